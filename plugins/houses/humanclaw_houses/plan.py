"""Floor plans: a hall with rooms on both sides, walls between, doors and windows in them.

Rooms are rectangles on the middle lines of the walls. Two kinds of house: a living block across the end of the hall, or all rooms
in two rows along it; both are mirrored and turned at random.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final, Literal

import numpy as np

from humanclaw.errors import SceneError

WALL: Final = 0.12
"""Thickness of every wall, metres."""
CEILING: Final = 2.5
DOOR_HEIGHT: Final = 2.05
Axis = Literal["x", "z"]


@dataclass(frozen=True)
class Area:
    """A room between the middle lines of its walls."""

    name: str
    kind: str
    x0: float
    z0: float
    x1: float
    z1: float

    @property
    def inner(self) -> tuple[float, float, float, float]:
        """x0, z0, x1, z1 between the faces of the walls."""
        h = WALL / 2
        return self.x0 + h, self.z0 + h, self.x1 - h, self.z1 - h


@dataclass(frozen=True)
class Opening:
    """A hole in a wall: a doorway (bottom 0) or a window. at: its middle along the wall."""

    at: float
    width: float
    bottom: float
    top: float
    kind: Literal["door", "front_door", "passage", "window"]
    leaf: int = 0
    """The side of the hinge along the wall for a door with a leaf, -1 or 1; 0 for none."""
    opens_low: bool = False
    """The leaf stands open on the side of the smaller coordinate across the wall."""


@dataclass(frozen=True)
class Wall:
    """A straight wall on the line where the other coordinate is `line`. low, high: the rooms at its sides, empty outside."""

    axis: Axis
    line: float
    start: float
    end: float
    low: str
    high: str
    openings: tuple[Opening, ...] = ()

    def point(self, along: float, across: float = 0.0) -> tuple[float, float]:
        """World (x, z) of a point along the wall."""
        return (along, self.line + across) if self.axis == "x" else (self.line + across, along)


@dataclass(frozen=True)
class Plan:
    areas: tuple[Area, ...]
    walls: tuple[Wall, ...]

    def area(self, name: str) -> Area:
        return next(area for area in self.areas if area.name == name)


_SIZES: Final = {
    "living": (19.0, 27.0), "kitchen": (10.0, 14.0), "dining": (11.0, 15.0), "bedroom": (11.5, 16.0), "kids": (10.0, 13.0),
    "bathroom": (5.5, 7.5), "office": (8.5, 11.5), "laundry": (5.0, 6.5),
}  # fmt: skip
_LEAST_WIDTH: Final = {"living": 4.0, "kitchen": 2.7, "dining": 2.9, "bathroom": 1.75, "laundry": 1.65, "office": 2.5}


def draw_plan(rng: np.random.Generator) -> Plan:
    """A plan with 5 to 12 rooms. Raises SceneError if none was found, which no seed has yet done."""
    for _ in range(400):
        areas = _draw_areas(rng)
        if areas is None:
            continue
        walls = _with_windows(_with_doors(_walls(areas), areas, rng), areas, rng)
        if walls is not None:
            return Plan(areas, tuple(walls))
    raise SceneError("no floor plan was found for this seed.", "Take another index and report this one.")


def _programme(rng: np.random.Generator) -> list[str]:
    """Kinds of rooms besides the hall, of a small flat up to a family house."""
    size = int(rng.integers(4))
    kinds = ["living", "kitchen", "bedroom", "bathroom"]
    if size >= 1:
        kinds += [str(rng.choice(["kids", "office", "bedroom"]))]
    if size >= 2:
        kinds += ["bedroom" if rng.random() < 0.5 else "kids", str(rng.choice(["bathroom", "laundry", "office"]))]
    if size >= 3:
        kinds += (
            ["dining", "bathroom"]
            + (["office"] if rng.random() < 0.6 else [])
            + (["laundry"] if rng.random() < 0.5 else [])
        )
    return kinds


def _draw_areas(rng: np.random.Generator) -> tuple[Area, ...] | None:
    hall = float(rng.uniform(1.6, 1.95))
    depths = float(rng.uniform(3.3, 4.3)), float(rng.uniform(3.3, 4.3))
    kinds = _programme(rng)
    block = rng.random() < 0.5
    if block:
        kinds = [kind for kind in kinds if kind not in ("living", "kitchen")]
    rows = _rows(kinds, depths, rng)
    if rows is None:
        return None
    rects = _lay_out(rows, depths, hall)
    if block:
        rects += _living_block(rows, depths, hall, float(rng.uniform(4.4, 5.4)))
    return _named(_turned(rects, rng))


Rect = tuple[str, float, float, float, float]


def _rows(
    kinds: list[str], depths: tuple[float, float], rng: np.random.Generator
) -> tuple[list[tuple[str, float]], list[tuple[str, float]]] | None:
    """(kind, width) along each side of the hall, the two sides equally long; None if that would distort the rooms."""
    rows: tuple[list[tuple[str, float]], list[tuple[str, float]]] = ([], [])
    for kind in _grouped(kinds, rng):
        lengths = [sum(width for _, width in row) for row in rows]
        side = int(np.argmin(lengths)) if not rows[0] or kind not in ("kitchen", "dining") else _side_of(rows, "living")
        width = float(rng.uniform(*_SIZES[kind])) / depths[side]
        rows[side].append((kind, max(width, _LEAST_WIDTH.get(kind, 2.8))))
    lengths = [sum(width for _, width in row) for row in rows]
    goal = sum(lengths) / 2
    if not all(rows) or not all(0.87 < goal / length < 1.22 for length in lengths):
        return None
    scaled = tuple(
        [(kind, width * goal / length) for kind, width in row] for row, length in zip(rows, lengths, strict=True)
    )
    fair = all(width >= 0.97 * _LEAST_WIDTH.get(kind, 2.8) for row in scaled for kind, width in row)
    return scaled if fair else None  # type: ignore[return-value]


def _grouped(kinds: list[str], rng: np.random.Generator) -> list[str]:
    """Living, dining and kitchen first and together, the rest shuffled."""
    public = [kind for kind in ("living", "dining", "kitchen") if kind in kinds]
    private = [kind for kind in kinds if kind not in public]
    return public + [private[k] for k in rng.permutation(len(private))]


def _side_of(rows: tuple[list[tuple[str, float]], ...], kind: str) -> int:
    return next((side for side, row in enumerate(rows) if any(name == kind for name, _ in row)), 0)


def _lay_out(
    rows: tuple[list[tuple[str, float]], list[tuple[str, float]]], depths: tuple[float, float], hall: float
) -> list[Rect]:
    """The hall along x between two rows of rooms."""
    length = sum(width for _, width in rows[0])
    rects: list[Rect] = [("hall", 0.0, depths[0], length, depths[0] + hall)]
    for row, z0, z1 in ((rows[0], 0.0, depths[0]), (rows[1], depths[0] + hall, depths[0] + hall + depths[1])):
        x = 0.0
        for kind, width in row:
            rects.append((kind, x, z0, x + width, z1))
            x += width
    return rects


def _living_block(
    rows: tuple[list[tuple[str, float]], list[tuple[str, float]]],
    depths: tuple[float, float],
    hall: float,
    width: float,
) -> list[Rect]:
    """Living room and kitchen across the far end of the hall."""
    x, split = sum(w for _, w in rows[0]), depths[0] + hall
    return [("living", x, 0.0, x + width, split), ("kitchen", x, split, x + width, split + depths[1])]


def _turned(rects: list[Rect], rng: np.random.Generator) -> list[Rect]:
    """Rounded to the centimetre, mirrored and turned at random."""
    flip_x, flip_z, swap = (bool(v) for v in rng.integers(0, 2, 3))
    far_x, far_z = max(r[3] for r in rects), max(r[4] for r in rects)
    result = []
    for kind, x0, z0, x1, z1 in rects:
        if flip_x:
            x0, x1 = far_x - x1, far_x - x0
        if flip_z:
            z0, z1 = far_z - z1, far_z - z0
        if swap:
            x0, z0, x1, z1 = z0, x0, z1, x1
        result.append((kind, round(x0, 2), round(z0, 2), round(x1, 2), round(z1, 2)))
    return result


def _named(rects: list[Rect]) -> tuple[Area, ...]:
    seen: dict[str, int] = {}
    areas = []
    for kind, *corners in rects:
        seen[kind] = seen.get(kind, 0) + 1
        areas.append(Area(kind if seen[kind] == 1 else f"{kind}_{seen[kind]}", kind, *corners))
    return tuple(areas)


# -- walls -------------------------------------------------------------------------------------------------------------
def room_at(areas: tuple[Area, ...], x: float, z: float) -> str:
    """The name of the room around a point; empty outside."""
    return next((a.name for a in areas if a.x0 < x < a.x1 and a.z0 < z < a.z1), "")


def _walls(areas: tuple[Area, ...]) -> list[Wall]:
    """A wall wherever the rooms on the two sides of a line differ, cut where they change."""
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
def _with_doors(walls: list[Wall], areas: tuple[Area, ...], rng: np.random.Generator) -> list[Wall] | None:
    """Doors from the hall to every room (a second bathroom may open from a bedroom), wide passages to the living room, and
    the front door at an outer end of the hall."""
    kind = {area.name: area.kind for area in areas} | {"": ""}
    walls = list(walls)
    linked = {"hall"}
    for index in rng.permutation(len(walls)):
        wall = walls[index]
        names, length = {wall.low, wall.high}, wall.end - wall.start
        kinds = {kind[wall.low], kind[wall.high]}
        if "hall" in names and "" not in names and (names - {"hall"}).isdisjoint(linked) and length > 1.3:
            linked |= names
            walls[index] = replace(wall, openings=(_door(wall, kind, rng),))
        elif kinds in ({"living", "kitchen"}, {"living", "dining"}, {"kitchen", "dining"}) and length > 2.2:
            width = round(float(rng.uniform(1.2, 1.7)), 2)
            at = round((wall.start + wall.end) / 2 + float(rng.uniform(-0.3, 0.3)), 2)
            walls[index] = replace(wall, openings=(Opening(at, width, 0.0, 2.15, "passage"),))
    if not linked >= {area.name for area in areas if area.kind != "kitchen"}:
        return None
    if not _joined(walls, areas):
        return None
    return _front_door(walls, rng)


def _door(wall: Wall, kind: dict[str, str], rng: np.random.Generator) -> Opening:
    """A door near a corner of the room, its leaf standing open along the side wall; a wide one without to the living room."""
    into = wall.high if wall.low == "hall" else wall.low
    length = wall.end - wall.start
    if kind[into] in ("living", "kitchen", "dining"):
        width = round(min(float(rng.uniform(1.1, 1.6)), length - 0.5), 2)
        return Opening(round((wall.start + wall.end) / 2, 2), width, 0.0, 2.15, "passage")
    side = -1 if rng.random() < 0.5 else 1
    width, gap = 0.9, 0.16
    edge = wall.start if side < 0 else wall.end
    at = round(edge - side * (WALL / 2 + gap + width / 2), 2)
    leaf = side if rng.random() < 0.75 else 0
    return Opening(at, width, 0.0, DOOR_HEIGHT, "door", leaf, opens_low=wall.low == into)


def _joined(walls: list[Wall], areas: tuple[Area, ...]) -> bool:
    """Every room can be walked to."""
    reached, grown = {"hall"}, True
    while grown:
        before = len(reached)
        for wall in walls:
            if wall.openings and {wall.low, wall.high} & reached:
                reached |= {wall.low, wall.high}
        grown = len(reached) > before
    return reached == {area.name for area in areas}


def _front_door(walls: list[Wall], rng: np.random.Generator) -> list[Wall] | None:
    ends = [k for k, wall in enumerate(walls) if {wall.low, wall.high} == {"hall", ""} and wall.end - wall.start > 1.3]
    if not ends:
        return None
    index = ends[int(rng.integers(len(ends)))]
    wall = walls[index]
    door = Opening(round((wall.start + wall.end) / 2, 2), 0.95, 0.0, DOOR_HEIGHT, "front_door")
    walls[index] = replace(wall, openings=(door,))
    return walls


# -- windows -----------------------------------------------------------------------------------------------------------
def _with_windows(walls: list[Wall] | None, areas: tuple[Area, ...], rng: np.random.Generator) -> list[Wall] | None:
    """Windows in the outer walls: small and high ones where people wash, large ones where they live."""
    if walls is None:
        return None
    kind = {area.name: area.kind for area in areas}
    result = []
    for wall in walls:
        inside = wall.low or wall.high
        outer = "" in (wall.low, wall.high)
        result.append(wall if not outer or wall.openings else replace(wall, openings=_windows(wall, kind[inside], rng)))
    return result


def _windows(wall: Wall, kind: str, rng: np.random.Generator) -> tuple[Opening, ...]:
    length = wall.end - wall.start
    small = kind in ("bathroom", "laundry", "hall")
    width = 0.6 if small else round(float(rng.uniform(1.1, 1.7)), 2)
    if length < width + 0.9:
        return ()
    bottom = 1.35 if small else 0.95 if kind in ("kitchen", "office", "kids", "bedroom") else 0.85
    count = 2 if kind in ("living", "dining") and length > 2 * width + 1.8 else 1
    middles = [wall.start + length * (k + 0.5) / count for k in range(count)]
    return tuple(Opening(round(at, 2), width, bottom, 2.05 if small else 2.15, "window") for at in middles)
