"""`humanclaw bench difficulty`: how difficult the episodes of a split are (paper, figure 7)."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from math import floor
from typing import Final

import click

from humanclaw import EpisodeSpec
from humanclaw.cli import show_markdown
from humanclaw_bench.difficulty import THRESHOLDS, TIERS, Tier, scores_of, tier_of
from humanclaw_bench.splits import load_split, summary

WIDEST: Final = 40
"""Characters of the longest bar."""


@dataclass(frozen=True)
class Bin:
    """Episodes of one tier whose value is from this whole number up to the next."""

    low: int
    tier: Tier
    episodes: int


@click.command("difficulty")
@click.option("--split", "name", default="val", show_default=True, help="val, mini, smoke, dev, or a file of episodes.")
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def difficulty_command(name: str, as_json: bool) -> None:
    """Show how difficult the episodes of a split are."""
    specs = load_split(name)
    found = {dimension: histogram(specs, dimension) for dimension in THRESHOLDS}
    if as_json:
        counted = {dimension: [asdict(one) for one in bins] for dimension, bins in found.items()}
        click.echo(json.dumps({"split": summary(specs), **counted}, indent=2))
        return
    for key, value in summary(specs).items():
        click.echo(f"{key:<12} {value}")
    for dimension, bins in found.items():
        show_markdown("\n" + drawn(bins, dimension))


def histogram(specs: Sequence[EpisodeSpec], dimension: str) -> list[Bin]:
    """Count episodes by tier and by the whole number below their value."""
    known = [scores_of(spec.difficulty)[dimension] for spec in specs if spec.difficulty]
    counts = Counter((floor(value), tier_of(dimension, value)) for value in known)
    order = sorted(counts, key=lambda one: (one[0], TIERS.index(one[1])))
    return [Bin(low, tier, counts[low, tier]) for low, tier in order]


def drawn(bins: Sequence[Bin], dimension: str) -> str:
    """Return a histogram as Markdown, with bars."""
    most = max((one.episodes for one in bins), default=1)
    lines = [f"| {dimension} | tier | episodes | |", "| --- | --- | --- | --- |"]
    bars = ("#" * round(WIDEST * one.episodes / most) for one in bins)
    lines += [f"| {one.low} | {one.tier} | {one.episodes} | {bar} |" for one, bar in zip(bins, bars, strict=True)]
    return "\n".join(lines)
