"""`humanclaw bench ablate` and `bench repair`: check how the benchmark responds to known faults, without a model."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict
from itertools import count
from pathlib import Path

import click
from rich.console import Console

from humanclaw import Backends, EpisodeSpec, Plugins, load_run
from humanclaw.cli import show_markdown
from humanclaw_bench import ablation, repair
from humanclaw_bench.attribution import Cause
from humanclaw_bench.export import scored
from humanclaw_bench.hookspecs import Fault
from humanclaw_bench.progress import RunProgress
from humanclaw_bench.runner import run_split
from humanclaw_bench.scores import Scores
from humanclaw_bench.splits import load_split
from humanclaw_bench.worker import Job

_SPLIT = click.option("--split", "name", default="mini", show_default=True, help="val, mini, smoke, or a file.")
_WORKERS = click.option("--workers", type=click.IntRange(1), default=1, show_default=True, help="Episodes at a time.")

_JSON = click.option("--json", "as_json", is_flag=True, help="Print JSON.")


@click.command()
@_SPLIT
@_WORKERS
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    default=Path("runs/ablation"),
    show_default=True,
    help="Folder of the runs.",
)
@_JSON
def ablate(name: str, workers: int, out: Path, as_json: bool) -> None:
    """Run the paper's ablation with a scripted bounded agent.

    Plays five settings and shows whether they reproduce the paper's four directions.
    """
    specs, scores = load_split(name), {}
    for setting in ablation.SETTINGS:
        click.echo(setting.name, err=True)
        scores[setting.name] = [one for one, _ in _played(specs, setting.job(Backends()), out / setting.name, workers)]
    if as_json:
        click.echo(json.dumps(ablation.plain(scores), indent=2))
    else:
        show_markdown(ablation.markdown(scores))


@click.command("repair")
@click.option("--split", "name", default="val", show_default=True, help="val, mini, smoke, or a file.")
@click.option("--each", type=click.IntRange(1), default=20, show_default=True, help="Failures of each root cause.")
@click.option(
    "--pairs", type=click.IntRange(0), default=40, show_default=True, help="Episodes with two faults at once."
)
@_WORKERS
@click.option(
    "--out", type=click.Path(path_type=Path), default=Path("runs/repair"), show_default=True, help="Folder of the runs."
)
@_JSON
def repair_command(name: str, each: int, pairs: int, workers: int, out: Path, as_json: bool) -> None:
    """Check root causes with failures of known origin: repair the blamed capability and play again."""
    specs, faults = load_split(name), repair.known_faults(Plugins.discover())
    causes = _failures(specs, faults, each, out, workers)
    right: dict[str, Scores] = {}
    for capability in repair.capabilities(faults):
        folder = out / f"{capability}--repaired"
        right |= _repaired(repair.blamed(specs, causes, capability), faults, capability, folder, workers)
    singly = repair.repaired(causes, right)
    paired = _pairs(specs, faults, pairs, out / "pairs", workers) if pairs else ()
    if as_json:
        found = {"one fault": [asdict(one) for one in singly], "two faults": [asdict(one) for one in paired]}
        click.echo(json.dumps(found, indent=2))
        return
    show_markdown(repair.markdown(singly))
    if paired:
        show_markdown("\n" + repair.pairs_markdown(paired))


def _pairs(
    specs: Sequence[EpisodeSpec], faults: Sequence[Fault], count: int, out: Path, workers: int
) -> tuple[repair.Paired, ...]:
    """Play episodes with two faults at once: with both, and with the capability of either repaired."""
    both = {spec.id: (own, other) for spec in specs if (own := repair.drawn(spec, faults))
            and (other := repair.companion(spec, faults))}  # fmt: skip
    chosen = [spec for spec in specs if spec.id in both]
    chosen = chosen[:: max(1, len(chosen) // count)][:count]
    causes: dict[str, Cause | None] = {}
    mended: dict[str, dict[str, Cause | None]] = {name: {} for name in repair.capabilities(faults)}
    for spec in chosen:
        own, other = both[spec.id]
        for capability in ("", own.capability, other.capability):
            folder = out / f"{own.name}+{other.name}--{capability or 'both'}".replace(" ", "-")
            job = repair.pair_job(own, other, capability)
            ((_, cause),) = _played([spec], job, folder / spec.id, workers)
            (mended[capability] if capability else causes)[spec.id] = cause
    return repair.paired(causes, mended, both)


def _failures(
    specs: Sequence[EpisodeSpec], faults: Sequence[Fault], each: int, out: Path, workers: int
) -> dict[str, Cause | None]:
    """Play episodes with faults until every root cause occurred often enough, and attribute the failures."""
    causes: dict[str, Cause | None] = {}
    for number in count(1):
        if not (todo := repair.wanting(specs, causes, each, faults)):
            break
        for fault, mine in repair.by_fault(todo, faults):
            played = _played(mine, repair.job(fault), out / f"faulty-{number}" / fault.name, workers)
            causes |= {one.episode: cause for one, cause in played}
    return causes


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
