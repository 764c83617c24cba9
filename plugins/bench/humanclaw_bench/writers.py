"""Write tables and comparisons: on the terminal, as Markdown, JSON and LaTeX."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, Final

import numpy as np
from rich.box import SIMPLE_HEAD
from rich.console import Group
from rich.table import Table
from rich.text import Text

from humanclaw.cli import counted
from humanclaw_bench.metrics import Column, Metric
from humanclaw_bench.results import MARK
from humanclaw_bench.statistics import SIGNIFICANT, Difference, Estimate
from humanclaw_bench.tables import RANKS, TELLING, ResultTable, Row, inline


def terminal(table: ResultTable, width: int = 80, *, notes: bool = True) -> Group:
    """Return a table for rich, split into parts that fit the width; intervals stand below their value."""
    parts = [_part(table, first, last, width // 2) for first, last in _cuts(table, width)]
    below = (Text(note, style="dim") for note in (table.all_notes if notes else ()))
    return Group(Text(table.title, style="bold"), *parts, *below, "")


def _cuts(table: ResultTable, width: int) -> Iterator[tuple[int, int]]:
    """Yield ranges of columns that fit side by side, at least one in each. A name takes half the width at most."""
    names = min(width // 2, max(len(text) for text in (table.corner, *(row.name for row in table.rows))))
    first, used = 0, names + 3
    for index, column in enumerate(table.columns):
        texts = [
            column.head,
            *(line for row in table.rows for line in _stacked(column, *_cell(row, index)).plain.split("\n")),
        ]
        wide = max(map(len, texts)) + 2
        if used + wide > width and index > first:
            yield first, index
            first, used = index, names + 3
        used += wide
    yield first, len(table.columns)


def _part(table: ResultTable, first: int, last: int, names: int) -> Table:
    grid = Table(box=SIMPLE_HEAD, padding=(0, 1, 0, 0))
    grid.add_column(table.corner, overflow="fold", max_width=names)
    for column in table.columns[first:last]:
        grid.add_column(column.head, justify="right", no_wrap=True)
    for index, row in enumerate(table.rows):
        if row.paper and not table.rows[index - 1].paper:
            grid.add_section()
        cells = (_stacked(table.columns[index], *_cell(row, index)) for index in range(first, last))
        grid.add_row(Text(row.name), *cells, style="dim" if row.paper else "")
    return grid


def _cell(row: Row, index: int) -> tuple[Estimate, int]:
    """Return a value and its rank."""
    return row.cells[index], row.ranks[index] if row.ranks else 0


def _stacked(column: Column, cell: Estimate, rank: int = 0) -> Text:
    interval = column.rounded.interval(cell)
    return Text.assemble(f"{column.number(cell.value)}{RANKS[rank]}", (f"\n{interval}" if interval else "", "dim"))


def texts(table: ResultTable) -> tuple[tuple[str, ...], tuple[tuple[str, ...], ...]]:
    """Return head and rows as text, with intervals in the cells, for reports and Markdown."""
    head = (table.corner, *(column.head for column in table.columns))
    return head, tuple(
        (row.name, *(inline(column, *_cell(row, index)) for index, column in enumerate(table.columns)))
        for row in table.rows
    )


def markdown(table: ResultTable) -> str:
    head, rows = texts(table)
    lines = [head, ("---", *["---:"] * len(table.columns)), *rows]
    body = "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines)
    return f"**{table.title}**\n\n{body}\n\n" + "\n\n".join(table.all_notes) + "\n"


def plain(table: ResultTable) -> dict[str, Any]:
    """Return a table for JSON: full precision, shares as fractions, None if missing."""
    rows = [
        {
            table.corner: row.name.removesuffix(f" {MARK}"), "source": "paper" if row.paper else "run",
            **{column.name: _known(cell) for column, cell in zip(table.columns, row.cells, strict=True)},
        }
        for row in table.rows
    ]  # fmt: skip
    return {"title": table.title, "rows": rows, "notes": list(table.all_notes)}


def _known(cell: Estimate) -> dict[str, float | None]:
    numbers = {"value": cell.value, "low": cell.low, "high": cell.high, "n": cell.count or None}
    return {key: None if number is None or not np.isfinite(number) else number for key, number in numbers.items()}


def plain_differences(differences: Mapping[str, Difference], metrics: Sequence[Metric]) -> list[dict[str, Any]]:
    """Return a comparison for JSON, one row for each metric: both values, B - A with its interval, p, verdict."""
    pairs = [(metric, differences[metric.name]) for metric in metrics if metric.name in differences]
    return [
        {
            "metric": metric.name, "a": difference.a, "b": difference.b,
            "difference": _known(Estimate(difference.value, difference.low, difference.high)), "p": difference.p,
            "verdict": verdict(metric, difference), "n": difference.count,
        }
        for metric, difference in pairs
    ]  # fmt: skip


_TEX: Final = str.maketrans(
    {"&": r"\&", "%": r"\%", "#": r"\#", "_": r"\_", "$": r"\$", "{": r"\{", "}": r"\}", "~": r"\textasciitilde{}",
     "^": r"\textasciicircum{}", "\\": r"\textbackslash{}", "\u2191": r"$\uparrow$", "\u2193": r"$\downarrow$",
     MARK: r"$^\dagger$", "\u2013": "--"}
)  # fmt: skip


_FITTED: Final = r"\noindent\resizebox{\ifdim\width>\textwidth\textwidth\else\width\fi}{!}{%"


def latex(table: ResultTable) -> str:
    """Return a LaTeX tabular (packages booktabs and graphicx), no wider than the text; notes follow as comments."""
    head, rows = table.columns, []
    for index, row in enumerate(table.rows):
        rule = "\\midrule\n" if row.paper and index and not table.rows[index - 1].paper else ""
        cells = (_tex(column, *_cell(row, place)) for place, column in enumerate(head))
        rows.append(rule + " & ".join([row.name.translate(_TEX), *cells]) + r" \\")
    titles = " & ".join([table.corner, *(column.head.translate(_TEX) for column in head)])
    lines = [f"% {table.title}", _FITTED, rf"\begin{{tabular}}{{l{'r' * len(head)}}}", r"\toprule", titles + r" \\"]
    notes = (f"% {note}" for note in table.all_notes)
    return "\n".join([*lines, r"\midrule", *rows, r"\bottomrule", r"\end{tabular}}", *notes]) + "\n"


def _tex(column: Column, cell: Estimate, rank: int = 0) -> str:
    """Write a cell, the best in bold and the second best underlined."""
    interval, number = column.interval(cell), column.number(cell.value).translate(_TEX)
    marked = {1: rf"\textbf{{{number}}}", 2: rf"\underline{{{number}}}"}.get(rank, number)
    return marked + (rf" {{\scriptsize {interval}}}" if interval else "")


WRITERS: Final[Mapping[str, Callable[[ResultTable], str]]] = {"markdown": markdown, "latex": latex}
"""Functions that write a table as text, by format."""


# -- two runs ----------------------------------------------------------------------------------------------------------
CORRECTED: Final = (
    "corrected (Holm) for FindSR, ArriveSR and InteractSR, and separately for the other metrics, which are more: equal "
    "data can have a larger p there."
)


def compare_table(differences: Mapping[str, Difference], metrics: Sequence[Metric], a: str, b: str) -> Table:
    """Return a table: for each metric both values, the difference with its interval, p, and a verdict."""
    caption = (
        f"{bearing(differences, metrics)} p: the runs are swapped house by house, exactly for rates (McNemar's test if "
        f"each house has one episode), at random for the rest; {CORRECTED} Noise: p is {SIGNIFICANT} or more, and the "
        f"interval contains 0 and excludes {100 * TELLING:.0f} points (if not a share, {TELLING:.0%} of the mean of "
        "both) either way. Too few to tell: p is as large, and the interval contains 0 and is wider, or this test "
        f"cannot give less than {SIGNIFICANT}. "
        "Not significant: p is as large although the interval excludes 0. "
        "The same: no episode differs."
    )
    grid = Table(
        title=f"A: {a}\nB: {b}", title_justify="left", caption=caption, caption_justify="left", box=SIMPLE_HEAD,
        padding=(0, 1, 0, 0), show_edge=False, pad_edge=False,
    )  # fmt: skip
    for title in ("metric", "A", "B", "B \u2212 A", "p", ""):
        grid.add_column(title, justify="left" if title in ("metric", "") else "right", no_wrap=True)
    for metric in metrics:
        if metric.name in differences:
            cells = compared(metric, differences[metric.name])
            grid.add_row(*(cell.replace(" [", "\n[") for cell in cells))  # Intervals below their value save width.
    return grid


def bearing(differences: Mapping[str, Difference], metrics: Sequence[Metric]) -> str:
    """Return a sentence on the number of compared episodes, and on the metrics that cover fewer."""
    count = max((difference.count for difference in differences.values()), default=0)
    fewer: dict[int, list[str]] = {}
    for metric in metrics:
        if metric.name in differences and differences[metric.name].count < count:
            fewer.setdefault(differences[metric.name].count, []).append(metric.name)
    partly = ", ".join(f"{', '.join(names)} ({number})" for number, names in fewer.items())
    return f"Over the {counted(count, 'episode')} that both finished." + (
        f" Fewer count for {partly}." if partly else ""
    )


def compared(column: Column, difference: Difference) -> tuple[str, ...]:
    """Return a row of the comparison: metric, both values, the difference with its interval, p, and a verdict."""
    change = Estimate(difference.value, difference.low, difference.high, difference.count)
    sign = "+" if difference.value > 0 else ""
    values = (column.number(difference.a), column.number(difference.b), f"{sign}{inline(column, change)}")
    # Three digits would say 0.000.
    p = "< 0.001" if difference.p < 0.0005 else f"{difference.p:.3f}"
    return (column.head, *values, p, verdict(column, difference))


def verdict(column: Column, difference: Difference) -> str:
    """Return the difference in words: the better run, not significant, noise, too few to tell, or the same.

    If neither direction is better, it names the run with the higher value.
    """
    if not difference.significant:
        # A rate has an interval even if no episode differs: a larger split could still show a difference.
        same = difference.alike and not difference.high > difference.low
        if difference.low > 0 or difference.high < 0:
            return "not significant"
        return "the same" if same else "too few to tell" if _blunt(column, difference) else "noise"
    higher = "B" if difference.value > 0 else "A"
    other = "A" if higher == "B" else "B"
    return {"higher": f"{higher} is better", "lower": f"{other} is better"}.get(column.better, f"{higher} is higher")


def _blunt(column: Column, difference: Difference) -> bool:
    """Return whether there are too few houses to show a difference, or to exclude a relevant one."""
    room = TELLING * (1.0 if column.percent else difference.level)
    return difference.least >= SIGNIFICANT or not -room <= difference.low <= 0.0 <= difference.high <= room
