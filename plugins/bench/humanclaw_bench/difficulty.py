"""Difficulty of an episode: length, branching and clutter of the route to its nearest target (paper, section 4.1)."""

from __future__ import annotations

from typing import Final, Literal

from humanclaw.records import Difficulty

Tier = Literal["easy", "medium", "hard"]
TIERS: Final[tuple[Tier, ...]] = ("easy", "medium", "hard")
THRESHOLDS: Final = {"distance": (3.5, 8.0), "choice": (2.0, 5.0), "obstacle": (2.5, 5.0)}
"""Largest value that is easy, and largest value that is medium."""


def scores_of(difficulty: Difficulty) -> dict[str, float]:
    """Return the value of each dimension: metres, turns and rooms, obstacles."""
    choice = difficulty.turns + difficulty.rooms
    return {"distance": difficulty.distance, "choice": choice, "obstacle": difficulty.obstacles}


def tier_of(dimension: str, value: float) -> Tier:
    """Return the tier of a value of a dimension."""
    return TIERS[sum(value > bound for bound in THRESHOLDS[dimension])]


def tiers(difficulty: Difficulty) -> dict[str, Tier]:
    """Return the tier of each dimension: distance, choice and obstacle."""
    return {name: tier_of(name, value) for name, value in scores_of(difficulty).items()}


def overall(difficulty: Difficulty) -> Tier:
    """Return the mean of the three tiers, rounded to the nearest."""
    ranks = [TIERS.index(tier) for tier in tiers(difficulty).values()]
    return TIERS[round(sum(ranks) / len(ranks))]
