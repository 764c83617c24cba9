"""Choose and check the start of a body in a scene that names none."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np
from numpy.typing import NDArray

from humanclaw import Plugins, Scene, SceneError, default_simulator
from humanclaw.body import Array, Pose2D
from humanclaw.world import CELL, OccupancyGrid, SceneObject
from humanclaw_habitat.regions import covered

_HEAD: Final = 1.9
"""Smallest height of a ceiling over its floor, metres."""
_NEAR: Final = 0.05
"""Largest distance of a floor from the height of its storey, metres."""
_ROOF: Final = 4.0
"""A scene with this much free floor below ceilings is a building, with an outside; square metres."""
_FALL: Final = 0.5
"""An object that sinks deeper than this, metres, has nothing below it."""


def indoors(scene: Scene, plan: OccupancyGrid) -> NDArray[np.bool_]:
    """Return the cells where a body can start: free cells, in a building only those below its ceilings."""
    free = ~(plan.blocked | plan.movable)
    free &= _covered(scene, plan, "floor", lambda low, high: low - _NEAR <= plan.floor <= high + _NEAR)
    roofed = free & _covered(scene, plan, "ceiling", lambda low, _: low >= plan.floor + _HEAD)
    return np.asarray(roofed if roofed.sum() * CELL**2 >= _ROOF else free)


def _covered(
    scene: Scene, plan: OccupancyGrid, category: str, fits: Callable[[float, float], bool]
) -> NDArray[np.bool_]:
    """Return the cells over or under pieces of a category. fits: takes a piece's lowest and highest point, metres."""
    cells = np.zeros(plan.blocked.shape, bool)
    for thing in scene.objects:
        for hull in scene.assets[thing.asset].hulls if thing.category == category else ():
            points = hull + np.array(thing.position)
            if fits(float(points[:, 1].min()), float(points[:, 1].max())):
                _mark(cells, points[:, [0, 2]], plan)
    return cells


def _mark(cells: NDArray[np.bool_], points: Array, plan: OccupancyGrid) -> None:
    """Set the cells whose centre is within the convex hull of (K, 2) points."""
    (i, j), (k, m) = plan.cell(points.min(axis=0)), plan.cell(points.max(axis=0))
    window = (slice(i, k + 1), slice(j, m + 1))
    cells[window] |= covered(plan.point(np.moveaxis(np.mgrid[window], 0, -1)), points)


def roomiest(scene: Scene, floor: float) -> Pose2D:
    """Return the place on a floor that is farthest from all obstacles, facing the longest free view of eight."""
    plan = OccupancyGrid.of(scene, floor)
    blocked = plan.blocked | plan.movable
    cell = np.unravel_index(int(np.where(indoors(scene, plan), plan.clearance, 0.0).argmax()), blocked.shape)
    place = plan.point(np.array(cell))
    yaw = plan.best_view(place, blocked)
    x, z = place.round(3).tolist()
    return Pose2D(x, z, yaw, floor)


def check_start(scene: Scene, plugins: Plugins) -> list[SceneObject]:
    """Return the movable objects that fall from their place.

    Raises SceneError if the scene has no floor, or its start is outdoors, in an obstacle or without a floor.
    """
    if not any(thing.category == "floor" and scene.assets[thing.asset].hulls for thing in scene.objects):
        raise SceneError("it has no floor to stand on.", "Check that its stage has a level surface and is collidable.")
    plan = OccupancyGrid.of(scene, scene.start.floor)
    if not plan.at(indoors(scene, plan), np.array([scene.start.x, scene.start.z])):
        raise SceneError("its start is outdoors or in an obstacle.", "Check that there is free floor within its rooms.")
    simulator = plugins.make("simulators", default_simulator(plugins), profile="default")
    try:
        # reset() lets the body stand for half a second, and refuses a start where it falls or is pushed away.
        places = simulator.reset(scene, scene.start).objects
    finally:
        simulator.close()
    return [obj for obj in scene.objects if obj.id in places and obj.position[1] - places[obj.id][1] > _FALL]
