"""The commands of `humanclaw bench` that score recorded runs: table, compare, rescore, export."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path

import click
from rich.console import RenderableType
from rich.text import Text

from humanclaw import Plugins, RecordError, load_run
from humanclaw.cli import Console, plugin_files
from humanclaw.storage import write_result
from humanclaw_bench.cli import PARTIAL, RUN
from humanclaw_bench.conditions import differences as unlike
from humanclaw_bench.export import FORMATS, row
from humanclaw_bench.metrics import ALL, common, compare
from humanclaw_bench.results import Result, named, require_whole
from humanclaw_bench.scoring import metrics_of, results_of as _results, scored_runs
from humanclaw_bench.tables import EXPLAINED, TABLES, ResultTable, all_tables, brief_tables, chosen_table, result_table
from humanclaw_bench.verification import standing
from humanclaw_bench.writers import WRITERS, compare_table, plain, plain_differences, terminal


@click.command()
@click.argument("runs", type=RUN, nargs=-1, required=True, metavar="RUN...")
@click.option("--format", "form", type=click.Choice(["terminal", *WRITERS]), default="terminal", show_default=True)
@click.option("--only", type=click.Choice(list(TABLES)), multiple=True, help="Print only this table (repeatable).")
@click.option(
    "--full", is_flag=True, help="Print all tables; on a terminal and in LaTeX the default are the short ones."
)
@click.option(
    "--column",
    "columns",
    multiple=True,
    help="Print one table with this column (repeatable). It may be a metric of a plugin.",
)
@click.option("--paper/--no-paper", default=None, help="Add the paper's rows, as all but the short tables do.")
@click.option("--json", "as_json", is_flag=True, help="Print JSON: every number in full, shares as fractions.")
@PARTIAL
@plugin_files
def table(
    runs: tuple[Path, ...], form: str, only: tuple[str, ...], columns: tuple[str, ...], paper: bool | None,
    full: bool, as_json: bool, partial: bool, files: tuple[Path, ...],
) -> None:  # fmt: skip
    """Print the tables of one or more runs, one row per agent."""
    results = _results(runs, files)
    if form == "latex":
        require_whole(results, partial)
    if columns and only:
        raise click.UsageError("--only and --column exclude each other.")
    brief = form in ("terminal", "latex") and not (full or only or columns or as_json)
    paper = not brief if paper is None else paper
    if columns:
        tables = {"columns": chosen_table(results, columns, paper=paper)}
    else:
        tables = brief_tables(results, paper=paper) if brief else all_tables(results, paper=paper)
    chosen = {name: tables[name] for name in only} or filled(tables)
    if as_json:
        _print_json({name: plain(result) for name, result in chosen.items()})
        return
    if form == "terminal":
        show(chosen)
        if chosen and brief and not columns:
            click.echo("--full prints all tables, with the paper's rows.")
    else:
        for result in chosen.values():
            click.echo(WRITERS[form](result))


def filled(tables: Mapping[str, ResultTable]) -> dict[str, ResultTable]:
    return {name: result for name, result in tables.items() if result.rows and result.columns}


def show(tables: Mapping[str, ResultTable]) -> None:
    """Print tables on the terminal, then what their columns mean, and each of their notes once."""
    if not tables:
        click.echo("Not scored: no episode has a target. `humanclaw bench table RUN --full` prints what the body did.")
    for result in tables.values():
        _print(terminal(result, Console().width, notes=False))
    meanings = [note for name, table in tables.items() if name in EXPLAINED for note in table.meanings]
    for note in dict.fromkeys([*meanings, *(note for table in tables.values() for note in table.all_notes)]):
        _print(Text(note, style="dim"))


@click.command("compare")
@click.argument("a", type=RUN)
@click.argument("b", type=RUN)
@click.option("--json", "as_json", is_flag=True, help="Print JSON: each difference with interval, p and verdict.")
@PARTIAL
@plugin_files
def compare_command(a: Path, b: Path, as_json: bool, partial: bool, files: tuple[Path, ...]) -> None:
    """Compare two runs over the episodes that both finished. Differences are told from noise."""
    first, second = _one(a, files), _one(b, files)
    require_whole((first, second), partial)
    differences = compare(first.scores, second.scores)
    changed = unlike(first.conditions, second.conditions)
    if as_json:
        _print_json({"settings": changed, "metrics": plain_differences(differences, ALL)})
        return
    _print(Text(f"Settings that differ (A and B): {', '.join(changed)}." if changed else "No setting differs."))
    _print(compare_table(differences, ALL, f"{first.name} ({a})", f"{second.name} ({b})"))
    for result in (first, second):
        _print(Text(result.note, style="dim"))
    left_out = len(first.finished) + len(second.finished) - 2 * len(common(first.scores, second.scores))
    if left_out:
        many = "episodes have" if left_out > 1 else "episode has"
        click.echo(f"Left out: {left_out} finished {many} no counterpart in the other run.")


@click.command()
@click.argument("run", type=RUN)
@click.option("--out", type=RUN, help="File to write (default: scores.jsonl in the run).")
@click.option("--json", "as_json", is_flag=True, help="Print JSON: every number in full, shares as fractions.")
@plugin_files
def rescore(run: Path, out: Path | None, as_json: bool, files: tuple[Path, ...]) -> None:
    """Score a run again from its records. Writes one line per episode, with every number and the root cause."""
    episodes = load_run(run)
    pairs = scored_runs({run: episodes}, metrics_of(Plugins.discover(files)))[run]
    lines = "".join(json.dumps(row(*pair), ensure_ascii=False) + "\n" for pair in pairs)
    out = write_result(out, run, "scores.jsonl", lines.encode())
    scores = result_table("main", named({run.name: pairs}, {run.name: standing(run, episodes)}), paper=False)
    if as_json:
        _print_json(plain(scores) | {"scores": str(out)})
        return
    _print(terminal(scores, Console().width))
    click.echo(f"scores: {out}")


@click.command("export")
@click.argument("run", type=RUN)
@click.option("--to", "form", type=click.Choice(list(FORMATS)), required=True)
@click.option("--out", type=RUN, help="File or folder to write (default: in the run).")
@plugin_files
def export_command(run: Path, form: str, out: Path | None, files: tuple[Path, ...]) -> None:
    """Convert a run for other tools. There are a table, an inspect_ai log and a LeRobotDataset."""
    write, name = FORMATS[form]
    click.echo(write(run, out or run / name, Plugins.discover(files)))


def _one(run: Path, files: Sequence[Path]) -> Result:
    results = _results([run], files)
    require_whole(results, partial=True)  # Foreign records are refused here; missing ones elsewhere.
    if len(results) > 1:
        names = ", ".join(result.name for result in results)
        raise RecordError(f"{run} holds runs of several agents ({names}).", "Name the folder of one of them.")
    return results[0]


def _print(what: RenderableType) -> None:
    Console().print(what, soft_wrap=False)


def _print_json(what: object) -> None:
    click.echo(json.dumps(what, indent=2, ensure_ascii=False))
