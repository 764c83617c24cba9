"""Couches, armchairs, chairs and stools. What is sat on collides as it looks: seat, back, arms, and free room below."""

from __future__ import annotations

from humanclaw_houses import textures as t
from humanclaw_houses.model import Model, Piece
from humanclaw_houses.shapes import ball, box, post, soft_box, tube
from humanclaw_houses.style import Style
from humanclaw_houses.textures import Tile


def couch(style: Style, name: str, seats: int = 3) -> Piece:
    """A couch for two or three, in cloth or leather."""
    return _sofa(style, name, "couch", seats)


def armchair(style: Style, name: str) -> Piece:
    return _sofa(style, name, "chair", 1)


def _sofa(style: Style, name: str, category: str, seats: int) -> Piece:
    m = Model()
    cover = t.leather(t.pick(style.rng, t.LEATHERS), style.rng) if style.chance(0.25) else style.choice(style.cloth, style.second_cloth)
    per_seat, depth = style.between(0.6, 0.68), style.between(0.84, 0.92)
    seat, back, leg = style.between(0.42, 0.46), style.between(0.78, 0.86), style.between(0.11, 0.14)
    arm, arm_top = style.between(0.14, 0.2), style.between(0.57, 0.64)
    inner = seats * per_seat
    width, back_depth = inner + 2 * arm, 0.2
    z_back = -depth / 2 + back_depth
    reach = depth / 2 - z_back
    m.box((inner + 0.02, seat - 0.13 - leg, reach - 0.02), (0, leg, (z_back + depth / 2) / 2 - 0.01), cover, solid=False)
    m.add(soft_box((width, back - leg, back_depth), (0, leg, -depth / 2 + back_depth / 2), 0.06), cover)
    for number in range(seats):
        x = (number - (seats - 1) / 2) * per_seat
        m.add(soft_box((per_seat - 0.012, 0.128, reach), (x, seat - 0.14, (z_back + depth / 2) / 2), 0.045, 0.012), cover)
        pad = soft_box((per_seat - 0.02, back - seat + 0.06, 0.15), (0, 0, 0), 0.065)
        m.add(pad.moved((x, seat - 0.02, z_back + 0.045), (-9, 0, 0)), cover)
    for side in (-1, 1):
        m.add(soft_box((arm, arm_top - leg, depth - 0.01), (side * (width - arm) / 2, leg, 0.0), 0.07), cover)
        for z in (-depth / 2 + 0.08, depth / 2 - 0.08):
            m.add(post(0.018, leg + 0.02, (side * (width / 2 - 0.08), 0, z), 0.026), style.second_wood)
        m.solid((arm, arm_top - leg, depth), (side * (width - arm) / 2, leg, 0))
    m.solid((inner, seat - leg, reach), (0, leg, (z_back + depth / 2) / 2))
    m.solid((inner, back - leg, back_depth + 0.06), (0, leg, -depth / 2 + back_depth / 2 + 0.03))
    return m.piece(name, category, seat=seat)


def dining_chair(style: Style, name: str) -> Piece:
    """A wooden chair: slatted, ladder or upholstered back."""
    m = Model()
    frame = style.choice(style.wood, style.second_wood, style.white, style.black)
    w, d, seat, back = style.between(0.42, 0.46), style.between(0.42, 0.46), style.between(0.44, 0.47), style.between(0.84, 0.94)
    kind = int(style.rng.integers(3))
    _legs(m, frame, w, d, seat - 0.04, 0.036)
    m.box((w, 0.04, d), (0, seat - 0.04, 0), frame, solid=False)
    if kind != 1:
        m.add(soft_box((w - 0.02, 0.035, d - 0.03), (0, seat - 0.022, 0.01), 0.016), style.second_cloth)
    m.solid((w, 0.045, d), (0, seat - 0.04, 0))
    _chair_back(m, style, frame, kind, w, d, seat, back)
    m.solid((w, back - seat - 0.01, 0.045), (0, seat + 0.01, -d / 2 + 0.02))
    return m.piece(name, "chair", seat=seat, mass=5.0, friction=0.5)


def _legs(m: Model, tile: Tile, width: float, depth: float, height: float, thick: float) -> None:
    for x in (-1, 1):
        for z in (-1, 1):
            m.box((thick, height, thick), (x * (width - thick) / 2, 0, z * (depth - thick) / 2), tile, skip="b")


def _chair_back(m: Model, style: Style, frame: Tile, kind: int, w: float, d: float, seat: float, back: float) -> None:
    z, rise = -d / 2 + 0.02, back - seat
    for x in (-1, 1):
        m.add(box((0.034, rise, 0.034), (x * (w - 0.034) / 2, seat, z)), frame)
    m.add(soft_box((w, 0.09, 0.03), (0, back - 0.09, z), 0.012), frame)
    if kind == 0:
        for k in range(5):
            m.add(box((0.025, rise - 0.08, 0.015), ((k - 2) * (w - 0.1) / 4.6, seat, z)), frame)
    elif kind == 1:
        for k in range(3):
            m.add(box((w - 0.05, 0.045, 0.016), (0, seat + 0.08 + k * (rise - 0.16) / 3, z)), frame)
    else:
        m.add(soft_box((w - 0.06, rise - 0.14, 0.045), (0, seat + 0.06, z + 0.01), 0.02), style.second_cloth)


def office_chair(style: Style, name: str) -> Piece:
    """A swivel chair on a star of five castors."""
    m = Model()
    cover = style.choice(style.black, style.cloth)
    seat = style.between(0.45, 0.48)
    for k in range(5):
        arm = box((0.04, 0.035, 0.28), (0, 0.06, 0.14)).moved(turn=(0, 72.0 * k, 0))
        m.add(arm, style.black)
        m.add(ball(0.03, (0, 0, 0.27)).moved(turn=(0, 72.0 * k, 0)), style.black)
    m.add(post(0.028, seat - 0.15, (0, 0.08, 0)), style.steel)
    m.add(soft_box((0.48, 0.085, 0.46), (0, seat - 0.085, 0.02), 0.04), cover)
    m.add(soft_box((0.44, 0.5, 0.07), (0, 0, 0), 0.034).moved((0, seat + 0.07, -0.21), (-7, 0, 0)), cover)
    m.add(box((0.06, 0.2, 0.025), (0, seat - 0.05, -0.235)), style.black)
    for x in (-1, 1):
        m.add(tube([(x * 0.24, seat - 0.05, 0.0), (x * 0.28, seat + 0.2, 0.0)], 0.014), style.black)
        m.add(soft_box((0.05, 0.03, 0.24), (x * 0.28, seat + 0.19, 0.0), 0.014), style.black)
        m.solid((0.06, 0.17, 0.24), (x * 0.28, seat + 0.05, 0))
    m.solid((0.4, 0.09, 0.4), (0, 0.01, 0))
    m.solid((0.07, seat - 0.18, 0.07), (0, 0.1, 0))
    m.solid((0.48, 0.085, 0.46), (0, seat - 0.085, 0.02))
    m.solid((0.44, 0.48, 0.1), (0, seat + 0.05, -0.225))
    return m.piece(name, "chair", seat=seat, mass=9.0, friction=0.25)


def stool(style: Style, name: str) -> Piece:
    """A round stool on four splayed legs."""
    m = Model()
    seat = style.between(0.44, 0.48)
    m.add(post(0.17, 0.035, (0, seat - 0.035, 0), segments=16), style.wood, "hull")
    for x in (-1, 1):
        for z in (-1, 1):
            m.add(tube([(x * 0.15, 0.0, z * 0.15), (x * 0.1, seat - 0.03, z * 0.1)], 0.015), style.wood)
    m.solid((0.3, seat - 0.06, 0.3), (0, 0.005, 0))
    return m.piece(name, "chair", seat=seat, mass=3.5, friction=0.5)


def bench(style: Style, name: str) -> Piece:
    """A bench for the hall, with shoes' room below."""
    m = Model()
    w, d, h = style.between(0.8, 1.1), 0.32, 0.44
    m.box((w, 0.04, d), (0, h - 0.06, 0), style.wood)
    m.add(soft_box((w - 0.02, 0.04, d - 0.02), (0, h - 0.03, 0), 0.018), style.cloth)
    for x in (-1, 1):
        m.box((0.04, h - 0.06, d), (x * (w / 2 - 0.03), 0, 0), style.wood)
    m.box((w - 0.06, 0.02, d - 0.04), (0, 0.16, 0), style.wood)
    return m.piece(name, "bench")
