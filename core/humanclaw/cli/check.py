"""`humanclaw check`: every named check of a skill, on the terminal."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from rich.markup import escape
from rich.table import Table

from humanclaw.cli.options import plugin_options, seed_option
from humanclaw.cli.terminal import Console
from humanclaw.plugins.choice import Choice
from humanclaw.plugins.host import Plugins
from humanclaw.skills.checks import CHECKS
from humanclaw.text.words import counted

if TYPE_CHECKING:
    from humanclaw.checks.skills import Report


@click.command()
@click.argument("targets", nargs=-1, metavar="[NAME|FOLDER|FILE]...")
@click.option("--samples", type=click.IntRange(0), default=3, show_default=True, help="Calls besides those at bounds.")
@seed_option(help="What the samples derive from.")
@click.option(
    "--engine",
    "engines",
    multiple=True,
    metavar="NAME",
    help="Simulator that plays it, or none. Repeatable. The default is each that is installed.",
)
@click.option("--list", "listing", is_flag=True, help="Print the names of all checks, and what holds if one passes.")
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
@plugin_options
def check(
    targets: Sequence[str],
    samples: int,
    seed: int,
    engines: Sequence[str],
    listing: bool,
    as_json: bool,
    files: tuple[Path, ...],
    choice: Choice,
) -> None:
    """Check skills against the contract, and play them. Exits with 1 if one has a fault.

    Items of other kinds (agents, scenes, renderers, ...) are made and used once.

    NAME is an installed skill (owner:skill if two plugins have it) or an installed plugin. FOLDER holds one or more
    skill folders, or a package. FILE is a Python file with hooks. Without arguments, all installed skills are checked.
    """
    if listing:
        _list_checks(as_json)
        return
    # Imported here: it loads bodies and engines, which other commands do not need.
    from humanclaw.checks.targets import check_target

    plugins = Plugins.discover(files, choice)
    named = targets or [*plugins.skills, *plugins.disabled]
    played = None if not engines else [name for name in engines if name != "none"]
    reports = [
        report
        for target in named
        for report in check_target(target, plugins, engines=played, samples=samples, seed=seed)
    ]
    if as_json:
        click.echo(json.dumps([_row(report) for report in reports], indent=2))
    else:
        _print(reports)
    sys.exit(not all(report.passed for report in reports))


def _list_checks(as_json: bool) -> None:
    if as_json:
        click.echo(json.dumps(dict(CHECKS), indent=2))
        return
    table = Table.grid("name", "what holds", padding=(0, 2))
    table.columns[0].no_wrap = True
    for name, says in CHECKS.items():
        table.add_row(name, escape(says))
    Console(highlight=False).print(table)


def _row(report: Report) -> dict[str, Any]:
    faults = [{"check": fault.check, "problem": fault.message, "remedy": fault.remedy} for fault in report.faults]
    played = {"calls": report.calls, "engines": report.engines, "notes": report.notes}
    return {"skill": report.skill, "passed": report.passed, "faults": faults, **played}


def _print(reports: Sequence[Report]) -> None:
    console = Console(emoji=False)
    for report in reports:
        for line in _lines(report):
            console.print(line, highlight=False, soft_wrap=True)
    broken = sum(not report.passed for report in reports)
    count = sum(len(report.faults) for report in reports)
    skills = counted(len(reports), "item" if any(" " in report.skill for report in reports) else "skill")
    summary = f"{counted(count, 'fault')} in {broken} of {skills}" if broken else f"{skills}, no fault"
    console.print(f"{summary}; {len(CHECKS)} named checks.", highlight=False, soft_wrap=True)


def _lines(report: Report) -> Iterator[str]:
    if report.passed:
        played = f": {counted(report.calls, 'call')} played on {', '.join(['a fake body', *report.engines])}"
        yield f"[green]ok[/]    {escape(report.skill)}{escape(played) if report.calls else ''}"
    else:
        yield f"[red]fault[/] {escape(report.skill)}"
    for fault in report.faults:
        yield f"      [bold]{fault.check}[/]: {escape(fault.message)}"
        if fault.remedy:
            yield f"        {escape(fault.remedy)}"
    for note in report.notes:
        yield f"      [dim]note: {escape(note)}[/]"
