"""Height maps seen from above, one per storey, for the soft shadows under and beside objects."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from humanclaw import Scene
from humanclaw.body import Array
from humanclaw_raster.buffers import Instances, OverheadMap, Pinhole
from humanclaw_raster.drawing import draw
from humanclaw_raster.lighting import PERSON
from humanclaw_raster.packing import Floats, Model
from humanclaw_raster.shading import TALLEST

CELL: Final = 0.04
"""Side of a cell of the map, metres. It is larger in scenes that would need more than MOST cells per side."""
MOST: Final = 1024
"""Cells along a side at most, a million a storey. Larger scenes get coarser shadows."""
WIDEST: Final = 40.0
"""The map need not hold the whole of a wider object, such as a ground, metres."""
AROUND: Final = 3
"""Cells on each side of the middle of STEPS steps that they can reach: a step is 1.5 cells long."""
_REACH: Final = 1.6
"""Distance from the pelvis within which all of the body and its neighbouring cells are, metres."""
_HIGH: Final = 1000.0
"""Height of the eye over the floor, metres: so high that the lines of sight are nearly parallel."""


class OverheadMapper:
    """Keeps the maps of all objects.

    People are on a map only where they are seen from outside: drawn anew for each picture, each costs time.
    """

    def __init__(self, scene: Scene, model: Model, instances: Instances, movers: Sequence[int]) -> None:
        """Draw the maps of all objects.

        instances: the body, then the objects of the scene. movers: rows of the objects that can move.
        """
        boxes = np.array([scene.aabb(obj.id) for obj in scene.objects]).reshape(-1, 2, 3)
        self._model, self._rows = model, np.array(movers, int)
        self._movers = _order(model, instances, movers)
        self._floors = np.array(sorted({room.floor for room in scene.rooms} or {boxes[:, 0, 1].min(initial=0.0)}))
        points = boxes[np.ptp(boxes, axis=1).max(axis=1, initial=0.0) < WIDEST].reshape(-1, 3)
        points = np.concatenate([points, [[scene.start.x, scene.start.floor, scene.start.z]]])
        low, high = points.min(axis=0), points.max(axis=0)
        self._cell = max(CELL, float((high - low)[[0, 2]].max()) / MOST)
        # Two more: the outermost cells stay empty.
        self._shape = tuple(np.ceil((high - low)[[2, 0]] / self._cell).astype(int) + 2)
        self._middle = (low + high) / 2
        self._still, solid = [], np.array([obj.category != PERSON for obj in scene.objects], bool)
        for floor in self._floors:
            # 0.3 m lower, so that objects which sink into the floor count. TALLEST leaves out walls and ceilings.
            on_it = solid & (boxes[:, 0, 1] > floor - 0.3) & (boxes[:, 1, 1] < floor + TALLEST)
            rows = sorted({1 + int(k) for k in np.flatnonzero(on_it)} - set(movers))
            self._still.append(self._drawn(instances, _order(model, instances, rows), float(floor), None))
        self._settle(instances)

    def now(self, instances: Instances) -> OverheadMap:
        """Return the map with movable objects at their current places. They mostly stay there for many pictures."""
        if not np.array_equal(self._poses, _poses(instances, self._rows)):
            self._settle(instances)
        return self._map

    def with_people(self, instances: Instances, rows: Sequence[int]) -> OverheadMap:
        """Return the map of now(), and people on it. rows: of their instances."""
        still = self.now(instances)
        if not rows:
            return still
        heights, around = still.heights.copy(), still.around.copy()
        for row in rows:
            near = self._near(instances.place[row])
            # On the map of a lower storey it would shade all that is under it.
            storey = max(0, int(np.searchsorted(self._floors, instances.place[row, 1])) - 1)
            floor, order = float(self._floors[storey]), _order(self._model, instances, [row])
            with np.errstate(divide="ignore"):
                body = np.float32(floor + _HIGH) - np.float32(1) / self._drawn(instances, order, floor, None)[near]
            heights[storey][near] = np.maximum(heights[storey][near], body)
            around[storey][near] = np.maximum(around[storey][near], _around(heights[storey : storey + 1, *near])[0])
        return still._replace(heights=heights, around=around)

    def _near(self, place: Array) -> tuple[slice, slice]:
        """Return the rows and columns of the map around a person's place."""
        column, row = ((place[[0, 2]] - self._map.corner) / self._cell).astype(int).tolist()
        reach = int(_REACH / self._cell)
        # The outermost cells stay empty.
        corners = (row - reach, column - reach), (row + reach, column + reach)
        first, last = np.clip(corners, 1, np.subtract(self._shape, 1))
        return slice(first[0], last[0]), slice(first[1], last[1])

    def _settle(self, instances: Instances) -> None:
        self._poses, maps = _poses(instances, self._rows), []
        for floor, still in zip(self._floors, self._still, strict=True):
            inverse_depth = self._drawn(instances, self._movers, float(floor), still)
            with np.errstate(divide="ignore"):
                maps.append(np.float32(floor + _HIGH) - np.float32(1) / inverse_depth)
            maps[-1][[0, -1]] = maps[-1][:, [0, -1]] = -np.inf
        corner, heights = self._middle[[0, 2]] - np.array(self._shape[::-1]) / 2 * self._cell, np.stack(maps)
        self._map = OverheadMap(heights, _around(heights), self._floors, corner, self._cell)

    def _drawn(self, instances: Instances, order: NDArray[np.int32], floor: float, before: Floats | None) -> Floats:
        inverse_depth = np.zeros(self._shape, np.float32) if before is None else before.copy()
        surface = np.empty(self._shape, np.int32)
        eye = np.array([self._middle[0], floor + _HIGH, self._middle[2]])
        # The eye looks down; columns go along +X and rows along +Z.
        axes = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
        draw(self._model, instances, Pinhole(eye, axes, _HIGH / self._cell), order, inverse_depth, surface)
        return inverse_depth


def _around(heights: Floats) -> Floats:
    """Return the greatest height within AROUND cells of each cell, along both axes."""
    for axis in (1, 2):
        inner = np.moveaxis(heights, axis, 0)
        wide = np.pad(inner, ((AROUND, AROUND), (0, 0), (0, 0)), constant_values=-np.inf)
        near = [wide[k : k + len(inner)] for k in range(2 * AROUND + 1)]
        heights = np.moveaxis(np.maximum.reduce(near), 0, axis)
    return np.ascontiguousarray(heights)


def _poses(instances: Instances, rows: NDArray[np.int64]) -> Array:
    """Return (N, 12) place and rotation of some instances."""
    return np.concatenate([instances.place[rows], instances.turn[rows].reshape(-1, 9)], axis=1)


def _order(model: Model, instances: Instances, rows: Sequence[int]) -> NDArray[np.int32]:
    """Return (K, 2) row and cluster of all clusters of some instances."""
    pairs = [(row, cluster) for row in rows for cluster in range(*model.meshes[instances.mesh[row]])]
    return np.array(pairs, np.int32).reshape(-1, 2)
