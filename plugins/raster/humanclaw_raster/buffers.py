"""The values that the kernels read and write, and the decorators that compile kernels."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from humanclaw.body import Array
from humanclaw_raster.packing import Floats

NEAR: Final = 0.02
"""Near plane: surfaces closer to the eye than this are cut away, metres."""
SURFACE: Final = 27
"""Number of values that prepare_face writes."""
FLAT: Final = 8
"""Index among them at which the normal of the face begins."""


class Pinhole(NamedTuple):
    """A pinhole camera: intrinsics and pose."""

    eye: Array
    """(3,) position in the world frame, metres."""
    axes: Array
    """(3, 3) unit vectors in the world frame; rows: right, down, forward."""
    focal: float
    """Focal length, pixels."""


class Instances(NamedTuple):
    """N placed meshes of a model."""

    mesh: NDArray[np.int32]
    id: NDArray[np.int32]
    shown: NDArray[np.bool_]
    turn: Array
    """(N, 3, 3) rotation from the mesh's frame to the world."""
    place: Array
    """(N, 3) position in the world frame, metres."""


class OverheadMap(NamedTuple):
    """Height maps from above, one for each of S storeys."""

    heights: Floats
    """(S, Z, X) world height of the highest surface over each cell, metres; minus infinity where there is none."""
    floors: Array
    """(S,) heights of the floors, ascending, metres."""
    corner: Array
    """(2,) smallest x and z of the maps, metres."""
    cell: float
    """Side of a cell, metres."""


class GBuffer(NamedTuple):
    """The nearest surface in each pixel, (H, W) each. Empty pixels have inverse_depth 0, and face and instance -1."""

    inverse_depth: Floats
    face: NDArray[np.int32]
    instance: NDArray[np.int32]


def compiled(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile a function to machine code, cached on disk beside the source or in the user's cache.

    Where neither can be written, each process compiles again.
    """
    how: Any = {"error_model": "numpy", "nogil": True}
    try:
        return njit(cache=True, **how)(function)  # type: ignore[no-any-return]
    except RuntimeError:
        return njit(**how)(function)  # type: ignore[no-any-return]


def inlined(function: Callable[..., Any]) -> Callable[..., Any]:
    return njit(inline="always", error_model="numpy")(function)
