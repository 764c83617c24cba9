"""What the kernels read and write, and how they are compiled."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from humanclaw.body import Array
from humanclaw_raster.packing import Floats

NEAR: Final = 0.02
"""What is closer to the eye than this is cut away, metres."""


SURFACE: Final = 27
FLAT: Final = 8
"""Numbers that prepare_face writes, and where among them the normal of the face begins."""


class Pinhole(NamedTuple):
    """A pinhole camera: intrinsics and pose."""

    eye: Array
    """(3,) world frame."""
    axes: Array
    """(3, 3) rows: right, down, forward."""
    focal: float
    """In pixels."""


class Instances(NamedTuple):
    """The meshes of a model, put somewhere. N instances."""

    mesh: NDArray[np.int32]
    id: NDArray[np.int32]
    shown: NDArray[np.bool_]
    turn: Array
    """(N, 3, 3) rotation from the mesh's frame to the world."""
    place: Array
    """(N, 3) world frame."""


class OverheadMap(NamedTuple):
    """Height maps from above. S storeys."""

    heights: Floats
    """(S, Z, X) world height of the highest surface over each cell, minus infinity where there is none."""
    floors: Array
    """(S,) heights of the floors, ascending."""
    corner: Array
    """(2,) least x and z of the maps."""
    cell: float
    """Side of a cell, metres."""


class GBuffer(NamedTuple):
    """What each pixel shows, all (H, W). Where nothing is, inverse_depth is 0, and face and instance are -1."""

    inverse_depth: Floats
    face: NDArray[np.int32]
    instance: NDArray[np.int32]


def compiled(function: Callable[..., Any]) -> Callable[..., Any]:
    """Machine code, kept on disk beside the source or in the user's cache; compiled anew where neither can be
    written."""
    how: Any = {"error_model": "numpy", "nogil": True}
    try:
        return njit(cache=True, **how)(function)  # type: ignore[no-any-return]
    except RuntimeError:
        return njit(**how)(function)  # type: ignore[no-any-return]


def inlined(function: Callable[..., Any]) -> Callable[..., Any]:
    return njit(inline="always", error_model="numpy")(function)
