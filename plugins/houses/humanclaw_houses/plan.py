"""Floor plans: rooms about a hall or about the room that people live in, walls between, doors and windows in them; a
plan for each storey.

Rooms are rectangles on the middle lines of the walls; what has corners, such as a hall that turns, is several with
nothing between. A house has a Layout: a straight hall (with a living block across its end, or all rooms in two rows
along it), a hall that turns or ends in another, a row of rooms along a living room without a hall, or a studio. All are
mirrored and turned at random. A house of two storeys has a staircase in the same place of both, at one end of a row,
open to the hall.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final, Literal

import numpy as np

from humanclaw import SceneError

WALL: Final = 0.12
"""Thickness of every wall, metres."""
CEILING: Final = 2.5
DOOR_HEIGHT: Final = 2.05
OPEN_TOP: Final = 100.0
"""Top of an opening that reaches up to whatever is above."""
Axis = Literal["x", "z"]
PUBLIC: Final = frozenset({"living", "kitchen", "dining"})
"""Kinds of room that are joined by wide passages, or by nothing at all in an open plan."""


@dataclass(frozen=True)
class Layout:
    """What a house is like before any of its measures is drawn."""

    shape: Literal["straight", "l", "t", "strip", "studio"] = "straight"
    """Of the hall: straight, turning a corner, or ending across another; none in a strip, where rooms open from the
    living room; and a studio has an entrance alone."""
    open_plan: bool = False
    """No walls between the rooms of PUBLIC."""
    livings: int = 1
    storeys: int = 1

    @classmethod
    def draw(cls, rng: np.random.Generator, storeys: int) -> Layout:
        shapes: tuple[Literal["straight", "l", "t", "strip", "studio"], ...] = ("straight", "l", "t", "strip", "studio")
        shape = shapes[int(rng.choice(5, p=_SHAPES))] if storeys == 1 else "straight"
        open_plan = shape in ("strip", "studio") or bool(rng.random() < 0.4)
        large = shape not in ("strip", "studio")
        return cls(shape, open_plan, 2 if large and rng.random() < _TWO_LIVINGS else 1, storeys)

    @property
    def opened(self) -> frozenset[str]:
        """Kinds of room between two of which there is no wall."""
        if self.shape == "studio":
            return PUBLIC | {"bedroom", "hall"}
        return PUBLIC if self.open_plan else frozenset()


_SHAPES: Final = (0.28, 0.22, 0.18, 0.17, 0.15)
"""Shares of the shapes among houses of one storey."""
_TWO_LIVINGS: Final = 0.3


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
    kind: Literal["door", "front_door", "passage", "stairs", "open", "window"]
    """stairs, open: up to the ceiling and from wall to wall."""
    leaf: int = 0
    """The side of the hinge along the wall for a door with a leaf, -1 or 1; 0 for none."""
    opens_low: bool = False
    """The leaf stands open on the side of the smaller coordinate across the wall."""


@dataclass(frozen=True)
class Wall:
    """A straight wall on the line where the other coordinate is `line`. low, high: the rooms at its sides, empty
    outside."""

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
class Stair:
    """A staircase that goes up to a half-landing, turns round and comes back: twice `steps` risers in all. Metres."""

    riser: float
    going: float
    steps: int = 8
    """Risers of each of its two flights."""
    left: bool = True
    """The lower flight is on the left of somebody who looks at the stairs from the hall."""

    @property
    def rise(self) -> float:
        """From floor to floor."""
        return round(2 * self.steps * self.riser, 4)

    @classmethod
    def draw(cls, rng: np.random.Generator) -> Stair:
        riser = float(rng.choice([0.17, 0.175, 0.18]))
        return cls(riser, round(float(rng.uniform(0.26, 0.29)), 2), left=bool(rng.random() < 0.5))


@dataclass(frozen=True)
class FloorPlan:
    """One storey."""

    areas: tuple[Area, ...]
    walls: tuple[Wall, ...]
    floor: float = 0.0
    """Height of its floor, metres."""
    height: float = CEILING
    """From its floor to the top of its walls: the ceiling, or the next floor."""
    stair: Stair | None = None
    """The staircase in the area named stairs, if there is one: on the lower storey its body, on the upper one the
    hole."""


_SIZES: Final = {
    "living": (19.0, 27.0), "sitting": (14.0, 18.0), "kitchen": (10.0, 14.0), "dining": (11.0, 15.0),
    "bedroom": (11.5, 16.0), "kids": (10.0, 13.0), "bathroom": (5.5, 7.5), "office": (8.5, 11.5), "laundry": (5.0, 6.5),
}  # fmt: skip
_LEAST_WIDTH: Final = {"living": 4.0, "kitchen": 2.7, "dining": 2.9, "bathroom": 1.75, "laundry": 1.65, "office": 2.5}


STAIR_WIDTH: Final = 2.22
"""Of the place for the stairs, between the middle lines of its walls: two flights of a metre and what is between
them."""


def draw_plans(rng: np.random.Generator, layout: Layout) -> tuple[FloorPlan, ...]:
    """Return the storeys of a house from the lowest, with 4 to 12 rooms together.

    Raises SceneError if none was found, which no seed has yet done.
    """
    for _ in range(1200):
        plans = _one_storey(rng, layout) if layout.storeys == 1 else _two_storeys(rng, layout)
        if plans is not None:
            return plans
    raise SceneError("no floor plan was found for this seed.", "Take another index and report this one.")


def _one_storey(rng: np.random.Generator, layout: Layout) -> tuple[FloorPlan, ...] | None:
    rects = _SHAPED[layout.shape](rng, layout)
    if rects is None or len(rects) > 12:
        return None
    areas = _named(_turned([rects], rng)[0])
    walls = _with_windows(_with_doors(_walls(areas), areas, rng, opened=layout.opened), areas, rng)
    return None if walls is None else (FloorPlan(areas, tuple(walls)),)


def _two_storeys(rng: np.random.Generator, layout: Layout) -> tuple[FloorPlan, ...] | None:
    """Living downstairs, sleeping upstairs; the stairs at the near end of the first row."""
    stair, hall, block = Stair.draw(rng), float(rng.uniform(1.6, 1.95)), bool(rng.random() < 0.4)
    depths = float(rng.uniform(3.3, 3.75)), float(rng.uniform(3.4, 4.3))
    lower = _rows(_downstairs(rng, block), depths, rng, stairs=STAIR_WIDTH)
    if lower is None:
        return None
    length = sum(width for _, width in lower[0])
    tries = (_rows(_upstairs(rng, layout), depths, rng, stairs=STAIR_WIDTH, length=length) for _ in range(30))
    upper = next((rows for rows in tries if rows), None)
    if upper is None:
        return None
    rects = [_lay_out(rows, depths, hall) for rows in (lower, upper)]
    if block:
        rects[0] += _living_block(lower, depths, hall, float(rng.uniform(4.4, 5.4)))
    ground, first = (_named(turned) for turned in _turned(rects, rng))
    if len(ground) + len(first) - 1 > 12:  # the stairs count once
        return None
    walls = [_with_windows(_with_doors(_walls(areas), areas, rng, upper, layout.opened), areas, rng, upper)
             for areas, upper in ((ground, False), (first, True))]  # fmt: skip
    if walls[0] is None or walls[1] is None:
        return None
    plan = FloorPlan(first, tuple(walls[1]), stair.rise, CEILING, stair)
    return FloorPlan(ground, tuple(walls[0]), 0.0, stair.rise, stair), _renamed(plan, {area.name for area in ground})


def _downstairs(rng: np.random.Generator, block: bool) -> list[str]:
    """Kinds of rooms on the ground floor of two, without the living block if that has its own place."""
    kinds = [] if block else ["living", "kitchen"]
    shares = {"bathroom": 0.6, "dining": 0.35, "office": 0.5, "laundry": 0.4, "bedroom": 0.25}
    return kinds + [kind for kind, share in shares.items() if rng.random() < share]


def _upstairs(rng: np.random.Generator, layout: Layout) -> list[str]:
    extra = ["bedroom", "kids", "kids", "office", "bathroom", "bedroom", "laundry"]
    sitting = ["living"] * (layout.livings - 1)
    return [
        *sitting,
        "bedroom",
        "bathroom",
        *(extra[k] for k in rng.permutation(len(extra))[: int(rng.integers(0, 6))]),
    ]


def _renamed(plan: FloorPlan, taken: set[str]) -> FloorPlan:
    """Return the upper storey with names that the lower one has not; its hall is the landing."""
    names = {"": "", "stairs": "stairs"}
    for area in plan.areas:
        number, stem = 1, "landing" if area.kind == "hall" else area.kind
        while area.name not in names:
            name = stem if number == 1 else f"{stem}_{number}"
            if name not in taken and name not in names.values():
                names[area.name] = name
            number += 1
    areas = tuple(
        replace(area, name=names[area.name], kind="landing" if area.kind == "hall" else area.kind)
        for area in plan.areas
    )
    walls = tuple(replace(wall, low=names[wall.low], high=names[wall.high]) for wall in plan.walls)
    return replace(plan, areas=areas, walls=walls)


def _programme(rng: np.random.Generator, layout: Layout) -> list[str]:
    """Kinds of rooms besides the hall, of a small flat up to a family house; one with two living rooms is large."""
    size = int(rng.integers(4)) if layout.livings == 1 else int(rng.integers(2, 4))
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
    return kinds + ["living"] * (layout.livings - 1)


Rect = tuple[str, float, float, float, float]


# -- shapes ------------------------------------------------------------------------------------------------------------
def _straight(rng: np.random.Generator, layout: Layout) -> list[Rect] | None:
    """Lay out a hall with rooms on both sides, and at times a living block across its end."""
    hall, depths = _hall(rng), (float(rng.uniform(3.3, 4.3)), float(rng.uniform(3.3, 4.3)))
    kinds = _programme(rng, layout)
    block = rng.random() < 0.5
    rows = _rows(_without(kinds, ("living", "kitchen")) if block else kinds, depths, rng)
    if rows is None:
        return None
    rects = _lay_out(rows, depths, hall)
    return rects + _living_block(rows, depths, hall, float(rng.uniform(4.4, 5.4))) if block else rects


def _crossed(rng: np.random.Generator, layout: Layout) -> list[Rect] | None:
    """Lay out a hall between two rows that turns a corner (l) or ends in the middle of another (t), and rooms along
    that."""
    hall, depths = _hall(rng), (float(rng.uniform(3.3, 4.1)), float(rng.uniform(3.3, 4.1)))
    kinds = _programme(rng, layout)
    beyond = hall if layout.shape == "l" else 0.0
    column = ["living", "kitchen", *(["dining"] if "dining" in kinds and rng.random() < 0.5 else [])]
    rows = _rows(_without(kinds, column), depths, rng, beyond=beyond)
    width, across = float(rng.uniform(3.9, 4.9)), depths[0] + hall + depths[1]
    along = _fitted([(kind, _width(kind, width, rng)) for kind in column], across)
    if rows is None or along is None or (along[0][1] < depths[0] + 1.4 and beyond):
        return None
    x = sum(w for _, w in rows[1])
    rects = _lay_out((rows[0], rows[1]), depths, hall, length=x)
    rects.append(("hall", x, depths[0] if beyond else 0.0, x + hall, across))
    return rects + _stacked(along, x + hall, x + hall + width)


def _strip(rng: np.random.Generator, layout: Layout) -> list[Rect] | None:
    """Lay out a row of rooms that open from the living and the dining room along it, and the kitchen across the end."""
    depth, row_depth = float(rng.uniform(4.2, 5.2)), float(rng.uniform(3.3, 4.2))
    kinds = _programme(rng, layout)
    rest = _without(kinds, ("living", "kitchen", "dining"))
    row = [(kind, _width(kind, row_depth, rng)) for kind in _grouped(rest, rng)]
    length = sum(width for _, width in row)
    living = _fitted([("living", _width("living", depth, rng))] + (
        [("dining", _width("dining", depth, rng))] if length > 7 else []), length)  # fmt: skip
    if living is None or len(row) < 2 or not 18 < depth * living[0][1] < 43:
        return None
    rects: list[Rect] = []
    for line, (z0, z1) in ((row, (0.0, row_depth)), (living, (row_depth, row_depth + depth))):
        x = 0.0
        for kind, width in line:
            rects.append((kind, x, z0, x + width, z1))
            x += width
    wide = float(rng.uniform(12.0, 16.0)) / depth
    return [*rects, ("kitchen", length, row_depth, length + wide, row_depth + depth)]


def _studio(rng: np.random.Generator, layout: Layout) -> list[Rect] | None:
    """Lay out one room to live, sleep and cook in, a bathroom, and an entrance between."""
    bath, hall, cook = float(rng.uniform(2.1, 2.6)), float(rng.uniform(1.75, 2.0)), float(rng.uniform(2.6, 3.2))
    near, far = float(rng.uniform(2.6, 2.9)), float(rng.uniform(3.8, 4.7))
    bed, length = max(2.75, bath + float(rng.uniform(0.1, 0.4))), bath + hall + cook
    return [
        ("bathroom", 0.0, 0.0, bath, near), ("hall", bath, 0.0, bath + hall, near),
        ("kitchen", bath + hall, 0.0, length, near),
        ("bedroom", 0.0, near, bed, near + far), ("living", bed, near, length, near + far),
    ]  # fmt: skip


_SHAPED: Final[dict[str, Callable[[np.random.Generator, Layout], list[Rect] | None]]] = {
    "straight": _straight, "l": _crossed, "t": _crossed, "strip": _strip, "studio": _studio,
}  # fmt: skip


def _hall(rng: np.random.Generator) -> float:
    """Width of a hall, metres."""
    return float(rng.uniform(1.6, 1.95))


def _without(kinds: list[str], taken: Sequence[str]) -> list[str]:
    """Return the kinds that are left when one of each of those taken is gone."""
    left = list(kinds)
    for kind in taken:
        if kind in left:
            left.remove(kind)
    return left


def _width(kind: str, depth: float, rng: np.random.Generator) -> float:
    """Draw what a room of a kind asks for along a row of some depth."""
    return max(float(rng.uniform(*_SIZES[kind])) / depth, _LEAST_WIDTH.get(kind, 2.8))


def _fitted(row: list[tuple[str, float]], length: float) -> list[tuple[str, float]] | None:
    """Return a row made so long; None if that would distort its rooms."""
    share = length / sum(width for _, width in row)
    fair = 0.8 < share < 1.3 and all(share * width >= 0.97 * _LEAST_WIDTH.get(kind, 2.8) for kind, width in row)
    return [(kind, width * share) for kind, width in row] if fair else None


def _stacked(column: list[tuple[str, float]], x0: float, x1: float) -> list[Rect]:
    rects, z = [], 0.0
    for kind, depth in column:
        rects.append((kind, x0, z, x1, z + depth))
        z += depth
    return rects


def _rows(
    kinds: list[str],
    depths: tuple[float, float],
    rng: np.random.Generator,
    stairs: float = 0.0,
    length: float | None = None,
    beyond: float = 0.0,
) -> tuple[list[tuple[str, float]], list[tuple[str, float]]] | None:
    """(kind, width) along each side of the hall, the two sides equally long; None if that would distort the rooms.

    stairs: width of the staircase at the head of the first row, 0 for none. length: of both rows; by default what the
    rooms ask for. beyond: by how much the first row is longer.
    """
    rows: tuple[list[tuple[str, float]], list[tuple[str, float]]] = ([("stairs", stairs)] if stairs else [], [])
    for number, kind in enumerate(_grouped(kinds, rng)):
        lengths = [sum(width for _, width in row) for row in rows]
        shortest = not rows[0] or kind not in ("kitchen", "dining")
        side = int(np.argmin(lengths)) if shortest else _side_of(rows, "living")
        width = float(rng.uniform(*_SIZES["sitting" if kind == "living" and number else kind])) / depths[side]
        rows[side].append((kind, max(width, _LEAST_WIDTH.get(kind, 2.8))))
    lengths = [sum(width for _, width in row) for row in rows]
    goal = (sum(lengths) - beyond) / 2 if length is None else length
    goals, fixed = (goal + beyond, goal), (stairs, 0.0)
    shares = [(to - own) / max(total - own, 1e-9) for to, total, own in zip(goals, lengths, fixed, strict=True)]
    if not all(0.87 < share < 1.22 for share in shares):
        return None
    scaled = tuple(
        [(kind, width if kind == "stairs" else width * share) for kind, width in row]
        for row, share in zip(rows, shares, strict=True)
    )
    fair = all(width >= 0.97 * _LEAST_WIDTH.get(kind, 2.8) for row in scaled for kind, width in row if kind != "stairs")
    return scaled if fair else None  # type: ignore[return-value]


def _grouped(kinds: list[str], rng: np.random.Generator) -> list[str]:
    """Living, dining and kitchen first and together, the rest shuffled."""
    public = [kind for kind in ("living", "dining", "kitchen") if kind in kinds]
    private = _without(kinds, public)
    return public + [private[k] for k in rng.permutation(len(private))]


def _side_of(rows: tuple[list[tuple[str, float]], ...], kind: str) -> int:
    return next((side for side, row in enumerate(rows) if any(name == kind for name, _ in row)), 0)


def _lay_out(
    rows: tuple[list[tuple[str, float]], list[tuple[str, float]]],
    depths: tuple[float, float],
    hall: float,
    length: float | None = None,
) -> list[Rect]:
    """Lay out the hall along x between two rows of rooms; length: of the hall, by default of the first row."""
    length = sum(width for _, width in rows[0]) if length is None else length
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


def _turned(storeys: list[list[Rect]], rng: np.random.Generator) -> list[list[Rect]]:
    """Round to the centimetre, mirror and turn at random, all storeys alike."""
    flip_x, flip_z, swap = (bool(v) for v in rng.integers(0, 2, 3))
    far_x = max(x1 for rects in storeys for _, _, _, x1, _ in rects)
    far_z = max(z1 for rects in storeys for _, _, _, _, z1 in rects)
    result: list[list[Rect]] = []
    for rects in storeys:
        result.append([])
        for kind, x0, z0, x1, z1 in rects:
            if flip_x:
                x0, x1 = far_x - x1, far_x - x0
            if flip_z:
                z0, z1 = far_z - z1, far_z - z0
            if swap:
                x0, z0, x1, z1 = z0, x0, z1, x1
            result[-1].append((kind, round(x0, 2), round(z0, 2), round(x1, 2), round(z1, 2)))
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
    """Return the name of the room around a point; empty outside."""
    return next((a.name for a in areas if a.x0 < x < a.x1 and a.z0 < z < a.z1), "")


def _walls(areas: tuple[Area, ...]) -> list[Wall]:
    """Return a wall wherever the rooms on the two sides of a line differ, cut where they change."""
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
def _with_doors(
    walls: list[Wall],
    areas: tuple[Area, ...],
    rng: np.random.Generator,
    upper: bool = False,
    opened: frozenset[str] = frozenset(),
) -> list[Wall] | None:
    """Doors from the hall to every room, wide passages to the living room or nothing between, the stairs open to the
    hall, and on the ground floor the front door at an outer end of the hall. Without a hall, the rooms open from the
    living and the dining room. opened: kinds of room between two of which there is no wall."""
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
        elif names & hubs and "" not in names and (names - hubs).isdisjoint(linked) and length > 1.3:
            linked |= names
            walls[index] = replace(wall, openings=(_door(wall, hubs, kind, rng),))
        elif kinds <= PUBLIC and len(kinds) == 2 and length > 2.2:
            width = round(float(rng.uniform(1.2, 1.7)), 2)
            at = round((wall.start + wall.end) / 2 + float(rng.uniform(-0.3, 0.3)), 2)
            walls[index] = replace(wall, openings=(Opening(at, width, 0.0, 2.15, "passage"),))
    if not linked >= {area.name for area in areas if area.kind not in opened | {"kitchen"}}:
        return None
    if not _joined(walls, areas, hubs):
        return None
    return walls if upper else _front_door(walls, hubs, rng)


def _hubs(areas: tuple[Area, ...]) -> set[str]:
    """Names of the areas that the other rooms open from."""
    halls = {area.name for area in areas if area.kind == "hall"}
    return halls or {area.name for area in areas if area.name in ("living", "dining")}


def _opened(wall: Wall, kind: Literal["stairs", "open"]) -> Wall:
    """Return a wall of which nothing is left but the thickness of those that it meets."""
    middle, width = round((wall.start + wall.end) / 2, 3), round(wall.end - wall.start - WALL, 3)
    return replace(wall, openings=(Opening(middle, width, 0.0, OPEN_TOP, kind),))


def _door(wall: Wall, hubs: set[str], kind: dict[str, str], rng: np.random.Generator) -> Opening:
    """Return a door near a corner of the room, its leaf standing open along the side wall; a wide one without to the
    living room."""
    into = wall.high if wall.low in hubs else wall.low
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


def _joined(walls: list[Wall], areas: tuple[Area, ...], hubs: set[str]) -> bool:
    """Every room can be walked to."""
    reached, grown = {min(hubs)}, True
    while grown:
        before = len(reached)
        for wall in walls:
            if wall.openings and {wall.low, wall.high} & reached:
                reached |= {wall.low, wall.high}
        grown = len(reached) > before
    return reached == {area.name for area in areas}


def _front_door(walls: list[Wall], hubs: set[str], rng: np.random.Generator) -> list[Wall] | None:
    """In one of the shortest walls that lead out; the long ones are for windows."""
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
    door = Opening(round((wall.start + wall.end) / 2, 2), 0.95, 0.0, DOOR_HEIGHT, "front_door")
    walls[index] = replace(wall, openings=(door,))
    return walls


# -- windows -----------------------------------------------------------------------------------------------------------
def _with_windows(
    walls: list[Wall] | None, areas: tuple[Area, ...], rng: np.random.Generator, upper: bool = False
) -> list[Wall] | None:
    """Windows in the outer walls: small and high ones where people wash, large ones where they live; above the stairs
    only. Of the outer walls of a living room the shortest has none: a television stands there."""
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
    """Return the shortest outer wall without a door of each living room that has two or more."""
    outer: dict[str, list[tuple[float, int]]] = {}
    for number, wall in enumerate(walls):
        inside = wall.low or wall.high
        if "" in (wall.low, wall.high) and kind[inside] == "living" and not wall.openings:
            outer.setdefault(inside, []).append((wall.end - wall.start, number))
    return {min(found)[1] for found in outer.values() if len(found) > 1}


def _windows(wall: Wall, kind: str, rng: np.random.Generator) -> tuple[Opening, ...]:
    length = wall.end - wall.start
    small = kind in ("bathroom", "laundry", "hall", "stairs")
    width = 0.6 if small else round(float(rng.uniform(1.1, 1.7)), 2)
    if length < width + 0.9:
        return ()
    bottom = 1.35 if small else 0.95 if kind in ("kitchen", "office", "kids", "bedroom") else 0.85
    count = 2 if kind in ("living", "dining") and length > 2 * width + 1.8 else 1
    middles = [wall.start + length * (k + 0.5) / count for k in range(count)]
    return tuple(Opening(round(at, 2), width, bottom, 2.05 if small else 2.15, "window") for at in middles)
