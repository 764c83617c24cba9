"""`humanclaw bench power`: which difference between two runs a split can show, by simulation.

Each house draws a chance of success for both runs, and each episode a difficulty that both share in part. The simulated
runs are compared as `bench compare` compares rates.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import click
import numpy as np
from numpy.typing import NDArray
from scipy.special import betaincinv, ndtr

from humanclaw.body import Array
from humanclaw.cli import counted, seed_option, show_markdown
from humanclaw_bench.splits import SPLITS, load_split
from humanclaw_bench.statistics import SIGNIFICANT, sign_flips

POWER: Final = 0.8
"""Share of the trials in which a difference should be found."""


@dataclass(frozen=True)
class Assumption:
    """What a simulation assumes of two runs."""

    rate: float
    """Rate of the first run."""
    icc: float
    """Intraclass correlation of the episodes of a house."""
    alike: float
    """Correlation of the two runs, between houses and between episodes of a house."""
    tests: int = 3
    """Number of rates that the comparison corrects for (Holm)."""
    # A power of .8 is then known to 3 %: the root of .8 * .2 / 200.
    trials: int = 200


@dataclass(frozen=True)
class Power:
    """What a split can show under an assumption."""

    split: str
    sizes: tuple[int, ...]
    """Episodes of each house."""
    alike: float
    shares: tuple[float, ...]
    """Share of the trials that find each difference."""


def power(sizes: Sequence[int], difference: float, assumed: Assumption, seed: int = 0) -> float:
    """Return the share of simulated pairs of runs whose difference is found (p < SIGNIFICANT).

    sizes: episodes of each house. difference: of the second run's rate from the first.
    """
    rng = np.random.default_rng(seed)
    p_values = (sign_flips(_changes(rng, sizes, difference, assumed)) * assumed.tests for _ in range(assumed.trials))
    return sum(p < SIGNIFICANT for p in p_values) / assumed.trials


def _changes(
    rng: np.random.Generator, sizes: Sequence[int], difference: float, assumed: Assumption
) -> NDArray[np.int64]:
    """Draw two runs. Returns (H,) successes of the second run minus those of the first, by house."""
    means, weight = np.array([assumed.rate, assumed.rate + difference]), 1 / assumed.icc - 1
    chances = betaincinv(means * weight, (1 - means) * weight, _alike(rng, len(sizes), assumed.alike))
    houses = np.repeat(np.arange(len(sizes)), sizes)
    met = (_alike(rng, len(houses), assumed.alike) < chances[houses]).astype(int)
    return np.bincount(houses, met[:, 1] - met[:, 0], len(sizes)).astype(np.int64)


def _alike(rng: np.random.Generator, count: int, correlation: float) -> Array:
    """Draw (N, 2) uniform numbers whose normal scores have a correlation."""
    shared, own = rng.normal(size=(count, 1)), rng.normal(size=(count, 2))
    return np.asarray(ndtr(np.sqrt(correlation) * shared + np.sqrt(1 - correlation) * own))


def smallest(differences: Sequence[float], shares: Sequence[float]) -> float:
    """Return the difference that is found with POWER, between two neighbours by interpolation; NaN if none is."""
    rising = np.maximum.accumulate([0.0, *shares])
    return float(np.interp(POWER, rising, [0.0, *differences])) if rising[-1] >= POWER else float("nan")


def markdown(rows: Sequence[Power], differences: Sequence[float]) -> str:
    """Return the power of each split as Markdown."""
    points = [f"{100 * difference:g}" for difference in differences]
    lines = [
        f"| split | episodes in houses | runs alike | {' | '.join(points)} points | found in {POWER:.0%}, points |",
        "| --- |" + " ---: |" * (len(points) + 3),
    ]
    for row in rows:
        least = smallest(differences, row.shares)
        shown = f"{100 * least:.0f}" if np.isfinite(least) else f"over {points[-1]}"
        shares = " | ".join(f"{share:.0%}" for share in row.shares)
        lines.append(f"| {row.split} | {sum(row.sizes)} in {len(row.sizes)} | {row.alike:g} | {shares} | {shown} |")
    return "\n".join(lines)


@click.command("power")
@click.option(
    "--split", "names", multiple=True, help="A split or a file of episodes; repeatable (default: all splits)."
)
@click.option(
    "--rate", type=click.FloatRange(0.001, 0.999), default=0.5, show_default=True, help="The first run's rate."
)
@click.option(
    "--difference", "differences", type=click.FloatRange(0.001, 0.998), multiple=True,
    default=(0.02, 0.05, 0.1, 0.15, 0.2, 0.3), show_default=True, help="Of the second run; repeatable.",
)  # fmt: skip
@click.option(
    "--icc", type=click.FloatRange(0.001, 0.99), default=0.13, show_default=True,
    help="Intraclass correlation of the episodes of a house.",
)  # fmt: skip
@click.option(
    "--alike", "correlations", type=click.FloatRange(0, 1), multiple=True, default=(0.2, 0.6), show_default=True,
    help="Correlation of the two runs; repeatable. Two versions of one agent are more alike than two models.",
)  # fmt: skip
@click.option("--tests", type=click.IntRange(1), default=3, show_default=True, help="Rates that are corrected for.")
@click.option("--trials", type=click.IntRange(1), default=200, show_default=True, help="Simulated pairs of runs.")
@seed_option(help="All randomness derives from it.")
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def power_command(
    names: tuple[str, ...], rate: float, differences: tuple[float, ...], icc: float, correlations: tuple[float, ...],
    tests: int, trials: int, seed: int, as_json: bool,
) -> None:  # fmt: skip
    """Simulate which difference of two runs a split can show, before any money is spent."""
    if rate + max(differences) >= 1:
        raise click.BadParameter(f"a rate of {rate:g} cannot rise by {max(differences):g}.", param_hint="--difference")
    differences = tuple(sorted(differences))
    rows = []
    for name in names or SPLITS:
        sizes = tuple(Counter(spec.scene for spec in load_split(name)).values())
        for alike in correlations:
            assumed = Assumption(rate, icc, alike, tests, trials)
            rows.append(Power(name, sizes, alike, tuple(power(sizes, d, assumed, seed) for d in differences)))
    if as_json:
        click.echo(json.dumps([_plain(row, differences) for row in rows], indent=2))
        return
    show_markdown(markdown(rows, differences))
    corrected = f"corrected for {counted(tests, 'rate')}"
    click.echo(f"Share of {counted(trials, 'simulated comparison')} with p < {SIGNIFICANT}, {corrected}.")


def _plain(row: Power, differences: Sequence[float]) -> dict[str, object]:
    least = smallest(differences, row.shares)
    return {
        "split": row.split, "episodes": sum(row.sizes), "houses": len(row.sizes), "alike": row.alike,
        "power": {f"{difference:g}": share for difference, share in zip(differences, row.shares, strict=True)},
        "found": least if np.isfinite(least) else None,
    }  # fmt: skip
