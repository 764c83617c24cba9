"""Measure how often intervals of a rate contain the truth if houses differ; `python house_effect.py` prints the table.

Houses draw their chance of success from a beta distribution whose intraclass correlation is given; episodes of a house
succeed by that chance.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from humanclaw_bench.statistics import rate, wilson

SIZES: Final = {
    "val": (30,) * 41, "val-400": (10,) * 31 + (9,) * 10, "mini": (2,) * 23 + (3,) * 18, "50 in 10 houses": (5,) * 10,
}  # fmt: skip
"""Episodes of each house."""


def in_houses(
    rng: np.random.Generator, share: float, sizes: tuple[int, ...], icc: float = 0.13
) -> tuple[list[bool], list[str]]:
    """Draw successes and the house of each."""
    chances = rng.beta(share * (1 / icc - 1), (1 - share) * (1 / icc - 1), len(sizes))
    met = [bool(x) for chance, size in zip(chances, sizes, strict=True) for x in rng.random(size) < chance]
    return met, [f"house:{k}" for k, size in enumerate(sizes) for _ in range(size)]


def coverage(share: float, sizes: tuple[int, ...], draws: int, *, icc: float = 0.13) -> np.ndarray:
    """Return (2, 2) share of the draws whose interval holds the truth, and its mean half-width.

    Wilson's, and with houses.
    """
    rng, rows = np.random.default_rng(10), []
    for _ in range(draws):
        met, houses = in_houses(rng, share, sizes, icc)
        intervals = wilson(sum(met), len(met)), rate(met, houses)
        rows.append([(bounds.low <= share <= bounds.high, (bounds.high - bounds.low) / 2) for bounds in intervals])
    return np.mean(rows, axis=0)


if __name__ == "__main__":
    print("| episodes | correlation | rate | Wilson | as `bench table` | half-width |")
    print("| --- | ---: | ---: | ---: | ---: | ---: |")
    for name, sizes in SIZES.items():
        for icc in (0.05, 0.13, 0.3):
            for share in (0.03, 0.17, 0.5, 0.97):
                plain, ours = coverage(share, sizes, 300, icc=icc)
                held = f"{100 * plain[0]:.0f} % | {100 * ours[0]:.0f} %"
                print(f"| {name} | {icc} | {100 * share:.0f} % | {held} | {100 * ours[1]:.1f} |", flush=True)
