"""Furniture that opens: carcasses with doors, drawers and lids. A piece stands on height 0 with its front at +Z."""

from __future__ import annotations

from typing import Final

import numpy as np

from humanclaw.world import Hinge, Slide
from humanclaw_houses import textures as t
from humanclaw_houses.model import Model, Piece
from humanclaw_houses.shapes import Point, Shape, box, sheet
from humanclaw_houses.style import Style
from humanclaw_houses.textures import Tile

_BOARD: Final = 0.018
"""Thickness of boards, metres."""
_PLAY: Final = 0.004
"""Gap around doors and drawers, metres."""
_OPEN: Final = float(np.pi / 2)
_DENSITY: Final = 650.0
"""Of chipboard, kg/m3."""


def carcass(m: Model, size: Point, at: Point, tile: Tile, shelves: int = 0) -> None:
    """Add a box that is open at the front, with shelves at equal heights. at: the centre of its underside."""
    (w, h, d), (x, y, z) = size, at
    for side in (-1, 1):
        m.box((_BOARD, h, d), (x + side * (w - _BOARD) / 2, y, z), tile)
    inner = w - 2 * _BOARD
    for k in range(shelves + 2):
        m.box((inner, _BOARD, d), (x, y + k * (h - _BOARD) / (shelves + 1), z), tile)
        if k <= shelves:
            m.top(inner, d - 0.06, y + k * (h - _BOARD) / (shelves + 1) + _BOARD, x, z, h / (shelves + 1) - 0.05)
    m.box((inner, h - 2 * _BOARD, _BOARD), (x, y + _BOARD, z - (d - _BOARD) / 2), tile)


def door(m: Model, size: Point, at: Point, tile: Tile, grip: Tile, left: bool = True) -> Model:
    """Add a door. at: the centre of its underside; left: whether its hinge is at -X. It opens by 90 degrees about the
    front edge there, so that it passes what stands beside it."""
    (w, h, d), (x, y, z) = size, at
    side = -1 if left else 1
    low, high = (-_OPEN, 0.0) if left else (0.0, _OPEN)
    leaf = m.leaf(Hinge((x + side * w / 2, y, z + d / 2), low, high, 1.5, 2.0), round(_DENSITY * w * h * d, 2))
    leaf.box((w - _PLAY, h - _PLAY, d), (x, y + _PLAY / 2, z), tile)
    leaf.add(box((0.014, min(0.3, h / 3), 0.025), (x - side * (w / 2 - 0.05), y + h / 2, z + d / 2 + 0.012)), grip)
    return leaf


def lid(m: Model, size: Point, at: Point, tile: Tile, grip: Tile) -> Model:
    """Add a lid that opens downwards about its lower edge, as those of ovens and dishwashers do."""
    (w, h, d), (x, y, z) = size, at
    hinge = Hinge((x, y, z + d / 2), 0.0, _OPEN, 1.5, 4.0, axis=(1.0, 0.0, 0.0))
    leaf = m.leaf(hinge, round(2 * _DENSITY * w * h * d, 2))
    leaf.box((w - _PLAY, h - _PLAY, d), (x, y + _PLAY / 2, z), tile)
    leaf.add(box((w - 0.12, 0.02, 0.03), (x, y + h - 0.07, z + d / 2 + 0.015)), grip)
    return leaf


def drawer(m: Model, size: Point, at: Point, tile: Tile, grip: Tile) -> Model:
    """Add a drawer that comes out by three quarters of its depth. size: its front's width and height, and its depth;
    at: the centre of its underside."""
    (w, h, d), (x, y, z) = size, at
    leaf = m.leaf(Slide(0.0, round(0.75 * d, 3)), round(_DENSITY * _BOARD * (2 * w * h + 2 * d * h / 2 + w * d), 2))
    leaf.box((w - _PLAY, h - _PLAY, _BOARD), (x, y + _PLAY / 2, z + (d - _BOARD) / 2), tile)
    inner, deep, low = w - 2 * _BOARD - 2 * _PLAY, d - _BOARD - 0.02, y + 0.01
    middle = z - 0.01 - _PLAY
    leaf.box((inner, 0.008, deep), (x, low, middle), tile)
    for side in (-1, 1):
        leaf.box((0.012, 0.6 * h, deep), (x + side * (inner - 0.012) / 2, low, middle), tile)
    leaf.box((inner, 0.6 * h, 0.012), (x, low, middle - (deep - 0.012) / 2), tile)
    leaf.add(box((min(0.16, w / 2), 0.012, 0.025), (x, y + 0.6 * h, z + d / 2 + 0.012)), grip)
    return leaf


# -- pieces ------------------------------------------------------------------------------------------------------------
def fridge(style: Style, name: str) -> Piece:
    """Return a fridge over a freezer, each with shelves and a door."""
    m = Model()
    tile, w, h, d = style.choice(style.steel, style.white), style.between(0.6, 0.7), style.between(1.7, 1.85), 0.62
    split, left = round(0.38 * h, 2), style.chance(0.5)
    for y, high, shelves in ((0.03, split - 0.03, 1), (split, h - split, 3)):
        carcass(m, (w, high, d - 0.05), (0, y, -0.025), style.white, shelves)
        door(m, (w, high - 0.005, 0.04), (0, y, d / 2 - 0.02), tile, style.chrome, left)
    m.box((w - 0.04, 0.03, d - 0.12), (0, 0, -0.03), style.black)
    return m.piece(name, "fridge")


def chest(style: Style, name: str, rows: int = 4) -> Piece:
    """Return a chest of drawers."""
    m = Model()
    w, h, d, tile = style.between(0.75, 1.0), style.between(0.8, 1.0), 0.45, style.choice(style.wood, style.white)
    carcass(m, (w, h, d - 0.02), (0, 0, -0.01), tile)
    each = (h - 2 * _BOARD) / rows
    for k in range(rows):
        drawer(m, (w - 2 * _BOARD, each, d - 0.03), (0, _BOARD + k * each, 0.015), tile, style.black)
    m.top(w, d - 0.04, h)
    return m.piece(name, "dresser")


def wardrobe(style: Style, name: str) -> Piece:
    """Return a wardrobe with two doors, a shelf and a rail."""
    m = Model()
    w, h, d, tile = style.between(0.9, 1.2), style.between(1.9, 2.1), 0.58, style.choice(style.wood, style.white)
    carcass(m, (w, h, d - 0.02), (0, 0, -0.01), tile, 1)
    for side in (-1, 1):
        door(m, (w / 2, h, 0.018), (side * w / 4, 0, d / 2 - 0.009), tile, style.steel, side < 0)
    m.add(box((w - 0.04, 0.025, 0.025), (0, h - 0.12, 0)), style.chrome)
    return m.piece(name, "wardrobe")


def oven(style: Style, name: str) -> Piece:
    """Return an oven with a lid of glass below a hob."""
    m = Model()
    body, h, d = style.choice(style.steel, style.white, style.black), 0.9, 0.58
    carcass(m, (0.6, 0.72, d - 0.05), (0, 0.06, -0.025), style.black, 1)
    m.box((0.6, 0.06, d - 0.1), (0, 0, -0.03), style.black)
    m.box((0.6, h - 0.78, d), (0, 0.78, 0), body)
    glass = lid(m, (0.6, 0.7, 0.04), (0, 0.07, d / 2 - 0.02), style.black, style.chrome)
    glass.add(Shape((sheet((-0.2, 0.17, d / 2 + 0.001), (0.4, 0, 0), (0, 0.4, 0)),)), t.screen(style.rng, on=False))
    m.add(Shape((sheet((-0.28, h + 0.002, 0.26), (0.56, 0, 0), (0, 0, -0.52)),)), t.burner(style.rng))
    m.top(0.4, 0.3, h, room=0.5)
    return m.piece(name, "stove")


def dishwasher(style: Style, name: str, front: Tile | None = None) -> Piece:
    """Return a dishwasher. front: the look of the kitchen's doors."""
    m = Model()
    h, d, tile = 0.86, 0.58, front or t.plain((226, 226, 224), style.rng)
    carcass(m, (0.6, h - 0.1, d - 0.04), (0, 0.1, -0.02), style.steel, 1)
    m.box((0.6, 0.1, d - 0.1), (0, 0, -0.05), style.black)
    lid(m, (0.6, h - 0.1, 0.03), (0, 0.1, d / 2 - 0.015), tile, style.steel)
    return m.piece(name, "dishwasher")


def cupboard(style: Style, name: str, tile: Tile, width: float = 0.6, drawers: bool = True) -> Piece:
    """Return a base unit of a kitchen, 0.86 m high: a drawer over a door if it is up to 0.6 m wide, else two doors."""
    m = Model()
    h, d, over = 0.86, 0.58, 0.16 if drawers else 0.0
    m.box((width, 0.1, d - 0.1), (0, 0, -0.05), style.black)
    carcass(m, (width, h - 0.1, d - 0.02), (0, 0.1, -0.01), tile, 0)
    count = 1 if width <= 0.6 else 2
    for k in range(count):
        wide, x = width / count, (k - (count - 1) / 2) * width / count
        door(m, (wide, h - 0.1 - over, 0.018), (x, 0.1, d / 2 - 0.009), tile, style.steel, k == 0)
    if drawers:
        # In front of the carcass, its sides inside: the front covers the boards.
        drawer(m, (width - 2 * _BOARD, over - _BOARD, d - 0.03), (0, h - over, 0.0), tile, style.steel)
    return m.piece(name, "kitchen_counter")
