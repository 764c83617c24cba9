"""Intervals and tests, compared with closed forms, full enumeration, and their nominal error rates on seeded draws."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
from house_effect import SIZES, coverage, in_houses
from scipy import stats

from humanclaw_bench.statistics import Difference, compare_rates, compare_ratios, holm, rate, ratio, wilson

Z = 1.959963984540054


# -- rates -------------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(("successes", "trials"), [(0, 10), (10, 10), (42, 100), (1, 1), (597, 1218)])
def test_a_rate_has_wilsons_interval(successes: int, trials: int) -> None:
    independent = stats.binomtest(successes, trials).proportion_ci(0.95, method="wilson")
    interval = wilson(successes, trials)
    assert (interval.value, interval.count) == (successes / trials, trials)
    assert (interval.low, interval.high) == pytest.approx((independent.low, independent.high), abs=1e-9)


def test_no_trials_have_no_rate() -> None:
    assert np.isnan([wilson(0, 0).value, wilson(0, 0).low, wilson(0, 0).high]).all()


@pytest.mark.parametrize(("split", "plain"), [("val", (0.55, 0.75)), ("mini", (0.86, 0.98))])
@pytest.mark.parametrize("share", [0.17, 0.5])
def test_intervals_of_rates_hold_the_truth_where_houses_differ(
    share: float, split: str, plain: tuple[float, float]
) -> None:
    """Wilson's plain interval holds it in two cases of three on val: 30 episodes of a house are worth six."""
    before, after = coverage(share, SIZES[split], 300)[:, 0]
    assert plain[0] <= before <= plain[1]
    assert 0.91 <= after <= 0.99


@pytest.mark.integration
@pytest.mark.parametrize("share", [0.01, 0.99, 0.995])
def test_intervals_of_rates_near_none_and_all_hold_the_truth_too(share: float) -> None:
    """Few failures fall into few houses by chance: taken for independent, four in five intervals held it."""
    assert coverage(share, SIZES["val"], 300)[1, 0] >= 0.93


def test_houses_that_do_not_differ_cost_a_rate_little() -> None:
    met = [k % 2 == 0 for k in range(1200)]
    interval, plain = rate(met, [f"house:{k // 30}" for k in range(1200)]), wilson(600, 1200)
    assert interval.value == plain.value
    assert plain.high <= interval.high <= plain.high + 0.002


def test_a_rate_of_one_has_an_interval_all_the_same() -> None:
    interval = rate([True] * 60, [f"house:{k % 10}" for k in range(60)])
    assert (interval.value, interval.high) == (1.0, 1.0)
    # If the six of a house always end alike, they are ten trials: ten times log(low) is half of t squared, and t of
    # nine degrees is 2.262.
    assert interval.low == pytest.approx(np.exp(-(2.262**2) / 20), abs=0.03)
    assert interval.low < wilson(60, 60).low


def test_two_houses_that_alone_succeed_say_little_of_others() -> None:
    """Clopper and Pearson give two trials in 41 [0.6, 16.5] %; the mean of chances has a narrower interval."""
    interval = rate([k < 60 for k in range(1230)], [f"house:{k // 30}" for k in range(1230)])
    assert (interval.low, interval.high) == pytest.approx((0.006, 0.13), abs=0.01)


@pytest.mark.integration
@pytest.mark.parametrize("share", [0.03, 0.97])
def test_intervals_of_rare_ends_hold_the_truth_in_unlike_houses(share: float) -> None:
    assert coverage(share, SIZES["val"], 300, icc=0.3)[1, 0] >= 0.93


def test_fewer_than_five_houses_say_nothing_of_houses() -> None:
    assert rate([True] * 8 + [False] * 2, ["house:1", "house:2"] * 5) == wilson(8, 10)


def test_the_interval_of_a_mean_holds_the_truth_where_houses_differ() -> None:
    rng = np.random.default_rng(11)
    held = np.zeros(2)
    for seed in range(80):
        values = (5 + rng.normal(0, 1, 41)[:, None] + rng.normal(0, 1, (41, 6))).ravel()
        houses = [f"house:{k}" for k in range(41) for _ in range(6)]
        both = ratio(values, np.ones(246), seed=seed), ratio(values, np.ones(246), houses, seed=seed)
        held += [interval.low <= 5 <= interval.high for interval in both]
    assert held[0] / 80 < 0.85
    assert 0.88 <= held[1] / 80 <= 0.99


# -- means and ratios --------------------------------------------------------------------------------------------------
def test_the_interval_of_a_mean_agrees_with_the_normal_one() -> None:
    values = np.random.default_rng(1).exponential(3.0, 400)
    interval = ratio(values, np.ones(400))
    half = Z * values.std(ddof=1) / 20
    assert interval.value == pytest.approx(values.mean())
    assert (interval.low, interval.high) == pytest.approx((values.mean() - half, values.mean() + half), rel=0.02)


def test_the_interval_of_ten_values_is_as_wide_as_students() -> None:
    """0 to 9 have the deviation sqrt(82.5 / 9) = 3.028, and t of nine degrees is 2.262."""
    intervals = [ratio(np.arange(10.0), np.ones(10), seed=seed) for seed in range(20)]
    half = np.mean([interval.high - interval.low for interval in intervals]) / 2
    assert half == pytest.approx(2.262 * 3.028 / np.sqrt(10), rel=0.03)


def test_intervals_of_a_few_episodes_hold_the_truth_too() -> None:
    rng = np.random.default_rng(2)
    intervals = [ratio(rng.normal(1.0, 1.0, 8), np.ones(8), seed=k) for k in range(300)]
    assert 0.9 <= np.mean([interval.low <= 1.0 <= interval.high for interval in intervals]) <= 0.99


def test_a_ratio_weighs_episodes_by_their_denominators() -> None:
    assert ratio([4.0, 0.0], [1.0, 3.0]).value == 1.0


def test_the_same_seed_gives_the_same_interval() -> None:
    values = np.random.default_rng(3).normal(size=30)
    assert ratio(values, np.ones(30), seed=5) == ratio(values, np.ones(30), seed=5)
    assert ratio(values, np.ones(30), seed=5) != ratio(values, np.ones(30), seed=6)


@pytest.mark.parametrize("count", [0, 1, 4])
def test_too_few_episodes_have_no_interval(count: int) -> None:
    interval = ratio(np.arange(count), np.ones(count))
    assert np.isnan([interval.low, interval.high]).all()
    assert interval.count == count


def test_nothing_disturbed_is_no_path() -> None:
    interval = ratio(np.zeros(9), np.zeros(9))
    assert np.isnan([interval.value, interval.low, interval.high]).all()


# -- paired rates ------------------------------------------------------------------------------------------------------
def test_mcnemars_test_asks_only_the_episodes_that_differ() -> None:
    a = [True] + [False] * 8 + [True] * 30
    b = [False] + [True] * 8 + [True] * 30
    difference = compare_rates(a, b)
    # Of nine tosses at most one the other way: 2 (1 + 9) / 2^9.
    assert difference.p == pytest.approx(20 / 512)
    assert difference.value == pytest.approx(7 / 39)
    assert difference.significant
    other = compare_rates(b, a)
    assert (other.p, other.value, other.low, other.high) == pytest.approx(
        (difference.p, -difference.value, -difference.high, -difference.low)
    )


def test_equal_runs_differ_by_noise_and_not_by_certainty() -> None:
    difference = compare_rates([True, False] * 10, [True, False] * 10)
    assert (difference.p, difference.value) == (1.0, 0.0)
    assert not difference.significant
    assert difference.low < 0.0 < difference.high


def test_the_interval_of_a_paired_difference_holds_the_truth() -> None:
    rng = np.random.default_rng(4)
    held = 0
    for _ in range(400):
        kind = rng.choice(4, 50, p=[0.3, 0.2, 0.1, 0.4])  # both, B alone, A alone, neither: the difference is 0.1
        difference = compare_rates(list(np.isin(kind, (0, 2))), list(np.isin(kind, (0, 1))))
        held += difference.low <= 0.1 <= difference.high
    assert 0.92 <= held / 400 <= 0.99


def test_runs_that_differ_by_house_alone_seldom_pass_for_different() -> None:
    """One agent is better in some houses, the other in others: by McNemar's test they differ in one case of three."""
    rng, loud, plain = np.random.default_rng(12), 0, 0
    for seed in range(60):
        houses = [f"house:{k}" for k in range(20) for _ in range(15)]
        (a, _), (b, _) = (in_houses(rng, 0.5, (15,) * 20, 0.3) for _ in range(2))
        loud += compare_rates(a, b, houses, seed=seed).significant
        plain += compare_rates(a, b).significant
    assert loud <= 7
    assert plain >= 15


def test_the_test_by_house_agrees_with_all_swaps_there_are() -> None:
    changes = [3, -1, 2, 2, 0, 1]
    a = [change < 0 for change in changes for _ in range(abs(change))]
    b = [change > 0 for change in changes for _ in range(abs(change))]
    houses = [f"house:{k}" for k, change in enumerate(changes) for _ in range(abs(change))]
    sums = [abs(np.dot(signs, changes)) for signs in itertools.product((1, -1), repeat=6)]
    assert compare_rates(a, b, houses).p == pytest.approx(np.mean(np.array(sums) >= 7))


def test_two_episodes_can_never_tell() -> None:
    difference = compare_rates([False, False], [True, True])
    assert (difference.p, difference.least) == (0.5, 0.5)
    assert holm([difference, difference])[0].least == 1.0


# -- paired ratios -----------------------------------------------------------------------------------------------------
def test_the_swap_test_agrees_with_all_swaps_there_are() -> None:
    rng = np.random.default_rng(5)
    a, b = rng.uniform(0, 2, (8, 2)), rng.uniform(0.5, 3, (8, 2))
    difference = compare_ratios([tuple(x) for x in a], [tuple(x) for x in b])
    values = []
    for swaps in itertools.product((False, True), repeat=8):
        old = [y if swap else x for x, y, swap in zip(a, b, swaps, strict=True)]
        new = [x if swap else y for x, y, swap in zip(a, b, swaps, strict=True)]
        values.append(sum(x[0] for x in new) / sum(x[1] for x in new) - sum(x[0] for x in old) / sum(x[1] for x in old))
    exact = np.mean(np.abs(values) >= abs(values[0]) - 1e-12)
    assert difference.value == pytest.approx(values[0])
    assert difference.p == pytest.approx(exact, abs=0.04)


def test_p_is_never_zero_and_equal_differences_count() -> None:
    """Forty units apart: of 2,000 swaps none is as large, and the observed one counts. One unit: all are as large."""
    apart = compare_ratios([(0.0, 1.0)] * 40, [(1.0, 1.0)] * 40)
    assert apart.p == 1 / 2001
    assert compare_ratios([(0.0, 1.0)], [(1.0, 1.0)]).p == 1.0


def test_runs_that_are_alike_seldom_pass_for_different() -> None:
    rng, loud = np.random.default_rng(6), 0
    for seed in range(100):
        shared = rng.normal(5.0, 3.0, 30)
        a, b = (shared + rng.normal(0, 1, 30) for _ in range(2))
        loud += compare_ratios([(x, 1.0) for x in a], [(x, 1.0) for x in b], seed=seed).significant
    assert loud <= 11


def test_pairing_shows_a_small_difference_between_unlike_episodes() -> None:
    rng = np.random.default_rng(7)
    episodes = rng.normal(50.0, 30.0, 40)
    a, b = [(x, 1.0) for x in episodes], [(x + 1.0 + rng.normal(0, 0.5), 1.0) for x in episodes]
    difference = compare_ratios(a, b)
    assert difference.significant
    assert 0.0 < difference.low < difference.value < difference.high
    assert difference.high - difference.low < 1.0


def test_nothing_to_compare_is_noise() -> None:
    assert not compare_ratios([], []).significant
    assert not compare_ratios([(0.0, 0.0)] * 6, [(0.0, 0.0)] * 6).significant


# -- many metrics ------------------------------------------------------------------------------------------------------
def test_many_comparisons_raise_p_by_holms_rule() -> None:
    differences = holm([Difference(0, 0, 0, 0, 0, p, 9) for p in (0.01, 0.04, 0.03)])
    assert [difference.p for difference in differences] == pytest.approx([0.03, 0.06, 0.06])
    assert [difference.significant for difference in differences] == [True, False, False]


def test_metrics_in_which_no_episode_differs_raise_no_p_of_others() -> None:
    tokens = compare_ratios([(0.0, 6.0)] * 9, [(0.0, 9.0)] * 9)  # None of six steps, and none of nine.
    stopped = compare_rates([True] * 9, [True] * 9)
    assert (tokens.alike, stopped.alike) == (True, True)
    differences = holm([tokens, Difference(0, 1, 1, 0, 2, 0.02, 9), stopped, Difference(0, 1, 1, 0, 2, 0.03, 9)])
    assert [difference.p for difference in differences] == pytest.approx([1.0, 0.04, 1.0, 0.04])
    assert holm([tokens, stopped])[0].p == 1.0
    certain = replace(tokens, alike=False, least=0.01)
    assert holm([certain, replace(certain, alike=True)])[0].least == 0.01
    assert not compare_rates([True, False], [False, True]).alike


def test_p_is_never_raised_above_one() -> None:
    assert [difference.p for difference in holm([Difference(0, 0, 0, 0, 0, p, 9) for p in (0.9, 0.8)])] == [1.0, 1.0]
