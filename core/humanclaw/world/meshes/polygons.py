"""Polygons with a corner that points inwards, such as a wall with a doorway, cut into triangles once more.

Readers cut a polygon into a fan of triangles from its first corner. The fan of such a polygon folds over itself: some
of its triangles look the other way, and together they cover more than the polygon.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from typing import Final

import numpy as np
from numpy.typing import NDArray

from humanclaw.body.pose import Array

Indices = NDArray[np.int64]

_FLAT: Final = 0.03
"""A polygon is flat if its corners are nearer to its plane than this share of its size: files round coordinates."""
_SLIVER: Final = 0.01
"""Height of a triangle without a side, as a share of its longest edge: files have some two decimals."""
_TURN: Final = 0.1
"""Sine of the largest angle between two triangles of one fan."""


def unfolded(vertices: Array, faces: Indices, lost: Counter[str]) -> Indices:
    """Return (M, 3) faces in which other triangles stand for each folded fan: they cover its polygon once.

    lost: counts the polygons for which there are none.
    """
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    areas, cut = np.cross(b - a, c - a), faces.copy()
    # Three corners in a row, as beside a doorway, have a normal of rounding errors: it must not end a fan.
    longest = np.max([np.linalg.norm(b - a, axis=1), np.linalg.norm(c - b, axis=1), np.linalg.norm(a - c, axis=1)], 0)
    thin = np.linalg.norm(areas, axis=1) <= _SLIVER * longest**2
    normals = np.where(thin[:, None], 0.0, areas)
    # By place, as some readers give each triangle corners of its own.
    linked = (a[1:] == a[:-1]).all(axis=1) & (b[1:] == c[:-1]).all(axis=1) & _parallel(normals[1:], normals[:-1])
    for fan, loop in (*_halves(faces, normals), *_fans(faces, linked, normals)):
        normal = areas[fan].sum(axis=0)
        if np.linalg.norm(normal) <= _SLIVER * np.linalg.norm(areas[fan], axis=1).sum():
            continue  # A sheet with two sides.
        triangles = _cut(vertices[loop], normal)
        if triangles is None:
            lost["polygons that are not flat or cross themselves (their openings may be closed)"] += 1
        else:
            cut[fan] = loop[triangles]
    return cut


def _halves(faces: Indices, normals: Array) -> Iterator[tuple[Indices, Indices]]:
    """Yield the rows and the loop of folded quadrilaterals p q r s, which trimesh cuts into p q r and r s p."""
    size = int(faces.max()) + 1
    out, back = faces[:, 0] * size + faces[:, 2], faces[:, 2] * size + faces[:, 0]
    order = np.argsort(back, kind="stable")
    other = order[np.minimum(np.searchsorted(back, out, sorter=order), len(order) - 1)]
    folded = (back[other] == out) & (np.einsum("ij,ij->i", normals, normals[other]) < 0)
    folded &= _parallel(normals, normals[other]) & (np.arange(len(other)) < other)
    for row in np.flatnonzero(folded):
        yield np.array([row, other[row]]), np.append(faces[row], faces[other[row], 1])


def _fans(faces: Indices, linked: NDArray[np.bool_], normals: Array) -> Iterator[tuple[Indices, Indices]]:
    """Yield the rows and the loop of folded polygons p q r s t ..., cut into p q r, p r s, p s t ...

    linked: (M - 1,) whether a face and the next one have the edge p r in common.
    """
    fan = np.concatenate([[0], np.cumsum(~linked)])
    whole = np.zeros((fan[-1] + 1, 3))
    np.add.at(whole, fan, normals)
    for number in np.unique(fan[np.einsum("ij,ij->i", normals, whole[fan]) < 0]):
        rows = np.arange(*np.searchsorted(fan, [number, number + 1]))
        yield rows, np.append(faces[rows[0], :2], faces[rows, 2])


def _parallel(first: Array, second: Array) -> NDArray[np.bool_]:
    sizes = np.linalg.norm(first, axis=1) * np.linalg.norm(second, axis=1)
    return np.asarray(np.linalg.norm(np.cross(first, second), axis=1) <= _TURN * sizes)


def _cut(loop: Array, normal: Array) -> Indices | None:
    """Return (N - 2, 3) triangles of an (N, 3) polygon; None if it is not flat or crosses itself.

    normal: towards its front, as long as twice its area.
    """
    from manifold3d import triangulate

    twice = float(np.linalg.norm(normal))
    up = normal / twice
    across = np.cross(np.eye(3)[np.abs(up).argmin()], up)
    flat = loop @ np.stack([across, np.cross(up, across)], axis=1) / np.linalg.norm(across)
    triangles = np.asarray(triangulate([flat]), np.int64)
    a, b, c = (flat[triangles[:, k]] for k in range(3))
    areas = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    even = np.ptp(loop @ up) <= _FLAT * np.ptp(flat, axis=0).max()
    return triangles if even and len(triangles) == len(loop) - 2 and np.abs(areas).sum() <= 1.001 * twice else None
