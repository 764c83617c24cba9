"""Make the walls between areas, and their doors and windows."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Literal

import numpy as np

from humanclaw_houses.plan import DOOR_HEIGHT, OPEN_TOP, PUBLIC, WALL, Area, Axis, Wall, WallOpening, room_at


def walls_between(areas: tuple[Area, ...]) -> list[Wall]:
    """Return a wall wherever the rooms on the two sides of a line differ; walls are cut where the rooms change."""
    walls = []
    axes: tuple[Axis, Axis] = ("x", "z")
    for axis in axes:
        lines = sorted({v for a in areas for v in ((a.z0, a.z1) if axis == "x" else (a.x0, a.x1))})
        cuts = sorted({v for a in areas for v in ((a.x0, a.x1) if axis == "x" else (a.z0, a.z1))})
        for line in lines:
            walls += _along(areas, axis, line, cuts)
    return walls


def _along(areas: tuple[Area, ...], axis: Axis, line: float, cuts: list[float]) -> list[Wall]:
    walls: list[Wall] = []
    for start, end in pairwise(cuts):
        middle, eps = (start + end) / 2, 1e-3
        sides = [(middle, line + s * eps) if axis == "x" else (line + s * eps, middle) for s in (-1, 1)]
        low, high = (room_at(areas, *side) for side in sides)
        if low == high:
            continue
        last = walls[-1] if walls else None
        if last and last.end == start and (last.low, last.high) == (low, high):
            walls[-1] = replace(last, end=end)
        else:
            walls.append(Wall(axis, line, start, end, low, high))
    return walls


# -- doors -------------------------------------------------------------------------------------------------------------
def with_doors(
    walls: list[Wall],
    areas: tuple[Area, ...],
    rng: np.random.Generator,
    upper: bool = False,
    opened: frozenset[str] = frozenset(),
) -> list[Wall] | None:
    """Add doors to walls; None if a room cannot be reached or there is no place for the front door.

    Every room gets a door from the hall; without a hall, from the living or the dining room. The living room gets a
    wide passage or no wall at all. The stairs are open to the hall. The ground floor has the front door, at an outer
    end of the hall. opened: kinds of room without walls between them.
    """
    kind = {area.name: area.kind for area in areas} | {"": ""}
    hubs = _hubs(areas)
    walls, linked = list(walls), set(hubs)
    for index in rng.permutation(len(walls)):
        wall = walls[index]
        names, length = {wall.low, wall.high}, wall.end - wall.start
        kinds = {kind[wall.low], kind[wall.high]}
        if "stairs" in kinds and "hall" in kinds:
            linked |= names
            walls[index] = _opened(wall, "stairs")
        elif "" not in names and (names <= hubs or kinds <= opened) and length > 1.1:
            linked |= names
            walls[index] = _opened(wall, "open")
        # 1.3 m: a door of 0.9, its gap of 0.16 and half a wall at each end take 1.18.
        elif names & hubs and "" not in names and (names - hubs).isdisjoint(linked) and length > 1.3:
            linked |= names
            walls[index] = replace(wall, openings=(_door(wall, hubs, kind, rng),))
        elif kinds <= PUBLIC and len(kinds) == 2 and length > 2.2:
            width = round(float(rng.uniform(1.2, 1.7)), 2)
            at = round((wall.start + wall.end) / 2 + float(rng.uniform(-0.3, 0.3)), 2)
            walls[index] = replace(wall, openings=(WallOpening(at, width, 0.0, 2.15, "passage"),))
    if not linked >= {area.name for area in areas if area.kind not in opened | {"kitchen"}}:
        return None
    if not _joined(walls, areas, hubs):
        return None
    return walls if upper else _front_door(walls, hubs, rng)


def _hubs(areas: tuple[Area, ...]) -> set[str]:
    """Return the names of the areas from which the other rooms open."""
    halls = {area.name for area in areas if area.kind == "hall"}
    return halls or {area.name for area in areas if area.name in ("living", "dining")}


def _opened(wall: Wall, kind: Literal["stairs", "open"]) -> Wall:
    """Return a wall that is open except for the thickness of the walls that it meets."""
    middle, width = round((wall.start + wall.end) / 2, 3), round(wall.end - wall.start - WALL, 3)
    return replace(wall, openings=(WallOpening(middle, width, 0.0, OPEN_TOP, kind),))


def _door(wall: Wall, hubs: set[str], kind: dict[str, str], rng: np.random.Generator) -> WallOpening:
    """Return a door near a corner of the room, whose leaf opens along the side wall.

    Living room, kitchen and dining room get a wide passage without a leaf.
    """
    into = wall.high if wall.low in hubs else wall.low
    length = wall.end - wall.start
    if kind[into] in ("living", "kitchen", "dining"):
        width = round(min(float(rng.uniform(1.1, 1.6)), length - 0.5), 2)
        return WallOpening(round((wall.start + wall.end) / 2, 2), width, 0.0, 2.15, "passage")
    side = -1 if rng.random() < 0.5 else 1
    # As much as an open leaf takes beside the doorway (RoomOccupancy).
    width, gap = 0.9, 0.16
    edge = wall.start if side < 0 else wall.end
    at = round(edge - side * (WALL / 2 + gap + width / 2), 2)
    leaf = side if rng.random() < 0.75 else 0
    return WallOpening(at, width, 0.0, DOOR_HEIGHT, "door", leaf, opens_low=wall.low == into)


def _joined(walls: list[Wall], areas: tuple[Area, ...], hubs: set[str]) -> bool:
    """Return whether openings connect all rooms."""
    reached, grown = {min(hubs)}, True
    while grown:
        before = len(reached)
        for wall in walls:
            if wall.openings and {wall.low, wall.high} & reached:
                reached |= {wall.low, wall.high}
        grown = len(reached) > before
    return reached == {area.name for area in areas}


def _front_door(walls: list[Wall], hubs: set[str], rng: np.random.Generator) -> list[Wall] | None:
    """Put the front door in one of the shortest outer walls; the long ones are for windows."""
    outer = {
        number: round(wall.end - wall.start, 2)
        for number, wall in enumerate(walls)
        if "" in (wall.low, wall.high) and {wall.low, wall.high} & hubs and wall.end - wall.start > 1.3
    }
    if not outer:
        return None
    ends = [k for k, length in outer.items() if length < min(outer.values()) + 0.1]
    index = ends[int(rng.integers(len(ends)))]
    wall = walls[index]
    door = WallOpening(round((wall.start + wall.end) / 2, 2), 0.95, 0.0, DOOR_HEIGHT, "front_door")
    walls[index] = replace(wall, openings=(door,))
    return walls


# -- windows -----------------------------------------------------------------------------------------------------------
def with_windows(
    walls: list[Wall] | None, areas: tuple[Area, ...], rng: np.random.Generator, upper: bool = False
) -> list[Wall] | None:
    """Add windows to the outer walls: small and high ones in bathrooms and halls, large ones in other rooms.

    The shortest outer wall of a living room has none, because a television stands there. Stairs have windows only on
    the upper storey.
    """
    if walls is None:
        return None
    kind = {area.name: area.kind for area in areas}
    plain = _television_walls(walls, kind)
    result = []
    for number, wall in enumerate(walls):
        inside = wall.low or wall.high
        outer = "" in (wall.low, wall.high) and (upper or kind[inside] != "stairs") and number not in plain
        result.append(wall if not outer or wall.openings else replace(wall, openings=_windows(wall, kind[inside], rng)))
    return result


def _television_walls(walls: list[Wall], kind: dict[str, str]) -> set[int]:
    """Return the shortest outer wall without a door of each living room with two or more such walls."""
    outer: dict[str, list[tuple[float, int]]] = {}
    for number, wall in enumerate(walls):
        inside = wall.low or wall.high
        if "" in (wall.low, wall.high) and kind[inside] == "living" and not wall.openings:
            outer.setdefault(inside, []).append((wall.end - wall.start, number))
    return {min(candidates)[1] for candidates in outer.values() if len(candidates) > 1}


def _windows(wall: Wall, kind: str, rng: np.random.Generator) -> tuple[WallOpening, ...]:
    length = wall.end - wall.start
    small = kind in ("bathroom", "laundry", "hall", "stairs")
    width = 0.6 if small else round(float(rng.uniform(1.1, 1.7)), 2)
    if length < width + 0.9:
        return ()
    bottom = 1.35 if small else 0.95 if kind in ("kitchen", "office", "kids", "bedroom") else 0.85
    count = 2 if kind in ("living", "dining") and length > 2 * width + 1.8 else 1
    middles = [wall.start + length * (k + 0.5) / count for k in range(count)]
    return tuple(WallOpening(round(at, 2), width, bottom, 2.05 if small else 2.15, "window") for at in middles)
