"""`humanclaw bench difficulty`: how difficult the episodes of a split are (paper, figure 7)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from math import floor

import click

from humanclaw import EpisodeSpec
from humanclaw.cli import show_markdown
from humanclaw_bench.difficulty import THRESHOLDS, TIERS, scores_of, tier_of
from humanclaw_bench.splits import load_split, summary

WIDEST = 40
"""Characters of the longest bar."""


@click.command("difficulty")
@click.option("--split", "name", default="val", show_default=True, help="val, mini, smoke, dev, or a file of episodes.")
def difficulty_command(name: str) -> None:
    """Show how difficult the episodes of a split are."""
    specs = load_split(name)
    for key, value in summary(specs).items():
        click.echo(f"{key:<13} {value}")
    for dimension in THRESHOLDS:
        show_markdown("\n" + histogram(specs, dimension))


def histogram(specs: Sequence[EpisodeSpec], dimension: str) -> str:
    """Return the number of episodes by tier and by the whole number below their value, as Markdown."""
    known = [scores_of(spec.difficulty)[dimension] for spec in specs if spec.difficulty]
    counts = Counter((floor(value), tier_of(dimension, value)) for value in known)
    most = max(counts.values(), default=1)
    lines = [f"| {dimension} | tier | episodes | |", "| --- | --- | --- | --- |"]
    for low, tier in sorted(counts, key=lambda one: (one[0], TIERS.index(one[1]))):
        count = counts[low, tier]
        lines.append(f"| {low} | {tier} | {count} | {'#' * round(WIDEST * count / most)} |")
    return "\n".join(lines)
