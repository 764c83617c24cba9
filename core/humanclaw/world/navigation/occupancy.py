"""Free and occupied cells: one floor of a scene on a grid of 5 cm (paper, section 4.1).

Points on a floor are (..., 2) arrays of x and z, points in the house (..., 3) arrays of x, y and z; metres, world
frame.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Final

import numpy as np
import scipy  # Whose parts load when they are used: ndimage takes a fifth of a second, and few commands use it.
from numpy.typing import NDArray

from humanclaw.body.pose import Array
from humanclaw.errors import SceneError
from humanclaw.storage.cache import source_digest
from humanclaw.world.scene import Room, Scene, SceneObject
from humanclaw.world.scene_cache import Arrays, kept

Mask = NDArray[np.bool_]

_SOURCES: Final = ("world/navigation", "world/scene_cache.py", "world/scene.py", "body/pose.py")
DRAWING: Final = (tuple(f"humanclaw/{name}" for name in _SOURCES), ("numpy", "scipy"))
"""Sources and libraries that may change a drawing of the same scene."""
CELL: Final = 0.05
"""Side of a grid cell, metres."""
_LARGEST: Final = 100_000
"""Largest area of a grid, square metres: 40 million cells take 2 GB."""
OBSTACLE_HEIGHTS: Final = (0.05, 1.9)
"""Heights above the floor, metres, between which an object blocks a body: lower it is stepped over, higher the head
passes below it."""
STEP: Final = 0.26
"""Highest step that a body climbs or descends, metres."""
STOREY: Final = 3.0
"""What begins so far above a floor is nothing to those who stand on it, metres: they do not even see that it hides
anything."""
RADIUS: Final = 0.28
"""Half the width of a walking body, metres."""
SQUEEZE: Final = 0.14
"""Half the narrowest gap, tried only without another way, metres."""
COMFORT: Final = 0.55
"""Distance from walls beyond which a route is as good as any, metres."""


@dataclass(frozen=True, eq=False)
class OccupancyGrid:
    """The obstacles of one floor. Arrays are indexed [x cell, z cell]; owners and heights describe the object in a
    cell."""

    origin: tuple[float, float]
    """World x and z of the corner of cell (0, 0)."""
    blocked: Mask
    """Static objects, objects on hinges, and cells without floor: a door opens to one side only, so no route relies on
    it."""
    movable: Mask
    owners: NDArray[np.int32]
    """Id of the object that blocks a cell, 0 for none."""
    tops: Array
    """Height over the floor of the tallest static object in a cell, metres: it hides objects behind it."""
    overhead: tuple[Array, Array]
    """Lowest and highest height over the floor of objects above the heads in a cell, such as lintels, metres."""
    ground: Array
    """World height of the ground in each cell, metres; NaN where this grid has no floor."""
    floor: float = 0.0
    slope: Array | None = None
    """Only on stairs: (2, ...) rise over run along x and z, taken over two steps; at that scale a staircase is a
    ramp."""

    @classmethod
    def of(
        cls, scene: Scene, floor: float = 0.0, moved: Mapping[int, Array] | None = None, keep: bool = True
    ) -> OccupancyGrid:
        """Rasterize a scene.

        Args:
            moved: object id to (7,) pose, for movable objects that are not where the scene says.
            keep: whether to keep the grid on disk. Every start in a house finds each object at the same place; later
                places never come again.
        """
        if not keep:
            return cls._drawn(scene, floor, moved or {})
        places = b"".join(np.array([key, *pose]).tobytes() for key, pose in sorted((moved or {}).items()))
        what = f"grid {floor} {_extent(scene)} {hashlib.sha256(places).hexdigest()}"
        arrays = dict(kept(scene, what, source_digest(*DRAWING), lambda: cls._drawn(scene, floor, moved or {})._arrays))
        x, z = arrays.pop("origin").tolist()
        return cls((x, z), overhead=(arrays.pop("under"), arrays.pop("over")), floor=floor, **arrays)

    @classmethod
    def _drawn(cls, scene: Scene, floor: float, moved: Mapping[int, Array]) -> OccupancyGrid:
        low, shape = _extent(scene)
        grid = cls(
            (float(low[0]), float(low[1])), np.zeros(shape, bool), np.zeros(shape, bool), np.zeros(shape, np.int32),
            np.zeros(shape), (np.full(shape, np.inf), np.zeros(shape)), np.full(shape, floor), floor,
        )  # fmt: skip
        # Movable objects last, so that a cell names the fixed object that would hide them.
        for obj in sorted(scene.objects, key=lambda obj: obj.movable):
            grid._draw(scene, obj, moved.get(obj.id))
        inside = grid._indoors(scene)
        return replace(grid, blocked=grid.blocked | ~inside, ground=np.where(inside, grid.ground, np.nan))

    def _draw(self, scene: Scene, obj: SceneObject, pose: Array | None = None) -> None:
        """Draw an object into the arrays. pose: (7,), if it is not where the scene says."""
        under, over = self.overhead
        for hull in _hulls(scene, obj, pose, self.floor):
            mask, where = rasterize(hull[:, [0, 2]], np.array(self.origin), self.blocked.shape)
            bottom, top = hull[:, 1].min() - self.floor, hull[:, 1].max() - self.floor
            if bottom >= OBSTACLE_HEIGHTS[1]:
                under[where] = np.where(mask, np.minimum(under[where], bottom), under[where])
                over[where] = np.where(mask, np.maximum(over[where], top), over[where])
            elif obj.movable and not obj.joint:
                self.movable[where] |= mask
            else:
                self.blocked[where] |= mask
                self.owners[where][mask] = obj.id
                self.tops[where] = np.maximum(self.tops[where], mask * top)

    @property
    def _arrays(self) -> Arrays:
        """Everything but floor and slope, by name."""
        under, over = self.overhead
        names = ("blocked", "movable", "owners", "tops", "ground")
        return {"origin": np.array(self.origin), "under": under, "over": over} | {
            name: getattr(self, name) for name in names
        }

    def _indoors(self, scene: Scene) -> Mask:
        """Cells of this floor's rooms and of the walls and doorways between them; everything if the scene has no
        rooms."""
        rooms = [room for room in scene.rooms if abs(room.floor - self.floor) < 0.5]
        if not rooms:
            return np.ones(self.blocked.shape, bool)
        inside = np.any([self.within(room) for room in rooms], axis=0)
        return gap_to(inside) <= 0.16

    def within(self, room: Room) -> Mask:
        """Cells of a room; none if it is on another floor."""
        mask = np.zeros(self.blocked.shape, bool)
        if abs(room.floor - self.floor) < 0.5:
            (i, j), (k, m) = self.cell(np.array([room.x0, room.z0])), self.cell(np.array([room.x1, room.z1]))
            mask[i : k + 1, j : m + 1] = True
        return mask

    def gap(self, low: Array, high: Array) -> Array:
        """Distance of each cell's middle from a box with these (3,) corners, seen from above, metres."""
        middles = [(np.arange(size) + 0.5) * CELL + self.origin[k] for k, size in enumerate(self.blocked.shape)]
        x, z = (np.clip(middle, low[2 * k], high[2 * k]) - middle for k, middle in enumerate(middles))
        return np.asarray(np.sqrt((x * x)[:, None] + z * z))

    def cell(self, points: Array) -> NDArray[np.int64]:
        """Map (..., 2) points to (..., 2) cell indices, held inside the grid."""
        index = np.floor((np.asarray(points, float) - self.origin) / CELL).astype(np.int64)
        return np.asarray(np.clip(index, 0, np.array(self.blocked.shape) - 1))

    def point(self, cells: NDArray[Any]) -> Array:
        """Map (..., 2) cell indices to the (..., 2) centres of the cells."""
        return np.asarray((np.asarray(cells) + 0.5) * CELL + self.origin)

    def at(self, grid: NDArray[Any], points: Array) -> NDArray[Any]:
        """Return (...) values of a grid at (..., 2) points."""
        index = self.cell(points)
        return np.asarray(grid[index[..., 0], index[..., 1]])

    @cached_property
    def clearance(self) -> Array:
        """Distance of each cell to the nearest obstacle, metres."""
        return gap_to(self.blocked)

    @cached_property
    def cost(self) -> Array:
        """Metres that a metre through a cell counts for: more near walls, much more where it is tight; -1 is
        impassable."""
        near = np.clip((COMFORT - self.clearance) / (COMFORT - RADIUS), 0.0, 1.0)
        cost = 1.0 + 2.0 * near**2
        cost[gap_to(self.movable) < RADIUS] += 4.0
        cost[self.clearance < RADIUS] += 30.0  # A detour of 30 m is shorter than a metre of squeezing.
        cost[~self.fits(SQUEEZE)] = -1.0
        return np.asarray(cost)

    def fits(self, radius: float) -> Mask:
        """Cells in which a body of this radius can stand."""
        return np.asarray((self.clearance >= radius) & np.isfinite(self.ground))

    @cached_property
    def steepness(self) -> Array:
        """Metres walked to a metre of floor: 1 on the flat."""
        return np.ones(self.blocked.shape) if self.slope is None else np.sqrt(1.0 + (self.slope**2).sum(0))

    def with_obstacle(self, point: Array, radius: float) -> OccupancyGrid:
        """Return the same grid with one more round obstacle: something was found to be in the way."""
        middle = np.insert(point, 1, 0.0)
        return replace(self, blocked=self.blocked | (self.gap(middle, middle) <= radius))

    def clear(self, start: Array, end: Array, radius: float = SQUEEZE) -> bool:
        """Tell whether a body of this radius can go straight from one point to the other."""
        return bool((self.at(self.clearance, samples(start, end)) >= radius).all())

    def best_view(self, place: Array, blocked: Mask) -> float:
        """Return which of eight yaws, radians, has the longest view from a (2,) place over what is not blocked."""

        def length(yaw: float) -> float:
            steps = np.arange(0.1, 15.0, 0.1)
            points = place + steps[:, None] * np.array([np.sin(yaw), np.cos(yaw)])
            return float(steps[np.argmax(np.append(self.at(blocked, points)[:-1], True))])

        return max((round(float(k * np.pi / 4), 4) for k in range(-3, 5)), key=length)

    def sees(self, eyes: Array, points: Array, last: float = 0.1) -> Mask:
        """Return (...) whether nothing static stands between (..., 3) eyes and (..., 3) points.

        last: metres before a point that do not count.
        """
        eyes, points = np.broadcast_arrays(np.asarray(eyes, float), np.asarray(points, float))
        far = np.linalg.norm(points - eyes, axis=-1)
        steps = max(2, int(np.max(far, initial=0.0) / CELL))
        share = np.linspace(0.0, 1.0, steps) * np.maximum(0.0, 1.0 - last / np.maximum(far, 1e-6))[..., None]
        line = eyes[..., None, :] + share[..., None] * (points - eyes)[..., None, :]
        height, under, over = line[..., 1] - self.floor, *self.overhead
        places = line[..., [0, 2]]
        between = (self.at(under, places) < height) & (height < self.at(over, places))
        return np.asarray(((self.at(self.tops, places) <= height) & ~between).all(-1))


def floors_of(scene: Scene) -> tuple[float, ...]:
    """Heights of the floors that rooms stand on, lowest first; that of the start if the scene has no rooms."""
    floors: list[float] = []
    for floor in sorted({room.floor for room in scene.rooms} or {scene.start.floor}):
        if not floors or floor - floors[-1] > 0.5:
            floors.append(floor)
    return tuple(floors)


# -- geometry of a floor -----------------------------------------------------------------------------------------------
def room_at(scene: Scene, x: float, z: float, floor: float = 0.0) -> str:
    """Name of the room that a point lies in; empty between rooms."""
    inside: Sequence[str] = [
        room.name
        for room in scene.rooms
        if room.x0 <= x <= room.x1 and room.z0 <= z <= room.z1 and abs(room.floor - floor) < 0.5
    ]
    return inside[0] if inside else ""


def on_floor(grid: OccupancyGrid, points: Array) -> Array:
    """Return (..., 2) points as (..., 3) points on the floor of a grid."""
    points = np.asarray(points, float)
    return np.stack([points[..., 0], np.full(points.shape[:-1], grid.floor), points[..., 1]], -1)


def gap_to(mask: Mask) -> Array:
    """Return the distance of each cell from the nearest cell in a mask, metres."""
    return np.asarray(scipy.ndimage.distance_transform_edt(~mask) * CELL)


def length(path: Array) -> float:
    """Length of a polyline, metres."""
    return float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())


def samples(start: Array, end: Array) -> Array:
    """Return (M, 2) points from one to the other, ends included, at most half a cell apart."""
    return samples_along(np.stack([start, end]))[0]


def samples_along(path: Array) -> tuple[Array, NDArray[np.int64]]:
    """Return (M, 2) points on a polyline of (N, 2), at most half a cell apart, and their (N - 1,) number on each
    segment, ends included."""
    ways = np.diff(path, axis=0)
    counts = np.maximum(2, np.ceil(np.linalg.norm(ways, axis=1) / (CELL / 2)).astype(np.int64) + 1)
    last = np.cumsum(counts) - 1
    number = np.arange(counts.sum()) - np.repeat(last - counts + 1, counts)
    share = number * np.repeat(1 / (counts - 1), counts)
    share[last] = 1.0
    return np.repeat(path[:-1], counts, axis=0) + share[:, None] * np.repeat(ways, counts, axis=0), counts


def yaw_of(direction: Array) -> float:
    return float(np.arctan2(direction[0], direction[1]))


# -- rasterizing -------------------------------------------------------------------------------------------------------
def _extent(scene: Scene) -> tuple[Array, tuple[int, int]]:
    corners = [corner[[0, 2]] for obj in scene.objects for corner in scene.aabb(obj.id)]
    corners += [np.array(pair) for room in scene.rooms for pair in ((room.x0, room.z0), (room.x1, room.z1))]
    corners.append(np.array([scene.start.x, scene.start.z]))
    low = np.floor((np.min(corners, axis=0) - 0.5) / CELL) * CELL
    wide, deep = np.max(corners, axis=0) + 0.5 - low
    if wide * deep > _LARGEST:
        far = max(scene.objects, key=lambda obj: float(np.abs(scene.aabb(obj.id)).max()))
        problem = f"the scene is {wide:.0f} m by {deep:.0f} m; at most {_LARGEST:,} m² can be searched."
        raise SceneError(problem, f"Look at object {far.id} ({far.asset}): it reaches farthest from the origin.")
    return low, (int(np.ceil(wide / CELL)), int(np.ceil(deep / CELL)))


def _hulls(scene: Scene, obj: SceneObject, pose: Array | None, floor: float) -> Iterator[Array]:
    """Yield the convex pieces of an object that stand on this floor, (K, 3) world points each; ceilings left out."""
    if obj.category != "ceiling":
        for points in scene.hulls(obj.id, pose):
            if points[:, 1].max() > floor + OBSTACLE_HEIGHTS[0] and points[:, 1].min() < floor + STOREY:
                yield points


def rasterize(points: Array, low: Array, shape: tuple[int, int]) -> tuple[Mask, tuple[slice, slice]]:
    """Cells whose centre is within half a cell of the convex hull of (K, 2) points, and the window that they lie in."""
    first = np.minimum(np.maximum(np.floor((points.min(0) - low) / CELL).astype(int) - 1, 0), shape)
    last = np.minimum(np.maximum(np.ceil((points.max(0) - low) / CELL).astype(int) + 1, 0), shape)
    where = (slice(first[0], last[0]), slice(first[1], last[1]))
    x, z = ((np.arange(first[axis], last[axis]) + 0.5) * CELL + low[axis] for axis in (0, 1))
    along, across, off = _sides(points).T[..., None]
    return np.asarray(((along * x)[..., None] + (across * z)[:, None] + off[..., None] <= CELL / 2).all(0)), where


def _sides(points: Array) -> Array:
    """(S, 3) outward half-planes of the convex hull of (K, 2) points; of their box if they lie on one line."""
    try:
        return np.asarray(scipy.spatial.ConvexHull(points).equations)
    except scipy.spatial.QhullError:
        (x0, z0), (x1, z1) = points.min(0), points.max(0)
        return np.array([[-1.0, 0.0, x0], [1.0, 0.0, -x1], [0.0, -1.0, z0], [0.0, 1.0, -z1]])
