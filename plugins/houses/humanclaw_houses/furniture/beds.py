"""Beds."""

from __future__ import annotations

from humanclaw_houses.model import Model, Piece
from humanclaw_houses.shapes import Ring, Shape, box, loft, post, soft_box
from humanclaw_houses.style import Style
from humanclaw_houses.textures import Tile


def bed(style: Style, name: str, double: bool = True) -> Piece:
    """Return a made bed: frame, mattress, duvet turned back below the pillows, headboard at -Z."""
    m = Model()
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
    m.add(soft_box((width - 0.02, 0.2, length - 0.02), (0, seat - 0.23, 0.03), 0.05), style.linen)
    cover = style.fabric()
    m.add(soft_box((width + 0.03, 0.2, 1.36), (0, seat - 0.2, length / 2 - 0.65), 0.05), cover)
    m.add(soft_box((width + 0.035, 0.075, 0.3), (0, seat - 0.068, z0 + 0.66), 0.034), style.linen)
    count = 2 if double else 1
    for k in range(count):
        x = (k - (count - 1) / 2) * width * 0.46
        m.add(
            _pillow(min(0.66, width * 0.43 if double else 0.6), 0.4).moved((x, seat - 0.04, z0 + 0.28), (14, 0, 0)),
            style.linen,
        )
    _headboard(m, frame, int(style.rng.integers(3)), width + 0.04, board, -length / 2)
    m.solid((width + 0.02, seat - gap, length), (0, gap, 0.03))
    m.solid((width + 0.04, board, 0.07), (0, 0, -length / 2 + 0.0))
    return m.piece(name, "bed", seat=seat)


def _pillow(width: float, depth: float) -> Shape:
    rings = [(0.0, 0.8), (0.015, 0.93), (0.05, 1.0), (0.085, 0.93), (0.115, 0.7), (0.13, 0.35)]
    return loft([Ring(y, width / 2 * s, depth / 2 * s, 4.0) for y, s in rings], 12)


def _headboard(m: Model, tile: Tile, kind: int, width: float, height: float, z: float) -> None:
    if kind == 0:
        m.add(soft_box((width, height - 0.25, 0.07), (0, 0.25, z), 0.03), tile)
    elif kind == 1:
        for x in (-1, 1):
            m.add(box((0.06, height, 0.06), (x * (width / 2 - 0.03), 0, z)), tile)
        for k in range(3):
            m.add(box((width - 0.12, 0.13, 0.03), (0, 0.45 + k * (height - 0.5) / 3, z)), tile)
    else:
        for k in range(4):
            m.add(soft_box((width / 4 - 0.008, height - 0.3, 0.07), ((k - 1.5) * width / 4, 0.3, z), 0.03), tile)
