"""How sure a number is: intervals of rates and means, and whether two runs of the same episodes differ.

A house is the unit that is drawn at random: episodes of one house succeed and fail together, and steps within an
episode even more so. Of fewer than FEW houses episodes are drawn, and what comes out holds for these houses alone.
Repeats of an episode are never drawn apart. Seeds make every result repeatable.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr, ndtri, stdtrit  # scipy.stats takes a second to load.

from humanclaw.body import Array

CONFIDENCE: Final = 0.95
RESAMPLES: Final = 2000
SIGNIFICANT: Final = 0.05
FEW: Final = 5
"""Fewer houses or episodes than this cannot tell how they vary."""
RARE: Final = 10
"""Fewer successes, or failures, than this do not tell either how much houses differ: none would say "not at all"."""
ROUNDING: Final = 1e-12
"""By what share sums of equal numbers may differ; an interval is wider."""
ALIKE: Final = 0.13
"""Intraclass correlation of the episodes of a house that is then assumed: that of the agents that were looked at."""


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
    least: float = 0.0
    """The smallest p that so few houses could have had; above SIGNIFICANT nothing could have been told."""
    alike: bool = False
    """Whether the two have the same in every episode, or nothing in any."""

    @property
    def significant(self) -> bool:
        """Whether chance alone seldom makes as large a one."""
        return self.p < SIGNIFICANT

    @property
    def level(self) -> float:
        """Mean size of the two."""
        return (abs(self.a) + abs(self.b)) / 2


# -- one run -----------------------------------------------------------------------------------------------------------
def wilson(successes: float, trials: int) -> Estimate:
    """Return a rate with Wilson's score interval, which holds near 0 and 1 and for few trials. NaN without trials."""
    if trials == 0:
        return Estimate(float("nan"))
    interval = _score_interval(successes / trials, trials, _normal_quantile())
    return Estimate(successes / trials, *interval, trials)


def rate(met: Sequence[bool], houses: Sequence[str] = (), episodes: Sequence[str] = ()) -> Estimate:
    """Estimate a share of episodes, with Wilson's interval for as many episodes as these are worth.

    What they are worth is told by how much the houses differ (effective sample size, Korn and Graubard 1998), or the
    episodes if these do so more, with Student's t for the number of houses; where RARE is not reached houses are taken
    to be ALIKE. Wilson's plain interval of the number of episodes without houses, or with fewer than FEW.

    episodes: names, the same for the repeats of one; without them none is a repeat.
    """
    pairs = np.stack([np.asarray(met, float), np.ones(len(met))], -1)
    each, drawn = units(pairs, (), episodes), units(pairs, houses, episodes)
    plain = wilson(sum(met) * len(each) / max(1, len(met)), len(each))
    if len(set(houses)) < FEW:
        return replace(plain, count=len(met))
    share = plain.value
    spread = max(_spread(each, share), len(drawn) / (len(drawn) - 1) * _spread(drawn, share))
    worth = min(len(met), share * (1 - share) / spread) if spread > 0 else float(len(met))
    if min(sum(met), len(met) - sum(met)) * len(each) < RARE * len(met):
        worth = min(worth, len(each) / (1 + (len(each) / len(drawn) - 1) * ALIKE))
    return Estimate(share, *_score_interval(share, worth, _student_quantile(len(drawn) - 1)), len(met))


def _spread(drawn: Array, share: float) -> float:
    """Variance of a share of which each of (U, 2) units has successes and trials."""
    return float(((drawn[:, 0] - share * drawn[:, 1]) ** 2).sum() / drawn[:, 1].sum() ** 2)


def _normal_quantile() -> float:
    """Return how many standard deviations CONFIDENCE reaches to either side."""
    return float(ndtri((1 + CONFIDENCE) / 2))


def _student_quantile(degrees: int) -> float:
    """Return the same for Student's t with so many degrees of freedom."""
    return float(stdtrit(degrees, (1 + CONFIDENCE) / 2))


def _score_interval(share: float, count: float, quantile: float) -> tuple[float, float]:
    """Wilson's score interval of a share of so many trials."""
    square = quantile**2 / count
    centre = (share + square / 2) / (1 + square)
    half = quantile / (1 + square) * float(np.sqrt(share * (1 - share) / count + square / (4 * count)))
    # Rounding must not keep a rate of 0 or 1 out of its own interval.
    return (max(0.0, centre - half) if share > 0 else 0.0), (min(1.0, centre + half) if share < 1 else 1.0)


def ratio(
    numerators: Sequence[float] | Array,
    denominators: Sequence[float] | Array,
    houses: Sequence[str] = (),
    episodes: Sequence[str] = (),
    *,
    seed: int = 0,
) -> Estimate:
    """Sum over sum, houses drawn again for the interval (cluster bootstrap); a mean where all denominators are 1.

    NaN if the denominators sum to 0. No interval where fewer than FEW episodes, or all of them alike, cannot tell how
    they vary.
    """
    pairs = np.stack([np.asarray(numerators, float), np.asarray(denominators, float)], -1)
    drawn = units(pairs, houses, episodes)
    draws = (_ratio(*np.moveaxis(drawn[rows], -1, 0)) for rows in _draws(len(drawn), seed))
    low, high = _percentiles(draws, len(drawn))
    found = Estimate(float(_ratio(*pairs.T)), count=len(pairs))
    return replace(found, low=low, high=high) if high - low > ROUNDING * abs(found.value) else found


def units(values: Array, houses: Sequence[str], episodes: Sequence[str] = ()) -> Array:
    """Return (N, ...) values of episodes as (U, ...) sums of what is drawn: houses, or of too few the episodes, each
    with its repeats.

    Raises ValueError unless each episode has a house, or none has, and likewise a name.
    """
    if len(houses) not in (0, len(values)):
        raise ValueError(f"{len(values)} episodes lie in {len(houses)} houses.")
    if len(episodes) not in (0, len(values)):
        raise ValueError(f"{len(values)} episodes have {len(episodes)} names.")
    drawn = houses if len(set(houses)) >= FEW else episodes
    if not len(drawn):
        return values
    names, index = np.unique(np.asarray(drawn, str), return_inverse=True)
    sums = np.zeros((len(names), *values.shape[1:]))
    np.add.at(sums, index, values)
    return sums


def _ratio(above: Array, below: Array) -> Array:
    """Divide sums over the last axis; NaN over nothing."""
    total = below.sum(-1)
    return np.asarray(np.where(total > 0, above.sum(-1) / np.where(total > 0, total, 1.0), np.nan))


def _draws(count: int, seed: int) -> Iterator[NDArray[np.int64]]:
    """Index arrays (R, count) that draw units with replacement, in pieces that stay small; none for too few."""
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
    wider = np.sqrt(count / (count - 1)) * _student_quantile(count - 1)
    low, high = np.quantile(values, [ndtr(-wider), ndtr(wider)])
    return float(low), float(high)


# -- two runs ----------------------------------------------------------------------------------------------------------
def compare_rates(
    a: Sequence[bool], b: Sequence[bool], houses: Sequence[str] = (), episodes: Sequence[str] = (), *, seed: int = 0
) -> Difference:
    """Compare paired successes by an exact test that swaps the runs house by house.

    It is McNemar's where a house is an episode.

    The interval is on each side the wider of Agresti and Min's (2005) and that of a bootstrap over houses; half an
    episode is added to each cell of the former, so that it keeps a width where none differs. Raises ValueError for
    sequences of unequal length.
    """
    first, second = _paired(a, b)
    changes, each = units(second - first, houses, episodes), units(second - first, (), episodes)
    low, high = _agresti_min(each * (len(each) / max(1, len(first))))
    if len(set(houses)) >= FEW:
        drawn = ratio(second - first, np.ones(len(first)), houses, episodes, seed=seed)
        low, high = min(low, drawn.low), max(high, drawn.high)
    value = float(changes.sum() / len(first)) if len(first) else float("nan")
    p = _sign_flips(changes.astype(int))
    alike = np.array_equal(first, second)
    return Difference(_mean(first), _mean(second), value, low, high, p, len(first), _least(changes), alike)


def _agresti_min(changes: Array) -> tuple[float, float]:
    """Interval of the mean of (N,) changes of episodes, each from -1 to 1."""
    cells = len(changes) + 2
    centre = float(changes.sum()) / cells
    square = (float((changes**2).sum()) + 1) / cells
    spread = float(np.sqrt(max(0.0, square - centre**2) / cells)) * _normal_quantile()
    return max(-1.0, centre - spread), min(1.0, centre + spread)


def _sign_flips(changes: NDArray[np.int64]) -> float:
    """Return how likely a sum at least as large is if each of (U,) changes had its sign by the toss of a coin.

    Exactly: all tosses are taken together, one change after the other.
    """
    chances = np.ones(1)
    for change in np.abs(changes[changes != 0]):
        chances = (np.pad(chances, (2 * change, 0)) + np.pad(chances, (0, 2 * change))) / 2
    total = int(np.abs(changes).sum())
    sums = np.arange(len(chances)) - total
    return float(min(1.0, chances[np.abs(sums) >= abs(int(changes.sum()))].sum()))


def _least(drawn: Array) -> float:
    """Return the smallest p of a test that swaps so many units: all of them alike, one way or the other."""
    return float(min(1.0, 2.0 ** (1 - len(drawn))))


def compare_ratios(
    a: Sequence[tuple[float, float]],
    b: Sequence[tuple[float, float]],
    houses: Sequence[str] = (),
    episodes: Sequence[str] = (),
    *,
    seed: int = 0,
) -> Difference:
    """Compare paired (numerator, denominator) of each episode by a bootstrap of the houses and random swaps of these.

    Raises ValueError for sequences of unequal length.
    """
    first, second = _paired(a, b)
    if not len(first):
        nothing = float("nan")
        return Difference(nothing, nothing, nothing, nothing, nothing, 1.0, 0, 1.0, True)
    one, two = float(_ratio(*first.T)), float(_ratio(*second.T))
    both = units(np.stack([first, second], 1), houses, episodes)
    draws = (
        _ratio(*np.moveaxis(both[rows, 1], -1, 0)) - _ratio(*np.moveaxis(both[rows, 0], -1, 0))
        for rows in _draws(len(both), seed)
    )
    low, high = _percentiles(draws, len(both))
    p = _swap_test(both[:, 0], both[:, 1], seed)
    alike = np.array_equal(first, second) or not both[..., 0].any()
    return Difference(one, two, two - one, low, high, p, len(first), _least(both), alike)


def _paired(a: Sequence[object], b: Sequence[object]) -> tuple[Array, Array]:
    if len(a) != len(b):
        raise ValueError(f"a paired comparison needs one value of each run an episode; got {len(a)} and {len(b)}.")
    return np.asarray(a, float), np.asarray(b, float)


def _mean(values: Array) -> float:
    return float(values.mean()) if len(values) else float("nan")


def _swap_test(first: Array, second: Array, seed: int) -> float:
    """How often the difference is as large when each unit's two results are swapped by the toss of a coin."""
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
    """Return the same differences with p raised for their number (Holm): of twenty metrics one differs by chance.

    What is alike in every episode could not have differed by swapping runs, and is none of the number (Tarone 1990).
    What p could have been at least is raised for all of them: less none of them could come to.
    """
    asked = sorted((k for k, one in enumerate(differences) if not one.alike), key=lambda k: differences[k].p)
    raised = [replace(one, least=min(1.0, max(1, len(asked)) * one.least)) for one in differences]
    largest = 0.0
    for rank, k in enumerate(asked):
        largest = max(largest, min(1.0, (len(asked) - rank) * differences[k].p))
        raised[k] = replace(raised[k], p=largest)
    return tuple(raised)
