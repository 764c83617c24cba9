"""Parts of furniture that opens: carcasses, doors, drawers and lids. A piece stands on height 0, its front at +Z."""

from __future__ import annotations

from typing import Final

import numpy as np

from humanclaw.world import Hinge, Slide
from humanclaw_houses.piece_builder import PieceBuilder
from humanclaw_houses.shapes import Point, box
from humanclaw_houses.textures import Texture

BOARD: Final = 0.018
"""Thickness of boards, metres."""
PLAY: Final = 0.004
"""Gap around doors and drawers, metres."""
_OPEN: Final = float(np.pi / 2)
"""A quarter turn: doors end square to the front, clear of the neighbour's."""
_DENSITY: Final = 650.0
"""Of chipboard, kg/m3."""


def carcass(m: PieceBuilder, size: Point, at: Point, texture: Texture, shelves: int = 0, *, roof: bool = True) -> None:
    """Add a box that is open at the front, with shelves at equal heights. at: the centre of its underside.

    roof: whether a board closes it above. Things can stand on its shelves, and on its floor if it has shelves.
    """
    (w, h, d), (x, y, z) = size, at
    for side in (-1, 1):
        m.box((BOARD, h, d), (x + side * (w - BOARD) / 2, y, z), texture)
    inner = w - 2 * BOARD
    each = (h - BOARD) / (shelves + 1)
    for k in range(shelves + 1 + roof):
        m.box((inner, BOARD, d), (x, y + k * each, z), texture)
        if shelves and k <= shelves:
            m.surface(inner, d - 0.06, y + k * each + BOARD, x, z, each - 0.05, inside=True)
    m.box((inner, h - 2 * BOARD, BOARD), (x, y + BOARD, z - (d - BOARD) / 2), texture)


def door(m: PieceBuilder, size: Point, at: Point, texture: Texture, grip: Texture, left: bool = True) -> PieceBuilder:
    """Add a door. at: the centre of its underside; left: whether its hinge is at -X. It opens by 90 degrees about the
    front edge there, so that it passes what stands beside it."""
    (w, h, d), (x, y, z) = size, at
    side = -1 if left else 1
    low, high = (-_OPEN, 0.0) if left else (0.0, _OPEN)
    leaf = m.hinged_part(Hinge((x + side * w / 2, y, z + d / 2), low, high, 1.5, 2.0), round(_DENSITY * w * h * d, 2))
    leaf.box((w - PLAY, h - PLAY, d), (x, y + PLAY / 2, z), texture)
    leaf.add(box((0.014, min(0.3, h / 3), 0.025), (x - side * (w / 2 - 0.05), y + h / 2, z + d / 2 + 0.012)), grip)
    return leaf


def lid(m: PieceBuilder, size: Point, at: Point, texture: Texture, grip: Texture) -> PieceBuilder:
    """Add a lid that opens downwards about its lower edge, as those of ovens and dishwashers do."""
    (w, h, d), (x, y, z) = size, at
    hinge = Hinge((x, y, z + d / 2), 0.0, _OPEN, 1.5, 4.0, axis=(1.0, 0.0, 0.0))
    leaf = m.hinged_part(hinge, round(2 * _DENSITY * w * h * d, 2))
    leaf.box((w - PLAY, h - PLAY, d), (x, y + PLAY / 2, z), texture)
    leaf.add(box((w - 0.12, 0.02, 0.03), (x, y + h - 0.07, z + d / 2 + 0.015)), grip)
    return leaf


def drawer(m: PieceBuilder, size: Point, at: Point, texture: Texture, grip: Texture) -> PieceBuilder:
    """Add a drawer that comes out by three quarters of its depth. size: its front's width and height, and its depth;
    at: the centre of its underside."""
    (w, h, d), (x, y, z) = size, at
    leaf = m.hinged_part(
        Slide(0.0, round(0.75 * d, 3)), round(_DENSITY * BOARD * (2 * w * h + 2 * d * h / 2 + w * d), 2)
    )
    leaf.box((w - PLAY, h - PLAY, BOARD), (x, y + PLAY / 2, z + (d - BOARD) / 2), texture)
    inner, deep, low = w - 2 * BOARD - 2 * PLAY, d - BOARD - 0.02, y + 0.01
    middle = z - 0.01 - PLAY
    leaf.box((inner, 0.008, deep), (x, low, middle), texture)
    for side in (-1, 1):
        leaf.box((0.012, 0.6 * h, deep), (x + side * (inner - 0.012) / 2, low, middle), texture)
    leaf.box((inner, 0.6 * h, 0.012), (x, low, middle - (deep - 0.012) / 2), texture)
    leaf.add(box((min(0.16, w / 2), 0.012, 0.025), (x, y + 0.6 * h, z + d / 2 + 0.012)), grip)
    return leaf
