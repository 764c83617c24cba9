"""Difficulty of an episode: length, branching and clutter of the route to its nearest target (paper, section 4.1)."""

from __future__ import annotations

from typing import Final, Literal

from humanclaw.records import Difficulty

Tier = Literal["easy", "medium", "hard"]
TIERS: Final[tuple[Tier, ...]] = ("easy", "medium", "hard")
THRESHOLDS: Final = {"distance": (3.5, 8.0), "choice": (2.0, 5.0), "obstacle": (2.5, 5.0)}
"""Largest value that is easy, and largest value that is medium."""


def tiers(difficulty: Difficulty) -> dict[str, Tier]:
    """Return the tier of each dimension: distance, choice and obstacle."""
    values = {
        "distance": difficulty.distance,
        "choice": difficulty.turns + difficulty.rooms,
        "obstacle": difficulty.obstacles,
    }
    return {name: TIERS[sum(values[name] > bound for bound in bounds)] for name, bounds in THRESHOLDS.items()}


def overall(difficulty: Difficulty) -> Tier:
    """Return the mean of the three tiers, rounded to the nearest."""
    ranks = [TIERS.index(tier) for tier in tiers(difficulty).values()]
    return TIERS[round(sum(ranks) / len(ranks))]
