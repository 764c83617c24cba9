"""Where a body can go: occupancy on a 5 cm grid, geodesic distances, routes and standing places (paper, section 4.1).

Points on the floor are (..., 2) arrays of x and z in metres, world frame. A standing place faces a yaw in radians.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt
from scipy.spatial import ConvexHull, QhullError
from skimage.graph import MCP_Geometric
from skimage.measure import approximate_polygon

from humanclaw.pose import Array, matrix_from_quaternion, wrap_angle
from humanclaw.scene import Scene, SceneObject

Mask = NDArray[np.bool_]

CELL: Final = 0.05
"""Side of a grid cell, metres."""
OBSTACLE_HEIGHTS: Final = (0.05, 1.9)
"""What lies between these heights over the floor is in a body's way: a foot steps over the rest or a head passes below it."""
STOREY: Final = 2.6
"""Height of a storey, metres: what begins above it belongs to the next."""
RADIUS: Final = 0.28
"""Half the width that a walking body needs, metres."""
SQUEEZE: Final = 0.14
"""Half the narrowest gap that is tried when there is no other way, metres."""
COMFORT: Final = 0.55
"""Distance from walls beyond which a route is as good as any, metres."""
ARM_ROOM: Final = 0.5
"""From the middle of the body to the end of the seat, metres: hips and elbows must clear the armrest."""
STAND_OFF: Final = 0.45
"""From the edge of a seat to where one turns round before sitting down, metres."""


@dataclass(frozen=True, eq=False)
class FloorPlan:
    """The obstacles of one storey. Arrays are indexed [x cell, z cell]; owners and heights tell what stands in a cell."""

    origin: tuple[float, float]
    """World x and z of the corner of cell (0, 0)."""
    blocked: Mask
    """Static things, and whatever is not floor."""
    movable: Mask
    owners: NDArray[np.int32]
    """Id of the static object in a cell, 0 for none."""
    tops: Array
    """Height over the floor of the tallest static thing in a cell, metres: what hides things behind it."""
    overhead: tuple[Array, Array]
    """Lowest and highest height over the floor of what hangs in a cell above the heads, such as lintels, metres."""
    floor: float = 0.0

    @classmethod
    def of(cls, scene: Scene, floor: float = 0.0, moved: Mapping[int, Array] | None = None) -> FloorPlan:
        """Rasterise a scene. moved: object id to (7,) pose, for movable things that are not where the scene says."""
        low, shape = _extent(scene)
        blocked, movable = np.zeros(shape, bool), np.zeros(shape, bool)
        owners, tops = np.zeros(shape, np.int32), np.zeros(shape)
        under, over = np.full(shape, np.inf), np.zeros(shape)
        for thing in scene.objects:
            pose = (moved or {}).get(thing.id)
            for hull in _hulls(scene, thing, pose, floor):
                mask, where = _raster(hull[:, [0, 2]], low, shape)
                bottom, top = hull[:, 1].min() - floor, hull[:, 1].max() - floor
                if bottom >= OBSTACLE_HEIGHTS[1]:
                    under[where] = np.where(mask, np.minimum(under[where], bottom), under[where])
                    over[where] = np.where(mask, np.maximum(over[where], top), over[where])
                elif thing.movable:
                    movable[where] |= mask
                else:
                    blocked[where] |= mask
                    owners[where][mask] = thing.id
                    tops[where] = np.maximum(tops[where], mask * top)
        plan = cls((float(low[0]), float(low[1])), blocked, movable, owners, tops, (under, over), floor)
        return replace(plan, blocked=blocked | ~plan._indoors(scene))

    def _indoors(self, scene: Scene) -> Mask:
        """Cells of this storey's rooms and of the walls and doorways between them; everything if the scene has no rooms."""
        rooms = [room for room in scene.rooms if abs(room.floor - self.floor) < 0.5]
        if not rooms:
            return np.ones(self.blocked.shape, bool)
        inside = np.zeros(self.blocked.shape, bool)
        for room in rooms:
            (i, j), (k, m) = self.cell(np.array([room.x0, room.z0])), self.cell(np.array([room.x1, room.z1]))
            inside[i : k + 1, j : m + 1] = True
        return np.asarray(distance_transform_edt(~inside) * CELL <= 0.16)

    def cell(self, points: Array) -> NDArray[np.int64]:
        """(..., 2) points to (..., 2) cell indices, held inside the grid."""
        index = np.floor((np.asarray(points, float) - self.origin) / CELL).astype(np.int64)
        return np.asarray(np.clip(index, 0, np.array(self.blocked.shape) - 1))

    def point(self, cells: NDArray[Any]) -> Array:
        """(..., 2) cell indices to the (..., 2) centres of the cells."""
        return np.asarray((np.asarray(cells) + 0.5) * CELL + self.origin)

    def at(self, grid: NDArray[Any], points: Array) -> NDArray[Any]:
        """(...) values of a grid at (..., 2) points."""
        index = self.cell(points)
        return np.asarray(grid[index[..., 0], index[..., 1]])

    @cached_property
    def clearance(self) -> Array:
        """Distance of each cell to the nearest obstacle, metres."""
        return np.asarray(distance_transform_edt(~self.blocked) * CELL)

    @cached_property
    def cost(self) -> Array:
        """Metres that a metre through a cell counts for: more near walls, much more where it is tight; -1 is impassable."""
        near = np.clip((COMFORT - self.clearance) / (COMFORT - RADIUS), 0.0, 1.0)
        cost = 1.0 + 2.0 * near**2
        cost[distance_transform_edt(~self.movable) * CELL < RADIUS] += 4.0
        cost[self.clearance < RADIUS] += 30.0
        cost[self.clearance < SQUEEZE] = -1.0
        return np.asarray(cost)

    def with_obstacle(self, point: Array, radius: float) -> FloorPlan:
        """The same plan with one more round obstacle: something was found to be in the way."""
        centres = self.point(np.moveaxis(np.indices(self.blocked.shape), 0, -1))
        disk = np.linalg.norm(centres - point, axis=-1) <= radius
        return replace(self, blocked=self.blocked | disk)

    def clear(self, start: Array, end: Array, radius: float = SQUEEZE) -> bool:
        """Whether a body of this radius can go straight from one point to the other."""
        return bool((self.at(self.clearance, _samples(start, end)) >= radius).all())

    def sees(self, eyes: Array, points: Array) -> Mask:
        """(...) whether nothing static stands between (..., 3) eyes and (..., 3) points; the last 10 cm do not count."""
        eyes, points = np.broadcast_arrays(np.asarray(eyes, float), np.asarray(points, float))
        far = np.linalg.norm(points - eyes, axis=-1)
        steps = max(2, int(np.max(far, initial=0.0) / CELL))
        share = np.linspace(0.0, 1.0, steps) * np.maximum(0.0, 1.0 - 0.1 / np.maximum(far, 1e-6))[..., None]
        line = eyes[..., None, :] + share[..., None] * (points - eyes)[..., None, :]
        height, under, over = line[..., 1] - self.floor, *self.overhead
        places = line[..., [0, 2]]
        between = (self.at(under, places) < height) & (height < self.at(over, places))
        return np.asarray(((self.at(self.tops, places) <= height) & ~between).all(-1))


# -- routes ------------------------------------------------------------------------------------------------------------
@dataclass(frozen=True, eq=False)
class Routes:
    """Cheapest routes from one start to everywhere."""

    plan: FloorPlan
    start: tuple[float, float]
    costs: Array
    """What the cheapest route to each cell costs, metres; infinite where there is none."""
    _search: Any

    @classmethod
    def of(cls, plan: FloorPlan, start: Array, *, radius: float | None = None) -> Routes:
        """Search from (2,) start. With a radius the plain shortest way of a body that wide; without, one that likes room.

        A start where no body fits begins at the nearest cell where one does.
        """
        weights = plan.cost if radius is None else np.where(plan.clearance >= radius, 1.0, -1.0)
        search = MCP_Geometric(weights, sampling=(CELL, CELL))
        costs, _ = search.find_costs([tuple(_nearest(plan, weights > 0, start))])
        return cls(plan, (float(start[0]), float(start[1])), costs, search)

    def to(self, points: Array) -> Array:
        """(..., 2) points to the cost of getting there, metres; infinite if it is impossible."""
        return self.plan.at(self.costs, points)

    def route(self, goals: Array) -> Array | None:
        """The polyline (N, 2) to the cheapest of (M, 2) goals, pulled straight; None if none can be reached."""
        goals = np.atleast_2d(goals)
        costs = self.to(goals)
        if not len(goals) or not np.isfinite(costs).any():
            return None
        goal = goals[int(np.argmin(costs))]
        cells = np.array(self._search.traceback(tuple(self.plan.cell(goal))))
        path = np.concatenate([[self.start], self.plan.point(cells)[1:-1], [goal]])
        return path[_pull(self.plan, path)]


def route(plan: FloorPlan, start: Array, goals: Array) -> Array | None:
    """The polyline (N, 2) from (2,) start to the cheapest of (M, 2) goals, keeping off walls; None if there is no way."""
    return Routes.of(plan, start).route(goals)


def geodesic(plan: FloorPlan, start: Array, goals: Array) -> float:
    """Length in metres of the shortest way from (2,) start to the nearest of (M, 2) goals; infinite if there is none.

    A body of RADIUS first; if that is too wide for some door on the way, a narrower one.
    """
    for radius in (RADIUS, 0.2, SQUEEZE):
        routes = Routes.of(plan, start, radius=radius)
        cheapest = float(np.min(routes.to(np.atleast_2d(goals)), initial=np.inf))
        if np.isfinite(cheapest):
            path = routes.route(goals)
            # The eight directions of a grid overestimate by up to 8 %; the pulled path may keep off walls. Take the less.
            return min(cheapest, length(path)) if path is not None else cheapest
    return float("inf")


def length(path: Array) -> float:
    """Length of a polyline, metres."""
    return float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())


def _pull(plan: FloorPlan, path: Array) -> list[int]:
    """Indices of the points of a path that remain when every stretch that loses nothing is pulled straight."""
    kept = list(_split(plan, path, 0, len(path) - 1)) + [len(path) - 1]
    index = 0
    while index + 2 < len(kept):
        if _as_cheap(plan, path, kept[index], kept[index + 2]):
            del kept[index + 1]
        else:
            index += 1
    return kept


def _split(plan: FloorPlan, path: Array, first: int, last: int) -> Iterator[int]:
    """Douglas and Peucker's recursion, with cost in the place of deviation."""
    if last - first < 2 or _as_cheap(plan, path, first, last):
        yield first
        return
    chord = path[last] - path[first]
    away = path[first + 1 : last] - path[first]
    far = np.abs(chord[0] * away[:, 1] - chord[1] * away[:, 0])
    # Ends are no place to split: a path that doubles back would recurse for ever.
    middle = first + 1 + int(np.argmax(far)) if far.max() > 1e-9 else (first + last) // 2
    yield from _split(plan, path, first, middle)
    yield from _split(plan, path, middle, last)


def _as_cheap(plan: FloorPlan, path: Array, first: int, last: int) -> bool:
    straight = _price(plan, path[[first, last]])
    return straight <= 1.02 * _price(plan, path[first : last + 1]) + 0.02


def _price(plan: FloorPlan, path: Array) -> float:
    """Cost of a polyline, metres. Impassable cells are dear and not infinite: a body may begin in one, as on a seat."""
    total = 0.0
    for start, end in pairwise(path):
        weights = plan.at(plan.cost, _samples(start, end))
        total += float(np.where(weights < 0, 200.0, weights).mean() * np.linalg.norm(end - start))
    return total


def _samples(start: Array, end: Array) -> Array:
    steps = max(2, int(np.ceil(np.linalg.norm(end - start) / (CELL / 2))) + 1)
    return np.asarray(start + np.linspace(0.0, 1.0, steps)[:, None] * (np.asarray(end) - start))


def _nearest(plan: FloorPlan, free: Mask, point: Array) -> NDArray[np.int64]:
    """The free cell nearest to a point."""
    if plan.at(free, point):
        return plan.cell(point)
    cells = np.argwhere(free)
    if not len(cells):
        return plan.cell(point)
    return np.asarray(cells[int(np.argmin(np.linalg.norm(plan.point(cells) - point, axis=1)))])


# -- standing places ---------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Stand:
    """A place to stand near a target. For a seat: where one turns round, with one's back to it."""

    target: int
    x: float
    z: float
    yaw: float
    """Where to face there: the target, or away from a seat."""
    gap: float
    """From the place to the target's edge, metres."""
    seat_height: float | None = None
    """Height of the sitting surface over the floor, metres; None if the target is not to be sat on."""

    @property
    def point(self) -> Array:
        return np.array([self.x, self.z])


def approach(plan: FloorPlan, scene: Scene, target: int, *, sit: bool = False) -> tuple[Stand, ...]:
    """Standing places at a target, the best first as far as the place alone can tell. Empty if no body fits near it.

    sit: places from which it can be sat on. Empty as well if the target is on another storey.
    """
    low, high = scene.aabb(target)
    if not (low[1] < plan.floor + OBSTACLE_HEIGHTS[1] and high[1] > plan.floor):
        return ()
    return tuple(_seats(plan, scene, target)) if sit else tuple(_beside(plan, scene, target))


def near(plan: FloorPlan, scene: Scene, target: int) -> Array:
    """(N, 2) places from which a target counts as reached: the goals that geodesic distances are measured to."""
    return np.array([[stand.x, stand.z] for stand in approach(plan, scene, target)]).reshape(-1, 2)


def _beside(plan: FloorPlan, scene: Scene, target: int) -> Iterator[Stand]:
    """Free cells nearest to the target's bounding box, on the target's side of every wall."""
    low, high = (corner[[0, 2]] for corner in scene.aabb(target))
    for radius in (RADIUS, 0.2, SQUEEZE):
        points = plan.point(np.argwhere(plan.clearance >= radius))
        edge = np.clip(points, low, high)
        gap = np.linalg.norm(points - edge, axis=1)
        points, edge, gap = points[gap < 1.5], edge[gap < 1.5], gap[gap < 1.5]
        free = ~_walled(plan, scene, points, edge)
        if free.any():
            chosen = np.flatnonzero(free & (gap <= gap[free].min() + 0.15))
            for k in chosen[np.argsort(gap[chosen], kind="stable")]:
                yield Stand(target, float(points[k, 0]), float(points[k, 1]), _yaw(edge[k] - points[k]), float(gap[k]))
            return


def _walled(plan: FloorPlan, scene: Scene, starts: Array, ends: Array) -> Mask:
    """(N,) whether a wall, a window or a door stands between (N, 2) points and (N, 2) others."""
    parts = [thing.id for thing in scene.objects if thing.category in ("wall", "window", "door")]
    # The last 5 cm do not count: a screen hangs so close to its wall that both share a cell.
    far = np.linalg.norm(ends - starts, axis=1)
    share = (np.linspace(0.0, 1.0, 60) * np.maximum(0.0, 1.0 - 0.05 / np.maximum(far, 1e-6))[:, None])[..., None]
    lines = starts[:, None] + share * (ends - starts)[:, None]
    return np.asarray(plan.at(np.isin(plan.owners, parts), lines).any(-1))


def _seats(plan: FloorPlan, scene: Scene, target: int) -> Iterator[Stand]:
    """In front of each side from which a seat can be sat on: the front, of a bed the long sides too; the middle first."""
    thing = scene.by_id[target]
    asset = scene.assets[thing.asset]
    if asset.seat_height is None:
        return
    turn = matrix_from_quaternion(np.array(thing.rotation))
    sides = (0.0, np.pi / 2, -np.pi / 2) if thing.category == "bed" else (0.0,)
    height = asset.seat_height + thing.position[1] - plan.floor
    others = replace(plan, blocked=plan.blocked & (plan.owners != target))
    for stand_off, margin in ((STAND_OFF, ARM_ROOM), (STAND_OFF, 0.35), (0.6, 0.35), (0.36, 0.35)):
        found = [
            Stand(target, float(place[0]), float(place[1]), yaw, stand_off, height)
            for side in sides
            for place, yaw in _along(scene, target, turn, side, stand_off, margin)
            if plan.at(plan.clearance, place) >= min(RADIUS, stand_off - 0.1)
            and others.clear(place, place - stand_off * _facing(yaw), 0.2)
        ]
        yield from found
        if found:
            return


def _along(
    scene: Scene, target: int, turn: Array, side: float, stand_off: float, margin: float
) -> list[tuple[Array, float]]:
    """Places in front of one side of an object and where its front looks, from the middle of the side outwards."""
    thing = scene.by_id[target]
    asset = scene.assets[thing.asset]
    out, along = _facing3(side), _facing3(side + np.pi / 2)
    points = np.concatenate(asset.hulls) if asset.hulls else asset.mesh.vertices
    edge, reach = float((points @ out).max()), float(np.ptp(points @ along)) / 2
    offsets = np.arange(0.0, max(reach - margin, 0.0) + 1e-9, 0.2)
    facing = (turn @ out)[[0, 2]]
    places = [out * (edge + stand_off) + along * step for step in [*offsets, *-offsets[1:]]]
    places.sort(key=lambda place: abs(float(place @ along)))
    return [((turn @ place + thing.position)[[0, 2]], _yaw(facing)) for place in places]


def _facing(yaw: float) -> Array:
    return np.array([np.sin(yaw), np.cos(yaw)])


def _facing3(yaw: float) -> Array:
    return np.array([np.sin(yaw), 0.0, np.cos(yaw)])


def _yaw(direction: Array) -> float:
    return float(np.arctan2(direction[0], direction[1]))


# -- rasterising -------------------------------------------------------------------------------------------------------
def _extent(scene: Scene) -> tuple[Array, tuple[int, int]]:
    corners = [corner[[0, 2]] for thing in scene.objects for corner in scene.aabb(thing.id)]
    corners += [np.array(pair) for room in scene.rooms for pair in ((room.x0, room.z0), (room.x1, room.z1))]
    corners.append(np.array([scene.start.x, scene.start.z]))
    low = np.floor((np.min(corners, axis=0) - 0.5) / CELL) * CELL
    nx, nz = np.ceil((np.max(corners, axis=0) + 0.5 - low) / CELL).astype(int)
    return low, (int(nx), int(nz))


def _hulls(scene: Scene, thing: SceneObject, pose: Array | None, floor: float) -> Iterator[Array]:
    """The convex pieces of an object that stand on this storey, (K, 3) world points each; ceilings left out."""
    if thing.category == "ceiling":
        return
    place = np.array([*thing.position, *thing.rotation]) if pose is None else np.asarray(pose)
    turn = matrix_from_quaternion(place[3:])
    for hull in scene.assets[thing.asset].hulls:
        points = hull.astype(float) @ turn.T + place[:3]
        if points[:, 1].max() > floor + OBSTACLE_HEIGHTS[0] and points[:, 1].min() < floor + STOREY:
            yield points


def _raster(points: Array, low: Array, shape: tuple[int, int]) -> tuple[Mask, tuple[slice, slice]]:
    """Cells whose centre is within half a cell of the convex hull of (K, 2) points, and the window that they lie in."""
    first = np.clip(np.floor((points.min(0) - low) / CELL).astype(int) - 1, 0, shape)
    last = np.clip(np.ceil((points.max(0) - low) / CELL).astype(int) + 1, 0, shape)
    where = (slice(first[0], last[0]), slice(first[1], last[1]))
    centres = (np.moveaxis(np.mgrid[where], 0, -1) + 0.5) * CELL + low
    sides = _sides(points)
    return np.asarray((centres @ sides[:, :2].T + sides[:, 2] <= CELL / 2).all(-1)), where


def _sides(points: Array) -> Array:
    """(S, 3) outward half-planes of the convex hull of (K, 2) points; of their box if they lie on one line."""
    try:
        return np.asarray(ConvexHull(points).equations)
    except QhullError:
        (x0, z0), (x1, z1) = points.min(0), points.max(0)
        return np.array([[-1.0, 0.0, x0], [1.0, 0.0, -x1], [0.0, -1.0, z0], [0.0, 1.0, -z1]])


def turns(path: Array, tolerance: float = 0.2, degrees: float = 30.0) -> int:
    """How often a polyline (N, 2) turns by more than so many degrees, once simplified (Douglas and Peucker, metres)."""
    simple = approximate_polygon(np.asarray(path), tolerance)  # type: ignore[no-untyped-call]
    legs = np.diff(simple, axis=0)
    bearing = np.arctan2(legs[:, 0], legs[:, 1])
    return int((np.abs(wrap_angle(np.diff(bearing))) > np.radians(degrees)).sum())


def rooms_on(scene: Scene, path: Array) -> tuple[str, ...]:
    """Names of the rooms that a polyline (N, 2) passes through, in order."""
    points = np.concatenate([_samples(a, b) for a, b in pairwise(path)] or [path])
    names: list[str] = []
    for x, z in points:
        name = room_at(scene, x, z)
        if name and (not names or names[-1] != name):
            names.append(name)
    return tuple(names)


def room_at(scene: Scene, x: float, z: float, floor: float = 0.0) -> str:
    """Name of the room that a point lies in; empty between rooms."""
    inside: Sequence[str] = [
        room.name
        for room in scene.rooms
        if room.x0 <= x <= room.x1 and room.z0 <= z <= room.z1 and abs(room.floor - floor) < 0.5
    ]
    return inside[0] if inside else ""
