"""Staircases: two flights side by side with a half-landing, a rail between them and a guard above the lower flight."""

from __future__ import annotations

import math
from typing import Final

from humanclaw_houses.piece_builder import PieceBuilder, maker
from humanclaw_houses.plan import Stair
from humanclaw_houses.shapes import box
from humanclaw_houses.style import Style
from humanclaw_houses.textures import Texture

GUARD: Final = 0.92
"""Height of a handrail above the step, metres."""
_TREAD: Final = 0.035
"""Thickness of a tread, metres."""
_EDGE: Final = 0.045
"""Width of the strip along the edge of a tread, metres."""
_SPINE: Final = 0.1
"""Width of the spine between the flights, metres."""


@maker("stairs")
def staircase(m: PieceBuilder, style: Style, stair: Stair, width: float, depth: float, wall: Texture) -> None:
    """Build a staircase on a floor of width x depth metres. Its front (+Z) is the entrance on both floors.

    The steps are solid down to the floor. Its hulls are the steps, the landing, the spine and rail between the flights,
    and the guard at the front above the lower flight.
    """
    flight = (width - _SPINE) / 2
    # Seen from the hall, along -Z, left is -X.
    lower = (-1 if stair.left else 1) * (flight + _SPINE) / 2
    front = depth / 2
    for k in range(1, stair.steps):
        near, far = front - (k - 1) * stair.going, front - k * stair.going
        _step(m, style, wall, (flight, k * stair.riser), lower, near, far, 1)
        _step(m, style, wall, (flight, (2 * stair.steps - k) * stair.riser), -lower, near, far, -1)
        _between(m, style, stair, wall, (2 * stair.steps - k) * stair.riser, near, far)
    edge = front - (stair.steps - 1) * stair.going
    _landing(m, style, wall, width, stair.steps * stair.riser, -front, edge)
    _rail(m, style, stair, front, edge)
    _guard(m, style, stair, flight, lower, front)


def _step(
    m: PieceBuilder,
    style: Style,
    wall: Texture,
    size: tuple[float, float],
    x: float,
    near: float,
    far: float,
    front: int,
) -> None:
    """Build one step: a white riser that faces +Z (front 1) or -Z, a wooden tread, and plastered sides.

    A strip along the edge of the tread makes the steps visible from above.
    """
    w, h = size
    d, z = near - far, (near + far) / 2
    m.add(box((w, h - _TREAD, d), (x, 0, z), "tbfk"), wall)
    m.add(box((w, h - _TREAD, d), (x, 0, z), "tblr" + ("k" if front > 0 else "f")), style.white)
    m.add(box((w, h - _TREAD, d), (x, 0, z), "tblr" + ("f" if front > 0 else "k")), wall)
    m.add(box((w, _TREAD, d + 0.02), (x, h - _TREAD, z + 0.01 * front)), style.wood)
    m.add(box((w, 0.002, _EDGE), (x, h, z + front * (d / 2 + 0.01 - _EDGE / 2)), "b"), _edging(style))
    m.solid((w, h, d), (x, 0, z))


def _edging(style: Style) -> Texture:
    """Return the texture of the edges: dark on light wood, light on dark wood."""
    return style.black if float(style.wood.pixels.mean()) > 95 else style.white


def _between(
    m: PieceBuilder, style: Style, stair: Stair, wall: Texture, height: float, near: float, far: float
) -> None:
    """Build the spine between the flights, as high as the upper flight, and two bars of the rail."""
    d, z = near - far, (near + far) / 2
    m.add(box((_SPINE, height, d), (0, 0, z), "b"), wall)
    m.solid((_SPINE, height + GUARD, d), (0, 0, z))
    for share in (0.25, 0.75):
        top = height + GUARD - 0.04 + (share - 0.5) * stair.riser
        m.add(box((0.025, top - height, 0.025), (0, height, far + share * d), "tb"), style.white)


def _landing(
    m: PieceBuilder, style: Style, wall: Texture, width: float, height: float, back: float, edge: float
) -> None:
    d, z = edge - back, (edge + back) / 2
    m.add(box((width, height - _TREAD, d), (0, 0, z), "tb"), style.white)
    m.add(box((width, _TREAD, d + 0.02), (0, height - _TREAD, z + 0.01)), style.wood)
    m.add(box((width, 0.002, _EDGE), (0, height, edge + 0.01 - _EDGE / 2), "b"), _edging(style))
    m.solid((width, height, d), (0, 0, z))


def _rail(m: PieceBuilder, style: Style, stair: Stair, front: float, edge: float) -> None:
    """Build the sloping handrail over the spine, with a newel post at each end."""
    top = 2 * stair.steps * stair.riser
    low, high = (stair.steps + 0.5) * stair.riser + GUARD, top - 0.5 * stair.riser + GUARD
    run, rise = front - edge, high - low
    bar = box((0.06, 0.05, math.hypot(run, rise)), (0, -0.025, 0))
    m.add(
        bar.moved((0, (low + high) / 2, (front + edge) / 2), (-math.degrees(math.atan2(rise, run)), 0, 0)), style.wood
    )
    m.add(box((0.09, GUARD + 0.16, 0.09), (0, low - GUARD - 0.5 * stair.riser, edge + 0.045)), style.wood)
    m.add(box((0.09, GUARD + 0.12 + stair.riser, 0.09), (0, top - stair.riser, front - 0.045)), style.wood)


def _guard(m: PieceBuilder, style: Style, stair: Stair, flight: float, lower: float, front: float) -> None:
    """Build the guard that keeps people on the upper floor from falling into the lower flight."""
    top, z = 2 * stair.steps * stair.riser, front - 0.04
    m.add(box((flight, 0.05, 0.06), (lower, top + GUARD - 0.05, z)), style.wood)
    m.add(box((flight, 0.12, 0.04), (lower, top - 0.12, z)), style.white)
    count = round(flight / 0.11)
    for k in range(count):
        x = lower + flight * ((k + 0.5) / count - 0.5)
        m.add(box((0.025, GUARD - 0.05, 0.025), (x, top, z), "tb"), style.white)
    m.solid((flight, GUARD + 0.12, 0.06), (lower, top - 0.12, z))
