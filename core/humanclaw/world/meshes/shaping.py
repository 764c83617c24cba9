"""Meshes brought into the frame of an asset: origin at the centre of the footprint, y = 0 at the bottom, front +Z."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from humanclaw.body.pose import Array
from humanclaw.world.meshes.baking import area
from humanclaw.world.meshes.decimation import simplify
from humanclaw.world.meshes.hulls import KeepOutBox, box_of, exact
from humanclaw.world.scene import Mesh

_SURFACE: Final = 0.7
"""The share of a mesh's surface that must be left when it is simplified."""


def lightened(mesh: Mesh, triangles: int) -> Mesh:
    """Make a mesh of about so many triangles.

    Up to four times as many where fewer would cost it its surface, as leaves do.
    """
    whole, less = area(mesh), mesh
    for factor in (1, 2, 4):
        less = simplify(mesh, factor * triangles)
        if area(less) > _SURFACE * whole:
            break
    return less


def base_of(points: NDArray[Any]) -> Array:
    """Return (3,) centre of the footprint of (N, 3) points, at the height of the lowest."""
    low, high = points.min(axis=0), points.max(axis=0)
    return np.array([(low[0] + high[0]) / 2, low[1], (low[2] + high[2]) / 2], float)


def moved(mesh: Mesh, by: Array) -> Mesh:
    """Return a mesh moved by a (3,) vector, metres."""
    return replace(mesh, vertices=exact(mesh.vertices + by))


def turned(mesh: Mesh, quarters: int) -> Mesh:
    """Return a mesh turned by quarter turns to the left about y."""
    x, y, z = mesh.vertices.T
    points = {0: (x, y, z), 1: (z, y, -x), 2: (-x, y, -z), 3: (-z, y, x)}[quarters % 4]
    return replace(mesh, vertices=exact(np.stack(points, axis=-1)))


def with_lid(pieces: Sequence[NDArray[np.float32]], level: KeepOutBox) -> tuple[NDArray[np.float32], ...]:
    """Convex pieces and a box whose lid is exactly a level: a seat, or a table's top."""
    low, high = np.array([level.x0, level.y - 0.04, level.z0]), np.array([level.x1, level.y, level.z1])
    return (*pieces, exact(box_of(low, high)))
