"""Tests of the seeing agent: perception from its views, and tasks without map and pose."""

from __future__ import annotations

import numpy as np
import pytest
from rooms import two_rooms
from scipy.spatial import cKDTree
from walker import PICTURE, SKILLS, Walker

from humanclaw import Agent, Call, EpisodeContext, EpisodeSpec, HistoryEntry, HumanclawError, Observation, Plugins
from humanclaw.body import Pose2D, rest_pose
from humanclaw.records import Feedback
from humanclaw.world import DEFAULT_GAZE, GAZES, View, distance_to_box, ego_camera
from humanclaw_scripted.baselines import WanderingAgent
from humanclaw_scripted.depth_mapping import SeenMap, Sight, aligned, edges, gap_to, moved, placed

GAZE = GAZES[DEFAULT_GAZE]
WALL = 3.0
"""Distance of a wall across the way from the eyes, metres."""


def seeing() -> Agent:
    return Plugins.discover().make("agents", "seeing", {})


def before_a_wall() -> View:
    """Return a view of a level floor and a wall: each pixel's ray meets the nearer of the two."""
    size, eye = 512, float(ego_camera(rest_pose()).position[1])
    up = 1 - 2 * (np.arange(size) + 0.5) / size
    rise = np.sin(GAZE.pitch) + up * np.cos(GAZE.pitch)
    ahead = np.cos(GAZE.pitch) - up * np.sin(GAZE.pitch)
    with np.errstate(divide="ignore"):
        floor = np.where(rise < 0, -eye / rise, np.inf)
    depth = np.minimum(floor, WALL / ahead)
    ids = np.where(floor < WALL / ahead, 1, 2)
    rows = [np.repeat(column[:, None], size, 1) for column in (depth, ids)]
    return View(np.zeros((size, size, 3), np.uint8), rows[0].astype(np.float32), rows[1].astype(np.int32))


def sight_of(view: View) -> Sight:
    """Return the view as points, with the wall as target."""
    return Sight.of(view, (2,), GAZE)


def test_depth_becomes_points_on_the_floor_and_on_the_wall() -> None:
    sight = sight_of(before_a_wall())
    offset = float(ego_camera(rest_pose()).position[2])
    assert np.abs(sight.points[~sight.mine][:, 1]).max() < 1e-3
    assert sight.points[sight.mine][:, 2] == pytest.approx(WALL + offset, abs=1e-3)
    assert sight.obstacles()[:, 1] == pytest.approx(WALL + offset, abs=0.03)


def test_the_map_knows_the_floor_up_to_the_wall_and_nothing_behind_it() -> None:
    seen = SeenMap.empty()
    seen.add(sight_of(before_a_wall()), Pose2D())
    grid = seen.grid()
    at = lambda values, x, z: values[tuple(grid.cell(np.array([x, z])))]  # noqa: E731
    assert at(np.isfinite(grid.ground), 0.0, 2.0)
    assert at(grid.blocked, 0.5, 3.12)
    assert not at(grid.blocked, 0.5, 2.5)
    assert float(at(gap_to(seen.heights(grid) > 0), 0.0, 2.1)) == pytest.approx(1.0, abs=0.06)
    # The floor ends out of view to both sides, never at the wall.
    ends = np.concatenate(edges(grid))
    assert (ends[:, 1] < 3.0).all()
    assert {-1.0, 1.0} <= set(np.sign(ends[:, 0]))


def test_a_view_of_a_corner_tells_how_far_the_body_really_went() -> None:
    rng = np.random.default_rng(0)
    corner = np.concatenate([np.stack([np.linspace(-2, 2, 200), np.full(200, 3.0)], -1),
                             np.stack([np.full(200, 2.0), np.linspace(-1, 3, 200)], -1)])  # fmt: skip
    truth, asked = Pose2D(0.05, 0.31, 0.1), moved(Pose2D(), 0.0, 0.4, 0.15)
    away = corner - [truth.x, truth.z]
    local = np.linalg.solve(placed(Pose2D(0, 0, truth.yaw), np.eye(2)).T, away.T).T + rng.normal(0, 0.01, away.shape)
    place, left = aligned(local, cKDTree(corner), asked)
    assert (place.x, place.z, place.yaw) == pytest.approx((truth.x, truth.z, truth.yaw), abs=0.02)
    assert left < 0.02


def test_it_needs_its_view_and_nothing_else() -> None:
    spec = EpisodeSpec(id="x", instruction="Find a tv.", scene="test:rooms", target_category="tv", target_ids=(21,))
    with pytest.raises(HumanclawError, match="needs its view"):
        seeing().begin(EpisodeContext(spec, SKILLS, 0))


@pytest.mark.integration
def test_it_finds_a_seat_in_another_room_without_map_or_pose(plugins: Plugins) -> None:
    walker, renderer = Walker(two_rooms(), (20,), 0), plugins.make("renderers", "raster")
    renderer.load(walker.scene)
    look = lambda: renderer.render(walker.state(), ego_camera(walker.state().body))  # noqa: E731
    spec = EpisodeSpec(
        id="x", instruction="Find a seat.", scene="test:rooms", target_category="couch", target_ids=(20,), interact=True
    )
    agent, history = seeing(), []
    agent.begin(EpisodeContext(spec, SKILLS, 0, view=look))
    for step in range(60):
        decision = agent.decide(Observation(step, spec.instruction, PICTURE), history)
        call = Call(decision.calls[0].skill, SKILLS[decision.calls[0].skill].check(decision.calls[0].params))
        walker.execute(call)
        history.append(HistoryEntry(step, decision, Feedback(call), PICTURE))
        if call.skill == "stop":
            break
    assert call.skill == "stop"
    assert walker.sat
    assert distance_to_box(walker.state().body.joints()[-1], *walker.scene.aabb(20)).min() < 0.2
    assert "A couch is in view" in " ".join(past.decision.visible_state for past in history)


def test_who_wanders_never_stops_and_claims_nothing() -> None:
    agent = WanderingAgent()
    spec = EpisodeSpec(id="x", instruction="Find a tv.", scene="test:rooms", target_category="tv", target_ids=(21,))
    agent.begin(EpisodeContext(spec, SKILLS, 3))
    said = [agent.decide(Observation(step, "Find a tv.", PICTURE), ()) for step in range(100)]
    roles = {SKILLS[decision.calls[0].skill].role for decision in said}
    assert roles == {"locomotion"}
    assert len({str(decision.calls[0]) for decision in said}) > 50
    assert not any(decision.visible_state for decision in said)
