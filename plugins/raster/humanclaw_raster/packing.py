"""Pack meshes into the flat arrays that the kernels read. Nothing here depends on the camera or on time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from humanclaw.body import Array
from humanclaw.world import Mesh

CLUSTER: Final = 64
"""Number of triangles that are tested against the view together."""
LEVELS: Final = 8
"""Number of sizes of a texture (mipmap); each is half the previous one."""
SMOOTH: Final = float(np.cos(np.radians(40.0)))
"""Cosine of 40 degrees. A face whose normal differs more from the mean of its neighbours has a sharp edge there."""

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
    clusters: NDArray[np.int32]
    """(C, 2) first triangle, and the one after the last."""
    spheres: Floats
    """(C, 4) centre and radius of a sphere around a cluster, metres."""
    meshes: NDArray[np.int32]
    """(M, 2) first cluster of a mesh, and the one after its last."""
    texels: NDArray[np.int32]
    """(P,) red in the lowest 8 bits, then green, then blue: one load fetches all three."""
    levels: NDArray[np.int32]
    """(M * LEVELS, 3) for each size of a mesh's texture: index of its first texel, height and width."""


def pack(meshes: Sequence[Mesh]) -> Model:
    """Pack meshes. They are numbered in the given order."""
    pieces = [_sorted_faces(mesh) for mesh in meshes]
    corners = [mesh.vertices[faces] for mesh, faces in zip(meshes, pieces, strict=True)]
    uv = [mesh.uv[faces] for mesh, faces in zip(meshes, pieces, strict=True)]
    density = [_density(*args) for args in zip(corners, uv, [mesh.texture for mesh in meshes], strict=True)]
    normals = [_smooth_normals(mesh, faces) for mesh, faces in zip(meshes, pieces, strict=True)]
    counts = [len(faces) for faces in pieces]
    clusters, ranges = _clusters(counts)
    texels, levels = _textures([mesh.texture for mesh in meshes])
    together = np.concatenate(corners).astype(np.float32)
    return Model(
        together, np.concatenate(normals).astype(np.float32), np.concatenate(uv).astype(np.float32),
        np.concatenate(density).astype(np.float32), clusters, _spheres(together, clusters), ranges, texels, levels,
    )  # fmt: skip


def _sorted_faces(mesh: Mesh) -> NDArray[np.int32]:
    """Return (M, 3) the faces along a Morton curve, so that successive faces are close to each other."""
    if len(mesh.faces) <= CLUSTER:
        return mesh.faces
    centres = mesh.vertices[mesh.faces].mean(axis=1)
    low, size = centres.min(axis=0), np.ptp(centres, axis=0).max() + 1e-9
    cells = ((centres - low) / size * 1023).astype(np.int64)
    code = np.zeros(len(cells), np.int64)
    for bit in range(10):
        for axis in range(3):
            code |= ((cells[:, axis] >> bit) & 1) << (3 * bit + axis)
    return mesh.faces[np.argsort(code, kind="stable")]


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
    low = np.minimum.reduceat(corners.min(axis=1), clusters[:, 0])
    high = np.maximum.reduceat(corners.max(axis=1), clusters[:, 0])
    radius = np.linalg.norm(high - low, axis=1, keepdims=True) / 2
    # A little larger than exact: rounding to float32 must not leave a corner outside.
    return np.concatenate([(low + high) / 2, radius * 1.0001 + 1e-6], axis=1).astype(np.float32)


def _density(corners: Floats, uv: Floats, texture: NDArray[np.uint8]) -> Array:
    """Return (M,) texels per metre; 0 where a face takes its colour from a single point of the texture."""
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    sides = (uv[:, 1:] - uv[:, :1]) * np.array([texture.shape[1], texture.shape[0]])
    covered = np.abs(sides[:, 0, 0] * sides[:, 1, 1] - sides[:, 0, 1] * sides[:, 1, 0])
    return np.asarray(np.sqrt(covered / np.maximum(area, 1e-12)))


def _smooth_normals(mesh: Mesh, faces: NDArray[np.int32]) -> Array:
    """Return (M, 3, 3) the normal at each corner: the mean of the faces that meet there, unless the edge is sharp."""
    points: Array = mesh.vertices.astype(float)[faces]
    flat = np.repeat(_unit(np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])), 3, axis=0)
    _, place = np.unique(np.round(mesh.vertices, 5), axis=0, return_inverse=True)
    corner = place.ravel()[faces.ravel()]
    total = np.stack([np.bincount(corner, flat[:, axis]) for axis in range(3)], axis=1).astype(float)
    mean = _unit(total)[corner]
    smooth = np.sum(flat * mean, axis=-1, keepdims=True) > SMOOTH
    return np.where(smooth, mean, flat).reshape(-1, 3, 3)


def _unit(vectors: Array) -> Array:
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-12))


def _textures(pictures: Sequence[NDArray[np.uint8]]) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    texels, levels, first = [], [], 0
    for picture in pictures:
        for _ in range(LEVELS):
            levels.append((first, *picture.shape[:2]))
            padded = np.zeros((picture.shape[0] * picture.shape[1], 4), np.uint8)
            padded[:, :3] = picture.reshape(-1, 3)
            texels.append(padded.view("<i4")[:, 0])
            first += len(padded)
            picture = _half(picture)
    return np.concatenate(texels, dtype=np.int32), np.array(levels, np.int32).reshape(-1, 3)


def _half(picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Halve a picture: each 2 x 2 texels become their mean. A side of one texel stays."""
    for axis in (0, 1):
        size = picture.shape[axis] // 2 * 2
        if size:
            even, odd = (picture.take(np.arange(first, size, 2), axis).astype(np.uint16) for first in (0, 1))
            picture = ((even + odd) // 2).astype(np.uint8)
    return picture
