"""Furniture of bathrooms and laundries."""

from __future__ import annotations

from dataclasses import replace

from humanclaw_houses import textures as t
from humanclaw_houses.furniture.decor import folds
from humanclaw_houses.piece_builder import PieceBuilder, maker
from humanclaw_houses.shapes import Ring, Shape, box, loft, post, sheet, soft_box, tube
from humanclaw_houses.style import Style


@maker("toilet")
def toilet(m: PieceBuilder, style: Style) -> None:
    """Return a close-coupled toilet: bowl, seat, lid up or down, cistern at -Z."""
    seat, z = style.between(0.4, 0.43), 0.1
    rim = seat - 0.03
    _bowl(m, style, rim, z)
    lid_up = style.chance(0.7)
    _seat(m, style, rim + 0.002, seat, z)
    lid = loft([Ring(y, rx, rx + 0.04, 2.3, z=0.215) for y, rx in ((0, 0.175), (0.02, 0.18), (0.028, 0.16))], 20)
    turn, rest = ((-97.0, 0.0, 0.0), -0.115) if lid_up else ((0.0, 0.0, 0.0), -0.13)
    m.add(lid.moved((0, seat if not lid_up else seat + 0.005, rest), turn), style.white)
    _cistern(m, style, seat)
    m.solid((0.37, 0.032, 0.46), (0, seat - 0.032, 0.1))
    m.solid((0.38, seat + 0.37, 0.18), (0, 0.0, -0.24))
    m.seat = seat


def _bowl(m: PieceBuilder, style: Style, rim: float, z: float) -> None:
    """Add the bowl, its inside, and the rim between them."""
    foot = [
        Ring(0, 0.11, 0.22, 2.6, z=z - 0.06),
        Ring(0.05, 0.1, 0.21, 2.4, z=z - 0.06),
        Ring(0.18, 0.11, 0.22, 2.3, z=z - 0.04),
    ]
    outer, inner = Ring(rim, 0.185, 0.25, 2.2, z=z), Ring(rim, 0.13, 0.18, 2.1, z=z + 0.02)
    upper = [Ring(0.3, 0.17, 0.24, 2.2, z=z - 0.01), replace(outer, y=rim - 0.04), outer]
    inside = [inner, Ring(rim - 0.09, 0.1, 0.14, 2, z=z + 0.02), Ring(rim - 0.16, 0.05, 0.08, 2, z=z)]
    m.add(loft([*foot, *upper], 20, top=False), style.ceramic, "hull")
    m.add(loft(inside, 20, bottom=False), t.plain((206, 220, 228), style.rng))
    m.add(loft([outer, inner], 20, False, False), style.ceramic)


def _cistern(m: PieceBuilder, style: Style, seat: float) -> None:
    """Add the cistern, its lid and button, and the block that it stands on."""
    m.add(soft_box((0.38, 0.37, 0.17), (0, seat - 0.02, -0.24), 0.03), style.ceramic)
    m.add(soft_box((0.4, 0.035, 0.19), (0, seat + 0.35, -0.24), 0.014), style.ceramic)
    m.add(post(0.025, 0.012, (0, seat + 0.385, -0.24), segments=12), style.chrome)
    m.add(box((0.2, seat, 0.17), (0, 0, -0.24)), style.ceramic)


def _seat(m: PieceBuilder, style: Style, low: float, high: float, z: float) -> None:
    """Add the seat ring."""
    outer, hole = (0.19, 0.245, 2.3), (0.12, 0.165, 2.1)
    rings = [
        Ring(low, *outer, z=z + 0.005),
        Ring(high - 0.008, *outer, z=z + 0.005),
        Ring(high, 0.18, 0.235, 2.3, z=z + 0.005),
    ]
    rings += [Ring(high, hole[0] + 0.008, hole[1] + 0.008, 2.1, z=z + 0.02), Ring(low, *hole, z=z + 0.02)]
    m.add(loft(rings, 20, False, False), style.white)


@maker("sink")
def vanity(m: PieceBuilder, style: Style) -> None:
    """Return a wash basin on a cupboard, with a tap."""
    w, d, h, texture = style.between(0.6, 0.85), 0.45, 0.74, style.choice(style.wood, style.second_wood, style.white)
    m.box((w, h - 0.2, d - 0.02), (0, 0.16, -0.01), texture)
    front = t.panel_door((225, 226, 224), style.rng)
    for x in (-1, 1):
        m.add(box((w / 2 - 0.012, h - 0.24, 0.016), (x * w / 4, 0.18, d / 2 - 0.012), "k"), front)
        m.add(box((0.014, 0.1, 0.018), (x * 0.04, 0.5, d / 2 + 0.004)), style.chrome)
        m.box((0.04, 0.16, d - 0.1), (x * (w / 2 - 0.05), 0, -0.02), style.black)
    outer = [
        Ring(h - 0.04, w / 2, d / 2, 9),
        Ring(h + 0.1, w / 2, d / 2, 9),
        Ring(h + 0.1, w / 2 - 0.06, d / 2 - 0.08, 4, z=0.03),
    ]
    m.add(loft([*outer, Ring(h + 0.01, w / 2 - 0.15, d / 2 - 0.14, 3, z=0.03)], 20), style.ceramic)
    m.solid((w, 0.14, d), (0, h - 0.04, 0))
    _tap(m, style, h + 0.1, -d / 2 + 0.06)


def _tap(m: PieceBuilder, style: Style, y: float, z: float) -> None:
    m.add(tube([(0, y, z), (0, y + 0.2, z), (0, y + 0.23, z + 0.06), (0, y + 0.2, z + 0.13)], 0.013, 8), style.chrome)
    m.add(box((0.02, 0.012, 0.07), (0.04, y + 0.05, z)), style.chrome)


@maker("bathtub")
def bathtub(m: PieceBuilder, style: Style) -> None:
    """Return an empty bathtub."""
    length, width, h = style.between(1.55, 1.7), 0.75, 0.56
    a, b = length / 2, width / 2
    rings = [Ring(0, a, b, 14), Ring(h, a, b, 14), Ring(h, a - 0.07, b - 0.07, 6), Ring(0.3, a - 0.13, b - 0.13, 5)]
    m.add(loft([*rings, Ring(0.14, a - 0.2, b - 0.18, 4)], 28), style.ceramic)
    m.solid((length, h, width), (0, 0, 0))
    m.add(tube([(-a + 0.05, h, 0), (-a + 0.05, h + 0.14, 0), (-a + 0.17, h + 0.13, 0)], 0.016, 8), style.chrome)


@maker("shower")
def shower(m: PieceBuilder, style: Style) -> None:
    """Return a tray in a corner with a riser, a head, and a curtain drawn back on its rail."""
    s = 0.9
    m.box((s, 0.06, s), (0, 0, 0), style.ceramic)
    m.add(box((s - 0.12, 0.003, s - 0.12), (0, 0.06, 0)), style.white)
    corner, rail = s / 2 - 0.02, 1.98
    m.add(tube([(-corner, rail, corner), (corner, rail, corner), (corner, rail, -corner)], 0.014), style.chrome)
    cloth = Shape((folds(0.0, 0.4, 1.85),)).moved((corner - 0.21, 0.1, corner - 0.07))
    m.add(cloth + _inside_out(cloth), t.stripes((120, 170, 190), (240, 244, 246), style.rng))
    z = -s / 2 + 0.05
    m.add(tube([(0, 0.9, z), (0, 2.05, z), (0, 2.1, z + 0.15), (0, 2.06, z + 0.28)], 0.012, 6), style.chrome)
    m.add(post(0.1, 0.02, (0, 2.03, z + 0.28), segments=14), style.chrome)
    m.add(box((0.16, 0.05, 0.05), (0, 1.0, z)), style.chrome)


def _inside_out(shape: Shape) -> Shape:
    """Return the other side of a sheet."""
    return Shape(tuple(replace(chart, faces=chart.faces[:, ::-1]) for chart in shape.charts))


@maker("washing_machine")
def washing_machine(m: PieceBuilder, style: Style) -> None:
    m.box((0.6, 0.85, 0.58), (0, 0, 0), style.white)
    m.add(Shape((sheet((-0.29, 0.02, 0.292), (0.58, 0, 0), (0, 0.81, 0)),)), t.porthole(style.rng))
    m.surface(0.5, 0.45, 0.85)


@maker("towel")
def towel_rail(m: PieceBuilder, style: Style) -> None:
    """Return a rail with a towel, hung on a wall."""
    m.add(tube([(-0.3, 0.6, 0.05), (0.3, 0.6, 0.05)], 0.01), style.chrome)
    for x in (-0.3, 0.3):
        m.add(tube([(x, 0.6, 0.0), (x, 0.6, 0.05)], 0.01), style.chrome)
    m.add(soft_box((0.42, 0.6, 0.05), (0, 0.02, 0.05), 0.02), style.fabric())


@maker("paper_holder")
def paper_holder(m: PieceBuilder, style: Style) -> None:
    """Return a roll of paper on the wall."""
    m.add(post(0.055, 0.1, segments=14).moved((0.05, 0.06, 0.06), (0, 0, 90)), style.white)
    m.add(box((0.09, 0.1, 0.003), (0, -0.02, 0.115)), style.white)
    m.add(tube([(-0.07, 0.06, 0.0), (-0.07, 0.06, 0.06), (0.06, 0.06, 0.06)], 0.006), style.chrome)
