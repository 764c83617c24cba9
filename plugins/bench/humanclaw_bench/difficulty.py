"""How hard an episode is: length, branching and clutter of the way to its nearest target (paper, section 4.1)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from itertools import groupby
from typing import Any, Final, Literal

import numpy as np

from humanclaw.navigation.routes import OBSTACLE_HEIGHTS, RADIUS, Storeys, room_at, turns
from humanclaw.pose import Array
from humanclaw.records import Difficulty
from humanclaw.scene import Scene

Tier = Literal["easy", "medium", "hard"]
TIERS: Final[tuple[Tier, ...]] = ("easy", "medium", "hard")
THRESHOLDS: Final = {"distance": (3.5, 8.0), "choice": (2.0, 5.0), "obstacle": (2.5, 5.0)}
"""The most that is still easy, and the most that is still medium."""
CROWDED: Final = 1.0
"""Distance from the way within which a thing counts as an obstacle, metres."""
GROUND: Final = frozenset({"floor", "ceiling", "stairs"})
"""What one walks on or under is no obstacle."""


def tiers(difficulty: Difficulty) -> dict[str, Tier]:
    """The tier of each dimension: distance, choice and obstacle."""
    values = {
        "distance": difficulty.distance,
        "choice": difficulty.turns + difficulty.rooms,
        "obstacle": difficulty.obstacles,
    }
    return {name: TIERS[sum(values[name] > bound for bound in bounds)] for name, bounds in THRESHOLDS.items()}


def overall(difficulty: Difficulty) -> Tier:
    """The three tiers averaged, rounded to the nearest."""
    ranks = [TIERS.index(tier) for tier in tiers(difficulty).values()]
    return TIERS[round(sum(ranks) / len(ranks))]


@dataclass(frozen=True, eq=False)
class Ways:
    """The shortest ways from everywhere in a house to the nearest of some places."""

    storeys: Storeys
    costs: Array
    """(P, x cell, z cell) metres from each cell of each plan; infinite where there is no way."""
    _search: Any

    @classmethod
    def of(cls, storeys: Storeys, goals: Array) -> Ways:
        """goals: (N, 3) places. For a body of RADIUS, which needs no squeezing through."""
        weights = [np.where(plan.fits(RADIUS), plan.steepness, -1.0) for plan in storeys.plans]
        open_goals = goals[storeys.at(np.stack(weights), goals) > 0]
        if not len(open_goals):
            return cls(storeys, np.full((len(weights), *weights[0].shape), np.inf), None)
        return cls(storeys, *storeys.search(weights, open_goals))

    def way(self, place: Array) -> Array:
        """(N, 3) points on the ground from (3,) place to the nearest goal, a cell apart."""
        plans = self.storeys.plans
        start = (2 * int(self.storeys.level(place)), *map(int, plans[0].cell(place[[0, 2]])))
        cells = np.array([cell for cell in self._search.traceback(start) if cell[0] % 2 == 0])[::-1]
        flat = plans[0].point(cells[:, 1:])
        heights = [plans[level].ground[x, z] for level, x, z in zip(cells[:, 0] // 2, *cells[:, 1:].T, strict=True)]
        return np.stack([flat[:, 0], heights, flat[:, 1]], -1)


def measure(scene: Scene, way: Array, distance: float) -> Difficulty:
    """The difficulty of a way (N, 3) on the ground, from the start on. distance: its length in metres."""
    return Difficulty(
        distance=round(distance, 2),
        turns=turns(way[:, [0, 2]]),
        rooms=len(list(_rooms(scene, way))),
        obstacles=round(float(_crowd(scene, way).mean()), 2),
    )


def _rooms(scene: Scene, way: Array) -> Iterator[str]:
    """Names of the rooms on a way, in order; between two rooms one is still in the first."""
    names = (room_at(scene, x, z, y) for x, y, z in way)
    yield from (name for name, _ in groupby(name for name in names if name))


def _crowd(scene: Scene, way: Array) -> Array:
    """(N,) how many solid things stand within CROWDED of each point of a way: walls, furniture, and what can be moved."""
    low, high = _boxes(scene)
    near, far = OBSTACLE_HEIGHTS
    feet = way[:, None, :]
    gap = np.maximum(np.maximum(low - feet, feet - high), 0.0)
    beside = np.hypot(gap[..., 0], gap[..., 2]) <= CROWDED
    upright = (high[:, 1] > feet[..., 1] + near) & (low[:, 1] < feet[..., 1] + far)
    return np.asarray((beside & upright).sum(1))


@lru_cache(maxsize=1)
def _boxes(scene: Scene) -> tuple[Array, Array]:
    """(N, 3) corners of the bounding boxes of everything solid."""
    solid = [thing for thing in scene.objects if thing.category not in GROUND and scene.assets[thing.asset].hulls]
    corners = [scene.aabb(thing.id) for thing in solid]
    return np.array([low for low, _ in corners]), np.array([high for _, high in corners])
