"""`humanclaw bench repair`: check root causes with failures of known origin, without a model."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict
from itertools import count
from pathlib import Path

import click

from humanclaw import EpisodeSpec, Plugins, load_run
from humanclaw.cli import Console, show_markdown
from humanclaw_bench import repair
from humanclaw_bench.causes import Cause
from humanclaw_bench.hookspecs import Fault
from humanclaw_bench.progress import RunProgress
from humanclaw_bench.runner import run_split
from humanclaw_bench.scores import Scores
from humanclaw_bench.scoring import scored
from humanclaw_bench.splits import load_split
from humanclaw_bench.worker import Job


@click.command("repair")
@click.option("--split", "name", default="val", show_default=True, help="val, mini, smoke, or a file.")
@click.option("--each", type=click.IntRange(1), default=20, show_default=True, help="Failures of each root cause.")
@click.option("--workers", type=click.IntRange(1), default=1, show_default=True, help="Episodes at a time.")
@click.option(
    "--out", type=click.Path(path_type=Path), default=Path("runs/repair"), show_default=True, help="Folder of the runs."
)
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def repair_command(name: str, each: int, workers: int, out: Path, as_json: bool) -> None:
    """Check root causes with failures of known origin: repair the blamed capability and play again."""
    specs, faults = load_split(name), repair.known_faults(Plugins.discover())
    causes, second = _failures(specs, faults, each, out, workers)
    right: dict[str, Scores] = {}
    for capability in repair.capabilities(faults):
        folder = out / f"{capability}--repaired"
        right |= _repaired(repair.blamed(specs, causes, capability), faults, capability, folder, workers)
    rows = repair.repaired(causes, right, second)
    if as_json:
        click.echo(json.dumps([asdict(row) for row in rows], indent=2))
    else:
        show_markdown(repair.markdown(rows))


def _failures(
    specs: Sequence[EpisodeSpec], faults: Sequence[Fault], each: int, out: Path, workers: int
) -> tuple[dict[str, Cause | None], set[str]]:
    """Play episodes with faults until every root cause occurred often enough, and attribute the failures.

    Returns the causes, and the episodes with a second label that blames the missing capability.
    """
    causes: dict[str, Cause | None] = {}
    second: set[str] = set()
    for number in count(1):
        if not (todo := repair.wanting(specs, causes, each, faults)):
            break
        for fault, mine in repair.by_fault(todo, faults):
            played = _played(mine, repair.job(fault), out / f"faulty-{number}" / fault.name, workers)
            causes |= {one.episode: cause for one, cause in played}
            second |= {one.episode for one, _ in played if repair.second_blames(one, fault.capability)}
    return causes, second


def _repaired(
    specs: Sequence[EpisodeSpec], faults: Sequence[Fault], capability: str, out: Path, workers: int
) -> dict[str, Scores]:
    """Play episodes with their faults again, but with a capability repaired, and score them."""
    folder = Path(str(out).replace(" ", "-"))
    played = [
        one
        for fault, mine in repair.by_fault(specs, faults)
        for one in _played(mine, repair.job(fault, capability), folder / fault.name, workers)
    ]
    return {scores.episode: scores for scores, _ in played}


def _played(specs: Sequence[EpisodeSpec], job: Job, out: Path, workers: int) -> list[tuple[Scores, Cause | None]]:
    """Run the rest of a split, and score it."""
    if not specs:
        return []
    plugins = Plugins.discover()
    with RunProgress(Console(stderr=True), out) as progress:
        player = plugins.make("executors", "local", workers, "")
        status = run_split(specs, job, player, out, plugins=plugins, watch=progress.watch)
        progress.end(status)
    if status.stopped:
        raise SystemExit(130)
    return scored(load_run(out), name=out.name)
