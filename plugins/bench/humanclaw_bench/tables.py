"""The tables of the paper and of this benchmark, as values."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final, Literal

import numpy as np

from humanclaw import HumanclawError
from humanclaw_bench.attribution import CAUSES, FURTHER, STAGES, Cause, Funnel
from humanclaw_bench.difficulty import THRESHOLDS, TIERS, tiers
from humanclaw_bench.metrics import (
    ALL,
    ARRIVE,
    BODY,
    COLLISIONS,
    FIND,
    INTERACT,
    MAIN,
    NAV,
    OWN,
    VARIANTS,
    Metric,
    clusters,
    estimate,
    extra_metric,
)
from humanclaw_bench.results import MARK, Result
from humanclaw_bench.scores import Scores
from humanclaw_bench.splits import CATEGORIES, repeat_of
from humanclaw_bench.statistics import CONFIDENCE, FEW, Estimate, rate

REPEATED: Final = (FIND, NAV, INTERACT, COLLISIONS)
"""Metrics whose variation between repeats is shown."""
HEADLINE: Final = (FIND, ARRIVE, NAV, INTERACT, COLLISIONS)
"""Columns of the table that fits a screen."""
TELLING: Final = 0.1
"""Relevant difference, which the verdict "noise" must exclude: absolute for shares, else relative to the mean."""
PAPER_NOTE: Final = (
    f"{MARK} As printed in the paper, for reference: other scenes (HSSD), another body and other weights. "
    "Do not compare it with rows of your own."
)
INTERVAL_NOTE: Final = (
    f"Intervals: {CONFIDENCE:.0%} confidence, clustered by house. Rates: beta-binomial profile likelihood. "
    f"Other columns: bootstrap over houses. With fewer than {FEW} houses the unit is the episode, and intervals hold "
    "for these houses alone. An episode with its repeats counts once."
)


# -- values ------------------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Column:
    title: str
    digits: int = 1
    percent: bool = False
    better: Literal["higher", "lower", ""] = ""
    counts: tuple[int, int] | None = None
    """Result.counts, if the column belongs to an agent."""
    meaning: str = ""

    @classmethod
    def of(cls, metric: Metric) -> Column:
        return cls(metric.name, metric.digits, metric.percent, metric.better, meaning=metric.meaning)

    @property
    def head(self) -> str:
        return self.title + {"higher": " \u2191", "lower": " \u2193", "": ""}[self.better]

    def number(self, value: float) -> str:
        if not np.isfinite(value):
            return "\u2013"
        text = f"{100 * value if self.percent else value:.{self.digits}f}"
        return (text if text.strip("-0.") else text.lstrip("-")) + "%" * self.percent  # Avoid "-0.0".

    def interval(self, estimate: Estimate) -> str:
        """Return the interval as text, such as [38.1, 46.9]; empty without one."""
        if not np.isfinite([estimate.low, estimate.high]).all():
            return ""
        low, high = (self.number(bound).rstrip("%") for bound in (estimate.low, estimate.high))
        return f"[{low}, {high}]"

    @property
    def rounded(self) -> Column:
        """Return the interval in whole per cents, which makes room for more columns."""
        return replace(self, digits=0 if self.percent else self.digits)


@dataclass(frozen=True)
class Row:
    """A row. cells: one estimate for each column."""

    name: str
    cells: tuple[Estimate, ...]
    paper: bool = False
    counts: tuple[int, int] | None = None
    """Result.counts, if the row belongs to an agent."""
    profile: str = ""
    """The profile that it was played with, if the row belongs to an agent."""

    @classmethod
    def of(cls, result: Result, cells: Iterable[Estimate], more: str = "") -> Row:
        """Return a row of an agent. more: what its name says besides."""
        return cls(result.name + more, tuple(cells), False, result.counts, result.conditions.get("profile", ""))


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
        paper = (PAPER_NOTE,) if any(row.paper for row in self.rows) else ()
        return (*self.notes, INTERVAL_NOTE, *paper)


# -- the tables of the paper -------------------------------------------------------------------------------------------
def main_table(results: Sequence[Result], *, paper: bool = True, seed: int = 0) -> ResultTable:
    """Return success, disturbance, smoothness and cost (paper, table of the full validation results)."""
    return _result_table("Results", MAIN, results, _named(PAPER_COLUMNS, PAPER_MAIN) if paper else {}, seed)


def ablation_table(results: Sequence[Result], *, paper: bool = True, seed: int = 0) -> ResultTable:
    """Return the main columns by setting of the harness (paper, table of the ablation)."""
    return _result_table("Ablation", MAIN, results, _named(PAPER_COLUMNS, PAPER_ABLATION) if paper else {}, seed)


def variants_table(results: Sequence[Result], *, paper: bool = True, seed: int = 0) -> ResultTable:
    """Return success with and without the agent's own acknowledgement (paper, table of success-rate variants)."""
    printed = _named([metric.name for metric in VARIANTS], PAPER_VARIANTS) if paper else {}
    return _result_table("Success by geometry alone and as acknowledged", VARIANTS, results, printed, seed)


def body_table(results: Sequence[Result], *, paper: bool = True, seed: int = 0) -> ResultTable:
    """Return the share of steps with a collision by body group; groups overlap (paper, table of collisions)."""
    printed = _named([metric.name for metric in BODY], PAPER_BODY) if paper else {}
    return _result_table("Steps with a collision, by part of the body", BODY, results, printed, seed)


def own_table(results: Sequence[Result], *, seed: int = 0) -> ResultTable:
    """Return landing rate and turn reversals (paper, section 5.2), other readings of five metrics, and calibration."""
    title = "Landing, reversals, other readings of GeoNavSR, Coll., #Dtb, dDtb and Jerk, and calibration"
    return _result_table(title, OWN, results, {}, seed)


def _result_table(
    title: str,
    metrics: Sequence[Metric],
    results: Sequence[Result],
    paper: Mapping[str, Mapping[str, float]],
    seed: int,
) -> ResultTable:
    columns = tuple(map(Column.of, metrics))
    rows = [Row.of(r, (estimate(m, r.scores, seed=seed) for m in metrics)) for r in results]
    rows += [Row(f"{name} {MARK}", _printed(columns, values), paper=True) for name, values in paper.items()]
    return ResultTable(title, "agent", columns, tuple(rows), tuple(r.note for r in results))


def _named(columns: Sequence[str], rows: Mapping[str, tuple[float, ...]]) -> dict[str, dict[str, float]]:
    """Return the paper's rows by name of the column."""
    return {name: dict(zip(columns, values, strict=True)) for name, values in rows.items()}


def _printed(columns: Sequence[Column], values: Mapping[str, float]) -> tuple[Estimate, ...]:
    """Return the paper's values, percentages as fractions; missing ones stay empty."""
    printed = ((column, values.get(column.title, float("nan"))) for column in columns)
    return tuple(Estimate(value / 100 if column.percent else value) for column, value in printed)


def funnel_table(results: Sequence[Result]) -> ResultTable:
    """Return the share of episodes that pass each stage (paper, figure of the error analysis, a)."""
    columns = tuple(Column(title, percent=True) for title in ("in view", "found", "found, reached", "reached, sat"))
    shares = [tuple(rate(met, *clusters(asked)) for met, asked in Funnel.of(r.scores).shares) for r in results]
    rows = tuple(Row.of(r, cells) for r, cells in zip(results, shares, strict=True))
    notes = ("'reached, sat' is of the reached episodes whose task is to sit.", *(r.note for r in results))
    return ResultTable("Funnel", "agent", columns, rows, notes)


def causes_table(results: Sequence[Result]) -> ResultTable:
    """Return the share of each root cause among the failures of its stage (paper, error analysis, b to d)."""
    columns = tuple(Column(result.name, percent=True, counts=result.counts) for result in results)
    failed = [
        {stage: [(c, s) for s, c in zip(r.scores, r.causes, strict=True) if c and c.stage == stage] for stage in STAGES}
        for r in results
    ]
    rows = tuple(
        Row(cause.label, tuple(_share(cause, failures[cause.stage]) for failures in failed)) for cause in CAUSES
    )
    rows += tuple(
        Row(f"also {cause.label}", tuple(_share_of_second(cause, failures[cause.stage]) for failures in failed))
        for cause in (*CAUSES, *FURTHER)
        if any(_is_second(cause, scores) for result in results for scores in result.scores)
    )
    notes = tuple(
        f"Failures of {result.name}: " + ", ".join(f"{stage} {len(failures[stage])}" for stage in STAGES) + "."
        for result, failures in zip(results, failed, strict=True)
    )
    if len(rows) > len(CAUSES):
        notes += ("Rows that begin with 'also' are second labels: other rules that describe a failure.",)
    notes += tuple(result.note for result in results)
    return ResultTable("Root causes, share of the failures of each stage", "cause", columns, rows, notes)


def _share(cause: Cause, failures: Sequence[tuple[Cause, Scores]]) -> Estimate:
    """Return the share of one root cause among the failures of its stage."""
    return rate([found is cause for found, _ in failures], *clusters([scores for _, scores in failures]))


def _share_of_second(cause: Cause, failures: Sequence[tuple[Cause, Scores]]) -> Estimate:
    """Return the share of the failures of a stage that have a cause as a second label."""
    return rate([_is_second(cause, scores) for _, scores in failures], *clusters([scores for _, scores in failures]))


def _is_second(cause: Cause, scores: Scores) -> bool:
    return cause.label in scores.also.split("; ")


def difficulty_table(results: Sequence[Result], *, seed: int = 0) -> ResultTable:
    """Return the main columns by tier of difficulty (paper, section 4.1)."""
    return _broken_down("Results by difficulty", results, TIERS, lambda s, tier: s.tier == tier, seed)


def factors_table(results: Sequence[Result], *, seed: int = 0) -> ResultTable:
    """Return the main columns by tier of each dimension of difficulty apart (paper, section 4.1)."""
    groups = [f"{dimension}: {tier}" for dimension in THRESHOLDS for tier in TIERS]

    def of(scores: Scores, group: str) -> bool:
        dimension, _, tier = group.partition(": ")
        known = scores.spec.difficulty if scores.spec else None
        return known is not None and tiers(known)[dimension] == tier

    return _broken_down("Results by distance, choice and obstacle", results, groups, of, seed)


def category_table(results: Sequence[Result], *, seed: int = 0) -> ResultTable:
    """Return the main columns by target category."""
    return _broken_down("Results by category", results, CATEGORIES, lambda s, one: s.category == one, seed)


def _broken_down(
    title: str, results: Sequence[Result], groups: Sequence[str], of: Callable[[Scores, str], bool], seed: int
) -> ResultTable:
    """Return a row for each agent and group that has episodes."""
    parts = [(r, group, [s for s in r.scores if of(s, group)]) for r in results for group in groups]
    rows = tuple(
        Row.of(result, (estimate(m, chosen, seed=seed) for m in MAIN), f", {group.replace('_', ' ')}")
        for result, group, chosen in parts
        if chosen
    )
    return ResultTable(title, "agent", tuple(map(Column.of, MAIN)), rows, tuple(r.note for r in results))


def repeats_table(results: Sequence[Result], *, seed: int = 0) -> ResultTable:
    """Return the rates of each repeat, and their variation between seeds; no row for a run without repeats."""
    rows = tuple(row for result in results for row in _repeats(result, seed))
    told = "The last row of an agent: standard deviation between its repeats, which differ in their seeds alone."
    notes = (told, *(result.note for result in results))
    return ResultTable("Repeats", "agent", tuple(map(Column.of, REPEATED)), rows, notes)


def _repeats(result: Result, seed: int) -> Iterator[Row]:
    numbers = sorted({repeat_of(s.episode) for s in result.finished})
    if len(numbers) < 2:
        return
    found = []
    for number in numbers:
        chosen = [s for s in result.finished if repeat_of(s.episode) == number]
        found.append(tuple(estimate(m, chosen, seed=seed) for m in REPEATED))
        yield Row.of(result, found[-1], f", repeat {number}")
    spread = (float(np.std([cell.value for cell in cells], ddof=1)) for cells in zip(*found, strict=True))
    yield Row.of(result, map(Estimate, spread), ", deviation")


def chosen_table(results: Sequence[Result], names: Sequence[str], *, paper: bool = True, seed: int = 0) -> ResultTable:
    """Return a table of chosen columns: any of the benchmark's, and metrics of plugins.

    Raises HumanclawError for an unknown name.
    """
    known = {metric.name: metric for metric in ALL} | {name: extra_metric(name) for name in _extra(results)}
    for name in names:
        if name not in known:
            raise HumanclawError(f"there is no column {name!r}.", f"The columns are {', '.join(known)}.")
    return _result_table("Results", [known[name] for name in names], results, _all_printed() if paper else {}, seed)


def _all_printed() -> dict[str, dict[str, float]]:
    """Return all numbers that the paper prints of an agent, by agent and column."""
    main = _named(PAPER_COLUMNS, PAPER_MAIN)
    variants = _named([metric.name for metric in VARIANTS], PAPER_VARIANTS)
    body = _named([metric.name for metric in BODY], PAPER_BODY)
    return {agent: variants[agent] | body[agent] | values for agent, values in main.items()}


def _extra(results: Sequence[Result]) -> dict[str, None]:
    """Return the names of the metrics of plugins."""
    return dict.fromkeys(name for result in results for scores in result.scores for name in scores.extra)


def extra_table(results: Sequence[Result], *, seed: int = 0) -> ResultTable:
    """Return the metrics of plugins, averaged over episodes."""
    return _result_table("Metrics of plugins", [extra_metric(name) for name in _extra(results)], results, {}, seed)


def brief_tables(results: Sequence[Result], *, seed: int = 0) -> dict[str, ResultTable]:
    """Return what fits a screen: headline numbers, the funnel, and the root causes that occurred."""
    headline = chosen_table(results, [metric.name for metric in HEADLINE], paper=False, seed=seed)
    return {"main": headline, "funnel": funnel_table(results), "causes": happened(causes_table(results))}


def happened(causes: ResultTable) -> ResultTable:
    """Leave out the causes without a failure: they are most rows of the table."""
    return replace(causes, rows=tuple(row for row in causes.rows if any(cell.value > 0 for cell in row.cells)))


def all_tables(results: Sequence[Result], *, paper: bool = True, seed: int = 0) -> dict[str, ResultTable]:
    """Return every table by its name on the command line."""
    return {
        "main": main_table(results, paper=paper, seed=seed),
        "repeats": repeats_table(results, seed=seed),
        "variants": variants_table(results, paper=paper, seed=seed),
        "body": body_table(results, paper=paper, seed=seed),
        "own": own_table(results, seed=seed),
        "difficulty": difficulty_table(results, seed=seed),
        "factors": factors_table(results, seed=seed),
        "category": category_table(results, seed=seed),
        "plugins": extra_table(results, seed=seed),
        "funnel": funnel_table(results),
        "causes": causes_table(results),
    }


def inline(column: Column, cell: Estimate) -> str:
    return f"{column.number(cell.value)} {column.interval(cell)}".strip()


# -- the paper's numbers -----------------------------------------------------------------------------------------------
PAPER_COLUMNS: Final = (
    "FindSR", "NavSR", "InteractSR", "Coll.", "#Dtb", "dDtb (m)", "Jerk", "steps", "in tok/step", "out tok/step",
)  # fmt: skip
PAPER_MAIN: Final = {
    "GPT-5.5": (55.1, 13.9, 3.4, 43.4, 1.53, 1.56, 4.2, 82.4, 4360, 354),
    "Gemini-3.1": (64.9, 42.4, 16.8, 39.5, 1.50, 1.22, 5.7, 59.1, 5890, 311),
    "Gemini-2.5": (58.5, 21.6, 3.5, 37.7, 1.35, 3.03, 8.7, 71.3, 6412, 401),
    "Claude-4.8": (32.6, 8.6, 1.5, 44.2, 1.73, 2.76, 5.3, 81.0, 7047, 625),
    "Gemma-4-31B": (58.1, 28.7, 11.1, 40.1, 1.66, 1.86, 4.8, 78.5, 4632, 322),
    "Qwen3.6-27B": (51.0, 20.9, 0.2, 43.0, 1.95, 2.16, 6.5, 81.6, 4862, 482),
    "Qwen3.6-35B-A3B": (44.6, 5.8, 0.0, 34.6, 1.45, 2.38, 7.4, 74.0, 4766, 477),
    "Qwen3.5-27B": (37.8, 13.5, 0.0, 34.5, 0.93, 2.38, 6.8, 37.6, 4641, 473),
    "InternVL3.5-38B": (46.8, 0.8, 0.0, 51.2, 1.90, 2.56, 7.2, 93.0, 4459, 309),
}
PAPER_ABLATION: Final = {
    "baseline": (58.0, 27.0, 18.9, 41.4, 1.35, 9.38, 4.9, 78.5, 4676, 322),
    "history 0": (65.0, 11.0, 0.0, 38.6, 1.27, 6.46, 5.1, 88.9, 2582, 292),
    "history 20": (59.0, 27.0, 7.5, 42.9, 1.18, 1.56, 4.8, 80.3, 6692, 326),
    "history 50": (60.0, 28.0, 7.5, 40.4, 1.24, 6.16, 4.8, 77.6, 10538, 320),
    "history 100": (56.0, 26.0, 11.3, 37.6, 1.08, 7.23, 4.7, 79.7, 12904, 318),
    "images 2": (57.0, 31.0, 9.4, 43.0, 1.19, 2.55, 4.7, 78.8, 5234, 321),
    "images 5": (55.0, 28.0, 7.5, 41.1, 1.30, 8.86, 5.1, 82.7, 6335, 324),
    "images 10": (53.0, 13.0, 3.8, 34.9, 0.95, 3.19, 5.2, 92.3, 7685, 303),
    "without verifier": (51.0, 2.0, 0.0, 33.2, 0.71, 10.40, 4.8, 47.5, 4095, 247),
    "without mid-level": (62.0, 30.0, 0.0, 35.4, 1.22, 2.08, 5.0, 70.3, 3769, 264),
}
PAPER_VARIANTS: Final = {
    "GPT-5.5": (55.1, 63.2, 13.9, 27.7, 15.5, 3.4, 9.7),
    "Gemini-3.1": (64.9, 69.9, 42.4, 44.7, 52.5, 16.8, 21.4),
    "Gemini-2.5": (58.5, 66.4, 21.6, 23.6, 31.0, 3.5, 4.5),
    "Claude-4.8": (32.6, 55.7, 8.6, 13.5, 11.4, 1.5, 2.2),
    "Gemma-4-31B": (58.1, 67.7, 28.7, 35.6, 33.4, 11.1, 17.9),
    "Qwen3.6-27B": (51.0, 62.8, 20.9, 34.8, 24.2, 0.2, 0.3),
    "Qwen3.6-35B-A3B": (44.6, 59.0, 5.8, 14.0, 11.4, 0.0, 0.0),
    "Qwen3.5-27B": (37.8, 48.9, 13.5, 17.7, 19.2, 0.0, 0.0),
    "InternVL3.5-38B": (46.8, 59.1, 0.8, 12.6, 1.6, 0.0, 0.0),
}
PAPER_BODY: Final = {
    "GPT-5.5": (43.37, 23.24, 13.78, 38.83, 2.99),
    "Gemini-3.1": (39.48, 20.97, 11.72, 33.29, 2.62),
    "Gemini-2.5": (37.69, 22.70, 13.63, 30.87, 2.94),
    "Claude-4.8": (44.18, 28.97, 16.90, 37.94, 6.93),
    "Gemma-4-31B": (40.09, 21.21, 11.38, 34.72, 2.66),
    "Qwen3.6-27B": (42.97, 25.48, 12.70, 36.86, 3.54),
    "Qwen3.6-35B-A3B": (34.58, 21.20, 11.40, 27.99, 3.71),
    "Qwen3.5-27B": (34.53, 20.59, 10.93, 29.58, 2.87),
    "InternVL3.5-38B": (51.17, 34.68, 23.12, 44.75, 6.10),
}
