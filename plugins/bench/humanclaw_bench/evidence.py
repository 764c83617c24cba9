"""`humanclaw bench ablate` and `bench repair`: check how the benchmark responds to known faults, without a model."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from itertools import count
from pathlib import Path

import click

from humanclaw import Backends, EpisodeSpec, Plugins, load_run
from humanclaw.cli import Console, parse_limits, parse_pairs, show_markdown
from humanclaw_bench import ablation, repair
from humanclaw_bench.causes import Cause
from humanclaw_bench.export import scored
from humanclaw_bench.hookspecs import Fault
from humanclaw_bench.integrity import standing
from humanclaw_bench.progress import RunProgress
from humanclaw_bench.results import Result
from humanclaw_bench.runner import Forecast, run_split
from humanclaw_bench.scores import Scores
from humanclaw_bench.splits import complete_split, load_split
from humanclaw_bench.tables import ablation_table
from humanclaw_bench.worker import Job
from humanclaw_bench.writers import plain, terminal

_SPLIT = click.option(
    "--split",
    "name",
    default="mini",
    show_default=True,
    help="val, mini, smoke, or a file.",
    shell_complete=complete_split,
)
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
@click.option("--model", default="", help="Any litellm model. The default is a scripted bounded agent.")
@click.option("--option", "pairs", multiple=True, metavar="KEY=VALUE", help="Option of the model. Repeatable.")
@click.option("--limit", "limits", multiple=True, metavar="SCOPE.UNIT=N", help="Limit as in `bench run`. Repeatable.")
@click.option(
    "--setting",
    "settings",
    multiple=True,
    type=click.Choice([*ablation.MODEL_SETTINGS, *ablation.FURTHER_SETTINGS]),
    help="Setting of the model. Repeatable; the default is the paper's ten.",
)
@click.option("--yes", is_flag=True, help="Do not ask for confirmation after the estimate of time and cost.")
def ablate(
    name: str, workers: int, out: Path, as_json: bool, model: str, pairs: Sequence[str], limits: Sequence[str],
    settings: Sequence[str], yes: bool,
) -> None:  # fmt: skip
    """Run the paper's ablation, or continue it.

    With --model, plays the settings of the paper's table and prints its columns. Otherwise a scripted bounded agent
    plays five settings, and the table shows whether they reproduce the paper's four directions.
    """
    specs = load_split(name)
    if model:
        given, chosen = {"model": model, **parse_pairs(pairs)}, settings or tuple(ablation.MODEL_SETTINGS)
        _ablate_model(specs, ablation.model_jobs(given, parse_limits(limits), chosen), out, workers, as_json, yes)
        return
    if pairs or limits or settings:
        raise click.UsageError("--option, --limit and --setting belong to a model: add --model NAME.")
    scores = {}
    for setting in ablation.SETTINGS:
        click.echo(setting.name, err=True)
        scores[setting.name] = [one for one, _ in _played(specs, setting.job(Backends()), out / setting.name, workers)]
    if as_json:
        click.echo(json.dumps(ablation.plain(scores), indent=2))
    else:
        show_markdown(ablation.markdown(scores))


def _ablate_model(
    specs: Sequence[EpisodeSpec], jobs: Mapping[str, Job], out: Path, workers: int, as_json: bool, yes: bool
) -> None:
    """Play the settings one after another; the estimate of the first one covers all."""
    results = []
    for number, (setting, job) in enumerate(jobs.items()):
        click.echo(setting, err=True)
        left = (len(jobs) - number - 1) * len(specs)
        run = out / setting.replace(" ", "-")
        played = _played(specs, job, run, workers, ask=not (number or yes), later=left)
        results.append(Result.of(setting, played, standing(run, load_run(run))))
    table = ablation_table(results)
    if as_json:
        click.echo(json.dumps(plain(table), indent=2))
    else:
        Console().print(terminal(table, Console().width))


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
    causes, second = _failures(specs, faults, each, out, workers)
    right: dict[str, Scores] = {}
    for capability in repair.capabilities(faults):
        folder = out / f"{capability}--repaired"
        right |= _repaired(repair.blamed(specs, causes, capability), faults, capability, folder, workers)
    singly = repair.repaired(causes, right, second)
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


def _played(
    specs: Sequence[EpisodeSpec], job: Job, out: Path, workers: int, *, ask: bool = False, later: int = 0
) -> list[tuple[Scores, Cause | None]]:
    """Run the rest of a split, and score it. ask: for confirmation after an estimate, which covers as many later
    episodes of other runs too."""
    if not specs:
        return []
    plugins = Plugins.discover()
    with RunProgress(Console(stderr=True), out) as progress:
        player = plugins.make("executors", "local", workers, "")

        def go_on(forecast: Forecast) -> bool:
            return not ask or progress.foresee(forecast.with_later(later), ask=True)

        status = run_split(specs, job, player, out, plugins=plugins, watch=progress.watch, go_on=go_on)
        progress.end(status)
    if status.stopped and not status.limited:  # What a limit left undone is a row all the same.
        raise SystemExit(130)
    return scored(load_run(out), name=out.name)
