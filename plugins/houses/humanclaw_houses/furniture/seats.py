"""Couches, armchairs, chairs and stools. They collide as they look: seat, back, arms, and free space below."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from humanclaw_houses import textures as t
from humanclaw_houses.piece_builder import PieceBuilder, maker
from humanclaw_houses.shapes import ball, box, pillow, post, soft_box, tube
from humanclaw_houses.style import Style
from humanclaw_houses.textures import Texture


@dataclass(frozen=True)
class _Cut:
    """Measures of a couch or an armchair, metres."""

    seats: int
    per_seat: float
    depth: float
    seat: float
    back: float
    leg: float
    arm: float
    arm_top: float

    BACK_DEPTH: ClassVar = 0.2

    @classmethod
    def draw(cls, style: Style, seats: int) -> _Cut:
        return cls(
            seats,
            per_seat=style.between(0.6, 0.68),
            depth=style.between(0.84, 0.92),
            seat=style.between(0.42, 0.46),
            back=style.between(0.78, 0.86),
            leg=style.between(0.11, 0.14),
            arm=style.between(0.14, 0.2),
            arm_top=style.between(0.57, 0.64),
        )

    @property
    def inner(self) -> float:
        """Width between the arms."""
        return self.seats * self.per_seat

    @property
    def width(self) -> float:
        return self.inner + 2 * self.arm

    @property
    def reach(self) -> float:
        """Depth of the seat from its front edge to the back."""
        return self.depth - self.BACK_DEPTH

    @property
    def middle(self) -> float:
        """z of the centre of the seat."""
        return self.BACK_DEPTH / 2

    def seat_x(self) -> list[float]:
        return [(number - (self.seats - 1) / 2) * self.per_seat for number in range(self.seats)]


@maker("couch")
def couch(m: PieceBuilder, style: Style, seats: int = 3) -> None:
    """Return a couch for two or three: soft, boxy, with wooden arms, or buttoned leather with rolled arms."""
    _sofa(m, style, seats)


@maker("chair")
def armchair(m: PieceBuilder, style: Style) -> None:
    _sofa(m, style, 1)


def _sofa(m: PieceBuilder, style: Style, seats: int) -> None:
    cut = _Cut.draw(style, seats)
    kind = str(style.rng.choice(["soft", "boxy", "wooden", "buttoned"]))
    if kind == "wooden":
        cut = replace(cut, arm=0.09)
    leather = kind == "buttoned" or style.chance(0.12)
    hide = t.leather(t.pick(style.rng, t.LEATHERS), style.rng)
    cover = hide if leather else style.choice(style.cloth, style.second_cloth)
    _seat_and_back(m, cut, cover, kind)
    for side in (-1, 1):
        _arm(m, style, cut, cover, kind, side)
        for z in () if kind == "wooden" else (-cut.depth / 2 + 0.08, cut.depth / 2 - 0.08):
            m.add(post(0.018, cut.leg + 0.02, (side * (cut.width / 2 - 0.08), 0, z), 0.026), style.second_wood)
        m.solid((cut.arm, cut.arm_top - cut.leg, cut.depth), (side * (cut.width - cut.arm) / 2, cut.leg, 0))
    _scatter_cushions(m, style, cut)
    m.solid((cut.inner, cut.seat - cut.leg, cut.reach), (0, cut.leg, cut.middle))
    m.solid(
        (cut.inner, cut.back - cut.leg, cut.BACK_DEPTH + 0.06), (0, cut.leg, (cut.BACK_DEPTH + 0.06 - cut.depth) / 2)
    )
    m.seat = cut.seat


def _seat_and_back(m: PieceBuilder, cut: _Cut, cover: Texture, kind: str) -> None:
    """Add the frame below, a seat cushion for each person, and loose back cushions or one buttoned back."""
    shade = t.shaded(cover, 0.55)
    m.add(box((cut.inner + 0.02, cut.seat - 0.13 - cut.leg, cut.reach - 0.03), (0, cut.leg, cut.middle - 0.015)), cover)
    m.add(box((cut.inner, 0.09, cut.reach - 0.04), (0, cut.seat - 0.13, cut.middle - 0.02), "b"), shade)
    _back(m, cut, cover, kind)
    radius = 0.025 if kind == "boxy" else 0.045
    for x in cut.seat_x():
        m.add(soft_box((cut.per_seat - 0.016, 0.11, cut.reach), (x, cut.seat - 0.13, cut.middle), radius, 0.02), cover)
        if kind == "buttoned":
            _buttons(m, cut, cover, x)
        else:
            pad = soft_box((cut.per_seat - 0.02, cut.back - cut.seat + 0.04, 0.17), radius=0.06)
            m.add(pad.moved((x, cut.seat - 0.01, cut.BACK_DEPTH - cut.depth / 2 + 0.02), (-10, 0, 0)), cover)


def _back(m: PieceBuilder, cut: _Cut, cover: Texture, kind: str) -> None:
    """Add the back, upholstered with one panel per seat; a buttoned back is one piece."""
    z, depth = (cut.BACK_DEPTH - cut.depth) / 2, cut.BACK_DEPTH
    width, high = (cut.width if kind in ("soft", "buttoned") else cut.inner + 0.02), cut.back - cut.leg
    if kind == "buttoned":
        m.add(soft_box((width, high, depth), (0, cut.leg, z), 0.06), cover)
        return
    m.add(soft_box((width, high - 0.07, depth - 0.04), (0, cut.leg, z - 0.01), 0.06), cover)
    for x in cut.seat_x():
        m.add(
            soft_box(
                (width / cut.seats - 0.016, high - 0.19, 0.06),
                (x * width / cut.inner, cut.leg + 0.1, -cut.depth / 2 + 0.03),
                0.028,
            ),
            cover,
        )


def _scatter_cushions(m: PieceBuilder, style: Style, cut: _Cut) -> None:
    """Add two cushions in the corners of a couch, at most one on an armchair. They do not collide."""
    texture, z = style.fabric(), cut.BACK_DEPTH - cut.depth / 2 + 0.2
    out = cut.inner / 2 - 0.22
    for x in (-out, out) if cut.seats > 1 else (0.0,) if style.chance(0.4) else ():
        pad = pillow((0.46, 0.17, 0.46)).moved((0.0, -0.085, 0.0)).moved(turn=(66, -14 * np.sign(x), 0))
        m.add(pad.moved((x, cut.seat + 0.2, z)), texture)


def _buttons(m: PieceBuilder, cut: _Cut, cover: Texture, x: float) -> None:
    """Add a buttoned back as a grid of small pads."""
    columns, rows = 3, 2
    wide, high = cut.per_seat / columns, (cut.back - cut.seat + 0.02) / rows
    for i in range(columns):
        for j in range(rows):
            pad = soft_box((wide * 1.02, high * 1.02, 0.11), radius=0.05)
            z = cut.BACK_DEPTH - cut.depth / 2 + 0.02
            m.add(pad.moved((x + (i - 1) * wide, cut.seat - 0.02 + j * high, z), (-6, 0, 0)), cover)


def _arm(m: PieceBuilder, style: Style, cut: _Cut, cover: Texture, kind: str, side: int) -> None:
    x, rise = side * (cut.width - cut.arm) / 2, cut.arm_top - cut.leg
    if kind == "wooden":
        for z in (-cut.depth / 2 + 0.06, cut.depth / 2 - 0.06):
            m.add(box((0.05, cut.arm_top, 0.05), (x, 0, z)), style.second_wood)
        m.add(soft_box((0.09, 0.035, cut.depth - 0.02), (x, cut.arm_top - 0.035, 0), 0.014), style.second_wood)
        m.add(box((0.03, 0.1, cut.depth - 0.1), (x, cut.seat - 0.16, 0)), style.second_wood)
    elif kind == "buttoned":
        m.add(soft_box((cut.arm * 0.75, rise - 0.05, cut.depth - 0.02), (x, cut.leg, 0), 0.04), cover)
        roll = post(cut.arm / 2, cut.depth - 0.01, segments=14)
        m.add(roll.moved((x, cut.arm_top - cut.arm / 2, -(cut.depth - 0.01) / 2), (90, 0, 0)), cover)
    else:
        radius = 0.022 if kind == "boxy" else 0.07
        m.add(soft_box((cut.arm, rise, cut.depth - 0.01), (x, cut.leg, 0.0), radius), cover)


@maker("chair", mass=5.0, friction=0.5)
def dining_chair(m: PieceBuilder, style: Style) -> None:
    """Return a wooden chair: slatted, ladder or upholstered back."""
    frame = style.choice(style.wood, style.second_wood, style.white, style.black)
    w, d, seat, back = (
        style.between(0.42, 0.46),
        style.between(0.42, 0.46),
        style.between(0.44, 0.47),
        style.between(0.84, 0.94),
    )
    kind = int(style.rng.integers(3))
    _legs(m, frame, w, d, seat - 0.03, 0.04)
    m.add(box((w - 0.05, 0.06, d - 0.05), (0, seat - 0.09, 0), "t"), frame)
    for x in (-1, 1):
        m.add(box((0.02, 0.03, d - 0.06), (x * (w / 2 - 0.02), 0.2, 0)), frame)
    m.box((w, 0.03, d), (0, seat - 0.03, 0), frame, solid=False)
    if kind != 1:
        m.add(soft_box((w - 0.01, 0.05, d - 0.05), (0, seat - 0.025, 0.02), 0.022), style.second_cloth)
    m.solid((w, 0.045, d), (0, seat - 0.04, 0))
    _chair_back(m, style, frame, kind, w, d, seat, back)
    m.solid((w, back - seat - 0.01, 0.045), (0, seat + 0.01, -d / 2 + 0.02))
    m.seat = seat


def _legs(m: PieceBuilder, texture: Texture, width: float, depth: float, height: float, thick: float) -> None:
    for x in (-1, 1):
        for z in (-1, 1):
            m.box((thick, height, thick), (x * (width - thick) / 2, 0, z * (depth - thick) / 2), texture, skip="b")


def _chair_back(
    m: PieceBuilder, style: Style, frame: Texture, kind: int, w: float, d: float, seat: float, back: float
) -> None:
    z, rise = -d / 2 + 0.02, back - seat
    for x in (-1, 1):
        m.add(box((0.04, rise, 0.036), (x * (w - 0.04) / 2, seat, z)), frame)
    m.add(soft_box((w, 0.09, 0.034), (0, back - 0.09, z), 0.014), frame)
    if kind == 0:
        for k in range(5):
            m.add(box((0.03, rise - 0.08, 0.018), ((k - 2) * (w - 0.1) / 4.6, seat, z)), frame)
    elif kind == 1:
        for k in range(3):
            m.add(box((w - 0.05, 0.06, 0.02), (0, seat + 0.07 + k * (rise - 0.16) / 3, z)), frame)
    else:
        m.add(soft_box((w - 0.06, rise - 0.14, 0.045), (0, seat + 0.06, z + 0.01), 0.02), style.second_cloth)


@maker("chair", mass=9.0, friction=0.25)
def office_chair(m: PieceBuilder, style: Style) -> None:
    """Return a swivel chair on a star of five castors."""
    cover = style.choice(style.black, style.cloth)
    seat = style.between(0.45, 0.48)
    for k in range(5):
        arm = box((0.04, 0.035, 0.28), (0, 0.06, 0.14)).moved(turn=(0, 72.0 * k, 0))
        m.add(arm, style.black)
        m.add(ball(0.03, (0, 0, 0.27), segments=6).moved(turn=(0, 72.0 * k, 0)), style.black)
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
    m.seat = seat


@maker("chair", mass=3.5, friction=0.5)
def stool(m: PieceBuilder, style: Style) -> None:
    """Return a round stool on four splayed legs."""
    seat = style.between(0.44, 0.48)
    m.add(post(0.17, 0.035, (0, seat - 0.035, 0), segments=16), style.wood, "hull")
    for x in (-1, 1):
        for z in (-1, 1):
            m.add(tube([(x * 0.15, 0.0, z * 0.15), (x * 0.1, seat - 0.03, z * 0.1)], 0.015), style.wood)
    m.solid((0.3, seat - 0.06, 0.3), (0, 0.005, 0))
    m.seat = seat


@maker("bench")
def bench(m: PieceBuilder, style: Style) -> None:
    """Return a bench for the hall, with space for shoes below."""
    w, d, h = style.between(0.8, 1.1), 0.32, 0.44
    m.box((w, 0.04, d), (0, h - 0.06, 0), style.wood)
    m.add(soft_box((w - 0.02, 0.04, d - 0.02), (0, h - 0.03, 0), 0.018), style.cloth)
    for x in (-1, 1):
        m.box((0.04, h - 0.06, d), (x * (w / 2 - 0.03), 0, 0), style.wood)
    m.box((w - 0.06, 0.02, d - 0.04), (0, 0.16, 0), style.wood)
