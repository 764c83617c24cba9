"""The free space of a room while it is furnished: taken space, space to keep free, and whether it stays walkable.

A walking body is a disc of radius 0.28 m. Rooms are furnished for a radius of 0.32 m, so that the final check on a
different grid finds the ways too.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from functools import lru_cache
from typing import Any, Final, Literal, NamedTuple

import numpy as np
from scipy.ndimage import distance_transform_edt, label

from humanclaw_houses.building import Placed
from humanclaw_houses.piece_builder import Piece
from humanclaw_houses.plan import Area, FloorPlan, Wall, WallOpening
from humanclaw_houses.shapes import Array

Side = Literal["south", "north", "west", "east"]
SIDES: Final[tuple[Side, ...]] = ("south", "north", "west", "east")
YAW: Final = {"south": 0.0, "north": float(np.pi), "west": float(np.pi / 2), "east": float(-np.pi / 2)}
"""Heading of a piece whose back is at that wall, radians."""
CELL: Final = 0.05
"""Side of a cell of the walking grid, metres."""
BODY: Final = 0.32
"""Radius of the body for which rooms are furnished, metres."""
_POCKET: Final = 0.25
"""Largest area of free floor that may be cut off, square metres."""
REACH: Final = 0.42
"""Largest distance from the centre of a standing body to an object within reach, metres."""
_HEAD: Final = 1.9
"""Objects above this height are in nobody's way, metres."""


class Rect(NamedTuple):
    """A rectangle of floor, metres."""

    x0: float
    z0: float
    x1: float
    z1: float

    def meets(self, other: Rect, gap: float = 0.0) -> bool:
        return (
            self.x0 < other.x1 + gap
            and other.x0 < self.x1 + gap
            and self.z0 < other.z1 + gap
            and other.z0 < self.z1 + gap
        )

    def within(self, other: Rect) -> bool:
        return self.x0 >= other.x0 and self.z0 >= other.z0 and self.x1 <= other.x1 and self.z1 <= other.z1

    def grown(self, by: float) -> Rect:
        return Rect(self.x0 - by, self.z0 - by, self.x1 + by, self.z1 + by)

    @property
    def middle(self) -> tuple[float, float]:
        return (self.x0 + self.x1) / 2, (self.z0 + self.z1) / 2


class Block(NamedTuple):
    """A rectangle from one height to another."""

    rect: Rect
    y0: float
    y1: float

    def meets(self, other: Block, gap: float = 0.0) -> bool:
        return self.y0 < other.y1 and other.y0 < self.y1 and self.rect.meets(other.rect, gap)


def turn(points: Array, yaw: float) -> Array:
    """Turn (N, 3) points about y by an angle in radians."""
    cos, sin = cos_sin(yaw)
    x, y, z = np.asarray(points, float).T
    return np.stack([cos * x + sin * z, y, cos * z - sin * x], -1)


@lru_cache(1024)
def cos_sin(yaw: float) -> tuple[float, float]:
    return float(np.cos(yaw)), float(np.sin(yaw))


def outline(points: Array, obj: Placed) -> Block:
    """Return the world box around points in the frame of a placed piece."""
    low, high = (f(turn(points, obj.yaw), axis=0) for f in (np.min, np.max))
    rect = Rect(low[0] + obj.x, low[2] + obj.z, high[0] + obj.x, high[2] + obj.z)
    return Block(rect, low[1] + obj.y, high[1] + obj.y)


@lru_cache(64)
def block_of(obj: Placed) -> Block:
    (x0, y0, z0), (x1, y1, z1) = obj.piece.low.tolist(), obj.piece.high.tolist()
    return Block(local(obj, x0, z0, x1, z1), min(y0, 0.0) + obj.y, max(y1, 0.0) + obj.y)


def at_hand(obj: Placed) -> tuple[Rect, ...]:
    """Return the floor in front of the four sides of a piece, from where a body can reach it."""
    r = block_of(obj).rect
    return Rect(r.x0 - REACH, r.z0, r.x1 + REACH, r.z1), Rect(r.x0, r.z0 - REACH, r.x1, r.z1 + REACH)


def local(obj: Placed, x0: float, z0: float, x1: float, z1: float) -> Rect:
    """Return the world box around a rectangle in the frame of a placed piece."""
    cos, sin = cos_sin(obj.yaw)
    x = [cos * x + sin * z for x in (x0, x1) for z in (z0, z1)]
    z = [cos * z - sin * x for x in (x0, x1) for z in (z0, z1)]
    return Rect(min(x) + obj.x, min(z) + obj.z, max(x) + obj.x, max(z) + obj.z)


class RoomOccupancy:
    """One room while it is furnished. Heights are above its own floor, metres."""

    def __init__(self, area: Area, plan: FloorPlan) -> None:
        self.area = area
        self.floor = plan.floor
        self.rect = Rect(*area.inner)
        self.objects: list[Placed] = []
        self._taken: list[Block] = []
        self._solid: list[Rect] = []
        self._kept: list[Rect] = []
        self._wanted: list[tuple[Rect, ...]] = []
        self.windows: list[tuple[Side, WallOpening]] = []
        self.doors: list[tuple[Side, WallOpening]] = []
        self._doors: list[Rect] = []
        for wall in plan.walls:
            if area.name in (wall.low, wall.high):
                self._add_wall(wall)

    def _add_wall(self, wall: Wall) -> None:
        high = wall.high == self.area.name
        side: Side = ("south" if high else "north") if wall.axis == "x" else ("west" if high else "east")
        for hole in wall.openings:
            if hole.kind == "window":
                self.windows.append((side, hole))
                # From just below the sill, a board of 6 cm under the glass.
                self._taken.append(Block(self._strip(side, hole.at, hole.width, 0.22), hole.bottom - 0.07, hole.top))
            else:
                if hole.kind not in ("open", "stairs"):
                    self.doors.append((side, hole))
                # People walk along an open side, and half of that way is in the other room.
                deep = 0.45 if hole.kind == "open" and hole.width > 2 else 0.8
                if hole.leaf and hole.opens_low == (wall.low == self.area.name):
                    deep = 0.96  # The leaf swings over this floor.
                self._doors.append(self._strip(side, hole.at, hole.width, min(deep, 0.8)))
                self._kept.append(self._strip(side, hole.at, hole.width + 0.14, deep))
            if hole.leaf and hole.opens_low == (wall.low == self.area.name):
                # An open leaf of 0.9 m begins 2 cm from the wall.
                edge = self._strip(side, hole.at + hole.leaf * (hole.width / 2 + 0.08), 0.16, 0.94)
                self._taken.append(Block(edge, 0.0, 2.1))
                self._solid.append(edge)

    def _strip(self, side: Side, at: float, width: float, depth: float) -> Rect:
        """Return the floor along a wall in front of a stretch of it."""
        r, h = self.rect, width / 2
        return {
            "south": Rect(at - h, r.z0, at + h, r.z0 + depth), "north": Rect(at - h, r.z1 - depth, at + h, r.z1),
            "west": Rect(r.x0, at - h, r.x0 + depth, at + h), "east": Rect(r.x1 - depth, at - h, r.x1, at + h),
        }[side]  # fmt: skip

    def length(self, side: Side) -> float:
        return self.rect.x1 - self.rect.x0 if side in ("south", "north") else self.rect.z1 - self.rect.z0

    def start(self, side: Side) -> float:
        """Return where a wall begins along itself: the smaller coordinate, metres."""
        return self.rect.x0 if side in ("south", "north") else self.rect.z0

    def depth(self, side: Side) -> float:
        """Return the distance to the opposite wall, metres."""
        return self.length("west" if side in ("south", "north") else "south")

    def at_wall(self, piece: Piece, side: Side, along: float, y: float = 0.0, gap: float = 0.015) -> Placed:
        """Return a piece with its back to a wall. along: metres from the end of smaller coordinate to its centre."""
        r, out = self.rect, piece.size[2] / 2 + gap
        x, z = {
            "south": (r.x0 + along, r.z0 + out), "north": (r.x0 + along, r.z1 - out),
            "west": (r.x0 + out, r.z0 + along), "east": (r.x1 - out, r.z0 + along),
        }[side]  # fmt: skip
        return Placed(piece, x, y, z, YAW[side], self.area.name)

    def spots(self, piece: Piece, rng: np.random.Generator, y: float = 0.0, step: float = 0.1) -> Iterator[Placed]:
        """Return places along the walls in random order, corners included. The order is drawn before the first."""
        half = piece.size[0] / 2 + 0.02
        rooms = [(side, self.length(side) - 2 * half) for side in SIDES]
        spots = [
            (side, half + k) for side, room in rooms if room >= 0 for k in (*np.arange(0, room, step).tolist(), room)
        ]
        order = [spots[k] for k in rng.permutation(len(spots))]
        return (self.at_wall(piece, side, along, y) for side, along in order)

    def fits(self, obj: Placed, front: float = 0.0, gap: float = 0.01) -> bool:
        """Return whether a piece is inside the room, overlaps nothing, and leaves ways and floor in front free.

        front: metres of free floor in front of it. gap: distance to other objects.
        """
        block = block_of(obj)
        if not block.rect.within(self.rect) or self._blocked(block, gap):
            return False
        if block.y0 < _HEAD and any(block.rect.meets(rect) for rect in self._kept):
            return False
        return not front or self.is_free(self.ahead(obj, front))

    def _blocked(self, block: Block, gap: float, ignore: Sequence[Block] = ()) -> bool:
        return any(block.meets(other, gap) and other not in ignore for other in self._taken)

    def is_free(self, rect: Rect) -> bool:
        """Return whether a rectangle is floor inside the room with nothing on it."""
        # From 3 cm on: what is flatter is a rug.
        return rect.within(self.rect) and not self._blocked(Block(rect, 0.03, 1.2), 0.0)

    def is_free_unit(self, side: Side, along: float, width: float) -> bool:
        """Return whether a kitchen unit fits along a stretch of a wall.

        It is 0.65 m deep, lower than window sills, and needs 0.6 m of free floor in front.
        """
        unit, floor = (self._strip(side, self.start(side) + along + width / 2, width, depth) for depth in (0.65, 1.25))
        if self._blocked(Block(unit, 0.0, 0.87), 0.0) or any(unit.meets(rect) for rect in self._kept):
            return False
        return floor.within(self.rect.grown(1e-6)) and not self._blocked(Block(floor, 0.03, 0.87), 0.0)

    def before_window(self, obj: Placed) -> bool:
        """Return whether a window is behind a piece at a wall, or within 10 cm beside it."""
        rect, side = block_of(obj).rect, next((s for s in SIDES if YAW[s] == obj.yaw), None)
        low, high = (rect.x0, rect.x1) if side in ("south", "north") else (rect.z0, rect.z1)
        return any(
            side == wall and low < hole.at + hole.width / 2 + 0.1 and hole.at - hole.width / 2 - 0.1 < high
            for wall, hole in self.windows
        )

    def clear_of_doors(self, obj: Placed) -> bool:
        return not any(block_of(obj).rect.meets(door) for door in self._doors)

    def rests(self, obj: Placed, *hosts: Placed) -> bool:
        """Return whether an object on top of its host touches nothing else. Further hosts stand under it too."""
        return not self._blocked(block_of(obj), 0.01, ignore=[block_of(host) for host in hosts])

    def ahead(self, obj: Placed, front: float) -> Rect:
        """Return the floor in front of a piece, as wide as the piece. front: its depth, metres."""
        w, _, d = obj.piece.size
        return local(obj, -w / 2, d / 2 + 0.001, w / 2, d / 2 + front)

    def put(self, *objects: Placed, keep: Sequence[Rect] = (), want: Sequence[tuple[Rect, ...]] = ()) -> bool:
        """Place a group; undo it and return False if the room does not stay walkable.

        keep: floor that must stay free. want: groups of places; a body must still reach one place of each group.
        """
        lists: tuple[list[Any], ...] = (self.objects, self._taken, self._solid, self._kept, self._wanted)
        before = [len(items) for items in lists]
        for obj in objects:
            self._add(obj)
        self._kept += keep
        self._wanted += want
        low = any(block_of(obj).y0 < _HEAD and obj.piece.asset.hulls for obj in objects)
        if low and not self.walkable():
            for items, count in zip(lists, before, strict=True):
                del items[count:]
            return False
        return True

    def _add(self, obj: Placed) -> None:
        self.objects.append(obj)
        if obj.piece.asset.hulls or obj.piece.size[1] > 0.03:  # A rug takes no space: objects stand on it.
            self._taken.append(block_of(obj))
        for hull in obj.piece.asset.hulls:
            block = outline(np.asarray(hull, float), obj)
            if block.y0 < _HEAD and block.y1 > 0.03:
                self._solid.append(block.rect)

    def try_put(
        self, spots: Iterable[Placed], *, front: float = 0.0, target: bool = False, gap: float = 0.01
    ) -> Placed | None:
        """Place a piece at the first spot that fits and leaves the room walkable; None if there is none.

        front: metres of floor in front that stays free. target: whether a body must be able to reach the piece.
        """
        for obj in spots:
            if self.fits(obj, front, gap):
                kept = [self.ahead(obj, front)] if front else []
                if self.put(obj, keep=kept, want=[at_hand(obj)] if target else []):
                    return obj
        return None

    # -- walking -------------------------------------------------------------------------------------------------------
    def grid(self) -> np.ndarray:
        """Return (rows, columns) where the centre of a walking body can be; rows along z."""
        r = self.rect
        shape = int((r.z1 - r.z0) / CELL), int((r.x1 - r.x0) / CELL)
        free = np.ones((shape[0] + 2, shape[1] + 2), bool)
        # A ring around the room, so that distances to its walls count.
        free[0] = free[-1] = free[:, 0] = free[:, -1] = False
        for rect in self._solid:
            rows, columns = self._cells(rect)
            free[rows.start + 1 : rows.stop + 1, columns.start + 1 : columns.stop + 1] = False
        return np.asarray(distance_transform_edt(free)[1:-1, 1:-1] * CELL >= BODY)

    def _cells(self, rect: Rect) -> tuple[slice, slice]:
        r = self.rect
        # Outwards: whatever cell an object touches is taken.
        limits = (
            np.floor((rect.z0 - r.z0) / CELL), np.ceil((rect.z1 - r.z0) / CELL),
            np.floor((rect.x0 - r.x0) / CELL), np.ceil((rect.x1 - r.x0) / CELL),
        )  # fmt: skip
        z0, z1, x0, x1 = (max(0, int(v)) for v in limits)
        return slice(z0, max(z0, z1)), slice(x0, max(x0, x1))

    def walkable(self) -> bool:
        """Return whether one free area connects all doors, reaches all wanted places, and leaves little floor out."""
        areas, count = label(self.grid())
        if not count:
            return False
        seen = [set(np.unique(areas[self._cells(door)]).tolist()) - {0} for door in self._doors]
        common = set.intersection(*seen) if seen else {int(np.bincount(areas[areas > 0]).argmax())}
        sizes = np.bincount(areas[areas > 0])
        return any(
            sizes.sum() - sizes[number] <= _POCKET / CELL**2
            and all(any((areas[self._cells(rect)] == number).any() for rect in places) for places in self._wanted)
            for number in common
        )
