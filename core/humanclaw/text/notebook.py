"""How a body, an episode, a record and a run show themselves in a notebook: a few pictures or rows over a few words."""

from __future__ import annotations

import base64
from collections.abc import Iterable, Sequence
from html import escape
from typing import Final

SHOWN: Final = 8
"""Pictures of a strip at most."""
ROWS: Final = 20
"""Of a table at most."""


def spread(count: int, wanted: int = SHOWN) -> list[int]:
    """At most so many of 0..count-1, evenly, first and last among them."""
    if count <= wanted:
        return list(range(count))
    return sorted({round(k * (count - 1) / (wanted - 1)) for k in range(wanted)})


def card(title: str, lines: Iterable[str], pictures: Sequence[tuple[str, bytes]] = ()) -> str:
    """HTML that needs nothing from outside. pictures: what each is called, and its JPEG."""
    side = 320 if len(pictures) == 1 else 120
    shown = "".join(
        f'<figure style="margin:0"><img src="data:image/jpeg;base64,{base64.b64encode(data).decode()}" width="{side}" '
        f'height="{side}" alt="{escape(name)}"><figcaption>{escape(name)}</figcaption></figure>'
        for name, data in pictures
    )
    told = "".join(f"<div>{escape(line)}</div>" for line in lines if line)
    strip = f'<div style="display:flex;flex-wrap:wrap;gap:6px;margin-top:6px">{shown}</div>' if shown else ""
    return f"<div><strong>{escape(title)}</strong>{told}{strip}</div>"


def table(title: str, head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """HTML of the first rows, which says how many more there are."""
    lines = [_row("th", head), *(_row("td", row) for row in rows[:ROWS])]
    more = f"<div>and {len(rows) - ROWS} more</div>" if len(rows) > ROWS else ""
    return f"<div><strong>{escape(title)}</strong><table>{''.join(lines)}</table>{more}</div>"


def _row(tag: str, cells: Sequence[str]) -> str:
    shown = "".join(f'<{tag} style="text-align:left">{escape(cell)}</{tag}>' for cell in cells)
    return f"<tr>{shown}</tr>"
