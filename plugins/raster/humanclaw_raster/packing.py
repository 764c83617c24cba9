"""Pack meshes into the flat arrays that the kernels read. Nothing here depends on the camera or on time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from humanclaw.body import Array
from humanclaw.world import Mesh, compiled, inlined

CLUSTER: Final = 64
"""Number of triangles that are tested against the view together."""
LEVELS: Final = 8
"""Number of sizes of a texture (mipmap); each is half the previous one."""
SMOOTH: Final = float(np.cos(np.radians(62.0)))
"""Cosine of 62 degrees. Between faces whose normals differ more is a sharp edge; a bar of six sides is round."""

SMALL, WIDE, PANE, SKIN = range(4)
"""Kinds of faces: light changes evenly over a small or bent one, and not over a wide flat one; a pane shows the sky;
skin is of a body."""
_WIDE: Final = 0.5
"""Longest side of a small face, metres."""
_FLAT: Final = 1e-3
"""Normals of the corners of a flat face differ by less."""

Floats = NDArray[np.float32]


class Model(NamedTuple):
    """All meshes of a scene in a row, each in its own frame: T triangles, C clusters, M meshes, P texels."""

    corners: Floats
    """(T, 3, 3) positions, metres."""
    normals: Floats
    """(T, 3, 3) unit normals for shading."""
    uv: Floats
    """(T, 3, 2) texture coordinates in 0..1."""
    density: Floats
    """(T,) texels per metre along the surface, in the full-size texture."""
    kind: NDArray[np.int32]
    """(T,) SMALL, WIDE, PANE or SKIN."""
    clusters: NDArray[np.int32]
    """(C, 2) first triangle, and the one after the last."""
    spheres: Floats
    """(C, 4) centre and radius of a sphere around a cluster, metres."""
    meshes: NDArray[np.int32]
    """(M, 2) first cluster of a mesh, and the one after its last."""
    texels: NDArray[np.int32]
    """(P,) red in the lowest 8 bits, then green, then blue: one load fetches all three."""
    levels: NDArray[np.int32]
    """((M + 1) * LEVELS, 3) for each size of a mesh's texture, and of the sky's: its first texel, height and width."""


def pack(meshes: Sequence[Mesh], panes: Sequence[NDArray[np.bool_]], sky: NDArray[np.uint8]) -> Model:
    """Pack meshes. They are numbered in the given order; behind their textures follows that of the sky.

    panes: (F,) for each mesh, which of its faces show the sky.
    """
    # All meshes at once: a house has hundreds of small ones.
    counts = [len(mesh.faces) for mesh in meshes]
    owner = np.repeat(np.arange(len(meshes)), counts)
    first = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    vertices = np.concatenate([mesh.vertices for mesh in meshes])
    faces = np.concatenate([mesh.faces + start for mesh, start in zip(meshes, first[:-1], strict=True)])
    order = np.lexsort((along_curve(vertices[faces], counts), owner))
    faces = faces[order]
    corners, uv = vertices[faces], np.concatenate([mesh.uv for mesh in meshes])[faces]
    sizes = np.array([mesh.texture.shape[1::-1] for mesh in meshes])
    clusters, ranges = _clusters(counts)
    texels, levels = _textures([*(mesh.texture for mesh in meshes), sky])
    places = _places(vertices, np.repeat(np.arange(len(meshes)), np.diff(first)))
    normals = _smooth_normals(corners, places[faces]).astype(np.float32)
    kind = np.where(np.concatenate(panes)[order], PANE, _kind(corners, normals))
    for number, mesh in enumerate(meshes):
        if mesh.normals is not None:
            mine = owner == number
            normals[mine], kind[mine] = mesh.normals[faces[mine] - first[number]], SKIN
    return Model(
        corners.astype(np.float32), normals,
        uv.astype(np.float32), _density(corners, uv, sizes[owner]).astype(np.float32),
        kind.astype(np.int32), clusters, _spheres(corners.astype(np.float32), clusters), ranges, texels, levels,
    )  # fmt: skip


def _kind(corners: Floats, normals: Floats) -> NDArray[np.int64]:
    sides = corners - corners[:, [2, 0, 1]]
    wide = np.asarray(np.einsum("tij,tij->ti", sides, sides).max(axis=1) > _WIDE**2)
    wide[wide] = np.abs(normals[wide] - normals[wide, :1]).max(axis=(1, 2)) < _FLAT
    return np.where(wide, WIDE, SMALL)


def along_curve(corners: Floats, counts: Sequence[int]) -> NDArray[np.int64]:
    """Return (T,) the place of each face on a Morton curve through its mesh: successive faces are close to each other.

    The faces of a mesh with one cluster keep their order.
    """
    centres, code = (corners[:, 0] + corners[:, 1] + corners[:, 2]) / 3, np.zeros(len(corners), np.int64)
    for first, count in zip(np.cumsum([0, *counts]), counts, strict=False):
        if count > CLUSTER:
            mine = centres[first : first + count]
            low, size = mine.min(axis=0), np.ptp(mine, axis=0).max() + 1e-9
            # Ten bits along each axis, as many as _SPREAD has.
            cells = ((mine - low) / size * 1023).astype(np.int64)
            x, y, z = _SPREAD[cells].T
            code[first : first + count] = x | y << 1 | z << 2
    return code


_SPREAD: Final = np.array([sum((cell >> bit & 1) << 3 * bit for bit in range(10)) for cell in range(1024)])
"""The bits of a number, three apart."""


def _clusters(counts: Sequence[int]) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    clusters: list[tuple[int, int]] = []
    ranges: list[tuple[int, int]] = []
    first = 0
    for count in counts:
        begin = len(clusters)
        clusters += [(first + k, first + min(k + CLUSTER, count)) for k in range(0, count, CLUSTER)]
        ranges.append((begin, len(clusters)))
        first += count
    return np.array(clusters, np.int32).reshape(-1, 2), np.array(ranges, np.int32).reshape(-1, 2)


def _spheres(corners: Floats, clusters: NDArray[np.int32]) -> Floats:
    low = np.minimum.reduceat(np.minimum(np.minimum(corners[:, 0], corners[:, 1]), corners[:, 2]), clusters[:, 0])
    high = np.maximum.reduceat(np.maximum(np.maximum(corners[:, 0], corners[:, 1]), corners[:, 2]), clusters[:, 0])
    radius = np.linalg.norm(high - low, axis=1, keepdims=True) / 2
    # A little larger than exact: rounding to float32 must not leave a corner outside.
    return np.concatenate([(low + high) / 2, radius * 1.0001 + 1e-6], axis=1).astype(np.float32)


def _density(corners: Floats, uv: Floats, sizes: NDArray[np.int64]) -> Array:
    """Return (T,) texels per metre; 0 where a face takes its colour from a single point of the texture.

    sizes: (T, 2) width and height of a face's texture.
    """
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    sides = (uv[:, 1:] - uv[:, :1]) * sizes[:, None]
    covered = np.abs(sides[:, 0, 0] * sides[:, 1, 1] - sides[:, 0, 1] * sides[:, 1, 0])
    return np.asarray(np.sqrt(covered / np.maximum(area, 1e-12)))


def _places(vertices: Floats, owner: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return (N,) a number for each vertex, equal for vertices of one mesh at the same place."""
    x, y, z = np.round(vertices, 5).T
    order = np.lexsort((z, y, x, owner))
    new = np.any([np.diff(key[order]) != 0 for key in (x, y, z, owner)], axis=0)
    places = np.empty(len(order), np.int64)
    places[order] = np.cumsum([False, *new])
    return places


def _smooth_normals(corners: Floats, places: NDArray[np.int64]) -> Array:
    """Return (T, 3, 3) the normal at each corner: the mean of the faces that meet there without a sharp edge.

    places: (T, 3) the number of each corner's place.
    """
    points: Array = corners.astype(float)
    area = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
    mean = np.zeros((3 * len(area), 3))
    order, ends = np.argsort(places, axis=None, kind="stable"), np.cumsum(np.bincount(places.ravel()))
    _add_alike(area, _unit(area), order, ends, mean)
    return _unit(mean).reshape(-1, 3, 3)


@compiled
def _add_alike(area: Array, flat: Array, order: NDArray[np.int64], ends: NDArray[np.int64], mean: Array) -> None:
    """Add to each corner the areas of all faces at its place that are SMOOTH with its own: rounded edges leave large
    faces flat."""
    begin = 0
    for end in ends:
        for corner in order[begin:end]:
            for other in order[begin:end]:
                a, b = flat[corner // 3], flat[other // 3]
                if a[0] * b[0] + a[1] * b[1] + a[2] * b[2] > SMOOTH:
                    for axis in range(3):
                        mean[corner, axis] += area[other // 3, axis]
        begin = end


def _unit(vectors: Array) -> Array:
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-12))


def _textures(pictures: Sequence[NDArray[np.uint8]]) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    sizes = np.array([[[max(side >> level, 1) for side in p.shape[:2]] for level in range(LEVELS)] for p in pictures])
    begins = np.cumsum([0, *sizes.prod(axis=-1).ravel()])
    levels = np.concatenate([begins[:-1, None], sizes.reshape(-1, 2)], axis=1).astype(np.int32)
    texels = np.empty(begins[-1], np.int32)
    _fill(np.concatenate([picture.ravel() for picture in pictures]), levels, texels)
    return texels, levels


@compiled
def _fill(rgb: NDArray[np.uint8], levels: NDArray[np.int32], texels: NDArray[np.int32]) -> None:
    """Copy the pictures, and make each smaller size of 2 x 2 texels of the one before it. A side of one texel stays."""
    read = 0
    for row in range(len(levels)):
        start, height, width = levels[row]
        if row % LEVELS == 0:
            for k in range(start, start + height * width):
                texels[k] = rgb[read] | rgb[read + 1] << 8 | rgb[read + 2] << 16
                read += 3
            continue
        before, high, wide = levels[row - 1]
        down, right = wide * min(high - 1, 1), min(wide - 1, 1)
        for y in range(height):
            for x in range(width):
                k = before + 2 * (y * wide + x)
                left, other = _mean(texels[k], texels[k + down]), _mean(texels[k + right], texels[k + right + down])
                texels[start + y * width + x] = _mean(left, other)


@inlined
def _mean(first: np.int32, second: np.int32) -> np.int32:
    """Return the mean of each byte, rounded down. Nothing carries from one byte into the next."""
    return (first & second) + ((first ^ second) >> 1 & 0x7F7F7F7F)
