"""The same mesh with fewer triangles: quadric edge collapses (Garland and Heckbert 1997, by fast-simplification)."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from humanclaw.body.pose import Array
from humanclaw.world.meshes.baking import used
from humanclaw.world.scene import Mesh

_SIZE: Final = 1e4
"""A mesh's largest extent while it is simplified. The library's bound on the error has no unit: in its last round it is
351 squared, a sum over planes. So a vertex moves by 3.5 % of the extent at most, and by less where many planes meet."""

Indices = NDArray[np.int64]


def simplify(mesh: Mesh, triangles: int) -> Mesh:
    """Make a mesh with so many triangles or fewer; more where it would lose its shape (by more than 3.5 % of its size).

    Every vertex that stays keeps its place. It keeps its uv too, except at a seam of the texture: there each side takes
    the uv of its own nearest vertex. Not thread-safe, as the library is not.
    """
    if len(mesh.faces) <= triangles:
        return mesh
    points, place = np.unique(mesh.vertices.astype(float), axis=0, return_inverse=True)
    place = place.ravel()
    corners = mesh.faces[_proper(place[mesh.faces])].astype(np.int64)
    # A sheet may be drawn from both sides: the library gets it once, because it does not simplify doubled faces.
    _, once = np.unique(np.sort(place[corners], axis=1), axis=0, return_index=True)
    single = corners[once]
    wanted = triangles * len(single) // len(corners)
    group, best = _collapsed(points, place[single], _outline(place, single), wanted)
    group, best = group[place], best[place]
    spot = mesh.vertices[_nearest(group, best - mesh.vertices)]
    stand_in = _nearest(_sides(corners, group), mesh.vertices - spot)
    return used(spot, stand_in[corners[_proper(group[corners])]], mesh.uv, mesh.texture)


def _collapsed(points: Array, faces: Indices, outline: Indices, triangles: int) -> tuple[Indices, Array]:
    """For each of (N, 3) points the group that it falls into, and where the group is best put; NaN where nothing is
    left.

    A quadric knows the planes of faces and nothing of a border. So each edge of the outline gets a plane that stands
    upright on it: a triangle whose tip is no border either, since it is there from both sides, and so is the first to
    be collapsed.
    """
    import fast_simplification

    edges, upright = outline[:, :2], _normals(points, faces)[outline[:, 2]]
    start, end = points[edges[:, 0]], points[edges[:, 1]]
    tips = (start + end) / 2 + upright * np.linalg.norm(end - start, axis=1, keepdims=True)
    number = len(points) + np.arange(len(edges))[:, None]
    every = np.concatenate([faces, np.hstack([edges, number]), np.hstack([edges[:, ::-1], number])]).astype(np.int32)
    scale = _SIZE / float(np.ptp(points, axis=0).max())
    moved, _, collapses = fast_simplification.simplify(
        np.concatenate([points, tips]) * scale, every, target_count=triangles, return_collapses=True
    )
    onto = np.arange(len(points) + len(tips))
    for kept, gone in collapses[::-1]:
        onto[gone] = onto[kept]
    left = onto[every]
    best = np.full((len(onto), 3), np.nan)
    best[np.unique(left[_proper(left)])] = moved / scale
    group = onto[: len(points)]
    return group, best[group]


def _outline(place: Indices, corners: Indices) -> Indices:
    """(E, 3) edges where the surface ends or the picture breaks: two points, and a face beside them."""
    ends = _edges(corners)
    ends = np.take_along_axis(ends, np.argsort(place[ends], axis=1), axis=1)
    edges, face, faces = np.unique(place[ends], axis=0, return_index=True, return_counts=True)
    _, pictures = np.unique(place[np.unique(ends, axis=0)], axis=0, return_counts=True)
    outer = (faces == 1) | (pictures > 1)
    return np.asarray(np.column_stack([edges, face % len(corners)])[outer], np.int64)


def _normals(points: Array, faces: Indices) -> Array:
    a, b, c = (points[faces[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    return np.asarray(normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-30))


def _sides(corners: Indices, group: Indices) -> Indices:
    """(N,) vertices that became one along edges of faces; those of one group on both sides of a break did not."""
    ends = _edges(corners)
    ends = ends[group[ends[:, 0]] == group[ends[:, 1]]]
    graph = coo_array((np.ones(len(ends)), (ends[:, 0], ends[:, 1])), shape=(len(group), len(group)))
    return np.asarray(connected_components(graph, directed=False)[1], np.int64)


def _edges(faces: Indices) -> Indices:
    """(3 M, 2) the sides of (M, 3) faces: the first of each, the second of each, the third."""
    return np.concatenate([faces[:, side] for side in ((0, 1), (1, 2), (2, 0))])


def _nearest(group: Indices, offset: NDArray[np.floating[Any]]) -> Indices:
    """(N,) for each row the one of its group with the smallest offset."""
    order = np.lexsort(((offset**2).sum(axis=1), group))
    _, first, back = np.unique(group[order], return_index=True, return_inverse=True)
    nearest = np.empty_like(order)
    nearest[order] = order[first][back.ravel()]
    return nearest


def _proper(faces: Indices) -> NDArray[np.bool_]:
    """(M,) which faces have three corners."""
    return np.asarray((faces != np.roll(faces, 1, axis=1)).all(axis=1))
