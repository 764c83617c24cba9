"""Small things that stay where they are: on tables, worktops and shelves, beside doors, below windows.

They do not collide, so that a house full of them costs physics nothing. Things that a body pushes are in small.py.
"""

from __future__ import annotations

from humanclaw_houses import textures as t
from humanclaw_houses.piece_builder import PieceBuilder, maker
from humanclaw_houses.shapes import Shape, ball, box, post, sheet, soft_box, tube, turned
from humanclaw_houses.style import Style


@maker("plate")
def plate(m: PieceBuilder, style: Style) -> None:
    """Return a plate with knife and fork beside it."""
    m.add(turned([(0.07, 0.0), (0.125, 0.018), (0.12, 0.02), (0.07, 0.006)], segments=14), style.ceramic)
    for x in (-1, 1):
        m.add(box((0.018, 0.004, 0.2), (x * 0.155, 0, 0), "b"), style.steel)


@maker("glass")
def glass(m: PieceBuilder, style: Style) -> None:
    texture = t.plain((206, 222, 226), style.rng)
    m.add(turned([(0.028, 0), (0.034, 0.12), (0.031, 0.12), (0.026, 0.012)], segments=10), texture)


@maker("cup")
def mug(m: PieceBuilder, style: Style) -> None:
    texture = style.paint()
    m.add(turned([(0.038, 0), (0.04, 0.09), (0.035, 0.09), (0.033, 0.015)], segments=10), texture)
    m.add(tube([(0.039, 0.075, 0), (0.062, 0.06, 0), (0.058, 0.03, 0), (0.038, 0.02, 0)], 0.006, 4), texture)


@maker("kettle")
def kettle(m: PieceBuilder, style: Style) -> None:
    texture = style.choice(style.steel, style.white, style.black)
    m.add(turned([(0.085, 0), (0.09, 0.03), (0.065, 0.19), (0.02, 0.21)], segments=12), texture)
    m.add(tube([(-0.06, 0.17, 0), (-0.13, 0.16, 0), (-0.12, 0.05, 0), (-0.08, 0.04, 0)], 0.012, 5), style.black)
    m.add(tube([(0.06, 0.14, 0), (0.12, 0.18, 0)], 0.016, 6), texture)


@maker("toaster")
def toaster(m: PieceBuilder, style: Style) -> None:
    m.add(soft_box((0.28, 0.18, 0.16), (0, 0.01, 0), 0.03), style.choice(style.steel, style.white, style.paint()))
    for z in (-0.03, 0.03):
        m.add(box((0.2, 0.002, 0.025), (0, 0.191, z)), style.black)
    m.add(box((0.02, 0.03, 0.03), (0.145, 0.1, 0)), style.black)


@maker("microwave")
def microwave(m: PieceBuilder, style: Style) -> None:
    texture = style.choice(style.steel, style.white, style.black)
    m.add(box((0.46, 0.27, 0.34), (0, 0.01, 0)), texture)
    m.add(box((0.32, 0.2, 0.012), (-0.05, 0.045, 0.172), "k"), style.black)
    m.add(box((0.07, 0.02, 0.01), (0.17, 0.2, 0.172), "k"), style.black)
    m.add(post(0.01, 0.18, (0.12, 0.055, 0.19)), style.chrome)


@maker("jar")
def jar(m: PieceBuilder, style: Style) -> None:
    """Return a jar of pasta, rice or beans with a lid."""
    r, h = style.between(0.045, 0.06), style.between(0.12, 0.2)
    food = t.pick(style.rng, ((226, 196, 130), (232, 226, 208), (140, 84, 60), (196, 120, 70)))
    m.add(turned([(r, 0), (r, 0.85 * h), (0.8 * r, 0.9 * h)], segments=10), t.plain(food, style.rng, 0.08))
    m.add(post(0.85 * r, 0.025, (0, 0.88 * h, 0), segments=10), style.choice(style.wood, style.steel, style.black))


@maker("bread")
def board(m: PieceBuilder, style: Style) -> None:
    """Return a chopping board with a loaf of bread."""
    m.add(box((0.36, 0.02, 0.24), (0, 0, 0)), style.wood)
    m.add(soft_box((0.22, 0.09, 0.1), (0, 0.02, 0), 0.04), t.plain((186, 130, 72), style.rng, 0.08))


@maker("pan")
def pan(m: PieceBuilder, style: Style) -> None:
    m.add(turned([(0.1, 0), (0.125, 0.045), (0.12, 0.045), (0.095, 0.008)], segments=14), style.black)
    m.add(box((0.024, 0.016, 0.18), (0, 0.035, 0.21)), style.black)


@maker("dish_rack")
def dish_rack(m: PieceBuilder, style: Style) -> None:
    """Return a drainer with four plates on edge and a cup."""
    m.add(box((0.36, 0.03, 0.26), (0, 0, 0), "t"), style.steel)
    for k in range(4):
        disc = post(0.105, 0.012, segments=12).moved((-0.1 + 0.05 * k, 0.12, 0), (0, 0, 80))
        m.add(disc, style.ceramic)
    m.add(turned([(0.04, 0.03), (0.034, 0.12)], (0.13, 0, 0.05), 10), style.paint())


@maker("photo")
def frame(m: PieceBuilder, style: Style) -> None:
    """Return a photograph in a frame that stands."""
    w, h = style.between(0.13, 0.2), style.between(0.16, 0.22)
    shape = box((w, h, 0.015)) + Shape((sheet((-w / 2 + 0.015, 0.015, 0.008), (w - 0.03, 0, 0), (0, h - 0.03, 0)),))
    m.add(Shape(shape.charts[:6]).moved((0, 0.003, 0), (-12, 0, 0)), style.choice(style.wood, style.black, style.brass))
    m.add(Shape(shape.charts[6:]).moved((0, 0.003, 0), (-12, 0, 0)), t.painting(style.rng))


@maker("books")
def books(m: PieceBuilder, style: Style) -> None:
    """Return a row of upright books."""
    w = style.between(0.18, 0.34)
    m.add(box((w, 0.21, 0.15), (0, 0, -0.002), "bf"), style.second_wood)
    m.add(Shape((sheet((-w / 2, 0, 0.075), (w, 0, 0), (0, 0.24, 0)),)), t.books(style.rng))


@maker("magazines")
def magazines(m: PieceBuilder, style: Style) -> None:
    """Return a pile of magazines and a remote control."""
    for k in range(3):
        sheaf = box((0.21, 0.008, 0.28), (0, 0.008 * k, 0)).moved(turn=(0, 9.0 * (k - 1), 0))
        m.add(sheaf, style.paint())
    m.add(box((0.045, 0.018, 0.16), (0.17, 0, 0.02)), style.black)


@maker("candle")
def candle(m: PieceBuilder, style: Style) -> None:
    m.add(post(0.05, 0.012, segments=12), style.brass)
    m.add(post(0.03, style.between(0.08, 0.16), (0, 0.012, 0), segments=10), style.linen)


@maker("storage_box")
def casket(m: PieceBuilder, style: Style) -> None:
    """Return a storage box with a lid."""
    texture = style.choice(style.wood, style.paint(), style.linen)
    w, h, d = style.between(0.2, 0.3), style.between(0.1, 0.2), style.between(0.16, 0.22)
    m.add(box((w, h, d)), texture)
    m.add(box((w + 0.012, 0.03, d + 0.012), (0, h, 0)), t.shaded(texture, 0.85))


@maker("succulent")
def small_plant(m: PieceBuilder, style: Style) -> None:
    """Return a succulent in a small pot. It is no target: it is called by another name than plants on the floor."""
    m.add(turned([(0.04, 0), (0.06, 0.09), (0.05, 0.09)], segments=10), style.choice(style.ceramic, style.paint()))
    leaf = t.plain((92, 140, 84), style.rng, 0.05)
    for k in range(7):
        spike = ball(0.035, (0, 0.07, 0.02), (0.5, 1.6, 0.5), 6).moved(turn=(24.0 if k else 0.0, 51.4 * k, 0))
        m.add(spike, leaf)


@maker("papers")
def papers(m: PieceBuilder, style: Style) -> None:
    """Return sheets of paper, a notebook and a pen."""
    for k in range(2):
        m.add(box((0.21, 0.002, 0.297), (0.02 * k, 0.002 * k, 0)).moved(turn=(0, 8.0 * k, 0)), style.white)
    m.add(box((0.15, 0.014, 0.21), (-0.19, 0, 0.02)), style.paint())
    m.add(box((0.01, 0.008, 0.14), (-0.19, 0.014, 0.02)).moved(turn=(0, 20, 0)), style.black)


@maker("pens")
def pens(m: PieceBuilder, style: Style) -> None:
    m.add(turned([(0.038, 0), (0.04, 0.1), (0.035, 0.1)], segments=10), style.choice(style.black, style.steel))
    for k in range(4):
        lean = 0.02 * (k - 1.5)
        m.add(tube([(lean, 0.03, 0), (1.8 * lean, 0.16 + 0.01 * (k % 2), 0.01 * (k % 2))], 0.004, 4), style.paint())


@maker("speaker")
def speaker(m: PieceBuilder, style: Style) -> None:
    m.add(box((0.16, 0.26, 0.18)), style.choice(style.black, style.wood))
    for y, r in ((0.09, 0.055), (0.2, 0.028)):
        m.add(post(r, 0.008, segments=12).moved((0, y, 0.09), (90, 0, 0)), t.plain((60, 60, 64), style.rng, 0.05))


@maker("desk_lamp")
def desk_lamp(m: PieceBuilder, style: Style) -> None:
    texture = style.choice(style.black, style.white, style.paint())
    m.add(post(0.085, 0.02, segments=12), texture)
    m.add(tube([(0, 0.02, 0), (0, 0.24, -0.07), (0, 0.4, 0.06)], 0.008, 5), style.steel)
    m.add(turned([(0.075, 0), (0.03, 0.1)], segments=12).moved((0, 0.32, 0.07), (-24, 0, 0)), texture)


@maker("towels")
def towels(m: PieceBuilder, style: Style) -> None:
    """Return a pile of folded towels."""
    for k in range(3):
        m.add(soft_box((0.3, 0.06, 0.2), (0, 0.058 * k, 0), 0.025), style.choice(style.linen, style.cloth))


@maker("toiletries")
def toiletries(m: PieceBuilder, style: Style) -> None:
    """Return two bottles and a mug with toothbrushes."""
    for k, (r, h) in enumerate(((0.024, 0.16), (0.03, 0.12))):
        texture = style.paint()
        m.add(turned([(r, 0), (r, 0.8 * h), (0.4 * r, 0.9 * h), (0.4 * r, h)], (-0.07 + 0.065 * k, 0, 0), 10), texture)
    m.add(turned([(0.03, 0), (0.034, 0.09), (0.03, 0.09)], (0.07, 0, 0), 10), style.ceramic)
    for k in (-1, 1):
        m.add(tube([(0.07, 0.02, 0.01 * k), (0.07 + 0.03 * k, 0.18, 0.012 * k)], 0.004, 4), style.paint())


@maker("detergent")
def detergent(m: PieceBuilder, style: Style) -> None:
    texture = style.paint()
    m.add(soft_box((0.17, 0.22, 0.09), (0, 0, 0), 0.03), texture)
    m.add(post(0.025, 0.05, (0.04, 0.22, 0), segments=8), style.white)


@maker("bath_shelf")
def bath_shelf(m: PieceBuilder, style: Style) -> None:
    """Return a board on the wall of a bathroom, for what stands beside a basin."""
    w = style.between(0.4, 0.6)
    m.add(box((w, 0.018, 0.15), (0, 0, 0)), style.choice(style.wood, style.white))
    m.surface(w - 0.02, 0.15, 0.018, room=0.4)


@maker("shoes")
def shoes(m: PieceBuilder, style: Style) -> None:
    """Return a pair of shoes."""
    texture = style.paint()
    for x in (-0.065, 0.065):
        m.add(soft_box((0.095, 0.025, 0.27), (x, 0, 0), 0.012), style.white)
        m.add(soft_box((0.088, 0.045, 0.25), (x, 0.024, -0.005), 0.02), texture)
        m.add(soft_box((0.08, 0.04, 0.12), (x, 0.066, -0.065), 0.02), texture)


@maker("handbag")
def handbag(m: PieceBuilder, style: Style) -> None:
    texture = style.choice(t.leather(t.pick(style.rng, t.LEATHERS), style.rng), style.black)
    m.add(soft_box((0.34, 0.26, 0.13), (0, 0, 0), 0.04), texture)
    m.add(tube([(-0.09, 0.25, 0), (-0.07, 0.38, 0), (0.07, 0.38, 0), (0.09, 0.25, 0)], 0.01, 5), texture)


@maker("radiator")
def radiator(m: PieceBuilder, style: Style, width: float) -> None:
    """Return a flat ribbed radiator with its valve, to hang below a window. It collides."""
    m.add(box((width, 0.5, 0.02), (0, 0, -0.01)), style.white)
    for k in range(count := round(width / 0.07)):
        m.add(box((0.045, 0.48, 0.02), ((k + 0.5) * width / count - width / 2, 0.01, 0.01), "kb"), style.white)
    m.add(tube([(width / 2, 0.06, 0), (width / 2 + 0.04, 0.06, 0), (width / 2 + 0.04, -0.1, 0)], 0.01, 5), style.white)
    m.solid((width, 0.5, 0.04), (0, 0, 0))


@maker("switch")
def switch(m: PieceBuilder, style: Style) -> None:
    m.add(box((0.08, 0.08, 0.01), (0, 0, 0.005), "k"), style.white)
    m.add(box((0.05, 0.05, 0.006), (0, 0.015, 0.012), "k"), style.ceramic)
