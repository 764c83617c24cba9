"""`humanclaw physics`: print evidence, write nothing to disk."""

from __future__ import annotations

import json
import sys
from dataclasses import asdict
from typing import Final

import click
from rich.progress import BarColumn, Progress, TimeElapsedColumn

from humanclaw.cli.options import SIMULATOR_HELP, seed_option
from humanclaw.cli.tables import show_markdown
from humanclaw.cli.terminal import Console
from humanclaw.world.half_physics.profile import PROFILES

_CHECKS: Final = (
    "free-space", "walls", "ledge", "stairs", "boxes", "chair", "door", "hinges", "slides", "lids", "seats", "rates",
    "wild",
)  # fmt: skip
"""Names of the laws: to import humanclaw.laws would take a second."""


def _bar() -> Progress:
    """Return a progress bar on stderr, so that stdout holds the table alone."""
    console = Console(stderr=True)
    columns = "{task.description}", BarColumn(30), "{task.completed} cases", TimeElapsedColumn()
    return Progress(*columns, console=console, transient=True, disable=not console.is_terminal)


@click.command()
@click.option("--simulator", default="", help=SIMULATOR_HELP)
@click.option("--profile", type=click.Choice(list(PROFILES)), default="default", show_default=True)
@click.option(
    "--samples", type=click.IntRange(1), default=200, show_default=True, help="Walls; loads and chairs at most."
)
@click.option("--chunks", type=click.IntRange(1), default=10_000, show_default=True, help="Random commands of 0.5 s.")
@seed_option(help="Of the random commands.")
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
@click.argument("checks", nargs=-1, type=click.Choice(_CHECKS))
def physics(
    simulator: str, profile: str, samples: int, chunks: int, seed: int, as_json: bool, checks: tuple[str, ...]
) -> None:
    """Check that simulators obey the laws of half-physics. Exits with 1 if one does not hold.

    CHECKS: names of the checks to run; by default all.
    """
    from humanclaw.laws.body import CHECKS, table
    from humanclaw.laws.fixture import Fixture

    findings = []
    with _bar() as bar:
        task = bar.add_task("", total=None)
        fixture = Fixture.of(
            simulator, profile, samples=samples, chunks=chunks, seed=seed, progress=lambda: bar.advance(task)
        )
        for name in checks or _CHECKS:
            bar.reset(task, description=name)
            findings += list(CHECKS[name](fixture))
    rows = [asdict(finding) | {"holds": finding.holds} for finding in findings]
    if as_json:
        click.echo(json.dumps(rows, indent=2, ensure_ascii=False))
    else:
        show_markdown(table(findings))
    sys.exit(not all(finding.holds for finding in findings))
