"""The values that the kernels read and write."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from humanclaw.body import Array
from humanclaw.world import inlined
from humanclaw_raster.packing import Floats

NEAR: Final = 0.02
"""Near plane: surfaces closer to the eye than this are cut away, metres."""
GOLDEN: Final = 2.399963
"""The golden angle: points at its multiples are spread evenly, however many there are; radians."""
ZERO, HALF, ONE, TWO, TINY = (np.float32(number) for number in (0, 0.5, 1, 2, 1e-9))
"""Constants as float32. A plain Python number would turn the whole formula into float64, and then a loop would process
only half as many pixels at once."""


class Pinhole(NamedTuple):
    """A pinhole camera: intrinsics and pose."""

    eye: Array
    """(3,) position in the world frame, metres."""
    axes: Array
    """(3, 3) unit vectors in the world frame; rows: right, down, forward."""
    focal: float
    """Focal length, pixels."""
    most: Array = np.array([0.0, 0.0, np.inf])
    """(3,) the greatest inverse depth that is drawn, as rays (right, down, 1) times this."""


class Instances(NamedTuple):
    """N placed meshes of a model."""

    mesh: NDArray[np.int32]
    id: NDArray[np.int32]
    turn: Array
    """(N, 3, 3) rotation from the mesh's frame to the world."""
    place: Array
    """(N, 3) position in the world frame, metres."""


class OverheadMap(NamedTuple):
    """Height maps from above, one for each of S storeys."""

    heights: Floats
    """(S, Z, X) world height of the highest surface over each cell, metres; minus infinity where there is none.

    The outermost cells are always empty, because a lookup beyond the map reads them.
    """
    around: Floats
    """(S, Z, X) the greatest height within AROUND cells of each cell, along both axes."""
    floors: Array
    """(S,) heights of the floors, ascending, metres."""
    corner: Array
    """(2,) smallest x and z of the maps, metres."""
    cell: float
    """Side of a cell, metres."""


class GBuffer(NamedTuple):
    """The nearest surface in each pixel. The K surfaces are the triangles that were drawn into at least one pixel."""

    inverse_depth: Floats
    """(H, W), 0 in empty pixels."""
    surface: NDArray[np.int32]
    """(H, W) number of the surface, -1 in empty pixels."""
    faces: NDArray[np.int32]
    """(K, 2) face and instance of each surface."""
    table: Floats
    """(K, SURFACE) the values that all pixels of a surface share, as from prepare."""


@inlined
def floats(count: int) -> Floats:
    """Allocate a row of numbers.

    Each row is an array of its own, so that loops are vectorized: the compiler cannot know that rows of one array do
    not overlap.
    """
    return np.empty(count, np.float32)


@inlined
def ints(count: int) -> NDArray[np.int32]:
    return np.empty(count, np.int32)
