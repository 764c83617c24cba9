"""Print Markdown in the width of the terminal."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from itertools import groupby
from typing import Final

from rich import box
from rich.table import Table
from rich.text import Text

from humanclaw.cli.terminal import Console

_BETWEEN: Final = re.compile(r"\s*(?<!\\)\|\s*")
_WIDEST: Final = 30
"""Maximum characters of a column in a narrow terminal; longer cells wrap."""


def show_markdown(text: str) -> None:
    """Print Markdown in the width of the terminal; in a pipe 80 characters, or COLUMNS.

    A wider table is split into parts, each with the first column. Everything else is printed as it is.
    """
    console = Console(highlight=False)
    for inside, group in groupby(text.splitlines(), lambda line: line.startswith("|")):
        lines = list(group)
        if inside and max(map(len, lines)) > console.width:
            for part in _parts([_BETWEEN.split(line)[1:-1] for line in lines], console.width):
                console.print(part)
        else:
            console.print(Text("\n".join(lines)))


def _parts(rows: Sequence[Sequence[str]], width: int) -> Iterator[Table]:
    """Yield a table in parts. rows: header, rule, then the body."""
    columns = list(zip(rows[0], *rows[2:], strict=True))
    wide = [min(_WIDEST, max(map(len, column))) + 3 for column in columns]
    chosen, used = [0], wide[0] + 1
    for index in range(1, len(columns)):
        if used + wide[index] > width and len(chosen) > 1:
            yield _part([columns[k] for k in chosen])
            chosen, used = [0], wide[0] + 1
        chosen.append(index)
        used += wide[index]
    yield _part([columns[k] for k in chosen])


def _part(columns: Sequence[Sequence[str]]) -> Table:
    grid = Table(box=box.MARKDOWN)
    for column in columns:
        grid.add_column(Text(column[0]))
    for row in zip(*(column[1:] for column in columns), strict=True):
        grid.add_row(*map(Text, row))
    return grid
