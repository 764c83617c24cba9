"""HTML for notebooks: cards of bodies, episodes and records, tables of runs."""

from __future__ import annotations

import base64
from collections.abc import Iterable, Sequence
from html import escape
from typing import Final

SHOWN: Final = 8
"""Maximum pictures of a strip."""
ROWS: Final = 20
"""Maximum rows of a table."""


def spread(count: int, wanted: int = SHOWN) -> list[int]:
    """Return at most `wanted` indices of 0..count-1, evenly spaced, with first and last."""
    if count <= wanted:
        return list(range(count))
    return sorted({round(k * (count - 1) / (wanted - 1)) for k in range(wanted)})


def card(title: str, lines: Iterable[str], pictures: Sequence[tuple[str, bytes]] = ()) -> str:
    """Return self-contained HTML. pictures: caption and JPEG of each."""
    side = 320 if len(pictures) == 1 else 120
    shown = "".join(
        f'<figure style="margin:0"><img src="data:image/jpeg;base64,{base64.b64encode(data).decode()}" width="{side}" '
        f'height="{side}" alt="{escape(name)}"><figcaption>{escape(name)}</figcaption></figure>'
        for name, data in pictures
    )
    body = "".join(f"<div>{escape(line)}</div>" for line in lines if line)
    strip = f'<div style="display:flex;flex-wrap:wrap;gap:6px;margin-top:6px">{shown}</div>' if shown else ""
    return f"<div><strong>{escape(title)}</strong>{body}{strip}</div>"


def table(title: str, head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return HTML of the first rows and the number of further ones."""
    lines = [_row("th", head), *(_row("td", row) for row in rows[:ROWS])]
    more = f"<div>and {len(rows) - ROWS} more</div>" if len(rows) > ROWS else ""
    return f"<div><strong>{escape(title)}</strong><table>{''.join(lines)}</table>{more}</div>"


def _row(tag: str, cells: Sequence[str]) -> str:
    shown = "".join(f'<{tag} style="text-align:left">{escape(cell)}</{tag}>' for cell in cells)
    return f"<tr>{shown}</tr>"
