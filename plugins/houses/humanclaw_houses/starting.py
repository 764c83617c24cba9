"""Where bodies can walk in a finished house, and where one starts."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt, label
from skimage.graph import MCP_Geometric

from humanclaw.pose import matrix_from_quaternion
from humanclaw.scene import Placement, Scene, SceneObject

CELL = 0.05
BODY = 0.28
_LOW, _HIGH = 0.03, 1.9


@dataclass(frozen=True, eq=False)
class WalkMap:
    """A 5 cm grid over a house. clearance: (rows, columns) metres from each cell to the nearest thing that collides below head
    height; rows run along z, columns along x."""

    x0: float
    z0: float
    clearance: NDArray[np.float64]

    @classmethod
    def of(cls, scene: Scene, movable: bool = True) -> WalkMap:
        """movable: whether what can be moved counts as being in the way."""
        x0, z0 = (min(getattr(room, key) for room in scene.rooms) - 0.3 for key in ("x0", "z0"))
        x1, z1 = (max(getattr(room, key) for room in scene.rooms) + 0.3 for key in ("x1", "z1"))
        free = np.zeros((int((z1 - z0) / CELL) + 1, int((x1 - x0) / CELL) + 1), bool)
        for room in scene.rooms:  # the doorways between the rooms are 0.12 m of wall line
            free[_span(room.z0 - 0.12, room.z1 + 0.12, z0), _span(room.x0 - 0.12, room.x1 + 0.12, x0)] = True
        for thing in scene.objects:
            if movable or not thing.movable:
                for low, high in boxes(scene, thing):
                    if low[1] < _HIGH and high[1] > _LOW:
                        free[_span(low[2], high[2], z0), _span(low[0], high[0], x0)] = False
        return cls(x0, z0, np.asarray(distance_transform_edt(free)) * CELL)

    @cached_property
    def walkable(self) -> NDArray[np.bool_]:
        return np.asarray(self.clearance >= BODY + CELL / 2)

    @cached_property
    def main(self) -> NDArray[np.bool_]:
        """The largest area that can be walked in one piece."""
        areas, _ = label(self.walkable, np.ones((3, 3)))
        return np.asarray(areas == np.bincount(areas[areas > 0]).argmax())

    def cell(self, x: float, z: float) -> tuple[int, int]:
        return int((z - self.z0) / CELL), int((x - self.x0) / CELL)

    def point(self, row: int, column: int) -> tuple[float, float]:
        return self.x0 + (column + 0.5) * CELL, self.z0 + (row + 0.5) * CELL

    def near(self, low: NDArray[np.float64], high: NDArray[np.float64], reach: float) -> NDArray[np.bool_]:
        """Cells of the main area whose middle is at most `reach` from a box, seen from above."""
        rows, columns = np.indices(self.clearance.shape)
        x, z = self.x0 + (columns + 0.5) * CELL, self.z0 + (rows + 0.5) * CELL
        dx = np.maximum(np.maximum(low[0] - x, x - high[0]), 0)
        dz = np.maximum(np.maximum(low[2] - z, z - high[2]), 0)
        return np.asarray(self.main & (np.hypot(dx, dz) <= reach))

    def distances(self, goals: NDArray[np.bool_]) -> NDArray[np.float64]:
        """(rows, columns) metres to walk from each cell to the nearest goal; infinite where there is no way."""
        if not goals.any():
            return np.full(goals.shape, np.inf)
        costs = np.where(self.main, CELL, -1.0)
        return np.asarray(MCP_Geometric(costs).find_costs(np.argwhere(goals))[0])


def _span(low: float, high: float, origin: float) -> slice:
    return slice(
        max(0, int(np.floor((low - origin) / CELL + 1e-6))), max(0, int(np.ceil((high - origin) / CELL - 1e-6)))
    )


def boxes(scene: Scene, thing: SceneObject) -> list[tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """Lowest and highest corner of each collision hull of an object, in the world."""
    matrix = matrix_from_quaternion(np.array(thing.rotation))
    placed = [hull.astype(float) @ matrix.T + np.array(thing.position) for hull in scene.assets[thing.asset].hulls]
    return [(points.min(axis=0), points.max(axis=0)) for points in placed]


def choose_start(scene: Scene, rng: np.random.Generator) -> Placement:
    """A place with more than half a metre of room, 4 to 10 m on foot from the nearest couch if the house is large enough,
    in the hall if that is possible, facing the longest free line of sight."""
    walk = WalkMap.of(scene)
    roomy = walk.main & (walk.clearance > 0.55)
    couches = np.zeros_like(roomy)
    for couch in scene.of_category("couch"):
        couches |= walk.near(*scene.aabb(couch.id), 0.4)
    far = walk.distances(couches)
    well = roomy & (far > 4) & (far < 10)
    choices = [well & _inside(walk, scene, "hall"), well, roomy & (far > 2.5), roomy]
    cells = np.argwhere(next(choice for choice in choices if choice.any()))
    row, column = cells[int(rng.integers(len(cells)))]
    x, z = walk.point(int(row), int(column))
    return Placement(round(x, 3), round(z, 3), _view(walk, x, z))


def _inside(walk: WalkMap, scene: Scene, kind: str) -> NDArray[np.bool_]:
    mask = np.zeros(walk.clearance.shape, bool)
    for room in scene.rooms:
        if room.kind == kind:
            mask[_span(room.z0, room.z1, walk.z0), _span(room.x0, room.x1, walk.x0)] = True
    return mask


def _view(walk: WalkMap, x: float, z: float) -> float:
    """The yaw, of eight, in which one can see farthest over free floor."""

    def sight(yaw: float) -> float:
        for step in np.arange(0.1, 15, 0.1):
            row, column = walk.cell(x + step * np.sin(yaw), z + step * np.cos(yaw))
            inside = 0 <= row < walk.clearance.shape[0] and 0 <= column < walk.clearance.shape[1]
            if not inside or walk.clearance[row, column] <= 0:
                return float(step)
        return 15.0

    yaws = [round(float(k * np.pi / 4), 4) for k in range(-3, 5)]
    return max(yaws, key=sight)
