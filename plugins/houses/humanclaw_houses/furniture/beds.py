"""Beds."""

from __future__ import annotations

import numpy as np

from humanclaw_houses import textures as t
from humanclaw_houses.piece_builder import PieceBuilder, maker
from humanclaw_houses.shapes import Chart, Shape, box, pillow, post, sheet, soft_box
from humanclaw_houses.style import Style
from humanclaw_houses.textures import Texture


@maker("bed")
def bed(m: PieceBuilder, style: Style, double: bool = True) -> None:
    """Return a made bed: frame, mattress, duvet turned back below the pillows, headboard at -Z."""
    frame = style.choice(style.wood, style.second_wood, style.white, style.cloth)
    width = style.between(1.4, 1.7) if double else style.between(0.9, 1.0)
    length, seat, gap = 2.0, style.between(0.48, 0.56), style.between(0.12, 0.16)
    board, z0 = style.between(0.95, 1.15), -length / 2 + 0.03
    m.add(box((width, seat - 0.2 - gap, length), (0, gap, 0.03)), frame)
    for side in (-1, 1):
        for z in (-1, 1):
            m.add(
                post(0.03, gap + 0.02, (side * (width / 2 - 0.08), 0, 0.03 + z * (length / 2 - 0.1))), style.second_wood
            )
    m.add(soft_box((width - 0.05, 0.2, length - 0.05), (0, seat - 0.23, 0.025), 0.06), style.linen)
    cover = t.pastel(style.checked() if style.chance(0.5) else style.fabric())
    foot = length / 2 + 0.03
    m.add(_drape(width + 0.012, foot - 1.36, foot, seat, 0.19), cover)
    m.add(_drape(width + 0.016, z0 + 0.5, z0 + 0.84, seat + 0.012, 0.19, hem=False), style.linen)
    count = 2 if double else 1
    for k in range(count):
        x = (k - (count - 1) / 2) * width * 0.47
        case = pillow((min(0.72, width * 0.46) if double else 0.66, 0.19, 0.46))
        m.add(case.moved((x, seat + 0.05, z0 + 0.28), (32, 0, 0)), style.linen)
    _headboard(m, frame, int(style.rng.integers(3)), width + 0.04, board, -length / 2)
    m.solid((width + 0.02, seat - gap, length), (0, gap, 0.03))
    m.solid((width + 0.04, board, 0.07), (0, 0, -length / 2 + 0.0))
    m.seat = seat


def _drape(width: float, z0: float, z1: float, top: float, drop: float, hem: bool = True) -> Shape:
    """Return a blanket over a mattress from z0 to z1, with folds where it hangs. hem: it also hangs over the foot."""
    grid = sheet((-1, 0, 0), (2, 0, 0), (0, 0, -1), (16, 12))
    across, along = grid.vertices[:, 0], 1 + grid.vertices[:, 2]
    (out, down), z = _over(np.abs(across), width / 2, drop), z0 + (z1 - z0) * along
    if hem:
        ahead, fallen = _over(along, z1 - z0, drop)
        z, down = z0 + ahead, np.maximum(down, fallen)
    x = np.sign(across) * (out + 0.006 * down / drop * (1 + np.sin(17 * z + 5 * np.sign(across))))
    crease = 0.005 * (np.sin(9 * x + 7 * z) + np.sin(13 * x - 11 * z) - 2)
    points = np.stack([x, top + crease - down * (1 + 0.04 * np.sin(8 * z + 3 * x)), z], -1)
    return Shape((Chart(points, grid.faces, grid.uv * [width / 2 + drop, z1 - z0 + drop]),))


def _over(share: np.ndarray, reach: float, drop: float) -> tuple[np.ndarray, np.ndarray]:
    """Return how far out and how far down points of a cloth are that hangs over a rounded edge at `reach`, metres."""
    gone = share * (reach + drop * 0.9) - (reach - 0.07)
    bent = np.clip(gone / 0.11, 0.0, 1.0) * np.pi / 2
    out = reach - 0.07 + np.where(gone < 0, gone, 0.07 * np.sin(bent))
    down = 0.07 * (1 - np.cos(bent)) + np.clip(gone - 0.11, 0, None)
    return out, down


def _headboard(m: PieceBuilder, texture: Texture, kind: int, width: float, height: float, z: float) -> None:
    if kind == 0:
        m.add(soft_box((width, height - 0.25, 0.07), (0, 0.25, z), 0.03), texture)
    elif kind == 1:
        for x in (-1, 1):
            m.add(box((0.06, height, 0.06), (x * (width / 2 - 0.03), 0, z)), texture)
        for k in range(3):
            m.add(box((width - 0.12, 0.13, 0.03), (0, 0.45 + k * (height - 0.5) / 3, z)), texture)
    else:
        for k in range(4):
            m.add(soft_box((width / 4 - 0.008, height - 0.3, 0.07), ((k - 1.5) * width / 4, 0.3, z), 0.03), texture)
