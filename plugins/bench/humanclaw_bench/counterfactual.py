"""`humanclaw bench counterfactual`: check root causes by repairing the blamed capability and playing again.

An agent with a known fault, drawn by the episode's seed, plays episodes until every root cause of the faults occurred
often enough. The benchmark blames a capability for each failure, from the record alone. Then the episode is played
again with the blamed capability repaired.
"""

from __future__ import annotations

import json
from collections.abc import Container, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import count
from pathlib import Path
from typing import Final

import click
import numpy as np

from humanclaw import EpisodeSpec, HumanclawError, Plugins, load_run
from humanclaw.cli import Console, show_markdown
from humanclaw.plugins import install
from humanclaw_bench.attribution import CAUSES, FURTHER
from humanclaw_bench.failure_modes import Cause
from humanclaw_bench.hookspecs import Fault
from humanclaw_bench.progress import RunProgress
from humanclaw_bench.runner import run_split
from humanclaw_bench.scores import Scores
from humanclaw_bench.scoring import scored
from humanclaw_bench.splits import load_split
from humanclaw_bench.worker import Job

PATIENCE: Final = 3
"""Number of episodes tried per wanted root cause, because not every episode shows every fault."""
Causes = Mapping[str, Cause | None]
"""Episode id to root cause; None if the episode did not fail."""


def known_faults(plugins: Plugins) -> tuple[Fault, ...]:
    """Return the faults of plugins. Raises HumanclawError if there are none."""
    faults = tuple(registration.value for registration in plugins.registered("faults"))
    if not faults:
        raise HumanclawError("no plugin has an agent with a known fault.", f"Run `{install(['humanclaw-scripted'])}`.")
    return faults


def drawn(spec: EpisodeSpec, faults: Sequence[Fault]) -> Fault | None:
    """Return the fault with which an episode is played, drawn by its seed from those that it can show."""
    fitting = [fault for fault in faults if fault.fits(spec)]
    return fitting[int(np.random.default_rng([spec.seed, 77]).integers(len(fitting)))] if fitting else None


def by_fault(specs: Sequence[EpisodeSpec], faults: Sequence[Fault]) -> Iterator[tuple[Fault, list[EpisodeSpec]]]:
    """Yield each fault with the episodes that are played with it."""
    for fault in faults:
        if mine := [spec for spec in specs if drawn(spec, faults) is fault]:
            yield fault, mine


def job(fault: Fault, repair: str = "") -> Job:
    """Return the job for a fault. repair: a capability to repair."""
    return Job(fault.agent, {**fault.options, **({"repair": repair} if repair else {})})


def wanting(specs: Sequence[EpisodeSpec], causes: Causes, each: int, faults: Sequence[Fault]) -> list[EpisodeSpec]:
    """Return the episodes to play next: for every fault as many as its root cause occurred too rarely.

    At most PATIENCE * each episodes per fault. causes: of the played episodes.
    """
    todo: list[EpisodeSpec] = []
    for fault, mine in by_fault(specs, faults):
        fresh = [spec for spec in mine[: PATIENCE * each] if spec.id not in causes]
        failures = [cause for spec in mine if (cause := causes.get(spec.id))]
        lacking = each - sum(cause.label == fault.cause for cause in failures)
        todo += fresh[: max(lacking, each // 3)] if lacking > 0 else []  # A third at least: few rounds.
    return todo


def blamed(specs: Sequence[EpisodeSpec], causes: Causes, capability: str) -> list[EpisodeSpec]:
    """Return the episodes whose failure is blamed on a capability."""
    return [spec for spec in specs if (cause := causes.get(spec.id)) and cause.capability == capability]


@dataclass(frozen=True)
class Repaired:
    """The episodes with one label, and how many succeed after the blamed capability is repaired."""

    label: str
    capability: str
    count: int
    repaired: int
    second: int = 0
    """Number of the others with a second label that blames the missing capability."""


def repaired(causes: Causes, right: Mapping[str, Scores], second: Container[str] = ()) -> tuple[Repaired, ...]:
    """Check every label, in the order of the rules.

    right: episode id to scores with the blamed capability repaired. second: episodes with a second label that blames
    the missing capability.
    """
    played = {cause for episode, cause in causes.items() if episode in right}
    return tuple(_repaired(cause, causes, right, second) for cause in CAUSES if cause in played)


def _repaired(cause: Cause, causes: Causes, right: Mapping[str, Scores], second: Container[str]) -> Repaired:
    mine = [episode for episode, blamed_cause in causes.items() if blamed_cause is cause]
    others = [episode for episode in mine if not right[episode].success]
    hidden = sum(episode in second for episode in others)
    return Repaired(cause.label, cause.capability, len(mine), len(mine) - len(others), hidden)


def second_blames(scores: Scores, capability: str) -> bool:
    """Tell whether a second label of a failure blames a capability."""
    further = scores.also.split("; ")
    return any(cause.label in further and cause.capability == capability for cause in (*CAUSES, *FURTHER))


def markdown(rows: Sequence[Repaired]) -> str:
    lines = [
        "| label | capability | episodes | mended by that capability | others: a second label blames the missing one |",
        "| --- | --- | ---: | ---: | ---: |",
    ]
    lines += [
        f"| {r.label} | {r.capability} | {r.count} | {_share(r.repaired, r.count)} | "
        f"{_share(r.second, r.count - r.repaired)} |"
        for r in rows
    ]
    return "\n".join(lines)


def _share(part: int, whole: int) -> str:
    return f"{part} ({100 * part / whole:.0f} %)" if whole else "-"


# -- the command -------------------------------------------------------------------------------------------------------
@click.command()
@click.option("--split", "name", default="val", show_default=True, help="val, mini, smoke, or a file.")
@click.option("--each", type=click.IntRange(1), default=20, show_default=True, help="Failures of each root cause.")
@click.option("--workers", type=click.IntRange(1), default=1, show_default=True, help="Episodes at a time.")
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    default=Path("runs/counterfactual"),
    show_default=True,
    help="Folder of the runs.",
)
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def counterfactual(name: str, each: int, workers: int, out: Path, as_json: bool) -> None:
    """Check root causes with failures of known origin: repair the blamed capability and play again."""
    specs, faults = load_split(name), known_faults(Plugins.discover())
    causes, second = _failures(specs, faults, each, out, workers)
    right: dict[str, Scores] = {}
    for capability in sorted({fault.capability for fault in faults}):
        folder = out / f"{capability}--repaired"
        right |= _play_repaired(blamed(specs, causes, capability), faults, capability, folder, workers)
    rows = repaired(causes, right, second)
    if as_json:
        click.echo(json.dumps([asdict(row) for row in rows], indent=2))
    else:
        show_markdown(markdown(rows))


def _failures(
    specs: Sequence[EpisodeSpec], faults: Sequence[Fault], each: int, out: Path, workers: int
) -> tuple[dict[str, Cause | None], set[str]]:
    """Play episodes with faults until every root cause occurred often enough, and attribute the failures.

    Returns the causes, and the episodes with a second label that blames the missing capability.
    """
    causes: dict[str, Cause | None] = {}
    second: set[str] = set()
    for number in count(1):
        if not (todo := wanting(specs, causes, each, faults)):
            break
        for fault, mine in by_fault(todo, faults):
            played = _played(mine, job(fault), out / f"faulty-{number}" / fault.name, workers)
            causes |= {scores.episode: cause for scores, cause in played}
            second |= {scores.episode for scores, _ in played if second_blames(scores, fault.capability)}
    return causes, second


def _play_repaired(
    specs: Sequence[EpisodeSpec], faults: Sequence[Fault], capability: str, out: Path, workers: int
) -> dict[str, Scores]:
    """Play episodes with their faults again, but with a capability repaired, and score them."""
    folder = Path(str(out).replace(" ", "-"))
    played = [
        play
        for fault, mine in by_fault(specs, faults)
        for play in _played(mine, job(fault, capability), folder / fault.name, workers)
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
