"""Stairs: whatever climbs from one floor to the next in steps of at most STEP; they need no label."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import scipy
from numpy.typing import NDArray

from humanclaw.body.pose import Array
from humanclaw.storage.cache import source_digest
from humanclaw.world.navigation.occupancy import (
    CELL,
    DRAWING,
    OBSTACLE_HEIGHTS,
    STEP,
    Mask,
    OccupancyGrid,
    gap_to,
    rasterize,
    samples,
    yaw_of,
)
from humanclaw.world.scene import Scene
from humanclaw.world.scene_cache import Arrays, kept

APRON: Final = 0.7
"""So far before its first and after its last step a staircase knows the floor that it stands on, metres. With .3 no
body fits there, and no upper floor of 14 houses is reached; with .5 ways are the same as with .7."""


def staircase(scene: Scene, lower: OccupancyGrid, upper: OccupancyGrid) -> OccupancyGrid:
    """Build the grid of the stairs from one storey to the next. Without stairs every cell is blocked."""
    walls = hashlib.sha256(lower.blocked.tobytes() + upper.blocked.tobytes()).hexdigest()
    flight = kept(scene, f"stairs {lower.floor} {walls}", source_digest(*DRAWING), lambda: _flight(scene, lower, upper))
    movable = lower.movable & (flight["near"] < lower.floor + OBSTACLE_HEIGHTS[0])
    return replace(lower, blocked=flight["blocked"], movable=movable, ground=flight["ground"], slope=flight["slope"])


def _flight(scene: Scene, lower: OccupancyGrid, upper: OccupancyGrid) -> Arrays:
    """Draw the stairs between two floors, without the objects that can be pushed. near: height of the nearest ground,
    metres; minus infinity without stairs."""
    pieces = list(_static(scene, lower.floor + OBSTACLE_HEIGHTS[0], upper.floor + OBSTACLE_HEIGHTS[1]))
    masks = [(hull, *rasterize(hull[:, [0, 2]], np.array(lower.origin), lower.blocked.shape)) for hull in pieces]
    tops = np.full(lower.blocked.shape, -np.inf)
    for hull, mask, where in masks:
        if hull[:, 1].max() < upper.floor - OBSTACLE_HEIGHTS[0]:
            tops[where] = np.where(mask, np.maximum(tops[where], hull[:, 1].max()), tops[where])
    ground = _with_aprons(_climb(tops, lower, upper), lower, upper)
    known = np.isfinite(ground)
    if not known.any():
        flat, none = np.zeros((2, *ground.shape)), np.full(ground.shape, -np.inf)
        return {"blocked": ~known, "ground": ground, "slope": flat, "near": none}
    near = ground[tuple(scipy.ndimage.distance_transform_edt(~known, return_distances=False, return_indices=True))]
    blocked = _ledges(ground)
    for hull, mask, where in masks:
        above = hull[:, 1].max() - near[where] > STEP
        blocked[where] |= mask & above & (hull[:, 1].min() - near[where] < OBSTACLE_HEIGHTS[1])
    return {"blocked": blocked, "ground": ground, "slope": _slope(ground), "near": near}


def _static(scene: Scene, low: float, high: float) -> Iterator[Array]:
    """Return collision pieces of fixed and hinged objects that reach into a range of heights; (K, 3) world points
    each."""
    for obj in scene.objects:
        if (obj.joint or not obj.movable) and obj.category != "ceiling":
            for hull in scene.hulls(obj.id):
                if hull[:, 1].max() > low and hull[:, 1].min() < high:
                    yield hull


def _climb(tops: Array, lower: OccupancyGrid, upper: OccupancyGrid) -> Array:
    """Return the tops that are reached from the lower floor step by step and lead to the upper one; not finite
    elsewhere."""
    reached = np.full(tops.shape, np.nan)
    reached[~np.isfinite(tops) & ~lower.blocked] = lower.floor
    flat, frontier = reached.ravel(), np.flatnonzero(np.isfinite(reached))
    while len(frontier):
        ways = [(frontier + way) % flat.size for way in (1, -1, tops.shape[1], -tops.shape[1])]
        new = [to[np.isnan(flat[to]) & (np.abs(tops.flat[to] - flat[frontier]) <= STEP)] for to in ways]
        frontier = np.unique(np.concatenate(new))
        flat[frontier] = tops.flat[frontier]
    steps = np.isfinite(tops) & np.isfinite(reached)
    parts, _ = scipy.ndimage.label(steps, np.ones((3, 3)))
    beside = np.isfinite(upper.ground) & ~upper.blocked
    # The raster may leave a gap before the floor: a cell in generated houses, here up to three.
    arrives = scipy.ndimage.binary_dilation(beside, iterations=3) & (upper.floor - reached <= STEP) & steps
    return np.where(np.isin(parts, np.unique(parts[arrives])) & steps, reached, np.nan)


def _with_aprons(steps: Array, lower: OccupancyGrid, upper: OccupancyGrid) -> Array:
    """Return steps with the floor around their lower and their upper end. Where both reach, the nearer end has it."""
    ends = [(grid, np.isfinite(steps) & (np.abs(steps - grid.floor) <= STEP)) for grid in (lower, upper)]
    gaps = [
        np.where(grid.blocked | np.isfinite(steps), np.inf, gap_to(end)) if end.any() else np.full(steps.shape, np.inf)
        for grid, end in ends
    ]
    ground = steps.copy()
    for mine, other, grid in ((gaps[0], gaps[1], lower), (gaps[1], gaps[0], upper)):
        ground[(mine <= APRON) & (mine <= other)] = grid.floor
    return ground


def _ledges(ground: Array) -> Mask:
    """Cells beside which the ground drops or rises by more than a step."""
    along_x, along_z = (np.abs(np.diff(ground, axis=axis)) > STEP for axis in (0, 1))
    before = np.pad(along_x, ((0, 1), (0, 0))) | np.pad(along_z, ((0, 0), (0, 1)))
    return np.asarray(before | np.pad(along_x, ((1, 0), (0, 0))) | np.pad(along_z, ((0, 0), (1, 0))))


def _slope(ground: Array) -> Array:
    """(2, ...) gradient of the ground after it is smoothed over the 0.55 m of two steps."""
    known = np.isfinite(ground)
    share = scipy.ndimage.uniform_filter(known.astype(float), 11)  # 11 cells of 5 cm.
    smooth = scipy.ndimage.uniform_filter(np.where(known, ground, 0.0), 11) / np.maximum(share, 1e-6)
    slope = np.array(np.gradient(smooth, CELL))
    return np.where(known, slope, 0.0)


@dataclass(frozen=True, eq=False)
class StairRun:
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
        return yaw_of(self.way)


def stair_runs(grid: OccupancyGrid, points: Array) -> tuple[StairRun, ...]:
    """Find the runs of stairs on a way of closely spaced (N, 2) points, in the order in which they are met."""
    if grid.slope is None:
        return ()
    change = np.diff(grid.at(grid.ground, points))
    steps = _steps(change)
    apart = np.linalg.norm(np.diff(points[steps], axis=0), axis=1) > 0.6  # A landing: treads are half as deep.
    groups = np.split(steps, np.flatnonzero(apart | (np.diff(np.sign(change[steps])) != 0)) + 1)
    flights = (
        _stair_run(grid, points[[group[0], group[-1] + 1]], float(np.sign(change[group[0]])))
        for group in groups
        if len(group)
    )
    return tuple(flight for flight in flights if flight)


def _stair_run(grid: OccupancyGrid, ends: Array, sign: float) -> StairRun | None:
    """Return the flight that a path enters at the first of (2, 2) points and leaves at the second; sign: 1 for up, -1
    for down.

    None if there is no step on its middle line: the path crossed the corner of one at the edge of the stairs.
    """
    assert grid.slope is not None
    middle = ends.mean(0)
    slope = np.array([grid.at(layer, samples(ends[0], ends[1])).mean() for layer in grid.slope])
    way = sign * slope / max(float(np.linalg.norm(slope)), 1e-9)
    side = np.array([way[1], -way[0]])
    centre = middle + side * (_free(grid, middle, side) - _free(grid, middle, -side)) / 2
    # Less than half a tread beyond both ends, or the next steps would be met; to a centimetre.
    reach = np.arange((ends[0] - centre) @ way - 0.12, (ends[1] - centre) @ way + 0.12, 0.01)
    ground = grid.at(grid.ground, centre + reach[:, None] * way)
    reach, ground = reach[np.isfinite(ground)], ground[np.isfinite(ground)]
    steps = _steps(np.diff(ground))
    if not len(steps):
        return None
    edges = (reach[steps] + reach[steps + 1]) / 2
    return StairRun(centre + edges[0] * way, way, edges - edges[0], ground[[*steps, steps[-1] + 1]], ends)


def _steps(change: Array) -> NDArray[np.int64]:
    """Where heights change by a step; by more they change where a route joins from a floor below or above."""
    return np.flatnonzero((np.abs(change) > OBSTACLE_HEIGHTS[0]) & (np.abs(change) <= STEP))


def _free(grid: OccupancyGrid, point: Array, way: Array) -> float:
    """How far it is from a point to the side of its stairs, metres; 1.5 at most, half of the widest stairs."""
    reach = np.arange(0.0, 1.5, CELL / 2)
    places = point + reach[:, None] * way
    open_ = np.isfinite(grid.at(grid.ground, places)) & ~grid.at(grid.blocked, places)
    return float(reach[int(np.argmin(np.append(open_[:-1], False)))])
