"""Draw docs/images/architecture.svg from the import graph: `python docs/_architecture.py` (or `make architecture`).

The rows are the layers that lint-imports enforces, the boxes the packages of the core with the first sentence of their
docstrings, the arrows their imports. An arrow that follows from two others is left out. A test draws the picture again
and compares it, so it cannot drift from the code.
"""

from __future__ import annotations

import ast
import tomllib
from html import escape
from pathlib import Path

import grimp

ROOT = Path(__file__).parents[1]
PICTURE = ROOT / "docs" / "images" / "architecture.svg"
WIDTH, HEIGHT, GAP, LEFT, BOX = 980, 58, 30, 56, 420
"""Pixels: of the picture, of a box, between rows, at the sides, and of a box that has a row to share."""
LEFT_OUT = ("__main__", "doors")
"""Modules that are no idea of their own: the entry point of `python -m`, and how a package opens its door."""
STYLE = """
  text { font-family: system-ui, sans-serif; fill: #1d2733 } .name { font-weight: 600; font-size: 16px }
  .idea { font-size: 12px; fill: #47566b } rect { fill: #f4f7fb; stroke: #7c8ca3; rx: 6 }
  path { fill: none; stroke: #9fb0c6; stroke-width: 1.4; marker-end: url(#tip) }
"""


def layers() -> list[list[str]]:
    """Return the rooms of each layer, from the top down, as the import rules list them."""
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["tool"]["importlinter"]
    rule = next(contract for contract in settings["contracts"] if contract["type"] == "layers")
    rows = [[name.strip() for name in row.split("|")] for row in rule["layers"]]
    return [kept for row in rows if (kept := [name for name in row if name not in LEFT_OUT])]


def arrows(rooms: list[str]) -> set[tuple[str, str]]:
    """Return (room, room that it imports), annotations included, without those that follow from others."""
    graph = grimp.build_graph("humanclaw")
    homes = {name: f"humanclaw.{name}" for name in rooms}
    straight = {
        (upper, lower)
        for upper in rooms
        for lower in rooms
        if upper != lower and graph.direct_import_exists(importer=homes[upper], imported=homes[lower], as_packages=True)
    }
    return {pair for pair in straight if not any(_leads(straight, pair, via) for via in rooms)}


def _leads(straight: set[tuple[str, str]], pair: tuple[str, str], via: str) -> bool:
    """Whether an arrow follows from two others by way of a room: the rows allow no circle, so one step is enough."""
    return (pair[0], via) in straight and (via, pair[1]) in straight


def idea(room: str) -> str:
    """Return the first sentence of a room's docstring."""
    base = ROOT / "core" / "humanclaw" / room
    text = (base / "__init__.py" if base.is_dir() else base.with_suffix(".py")).read_text("utf-8")
    return " ".join((ast.get_docstring(ast.parse(text)) or "").split("\n\n")[0].split())


def picture() -> str:
    """Return the SVG."""
    rows = layers()
    places = {
        name: _place(len(row), column, number) for number, row in enumerate(rows) for column, name in enumerate(row)
    }
    height = len(rows) * (HEIGHT + GAP) + GAP
    pairs = sorted(arrows(list(places)), key=lambda pair: (*(places[upper][1] for upper in pair), pair))
    lines = [_arrow(places[upper], places[lower], 6 * number) for number, (upper, lower) in enumerate(pairs)]
    boxes = [_box(name, *place) for name, place in places.items()]
    tip = '<marker id="tip" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="7" markerHeight="7" orient="auto">'
    tip += '<path d="M0 0 L8 4 L0 8 z" style="fill:#9fb0c6;stroke:none;marker-end:none"/></marker>'
    head = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height}" role="img">'
    title = "<title>The packages of humanclaw, each above all that it imports</title>"
    return "\n".join([head, title, f"<style>{STYLE}</style><defs>{tip}</defs>", *lines, *boxes, "</svg>\n"])


def _place(count: int, column: int, row: int) -> tuple[int, int, int]:
    """Left edge, top edge and width of a box."""
    width = BOX if count > 1 else WIDTH - 2 * LEFT - 160
    free = WIDTH - 2 * LEFT - count * width
    left = LEFT + column * (width + (free if count > 1 else 0)) + (free // 2 if count == 1 else 0)
    return left, GAP + row * (HEIGHT + GAP), width


def _box(name: str, left: int, top: int, width: int) -> str:
    middle = left + width // 2
    words = idea(name)
    cut = words if len(words) * 6 < width - 16 else words[: (width - 28) // 6].rsplit(" ", 1)[0].rstrip(",:;") + " ..."
    return (
        f'<rect x="{left}" y="{top}" width="{width}" height="{HEIGHT}"/>'
        f'<text class="name" text-anchor="middle" x="{middle}" y="{top + 23}">{escape(name)}</text>'
        f'<text class="idea" text-anchor="middle" x="{middle}" y="{top + 43}">{escape(cut)}</text>'
    )


def _arrow(above: tuple[int, int, int], below: tuple[int, int, int], lane: int) -> str:
    """From the lower edge of a box to the upper edge of another; past the boxes between them, on a lane at the side."""
    (x, y, width), (to_x, to_y, to_width) = above, below
    start, end = x + width // 2, to_x + to_width // 2
    if to_y - y <= HEIGHT + GAP:
        return f'<path d="M{start} {y + HEIGHT} L{end} {to_y}"/>'
    left = start + end < WIDTH
    side = lane % (LEFT - 12) + 6 if left else WIDTH - lane % (LEFT - 12) - 6
    edge, to_edge = (x, to_x) if left else (x + width, to_x + to_width)
    turn = 20 if left else -20
    return (
        f'<path d="M{edge} {y + HEIGHT - 14} H{side + turn} Q{side} {y + HEIGHT - 14} {side} {y + HEIGHT + 6} '
        f'V{to_y - 6} Q{side} {to_y + 14} {side + turn} {to_y + 14} H{to_edge}"/>'
    )


if __name__ == "__main__":
    PICTURE.write_text(picture(), "utf-8")
    print(PICTURE.relative_to(ROOT))
