"""Shortest ways: all floors of a scene with the stairs between them, distance fields, and routes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, Final
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray
from skimage.graph import MCP_Geometric

from humanclaw.body.pose import Array
from humanclaw.world.navigation.occupancy import (
    CELL,
    OBSTACLE_HEIGHTS,
    RADIUS,
    Mask,
    OccupancyGrid,
    floors_of,
    on_floor,
    samples_along,
)
from humanclaw.world.navigation.stairs import staircase
from humanclaw.world.scene import Scene


@dataclass(frozen=True, eq=False)
class MultiFloorMap:
    """All floors of a scene, lowest first, and between each and the next the stairs that join them; all on one raster.

    Stairs are whatever climbs from one floor to the next in steps of at most STEP: they need no label. A scene with one
    floor is one grid.
    """

    grids: tuple[OccupancyGrid, ...]

    @classmethod
    def of(cls, scene: Scene, moved: Mapping[int, Array] | None = None, keep: bool = True) -> MultiFloorMap:
        """Build the grids of a scene. moved, keep: as for OccupancyGrid.of."""
        if not moved and scene in _MAPS:
            return _MAPS[scene]
        floors = [OccupancyGrid.of(scene, floor, moved, keep) for floor in floors_of(scene)]
        grids = floors[:1]
        for lower, upper in pairwise(floors):
            grids += [staircase(scene, lower, upper), upper]
        made = cls(tuple(grids))
        return made if moved else _MAPS.setdefault(scene, made)

    @property
    def floors(self) -> tuple[OccupancyGrid, ...]:
        """The floors alone, without the stairs."""
        return tuple(grid for grid in self.grids if grid.slope is None)

    def with_obstacle(self, point: Array, radius: float) -> MultiFloorMap:
        """Return the same with one more round obstacle on the grid of a (3,) point."""
        k, grids = int(self.level(point)), list(self.grids)
        grids[k] = grids[k].with_obstacle(point[[0, 2]], radius)
        return MultiFloorMap(tuple(grids))

    def level(self, points: Array) -> NDArray[np.int64]:
        """Return (...) index of the grid that each of (..., 3) points is on: the highest ground that is not above it.

        The points may be feet or hips: both lie between their own floor and the next.
        """
        points = np.asarray(points, float)
        # Where stairs and a floor share the floor before the first step, the floor is meant.
        grounds = np.stack(
            [grid.at(grid.ground, points[..., [0, 2]]) + 0.01 * (grid.slope is None) for grid in self.grids]
        )
        below = np.where(grounds <= points[..., 1] + 0.1, grounds, -np.inf)  # Feet sink in a little.
        return np.asarray(len(self.grids) - 1 - below[::-1].argmax(0))

    def solid(self) -> MultiFloorMap:
        """Return the same, with movable objects in the way where they stand: for those who must not count on
        pushing."""
        return MultiFloorMap(tuple(replace(grid, blocked=grid.blocked | grid.movable) for grid in self.grids))

    def open(self, radius: float) -> list[Array]:
        """Metres that a metre of each cell of each grid counts for, for a body of this radius; -1 where it does not
        fit."""
        return [np.where(grid.fits(radius), grid.steepness, -1.0) for grid in self.grids]

    def distances(self, starts: Array, radius: float = RADIUS) -> Array:
        """Return (G, x cell, z cell) metres to walk from the nearest of (..., 3) starts; infinite where there is no
        way.

        A start where no body fits begins at the nearest cell where one does.
        """
        return self.search(self.open(radius), np.asarray(starts, float).reshape(-1, 3))[0]

    def starts(self, start: Array, room: float = 0.5) -> tuple[Array, ...]:
        """For each floor, lowest first, the (N, 3) places with so much room around them that can be walked to from (3,)
        start.

        What can be walked to can be walked from: any of them is a start for any target that one of them reaches.
        """
        known = np.isfinite(self.distances(start))
        return tuple(
            on_floor(grid, grid.point(np.argwhere(known[k] & (grid.clearance >= room))))
            for k, grid in enumerate(self.grids)
            if grid.slope is None
        )

    def search(self, weights: Sequence[Array], starts: Array) -> tuple[Array, MCP_Geometric]:
        """Costs of the cheapest way from the nearest of (N, 3) starts to each cell of each grid, and the search itself.

        weights: metres that a metre through a cell counts for, -1 for no way; an array a grid. Between two grids lies a
        layer that is open where both know the same ground: there one passes from one to the other.
        """
        layers = [weights[0]]
        for k, (lower, upper) in enumerate(pairwise(self.grids)):
            same = (weights[k] > 0) & (weights[k + 1] > 0) & (np.abs(lower.ground - upper.ground) < OBSTACLE_HEIGHTS[0])
            # Slightly more expensive than either grid, or ways would run along between them.
            layers += [np.where(same, 1.01 * np.maximum(weights[k], weights[k + 1]), -1.0), weights[k + 1]]
        # Layers lie a tenth of a millimetre apart: a change between them costs nothing.
        search = MCP_Geometric(np.stack(layers), sampling=(1e-4, CELL, CELL))
        costs, _ = search.find_costs([tuple(entry) for entry in self._entries(np.stack(weights) > 0, starts).tolist()])
        return np.asarray(costs[::2]), search

    def _entries(self, free: Mask, starts: Array) -> NDArray[np.int64]:
        """Return (N, 3) layer and cell of the free cell nearest to each start, on the start's own grid.

        free: (G, x cell, z cell).
        """
        levels, cells = self.level(starts), self.grids[0].cell(starts[:, [0, 2]])
        for k in np.flatnonzero(~free[levels, cells[:, 0], cells[:, 1]]):
            cells[k] = _nearest(self.grids[levels[k]], free[levels[k]], starts[k, [0, 2]])
        return np.column_stack([2 * levels, cells])

    def at(self, grids: Array, points: Array) -> Array:
        """Return (...) values of an array a grid (G, x cell, z cell) at (..., 3) points."""
        points = np.asarray(points, float)
        index = self.grids[0].cell(points[..., [0, 2]])
        return np.asarray(grids[self.level(points), index[..., 0], index[..., 1]])


_MAPS: Final[WeakKeyDictionary[Scene, MultiFloorMap]] = WeakKeyDictionary()
"""The map of each scene as it is described; each episode in a house measures distances on it. Freed with the scene."""


@dataclass(frozen=True, eq=False)
class Segment:
    """A part of a route on one grid: a floor, or the stairs between two."""

    grid: OccupancyGrid
    points: Array
    """(N, 2) polyline."""

    @property
    def samples(self) -> Array:
        """(M, 2) points along it, at most half a cell apart."""
        return samples_along(self.points)[0]


@dataclass(frozen=True, eq=False)
class DistanceField:
    """How far it is on foot between the nearest of some places and everywhere in a house, and the ways there."""

    where: MultiFloorMap
    places: Array
    """(N, 3)"""
    metres: Array
    """(G, x cell, z cell) to each cell of each grid; infinite where there is no way."""
    _search: Any

    @classmethod
    def of(cls, where: MultiFloorMap, goals: Array, radius: float = RADIUS) -> DistanceField:
        """Search from (N, 3) goals, those left out where no body of this radius fits."""
        weights = where.open(radius)
        reachable = goals[where.at(np.stack(weights), goals) > 0]
        if not len(reachable):
            return cls(where, reachable, np.full((len(weights), *weights[0].shape), np.inf), None)
        return cls(where, reachable, *where.search(weights, reachable))

    @classmethod
    def comfortable(cls, where: MultiFloorMap, start: Array) -> DistanceField:
        """Search from (3,) start for a body that likes room: metres near walls count more (OccupancyGrid.cost).

        A start where no body fits begins at the nearest cell where one does.
        """
        start = np.asarray(start, float)[None]
        return cls(where, start, *where.search([grid.cost for grid in where.grids], start))

    def at(self, points: Array) -> Array:
        """Return (...) metres from (..., 3) points."""
        return self.where.at(self.metres, points)

    def path(self, place: Array) -> Array:
        """Find (N, 3) points on the ground from (3,) place to the nearest goal, a cell apart."""
        grids = self.where.grids
        cells = np.array([cell for cell in self._cells(place) if cell[0] % 2 == 0])[::-1]
        flat = grids[0].point(cells[:, 1:])
        heights = [grids[level].ground[x, z] for level, x, z in zip(cells[:, 0] // 2, *cells[:, 1:].T, strict=True)]
        return np.stack([flat[:, 0], heights, flat[:, 1]], -1)

    def route(self, goals: Array) -> tuple[Segment, ...]:
        """Find the way from the one place to the cheapest of (M, 3) goals, pulled straight on each grid.

        Empty if none can be reached.
        """
        goals = np.atleast_2d(goals)
        costs = self.at(goals)
        if not len(goals) or not np.isfinite(costs).any():
            return ()
        goal = goals[int(np.argmin(costs))]
        cells = np.array(self._cells(goal))
        cells = cells[[0, *range(1, len(cells) - 1), -1]]  # A way within one cell has two ends as well.
        points = self.where.grids[0].point(cells[:, 1:])
        points[0], points[-1] = self.places[0, [0, 2]], goal[[0, 2]]
        # Floors are layers 0, 4, 8, ..., stairs 2, 6, ...; what lies between belongs to the floor.
        return tuple(
            self._segments(points, np.where(cells[:, 0] % 4 == 2, cells[:, 0] // 2, 2 * ((cells[:, 0] + 1) // 4)))
        )

    def _cells(self, end: Array) -> list[tuple[int, ...]]:
        """Return the layers and cells on the way from the nearest place to (3,) end."""
        cell = self.where.grids[0].cell(end[[0, 2]])
        # scikit-image has no types.
        return self._search.traceback((2 * int(self.where.level(end)), *map(int, cell)))  # type: ignore[no-any-return]

    def _segments(self, points: Array, levels: NDArray[np.int64]) -> Iterator[Segment]:
        """(N, 2) points, cut where the grid changes; stairs reach from the floor before them to the floor after
        them."""
        changes = [0, *(np.flatnonzero(np.diff(levels)) + 1), len(points)]
        for first, last in pairwise(changes):
            grid = self.where.grids[levels[first]]
            part = points[first:last] if grid.slope is None else points[max(first - 1, 0) : last + 1]
            yield Segment(grid, part[_pull(grid, part)])


def _pull(grid: OccupancyGrid, path: Array) -> list[int]:
    """Return the indices of the points of a path that remain when every segment that loses nothing is pulled
    straight."""
    kept = list(_split(grid, path, 0, len(path) - 1)) + [len(path) - 1]
    index = 0
    while index + 2 < len(kept):
        if _as_cheap(grid, path, kept[index], kept[index + 2]):
            del kept[index + 1]
        else:
            index += 1
    return kept


def _split(grid: OccupancyGrid, path: Array, first: int, last: int) -> Iterator[int]:
    """Douglas and Peucker's recursion, with cost in the place of deviation."""
    if last - first < 2 or _as_cheap(grid, path, first, last):
        yield first
        return
    chord = path[last] - path[first]
    away = path[first + 1 : last] - path[first]
    far = np.abs(chord[0] * away[:, 1] - chord[1] * away[:, 0])
    # Ends are no place to split: a path that doubles back would recurse for ever.
    middle = first + 1 + int(np.argmax(far)) if far.max() > 1e-9 else (first + last) // 2
    yield from _split(grid, path, first, middle)
    yield from _split(grid, path, middle, last)


def _as_cheap(grid: OccupancyGrid, path: Array, first: int, last: int) -> bool:
    straight = _price(grid, path[[first, last]])
    # Measured on 16 routes: 9 points each, where without tolerance there are 14, and 1 % more cost.
    return straight <= 1.02 * _price(grid, path[first : last + 1]) + 0.02


def _price(grid: OccupancyGrid, path: Array) -> float:
    """Cost of a polyline, metres. Impassable cells are expensive and not infinite: a body may begin in one, as on a
    seat. 200 is more than any other cell can cost (37, see OccupancyGrid.cost)."""
    points, counts = samples_along(path)
    weights = grid.at(grid.cost, points)
    sums = np.add.reduceat(np.where(weights < 0, 200.0, weights), np.cumsum(counts) - counts)
    return float(sums / counts @ np.linalg.norm(np.diff(path, axis=0), axis=1))


def _nearest(grid: OccupancyGrid, free: Mask, point: Array) -> NDArray[np.int64]:
    """Return the free cell nearest to a point; its own if none is free."""
    cells = np.argwhere(free)
    if not len(cells):
        return grid.cell(point)
    return np.asarray(cells[int(np.argmin(np.linalg.norm(grid.point(cells) - point, axis=1)))])
