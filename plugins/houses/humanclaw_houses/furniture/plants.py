"""Potted plants with five growth habits."""

from __future__ import annotations

import numpy as np

from humanclaw_houses import textures as t
from humanclaw_houses.piece_builder import PieceBuilder, maker
from humanclaw_houses.shapes import blade, post, tube, turned
from humanclaw_houses.style import Style
from humanclaw_houses.textures import Texture

GREENS: tuple[t.Colour, ...] = ((62, 118, 58), (84, 138, 66), (48, 100, 62), (104, 146, 78))
POTS: tuple[t.Colour, ...] = ((186, 104, 72), (232, 230, 224), (70, 76, 84), (160, 150, 136), (60, 98, 122))

Leaves = tuple[Texture, Texture, Texture]
"""Leaves of one plant: in the light, in the shade, and new ones."""


@maker("potted_plant")
def plant(m: PieceBuilder, style: Style, habit: int | None = None) -> None:
    """Return a plant on the floor, 0.7 to 1.6 m high. Its pot and stem collide, its leaves do not."""
    habit = int(style.rng.integers(5)) if habit is None else habit
    radius, height = style.between(0.14, 0.18), style.between(0.26, 0.34)
    _pot(m, style, radius, height)
    green = t.leaf(t.pick(style.rng, GREENS), style.rng)
    leaves = green, t.shaded(green, 0.62), t.shaded(green, 1.3)
    [_palm, _sword, _bush, _tree, _broad][habit](m, style, leaves, height - 0.03)


def _pot(m: PieceBuilder, style: Style, r: float, h: float) -> None:
    texture = t.plain(t.pick(style.rng, POTS), style.rng, 0.03)
    outer = [
        (0.7 * r, 0.0),
        (0.8 * r, 0.3 * h),
        (0.95 * r, 0.85 * h),
        (1.02 * r, 0.86 * h),
        (1.04 * r, h),
        (0.93 * r, h),
    ]
    shell = turned([*outer, (0.9 * r, h - 0.03)], segments=14, top=False)
    m.add(shell, texture)
    m.add(turned([(0.93 * r, h - 0.04), (0.93 * r, h - 0.03)], segments=14), t.plain((62, 46, 36), style.rng, 0.12))
    m.add(turned([(0.72 * r, 0.0), (1.04 * r, h)], segments=10), texture, "hull")


def _spread(style: Style, count: int) -> np.ndarray:
    """Return headings spread by the golden angle, as leaves grow, radians."""
    return np.arange(count) * 2.39996 + float(style.rng.uniform(0, 6.28))


def _palm(m: PieceBuilder, style: Style, leaves: Leaves, y: float) -> None:
    trunk = style.between(0.25, 0.5)
    m.add(post(0.03, trunk, (0, y, 0), 0.022), t.wood((120, 92, 62), style.rng), "box")
    for k, heading in enumerate(_spread(style, 22)):
        rise = 30.0 + 50.0 * (k % 4) / 3
        m.add(blade((0, y + trunk, 0), heading, style.between(0.4, 0.5), 0.11, rise, 85.0, 5), leaves[k % 3])


def _sword(m: PieceBuilder, style: Style, leaves: Leaves, y: float) -> None:
    for k, heading in enumerate(_spread(style, 15)):
        r = 0.02 + 0.06 * (k % 5) / 4
        base = (r * float(np.sin(heading)), y, r * float(np.cos(heading)))
        m.add(blade(base, heading, style.between(0.45, 0.8), 0.075, 84.0 - 14 * r / 0.08, 6.0, 3), leaves[k % 3])


def _bush(m: PieceBuilder, style: Style, leaves: Leaves, y: float) -> None:
    m.add(post(0.02, 0.2, (0, y, 0)), t.wood((96, 76, 52), style.rng))
    for k, heading in enumerate(_spread(style, 64)):
        up = (k + 0.5) / 64
        reach = 0.08 + 0.13 * float(np.sqrt(1 - (2 * up - 1) ** 2))
        base = (reach * 0.6 * float(np.sin(heading)), y + 0.06 + 0.42 * up, reach * 0.6 * float(np.cos(heading)))
        m.add(blade(base, heading, reach + 0.06, 0.1, 70.0 * up - 5, 50.0, 3), leaves[k % 3])


def _tree(m: PieceBuilder, style: Style, leaves: Leaves, y: float) -> None:
    trunk = style.between(0.5, 0.7)
    bark = t.wood((112, 86, 60), style.rng)
    m.add(post(0.022, trunk, (0, y, 0), 0.016), bark, "box")
    for k, heading in enumerate(_spread(style, 60)):
        up = (k + 0.5) / 60
        reach = 0.23 * float(np.sqrt(1 - (2 * up - 1) ** 2))
        base = (reach * float(np.sin(heading)), y + trunk - 0.12 + 0.5 * up, reach * float(np.cos(heading)))
        m.add(blade(base, heading, 0.18, 0.11, 55.0 * up - 20, 45.0, 3), leaves[k % 3])
        if k % 6 == 0:
            m.add(tube([(0, y + trunk - 0.1 + 0.1 * up, 0), base], 0.008, 5), bark)


def _broad(m: PieceBuilder, style: Style, leaves: Leaves, y: float) -> None:
    stalk = t.plain((88, 128, 70), style.rng)
    for k, heading in enumerate(_spread(style, 21)):
        lean, high = 0.08 + 0.14 * (k % 3) / 2, 0.2 + 0.5 * ((k * 8) % 21) / 20
        tip = (lean * float(np.sin(heading)), y + high, lean * float(np.cos(heading)))
        m.add(tube([(0, y, 0), tip], 0.007, 5), stalk)
        m.add(blade(tip, heading, style.between(0.22, 0.28), 0.2, 35.0, 75.0, 5), leaves[k % 3])
