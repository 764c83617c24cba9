"""Kitchen units, 0.6 m deep and 0.9 m high, and the appliances between them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from humanclaw_houses import textures as t
from humanclaw_houses.furniture import hinged_parts
from humanclaw_houses.furniture.hinged_parts import BOARD, carcass, door, lid
from humanclaw_houses.piece_builder import PieceBuilder, maker
from humanclaw_houses.shapes import Ring, Shape, box, loft, post, sheet, tube
from humanclaw_houses.style import Style
from humanclaw_houses.textures import Texture

DEPTH, HEIGHT = 0.6, 0.9
"""Of units with their worktop, metres: the standard of fitted kitchens, which stoves and dishwashers keep."""
_UNIT: Final = HEIGHT - 0.14
"""Height of a unit between its plinth and its worktop, metres."""
_ONE_DOOR: Final = 0.6
"""Largest width of a unit with a single door, metres."""


@dataclass(frozen=True, eq=False)
class Fronts:
    """The look that all doors of one kitchen share."""

    door: Texture
    body: Texture

    @classmethod
    def draw(cls, style: Style) -> Fronts:
        colours = ((238, 238, 236), (86, 108, 116), (96, 118, 100), (196, 190, 178), (60, 66, 74), (176, 132, 88))
        colour = t.pick(style.rng, colours)
        return cls(t.panel_door(colour, style.rng), t.plain(colour, style.rng))


def _cupboard(
    m: PieceBuilder, style: Style, fronts: Fronts, width: float, drawer: float = 0.0, roof: bool = True
) -> None:
    """Add a plinth and a carcass with one or two doors. drawer: height of a drawer over them, metres; 0 for none."""
    m.box((width, 0.1, DEPTH - 0.1), (0, 0, -0.05), style.black)
    carcass(m, (width, _UNIT, 0.567), (0, 0.1, -0.0165), fronts.body, 0 if drawer else 1, roof=roof)
    count = 1 if width <= _ONE_DOOR else 2
    for k in range(count):
        x = (k - (count - 1) / 2) * width / count
        door(m, (width / count, _UNIT - drawer, BOARD), (x, 0.1, 0.276), fronts.door, style.steel, k == 0)
    if drawer:
        front = (width - 2 * BOARD, drawer - BOARD, 0.55)
        hinged_parts.drawer(m, front, (0, 0.1 + _UNIT - drawer, 0.01), fronts.body, style.steel)


@maker("kitchen_counter")
def counter(m: PieceBuilder, style: Style, fronts: Fronts, width: float) -> None:
    """Return a worktop over a drawer over a door, or over two doors with a shelf behind them if it is wide."""
    _cupboard(m, style, fronts, width, 0.16 if width <= _ONE_DOOR else 0.0)
    _worktop(m, style, width)


def _worktop(m: PieceBuilder, style: Style, width: float) -> None:
    m.box((width, 0.04, DEPTH + 0.01), (0, HEIGHT - 0.04, 0.005), style.stone)
    m.surface(width, DEPTH - 0.08, HEIGHT, room=0.5)


@maker("dishwasher")
def dishwasher(m: PieceBuilder, style: Style, fronts: Fronts) -> None:
    """Return a dishwasher below a worktop, 0.6 m wide."""
    m.box((0.6, 0.1, DEPTH - 0.1), (0, 0, -0.05), style.black)
    carcass(m, (0.6, _UNIT, 0.555), (0, 0.1, -0.0225), style.steel, 1)
    lid(m, (0.6, _UNIT, 0.03), (0, 0.1, 0.27), fronts.body, style.steel)
    _worktop(m, style, 0.6)


@maker("sink")
def sink(m: PieceBuilder, style: Style, fronts: Fronts) -> None:
    """Return a unit with a steel basin and a tap."""
    w = 0.8
    _cupboard(m, style, fronts, w, roof=False)
    edge = [Ring(HEIGHT - 0.04, w / 2, DEPTH / 2, 60), Ring(HEIGHT, w / 2, DEPTH / 2, 60)]
    m.add(loft([*edge, Ring(HEIGHT, 0.27, 0.19, 8, z=0.02)], 28, top=False), style.stone)
    basin = [Ring(HEIGHT + 0.004, 0.27, 0.19, 8, z=0.02), Ring(HEIGHT + 0.004, 0.25, 0.17, 8, z=0.02)]
    m.add(loft([*basin, Ring(HEIGHT - 0.15, 0.23, 0.15, 6, z=0.02)], 28, bottom=False), style.steel)
    m.solid((w, 0.04, DEPTH), (0, HEIGHT - 0.04, 0))
    arc = [(0.0, HEIGHT, -0.22), (0.0, HEIGHT + 0.26, -0.22), (0.0, HEIGHT + 0.32, -0.15), (0.0, HEIGHT + 0.26, -0.07)]
    m.add(tube(arc, 0.013, 8), style.chrome)


@maker("stove")
def stove(m: PieceBuilder, style: Style) -> None:
    """Return an oven with a lid of glass below a hob."""
    body, d = style.choice(style.steel, style.white, style.black), DEPTH - 0.02
    m.box((0.6, 0.06, d - 0.1), (0, 0, -0.03), style.black)
    carcass(m, (0.6, 0.7, d - 0.04), (0, 0.06, -0.02), style.black, 1)
    m.box((0.6, HEIGHT - 0.76, d), (0, 0.76, 0), body)
    glass = lid(m, (0.6, 0.7, 0.04), (0, 0.06, d / 2 - 0.02), body, style.chrome)
    glass.add(Shape((sheet((-0.22, 0.17, d / 2 + 0.001), (0.44, 0, 0), (0, 0.36, 0)),)), t.screen(style.rng, on=False))
    for k in range(5):
        knob = post(0.022, 0.025, segments=10).moved((-0.2 + 0.1 * k, 0.83, d / 2 - 0.005), (90, 0, 0))
        m.add(knob, style.black if body is not style.black else style.steel)
    m.add(Shape((sheet((-0.28, HEIGHT + 0.004, 0.26), (0.56, 0, 0), (0, 0, -0.52)),)), t.burner(style.rng))
    m.surface(0.4, 0.3, HEIGHT + 0.005, room=0.5)


@maker("fridge")
def fridge(m: PieceBuilder, style: Style) -> None:
    """Return a fridge over a freezer, each with shelves and a door."""
    texture, w, h, d = style.choice(style.steel, style.white), style.between(0.6, 0.7), style.between(1.7, 1.85), 0.62
    split, left = round(0.38 * h, 2), style.chance(0.5)
    for y, high, shelves in ((0.03, split - 0.03, 1), (split, h - split, 3)):
        carcass(m, (w, high, d - 0.05), (0, y, -0.025), style.white, shelves)
        door(m, (w, high - 0.005, 0.04), (0, y, d / 2 - 0.02), texture, style.chrome, left)
    m.box((w - 0.04, 0.03, d - 0.12), (0, 0, -0.03), style.black)


@maker("cabinet")
def wall_cabinet(m: PieceBuilder, style: Style, fronts: Fronts, width: float) -> None:
    m.box((width, 0.68, 0.31), (0, 0, 0), fronts.body)
    count = max(1, round(width / 0.5))
    wide = width / count
    for k in range(count):
        x = (k - (count - 1) / 2) * wide
        m.add(box((wide - 0.008, 0.67, 0.016), (x, 0.005, 0.163), "k"), fronts.door)
        m.add(box((0.1, 0.01, 0.018), (x, 0.04, 0.178)), style.steel)


@maker("range_hood")
def hood(m: PieceBuilder, style: Style) -> None:
    """Return an extractor above a hob."""
    wide = [Ring(y, 0.3, 0.24, 40) for y in (0, 0.06)]
    m.add(loft([*wide, *(Ring(y, 0.13, 0.12, 40, z=-0.1) for y in (0.2, 0.8))], 20), style.steel)
    m.solid((0.6, 0.2, 0.48), (0, 0, 0))
