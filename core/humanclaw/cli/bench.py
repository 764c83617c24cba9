"""`humanclaw bench`: tables, comparisons and scores of runs, from their records alone."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import click
from rich.console import Console, RenderableType
from tqdm import tqdm

from humanclaw.bench.attribution import Cause, attribute
from humanclaw.bench.metrics import ALL, Scores, common, compare, score
from humanclaw.bench.tables import WRITERS, Result, all_tables, compare_table, main_table, named, terminal
from humanclaw.errors import RecordError
from humanclaw.records import RecordedEpisode, load_run

RUN = click.Path(path_type=Path)
NAMES = ("main", "variants", "body", "funnel", "causes")


@click.group()
def bench() -> None:
    """Score runs: the paper's tables with intervals, comparisons, root causes."""


@bench.command()
@click.argument("runs", type=RUN, nargs=-1, required=True, metavar="RUN...")
@click.option("--format", "form", type=click.Choice(["terminal", *WRITERS]), default="terminal", show_default=True)
@click.option("--only", type=click.Choice(NAMES), multiple=True, help="Only this table. Repeatable; by default all.")
@click.option("--paper/--no-paper", default=True, help="With the paper's rows for reference.")
@click.option("--seed", type=int, default=0, show_default=True, help="Of the bootstrap.")
def table(runs: tuple[Path, ...], form: str, only: tuple[str, ...], paper: bool, seed: int) -> None:
    """Print the paper's tables for one or more runs, a row for each agent."""
    sheets = all_tables(_results(runs), paper=paper, seed=seed)
    for name in only or NAMES:
        if form == "terminal":
            _print(terminal(sheets[name], _console().width))
        else:
            click.echo(WRITERS[form](sheets[name]))


@bench.command("compare")
@click.argument("a", type=RUN)
@click.argument("b", type=RUN)
@click.option("--seed", type=int, default=0, show_default=True, help="Of the bootstrap and the random swaps.")
def compare_command(a: Path, b: Path, seed: int) -> None:
    """Compare two runs over the episodes that both finished, and say which differences are noise."""
    one, two = _one(a), _one(b)
    differences = compare(one.scores, two.scores, seed=seed)
    _print(compare_table(differences, ALL, f"{one.name} ({a})", f"{two.name} ({b})"))
    left_out = len(one.finished) + len(two.finished) - 2 * len(common(one.scores, two.scores))
    if left_out:
        many = "episodes have" if left_out > 1 else "episode has"
        click.echo(f"{left_out} finished {many} no counterpart in the other run: left out.")


@bench.command()
@click.argument("run", type=RUN)
@click.option("--out", type=RUN, help="Where to write; the default is scores.jsonl in the run.")
def rescore(run: Path, out: Path | None) -> None:
    """Score a run again from its records: a line an episode with every number and the root cause."""
    out = out or run / "scores.jsonl"
    found = _scored(load_run(run), run)
    try:
        out.write_text("".join(_line(scores, cause) + "\n" for scores, cause in found), "utf-8")
    except OSError as error:
        raise RecordError(f"cannot write {out}: {error.strerror}.", "Name another file with --out.") from error
    _print(terminal(main_table(named({run.name: found}), paper=False), _console().width))
    click.echo(f"scores: {out}")


def _results(runs: Sequence[Path]) -> tuple[Result, ...]:
    if len({run.resolve() for run in runs}) < len(runs):
        raise RecordError("a run is named twice.", "Name each folder once.")
    return named({str(run): _scored(load_run(run), run) for run in runs})


def _one(run: Path) -> Result:
    results = _results([run])
    if len(results) > 1:
        names = ", ".join(result.name for result in results)
        raise RecordError(f"{run} holds runs of several agents ({names}).", "Name the folder of one of them.")
    return results[0]


def _scored(episodes: Sequence[RecordedEpisode], run: Path) -> list[tuple[Scores, Cause | None]]:
    found: list[tuple[Scores, Cause | None]] = []
    for recorded in tqdm(episodes, desc=f"scoring {run.name}", disable=len(episodes) < 50, leave=False):
        scores = score(recorded)
        found.append((scores, attribute(recorded, scores)))
    return found


def _line(scores: Scores, cause: Cause | None) -> str:
    why = {"stage": cause.stage, "cause": cause.name, "faculty": cause.faculty} if cause else {}
    return json.dumps(_finite(asdict(scores) | why), ensure_ascii=False)


def _finite(value: Any) -> Any:
    """JSON knows neither NaN nor infinity: what is not known is null."""
    if isinstance(value, dict):
        return {key: _finite(part) for key, part in value.items()}
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _console() -> Console:
    """A pipe has no width: tables are as wide there as they need."""
    console = Console()
    return console if console.is_terminal else Console(width=240)


def _print(what: RenderableType) -> None:
    _console().print(what, soft_wrap=False)
