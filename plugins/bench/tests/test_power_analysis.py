"""The power of a split: what a comparison would find, compared with closed forms."""

from __future__ import annotations

import json

import numpy as np
import pytest
from manifests import invoke
from scipy import stats

from humanclaw_bench.power_analysis import Assumption, markdown, power, smallest
from humanclaw_bench.statistics import SIGNIFICANT

VAL, MINI = (30,) * 41, (2,) * 23 + (3,) * 18


def test_two_runs_alike_differ_as_rarely_as_the_test_promises() -> None:
    assumed = Assumption(0.5, icc=0.13, alike=0.4, tests=1, trials=1000)
    assert 0.03 <= power(VAL, 0.0, assumed) <= 0.07
    assert power(VAL, 0.0, Assumption(0.5, 0.13, 0.4, tests=3, trials=1000)) <= SIGNIFICANT / 2


def test_houses_of_one_episode_each_have_the_power_of_mcnemars_test() -> None:
    """Independent runs of rates .5 and .7 over 100 episodes differ in a number of episodes of chance .5; .7 of them are
    won. The exact test is enumerated over both binomials."""
    assumed = Assumption(0.5, icc=0.001, alike=0.0, tests=1, trials=2000)
    expected = 0.0
    for n in range(1, 101):
        k = np.arange(n + 1)
        p = 2 * stats.binom.cdf(np.minimum(k, n - k), n, 0.5)
        expected += stats.binom.pmf(n, 100, 0.5) * stats.binom.pmf(k, n, 0.7)[p < SIGNIFICANT].sum()
    assert power((1,) * 100, 0.2, assumed) == pytest.approx(expected, abs=0.04)


def test_more_houses_and_runs_that_are_more_alike_show_more() -> None:
    loose, tight = (Assumption(0.5, icc=0.13, alike=alike, trials=300) for alike in (0.2, 0.8))
    assert power(MINI, 0.1, loose) < power(VAL, 0.1, loose) < power(VAL, 0.1, tight)


def test_the_smallest_difference_is_interpolated() -> None:
    assert smallest((0.1, 0.2), (0.6, 1.0)) == pytest.approx(0.15)
    assert np.isnan(smallest((0.1, 0.2), (0.3, 0.7)))
    assert (
        "over 20" in markdown([], ()) + invoke("power", "--split", "smoke", "--difference", 0.2, "--trials", 5).output
    )


def test_the_command_tells_every_split_and_is_the_same_again() -> None:
    words = ("--split", "mini", "--split", "smoke", "--difference", 0.1, "--difference", 0.3, "--trials", 20, "--json")
    first, again = (json.loads(invoke("power", *words).output) for _ in range(2))
    assert first == again
    assert [(row["split"], row["episodes"], row["alike"]) for row in first] == [
        ("mini", 100, 0.2), ("mini", 100, 0.6), ("smoke", 5, 0.2), ("smoke", 5, 0.6),
    ]  # fmt: skip
    assert set(first[0]["power"]) == {"0.1", "0.3"}
    assert first[2]["found"] is None  # Five episodes show nothing.


def test_a_difference_beyond_all_successes_is_refused() -> None:
    result = invoke("power", "--rate", 0.9, "--difference", 0.2)
    assert (result.exit_code, "a rate of 0.9 cannot rise by 0.2" in result.output) == (2, True)
