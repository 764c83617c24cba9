"""Small objects that can be pushed, kicked and knocked over."""

from __future__ import annotations

from humanclaw_houses import textures as t
from humanclaw_houses.piece_builder import PieceBuilder, maker
from humanclaw_houses.shapes import Ring, ball, box, loft, post, soft_box, tube, turned
from humanclaw_houses.style import Style


@maker("cup", mass=0.3, friction=0.4)
def cup(m: PieceBuilder, style: Style) -> None:
    texture = style.paint()
    m.add(turned([(0.032, 0), (0.04, 0.09), (0.035, 0.09), (0.03, 0.02)], segments=12), texture, "hull")
    m.add(tube([(0.038, 0.075, 0), (0.062, 0.06, 0), (0.058, 0.03, 0), (0.036, 0.025, 0)], 0.006, 5), texture)


@maker("bottle", mass=0.8, friction=0.4)
def bottle(m: PieceBuilder, style: Style) -> None:
    texture = t.plain(t.pick(style.rng, ((50, 92, 60), (90, 56, 36), (176, 206, 214), (40, 70, 110))), style.rng)
    m.add(turned([(0.036, 0), (0.037, 0.17), (0.015, 0.22), (0.014, 0.27)], segments=12), texture, "hull")
    m.add(turned([(0.0375, 0.05), (0.0375, 0.13)], segments=12), style.linen)
    m.add(post(0.016, 0.025, (0, 0.268, 0)), style.brass)


@maker("vase", mass=1.0, friction=0.4)
def vase(m: PieceBuilder, style: Style) -> None:
    """Return a vase with a few flowers."""
    m.add(
        turned([(0.05, 0), (0.075, 0.08), (0.05, 0.17), (0.035, 0.2), (0.045, 0.23)], segments=14),
        style.paint(),
        "hull",
    )
    stalk = t.plain((84, 124, 70), style.rng)
    head = t.plain(t.pick(style.rng, ((224, 90, 110), (240, 200, 80), (236, 236, 240))), style.rng)
    for k in range(5):
        x, z = 0.06 * ((k * 2) % 5 - 2) / 2, 0.06 * ((k * 3) % 5 - 2) / 2
        m.add(tube([(0, 0.2, 0), (x, 0.34 + 0.02 * (k % 3), z)], 0.004, 4), stalk)
        m.add(ball(0.028, (x, 0.33 + 0.02 * (k % 3), z), (1, 0.8, 1), 8), head)


@maker("book", mass=0.8, friction=0.5)
def book(m: PieceBuilder, style: Style) -> None:
    """Return one book, or a pile of three."""
    y = 0.0
    for k in range(1 if style.chance(0.5) else 3):
        h = style.between(0.02, 0.04)
        m.add(box((0.21 - 0.02 * k, h, 0.15 - 0.01 * k), (0, y, 0)), style.paint())
        m.add(box((0.2 - 0.02 * k, h - 0.01, 0.004), (0.005, y + 0.005, 0.075 - 0.005 * k)), style.linen)
        y += h
    m.solid((0.21, y, 0.15), (0, 0, 0))


@maker("bowl", mass=1.1, friction=0.5)
def bowl(m: PieceBuilder, style: Style) -> None:
    """Return a bowl of fruit."""
    m.add(
        turned([(0.06, 0), (0.12, 0.06), (0.14, 0.09), (0.13, 0.09), (0.09, 0.05)], segments=16), style.ceramic, "hull"
    )
    for k, colour in enumerate(((206, 60, 50), (236, 160, 50), (130, 170, 60), (226, 196, 70))):
        x, z = 0.055 * (1 - 2 * (k % 2)), 0.055 * (1 - k // 2 * 2)
        m.add(ball(0.042, (x, 0.05, z), segments=10), t.plain(colour, style.rng))


@maker("pot", mass=1.5, friction=0.4)
def pot(m: PieceBuilder, style: Style) -> None:
    """Return a cooking pot with a lid."""
    texture = style.choice(style.steel, style.black, style.paint())
    m.add(turned([(0.1, 0), (0.11, 0.02), (0.11, 0.13), (0.115, 0.135), (0.06, 0.16)], segments=16), texture, "hull")
    m.add(ball(0.018, (0, 0.158, 0), segments=8), style.black)
    for x in (-1, 1):
        m.add(box((0.05, 0.015, 0.06), (x * 0.125, 0.1, 0)), style.black)


@maker("box", friction=0.5)
def carton(m: PieceBuilder, style: Style) -> None:
    """Return a cardboard box with tape over its lid."""
    w, h, d = style.between(0.28, 0.42), style.between(0.22, 0.34), style.between(0.25, 0.34)
    m.box((w, h, d), (0, 0, 0), t.plain((190, 150, 104), style.rng, 0.03))
    m.add(box((w + 0.002, 0.002, 0.05), (0, h, 0)), t.plain((214, 190, 150), style.rng))
    m.mass = round(150 * w * h * d, 1)


@maker("ball", mass=0.4, friction=0.6)
def toy_ball(m: PieceBuilder, style: Style) -> None:
    r = style.between(0.1, 0.13)
    texture = t.stripes(t.pick(style.rng, t.ACCENTS), (240, 236, 226), style.rng, 3)
    m.add(ball(r, segments=16), texture, "hull")


@maker("basket", mass=2.0, friction=0.5)
def basket(m: PieceBuilder, style: Style) -> None:
    """Return a wicker basket with folded cloth in it."""
    wicker = t.checks((190, 150, 100), (150, 112, 70), style.rng, 8)
    m.add(turned([(0.16, 0), (0.2, 0.28), (0.18, 0.28), (0.16, 0.2)], segments=16), wicker, "hull")
    m.add(soft_box((0.22, 0.08, 0.22), (0, 0.19, 0), 0.035), style.linen)


@maker("bin", mass=1.0, friction=0.5)
def bin_(m: PieceBuilder, style: Style) -> None:
    texture = style.choice(style.steel, style.black, style.white)
    m.add(turned([(0.11, 0), (0.13, 0.3), (0.12, 0.3), (0.1, 0.04)], segments=14), texture, "hull")


@maker("shoe", mass=0.4, friction=0.7)
def shoe(m: PieceBuilder, style: Style) -> None:
    """Return one shoe."""
    texture = style.paint()
    m.add(soft_box((0.1, 0.025, 0.27), (0, 0, 0), 0.012), style.white)
    upper = [
        Ring(0.02, 0.046, 0.128, 3.5),
        Ring(0.06, 0.045, 0.115, 3, z=-0.01),
        Ring(0.085, 0.036, 0.06, 2.5, z=-0.055),
    ]
    m.add(loft(upper, 12), texture)
    m.add(loft([Ring(0.086, 0.028, 0.045, 2.5, z=-0.06), Ring(0.087, 0.02, 0.04, 2, z=-0.06)], 10), style.black)
    m.solid((0.1, 0.08, 0.27), (0, 0, 0))


@maker("teddy_bear", mass=0.5, friction=0.8)
def teddy(m: PieceBuilder, style: Style) -> None:
    """Return a sitting teddy bear."""
    fur = t.carpet(t.pick(style.rng, ((156, 108, 66), (206, 170, 124), (120, 84, 60))), style.rng)
    m.add(ball(0.1, (0, 0, 0), (1, 1.1, 0.9), 10), fur)
    m.add(ball(0.075, (0, 0.19, 0), segments=10), fur)
    for x in (-1, 1):
        m.add(ball(0.028, (x * 0.055, 0.3, 0), segments=8), fur)
        m.add(ball(0.04, (x * 0.07, 0, 0.11), (0.9, 0.9, 1.5), 8), fur)
        m.add(ball(0.035, (x * 0.11, 0.09, 0.04), (0.9, 1.4, 0.9), 8), fur)
        m.add(ball(0.009, (x * 0.028, 0.27, 0.065), segments=6), style.black)
    m.add(ball(0.03, (0, 0.22, 0.055), (1, 0.8, 1), 8), style.linen)
    m.solid((0.24, 0.33, 0.26), (0, 0, 0.035))


@maker("toy", mass=0.3, friction=0.6)
def toy_block(m: PieceBuilder, style: Style) -> None:
    m.box((0.1, 0.1, 0.1), (0, 0, 0), style.paint())


@maker("toy", mass=0.5, friction=0.4)
def toy_car(m: PieceBuilder, style: Style) -> None:
    texture = style.paint()
    m.add(soft_box((0.12, 0.06, 0.24), (0, 0.025, 0), 0.02), texture)
    m.add(soft_box((0.1, 0.05, 0.12), (0, 0.08, -0.01), 0.02), style.chrome)
    for x in (-1, 1):
        for z in (-1, 1):
            m.add(post(0.03, 0.02, segments=10).moved((x * 0.055 + 0.01, 0.03, z * 0.07), (0, 0, 90)), style.black)
    m.solid((0.12, 0.12, 0.24), (0, 0.0, 0))


@maker("clock", mass=0.3, friction=0.5)
def clock(m: PieceBuilder, style: Style) -> None:
    """Return an alarm clock."""
    m.box((0.12, 0.09, 0.06), (0, 0, 0), style.paint())
    m.add(box((0.1, 0.07, 0.004), (0, 0.01, 0.03)), style.white)
    m.add(box((0.006, 0.03, 0.002), (0, 0.045, 0.034)), style.black)
    m.add(box((0.022, 0.006, 0.002), (0.011, 0.042, 0.034)), style.black)


@maker("soap", mass=0.3, friction=0.4)
def soap(m: PieceBuilder, style: Style) -> None:
    """Return a soap dispenser."""
    m.add(turned([(0.03, 0), (0.032, 0.1), (0.012, 0.13)], segments=10), style.paint(), "hull")
    m.add(tube([(0, 0.13, 0), (0, 0.16, 0), (0, 0.16, 0.035)], 0.006, 5), style.chrome)


@maker("backpack", mass=3.0, friction=0.6)
def backpack(m: PieceBuilder, style: Style) -> None:
    texture = style.fabric()
    m.add(soft_box((0.3, 0.42, 0.16), (0, 0, 0), 0.06), texture)
    m.add(soft_box((0.24, 0.2, 0.07), (0, 0.03, 0.1), 0.03), texture)
    m.add(
        tube([(-0.05, 0.4, -0.04), (-0.03, 0.47, -0.04), (0.03, 0.47, -0.04), (0.05, 0.4, -0.04)], 0.01, 5), style.black
    )
    m.solid((0.3, 0.42, 0.22), (0, 0, 0.025))
