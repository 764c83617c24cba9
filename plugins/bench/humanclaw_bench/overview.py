"""The benchmark's part of the page of a run: the paper's tables, root causes, and a comparison of two runs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Protocol

from humanclaw import Plugins, RecordedEpisode, RecordError
from humanclaw_bench.metrics import ALL, COST, Metric, compare
from humanclaw_bench.results import Result
from humanclaw_bench.scoring import Runs, Scored, metrics_of, results_from, scored_runs
from humanclaw_bench.statistics import Difference
from humanclaw_bench.tables import EXPLAINED, ResultTable, all_tables, happened
from humanclaw_bench.writers import CORRECTED, bearing, compared, texts

SHOWN = (
    "main", "tasks", "hands", "self", "two", "funnel", "causes", "faculties", "hand-causes", "two-causes",
    "difficulty", "category", "variants", "body", "own", "plugins",
)  # fmt: skip
DRAWN = {"funnel": True, "causes": False, "faculties": False, "hand-causes": False, "two-causes": False}
"""Tables of shares that the page draws as charts, and whether the columns become the rows of the chart."""


class Page(Protocol):
    """The methods of humanclaw_report.hookspecs.Overview that are used here."""

    def table(
        self, title: str, head: Sequence[str], rows: Sequence[Sequence[str]], *,
        notes: Sequence[str] = (), shares: Sequence[Sequence[float]] = (), turned: bool = False,
    ) -> None: ...  # fmt: skip

    def episode(
        self, run: Path, name: str, *, success: bool | None, cause: str = "", tier: str = "", step: int | None = None
    ) -> None: ...


def overview(runs: Runs, page: Page, plugins: Plugins) -> None:
    """Add the tables of some runs, and the result of each of their episodes, to a page."""
    pairs = scored_runs(runs, metrics_of(plugins))
    for run, episodes in runs.items():
        _tell_episodes(run, episodes, page, pairs[run])
    run_results = results_from(runs, pairs)
    tables = all_tables(run_results, paper=False)
    tables |= {name: happened(tables[name]) for name in ("causes", "faculties", "hand-causes", "two-causes")}
    for name in SHOWN:
        if tables[name].rows and tables[name].columns:
            _add(tables[name], page, name)
        if name == "main" and len(run_results) == 2:
            _add_comparison(run_results[0], run_results[1], page)


def _tell_episodes(run: Path, episodes: Sequence[RecordedEpisode], page: Page, pairs: Sequence[Scored]) -> None:
    for (scores, cause), recorded in zip(pairs, episodes, strict=True):
        success = scores.success if scores.finished else None
        label, step = (cause.label, cause.step(recorded)) if cause else ("", None)
        page.episode(run, scores.episode, success=success, cause=label, tier=scores.tier, step=step)


def _spent(table: ResultTable) -> ResultTable:
    """Hide token and cost columns if no model was called, so that the other columns have more room."""
    cost = {metric.name for metric in COST}
    kept = [
        index for index, column in enumerate(table.columns)
        if column.name not in cost or any(row.cells[index].value > 0 for row in table.rows)
    ]  # fmt: skip
    rows = tuple(replace(row, cells=tuple(row.cells[index] for index in kept)) for row in table.rows)
    return replace(table, columns=tuple(table.columns[index] for index in kept), rows=rows)


def _add(table: ResultTable, page: Page, name: str) -> None:
    table = _spent(table)
    head, rows = texts(table)
    shares = [[cell.value for cell in row.cells] for row in table.rows] if name in DRAWN else ()
    notes = (*table.meanings, *table.all_notes) if name in EXPLAINED else table.all_notes
    page.table(table.title, head, rows, notes=notes, shares=shares, turned=DRAWN.get(name, False))


def _add_comparison(first: Result, second: Result, page: Page) -> None:
    """Add the comparison of two runs over the episodes that both finished; nothing if they share none."""
    try:
        differences: Mapping[str, Difference] = compare(first.scores, second.scores)
    except RecordError:
        return
    shown = [metric for metric in ALL if metric.name in differences and not _unasked(metric, differences[metric.name])]
    differing = [m for m in shown if differences[m.name].low > 0 or differences[m.name].high < 0]
    cells = [compared(metric, differences[metric.name]) for metric in differing]
    rows = [(*row, f"{said} [p {p}]") for *row, p, said in cells]  # One column less: a phone is narrow.
    alike = ", ".join(metric.name for metric in shown if metric not in differing)
    notes = (
        f"No difference shown (the interval contains 0): {alike or 'none'}.",
        f"{bearing(differences, shown)} p: the runs are swapped house by "
        f"house, exactly for rates, at random for the rest; {CORRECTED}",
    )
    head = ("metric", "A", "B", "B \u2212 A", "verdict")
    page.table(f"Metrics that differ (A: {first.name}, B: {second.name})", head, rows, notes=notes)


def _unasked(metric: Metric, difference: Difference) -> bool:
    """Return whether a metric counts tokens or cost and neither run called a model."""
    return metric in COST and difference.a == difference.b == 0
