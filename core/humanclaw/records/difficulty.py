"""Measure how hard a way is: length, turns, rooms and clutter (paper, section 4.1)."""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from itertools import groupby
from typing import Final

import numpy as np

from humanclaw.body.pose import Array, wrap_angle
from humanclaw.records.specification import Difficulty
from humanclaw.world.navigation.occupancy import OBSTACLE_HEIGHTS, room_at
from humanclaw.world.scene import Scene

CROWDED: Final = 1.0
"""Metres from the way within which an object counts as an obstacle."""
NO_OBSTACLES: Final = frozenset({"floor", "ceiling", "stairs"})
"""Categories that a body walks on or under."""


def route_difficulty(scene: Scene, way: Array, distance: float) -> Difficulty:
    """Return the difficulty of a way (N, 3) on the ground, from start to target. distance: its length, metres."""
    return Difficulty(
        distance=round(distance, 2),
        turns=turns(way[:, [0, 2]]),
        rooms=len(list(_rooms(scene, way))),
        obstacles=round(float(_crowd(scene, way).mean()), 2),
    )


def _rooms(scene: Scene, way: Array) -> Iterator[str]:
    """Yield the names of the rooms on a way, in order. Points between two rooms belong to the first."""
    names = (room_at(scene, x, z, y) for x, y, z in way)
    yield from (name for name, _ in groupby(name for name in names if name))


def _crowd(scene: Scene, way: Array) -> Array:
    """(N,) how many solid objects stand within CROWDED of each point of a way: walls, furniture, and what can be
    moved."""
    low, high = _boxes(scene)
    near, far = OBSTACLE_HEIGHTS
    feet = way[:, None, :]
    gap = np.maximum(np.maximum(low - feet, feet - high), 0.0)
    beside = np.hypot(gap[..., 0], gap[..., 2]) <= CROWDED
    upright = (high[:, 1] > feet[..., 1] + near) & (low[:, 1] < feet[..., 1] + far)
    return np.asarray((beside & upright).sum(1))


@lru_cache(maxsize=1)
def _boxes(scene: Scene) -> tuple[Array, Array]:
    """(N, 3) corners of the bounding boxes of every solid object."""
    solid = [obj for obj in scene.objects if obj.category not in NO_OBSTACLES and scene.assets[obj.asset].hulls]
    corners = [scene.aabb(obj.id) for obj in solid]
    return np.array([low for low, _ in corners]), np.array([high for _, high in corners])


def turns(path: Array) -> int:
    """Count the turns of a polyline (N, 2) above 30 degrees, after simplifying it to 0.2 m (Douglas-Peucker)."""
    # Imported here: it loads scipy.signal and scipy.stats, which takes a second.
    from skimage.measure import approximate_polygon

    # scikit-image has no types.
    simple = approximate_polygon(np.asarray(path), 0.2)  # type: ignore[no-untyped-call]
    segments = np.diff(simple, axis=0)
    bearing = np.arctan2(segments[:, 0], segments[:, 1])
    return int((np.abs(wrap_angle(np.diff(bearing))) > np.radians(30.0)).sum())
