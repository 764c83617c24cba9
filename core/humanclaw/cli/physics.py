"""`humanclaw physics` and `humanclaw bench-world`: print evidence, write nothing to disk."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from dataclasses import asdict
from typing import Any, Final

import click
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from humanclaw.cli.options import SIMULATOR_HELP, scene_option, seed_option
from humanclaw.cli.tables import show_markdown
from humanclaw.cli.terminal import Console
from humanclaw.world.half_physics.profile import PROFILES

_CHECKS: Final = (
    "free-space",
    "walls",
    "ledge",
    "stairs",
    "boxes",
    "chair",
    "door",
    "hinges",
    "slides",
    "lids",
    "seats",
    "rates",
    "wild",
)


def _bar() -> Progress:
    """Return a progress bar on stderr, so that stdout holds the table alone."""
    console = Console(stderr=True)
    columns = (TextColumn("{task.description}"), BarColumn(30), MofNCompleteColumn(), TimeRemainingColumn())
    return Progress(*columns, console=console, transient=True, disable=not console.is_terminal)


def _world_options(function: Callable[..., Any]) -> Callable[..., Any]:
    simulator = click.option("--simulator", default="", help=SIMULATOR_HELP)
    profile = click.option("--profile", type=click.Choice(list(PROFILES)), default="default", show_default=True)
    return simulator(profile(function))


@click.command()
@_world_options
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
    """Run the physics checks of half-physics. Exits with 1 if one does not hold.

    CHECKS: names of the checks to run; by default all.
    """
    from humanclaw.testing.fixture import Fixture
    from humanclaw.testing.laws import CHECKS, table, ticks

    fixture = Fixture.of(simulator, profile, samples=samples, chunks=chunks, seed=seed)
    names, findings = checks or _CHECKS, []
    with _bar() as bar:
        task = bar.add_task("", total=ticks(fixture, names))
        for name in names:
            bar.update(task, description=name)
            findings += list(CHECKS[name](fixture, lambda: bar.advance(task)))
    rows = [asdict(finding) | {"holds": finding.holds} for finding in findings]
    if as_json:
        click.echo(json.dumps(rows, indent=2, ensure_ascii=False))
    else:
        show_markdown(table(findings))
    sys.exit(not all(finding.holds for finding in findings))


@click.command("bench-world")
@_world_options
@scene_option("scene", default="house:0", about="A house, filled up from itself.")
@click.option("--chunks", type=click.IntRange(1), default=100, show_default=True, help="Half seconds of walking.")
@click.option("--resets", type=click.IntRange(2), default=200, show_default=True, help="How often to load a scene.")
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def bench_world(simulator: str, profile: str, scene: str, chunks: int, resets: int, as_json: bool) -> None:
    """Time half-physics in a house of 360 objects, 60 of them movable. Median [quartiles], CPU time on one core."""
    from humanclaw.testing.fixture import Fixture
    from humanclaw.testing.speed import FIXED, MOVABLE, Quartiles, chunk_times, crowded, reset_times

    fixture = Fixture.of(simulator, profile)
    house = crowded(fixture.plugins.scene(scene))
    with _bar() as bar:
        task = bar.add_task("walking", total=chunks + resets)
        walking = Quartiles.of(chunk_times(fixture, house, chunks, lambda: bar.advance(task)))
        bar.update(task, description="resetting")
        loading, memory = reset_times(fixture.simulator(), house, resets, lambda: bar.advance(task))
    tenth = min(10, resets)
    rows = (
        (f"0.5 s in {scene}, {FIXED} fixed and {MOVABLE} movable objects", f"{walking} ms", "< 100 ms"),
        ("loading it", f"{Quartiles.of(loading)} ms", "< 2000 ms"),
        (f"memory, reset {tenth} to {resets}", f"{memory[tenth - 1]:.0f} to {memory[-1]:.0f} MB", "flat"),
    )
    if as_json:
        keys = ("what", "found", "target")
        click.echo(json.dumps([dict(zip(keys, row, strict=True)) for row in rows], indent=2, ensure_ascii=False))
        return
    lines = ["| world speed | found | target |", "| --- | --- | --- |", *(f"| {' | '.join(row)} |" for row in rows)]
    show_markdown("\n".join(lines))
