"""Televisions and laptops."""

from __future__ import annotations

from humanclaw_houses import textures as t
from humanclaw_houses.piece_builder import PieceBuilder, maker
from humanclaw_houses.shapes import Shape, box, sheet
from humanclaw_houses.style import Style


def _panel(m: PieceBuilder, style: Style, width: float, y: float, z: float) -> float:
    """Add a flat screen of 16:9 with its bottom at y and its front at z; return its height."""
    height = round(0.5625 * width, 3)
    m.add(box((width, height, 0.045), (0, y, z - 0.0225)), style.black, "box")
    m.add(box((width * 0.55, height * 0.5, 0.03), (0, y + 0.06, z - 0.06)), style.black)
    glass = sheet((-width / 2 + 0.03, y + 0.048, z + 0.002), (width - 0.06, 0, 0), (0, height - 0.078, 0))
    m.add(Shape((glass,)), t.screen(style.rng, on=True))
    m.add(box((0.07, 0.008, 0.004), (0, y + 0.01, z)), style.steel)
    return height


@maker("tv")
def tv(m: PieceBuilder, style: Style, width: float = 1.1) -> None:
    """Return a television on its own foot."""
    _panel(m, style, width, 0.075, 0.06)
    m.add(box((0.09, 0.1, 0.03), (0, 0.012, 0.02)), style.black)
    m.box((width * 0.42, 0.014, 0.2), (0, 0, 0.02), style.black)


@maker("tv")
def wall_tv(m: PieceBuilder, style: Style, width: float = 1.1) -> None:
    """Return a television on a wall bracket."""
    _panel(m, style, width, 0.0, 0.09)
    m.box((0.3, 0.2, 0.06), (0, 0.15, 0.03), style.black, solid=False)


@maker("tv")
def floor_tv(m: PieceBuilder, style: Style, width: float = 1.1) -> None:
    """Return a television on a low cabinet of its own, for a bedroom."""
    high = 0.5
    m.box((width - 0.02, high - 0.1, 0.45), (0, 0.1, -0.03), style.wood)
    for x in (-1, 1):
        for z in (-1, 1):
            m.add(box((0.04, 0.1, 0.04), (x * (width / 2 - 0.06), 0, z * 0.18 - 0.03), "tb"), style.black)
        m.add(box((width / 2 - 0.03, high - 0.14, 0.016), (x * width / 4, 0.12, 0.198), "k"), style.wood)
        m.add(box((0.1, 0.012, 0.012), (x * width / 4, high - 0.1, 0.208), "k"), style.steel)
    m.add(box((width, 0.02, 0.48), (0, high, -0.03)), style.wood)
    m.add(box((width * 0.42, 0.014, 0.2), (0, high + 0.02, 0.0)), style.black)
    m.add(box((0.09, 0.08, 0.03), (0, high + 0.03, 0.0)), style.black)
    _panel(m, style, width, high + 0.08, 0.06)


@maker("laptop", mass=1.6, friction=0.5)
def laptop(m: PieceBuilder, style: Style) -> None:
    m.box((0.33, 0.018, 0.23), (0, 0, 0), style.steel, solid=False)
    m.add(Shape((sheet((-0.145, 0.0185, 0.02), (0.29, 0, 0), (0, 0, -0.11)),)), style.black)
    lid = box((0.33, 0.22, 0.01), (0, 0, 0)) + Shape((sheet((-0.15, 0.015, 0.006), (0.3, 0, 0), (0, 0.19, 0)),))
    m.add(Shape(lid.charts[:6]).moved((0, 0.014, -0.115), (-18, 0, 0)), style.steel)
    m.add(Shape(lid.charts[6:]).moved((0, 0.014, -0.115), (-18, 0, 0)), t.screen(style.rng, on=False))
    # The lid does not collide: a hull around it would move the centre of mass behind the hinge.
    m.solid((0.33, 0.018, 0.29), (0, 0, -0.03))
