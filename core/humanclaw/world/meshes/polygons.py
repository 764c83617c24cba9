"""Polygons of any number of corners, cut into triangles.

The fan of triangles from a polygon's first corner covers it, unless a corner points inwards, as those of a doorway in a
wall. Such a fan folds over itself: some of its triangles look the other way, and together they cover more.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from typing import Final

import numpy as np
from numpy.typing import NDArray

from humanclaw.body.pose import Array

Indices = NDArray[np.int64]

_SLIVER: Final = 1e-9
"""Height of a triangle without a side, as a share of its longest edge: three corners in a row have one by rounding."""
_MORE: Final = 1.001
"""How many times its own area a polygon may be covered: its corners are rounded, or stand a little out of its plane."""


def cut(vertices: Array, polygons: Iterable[Indices], lost: Counter[str]) -> Indices:
    """Return the (M, 3) triangles of polygons, (K, corners) of each number of corners, which cover each of them once.

    lost: counts the polygons for which there are none. Raises ValueError for a corner that is no vertex.
    """
    faces = [np.zeros((0, 3), np.int64)]
    for loops in polygons:
        if (wrong := loops[(loops < 0) | (loops >= len(vertices))]).size:
            raise ValueError(f"a polygon names vertex {wrong[0]} of {len(vertices)}")
        first = np.broadcast_to(loops[:, :1], loops[:, 2:].shape)
        fans = np.stack([first, loops[:, 1:-1], loops[:, 2:]], axis=-1)
        for number in _folded(vertices[fans]) if loops.shape[1] > 3 else ():
            triangles = _cut(vertices[loops[number]])
            if triangles is not None:
                fans[number] = loops[number][triangles]
            elif _covers_more(_normals(vertices[fans[number]])):
                lost["polygons that cross themselves (their openings may be closed)"] += 1
        faces.append(fans.reshape(-1, 3))
    return np.concatenate(faces)


def _folded(fans: Array) -> Indices:
    """Return the numbers of the fans, (K, triangles, 3, 3), some of whose triangles look the other way."""
    normals = _normals(fans)
    longest = np.linalg.norm(fans - np.roll(fans, 1, axis=2), axis=-1).max(axis=-1, initial=0.0)
    sides = np.linalg.norm(normals, axis=-1) > _SLIVER * longest**2
    back = np.einsum("ktj,kj->kt", normals, normals.sum(axis=1)) <= 0
    return np.flatnonzero((sides & back).any(axis=1))


def _normals(triangles: Array) -> Array:
    """Return (..., 3) normals of (..., 3, 3) triangles, twice as long as each has area."""
    return np.cross(triangles[..., 1, :] - triangles[..., 0, :], triangles[..., 2, :] - triangles[..., 0, :])


def _covers_more(normals: Array) -> bool:
    """Tell whether the triangles of (N, 3) normals fold over one another."""
    return bool(np.linalg.norm(normals, axis=1).sum() > _MORE * np.linalg.norm(normals.sum(axis=0)))


def _cut(loop: Array) -> Indices | None:
    """Return (N - 2, 3) triangles of an (N, 3) polygon, cut as it looks from its front; None if it crosses itself."""
    from manifold3d import triangulate

    loop = loop - loop[0]
    normal = np.cross(loop, np.roll(loop, -1, axis=0)).sum(axis=0)
    twice = float(np.linalg.norm(normal))
    if not twice:
        return None
    up = normal / twice
    across = np.cross(np.eye(3)[np.abs(up).argmin()], up)
    flat = loop @ np.stack([across, np.cross(up, across), np.zeros(3)], axis=1) / np.linalg.norm(across)
    triangles = np.asarray(triangulate([flat[:, :2]]), np.int64)
    return triangles if len(triangles) == len(loop) - 2 and not _covers_more(_normals(flat[triangles])) else None
