"""Wardrobes, bookshelves, sideboards and open shelves."""

from __future__ import annotations

from humanclaw_houses import textures as t
from humanclaw_houses.furniture.hinged_parts import BOARD, carcass, door
from humanclaw_houses.piece_builder import PieceBuilder, maker
from humanclaw_houses.shapes import Shape, box, post, sheet, tube
from humanclaw_houses.style import Style


@maker("wardrobe")
def wardrobe(m: PieceBuilder, style: Style) -> None:
    """Return a wardrobe with two or three doors, one of three sometimes a mirror, with a shelf and a rail."""
    doors = int(style.rng.integers(2, 4))
    w, h, d, gap = doors * 0.5, style.between(1.95, 2.15), 0.58, 0.06
    texture = style.choice(style.wood, style.second_wood, style.white)
    m.box((w - 0.04, gap, d - 0.08), (0, 0, -0.02), style.black)
    carcass(m, (w, h - gap, d - BOARD), (0, gap, -BOARD / 2), texture, 1)
    panel = t.panel_door(tuple(texture.pixels.reshape(-1, 3).mean(axis=0).astype(int).tolist()), style.rng)
    mirror = t.glass(style.rng) if style.chance(0.3) else panel
    for k in range(doors):
        x, look = (k - (doors - 1) / 2) * 0.5, mirror if doors == 3 and k == 1 else panel
        door(m, (0.5, h - gap, BOARD), (x, gap, (d - BOARD) / 2), look, style.steel, k < doors - 1)
    m.add(box((w - 0.04, 0.025, 0.025), (0, h - 0.12, 0)), style.chrome)


@maker("bookshelf")
def bookshelf(m: PieceBuilder, style: Style, low: bool = False) -> None:
    """Return a bookshelf with rows of books, some gaps, and a free top."""
    w, d = style.between(0.75, 1.0), 0.3
    levels = 2 if low else 5
    h = 0.06 + 0.36 * levels
    texture = style.choice(style.wood, style.second_wood, style.white)
    m.add(box((w, h, 0.015), (0, 0, -d / 2 + 0.0075)), texture)
    for x in (-1, 1):
        m.add(box((0.025, h, d), (x * (w - 0.025) / 2, 0, 0)), texture)
    for k in range(levels + 1):
        m.add(box((w - 0.05, 0.025, d - 0.005), (0, min(0.04 + 0.36 * k, h - 0.025), 0)), texture)
    for k in range(levels):
        _row(m, style, w, 0.065 + 0.36 * k, d)
    m.solid((w, h, d), (0, 0, 0))
    m.surface(w, d, h, room=0.3)


def _row(m: PieceBuilder, style: Style, w: float, y: float, d: float) -> None:
    share = style.between(0.5, 0.98)
    side = 1 if style.chance(0.5) else -1
    length = (w - 0.06) * share
    x = side * ((w - 0.06) - length) / 2
    m.add(box((length, style.between(0.22, 0.28), d - 0.1), (x, y, -0.03), "fkb"), style.second_wood)
    row = sheet((x - length / 2, y, d / 2 - 0.08), (length, 0, 0), (0, 0.27, 0), (2, 1))
    m.add(Shape((row,)), t.books(style.rng))
    if share < 0.75:
        spare = -side * (w / 2 - 0.12)
        m.add(post(0.05, 0.14, (spare, y, 0.02), 0.03), style.paint())


@maker("sideboard")
def sideboard(m: PieceBuilder, style: Style) -> None:
    """Return a long low cupboard on legs."""
    w, h, d, gap = style.between(1.2, 1.6), style.between(0.72, 0.82), 0.42, 0.14
    texture = style.choice(style.wood, style.second_wood)
    m.box((w, h - gap, d - 0.02), (0, gap, -0.01), texture)
    for k in range(3):
        x, wide = (k - 1) * (w - 0.02) / 3, (w - 0.02) / 3
        m.add(box((wide - 0.012, h - gap - 0.04, 0.016), (x, gap + 0.02, d / 2 - 0.012), "k"), texture)
        m.add(post(0.012, 0.02).moved((x + wide * 0.35, h - 0.2, d / 2), (90, 0, 0)), style.brass)
    for x in (-1, 1):
        for z in (-1, 1):
            m.box((0.04, gap, 0.04), (x * (w / 2 - 0.1), 0, z * (d / 2 - 0.07)), style.black, skip="t")
    m.surface(w, d - 0.04, h)


@maker("shelf")
def open_shelf(m: PieceBuilder, style: Style) -> None:
    """Return a metal rack whose boards can hold objects."""
    w, d, h = style.between(0.75, 0.95), 0.36, 1.6
    for x in (-1, 1):
        for z in (-1, 1):
            m.box((0.03, h, 0.03), (x * (w - 0.03) / 2, 0, z * (d - 0.03) / 2), style.black)
    for k in range(4):
        y = 0.12 + 0.48 * k
        m.box((w, 0.025, d), (0, y, 0), style.wood)
        m.surface(w - 0.1, d - 0.06, y + 0.025, room=0.42)


@maker("wall_shelf")
def wall_shelf(m: PieceBuilder, style: Style) -> None:
    """Return a board on brackets with a few books, hung on a wall."""
    w = style.between(0.6, 0.9)
    m.box((w, 0.03, 0.2), (0, 0, 0), style.wood)
    row = box((w * 0.5, 0.22, 0.15), (-w * 0.2, 0.03, -0.01), "f")
    m.add(row, style.second_wood)
    m.add(Shape((sheet((-w * 0.45, 0.03, 0.066), (w * 0.5, 0, 0), (0, 0.24, 0)),)), t.books(style.rng))
    m.add(post(0.05, 0.12, (w * 0.3, 0.03, 0), 0.035, 10), style.paint())


@maker("coat_rack")
def coat_rack(m: PieceBuilder, style: Style) -> None:
    """Return a board with hooks and two coats, hung on a wall."""
    m.add(box((0.8, 0.1, 0.02), (0, 0.9, 0.01)), style.wood)
    for k in range(4):
        x = -0.3 + 0.2 * k
        m.add(tube([(x, 0.94, 0.02), (x, 0.93, 0.07), (x, 0.96, 0.08)], 0.008), style.black)
    for x, texture in ((-0.3, style.paint()), (0.1, style.paint())):
        m.add(box((0.3, 0.75, 0.06), (x, 0.12, 0.05)).moved(), texture)
        m.add(box((0.16, 0.08, 0.05), (x, 0.86, 0.05)), texture)
