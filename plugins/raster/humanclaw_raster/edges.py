"""Smooth the edges of faces with their exact place between two pixels (geometric anti-aliasing, Persson 2011)."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from humanclaw.world import compiled, inlined, internal
from humanclaw_raster.buffers import HALF, ONE, TWO, ZERO, GBuffer, Pinhole
from humanclaw_raster.packing import Floats
from humanclaw_raster.surfaces import FLAT

ALIKE: Final = 24
"""Neighbours whose channels differ by less than this in total are not mixed."""


def soften(pinhole: Pinhole, gbuffer: GBuffer, rgb: NDArray[np.uint8]) -> None:
    """Mix the colours of pixels on both sides of an edge, as the edge divides the pixel that it crosses.

    rgb: (H, W, 3), changed in place. A pixel with several edges is mixed with the neighbour that covers most of it.
    """
    _soften(np.float32(1 / pinhole.focal), *gbuffer, rgb.copy(), np.zeros(rgb.shape[:2], np.float32), rgb)


# Single arrays: a call that passes a tuple of arrays counts a reference to each.
@compiled
def _soften(
    scale: np.float32, depth: Floats, surface: NDArray[np.int32], faces: NDArray[np.int32], table: Floats,
    before: NDArray[np.uint8], covered: Floats, rgb: NDArray[np.uint8],
) -> None:  # fmt: skip
    height, width = surface.shape
    for row in range(height):
        for column in range(width):
            number = surface[row, column]
            right = column + 1 < width and surface[row, column + 1] != number
            if right and _unlike(before, row, column, row, column + 1):
                _mix(scale, depth, surface, faces, table, before, covered, rgb, row, column, row, column + 1)
            below = row + 1 < height and surface[row + 1, column] != number
            if below and _unlike(before, row, column, row + 1, column):
                _mix(scale, depth, surface, faces, table, before, covered, rgb, row, column, row + 1, column)


@inlined
def _unlike(before: NDArray[np.uint8], row: int, column: int, row2: int, column2: int) -> bool:
    """Return whether the colours of two pixels differ. Most neighbours are alike, and a call of _mix takes longer."""
    apart = np.int64(0)
    for channel in range(3):  # As numbers with a sign: the compiler subtracts bytes without one.
        apart += abs(np.int64(before[row, column, channel]) - np.int64(before[row2, column2, channel]))
    return bool(apart >= ALIKE)


@internal
def _mix(
    scale: np.float32, depth: Floats, surface: NDArray[np.int32], faces: NDArray[np.int32], table: Floats,
    before: NDArray[np.uint8], covered: Floats, rgb: NDArray[np.uint8],
    row: int, column: int, row2: int, column2: int,
) -> None:  # fmt: skip
    """Mix one of two neighbours with the other, if the edge between them lies inside it.

    covered: (H, W) the share of each pixel that a neighbour has covered so far, changed in place.
    """
    first, second = surface[row, column], surface[row2, column2]
    if first >= 0 and second >= 0 and _bent(faces, table, first, second):
        return
    share = _reach(scale, depth, surface, faces, table, row, column, row2, column2) - HALF
    if share > HALF:  # A face that goes on lies behind the other.
        row, column, row2, column2 = row2, column2, row, column
        share = _reach(scale, depth, surface, faces, table, row, column, row2, column2) - HALF
    if share < ZERO:
        row, column, row2, column2, share = row2, column2, row, column, -share
    if share <= HALF and share > covered[row2, column2]:
        covered[row2, column2] = share
        for channel in range(3):
            own, other = np.float32(before[row2, column2, channel]), np.float32(before[row, column, channel])
            rgb[row2, column2, channel] = np.uint8(own + (other - own) * share + HALF)


@inlined
def _bent(faces: NDArray[np.int32], table: Floats, first: int, second: int) -> bool:
    """Return whether two surfaces are parts of one rounded shape, at 1 to 25 degrees to each other.

    Flat neighbours are not: a screen lies flat in its frame.
    """
    alike = np.float32(0)
    for axis in range(3):
        alike += table[first, FLAT + axis] * table[second, FLAT + axis]
    return bool(faces[first, 1] == faces[second, 1] and np.float32(0.9) < alike < np.float32(0.9998))


@internal
def _reach(
    scale: np.float32, depth: Floats, surface: NDArray[np.int32], faces: NDArray[np.int32], table: Floats,
    row: int, column: int, row2: int, column2: int,
) -> float:  # fmt: skip
    """Return how far the object in one pixel reaches towards the next pixel's middle, 0 to 1; 2 if it reaches it.

    Where a face ends, another face of the same object may go on that covers no pixel's middle on this line.
    """
    if surface[row, column] < 0:
        return TWO  # type: ignore[return-value]  # Numba's float is NumPy's.
    _, reach = _inside(scale, depth, surface, table, row, column, row, column, row2, column2)
    (height, width), down, aside = surface.shape, column2 - column, row2 - row
    owner, number = faces[surface[row, column], 1], surface[row, column]
    for step in (-1, 1):
        r, c = row + step * down, column + step * aside
        other = surface[r, c] if 0 <= r < height and 0 <= c < width else -1
        if reach < ONE and other >= 0 and other != number and faces[other, 1] == owner:
            enter, leave = _inside(scale, depth, surface, table, r, c, row, column, row2, column2)
            if enter < reach + np.float32(0.02) and leave > reach:
                reach = leave
    return reach  # type: ignore[no-any-return]  # Numba's float is NumPy's.


@inlined
def _inside(
    scale: np.float32, depth: Floats, surface: NDArray[np.int32], table: Floats,
    at_row: int, at_column: int, row: int, column: int, row2: int, column2: int,
) -> tuple[float, float]:  # fmt: skip
    """Return where the way from one pixel to the next enters and leaves the face that a third pixel shows.

    0 is the first pixel's middle, 1 the second's. A way that ends inside leaves at 2, one that misses the face at -1.
    """
    (height, width), s = surface.shape, table[np.uint64(surface[at_row, at_column])]
    left, top = np.float32(0.5 - width / 2), np.float32(0.5 - height / 2)
    x0, y0 = (np.float32(at_column) + left) * scale, (np.float32(at_row) + top) * scale
    x, y = (np.float32(column) + left) * scale, (np.float32(row) + top) * scale
    x2, y2 = (np.float32(column2) + left) * scale, (np.float32(row2) + top) * scale
    # Barycentric weights times inverse depth are linear in the picture.
    unit = depth[at_row, at_column] / (s[FLAT] * x0 + s[FLAT + 1] * y0 + s[FLAT + 2])
    w, w2 = unit * (s[FLAT] * x + s[FLAT + 1] * y + s[FLAT + 2]), unit * (s[FLAT] * x2 + s[FLAT + 1] * y2 + s[FLAT + 2])
    b, b2 = s[0] * w + s[1] * x + s[2] * y + s[3], s[0] * w2 + s[1] * x2 + s[2] * y2 + s[3]
    c, c2 = s[4] * w + s[5] * x + s[6] * y + s[7], s[4] * w2 + s[5] * x2 + s[6] * y2 + s[7]
    enter, leave = ZERO, TWO
    for here, there in ((b, b2), (c, c2), (w - b - c, w2 - b2 - c2)):
        if there < ZERO:
            leave = min(leave, here / (here - there)) if here > ZERO else min(leave, ZERO)
        elif here < ZERO:
            enter = max(enter, here / (here - there))
    return enter, leave  # type: ignore[return-value]  # Numba's float is NumPy's.
