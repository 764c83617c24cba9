"""Kitchen units, 0.6 m deep and 0.9 m high, and the appliances between them."""

from __future__ import annotations

from dataclasses import dataclass

from humanclaw_houses import textures as t
from humanclaw_houses.model import Model, Piece
from humanclaw_houses.shapes import Ring, Shape, box, loft, post, sheet, tube
from humanclaw_houses.style import Style
from humanclaw_houses.textures import Tile

DEPTH, HEIGHT = 0.6, 0.9


@dataclass(frozen=True, eq=False)
class Fronts:
    """The look that all doors of one kitchen share."""

    door: Tile
    body: Tile

    @classmethod
    def draw(cls, style: Style) -> Fronts:
        colours = ((238, 238, 236), (86, 108, 116), (96, 118, 100), (196, 190, 178), (60, 66, 74), (176, 132, 88))
        colour = t.pick(style.rng, colours)
        return cls(t.panel_door(colour, style.rng), t.plain(colour, style.rng))


def _body(m: Model, style: Style, fronts: Fronts, width: float) -> None:
    """Add plinth, carcass, and about one door per 0.55 m."""
    m.box((width, 0.1, DEPTH - 0.1), (0, 0, -0.05), style.black)
    m.box((width, HEIGHT - 0.14, DEPTH - 0.04), (0, 0.1, -0.02), fronts.body)
    count = max(1, round(width / 0.55))
    wide = width / count
    for k in range(count):
        x = (k - (count - 1) / 2) * wide
        m.add(box((wide - 0.008, HEIGHT - 0.16, 0.018), (x, 0.11, DEPTH / 2 - 0.031), "k"), fronts.door)
        m.add(box((0.13, 0.012, 0.02), (x, HEIGHT - 0.12, DEPTH / 2 - 0.005)), style.steel)


def counter(style: Style, name: str, fronts: Fronts, width: float) -> Piece:
    m = Model()
    _body(m, style, fronts, width)
    m.box((width, 0.04, DEPTH + 0.01), (0, HEIGHT - 0.04, 0.005), style.stone)
    m.top(width, DEPTH - 0.08, HEIGHT, room=0.5)
    return m.piece(name, "kitchen_counter")


def sink(style: Style, name: str, fronts: Fronts) -> Piece:
    """Return a unit with a steel basin and a tap."""
    m = Model()
    w = 0.8
    _body(m, style, fronts, w)
    edge = [Ring(HEIGHT - 0.04, w / 2, DEPTH / 2, 60), Ring(HEIGHT, w / 2, DEPTH / 2, 60)]
    m.add(loft([*edge, Ring(HEIGHT, 0.27, 0.19, 8, z=0.02)], 28, top=False), style.stone)
    basin = [Ring(HEIGHT + 0.004, 0.27, 0.19, 8, z=0.02), Ring(HEIGHT + 0.004, 0.25, 0.17, 8, z=0.02)]
    m.add(loft([*basin, Ring(HEIGHT - 0.15, 0.23, 0.15, 6, z=0.02)], 28, bottom=False), style.steel)
    m.solid((w, 0.04, DEPTH), (0, HEIGHT - 0.04, 0))
    arc = [(0.0, HEIGHT, -0.22), (0.0, HEIGHT + 0.26, -0.22), (0.0, HEIGHT + 0.32, -0.15), (0.0, HEIGHT + 0.26, -0.07)]
    m.add(tube(arc, 0.013, 8), style.chrome)
    return m.piece(name, "sink")


def stove(style: Style, name: str) -> Piece:
    """Return an oven with a glass door below a hob."""
    m = Model()
    body = style.choice(style.steel, style.white, style.black)
    m.box((0.6, HEIGHT, DEPTH - 0.02), (0, 0, -0.01), body)
    m.add(box((0.54, 0.5, 0.02), (0, 0.12, DEPTH / 2 - 0.012), "k"), style.black)
    m.add(Shape((sheet((-0.2, 0.2, DEPTH / 2 + 0.009), (0.4, 0, 0), (0, 0.26, 0)),)), t.screen(style.rng, on=False))
    m.add(tube([(-0.22, 0.66, DEPTH / 2 + 0.03), (0.22, 0.66, DEPTH / 2 + 0.03)], 0.011), style.chrome)
    for k in range(5):
        knob = post(0.022, 0.025, segments=10).moved((-0.2 + 0.1 * k, 0.8, DEPTH / 2 - 0.02), (90, 0, 0))
        m.add(knob, style.black if body is not style.black else style.steel)
    m.add(Shape((sheet((-0.28, HEIGHT + 0.004, 0.26), (0.56, 0, 0), (0, 0, -0.52)),)), t.burner(style.rng))
    m.top(0.4, 0.3, HEIGHT + 0.005, room=0.5)
    return m.piece(name, "stove")


def wall_cabinet(style: Style, name: str, fronts: Fronts, width: float) -> Piece:
    m = Model()
    m.box((width, 0.68, 0.31), (0, 0, 0), fronts.body)
    count = max(1, round(width / 0.5))
    wide = width / count
    for k in range(count):
        x = (k - (count - 1) / 2) * wide
        m.add(box((wide - 0.008, 0.67, 0.016), (x, 0.005, 0.163), "k"), fronts.door)
        m.add(box((0.1, 0.01, 0.018), (x, 0.04, 0.178)), style.steel)
    return m.piece(name, "cabinet")


def hood(style: Style, name: str) -> Piece:
    """Return an extractor above a hob."""
    m = Model()
    wide = [Ring(y, 0.3, 0.24, 40) for y in (0, 0.06)]
    m.add(loft([*wide, *(Ring(y, 0.13, 0.12, 40, z=-0.1) for y in (0.2, 0.8))], 20), style.steel)
    m.solid((0.6, 0.2, 0.48), (0, 0, 0))
    return m.piece(name, "range_hood")
