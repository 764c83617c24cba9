"""Write tables: on the terminal, as Markdown, JSON and LaTeX."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, Final

import numpy as np
from rich.box import SIMPLE_HEAD
from rich.console import Group
from rich.table import Table
from rich.text import Text

from humanclaw_bench.comparison import verdict
from humanclaw_bench.metrics import Column, Metric
from humanclaw_bench.results import MARK
from humanclaw_bench.statistics import Difference, Estimate
from humanclaw_bench.tables import ResultTable, inline


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
            *(line for row in table.rows for line in _stacked(column, row.cells[index]).plain.split("\n")),
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
        cells = map(_stacked, table.columns[first:last], row.cells[first:last])
        grid.add_row(Text(row.name), *cells, style="dim" if row.paper else "")
    return grid


def _stacked(column: Column, cell: Estimate) -> Text:
    interval = column.rounded.interval(cell)
    return Text.assemble(column.number(cell.value), (f"\n{interval}" if interval else "", "dim"))


def texts(table: ResultTable) -> tuple[tuple[str, ...], tuple[tuple[str, ...], ...]]:
    """Return head and rows as text, with intervals in the cells, for reports and Markdown."""
    head = (table.corner, *(column.head for column in table.columns))
    return head, tuple((row.name, *map(inline, table.columns, row.cells)) for row in table.rows)


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
    found = [(metric, differences[metric.name]) for metric in metrics if metric.name in differences]
    return [
        {
            "metric": metric.name, "a": one.a, "b": one.b, "difference": _known(Estimate(one.value, one.low, one.high)),
            "p": one.p, "verdict": verdict(metric, one), "n": one.count,
        }
        for metric, one in found
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
        cells = map(_tex, head, row.cells)
        rows.append(rule + " & ".join([row.name.translate(_TEX), *cells]) + r" \\")
    titles = " & ".join([table.corner, *(column.head.translate(_TEX) for column in head)])
    lines = [f"% {table.title}", _FITTED, rf"\begin{{tabular}}{{l{'r' * len(head)}}}", r"\toprule", titles + r" \\"]
    notes = (f"% {note}" for note in table.all_notes)
    return "\n".join([*lines, r"\midrule", *rows, r"\bottomrule", r"\end{tabular}}", *notes]) + "\n"


def _tex(column: Column, cell: Estimate) -> str:
    interval = column.interval(cell)
    return column.number(cell.value).translate(_TEX) + (rf" {{\scriptsize {interval}}}" if interval else "")


WRITERS: Final[Mapping[str, Callable[[ResultTable], str]]] = {"markdown": markdown, "latex": latex}
"""Functions that write a table as text, by format."""
