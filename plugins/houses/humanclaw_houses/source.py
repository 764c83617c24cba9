"""Generate the scene that the argument of `house:` names."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from humanclaw import Scene, SceneError
from humanclaw.body import Pose2D
from humanclaw.world import Quaternion, Room, SceneObject
from humanclaw_houses.building import Placed, build, draw_finishes
from humanclaw_houses.drafting import draw_plans
from humanclaw_houses.dressing import dress
from humanclaw_houses.furnish import furnish
from humanclaw_houses.furnishing_context import FurnishingContext
from humanclaw_houses.piece_builder import HingedPart
from humanclaw_houses.plan import Area, FloorPlan, Layout
from humanclaw_houses.reference import GENERATOR, seed_of
from humanclaw_houses.room_occupancy import RoomOccupancy, turn
from humanclaw_houses.scatter import scatter
from humanclaw_houses.starting import WalkableArea, choose_start
from humanclaw_houses.style import Style
from humanclaw_houses.validity import problems

_DRAFTS: Final = 12
"""Number of drafts that are tried for a house."""
_STOREYS: Final = 1_015
"""Added to the seed for the number of storeys, so that this draw is independent of the drafts."""
_LAYOUT: Final = 2_012
"""Added to the seed for the layout, for the same reason."""
_TWO_STOREYS: Final = 1 / 3
"""Share of houses with two storeys."""
_MOVABLE: Final = 0.21
"""Share of the furniture that is movable."""


def house(argument: str) -> Scene:
    """Generate house '0' to '40' or 'train-N', without the cache. Raises SceneError for any other argument."""
    return generate(seed_of(argument), f"house:{argument}")


def generate(seed: Sequence[int], name: str) -> Scene:
    """Generate a house from a seed alone: the first of its drafts without problems.

    Raises SceneError if all drafts have problems.
    """
    wrong: list[str] = []
    layout = layout_of(seed)
    for draft in range(_DRAFTS):
        rng = np.random.default_rng([*seed, draft])
        scene = _draft(rng, name, layout)
        walkable = WalkableArea.of(scene)
        scene = scene.starting(choose_start(walkable, rng))
        wrong = problems(scene, walkable)
        if not wrong:
            return scene
    raise SceneError(
        f"no usable house was found for {name}: {'; '.join(wrong)}.", "Use another index and report this one."
    )


def storeys_of(seed: Sequence[int]) -> int:
    """Return the number of storeys of a seed's house, 1 or 2."""
    return 2 if np.random.default_rng([*seed, _STOREYS]).random() < _TWO_STOREYS else 1


def layout_of(seed: Sequence[int]) -> Layout:
    """Draw the layout of a seed's house; it is the same for all its drafts."""
    return Layout.draw(np.random.default_rng([*seed, _LAYOUT]), storeys_of(seed))


def _draft(rng: np.random.Generator, name: str, layout: Layout) -> Scene:
    plans, style = draw_plans(rng, layout), Style.draw(rng)
    placed: list[Placed] = []
    for plan in plans:
        placed += _lifted(build(plan, style, draw_finishes(plan, style)), plan.floor)
    for space in _furnish(plans, style, rng):
        placed += _lifted(space.objects, space.floor)
    return _scene(name, plans, placed)


def _lifted(scene_objects: Iterable[Placed], floor: float) -> Iterator[Placed]:
    """Move the objects of a storey to their heights in the world."""
    return (replace(obj, y=obj.y + floor) for obj in scene_objects)


def _furnish(plans: Sequence[FloorPlan], style: Style, rng: np.random.Generator) -> list[RoomOccupancy]:
    areas = [(area, plan) for plan in plans for area in plan.areas]
    context = FurnishingContext(style, rng, tuple(area.kind for area, _ in areas))
    spaces = [RoomOccupancy(area, plan) for area, plan in areas if area.kind != "stairs" or plan.floor > 0]
    for space in spaces:
        furnish(space, context)
    scene_objects = [obj.piece for space in spaces for obj in space.objects]
    movable = sum(piece.mass > 0 for piece in scene_objects)
    # With n more small objects, (movable + n) / (all + n) is to be _MOVABLE: solved for n.
    wanted = round((_MOVABLE * len(scene_objects) - movable) / (1 - _MOVABLE))
    scatter([space for space in spaces if space.area.kind != "stairs"], context, max(wanted, 0))
    for space in spaces:
        dress(space, context)
    return spaces


def _scene(name: str, plans: Sequence[FloorPlan], placed: Sequence[Placed]) -> Scene:
    assets = {obj.piece.asset.name: obj.piece.asset for obj in placed}
    assets |= {leaf.piece.asset.name: leaf.piece.asset for obj in placed for leaf in obj.piece.hinged_parts}
    objects = objects_of(placed)
    rooms = tuple(
        _room(area, plan.floor) for plan in plans for area in plan.areas if area.kind != "stairs" or plan.floor == 0
    )
    return Scene(name, assets, objects, rooms, Pose2D(0.0, 0.0, 0.0), {"generator": f"humanclaw-houses {GENERATOR}"})


def objects_of(placed: Sequence[Placed]) -> tuple[SceneObject, ...]:
    """Return placed pieces as objects 1, 2, ..., followed by their doors and drawers."""
    hung = [(_hung(obj, leaf), leaf.state) for obj in placed for leaf in obj.piece.hinged_parts]
    leaves = (_object(number, obj).opened(state) for number, (obj, state) in enumerate(hung, len(placed) + 1))
    return *(_object(number, obj) for number, obj in enumerate(placed, 1)), *leaves


def _hung(body: Placed, leaf: HingedPart) -> Placed:
    """Return a door or drawer of a placed piece, closed."""
    x, y, z = turn(np.array([leaf.at]), body.yaw)[0].tolist()
    return Placed(leaf.piece, body.x + x, body.y + y, body.z + z, body.yaw, body.room, leaf.joint)


def _object(number: int, obj: Placed) -> SceneObject:
    piece = obj.piece
    position = tuple(round(float(v), 4) for v in (obj.x, obj.y, obj.z))
    return SceneObject(
        # position has three numbers.
        number, piece.asset.name, piece.asset.category, position, _quaternion(obj.yaw),  # type: ignore[arg-type]
        piece.mass > 0, piece.mass, piece.friction, obj.room, obj.joint, obj.state,
    )  # fmt: skip


def _quaternion(yaw: float) -> Quaternion:
    return 0.0, round(float(np.sin(yaw / 2)), 6), 0.0, round(float(np.cos(yaw / 2)), 6)


def _room(area: Area, floor: float) -> Room:
    x0, z0, x1, z1 = (round(v, 3) for v in area.inner)
    return Room(area.name, area.kind, x0, z0, x1, z1, floor)
