"""The paper's tables, of one's own runs, each number with its interval; for the terminal, Markdown, CSV and LaTeX."""

from __future__ import annotations

import csv
import io
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final, Literal

import numpy as np
from rich.box import SIMPLE_HEAD
from rich.console import Group
from rich.table import Table
from rich.text import Text

from humanclaw.cli import counted, legible
from humanclaw_bench.attribution import CAUSES, STAGES, Cause, Funnel
from humanclaw_bench.difficulty import TIERS
from humanclaw_bench.integrity import Standing
from humanclaw_bench.metrics import (
    BODY,
    COLLISIONS,
    FIND,
    INTERACT,
    MAIN,
    NAV,
    VARIANTS,
    Metric,
    Scores,
    clusters,
    estimate,
    extra_metric,
)
from humanclaw_bench.splits import CATEGORIES, repeat_of
from humanclaw_bench.statistics import CONFIDENCE, FEW, SIGNIFICANT, Difference, Estimate, rate

REPEATED: Final = (FIND, NAV, INTERACT, COLLISIONS)
"""Of which metrics it is told how much they vary between repeats."""
NONE: Final = Estimate(float("nan"))
MOST_UNASKED: Final = 0.01
"""Share of a verifier's steps above which calls that were let through unasked are worth a warning."""
TELLING: Final = 0.1
"""A difference of shares, or of anything else a part of the level of both runs, that "noise" must leave no room for."""
MARK: Final = "\u2020"
PAPER_NOTE: Final = (
    f"{MARK} As printed in the paper, for reference: other scenes (HSSD), another body and other weights. "
    "Its difference from a row of your own is no result."
)
INTERVAL_NOTE: Final = (
    f"Intervals hold the true value with {CONFIDENCE:.0%} confidence: "
    f"Wilson for rates, at the number of episodes that they are worth as houses differ; a bootstrap over houses for "
    f"the rest. With fewer than {FEW} houses both are over episodes, and hold for these houses alone. "
    "An episode with its repeats is one."
)


# -- a table -----------------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Column:
    title: str
    digits: int = 1
    percent: bool = False
    better: Literal["higher", "lower", ""] = ""
    counts: tuple[int, int] | None = None
    """Of a column that is an agent's: Result.counts."""

    @classmethod
    def of(cls, metric: Metric) -> Column:
        return cls(metric.name, metric.digits, metric.percent, metric.better)

    @property
    def head(self) -> str:
        return self.title + {"higher": " \u2191", "lower": " \u2193", "": ""}[self.better]

    def number(self, value: float) -> str:
        if not np.isfinite(value):
            return "\u2013"
        text = f"{100 * value if self.percent else value:.{self.digits}f}"
        return (text if text.strip("-0.") else text.lstrip("-")) + "%" * self.percent  # No minus before nothing.

    def interval(self, estimate: Estimate) -> str:
        """Such as [38.1, 46.9]; empty where there is none."""
        if not np.isfinite([estimate.low, estimate.high]).all():
            return ""
        low, high = (self.number(bound).rstrip("%") for bound in (estimate.low, estimate.high))
        return f"[{low}, {high}]"

    @property
    def rounded(self) -> Column:
        """The same with whole per cents, which leaves room for more columns."""
        return replace(self, digits=0 if self.percent else self.digits)


@dataclass(frozen=True)
class Row:
    """cells: one estimate a column."""

    name: str
    cells: tuple[Estimate, ...]
    paper: bool = False
    counts: tuple[int, int] | None = None
    """Of a row that is an agent's: Result.counts."""


@dataclass(frozen=True)
class ResultTable:
    """A table of numbers, before it is written in some format."""

    title: str
    corner: str
    columns: tuple[Column, ...]
    rows: tuple[Row, ...]
    notes: tuple[str, ...] = ()

    @property
    def all_notes(self) -> tuple[str, ...]:
        paper = (PAPER_NOTE,) if any(row.paper for row in self.rows) else ()
        return (*self.notes, INTERVAL_NOTE, *paper)


# -- which episodes make a row -----------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Result:
    """The scored episodes of one agent in one run, and why each failed episode did."""

    name: str
    scores: tuple[Scores, ...]
    causes: tuple[Cause | None, ...]
    """One a score; None for an episode that did not fail."""
    asked: int = 0
    """Episodes of the run, as its run.json says; 0 if there is none."""
    faults: tuple[str, ...] = ()
    """What contradicts its run.json, or leaves it open whether a record was changed."""
    again: int = 0
    """Episodes that were played again after they had ended."""

    @property
    def finished(self) -> tuple[Scores, ...]:
        return tuple(s for s in self.scores if s.finished)

    @property
    def total(self) -> int:
        """Episodes that there should be."""
        return max(self.asked, len(self.scores))

    @property
    def partial(self) -> bool:
        """Whether episodes are missing, or nothing tells that none is: not run yet, cut short by a limit of the run, or
        broken by the infrastructure."""
        return not self.asked or len(self.finished) < self.total

    @property
    def counts(self) -> tuple[int, int]:
        """Episodes that the numbers are of, and those that there should be; 0 if nothing tells."""
        return len(self.finished), self.total if self.asked else 0

    @property
    def note(self) -> str:
        """How many episodes the numbers are of, which were left out, what plugins broke, and a verifier that was not
        asked."""
        apart = Counter(s.outcome for s in self.scores if not s.finished)
        left_out = "".join(f"; apart from every number: {count} {outcome}" for outcome, count in sorted(apart.items()))
        of = f"{len(self.finished)} of " if len(self.finished) < self.total else ""
        told = f"{of}{counted(self.total, 'episode')}" + ("" if self.asked else ", of how many no run.json tells")
        note = (
            f"{self.name}: {told}{left_out}.{self._privileged}{self._again}{self._broken}{self._unasked}{self._foreign}"
        )
        return " ".join(legible(note).split())  # A line, whatever a record of somebody else's holds.

    @property
    def _again(self) -> str:
        return f" Played again after they had ended: {self.again}." if self.again else ""

    @property
    def _foreign(self) -> str:
        more = f" ({len(self.faults)} such faults: see `humanclaw bench verify`)" if len(self.faults) > 1 else ""
        return f" Warning: {self.faults[0]}{more}" if self.faults else ""

    @property
    def _privileged(self) -> str:
        told = " and ".join(sorted({s.privileged for s in self.scores if s.privileged}))
        return f" Privileged, told scene and true state: {told}." if told else ""

    @property
    def _broken(self) -> str:
        faults = Counter(s.error for s in self.finished if s.outcome == "plugin_error")
        return "".join(
            f" Failed by a plugin, and counted: {count} ({error})." for error, count in sorted(faults.items())
        )

    @property
    def _unasked(self) -> str:
        verified, unasked = (sum(getattr(s, name) for s in self.finished) for name in ("verified", "unasked"))
        if not verified:
            return ""
        warning = " Warning: this is not the verifier's row." if unasked > MOST_UNASKED * verified else ""
        return f" Let through unasked: {100 * unasked / verified:.1f} %.{warning}"


def named(
    runs: Mapping[str, Sequence[tuple[Scores, Cause | None]]], known: Mapping[str, Standing] | None = None
) -> tuple[Result, ...]:
    """Scored episodes by run to one result a run, agent, verifier and simulator. known: what each run's folder tells.

    The simulator's name is told only where there are several, and a run's only where the rest repeats.
    """
    several = len({scores.simulator for found in runs.values() for scores, _ in found}) > 1
    groups: dict[tuple[str, str], list[tuple[Scores, Cause | None]]] = {}
    for run, found in runs.items():
        for scores, cause in found:
            agent = scores.agent + (f" + {scores.verifier}" if scores.verifier else "")
            agent += f", {scores.simulator or 'simulator unknown'}" if several else ""
            groups.setdefault((agent, run), []).append((scores, cause))
    repeated = Counter(agent for agent, _ in groups)
    return tuple(
        Result(
            agent if repeated[agent] == 1 else f"{agent} ({run})",
            tuple(scores for scores, _ in found),
            tuple(cause for _, cause in found),
            standing.asked,
            standing.faults,
            standing.again,
        )
        for (agent, run), found in groups.items()
        for standing in [(known or {}).get(run, Standing())]
    )


# -- the tables of the paper -------------------------------------------------------------------------------------------
def main_table(results: Sequence[Result], *, paper: bool = True, seed: int = 0) -> ResultTable:
    """Success, disturbance, smoothness and cost (paper, table of the full validation results)."""
    # The paper does not tell of false claims, which stand beside FindSR here.
    printed = {name: (find, float("nan"), *rest) for name, (find, *rest) in PAPER_MAIN.items()} if paper else {}
    return _result_table("Results", MAIN, results, printed, seed)


def variants_table(results: Sequence[Result], *, paper: bool = True, seed: int = 0) -> ResultTable:
    """Success with and without the agent's own acknowledgement (paper, table of success-rate variants)."""
    return _result_table(
        "Success by geometry alone and as acknowledged", VARIANTS, results, PAPER_VARIANTS if paper else {}, seed
    )


def body_table(results: Sequence[Result], *, paper: bool = True, seed: int = 0) -> ResultTable:
    """Share of steps with a collision, by body group; groups overlap (paper, table of the collision breakdown)."""
    return _result_table(
        "Steps with a collision, by part of the body", BODY, results, PAPER_BODY if paper else {}, seed
    )


def _result_table(
    title: str, metrics: Sequence[Metric], results: Sequence[Result], paper: Mapping[str, tuple[float, ...]], seed: int
) -> ResultTable:
    columns = tuple(map(Column.of, metrics))
    rows = [Row(r.name, tuple(estimate(m, r.scores, seed=seed) for m in metrics), counts=r.counts) for r in results]
    rows += [Row(f"{name} {MARK}", _printed(columns, values), paper=True) for name, values in paper.items()]
    return ResultTable(title, "agent", columns, tuple(rows), tuple(r.note for r in results))


def _printed(columns: Sequence[Column], values: Sequence[float]) -> tuple[Estimate, ...]:
    """Values as the paper prints them, percentages as such; what it does not report stays empty."""
    padded = (*values, *[float("nan")] * (len(columns) - len(values)))
    return tuple(
        Estimate(value / 100 if column.percent else value) for column, value in zip(columns, padded, strict=True)
    )


def funnel_table(results: Sequence[Result]) -> ResultTable:
    """Share of episodes that remain after each stage (paper, figure of the error analysis, a)."""
    columns = tuple(Column(title, percent=True) for title in ("in view", "found", "found, reached", "reached, sat"))
    shares = [tuple(rate(met, *clusters(asked)) for met, asked in Funnel.of(r.scores).shares) for r in results]
    rows = tuple(Row(r.name, cells, counts=r.counts) for r, cells in zip(results, shares, strict=True))
    notes = ("The last column is of the reached episodes whose task is to sit.", *(r.note for r in results))
    return ResultTable("Funnel", "agent", columns, rows, notes)


def causes_table(results: Sequence[Result]) -> ResultTable:
    """Share of each root cause among the failures of its stage (paper, figure of the error analysis, b to d)."""
    columns = tuple(Column(result.name, percent=True, counts=result.counts) for result in results)
    failed = [
        {stage: [(c, s) for s, c in zip(r.scores, r.causes, strict=True) if c and c.stage == stage] for stage in STAGES}
        for r in results
    ]
    rows = tuple(
        Row(cause.label, tuple(_share(cause, failures[cause.stage]) for failures in failed)) for cause in CAUSES
    )
    notes = tuple(
        f"{result.name}: failures " + ", ".join(f"{stage} {len(failures[stage])}" for stage in STAGES) + "."
        for result, failures in zip(results, failed, strict=True)
    )
    notes += tuple(result.note for result in results)
    return ResultTable("Root causes, share of the failures of each stage", "cause", columns, rows, notes)


def _share(cause: Cause, failures: Sequence[tuple[Cause, Scores]]) -> Estimate:
    """Of the failures of a stage those with one root cause."""
    return rate([found is cause for found, _ in failures], *clusters([scores for _, scores in failures]))


def difficulty_table(results: Sequence[Result], *, seed: int = 0) -> ResultTable:
    """Return the main columns by the tier of the episode (paper, section 4.1)."""
    return _broken_down("Results by difficulty", results, TIERS, lambda s: s.tier, seed)


def category_table(results: Sequence[Result], *, seed: int = 0) -> ResultTable:
    """Return the main columns by the category of the target."""
    return _broken_down("Results by category", results, CATEGORIES, lambda s: s.category, seed)


def _broken_down(
    title: str, results: Sequence[Result], groups: Sequence[str], key: Callable[[Scores], str], seed: int
) -> ResultTable:
    """Return a row for each agent and group that has episodes."""
    parts = [(r, group, [s for s in r.scores if key(s) == group]) for r in results for group in groups]
    rows = tuple(
        Row(
            f"{result.name}, {group.replace('_', ' ')}",
            tuple(estimate(m, chosen, seed=seed) for m in MAIN),
            counts=result.counts,
        )
        for result, group, chosen in parts
        if chosen
    )
    return ResultTable(title, "agent", tuple(map(Column.of, MAIN)), rows, tuple(r.note for r in results))


def repeats_table(results: Sequence[Result], *, seed: int = 0) -> ResultTable:
    """Tell the rates of every repeat, and how much they vary between seeds; no row for a run without repeats."""
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
        yield Row(f"{result.name}, repeat {number}", found[-1], counts=result.counts)
    spread = (float(np.std([cell.value for cell in cells], ddof=1)) for cells in zip(*found, strict=True))
    yield Row(f"{result.name}, deviation", tuple(map(Estimate, spread)), counts=result.counts)


def extra_table(results: Sequence[Result], *, seed: int = 0) -> ResultTable:
    """Return what plugins measure, averaged over episodes."""
    names = dict.fromkeys(name for result in results for scores in result.scores for name in scores.extra)
    return _result_table("Metrics of plugins", [extra_metric(name) for name in names], results, {}, seed)


def all_tables(results: Sequence[Result], *, paper: bool = True, seed: int = 0) -> dict[str, ResultTable]:
    """Every table, by the name under which the command line offers it."""
    return {
        "main": main_table(results, paper=paper, seed=seed),
        "repeats": repeats_table(results, seed=seed),
        "variants": variants_table(results, paper=paper, seed=seed),
        "body": body_table(results, paper=paper, seed=seed),
        "difficulty": difficulty_table(results, seed=seed),
        "category": category_table(results, seed=seed),
        "plugins": extra_table(results, seed=seed),
        "funnel": funnel_table(results),
        "causes": causes_table(results),
    }


# -- writing a table ---------------------------------------------------------------------------------------------------
def terminal(table: ResultTable, width: int = 80) -> Group:
    """For rich, in as many parts as the width asks for; intervals in a second line of their cell."""
    parts = [_part(table, first, last) for first, last in _cuts(table, width)]
    notes = (Text(note, style="dim") for note in table.all_notes)
    return Group(Text(table.title, style="bold"), *parts, *notes, "")


def _cuts(table: ResultTable, width: int) -> Iterator[tuple[int, int]]:
    """Ranges of columns that fit side by side, at least one in each."""
    names = max(len(text) for text in (table.corner, *(row.name for row in table.rows)))
    first, used = 0, names + 3
    for index, column in enumerate(table.columns):
        texts = [
            column.head,
            *(line for row in table.rows for line in _stacked(column, row.cells[index]).plain.split("\n")),
        ]
        wide = max(map(len, texts)) + 2
        if used + wide > width and index > first:
            yield first, index
            first, used = index, names + 3
        used += wide
    yield first, len(table.columns)


def _part(table: ResultTable, first: int, last: int) -> Table:
    grid = Table(box=SIMPLE_HEAD, padding=(0, 1, 0, 0))
    grid.add_column(table.corner, no_wrap=True)
    for column in table.columns[first:last]:
        grid.add_column(column.head, justify="right", no_wrap=True)
    for index, row in enumerate(table.rows):
        if row.paper and not table.rows[index - 1].paper:
            grid.add_section()
        cells = map(_stacked, table.columns[first:last], row.cells[first:last])
        grid.add_row(Text(row.name), *cells, style="dim" if row.paper else "")
    return grid


def _stacked(column: Column, cell: Estimate) -> Text:
    interval = column.rounded.interval(cell)
    return Text.assemble(column.number(cell.value), (f"\n{interval}" if interval else "", "dim"))


def _inline(column: Column, cell: Estimate) -> str:
    return f"{column.number(cell.value)} {column.interval(cell)}".strip()


def texts(table: ResultTable) -> tuple[tuple[str, ...], tuple[tuple[str, ...], ...]]:
    """Head and rows as text, intervals in the cells: what a report or Markdown shows."""
    head = (table.corner, *(column.head for column in table.columns))
    return head, tuple((row.name, *map(_inline, table.columns, row.cells)) for row in table.rows)


def markdown(table: ResultTable) -> str:
    head, rows = texts(table)
    lines = [head, ("---", *["---:"] * len(table.columns)), *rows]
    body = "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines)
    return f"**{table.title}**\n\n{body}\n\n" + "\n\n".join(table.all_notes) + "\n"


def comma_separated(table: ResultTable) -> str:
    """Full precision, shares as fractions: value, low, high and count of every column; empty where there is none.

    Columns episodes and of tell of how many of its run's episodes an agent's row is, or column, where each is an agent.
    """
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow([table.corner, "source", *_OF, *(name for column in table.columns for name in _titles(column))])
    for row in table.rows:
        pairs = zip(table.columns, row.cells, strict=True)
        numbers = [number for column, cell in pairs for number in _numbers(column, cell)]
        source = "paper" if row.paper else "run"
        writer.writerow([row.name.removesuffix(f" {MARK}"), source, *_counts(row.counts), *numbers])
    return out.getvalue()


_OF: Final = ("episodes", "of")


def _titles(column: Column) -> list[str]:
    parts = ("", " low", " high", " n", *(f" {name}" for name in _OF if column.counts))
    return [column.title + part for part in parts]


def _numbers(column: Column, cell: Estimate) -> list[str]:
    found = [_plain(n) for n in (cell.value, cell.low, cell.high, cell.count or np.nan)]
    return found + (_counts(column.counts) if column.counts else [])


def _counts(counts: tuple[int, int] | None) -> list[str]:
    finished, total = counts or ("", "")
    return [str(finished), str(total or "")]


def _plain(value: float) -> str:
    return f"{value:.6g}" if np.isfinite(value) else ""


def plain(table: ResultTable) -> dict[str, Any]:
    """Return a table for JSON: full precision, shares as fractions, None where there is no number."""
    rows = [
        {
            table.corner: row.name.removesuffix(f" {MARK}"), "source": "paper" if row.paper else "run",
            **{column.title: _known(cell) for column, cell in zip(table.columns, row.cells, strict=True)},
        }
        for row in table.rows
    ]  # fmt: skip
    return {"title": table.title, "rows": rows, "notes": list(table.all_notes)}


def _known(cell: Estimate) -> dict[str, float | None]:
    numbers = {"value": cell.value, "low": cell.low, "high": cell.high, "n": cell.count or None}
    return {key: None if number is None or not np.isfinite(number) else number for key, number in numbers.items()}


def plain_differences(differences: Mapping[str, Difference], metrics: Sequence[Metric]) -> list[dict[str, Any]]:
    """Return a comparison for JSON, a metric a row: both values, B - A with its interval, p and the verdict."""
    found = [(metric, differences[metric.name]) for metric in metrics if metric.name in differences]
    return [
        {
            "metric": metric.name, "a": one.a, "b": one.b, "difference": _known(Estimate(one.value, one.low, one.high)),
            "p": one.p, "verdict": verdict(Column.of(metric), one), "n": one.count,
        }
        for metric, one in found
    ]  # fmt: skip


_TEX: Final = str.maketrans(
    {"&": r"\&", "%": r"\%", "#": r"\#", "_": r"\_", "$": r"\$", "{": r"\{", "}": r"\}", "~": r"\textasciitilde{}",
     "^": r"\textasciicircum{}", "\\": r"\textbackslash{}", "\u2191": r"$\uparrow$", "\u2193": r"$\downarrow$",
     MARK: r"$^\dagger$", "\u2013": "--"}
)  # fmt: skip


def latex(table: ResultTable) -> str:
    """Return a tabular for booktabs; the notes follow as comments."""
    head, rows = table.columns, []
    for index, row in enumerate(table.rows):
        rule = "\\midrule\n" if row.paper and index and not table.rows[index - 1].paper else ""
        rows.append(rule + " & ".join([row.name.translate(_TEX), *map(_tex, head, row.cells)]) + r" \\")
    titles = " & ".join([table.corner, *(column.head.translate(_TEX) for column in head)])
    lines = [f"% {table.title}", rf"\begin{{tabular}}{{l{'r' * len(head)}}}", r"\toprule", titles + r" \\", r"\midrule"]
    return (
        "\n".join([*lines, *rows, r"\bottomrule", r"\end{tabular}", *(f"% {note}" for note in table.all_notes)]) + "\n"
    )


def _tex(column: Column, cell: Estimate) -> str:
    interval = column.interval(cell)
    return column.number(cell.value).translate(_TEX) + (rf" {{\scriptsize {interval}}}" if interval else "")


WRITERS: Final[Mapping[str, Callable[[ResultTable], str]]] = {
    "markdown": markdown, "csv": comma_separated, "latex": latex,
}  # fmt: skip
"""What writes a table as text, by format."""


# -- two runs ----------------------------------------------------------------------------------------------------------
def compare_table(differences: Mapping[str, Difference], metrics: Sequence[Metric], a: str, b: str) -> Table:
    """Metric by metric: both values, the difference with its interval, p, and whether it is more than noise."""
    caption = (
        f"{bearing(differences, metrics)} p: of swapping the runs house by house, exactly for rates (with an episode a "
        "house McNemar's test), at random for the rest; raised (Holm) for the three success rates and for the other "
        f"metrics. Noise: p of {SIGNIFICANT} or more, and an interval that holds 0 and leaves no room for "
        f"{100 * TELLING:.0f} points (but for shares, {TELLING:.0%} of the level of both) either way. Too few to tell: "
        "p as large and another interval, or no difference whatever could have had less. The same: no episode differs."
    )
    grid = Table(
        title=f"A: {a}\nB: {b}", title_justify="left", caption=caption, caption_justify="left", box=SIMPLE_HEAD,
        padding=(0, 1, 0, 0), show_edge=False, pad_edge=False,
    )  # fmt: skip
    for title in ("metric", "A", "B", "B \u2212 A", "p", ""):
        grid.add_column(title, justify="left" if title in ("metric", "") else "right", no_wrap=True)
    for metric in metrics:
        if metric.name in differences:
            cells = compared(Column.of(metric), differences[metric.name])
            grid.add_row(*(cell.replace(" [", "\n[") for cell in cells))  # An interval has a line of its own.
    return grid


def bearing(differences: Mapping[str, Difference], metrics: Sequence[Metric]) -> str:
    """Say over how many episodes two runs are compared, and which metrics fewer of them bear on."""
    count = max((found.count for found in differences.values()), default=0)
    fewer: dict[int, list[str]] = {}
    for metric in metrics:
        if metric.name in differences and differences[metric.name].count < count:
            fewer.setdefault(differences[metric.name].count, []).append(metric.name)
    told = ", ".join(f"{', '.join(names)} ({number})" for number, names in fewer.items())
    return f"Over the {counted(count, 'episode')} that both finished." + (f" Fewer bear on {told}." if told else "")


def compared(column: Column, found: Difference) -> tuple[str, ...]:
    """Return a row of the comparison: metric, both values, the difference with its interval, p, and a verdict."""
    change = Estimate(found.value, found.low, found.high, found.count)
    sign = "+" if found.value > 0 else ""
    values = (column.number(found.a), column.number(found.b), f"{sign}{_inline(column, change)}")
    p = "< 0.001" if found.p < 0.0005 else f"{found.p:.3f}"
    return (column.head, *values, p, verdict(column, found))


def verdict(column: Column, found: Difference) -> str:
    """Say the difference in words: which run is better (higher, where neither is good in itself), noise, too few to
    tell, or the same."""
    if not found.significant:
        # The interval of a rate keeps a width where no episode differs, and tells what these leave open.
        same = found.alike and not found.high > found.low
        return "the same" if same else "too few to tell" if _blunt(column, found) else "noise"
    higher = "B" if found.value > 0 else "A"
    other = "A" if higher == "B" else "B"
    return {"higher": f"{higher} is better", "lower": f"{other} is better"}.get(column.better, f"{higher} is higher")


def _blunt(column: Column, found: Difference) -> bool:
    """Whether so few houses could not have shown a difference, or have not shown that there is none worth the name."""
    room = TELLING * (1.0 if column.percent else found.level)
    return found.least >= SIGNIFICANT or not -room <= found.low <= 0.0 <= found.high <= room


# -- the paper's numbers -----------------------------------------------------------------------------------------------
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
