"""Places to stand at a target, beside it or before its seat, and the walking distance to the nearest one."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Final

import numpy as np
import scipy

from humanclaw.body.pose import Array, matrix_from_quaternion
from humanclaw.world.navigation.occupancy import CELL, OBSTACLE_HEIGHTS, RADIUS, SQUEEZE, Mask, OccupancyGrid, yaw_of
from humanclaw.world.navigation.search import DistanceField, MultiFloorMap
from humanclaw.world.scene import Scene

ARM_ROOM: Final = 0.5
"""Metres from the middle of the body to the end of the seat: hips and elbows must clear the armrest."""
STAND_OFF: Final = 0.45
"""Metres from the edge of a seat to the place where a body turns round before sitting down."""
NEAR: Final = 1.5
"""Places farther from the edge of a target are not beside it, metres."""
_BATCH: Final = 256
"""Cells that are looked at together; the nearest ones are mostly free."""
_RADII: Final = (RADIUS, 0.2, SQUEEZE)
"""Half the widths of the bodies that ways are searched for, metres; the second is a body without its arms (38 cm). The
first that comes somewhere counts."""
_CORNER: Final = 0.25
"""A front that lies so much further back is that of the open corner of a couch, metres."""
LEANING: Final = 1.0
"""Metres. A body farther than this from every reachable cell is not leaning on furniture but shut in."""


@dataclass(frozen=True)
class Viewpoint:
    """A place to stand near a target. For a seat: the place to turn round, with the back to it."""

    target: int
    x: float
    z: float
    yaw: float
    """Heading there, radians: towards the target, or away from a seat."""
    gap: float
    """Distance from the place to the target's edge, metres."""
    seat_height: float | None = None
    """Height of the sitting surface above the floor, metres; None if the target is not a seat."""
    floor: float = 0.0

    @property
    def point(self) -> Array:
        return np.array([self.x, self.z])

    @property
    def place(self) -> Array:
        """(3,) on the floor."""
        return np.array([self.x, self.floor, self.z])


def viewpoints(where: MultiFloorMap, scene: Scene, target: int, *, sit: bool = False) -> tuple[Viewpoint, ...]:
    """Return places to stand at a target, on any floor, the best first judging by the place alone.

    sit: places from which it can be sat on. Empty if no body fits near it.
    """
    low, high = scene.aabb(target)
    find = _seats if sit else _beside
    return tuple(
        viewpoint
        for grid in where.floors
        if low[1] < grid.floor + OBSTACLE_HEIGHTS[1] and high[1] > grid.floor
        for viewpoint in find(grid, scene, target)
    )


def goals_at(where: MultiFloorMap, scene: Scene, target: int, *, sit: bool = False) -> Array:
    """Return (N, 3) places from which a target counts as reached: the goals that geodesic distances are measured to."""
    return np.array([viewpoint.place for viewpoint in viewpoints(where, scene, target, sit=sit)]).reshape(-1, 3)


def _beside(grid: OccupancyGrid, scene: Scene, target: int) -> Iterator[Viewpoint]:
    """Free cells nearest to the target's bounding box, on the target's side of every wall."""
    low, high = (corner[[0, 2]] for corner in scene.aabb(target))
    first, last = grid.cell(low - NEAR - CELL), grid.cell(high + NEAR + CELL) + 1
    window = grid.clearance[first[0] : last[0], first[1] : last[1]]
    for radius in _RADII:
        points = grid.point(np.argwhere(window >= radius) + first)
        edge = np.clip(points, low, high)
        gap = np.linalg.norm(points - edge, axis=1)
        order, reach = np.argsort(gap, kind="stable"), np.inf
        order = order[gap[order] < NEAR]
        for batch in np.split(order, range(_BATCH, len(order), _BATCH)):
            for k in batch[~_walled(grid, scene, points[batch], edge[batch])]:
                if gap[k] > reach:
                    return
                reach = min(reach, gap[k] + 0.15)  # Others so near are as good: the way decides.
                x, z = points[k].tolist()
                yield Viewpoint(target, x, z, yaw_of(edge[k] - points[k]), float(gap[k]), floor=grid.floor)
        if reach < np.inf:
            return


def _walled(grid: OccupancyGrid, scene: Scene, starts: Array, ends: Array) -> Mask:
    """(N,) whether a wall, a window or a door stands between (N, 2) points and (N, 2) others."""
    parts = [obj.id for obj in scene.objects if obj.category in ("wall", "window", "door")]
    # The last 5 cm do not count: a screen hangs so close to its wall that both share a cell. NEAR is 60 half cells.
    far = np.linalg.norm(ends - starts, axis=1)
    share = (np.linspace(0.0, 1.0, 60) * np.maximum(0.0, 1.0 - 0.05 / np.maximum(far, 1e-6))[:, None])[..., None]
    lines = starts[:, None] + share * (ends - starts)[:, None]
    return np.asarray(grid.at(np.isin(grid.owners, parts), lines).any(-1))


def _seats(grid: OccupancyGrid, scene: Scene, target: int) -> Iterator[Viewpoint]:
    """In front of each side from which a seat can be sat on: the front, of a bed the long sides too; the middle
    first."""
    obj = scene.by_id[target]
    asset = scene.assets[obj.asset]
    if asset.seat_height is None:
        return
    turn = matrix_from_quaternion(np.array(obj.rotation))
    sides = (0.0, np.pi / 2, -np.pi / 2) if obj.category == "bed" else (0.0,)
    height = asset.seat_height + obj.position[1] - grid.floor
    others = replace(grid, blocked=grid.blocked & (grid.owners != target))
    # Room for the elbows first, then for the hips, then farther from the seat, then closer: the first that fits.
    for stand_off, margin in ((STAND_OFF, ARM_ROOM), (STAND_OFF, 0.35), (0.6, 0.35), (0.36, 0.35)):
        seats = [
            Viewpoint(target, float(place[0]), float(place[1]), yaw, stand_off, height, grid.floor)
            for side in sides
            for place, yaw in _along(scene, target, turn, side, stand_off, margin)
            # The seat itself is the nearest obstacle, and its raster reaches up to two cells beyond it.
            if grid.at(grid.clearance, place) >= min(RADIUS, stand_off - 0.1)
            and others.clear(place, place - stand_off * _facing(yaw)[[0, 2]], 0.2)
        ]
        yield from seats
        if seats:
            return


def _along(
    scene: Scene, target: int, turn: Array, side: float, stand_off: float, margin: float
) -> list[tuple[Array, float]]:
    """Places in front of one side of an object and where its front looks, from the middle of the side outwards."""
    obj = scene.by_id[target]
    asset = scene.assets[obj.asset]
    out, along = _facing(side), _facing(side + np.pi / 2)
    parts = [(part @ along, part @ out) for part in asset.hulls or (asset.mesh.vertices,)]
    wide, deep = map(np.concatenate, zip(*parts, strict=True))
    edge, reach = float(deep.max()), float(np.ptp(wide)) / 2

    def front(step: float) -> float:
        there = [ahead.max() for aside, ahead in parts if aside.min() - RADIUS < step < aside.max() + RADIUS]
        nearest = float(max(there, default=edge))
        return edge if nearest > edge - _CORNER else nearest

    offsets = np.arange(0.0, max(reach - margin, 0.0) + 1e-9, 0.2)
    facing = (turn @ out)[[0, 2]]
    places = [out * (front(step) + stand_off) + along * step for step in [*offsets, *-offsets[1:]]]
    places.sort(key=lambda place: abs(float(place @ along)))
    return [((turn @ place + obj.position)[[0, 2]], yaw_of(facing)) for place in places]


def _facing(yaw: float) -> Array:
    return np.array([np.sin(yaw), 0.0, np.cos(yaw)])


# -- distance to the nearest target ------------------------------------------------------------------------------------
def geodesics(scene: Scene, targets: Sequence[int], floor: float = 0.0) -> Callable[[Array], float]:
    """Return a function that maps a world position (3,) to the shortest way to a place beside the nearest target,
    metres (paper, appendix B).

    The way of a body that is RADIUS wide on each side, over the stairs if need be; of a narrower one where that leads
    nowhere; infinite if none does. A body that leans on furniture is measured from the nearest free cell. Eight
    directions overestimate by up to 8 %. floor: of the start; the position tells the floor, so that nothing depends on
    it here.
    """
    where = MultiFloorMap.of(scene)
    goals = np.concatenate([goals_at(where, scene, target) for target in targets] or [np.empty((0, 3))])

    @cache
    def field(number: int) -> Array:
        """Return the metres of bodies of the first radii; behind them those that a body leans by. A search takes long,
        so each is made when a body is where the ones before it do not reach."""
        if number == len(_RADII):
            return np.stack([_extended(layer) for layer in field(number - 1)])
        metres = DistanceField.of(where, goals, _RADII[number]).metres
        return np.where(np.isfinite(field(number - 1)), field(number - 1), metres) if number else metres

    def distance(point: Array) -> float:
        distances = (float(where.at(field(number), np.asarray(point))) for number in range(len(_RADII) + 1))
        return next(filter(np.isfinite, distances), float("inf"))

    return distance


def voice_distance(scene: Scene, moved: Mapping[int, Array], mouth: Array, ear: Array) -> float:
    """Return the length of the shortest way of a voice from (3,) mouth to (3,) ear, metres: round corners and through
    open doors; infinite if none leads there.

    moved: poses (7,) of movable objects by id, doors among them, as they are now.
    """
    where = MultiFloorMap.of(scene, moved, keep=False)
    # From the nearest free cell each: who sits on a couch is where no body can walk.
    metres, near = (where.distances(point, CELL) for point in (mouth, ear))
    return float(metres[np.unravel_index(near.argmin(), near.shape)])


def _extended(field: Array) -> Array:
    """Return a cell where no body fits takes the way of the nearest cell with one, and the straight line to it."""
    known = np.isfinite(field)
    if not known.any():
        return field
    gap, nearest = scipy.ndimage.distance_transform_edt(~known, sampling=CELL, return_indices=True)
    return np.asarray(np.where(gap < LEANING, field[tuple(nearest)] + gap, np.inf))
