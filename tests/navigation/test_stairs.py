"""Stairs in half-physics: a body goes up and down those of a generated house, by the skills that a model would call."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from humanclaw import Body, Plugins
from humanclaw.body import Pose2D
from humanclaw.plugins import EpisodeContext, HistoryEntry, Observation
from humanclaw.records import EpisodeSpec, Feedback
from humanclaw.skills import check_call
from humanclaw.world import DistanceField, MultiFloorMap, Scene, distance_to_box, goals_at
from humanclaw_scripted.oracle import OracleAgent

pytestmark = pytest.mark.integration
HOUSE = "house:3"
NOTHING = np.zeros((2, 2, 3), np.uint8)


@pytest.fixture(scope="module")
def body(plugins: Plugins) -> Iterator[Body]:
    with Body(HOUSE, plugins=plugins) as made:
        yield made


def go(body: Body, start: Pose2D, target: int) -> list[str]:
    """Names of the skills that the oracle calls from a start until it stops at a target. No pictures are drawn."""
    body.reset(body.scene, start, seed=1)
    category = body.scene.by_id[target].category
    spec = EpisodeSpec(id="x", instruction="x", scene=HOUSE, target_category=category, target_ids=(target,))
    oracle, history = OracleAgent(), list[HistoryEntry]()
    oracle.begin(EpisodeContext(spec, body.skills, 1, body.scene, body.state))
    for step in range(60):
        decision = oracle.decide(Observation(step, "x", NOTHING), history)
        call = check_call(decision.calls[0], body.skills)
        body.execute(call)
        history.append(HistoryEntry(step, decision, Feedback(call), NOTHING))
        if call.skill == "stop":
            break
    return [past.executed.skill for past in history if past.executed]


def near_stairs(scene: Scene, upper: bool) -> Pose2D:
    """The roomiest place within two metres of the stairs, on the floor below or above."""
    start = np.array([scene.start.x, 0.0, scene.start.z])
    places = MultiFloorMap.of(scene).solid().starts(start, room=0.45)[upper]
    (stairs,) = scene.of_category("stairs")
    x, y, z = places[int(np.argmin(np.abs(np.linalg.norm((places - stairs.position)[:, [0, 2]], axis=1) - 2.8)))]
    return Pose2D(float(x), float(z), 0.0, float(y))


def nearest(scene: Scene, place: Pose2D, upper: bool) -> int:
    """Id of the chair, plant or bed with the shortest way, on one storey."""
    storeys, here = MultiFloorMap.of(scene), np.array([place.x, place.floor, place.z])
    objects = [obj for kind in ("potted_plant", "chair", "bed") for obj in scene.of_category(kind)]
    there = [obj.id for obj in objects if (obj.position[1] > 2) == upper]
    return min(there, key=lambda key: DistanceField.of(storeys, goals_at(storeys, scene, key)).at(here))


def test_a_body_climbs_the_stairs_to_an_object_on_the_upper_floor(body: Body) -> None:
    start = near_stairs(body.scene, upper=False)
    target = nearest(body.scene, start, upper=True)
    skills = go(body, start, target)
    assert skills[-1] == "stop"
    assert skills.count("climb_upstairs") >= 16
    joints = body.state().body.joints()[-1]
    assert joints[:, 1].min() > 2.6
    assert distance_to_box(joints, *body.scene.aabb(target)).min() <= 0.2


def test_a_body_walks_down_the_stairs_to_an_object_on_the_lower_floor(body: Body) -> None:
    start = near_stairs(body.scene, upper=True)
    target = nearest(body.scene, start, upper=False)
    skills = go(body, start, target)
    assert skills[-1] == "stop"
    assert skills.count("walk_downstairs") >= 16
    joints = body.state().body.joints()[-1]
    assert joints[:, 1].min() < 0.2
    assert distance_to_box(joints, *body.scene.aabb(target)).min() <= 0.2


def test_a_map_of_places_that_never_come_again_is_not_kept(
    body: Body, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HUMANCLAW_CACHE", str(tmp_path))
    moved = {obj.id: np.array([*obj.position, *obj.rotation]) for obj in body.scene.objects if obj.movable}
    drawn = MultiFloorMap.of(body.scene, moved, keep=False)
    assert len(list(tmp_path.glob("maps/*"))) == 1, "the stairs, which know no free object"
    kept = MultiFloorMap.of(body.scene, moved)
    assert len(list(tmp_path.glob("maps/*"))) == 3
    assert_same(drawn, kept)


def test_a_map_from_the_cache_is_the_map_drawn_for_another_start(
    body: Body, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HUMANCLAW_CACHE", str(tmp_path))
    start = body.scene.start
    scenes = [replace(body.scene, start=replace(start, x=start.x + aside)) for aside in (0.0, 0.1)]
    assert scenes[0].digest != scenes[1].digest
    drawn, kept = map(MultiFloorMap.of, scenes)
    assert len(list(tmp_path.glob("maps/*"))) == 3, "two floors and their stairs"
    assert_same(drawn, kept)


def assert_same(drawn: MultiFloorMap, kept: MultiFloorMap) -> None:
    for grid, other in zip(drawn.grids, kept.grids, strict=True):
        for name in ("blocked", "movable", "owners", "tops", "ground", "cost"):
            np.testing.assert_array_equal(getattr(grid, name), getattr(other, name))
