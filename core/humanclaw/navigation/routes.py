"""Where a body can go: occupancy on a 5 cm grid, geodesic distances, routes and standing places (paper, section 4.1).

A FloorPlan is one storey; Storeys are all storeys of a scene with the stairs between them. Points on a floor are (..., 2) arrays
of x and z, points in the house (..., 3) arrays of x, y and z; metres, world frame. A standing place faces a yaw in radians.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation, distance_transform_edt, label, uniform_filter
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
STEP: Final = 0.26
"""The highest step that is climbed or stepped down, metres."""
APRON: Final = 0.7
"""So far before its first and after its last step a staircase knows the floor that it stands on, metres."""
STOREY: Final = 3.0
"""What begins so far above a floor is nothing to those who stand on it, metres: they do not even see that it hides anything."""
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
    ground: Array
    """Height in the world of what one stands on in each cell, metres; NaN where this plan has no floor."""
    floor: float = 0.0
    slope: Array | None = None
    """Only on stairs: (2, ...) rise over run along x and z, taken over two steps; at that scale a staircase is a ramp."""

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
        ground = np.full(shape, floor)
        plan = cls((float(low[0]), float(low[1])), blocked, movable, owners, tops, (under, over), ground, floor)
        inside = plan._indoors(scene)
        return replace(plan, blocked=blocked | ~inside, ground=np.where(inside, ground, np.nan))

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
        cost[~self.fits(SQUEEZE)] = -1.0
        return np.asarray(cost)

    def fits(self, radius: float) -> Mask:
        """Cells in which a body of this radius can stand."""
        return np.asarray((self.clearance >= radius) & np.isfinite(self.ground))

    @cached_property
    def steepness(self) -> Array:
        """Metres walked to a metre of floor: 1 on the flat."""
        return np.ones(self.blocked.shape) if self.slope is None else np.sqrt(1.0 + (self.slope**2).sum(0))

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


# -- storeys -----------------------------------------------------------------------------------------------------------
@dataclass(frozen=True, eq=False)
class Storeys:
    """All storeys of a scene, lowest first, and between each and the next the stairs that join them; all on one raster.

    Stairs are whatever climbs from one floor to the next in steps of at most STEP: they need no label. A scene with one floor is
    one plan.
    """

    plans: tuple[FloorPlan, ...]

    @classmethod
    def of(cls, scene: Scene, moved: Mapping[int, Array] | None = None) -> Storeys:
        """moved: object id to (7,) pose, for movable things that are not where the scene says."""
        floors = [FloorPlan.of(scene, floor, moved) for floor in floors_of(scene)]
        plans = floors[:1]
        for lower, upper in pairwise(floors):
            plans += [_staircase(scene, lower, upper), upper]
        return cls(tuple(plans))

    @property
    def floors(self) -> tuple[FloorPlan, ...]:
        """The storeys alone."""
        return tuple(plan for plan in self.plans if plan.slope is None)

    def with_obstacle(self, point: Array, radius: float) -> Storeys:
        """The same with one more round obstacle on the plan of a (3,) point."""
        k, plans = int(self.level(point)), list(self.plans)
        plans[k] = plans[k].with_obstacle(point[[0, 2]], radius)
        return Storeys(tuple(plans))

    def level(self, points: Array) -> NDArray[np.int64]:
        """(...) index of the plan that each of (..., 3) points is on: the highest ground that is not above it.

        The points may be feet or hips: what is above a floor is never so low.
        """
        points = np.asarray(points, float)
        # Where stairs and a storey share the floor before the first step, the storey is meant.
        grounds = np.stack(
            [plan.at(plan.ground, points[..., [0, 2]]) + 0.01 * (plan.slope is None) for plan in self.plans]
        )
        below = np.where(grounds <= points[..., 1] + 0.1, grounds, -np.inf)
        return np.asarray(len(self.plans) - 1 - below[::-1].argmax(0))

    def solid(self) -> Storeys:
        """The same, with movable things in the way where they stand: for those who must not count on pushing."""
        return Storeys(tuple(replace(plan, blocked=plan.blocked | plan.movable) for plan in self.plans))

    def distances(self, start: Array, radius: float = RADIUS) -> Array:
        """(P, x cell, z cell) metres to walk from (3,) start to each cell of each plan; infinite where there is no way."""
        weights = [np.where(plan.fits(radius), plan.steepness, -1.0) for plan in self.plans]
        return self.search(weights, np.asarray(start, float)[None])[0]

    def starts(self, start: Array, room: float = 0.5) -> tuple[Array, ...]:
        """For each storey, lowest first, the (N, 3) places with so much room around them that can be walked to from (3,) start.

        What can be walked to can be walked from: any of them is a start for any target that one of them reaches.
        """
        known = np.isfinite(self.distances(start))
        return tuple(
            _on(plan, plan.point(np.argwhere(known[k] & (plan.clearance >= room))))
            for k, plan in enumerate(self.plans)
            if plan.slope is None
        )

    def approach(self, scene: Scene, target: int, *, sit: bool = False) -> tuple[Stand, ...]:
        """Standing places at a target, on whichever storey it is; see the function of this name."""
        return tuple(stand for plan in self.floors for stand in approach(plan, scene, target, sit=sit))

    def near(self, scene: Scene, target: int) -> Array:
        """(N, 3) places from which a target counts as reached: the goals that geodesic distances are measured to."""
        return np.array([stand.place for stand in self.approach(scene, target)]).reshape(-1, 3)

    def search(self, weights: Sequence[Array], starts: Array) -> tuple[Array, MCP_Geometric]:
        """Costs of the cheapest way from the nearest of (N, 3) starts to each cell of each plan, and the search itself.

        weights: metres that a metre through a cell counts for, -1 for no way; an array a plan. Between two plans lies a layer
        that is open where both know the same ground: there one passes from one to the other.
        """
        layers = [weights[0]]
        for k, (lower, upper) in enumerate(pairwise(self.plans)):
            same = (weights[k] > 0) & (weights[k + 1] > 0) & (np.abs(lower.ground - upper.ground) < 0.05)
            # A little dearer than either plan, or ways would run along between them.
            layers += [np.where(same, 1.01 * np.maximum(weights[k], weights[k + 1]), -1.0), weights[k + 1]]
        search = MCP_Geometric(np.stack(layers), sampling=(1e-4, CELL, CELL))
        found, _ = search.find_costs([(2 * int(k), *map(int, cell)) for k, cell in self._entries(weights, starts)])
        return np.asarray(found[::2]), search

    def _entries(self, weights: Sequence[Array], starts: Array) -> Iterator[tuple[int, NDArray[np.int64]]]:
        """The open cell nearest to each start, on the start's own plan."""
        for start, k in zip(starts, self.level(starts), strict=True):
            yield k, _nearest(self.plans[k], weights[k] > 0, start[[0, 2]])

    def at(self, grids: Array, points: Array) -> Array:
        """(...) values of a grid a plan (P, x cell, z cell) at (..., 3) points."""
        points = np.asarray(points, float)
        index = self.plans[0].cell(points[..., [0, 2]])
        return np.asarray(grids[self.level(points), index[..., 0], index[..., 1]])

    def geodesic(self, start: Array, goals: Array) -> float:
        """Length in metres of the shortest way from (3,) start to the nearest of (M, 3) goals; infinite if there is none.

        Measured along the slope of stairs. A body of RADIUS first; if that is too wide for some door, a narrower one.
        """
        for radius in (RADIUS, 0.2, SQUEEZE):
            routes = Routes.of(self, start, radius=radius)
            cheapest = float(np.min(routes.to(np.atleast_2d(goals)), initial=np.inf))
            if np.isfinite(cheapest):
                legs = routes.route(goals)
                # The eight directions of a grid overestimate by up to 8 %; the pulled path may keep off walls. Take the less.
                return min(cheapest, sum(leg.length for leg in legs)) if legs else cheapest
        return float("inf")


def floors_of(scene: Scene) -> tuple[float, ...]:
    """Heights of the floors that rooms stand on, lowest first; that of the start if the scene has no rooms."""
    found: list[float] = []
    for floor in sorted({room.floor for room in scene.rooms} or {scene.start.floor}):
        if not found or floor - found[-1] > 0.5:
            found.append(floor)
    return tuple(found)


def _staircase(scene: Scene, lower: FloorPlan, upper: FloorPlan) -> FloorPlan:
    """The plan of what leads from one storey to the next. Nobody passes it if nothing does."""
    pieces = list(_static(scene, lower.floor + 0.05, upper.floor + OBSTACLE_HEIGHTS[1]))
    masks = [(hull, *_raster(hull[:, [0, 2]], np.array(lower.origin), lower.blocked.shape)) for hull in pieces]
    tops = np.full(lower.blocked.shape, -np.inf)
    for hull, mask, where in masks:
        if hull[:, 1].max() < upper.floor - 0.05:
            tops[where] = np.where(mask, np.maximum(tops[where], hull[:, 1].max()), tops[where])
    ground = _with_aprons(_climb(tops, lower, upper), lower, upper)
    known = np.isfinite(ground)
    if not known.any():
        return replace(lower, blocked=~known, ground=ground, slope=np.zeros((2, *ground.shape)))
    near = ground[tuple(distance_transform_edt(~known, return_distances=False, return_indices=True))]
    blocked = _ledges(ground)
    for hull, mask, where in masks:
        above = hull[:, 1].max() - near[where] > STEP
        blocked[where] |= mask & above & (hull[:, 1].min() - near[where] < OBSTACLE_HEIGHTS[1])
    movable = lower.movable & (near < lower.floor + 0.05)
    return replace(lower, blocked=blocked, movable=movable, ground=ground, slope=_slope(ground))


def _static(scene: Scene, low: float, high: float) -> Iterator[Array]:
    """Collision pieces of fixed things that reach into a range of heights, (K, 3) world points each."""
    for thing in scene.objects:
        if not thing.movable and thing.category != "ceiling":
            for hull in _placed(scene, thing, None):
                if hull[:, 1].max() > low and hull[:, 1].min() < high:
                    yield hull


def _climb(tops: Array, lower: FloorPlan, upper: FloorPlan) -> Array:
    """The tops that are reached from the lower floor step by step and lead to the upper one; not finite elsewhere."""
    reached = np.full(tops.shape, np.nan)
    reached[~np.isfinite(tops) & ~lower.blocked] = lower.floor
    frontier = np.isfinite(reached)
    while frontier.any():
        new = np.zeros(tops.shape, bool)
        for axis, way in ((0, 1), (0, -1), (1, 1), (1, -1)):
            came = np.roll(np.where(frontier, reached, np.nan), way, axis)
            new |= np.isnan(reached) & np.isfinite(tops) & (np.abs(tops - came) <= STEP)
        reached[new] = tops[new]
        frontier = new
    steps = np.isfinite(tops) & np.isfinite(reached)
    parts, _ = label(steps, np.ones((3, 3)))
    beside = np.isfinite(upper.ground) & ~upper.blocked
    arrives = binary_dilation(beside, iterations=3) & (upper.floor - reached <= STEP) & steps
    return np.where(np.isin(parts, np.unique(parts[arrives])) & steps, reached, np.nan)


def _with_aprons(steps: Array, lower: FloorPlan, upper: FloorPlan) -> Array:
    """Steps with the floor around their lower and their upper end. Where both reach, the nearer end has it."""
    ends = [(plan, np.isfinite(steps) & (np.abs(steps - plan.floor) <= STEP)) for plan in (lower, upper)]
    gaps = [
        np.where(plan.blocked | np.isfinite(steps), np.inf, _gap(end)) if end.any() else np.full(steps.shape, np.inf)
        for plan, end in ends
    ]
    ground = steps.copy()
    for mine, other, plan in ((gaps[0], gaps[1], lower), (gaps[1], gaps[0], upper)):
        ground[(mine <= APRON) & (mine <= other)] = plan.floor
    return ground


def _gap(mask: Mask) -> Array:
    return np.asarray(distance_transform_edt(~mask) * CELL)


def _ledges(ground: Array) -> Mask:
    """Cells beside which the ground drops or rises by more than a step."""
    along_x, along_z = (np.abs(np.diff(ground, axis=axis)) > STEP for axis in (0, 1))
    before = np.pad(along_x, ((0, 1), (0, 0))) | np.pad(along_z, ((0, 0), (0, 1)))
    return np.asarray(before | np.pad(along_x, ((1, 0), (0, 0))) | np.pad(along_z, ((0, 0), (1, 0))))


def _slope(ground: Array) -> Array:
    """(2, ...) gradient of the ground after it is smoothed over the 0.55 m of two steps."""
    known = np.isfinite(ground)
    share = uniform_filter(known.astype(float), 11)
    smooth = uniform_filter(np.where(known, ground, 0.0), 11) / np.maximum(share, 1e-6)
    slope = np.array(np.gradient(smooth, CELL))
    return np.where(known, slope, 0.0)


# -- routes ------------------------------------------------------------------------------------------------------------
@dataclass(frozen=True, eq=False)
class Leg:
    """A part of a route on one plan: a storey, or the stairs between two."""

    plan: FloorPlan
    points: Array
    """(N, 2) polyline."""

    @property
    def samples(self) -> Array:
        """(M, 2) points along it, at most half a cell apart."""
        return np.concatenate([_samples(a, b) for a, b in pairwise(self.points)])

    @property
    def length(self) -> float:
        """Metres, along the slope where it climbs."""
        return sum(
            float(self.plan.at(self.plan.steepness, _samples(a, b)).mean() * np.linalg.norm(b - a))
            for a, b in pairwise(self.points)
        )


@dataclass(frozen=True, eq=False)
class Routes:
    """Cheapest routes from one start to everywhere."""

    storeys: Storeys
    start: Array
    """(3,)"""
    costs: Array
    """(P, x cell, z cell) what the cheapest route to each cell of each plan costs, metres; infinite where there is none."""
    _search: Any

    @classmethod
    def of(cls, storeys: Storeys, start: Array, *, radius: float | None = None) -> Routes:
        """Search from (3,) start. With a radius the plain shortest way of a body that wide; without, one that likes room.

        A start where no body fits begins at the nearest cell where one does.
        """
        start = np.asarray(start, float)
        weights = [
            plan.cost if radius is None else np.where(plan.fits(radius), plan.steepness, -1.0) for plan in storeys.plans
        ]
        costs, search = storeys.search(weights, start[None])
        return cls(storeys, start, costs, search)

    def to(self, points: Array) -> Array:
        """(..., 3) points to the cost of getting there, metres; infinite if it is impossible."""
        return self.storeys.at(self.costs, points)

    def route(self, goals: Array) -> tuple[Leg, ...]:
        """The way to the cheapest of (M, 3) goals, pulled straight on each plan; empty if none can be reached."""
        goals = np.atleast_2d(goals)
        costs = self.to(goals)
        if not len(goals) or not np.isfinite(costs).any():
            return ()
        goal = goals[int(np.argmin(costs))]
        end = (2 * int(self.storeys.level(goal)), *map(int, self.storeys.plans[0].cell(goal[[0, 2]])))
        cells = np.array(self._search.traceback(end))
        cells = cells[[0, *range(1, len(cells) - 1), -1]]
        points = self.storeys.plans[0].point(cells[:, 1:])
        points[0], points[-1] = self.start[[0, 2]], goal[[0, 2]]
        # Storeys are layers 0, 4, 8, ..., stairs 2, 6, ...; what lies between belongs to the storey.
        return tuple(self._legs(points, np.where(cells[:, 0] % 4 == 2, cells[:, 0] // 2, 2 * ((cells[:, 0] + 1) // 4))))

    def _legs(self, points: Array, levels: NDArray[np.int64]) -> Iterator[Leg]:
        """(N, 2) points, cut where the plan changes; stairs reach from the floor before them to the floor after them."""
        changes = [0, *(np.flatnonzero(np.diff(levels)) + 1), len(points)]
        for first, last in pairwise(changes):
            plan = self.storeys.plans[levels[first]]
            part = points[first:last] if plan.slope is None else points[max(first - 1, 0) : last + 1]
            yield Leg(plan, part[_pull(plan, part)])


@dataclass(frozen=True, eq=False)
class Flight:
    """Steps in one direction, along their middle line."""

    foot: Array
    """(2,) where the first of them begins."""
    way: Array
    """(2,) unit vector of travel."""
    edges: Array
    """(N,) how far along it steps up or down, beginning with 0, metres."""
    levels: Array
    """(N + 1,) heights before the first edge and after each, metres, world frame."""
    ends: Array
    """(2, 2) where the route enters and leaves it."""

    def point(self, along: float) -> Array:
        return np.asarray(self.foot + along * self.way)

    @property
    def yaw(self) -> float:
        return _yaw(self.way)


def flights(leg: Leg) -> tuple[Flight, ...]:
    """The flights of stairs on a leg, in the order in which they are met."""
    if leg.plan.slope is None:
        return ()
    points = leg.samples
    change = np.diff(leg.plan.at(leg.plan.ground, points))
    steps = _steps(change)
    apart = np.linalg.norm(np.diff(points[steps], axis=0), axis=1) > 0.6
    groups = np.split(steps, np.flatnonzero(apart | (np.diff(np.sign(change[steps])) != 0)) + 1)
    found = (
        _flight(leg.plan, points[[group[0], group[-1] + 1]], float(np.sign(change[group[0]])))
        for group in groups
        if len(group)
    )
    return tuple(flight for flight in found if flight)


def _flight(plan: FloorPlan, ends: Array, sign: float) -> Flight | None:
    """The flight that a path enters at the first of (2, 2) points and leaves at the second; sign: 1 for up, -1 for down.

    None if there is no step on its middle line: the path crossed the corner of one at the edge of the stairs.
    """
    assert plan.slope is not None
    middle = ends.mean(0)
    slope = np.array([plan.at(layer, _samples(ends[0], ends[1])).mean() for layer in plan.slope])
    way = sign * slope / max(float(np.linalg.norm(slope)), 1e-9)
    side = np.array([way[1], -way[0]])
    centre = middle + side * (_free(plan, middle, side) - _free(plan, middle, -side)) / 2
    reach = np.arange((ends[0] - centre) @ way - 0.12, (ends[1] - centre) @ way + 0.12, 0.01)
    ground = plan.at(plan.ground, centre + reach[:, None] * way)
    reach, ground = reach[np.isfinite(ground)], ground[np.isfinite(ground)]
    steps = _steps(np.diff(ground))
    if not len(steps):
        return None
    edges = (reach[steps] + reach[steps + 1]) / 2
    return Flight(centre + edges[0] * way, way, edges - edges[0], ground[[*steps, steps[-1] + 1]], ends)


def _steps(change: Array) -> NDArray[np.int64]:
    """Where heights change by a step; by more they change where a route joins from a floor below or above."""
    return np.flatnonzero((np.abs(change) > OBSTACLE_HEIGHTS[0]) & (np.abs(change) <= STEP))


def _free(plan: FloorPlan, point: Array, way: Array) -> float:
    """How far it is from a point to the side of its stairs, metres."""
    reach = np.arange(0.0, 1.5, CELL / 2)
    places = point + reach[:, None] * way
    open_ = np.isfinite(plan.at(plan.ground, places)) & ~plan.at(plan.blocked, places)
    return float(reach[int(np.argmin(np.append(open_[:-1], False)))])


def route(plan: FloorPlan, start: Array, goals: Array) -> Array | None:
    """On one storey: the polyline (N, 2) from (2,) start to the cheapest of (M, 2) goals, keeping off walls; None if there is no
    way."""
    legs = Routes.of(Storeys((plan,)), _on(plan, start)).route(_on(plan, goals))
    return legs[0].points if legs else None


def geodesic(plan: FloorPlan, start: Array, goals: Array) -> float:
    """On one storey: length in metres of the shortest way from (2,) start to the nearest of (M, 2) goals; infinite if there is
    none. See Storeys.geodesic."""
    return Storeys((plan,)).geodesic(_on(plan, start), _on(plan, np.atleast_2d(goals)))


def _on(plan: FloorPlan, points: Array) -> Array:
    """(..., 2) points as (..., 3) points on a storey's floor."""
    points = np.asarray(points, float)
    return np.stack([points[..., 0], np.full(points.shape[:-1], plan.floor), points[..., 1]], -1)


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
    floor: float = 0.0

    @property
    def point(self) -> Array:
        return np.array([self.x, self.z])

    @property
    def place(self) -> Array:
        """(3,) on the floor."""
        return np.array([self.x, self.floor, self.z])


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
                x, z = points[k].tolist()
                yield Stand(target, x, z, _yaw(edge[k] - points[k]), float(gap[k]), floor=plan.floor)
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
            Stand(target, float(place[0]), float(place[1]), yaw, stand_off, height, plan.floor)
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
    if thing.category != "ceiling":
        for points in _placed(scene, thing, pose):
            if points[:, 1].max() > floor + OBSTACLE_HEIGHTS[0] and points[:, 1].min() < floor + STOREY:
                yield points


def _placed(scene: Scene, thing: SceneObject, pose: Array | None) -> Iterator[Array]:
    """The convex pieces of an object, (K, 3) world points each. pose: (7,), by default where the scene says."""
    place = np.array([*thing.position, *thing.rotation]) if pose is None else np.asarray(pose)
    turn = matrix_from_quaternion(place[3:])
    for hull in scene.assets[thing.asset].hulls:
        yield hull.astype(float) @ turn.T + place[:3]


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
