"""Smooth the edges of faces with their exact place between two pixels (geometric anti-aliasing, Persson 2011)."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from humanclaw_raster.buffers import HALF, ZERO, GBuffer, Pinhole, compiled
from humanclaw_raster.packing import Floats
from humanclaw_raster.surfaces import FLAT

ALIKE: Final = 12
"""Neighbours whose channels differ by less than this in total are not mixed."""


@compiled
def soften(pinhole: Pinhole, gbuffer: GBuffer, rgb: NDArray[np.uint8]) -> None:
    """Mix the colours of pixels on both sides of an edge, as the edge divides the pixel that it crosses.

    rgb: (H, W, 3), changed in place. A pixel with several edges is mixed with the neighbour that covers most of it.
    """
    height, width = gbuffer.surface.shape
    before, covered = rgb.copy(), np.zeros((height, width), np.float32)
    for row in range(height):
        for column in range(width):
            number = gbuffer.surface[row, column]
            if column + 1 < width and gbuffer.surface[row, column + 1] != number:
                _mix(pinhole, gbuffer, before, covered, rgb, row, column, row, column + 1)
            if row + 1 < height and gbuffer.surface[row + 1, column] != number:
                _mix(pinhole, gbuffer, before, covered, rgb, row, column, row + 1, column)


@compiled
def _mix(
    pinhole: Pinhole, gbuffer: GBuffer, before: NDArray[np.uint8], covered: Floats, rgb: NDArray[np.uint8],
    row: int, column: int, row2: int, column2: int,
) -> None:  # fmt: skip
    """Mix one of two neighbours with the other, if the edge between them lies inside it.

    covered: (H, W) the share of each pixel that a neighbour has covered so far, changed in place.
    """
    apart = np.int32(0)
    for channel in range(3):
        apart += abs(int(before[row, column, channel]) - int(before[row2, column2, channel]))
    if apart < ALIKE:
        return
    if gbuffer.surface[row, column] < 0:
        row, column, row2, column2 = row2, column2, row, column
    share = _edge(pinhole, gbuffer, row, column, row2, column2) - HALF
    # A face that goes on lies behind the other.
    if share > HALF and gbuffer.surface[row2, column2] >= 0:
        row, column, row2, column2 = row2, column2, row, column
        share = _edge(pinhole, gbuffer, row, column, row2, column2) - HALF
    if share < ZERO:
        row, column, row2, column2, share = row2, column2, row, column, -share
    if share <= HALF and share > covered[row2, column2]:
        covered[row2, column2] = share
        for channel in range(3):
            own, other = np.float32(before[row2, column2, channel]), np.float32(before[row, column, channel])
            rgb[row2, column2, channel] = np.uint8(own + (other - own) * share + HALF)


@compiled
def _edge(pinhole: Pinhole, gbuffer: GBuffer, row: int, column: int, row2: int, column2: int) -> np.float32:
    """Return how far the face in one pixel reaches towards the next pixel's middle, 0 to 1; 2 if it reaches beyond."""
    (height, width), s = gbuffer.surface.shape, gbuffer.table[gbuffer.surface[row, column]]
    scale, w = np.float32(1 / pinhole.focal), gbuffer.inverse_depth[row, column]
    x, y = np.float32(column + 0.5 - width / 2) * scale, np.float32(row + 0.5 - height / 2) * scale
    x2, y2 = np.float32(column2 + 0.5 - width / 2) * scale, np.float32(row2 + 0.5 - height / 2) * scale
    # Barycentric weights times inverse depth are linear in the picture.
    w2 = w * (s[FLAT] * x2 + s[FLAT + 1] * y2 + s[FLAT + 2]) / (s[FLAT] * x + s[FLAT + 1] * y + s[FLAT + 2])
    b, b2 = s[0] * w + s[1] * x + s[2] * y + s[3], s[0] * w2 + s[1] * x2 + s[2] * y2 + s[3]
    c, c2 = s[4] * w + s[5] * x + s[6] * y + s[7], s[4] * w2 + s[5] * x2 + s[6] * y2 + s[7]
    reach = np.float32(2)
    for here, there in ((b, b2), (c, c2), (w - b - c, w2 - b2 - c2)):
        if there < ZERO:
            reach = min(reach, max(here, ZERO) / (max(here, ZERO) - there))
    return reach
