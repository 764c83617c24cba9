"""Lamps, rugs, pictures, curtains and mirrors. Most of them do not collide."""

from __future__ import annotations

import numpy as np

from humanclaw_houses import textures as t
from humanclaw_houses.piece_builder import PieceBuilder, maker
from humanclaw_houses.shapes import Chart, Shape, box, post, sheet, tube, turned
from humanclaw_houses.style import Style


def _shade(style: Style) -> t.Texture:
    return t.plain(t.pick(style.rng, ((250, 240, 214), (248, 248, 240), (240, 220, 180))), style.rng)


@maker("lamp")
def floor_lamp(m: PieceBuilder, style: Style) -> None:
    metal = style.choice(style.black, style.brass, style.steel)
    m.add(post(0.14, 0.02, segments=16), metal, "hull")
    m.add(post(0.013, 1.36, (0, 0.02, 0)), metal, "box")
    m.add(turned([(0.2, 1.3), (0.13, 1.58)], segments=14), _shade(style))


@maker("lamp", mass=1.2, friction=0.5)
def table_lamp(m: PieceBuilder, style: Style) -> None:
    """Return a lamp for a nightstand or a sideboard; it can be knocked over."""
    m.add(
        turned([(0.07, 0), (0.075, 0.02), (0.03, 0.06), (0.06, 0.14), (0.02, 0.24)], segments=8), style.paint(), "box"
    )
    m.add(turned([(0.13, 0.22), (0.085, 0.4)], segments=12), _shade(style))
    m.solid((0.18, 0.18, 0.18), (0, 0.22, 0))


@maker("ceiling_lamp")
def ceiling_lamp(m: PieceBuilder, style: Style, drop: float = 0.12) -> None:
    """Return a lamp that hangs from the ceiling, fixed at its top."""
    m.add(turned([(0.18, 0.0), (0.2, 0.02), (0.12, 0.1)], segments=12), _shade(style))
    m.add(post(0.012, drop, (0, 0.09, 0)), style.black)


@maker("rug")
def rug(m: PieceBuilder, style: Style, width: float, depth: float) -> None:
    """Return a rug. It does not collide."""
    accent, ground = t.pick(style.rng, t.ACCENTS), t.pick(style.rng, t.FABRICS)
    kind = style.rng.random()
    if kind < 0.5:
        texture = t.oriental(ground, accent, style.rng)
    elif kind < 0.75:
        texture = t.carpet(ground, style.rng)
    else:
        texture = t.stripes(ground, (228, 220, 204), style.rng, 6)
    m.box((width, 0.008, depth), (0, 0, 0), texture, solid=False, skip="b")


@maker("picture")
def picture(m: PieceBuilder, style: Style, width: float, height: float) -> None:
    """Return a framed picture, to hang on a wall."""
    m.add(box((width, height, 0.025), (0, 0, 0.0125)), style.choice(style.wood, style.black, style.white, style.brass))
    face = sheet((-width / 2 + 0.025, 0.025, 0.0265), (width - 0.05, 0, 0), (0, height - 0.05, 0))
    m.add(Shape((face,)), t.painting(style.rng))


@maker("mirror")
def mirror(m: PieceBuilder, style: Style, width: float = 0.55, height: float = 0.75) -> None:
    m.add(box((width, height, 0.02), (0, 0, 0.01)), style.choice(style.wood, style.chrome, style.black))
    face = sheet((-width / 2 + 0.02, 0.02, 0.0215), (width - 0.04, 0, 0), (0, height - 0.04, 0))
    m.add(Shape((face,)), t.glass(style.rng))


@maker("curtain")
def curtain(m: PieceBuilder, style: Style, width: float, height: float, texture: t.Texture) -> None:
    """Return two gathered curtains at the sides of a window, and the rod above it. width: of the window."""
    for side in (-1, 1):
        m.add(Shape((folds(side * (width / 2 + 0.06), 0.32, height),)), texture)
    m.add(tube([(-width / 2 - 0.3, height + 0.015, 0.07), (width / 2 + 0.3, height + 0.015, 0.07)], 0.012), style.black)


def folds(x: float, width: float, height: float) -> Chart:
    """Return gathered cloth centred on x, 7 cm in front of z = 0."""
    grid = sheet((x - width / 2, 0, 0.07), (width, 0, 0), (0, height, 0), (16, 1))
    wave = 0.025 * np.sin((grid.vertices[:, 0] - x) / width * 8 * np.pi)
    return Chart(grid.vertices + wave[:, None] * np.array([0, 0, 1.0]), grid.faces, grid.uv)
