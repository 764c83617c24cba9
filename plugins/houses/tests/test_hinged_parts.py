"""Furniture that opens: nothing overlaps, leaves stay closed, and each opens as far as its joint goes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from humanclaw import Plugins, Scene
from humanclaw.body import Pose2D, rest_pose
from humanclaw.world import Hinge, SceneBuilder, SceneObject
from humanclaw_houses.building import Placed
from humanclaw_houses.furniture import kitchen, storage, tables
from humanclaw_houses.piece_builder import Piece
from humanclaw_houses.source import objects_of
from humanclaw_houses.style import Style
from humanclaw_houses.validity import interpenetrating, swung_through


def in_kitchen(make: Callable[..., Piece], *args: float) -> Callable[[Style, str], Piece]:
    return lambda style, name: make(style, name, kitchen.Fronts.draw(style), *args)


MAKERS: dict[str, tuple[Callable[[Style, str], Piece], int]] = {
    "fridge": (kitchen.fridge, 2), "dresser": (tables.dresser, 4), "nightstand": (tables.nightstand, 2),
    "wardrobe": (storage.wardrobe, 3), "stove": (kitchen.stove, 1), "dishwasher": (in_kitchen(kitchen.dishwasher), 1),
    "narrow counter": (in_kitchen(kitchen.counter, 0.5), 2), "wide counter": (in_kitchen(kitchen.counter, 0.9), 2),
    "sink": (in_kitchen(kitchen.sink), 2),
}  # fmt: skip


def room(maker: str) -> Scene:
    """One piece two metres before the body, its front towards it, on a floor of its own."""
    builder = SceneBuilder.on_floor()
    style = Style.draw(np.random.default_rng(3))
    piece = MAKERS[maker][0](style, maker)
    placed = objects_of([Placed(piece, 0.0, 0.0, 2.0, np.pi)])
    assets = {piece.asset.name: piece.asset} | {leaf.piece.asset.name: leaf.piece.asset for leaf in piece.hinged_parts}
    objects = (*builder.objects, *(replace(obj, id=obj.id + 1) for obj in placed))
    return Scene(maker, builder.assets | assets, objects, (), Pose2D(0.0, 0.0, 0.0))


def leaves(scene: Scene) -> list[SceneObject]:
    return [obj for obj in scene.objects if obj.joint]


@pytest.mark.parametrize("maker", MAKERS)
def test_doors_and_drawers_overlap_nothing_on_their_way(maker: str) -> None:
    scene = room(maker)
    assert len(leaves(scene)) == MAKERS[maker][1]
    assert not list(interpenetrating(scene))
    assert not list(swung_through(scene))


@pytest.mark.integration
@pytest.mark.parametrize("name", ["fridge", "dresser", "stove", "dishwasher"])
@pytest.mark.parametrize("share", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("engine", ["bullet", "mujoco"])
def test_doors_drawers_and_lids_stay_where_they_are(engine: str, share: float, name: str, plugins: Plugins) -> None:
    """Closed, half open and open: springs hold the lids of ovens and dishwashers."""
    if engine not in {offer.name for offer in plugins.registered("simulators")}:
        pytest.skip(f"{engine} is not installed")
    scene = room(name)
    wide = {leaf.id: max(leaf.joint.low, leaf.joint.high, key=abs) for leaf in leaves(scene) if leaf.joint}
    opened = tuple(obj.opened(share * wide[obj.id]) if obj.joint else obj for obj in scene.objects)
    scene = replace(scene, objects=opened)
    simulator = plugins.make("simulators", engine)
    simulator.reset(scene, scene.start)
    simulator.execute(rest_pose(15))
    states = simulator.state().objects
    simulator.close()
    for leaf in leaves(scene):
        assert states[leaf.id] == pytest.approx([*leaf.position, *leaf.rotation], abs=0.005)


def test_the_lid_of_an_oven_lies_level_when_it_is_open() -> None:
    scene = room("stove")
    (lid,) = leaves(scene)
    assert isinstance(lid.joint, Hinge)
    low, high = scene.aabb(lid.id, lid.at(lid.joint.high))
    assert high[1] - low[1] < 0.1
    assert low[2] < 2.0 - 0.29 - 0.65  # 0.29 m to its front, then 0.7 m towards the body
