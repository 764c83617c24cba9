"""How sure a number is: intervals of rates and means, and whether two runs of the same episodes differ.

An episode is the unit that is drawn at random; steps within one are not independent. Seeds make every result
repeatable.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from humanclaw.pose import Array

CONFIDENCE: Final = 0.95
RESAMPLES: Final = 2000
SIGNIFICANT: Final = 0.05
FEW: Final = 5
"""Fewer episodes than this cannot tell how they vary."""


@dataclass(frozen=True)
class Estimate:
    """A number and the interval that holds the true one with 95 % confidence. NaN bounds: too few episodes to tell."""

    value: float
    low: float = float("nan")
    high: float = float("nan")
    count: int = 0
    """Episodes it is of; 0 where that is not known."""


@dataclass(frozen=True)
class Difference:
    """B less A over the same episodes."""

    a: float
    b: float
    value: float
    low: float
    high: float
    p: float
    """Chance of a difference this large if the two were alike."""
    count: int

    @property
    def noise(self) -> bool:
        """Whether chance alone explains it well enough."""
        return not self.p < SIGNIFICANT


# -- one run -----------------------------------------------------------------------------------------------------------
def wilson(successes: int, trials: int) -> Estimate:
    """Return a rate with Wilson's score interval, which holds near 0 and 1 and for few trials. NaN without trials."""
    if trials == 0:
        return Estimate(float("nan"))
    interval = stats.binomtest(successes, trials).proportion_ci(CONFIDENCE, method="wilson")
    return Estimate(successes / trials, float(interval.low), float(interval.high), trials)


def ratio(numerators: Sequence[float], denominators: Sequence[float], *, seed: int = 0) -> Estimate:
    """Sum over sum, episodes drawn again for the interval (bootstrap); a mean where all denominators are 1.

    NaN if the denominators sum to 0. Fewer than FEW episodes have no interval.
    """
    above, below = np.asarray(numerators, float), np.asarray(denominators, float)
    draws = (_ratio(above[rows], below[rows]) for rows in _draws(len(above), seed))
    return Estimate(float(_ratio(above, below)), *_percentiles(draws, len(above)), len(above))


def _ratio(above: Array, below: Array) -> Array:
    """Divide sums over the last axis; NaN over nothing."""
    total = below.sum(-1)
    return np.asarray(np.where(total > 0, above.sum(-1) / np.where(total > 0, total, 1.0), np.nan))


def _draws(count: int, seed: int) -> Iterator[NDArray[np.int64]]:
    """Index arrays (R, count) that draw episodes with replacement, in pieces that stay small; none for too few."""
    rng = np.random.default_rng(seed)
    for _ in range(10 if count >= FEW else 0):
        yield rng.integers(0, count, (RESAMPLES // 10, count))


def _percentiles(pieces: Iterable[Array], count: int) -> tuple[float, float]:
    """Percentiles of the draws, expanded for a small count (Hesterberg 2015), as the plain ones are too narrow there.

    Draws without a disturbed object say nothing of its path, so NaNs are left out.
    """
    values = np.concatenate([np.empty(0), *pieces])
    values = values[np.isfinite(values)]
    if not len(values):
        return float("nan"), float("nan")
    wider = np.sqrt(count / (count - 1)) * stats.t.ppf((1 + CONFIDENCE) / 2, count - 1)
    low, high = np.quantile(values, [stats.norm.cdf(-wider), stats.norm.cdf(wider)])
    return float(low), float(high)


# -- two runs ----------------------------------------------------------------------------------------------------------
def compare_rates(a: Sequence[bool], b: Sequence[bool]) -> Difference:
    """Paired successes: McNemar's exact test, and the interval of Agresti and Min (2005).

    Only episodes on which the two differ bear on the question; half a one is added to each cell, so that the interval
    keeps a width where none differs. Raises ValueError for sequences of unequal length.
    """
    first, second = _paired(a, b)
    count = len(first)
    gained, lost = int((second > first).sum()), int((first > second).sum())
    p = float(stats.binomtest(gained, gained + lost).pvalue) if gained + lost else 1.0
    cells, centre = count + 2, (gained - lost) / (count + 2)
    spread = float(np.sqrt(max(0.0, (gained + lost + 1) / cells - centre**2) / cells)) * float(
        stats.norm.ppf((1 + CONFIDENCE) / 2)
    )
    value = (gained - lost) / count if count else float("nan")
    low, high = max(-1.0, centre - spread), min(1.0, centre + spread)
    return Difference(_mean(first), _mean(second), value, low, high, p, count)


def compare_ratios(a: Sequence[tuple[float, float]], b: Sequence[tuple[float, float]], *, seed: int = 0) -> Difference:
    """Paired (numerator, denominator) of each episode: bootstrap of the pairs, and a test that swaps the runs at
    random.

    Raises ValueError for sequences of unequal length.
    """
    first, second = _paired(a, b)
    if not len(first):
        nothing = float("nan")
        return Difference(nothing, nothing, nothing, nothing, nothing, 1.0, 0)
    one, two = float(_ratio(*first.T)), float(_ratio(*second.T))
    draws = (
        _ratio(*np.moveaxis(second[rows], -1, 0)) - _ratio(*np.moveaxis(first[rows], -1, 0))
        for rows in _draws(len(first), seed)
    )
    low, high = _percentiles(draws, len(first))
    return Difference(one, two, two - one, low, high, _swap_test(first, second, seed), len(first))


def _paired(a: Sequence[object], b: Sequence[object]) -> tuple[Array, Array]:
    if len(a) != len(b):
        raise ValueError(f"a paired comparison needs one value of each run an episode; got {len(a)} and {len(b)}.")
    return np.asarray(a, float), np.asarray(b, float)


def _mean(values: Array) -> float:
    return float(values.mean()) if len(values) else float("nan")


def _swap_test(first: Array, second: Array, seed: int) -> float:
    """How often the difference is as large when each episode's two results are swapped by the toss of a coin."""
    found = abs(float(_ratio(*second.T) - _ratio(*first.T)))
    if not np.isfinite(found):
        return 1.0
    tosses = np.random.default_rng(seed).integers(0, 2, (RESAMPLES, len(first))).astype(float)
    total, change = first + second, second - first
    swapped = [_over(total, change, sign, tosses) for sign in (1.0, -1.0)]
    differences = np.abs(swapped[0] - swapped[1])
    as_large = int((differences >= found * (1 - 1e-9)).sum())
    return (as_large + 1) / (RESAMPLES + 1)


def _over(total: Array, change: Array, sign: float, tosses: Array) -> Array:
    """(R,) ratio of one side after the tosses: half the total plus or minus half the change of each episode."""
    sides = (total.sum(0) + sign * ((2 * tosses - 1) @ change)) / 2
    return np.asarray(np.where(sides[:, 1] > 0, sides[:, 0] / np.where(sides[:, 1] > 0, sides[:, 1], 1.0), np.nan))


def holm(differences: Sequence[Difference]) -> tuple[Difference, ...]:
    """Return the same differences with p raised for their number (Holm): of twenty metrics one differs by chance."""
    order = sorted(range(len(differences)), key=lambda k: differences[k].p)
    raised, largest = list(differences), 0.0
    for rank, k in enumerate(order):
        largest = max(largest, min(1.0, (len(order) - rank) * differences[k].p))
        raised[k] = replace(differences[k], p=largest)
    return tuple(raised)
