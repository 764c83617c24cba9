"""Tables, desks, nightstands and consoles."""

from __future__ import annotations

from humanclaw_houses.furniture.hinged_parts import BOARD, carcass, drawer
from humanclaw_houses.piece_builder import PieceBuilder, maker
from humanclaw_houses.shapes import box, post, soft_box, turned
from humanclaw_houses.style import Style
from humanclaw_houses.textures import Texture


def _table(
    m: PieceBuilder, style: Style, size: tuple[float, float, float], texture: Texture, thick: float = 0.035
) -> None:
    w, h, d = size
    leg = 0.055 if h > 0.6 else 0.045
    m.box((w, thick, d), (0, h - thick, 0), texture)
    m.add(box((w - 0.1, 0.06, d - 0.1), (0, h - thick - 0.06, 0)), texture)
    for x in (-1, 1):
        for z in (-1, 1):
            at = x * (w / 2 - leg / 2 - 0.02), 0, z * (d / 2 - leg / 2 - 0.02)
            m.box((leg, h - thick, leg), at, texture, skip="t")
    m.surface(w, d, h)


@maker("table")
def dining_table(m: PieceBuilder, style: Style, seats: int = 4) -> None:
    """Return a table for two, four, six or eight; tables for four are sometimes round."""
    texture = style.choice(style.wood, style.wood, style.second_wood)
    if seats == 4 and style.chance(0.3):
        r = style.between(0.52, 0.58)
        m.add(post(r, 0.035, (0, 0.715, 0), segments=24), texture, "hull")
        m.add(turned([(0.26, 0), (0.25, 0.03), (0.06, 0.08), (0.05, 0.6), (0.12, 0.715)]), texture)
        m.solid((0.36, 0.05, 0.36), (0, 0, 0))
        m.solid((0.12, 0.66, 0.12), (0, 0.05, 0))
        m.surface(1.3 * r, 1.3 * r, 0.75)
    else:
        lengths = {2: style.between(0.75, 0.85), 4: style.between(1.2, 1.35), 6: style.between(1.6, 1.8)}
        w = style.between(2.2, 2.4) if seats == 8 else lengths[seats]
        _table(m, style, (w, 0.75, style.between(0.78, 0.9)), texture)


@maker("coffee_table")
def coffee_table(m: PieceBuilder, style: Style) -> None:
    texture = style.choice(style.wood, style.second_wood, style.white)
    w, h, d = style.between(0.85, 1.15), style.between(0.38, 0.44), style.between(0.48, 0.58)
    if style.chance(0.35):
        m.add(post(0.38, 0.03, (0, h - 0.03, 0), segments=20), texture, "hull")
        for x, z in ((-0.22, -0.22), (0.22, -0.22), (-0.22, 0.22), (0.22, 0.22)):
            m.box((0.035, h - 0.03, 0.035), (x, 0, z), style.black)
        m.surface(0.5, 0.5, h)
    else:
        _table(m, style, (w, h, d), texture)
        m.box((w - 0.12, 0.02, d - 0.12), (0, 0.14, 0), texture)


@maker("side_table")
def side_table(m: PieceBuilder, style: Style) -> None:
    h = style.between(0.48, 0.55)
    m.add(post(0.22, 0.025, (0, h - 0.025, 0), segments=18), style.wood, "hull")
    m.add(post(0.02, h - 0.03, (0, 0.01, 0)), style.black)
    m.add(post(0.15, 0.015, segments=16), style.black)
    m.solid((0.2, 0.02, 0.2), (0, 0, 0))
    m.solid((0.04, h - 0.05, 0.04), (0, 0.02, 0))
    m.surface(0.3, 0.3, h)


@maker("nightstand")
def nightstand(m: PieceBuilder, style: Style) -> None:
    """Return a small chest of two drawers beside a bed."""
    _chest(m, style, (style.between(0.4, 0.48), style.between(0.48, 0.56), 0.38), 2)


@maker("dresser")
def dresser(m: PieceBuilder, style: Style) -> None:
    """Return a chest of four drawers."""
    _chest(m, style, (style.between(0.85, 1.2), style.between(0.8, 0.95), 0.45), 4)


def _chest(m: PieceBuilder, style: Style, size: tuple[float, float, float], rows: int) -> None:
    (w, h, d), plinth = size, 0.06
    texture = style.choice(style.wood, style.second_wood, style.white)
    m.box((w - 0.04, plinth, d - 0.06), (0, 0, -0.02), style.black)
    carcass(m, (w, h - plinth, d - 0.02), (0, plinth, -0.01), texture)
    each = (h - plinth - 2 * BOARD) / rows
    for k in range(rows):
        drawer(m, (w - 2 * BOARD, each, d - 0.03), (0, plinth + BOARD + k * each, 0.015), texture, style.steel)
    m.surface(w, d - 0.04, h)


@maker("desk")
def desk(m: PieceBuilder, style: Style) -> None:
    """Return a desk with drawers at its +X end; the place to sit is at x = -0.19."""
    w, d, h = style.between(1.15, 1.4), style.between(0.58, 0.66), 0.74
    texture = style.choice(style.wood, style.second_wood, style.white)
    m.box((w, 0.03, d), (0, h - 0.03, 0), texture)
    side = 1
    m.box((0.4, h - 0.09, d - 0.06), (side * (w / 2 - 0.22), 0.06, 0), texture)
    for k in range(3):
        m.add(box((0.37, 0.19, 0.015), (side * (w / 2 - 0.22), 0.07 + 0.205 * k, d / 2 - 0.025)), texture)
        m.add(box((0.12, 0.012, 0.02), (side * (w / 2 - 0.22), 0.16 + 0.205 * k, d / 2 - 0.012)), style.steel)
    for z in (-1, 1):
        m.box((0.045, h - 0.03, 0.045), (-side * (w / 2 - 0.04), 0, z * (d / 2 - 0.04)), texture)
    m.surface(w, d, h)


@maker("console_table")
def console(m: PieceBuilder, style: Style) -> None:
    """Return a narrow table for a hall."""
    _table(m, style, (style.between(0.7, 1.0), 0.8, 0.28), style.wood, 0.03)


@maker("tv_stand")
def tv_stand(m: PieceBuilder, style: Style, width: float) -> None:
    """Return a low board on legs. It is open below for the feet of a body that steps up to the screen."""
    d, h, gap = 0.36, style.between(0.44, 0.52), 0.16
    texture = style.choice(style.wood, style.second_wood, style.white, style.black)
    m.box((width, h - gap, d - 0.02), (0, gap, -0.01), texture)
    for end in (-1, 1):
        for z in (-1, 1):
            m.box((0.04, gap, 0.04), (end * (width / 2 - 0.08), 0, z * (d / 2 - 0.06)), style.black, skip="t")
    parts = 3
    for k in range(parts):
        x, wide = (k - (parts - 1) / 2) * (width - 0.02) / parts, (width - 0.02) / parts
        front = style.black if k == 1 else texture
        m.add(box((wide - 0.012, h - gap - 0.04, 0.016), (x, gap + 0.02, d / 2 - 0.012), "k"), front)
        if k != 1:
            m.add(box((0.016, 0.09, 0.018), (x + wide * 0.3 * (1 - k), gap + 0.1, d / 2 + 0.004)), style.steel)
    m.surface(width, d - 0.04, h)


@maker("pouffe", mass=3.0, friction=0.6)
def cushion_block(m: PieceBuilder, style: Style) -> None:
    """Return a pouffe."""
    m.add(soft_box((0.48, 0.36, 0.48), (0, 0, 0), 0.08, 0.02), style.second_cloth)
    m.solid((0.46, 0.36, 0.46), (0, 0, 0))
