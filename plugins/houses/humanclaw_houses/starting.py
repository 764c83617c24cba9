"""Find the walkable area of a finished house, and choose the start."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from humanclaw import Scene
from humanclaw.body import Array, Pose2D
from humanclaw.world import RADIUS, MultiFloorMap

Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class WalkableArea:
    """The walkable floor of a house on all storeys, with movable objects as obstacles."""

    scene: Scene
    floors: MultiFloorMap

    @classmethod
    def of(cls, scene: Scene) -> WalkableArea:
        return cls(scene, MultiFloorMap.of(scene).solid())

    @cached_property
    def reached(self) -> Array:
        """(P, x cell, z cell) walking distance to each cell of each plan, metres.

        Measured from the roomiest place of the lowest hall, or of the lowest floor if there is no hall.
        """
        return self.floors.distances(self._roomiest())

    def _roomiest(self) -> Array:
        plan = self.floors.grids[0]
        halls = [room for room in self.scene.rooms if room.kind == "hall"]
        within = np.any([plan.within(room) for room in halls or self.scene.rooms], axis=0)
        cell = np.unravel_index(int(np.where(within, plan.clearance, -1.0).argmax()), within.shape)
        x, z = plan.point(np.array(cell))
        return np.array([x, plan.floor, z])

    def near(self, low: Array, high: Array, reach: float) -> tuple[Mask, ...]:
        """Return, for each storey, the reachable cells whose centre is at most `reach` metres from a box.

        The distance is horizontal. A storey whose space the box does not touch has none.
        """
        # 2 k: the storeys' plans alternate with those of the stairs between them. 1.9 m: the height of a body.
        return tuple(
            np.isfinite(self.reached[2 * k])
            & (plan.gap(low, high) <= reach)
            & bool(low[1] < plan.floor + 1.9 and high[1] > plan.floor)
            for k, plan in enumerate(self.floors.floors)
        )

    def room_at(self, plan: int) -> Array:
        """Return the clearance of a storey's reachable cells, metres; 0 elsewhere."""
        return np.where(np.isfinite(self.reached[2 * plan]), self.floors.floors[plan].clearance, 0.0)


def choose_start(walkable: WalkableArea, rng: np.random.Generator) -> Pose2D:
    """Choose a start on the lowest floor with 0.55 m of free space around it, facing the longest free line of sight.

    If possible it is 4 to 10 m on foot from the nearest couch and in the hall; otherwise conditions are dropped one by
    one.
    """
    plan, rooms = walkable.floors.grids[0], walkable.scene.rooms
    roomy = walkable.room_at(0) > 0.55
    far = _from_couches(walkable)
    hall = np.any([plan.within(room) for room in rooms if room.kind == "hall"] or [np.zeros_like(roomy)], axis=0)
    well = roomy & (far > 4) & (far < 10)
    choices = [well & hall, well, roomy & (far > 2.5), roomy, plan.fits(RADIUS), ~plan.blocked]
    cells = np.argwhere(next(choice for choice in choices if choice.any()))
    x, z = plan.point(cells[int(rng.integers(len(cells)))]).tolist()
    return Pose2D(round(x, 3), round(z, 3), plan.best_view(np.array([x, z]), plan.blocked), plan.floor)


def _from_couches(walkable: WalkableArea) -> Array:
    """Return metres on foot from the nearest couch to the cells of the lowest floor; infinite without a couch."""
    goals = [
        [x, plan.floor, z]
        for couch in walkable.scene.of_category("couch")
        for plan, near in zip(walkable.floors.floors, walkable.near(*walkable.scene.aabb(couch.id), 0.4), strict=True)
        for x, z in plan.point(np.argwhere(near)).tolist()
    ]
    if not goals:
        return np.full(walkable.floors.grids[0].blocked.shape, np.inf)
    return np.asarray(walkable.floors.distances(np.array(goals))[0])
