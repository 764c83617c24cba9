"""The tables of the paper and of this benchmark, as values."""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any, Final

import numpy as np

from humanclaw import HumanclawError
from humanclaw_bench.attribution import CAUSES, FURTHER, NO_CALL, funnel
from humanclaw_bench.difficulty import THRESHOLDS, TIERS, tiers
from humanclaw_bench.failure_modes import Cause, Rule
from humanclaw_bench.hands.scores import CAUSES as HAND_CAUSES
from humanclaw_bench.metrics import (
    ALL,
    ALONE,
    ARRIVE,
    BODY,
    COLLISIONS,
    FIND,
    HANDS,
    INTERACT,
    MAIN,
    NAV,
    OWN,
    REFUSED,
    SELF,
    TASKS,
    TWO,
    VARIANTS,
    Column,
    Metric,
    estimate,
    extra_metric,
    houses_of,
)
from humanclaw_bench.results import MARK, NONE, Result
from humanclaw_bench.scores import Scores
from humanclaw_bench.splits import CATEGORIES, DATA
from humanclaw_bench.statistics import CONFIDENCE, FEW, Estimate, rate
from humanclaw_bench.two.scores import CAUSES as TWO_CAUSES

HEADLINE: Final = (FIND, ARRIVE, NAV, INTERACT, COLLISIONS, REFUSED)
"""Columns of the table that fits a screen."""
TELLING: Final = 0.1
"""Relevant difference, which the verdict "noise" must exclude: absolute for shares, else relative to the mean."""
PAPER_NOTE: Final = (
    f"{MARK} From the paper's numbers, for reference: other scenes (HSSD), another body and other weights. "
    "Do not compare it with rows of your own."
)
INTERVAL_NOTE: Final = (
    f"Intervals: {CONFIDENCE:.0%} confidence, clustered by house. Rates: beta-binomial profile likelihood. "
    f"Other columns: bootstrap over houses. With fewer than {FEW} houses the unit is the episode, and intervals hold "
    "for these houses alone."
)

RANKS: Final = ("", "\u00b9", "\u00b2")
"""Marks of the best and second-best value of a column: superscripts, which every format has."""
RANK_NOTE: Final = f"{RANKS[1]} best, {RANKS[2]} second best of these runs, whatever the intervals."
_RANKED: Final = 3
"""Of two rows everybody sees which is better."""
ALL_RUNS: Final = "all runs"
"""Rows and columns of several runs pooled, as the paper's error analysis pools its models."""


# -- values ------------------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Row:
    """A row. cells: one estimate for each column."""

    name: str
    cells: tuple[Estimate, ...]
    paper: bool = False
    ranks: tuple[int, ...] = ()
    """1 for the best and 2 for the second-best value of each column, else 0; empty where nothing is ranked."""


@dataclass(frozen=True)
class ResultTable:
    """A table of numbers, before formatting."""

    title: str
    corner: str
    columns: tuple[Column, ...]
    rows: tuple[Row, ...]
    notes: tuple[str, ...] = ()

    @property
    def all_notes(self) -> tuple[str, ...]:
        names = [*(row.name for row in self.rows), *(column.name for column in self.columns)]
        paper = (PAPER_NOTE,) if any(MARK in name for name in names) else ()
        ranked = (RANK_NOTE,) if any(row.ranks for row in self.rows) else ()
        return (*self.notes, *ranked, INTERVAL_NOTE, *paper)

    @property
    def meanings(self) -> tuple[str, ...]:
        """What short names of columns mean, as one note."""
        meanings = "; ".join(f"{column.name}: {column.meaning}" for column in self.columns if column.meaning)
        return (f"{meanings}.",) if meanings else ()


# -- the tables of the paper -------------------------------------------------------------------------------------------
LAYOUTS: Final[Mapping[str, tuple[str, tuple[Metric, ...]]]] = {
    "main": ("Results", MAIN),
    "ablation": ("Ablation", MAIN),
    "tasks": ("Tasks of one's own", TASKS),
    "hands": ("Tasks for hands", (*HANDS, *ALONE)),
    "self": ("Questions about oneself", SELF),
    "two": ("Tasks with a partner", TWO),
    "variants": ("Success by geometry alone and as acknowledged", VARIANTS),
    "body": ("Steps with a collision, by part of the body", BODY),
    "own": ("Landing, reversals, other readings of GeoNavSR, Coll., #Dtb, dDtb and Jerk, and calibration", OWN),
}
"""Title and columns of the tables with a row for each agent, by name: that of paper.json for tables of the paper."""
EXPLAINED: Final = ("main", "tasks", "hands", "self", "two")
"""Tables whose short names of columns are explained below them."""


@cache
def paper_results() -> Mapping[str, Mapping[str, Mapping[str, float]]]:
    """Return the numbers that the paper prints, per cents as such, by table, by agent or setting, and by column."""
    printed = json.loads((DATA / "paper.json").read_text("utf-8"))
    return {
        name: {agent: dict(zip(numbers["columns"], values, strict=True)) for agent, values in numbers["rows"].items()}
        for name, numbers in printed.items()
    }


def result_table(name: str, results: Sequence[Result], *, paper: bool = True) -> ResultTable:
    """Return a table of LAYOUTS. paper: with the paper's rows, if it has any."""
    printed = paper_results().get(name, {}) if paper else {}
    return _result_table(*LAYOUTS[name], results, printed)


def _result_table(
    title: str,
    metrics: Sequence[Metric],
    results: Sequence[Result],
    paper: Mapping[str, Mapping[str, float]],
) -> ResultTable:
    rows = _ranked(metrics, [Row(r.name, tuple(estimate(m, r.scores) for m in metrics)) for r in results])
    rows += [Row(f"{name} {MARK}", _printed(metrics, values), paper=True) for name, values in paper.items() if results]
    return ResultTable(title, "agent", tuple(metrics), tuple(rows), tuple(r.note for r in results))


def _ranked(columns: Sequence[Column], rows: list[Row]) -> list[Row]:
    """Mark the best and second-best value of each column that has a better side; equal values share their mark."""
    if len(rows) < _RANKED or not columns:  # Runs without a metric of a plugin have a table without columns.
        return rows
    places = [_places(column, [row.cells[index].value for row in rows]) for index, column in enumerate(columns)]
    return [replace(row, ranks=ranks) for row, ranks in zip(rows, zip(*places, strict=True), strict=True)]


def _places(column: Column, values: Sequence[float]) -> list[int]:
    """Return the rank of each value, 1 or 2, or 0 for others. As printed, so that rows that look equal are equal."""
    shown = [column.number(value) for value in values]
    finite = {text: value for text, value in zip(shown, values, strict=True) if np.isfinite(value)}
    order = sorted(finite, key=lambda text: finite[text], reverse=column.better == "higher") if column.better else []
    # The worst value of a column has no mark: where all rows are alike there is no best, and of two values no second.
    marked = order[:-1][:2]
    return [marked.index(text) + 1 if text in marked else 0 for text in shown]


def _printed(columns: Sequence[Column], values: Mapping[str, float]) -> tuple[Estimate, ...]:
    """Return the paper's values, percentages as fractions; missing ones stay empty."""
    printed = ((column, values.get(column.name, float("nan"))) for column in columns)
    return tuple(Estimate(value / 100 if column.percent else value) for column, value in printed)


def _pooled(results: Sequence[Result]) -> list[Result]:
    """Return the results, and if there are several, all of them as one."""
    if len(results) < 2:
        return list(results)
    scores = tuple(episode for result in results for episode in result.scores)
    return [*results, Result(ALL_RUNS, scores, tuple(cause for result in results for cause in result.causes))]


def funnel_table(results: Sequence[Result], *, paper: bool = False) -> ResultTable:
    """Return the share of episodes that pass each stage (paper, figure of the error analysis, a)."""
    columns = tuple(Column(title, percent=True) for title in ("in view", "found", "found, reached", "reached, sat"))
    rows = []
    for result in _pooled(results):
        rows.append(Row(result.name, tuple(rate(met, houses_of(asked)) for met, asked in funnel(result.scores))))
    printed = paper_results()["funnel"] if paper and results else {}
    rows += [Row(f"{name} {MARK}", _printed(columns, values), paper=True) for name, values in printed.items()]
    notes = ("'reached, sat' is of the reached episodes whose task is to sit.", *(r.note for r in results))
    return ResultTable("Funnel", "agent", columns, tuple(rows), notes)


Failures = Mapping[str, Sequence[tuple[Cause, Scores]]]
"""The failures of each stage."""


def _failures(result: Result) -> Failures:
    failures: dict[str, list[tuple[Cause, Scores]]] = defaultdict(list)
    for scores, cause in zip(result.scores, result.causes, strict=True):
        if cause:
            failures[cause.stage].append((cause, scores))
    return failures


def causes_table(
    results: Sequence[Result], causes: Sequence[Rule[Any]] = CAUSES, *, paper: bool = False
) -> ResultTable:
    """Return the share of each root cause among the failures of its stage (paper, error analysis, b to d)."""
    stages, pooled = tuple(dict.fromkeys(cause.stage for cause in causes)), _pooled(results)
    columns, failed, printed = _columns(pooled, paper)
    rows = [Row(cause.label, (*_shares_of([cause], failed), *_paper_share(printed, cause.label))) for cause in causes]
    nothing = (NONE,) * bool(printed)
    rows += [
        Row(f"also {cause.label}", (*(_share_of_second(cause, each[cause.stage]) for each in failed), *nothing))
        for cause in (*causes, *FURTHER)
        if any(_is_second(cause, scores) for result in results for scores in result.scores)
    ]
    notes = tuple(
        f"Failures of {result.name}: " + ", ".join(f"{stage} {len(failures[stage])}" for stage in stages) + "."
        for result, failures in zip(pooled, failed, strict=True)
    )
    if any(NO_CALL in result.causes for result in results):
        without = (*map(_share_without_calls, pooled), *nothing)
        rows.append(Row(f"{NO_CALL.label}, of all failures", without))
    if any(row.name.startswith("also ") for row in rows):
        notes += ("Rows that begin with 'also' are second labels: other rules that describe a failure.",)
    notes += tuple(result.note for result in results)
    return ResultTable("Root causes, share of the failures of each stage", "cause", columns, tuple(rows), notes)


def faculties_table(results: Sequence[Result], *, paper: bool = False) -> ResultTable:
    """Return the same shares summed by the faculty that failed, the colours of the paper's figure."""
    columns, failed, printed = _columns(_pooled(results), paper)
    groups: dict[tuple[str, str], list[Cause]] = defaultdict(list)
    for cause in CAUSES:
        groups[cause.stage, cause.capability].append(cause)
    # The paper prints a sum of its own where a share is below 1 %.
    sums = paper_results()["faculties"] if printed else {}
    rows = []
    for (stage, faculty), group in groups.items():
        name = f"{stage}: {faculty}"
        paper_share = _paper_share(sums, name) if name in sums else _paper_share(printed, *(c.label for c in group))
        rows.append(Row(name, (*_shares_of(group, failed), *paper_share)))
    notes = tuple(result.note for result in results)
    return ResultTable("Faculties, share of the failures of each stage", "faculty", columns, tuple(rows), notes)


def _columns(
    results: Sequence[Result], paper: bool
) -> tuple[tuple[Column, ...], list[Failures], Mapping[str, Mapping[str, float]]]:
    """Return a column for each result and for the paper; the failures of each result; the paper's shares."""
    printed = paper_results()["causes"] if paper and results else {}
    named = [result.name for result in results] + [f"{name} {MARK}" for name in _first(printed)]
    return tuple(Column(name, percent=True) for name in named), [_failures(result) for result in results], printed


def _first(printed: Mapping[str, Mapping[str, float]]) -> Sequence[str]:
    return list(next(iter(printed.values()), {}))


def _paper_share(printed: Mapping[str, Mapping[str, float]], *labels: str) -> tuple[Estimate, ...]:
    """Return the sum of the shares that the paper prints, for each of its columns."""
    return tuple(
        Estimate(sum(printed.get(label, {}).get(name, np.nan) for label in labels) / 100) for name in _first(printed)
    )


def _shares_of(causes: Sequence[Cause], failed: Sequence[Failures]) -> Iterator[Estimate]:
    """Yield for each result the share of root causes of one stage among its failures there."""
    return (_share_of(causes, failures[causes[0].stage]) for failures in failed)


def _share_of(causes: Sequence[Cause], failures: Sequence[tuple[Cause, Scores]]) -> Estimate:
    """Return the share of some root causes among the failures of their stage."""
    return rate([cause in causes for cause, _ in failures], houses_of(scores for _, scores in failures))


def _share_without_calls(result: Result) -> Estimate:
    failures = [(cause, scores) for scores, cause in zip(result.scores, result.causes, strict=True) if cause]
    return _share_of([NO_CALL], failures)


def _share_of_second(cause: Cause, failures: Sequence[tuple[Cause, Scores]]) -> Estimate:
    """Return the share of the failures of a stage that have a cause as a second label."""
    return rate([_is_second(cause, scores) for _, scores in failures], houses_of(scores for _, scores in failures))


def _is_second(cause: Cause, scores: Scores) -> bool:
    return cause.label in scores.also.split("; ")


def difficulty_table(results: Sequence[Result]) -> ResultTable:
    """Return the main columns by tier of difficulty (paper, section 4.1)."""
    return _broken_down("Results by difficulty", results, TIERS, lambda s, tier: s.tier == tier)


def factors_table(results: Sequence[Result]) -> ResultTable:
    """Return the main columns by tier of each dimension of difficulty apart (paper, section 4.1)."""
    groups = [f"{dimension}: {tier}" for dimension in THRESHOLDS for tier in TIERS]

    def of(scores: Scores, group: str) -> bool:
        dimension, _, tier = group.partition(": ")
        known = scores.spec.difficulty if scores.spec else None
        return known is not None and tiers(known)[dimension] == tier

    return _broken_down("Results by distance, choice and obstacle", results, groups, of)


def category_table(results: Sequence[Result]) -> ResultTable:
    """Return the main columns by target category."""
    return _broken_down("Results by category", results, CATEGORIES, lambda s, category: s.category == category)


def _broken_down(
    title: str, results: Sequence[Result], groups: Sequence[str], of: Callable[[Scores, str], bool]
) -> ResultTable:
    """Return a row for each agent and group that has episodes."""
    parts = [(r, group, [s for s in r.scores if of(s, group)]) for r in results for group in groups]
    rows = tuple(
        Row(f"{result.name}, {group.replace('_', ' ')}", tuple(estimate(m, chosen) for m in MAIN))
        for result, group, chosen in parts
        if chosen
    )
    return ResultTable(title, "agent", MAIN, rows, tuple(r.note for r in results))


def chosen_table(results: Sequence[Result], names: Sequence[str], *, paper: bool = True) -> ResultTable:
    """Return a table of chosen columns: any of the benchmark's, and metrics of plugins.

    Raises HumanclawError for an unknown name.
    """
    known = {metric.name: metric for metric in ALL} | {name: extra_metric(name) for name in _extra(results)}
    for name in names:
        if name not in known:
            raise HumanclawError(f"there is no column {name!r}.", f"The columns are {', '.join(known)}.")
    return _result_table("Results", [known[name] for name in names], results, _all_printed() if paper else {})


def _all_printed() -> dict[str, dict[str, float]]:
    """Return all numbers that the paper prints of an agent, by agent and column."""
    main, variants, body = (paper_results()[name] for name in ("main", "variants", "body"))
    return {agent: {**variants[agent], **body[agent], **values} for agent, values in main.items()}


def _extra(results: Sequence[Result]) -> dict[str, None]:
    """Return the names of the metrics of plugins."""
    return dict.fromkeys(name for result in results for scores in result.scores for name in scores.extra)


def extra_table(results: Sequence[Result]) -> ResultTable:
    """Return the metrics of plugins, averaged over episodes."""
    metrics = [extra_metric(name) for name in _extra(results)]
    table = _result_table("Metrics of plugins", metrics, results, {})
    return table if metrics else replace(table, notes=("No plugin brings a metric. Give the file of one: --plugin.",))


def brief_tables(results: Sequence[Result], *, paper: bool = False) -> dict[str, ResultTable]:
    """Return what fits a screen: headline numbers, the funnel, and the root causes that occurred.

    paper: with the paper's rows. Where no episode has a target, they are empty.
    """
    of = _apart(results)
    walks = of.walks if any(scores.category for result in of.walks for scores in result.scores) else []
    return {
        "main": chosen_table(walks, [metric.name for metric in HEADLINE], paper=paper),
        "tasks": result_table("tasks", of.own),
        "hands": _result_table("Tasks for hands", HANDS, of.hands, {}),
        "self": result_table("self", of.selves),
        "two": result_table("two", of.two),
        "funnel": funnel_table(walks, paper=paper),
        "causes": happened(causes_table(walks, paper=paper)),
        "hand-causes": happened(causes_table([*of.hands, *of.selves], HAND_CAUSES)),
        "two-causes": happened(causes_table(of.two, TWO_CAUSES)),
    }


@dataclass(frozen=True)
class _Kinds:
    """Results by the kind of their tasks: walking and sitting, one's own, hands, questions about oneself, with a
    partner."""

    walks: Sequence[Result]
    own: Sequence[Result]
    hands: Sequence[Result]
    selves: Sequence[Result]
    two: Sequence[Result]


def _apart(results: Sequence[Result]) -> _Kinds:
    walks = [r for r in results if not (r.of_own or r.of_hands or r.of_oneself or r.of_two)]
    own = [r for r in results if r.of_own]
    hands, selves = [r for r in results if r.of_hands], [r for r in results if r.of_oneself]
    return _Kinds(walks, own, hands, selves, [r for r in results if r.of_two])


def happened(causes: ResultTable) -> ResultTable:
    """Leave out the causes without a failure: they are most rows of the table."""
    return replace(causes, rows=tuple(row for row in causes.rows if any(cell.value > 0 for cell in row.cells)))


def all_tables(results: Sequence[Result], *, paper: bool = True) -> dict[str, ResultTable]:
    """Return every table by its name on the command line; empty ones of tasks that no run has."""
    kinds = _apart(results)
    return {name: make(kinds, paper) for name, make in TABLES.items()}


TABLES: Final[Mapping[str, Callable[[_Kinds, bool], ResultTable]]] = {
    "main": lambda of, paper: result_table("main", of.walks, paper=paper),
    "tasks": lambda of, paper: result_table("tasks", of.own),
    "hands": lambda of, paper: result_table("hands", of.hands),
    "self": lambda of, paper: result_table("self", of.selves),
    "two": lambda of, paper: result_table("two", of.two),
    "variants": lambda of, paper: result_table("variants", of.walks, paper=paper),
    "body": lambda of, paper: result_table("body", of.walks, paper=paper),
    "own": lambda of, paper: result_table("own", of.walks, paper=paper),
    "difficulty": lambda of, paper: difficulty_table(of.walks),
    "factors": lambda of, paper: factors_table(of.walks),
    "category": lambda of, paper: category_table(of.walks),
    "plugins": lambda of, paper: extra_table([*of.walks, *of.own]),
    "funnel": lambda of, paper: funnel_table(of.walks, paper=paper),
    "causes": lambda of, paper: causes_table(of.walks, paper=paper),
    "faculties": lambda of, paper: faculties_table(of.walks, paper=paper),
    "hand-causes": lambda of, paper: causes_table([*of.hands, *of.selves], HAND_CAUSES),
    "two-causes": lambda of, paper: causes_table(of.two, TWO_CAUSES),
}
"""Each table by its name, from the results by kind of task."""


def inline(column: Column, cell: Estimate, rank: int = 0) -> str:
    return f"{column.number(cell.value)}{RANKS[rank]} {column.interval(cell)}".strip()
