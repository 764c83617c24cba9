"""Where a body can go in a scene: occupancy, stairs, the shortest ways, and where to stand at a target (paper, section
4.1).

An OccupancyGrid is one floor; a MultiFloorMap holds all floors of a scene with the stairs between them; a DistanceField
tells how far it is to the nearest of some goals from everywhere; Routes lead from one start to everywhere; a Viewpoint
is a place to stand.
"""

from humanclaw.navigation.approach import Viewpoint, geodesics, goals_at, viewpoints
from humanclaw.navigation.difficulty import route_difficulty
from humanclaw.navigation.occupancy import (
    CELL,
    OBSTACLE_HEIGHTS,
    RADIUS,
    STEP,
    OccupancyGrid,
    floors_of,
    length,
    room_at,
)
from humanclaw.navigation.search import DistanceField, MultiFloorMap, Routes, Segment
from humanclaw.navigation.stairs import StairRun, stair_runs

__all__ = [
    "CELL", "OBSTACLE_HEIGHTS", "RADIUS", "STEP", "DistanceField", "MultiFloorMap", "OccupancyGrid", "Routes",
    "Segment",
    "StairRun", "Viewpoint", "floors_of", "geodesics", "goals_at", "length", "room_at", "route_difficulty",
    "stair_runs",
    "viewpoints",
]  # fmt: skip
