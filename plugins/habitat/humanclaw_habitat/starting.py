"""Where a body stands in a scene that names no start."""

from __future__ import annotations

import numpy as np

from humanclaw import Scene
from humanclaw.navigation import OccupancyGrid
from humanclaw.pose import Pose2D


def roomiest(scene: Scene, floor: float) -> Pose2D:
    """The place on a floor that is farthest from everything, facing the way, of eight, in which one sees farthest."""
    plan = OccupancyGrid.of(scene, floor)
    blocked = plan.blocked | plan.movable
    cell = np.unravel_index(int(np.where(blocked, 0.0, plan.clearance).argmax()), blocked.shape)
    place = plan.point(np.array(cell))

    def sight(yaw: float) -> float:
        steps = np.arange(0.1, 15.0, 0.1)
        way = place + steps[:, None] * np.array([np.sin(yaw), np.cos(yaw)])
        return float(steps[np.argmax(np.append(plan.at(blocked, way)[:-1], True))])

    yaw = max((round(float(k * np.pi / 4), 4) for k in range(-3, 5)), key=sight)
    x, z = place.round(3).tolist()
    return Pose2D(x, z, yaw, floor)
