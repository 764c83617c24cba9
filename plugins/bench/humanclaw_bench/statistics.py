"""Confidence intervals of rates and means, and tests whether two runs of the same episodes differ.

The sampling unit is the house, because episodes of one house tend to succeed or fail together. With fewer than FEW
houses the unit is the episode, and results hold for these houses alone. Repeats of an episode always stay together.
Seeds make every result reproducible.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import scipy
from numpy.typing import NDArray
from scipy.special import betaln, expit, logit, ndtr, ndtri, stdtrit  # Not scipy.stats, which takes a second to load.

from humanclaw.body import Array

CONFIDENCE: Final = 0.95
"""The usual one: of a hundred such intervals, 95 hold the true value."""
RESAMPLES: Final = 2000
"""Of bootstrap and swaps: with 2,000 a p of .05 is known to about half a percent, and .0005 is the smallest."""
SIGNIFICANT: Final = 0.05
"""The usual level, after Holm's correction for all comparisons of a table."""
FEW: Final = 5
"""With fewer houses or episodes than this, their variance cannot be estimated."""
ROUNDING: Final = 1e-12
"""Relative difference that rounding can cause between sums of equal numbers; a real interval is wider."""
ALIKE: Final = 0.95
"""Largest intraclass correlation of a house's episodes that intervals allow for."""
EXTREME: Final = 12.0
"""Largest logit of a chance: the search for a bound ends there."""
# Not from 0, where the weight of the beta distribution is infinite (_likelihood).
_CORRELATIONS: Final = np.concatenate([[1e-4], np.linspace(0.01, ALIKE, 40)])
_BELIEF: Final = 0.15 * np.log(_CORRELATIONS)
"""Logarithm of the weight of each. Chosen by the coverage of rates of 1 % in plugins/bench/tests/house_effect.py."""


@dataclass(frozen=True)
class Estimate:
    """A number with its 95 % confidence interval. NaN bounds: too few episodes for an interval."""

    value: float
    low: float = float("nan")
    high: float = float("nan")
    count: int = 0
    """Number of episodes behind it; 0 if unknown."""


@dataclass(frozen=True)
class Difference:
    """B minus A over the same episodes."""

    a: float
    b: float
    value: float
    low: float
    high: float
    p: float
    """Probability of a difference at least this large if the two were equal."""
    count: int
    least: float = 0.0
    """Smallest p that this test can give with so few houses. From SIGNIFICANT on, no difference could be shown."""
    alike: bool = False
    """Whether the two are equal in every episode, or 0 in all."""

    @property
    def significant(self) -> bool:
        """Whether p is below SIGNIFICANT."""
        return self.p < SIGNIFICANT

    @property
    def level(self) -> float:
        """Mean of the two absolute values."""
        return (abs(self.a) + abs(self.b)) / 2


# -- one run -----------------------------------------------------------------------------------------------------------
def wilson(successes: int, trials: int) -> Estimate:
    """Return a rate with Wilson's score interval, valid near 0 and 1 and for few trials. NaN without trials."""
    if trials == 0:
        return Estimate(float("nan"))
    share, quantile = successes / trials, _normal_quantile()
    square = quantile**2 / trials
    centre = (share + square / 2) / (1 + square)
    half = quantile / (1 + square) * float(np.sqrt(share * (1 - share) / trials + square / (4 * trials)))
    # Exact bounds at 0 and 1, because rounding could exclude the rate itself from its interval.
    low, high = (max(0.0, centre - half) if share > 0 else 0.0), (min(1.0, centre + half) if share < 1 else 1.0)
    return Estimate(share, low, high, trials)


def rate(met: Sequence[bool], houses: Sequence[str] = ()) -> Estimate:
    """Estimate a share of episodes, with the profile likelihood interval of a beta-binomial model.

    Each house draws its own chance of success. The interval holds the mean chances that are plausible with some
    intraclass correlation up to ALIKE; the quantile is Student's t for the number of houses. Without houses, or with
    fewer than FEW, it is Wilson's plain interval.
    """
    plain = wilson(sum(met), len(met))
    if len(set(houses)) < FEW:
        return plain
    low, high = _profile_interval(units(np.stack([np.asarray(met, float), np.ones(len(met))], -1), houses))
    share = plain.value
    return Estimate(share, min(low, share) if share > 0 else 0.0, max(high, share) if share < 1 else 1.0, len(met))


def _profile_interval(drawn: Array) -> tuple[float, float]:
    """Return the interval of the mean chance of (U, 2) houses with successes and trials."""

    def fit(place: float) -> float:
        return _likelihood(float(expit(place)), drawn)

    share = float(drawn[:, 0].sum() / drawn[:, 1].sum())
    # One within the ends, because the best is looked for up to one logit away.
    centre = float(np.clip(logit(share), 1 - EXTREME, EXTREME - 1))
    best = scipy.optimize.minimize_scalar(lambda x: -fit(x), bounds=(centre - 1, centre + 1), options={"xatol": 1e-3})
    least = -best.fun - _student_quantile(len(drawn) - 1) ** 2 / 2
    low, high = (_crossing(lambda place: fit(place) - least, best.x, end) for end in (-EXTREME, EXTREME))
    return float(expit(low)), float(expit(high))


def _likelihood(share: float, drawn: Array) -> float:
    """Return the log likelihood of a mean chance: the largest over the intraclass correlations.

    A correlation of 0 is unlikely beforehand: few successes fall into few houses by chance, and houses seem alike.
    """
    weight = (1 / _CORRELATIONS - 1)[:, None]
    hits, trials = drawn.T
    a, b = share * weight, (1 - share) * weight
    return float(((betaln(hits + a, trials - hits + b) - betaln(a, b)).sum(1) + _BELIEF).max())


def _crossing(excess: Callable[[float], float], inside: float, end: float) -> float:
    """Return where a function falls below 0 on the way to an end; the end if nowhere."""
    # A thousandth of a logit is at most a fortieth of a per cent of a rate.
    return float(scipy.optimize.brentq(excess, inside, end, xtol=1e-3)) if excess(end) < 0 else end


def _normal_quantile() -> float:
    """Return the normal quantile of a two-sided interval with CONFIDENCE."""
    return float(ndtri((1 + CONFIDENCE) / 2))


def _student_quantile(degrees: int) -> float:
    """Return the same quantile of Student's t."""
    return float(stdtrit(degrees, (1 + CONFIDENCE) / 2))


def ratio(
    numerators: Sequence[float] | Array,
    denominators: Sequence[float] | Array,
    houses: Sequence[str] = (),
    *,
    seed: int = 0,
) -> Estimate:
    """Estimate a ratio of sums, with a cluster bootstrap over houses; it is a mean if all denominators are 1.

    NaN if the denominators sum to 0. No interval with fewer than FEW episodes, or if all are equal.
    """
    pairs = np.stack([np.asarray(numerators, float), np.asarray(denominators, float)], -1)
    drawn = units(pairs, houses)
    draws = (_ratio(*np.moveaxis(drawn[rows], -1, 0)) for rows in _draws(len(drawn), seed))
    low, high = _percentiles(draws, len(drawn))
    estimate = Estimate(float(_ratio(*pairs.T)), count=len(pairs))
    return replace(estimate, low=low, high=high) if high - low > ROUNDING * abs(estimate.value) else estimate


def units(values: Array, houses: Sequence[str]) -> Array:
    """Sum (N, ...) values of episodes to (U, ...) sampling units: houses, or with too few houses the episodes."""
    if len(set(houses)) < FEW:
        return values
    names, index = np.unique(np.asarray(houses, str), return_inverse=True)
    sums = np.zeros((len(names), *values.shape[1:]))
    np.add.at(sums, index, values)
    return sums


def _ratio(above: Array, below: Array) -> Array:
    """Divide sums over the last axis; NaN if the denominator is 0."""
    total = below.sum(-1)
    return np.asarray(np.where(total > 0, above.sum(-1) / np.where(total > 0, total, 1.0), np.nan))


def _draws(count: int, seed: int) -> Iterator[NDArray[np.int64]]:
    """Yield (R, count) indices that draw units with replacement; nothing for fewer than FEW units."""
    # Ten pieces, because all 2,000 draws of many columns at once would take much memory.
    rng = np.random.default_rng(seed)
    for _ in range(10 if count >= FEW else 0):
        yield rng.integers(0, count, (RESAMPLES // 10, count))


def _percentiles(pieces: Iterable[Array], count: int) -> tuple[float, float]:
    """Return percentiles of the draws, expanded for a small count (Hesterberg 2015): plain ones are too narrow.

    NaNs are left out: a draw without a disturbed object has no path per object.
    """
    values = np.concatenate([np.empty(0), *pieces])
    values = values[np.isfinite(values)]
    if not len(values):
        return float("nan"), float("nan")
    wider = np.sqrt(count / (count - 1)) * _student_quantile(count - 1)
    low, high = np.quantile(values, [ndtr(-wider), ndtr(wider)])
    return float(low), float(high)


# -- two runs ----------------------------------------------------------------------------------------------------------
def compare_rates(a: Sequence[bool], b: Sequence[bool], houses: Sequence[str] = (), *, seed: int = 0) -> Difference:
    """Compare paired successes by an exact test that swaps the runs house by house.

    It is McNemar's test if each house has one episode. Each side of the interval is the wider of Agresti and Min's
    (2005) and a bootstrap over houses. The former adds half an episode to each cell, so that it has a width even if no
    episode differs.
    """
    first, second = np.asarray(a, float), np.asarray(b, float)
    changes = units(second - first, houses)
    low, high = _agresti_min(second - first)
    if len(set(houses)) >= FEW:
        drawn = ratio(second - first, np.ones(len(first)), houses, seed=seed)
        low, high = min(low, drawn.low), max(high, drawn.high)
    value = float(changes.sum() / len(first)) if len(first) else float("nan")
    p = sign_flips(changes.astype(int))
    alike = np.array_equal(first, second)
    return Difference(_mean(first), _mean(second), value, low, high, p, len(first), _least(changes), alike)


def _agresti_min(changes: Array) -> tuple[float, float]:
    """Return the interval of the mean of (N,) changes of episodes, each from -1 to 1."""
    cells = len(changes) + 2
    centre = float(changes.sum()) / cells
    square = (float((changes**2).sum()) + 1) / cells
    spread = float(np.sqrt(max(0.0, square - centre**2) / cells)) * _normal_quantile()
    return max(-1.0, centre - spread), min(1.0, centre + spread)


def sign_flips(changes: NDArray[np.int64]) -> float:
    """Return the exact probability of a sum at least as large if each of (U,) changes had a random sign."""
    # The distribution of the sum grows by one change at a time. Index k stands for the sum k - total.
    chances = np.ones(1)
    for change in np.abs(changes[changes != 0]):
        chances = (np.pad(chances, (2 * change, 0)) + np.pad(chances, (0, 2 * change))) / 2
    total = int(np.abs(changes).sum())
    sums = np.arange(len(chances)) - total
    return float(min(1.0, chances[np.abs(sums) >= abs(int(changes.sum()))].sum()))


def _least(drawn: Array) -> float:
    """Return the smallest p of a test that swaps (U, ...) units: 2 of 2^U outcomes have all changes the same way."""
    return float(min(1.0, 2.0 ** (1 - len(drawn))))


def compare_ratios(
    a: Sequence[tuple[float, float]],
    b: Sequence[tuple[float, float]],
    houses: Sequence[str] = (),
    *,
    seed: int = 0,
) -> Difference:
    """Compare paired (numerator, denominator) of each episode: bootstrap over houses, and random swaps of houses."""
    first, second = np.asarray(a, float), np.asarray(b, float)
    if not len(first):
        nothing = float("nan")
        return Difference(nothing, nothing, nothing, nothing, nothing, 1.0, 0, 1.0, True)
    ratio_a, ratio_b = float(_ratio(*first.T)), float(_ratio(*second.T))
    both = units(np.stack([first, second], 1), houses)  # (U, 2, 2): house, run, numerator and denominator
    draws = (
        _ratio(*np.moveaxis(both[rows, 1], -1, 0)) - _ratio(*np.moveaxis(both[rows, 0], -1, 0))
        for rows in _draws(len(both), seed)
    )
    low, high = _percentiles(draws, len(both))
    p = _swap_test(both[:, 0], both[:, 1], seed)
    alike = np.array_equal(first, second) or not both[..., 0].any()
    return Difference(ratio_a, ratio_b, ratio_b - ratio_a, low, high, p, len(first), _least(both), alike)


def _mean(values: Array) -> float:
    return float(values.mean()) if len(values) else float("nan")


def _swap_test(first: Array, second: Array, seed: int) -> float:
    """Return the share of random swaps of each unit's two results in which the difference is at least as large."""
    observed = abs(float(_ratio(*second.T) - _ratio(*first.T)))
    if not np.isfinite(observed):
        return 1.0
    tosses = np.random.default_rng(seed).integers(0, 2, (RESAMPLES, len(first))).astype(float)
    total, change = first + second, second - first
    swapped = [_over(total, change, sign, tosses) for sign in (1.0, -1.0)]  # (R,) each
    differences = np.abs(swapped[0] - swapped[1])
    as_large = int((differences >= observed * (1 - 1e-9)).sum())  # Equal differences may differ in their last bits.
    return (as_large + 1) / (RESAMPLES + 1)  # The observed result counts as one swap, so p is never 0.


def _over(total: Array, change: Array, sign: float, tosses: Array) -> Array:
    """Return (R,) the ratio of one side after the swaps: half the total plus or minus half of each change."""
    sides = (total.sum(0) + sign * ((2 * tosses - 1) @ change)) / 2  # (R, 2)
    return np.asarray(np.where(sides[:, 1] > 0, sides[:, 0] / np.where(sides[:, 1] > 0, sides[:, 1], 1.0), np.nan))


def holm(differences: Sequence[Difference]) -> tuple[Difference, ...]:
    """Return the differences with p corrected for their number (Holm): of twenty metrics, one differs by chance.

    Differences that are equal in every episode do not count, because no swap could change them (Tarone 1990). The
    smallest possible p is multiplied by the full number, because no corrected p can be smaller.
    """
    asked = sorted((k for k, d in enumerate(differences) if not d.alike), key=lambda k: differences[k].p)
    raised = [replace(difference, least=min(1.0, max(1, len(asked)) * difference.least)) for difference in differences]
    largest = 0.0
    for rank, k in enumerate(asked):
        largest = max(largest, min(1.0, (len(asked) - rank) * differences[k].p))
        raised[k] = replace(raised[k], p=largest)
    return tuple(raised)
