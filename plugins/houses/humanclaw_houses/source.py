"""From the argument of `house:` to a scene."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Final

import numpy as np

from humanclaw.errors import SceneError
from humanclaw.scene import Placement, Quaternion, Room, Scene, SceneObject
from humanclaw_houses.building import Placed, build, draw_finishes
from humanclaw_houses.furnish import Kit, furnish, scatter
from humanclaw_houses.plan import Plan, draw_plan
from humanclaw_houses.space import Space
from humanclaw_houses.starting import choose_start
from humanclaw_houses.style import Style
from humanclaw_houses.validity import problems

VALIDATION_HOUSES: Final = 41
_DRAFTS: Final = 12
_MOVABLE: Final = 0.21
"""The share of the furniture that can be moved."""
_REMEDY: Final = "Ask for house:0 to house:40, or house:train-N for a training house with N from 0 on."


def house(argument: str) -> Scene:
    """The house that '0' to '40' or 'train-N' names. Raises SceneError for any other argument."""
    match = re.fullmatch(r"(train-)?(0|[1-9][0-9]{0,8})", argument)
    if not match or (not match[1] and int(match[2]) >= VALIDATION_HOUSES):
        raise SceneError(f"there is no house {argument!r}.", _REMEDY)
    return generate((1 if match[1] else 0, int(match[2])), f"house:{argument}")


def generate(seed: Sequence[int], name: str) -> Scene:
    """A house from a seed alone: the first of its drafts with which nothing is wrong. Raises SceneError if none is."""
    wrong: list[str] = []
    for draft in range(_DRAFTS):
        scene = _draft(np.random.default_rng([*seed, draft]), name)
        wrong = problems(scene)
        if not wrong:
            return scene
    raise SceneError(
        f"no usable house was found for {name}: {'; '.join(wrong)}.", "Take another index and report this one."
    )


def _draft(rng: np.random.Generator, name: str) -> Scene:
    plan, style = draw_plan(rng), Style.draw(rng)
    placed = list(build(plan, style, draw_finishes(plan, style)))
    spaces = _furnish(plan, style, rng)
    placed += [thing for space in spaces for thing in space.things]
    return _scene(name, plan, placed, spaces, rng)


def _furnish(plan: Plan, style: Style, rng: np.random.Generator) -> list[Space]:
    kit = Kit(style, rng, tuple(area.kind for area in plan.areas))
    spaces = [Space(area, plan) for area in plan.areas]
    for space in spaces:
        furnish(space, kit)
    things = [thing.piece for space in spaces for thing in space.things]
    movable = sum(piece.mass > 0 for piece in things)
    wanted = round((_MOVABLE * len(things) - movable) / (1 - _MOVABLE))
    scatter(spaces, kit, max(wanted, 0))
    return spaces


def _scene(name: str, plan: Plan, placed: Sequence[Placed], spaces: Sequence[Space], rng: np.random.Generator) -> Scene:
    assets = {thing.piece.asset.name: thing.piece.asset for thing in placed}
    objects = tuple(_object(number, thing) for number, thing in enumerate(placed, 1))
    rooms = tuple(Room(area.name, area.kind, *(round(v, 3) for v in area.inner)) for area in plan.areas)
    scene = Scene(name, assets, objects, rooms, Placement(0.0, 0.0, 0.0), {"generator": "humanclaw-houses"})
    return Scene(name, assets, objects, rooms, choose_start(scene, rng), scene.notes)


def _object(number: int, thing: Placed) -> SceneObject:
    piece = thing.piece
    position = tuple(round(float(v), 4) for v in (thing.x, thing.y, thing.z))
    return SceneObject(
        number, piece.asset.name, piece.asset.category, position, _quaternion(thing.yaw),  # type: ignore[arg-type]
        piece.mass > 0, piece.mass, piece.friction, thing.room,
    )  # fmt: skip


def _quaternion(yaw: float) -> Quaternion:
    return 0.0, round(float(np.sin(yaw / 2)), 6), 0.0, round(float(np.cos(yaw / 2)), 6)
