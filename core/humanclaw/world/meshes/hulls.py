"""What of a mesh collides: its box where it fills one, else convex pieces (V-HACD), of which there are never too many.

Measured on seven models against CoACD (one thread): V-HACD 0.3 to 1.3 s a model, CoACD 4 to 20 s, and CoACD's pieces
were no nearer to the surface. V-HACD's are 2.5 cm off it on the mean (21 pieces of generated furniture). They bridge
the seat of a couch between arms and back, so the room over a seat is cut out before.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from safetensors.numpy import load, save

from humanclaw.body.pose import Array
from humanclaw.storage.cache import Cache
from humanclaw.world.scene import Mesh

VERSION: Final = 1
"""To be raised when the pieces change; cached ones of another version are not used."""
PIECES: Final = 12
"""With 6 hulls are 3.3 cm off, with 24 still 2.3."""
_CORNERS: Final = 24
"""Maximum of a piece. The mean is 15, and 64 bring no hull nearer."""
_VOXELS: Final = 50_000
"""V-HACD's own 400,000 take four times as long and are no nearer (2.5 cm)."""
_FILLED: Final = 0.06
"""Mean gap to each side of its bounding box, in its sizes, below which a mesh is a box: cupboards .05, all else .3."""
_THIN: Final = 0.004
"""Metres: engines need hulls with a volume, so sheets are made this thick, and thinner pieces are left out."""
_FLUSH: Final = 0.012
"""Voxels round a surface off by about this much: corners so near to the bounding box are put onto it, or legs would
hover."""
_DEPTH: Final = 6
"""V-HACD's own 10 takes twice as long and gives the same number of pieces."""


@dataclass(frozen=True)
class KeepOutBox:
    """Room that must stay free: over a rectangle of a mesh, from a height up. Metres."""

    x0: float
    z0: float
    x1: float
    z1: float
    y: float


def convex_pieces(
    mesh: Mesh, pieces: int = PIECES, keep_out: KeepOutBox | None = None
) -> tuple[NDArray[np.float32], ...]:
    """Convex hulls of a mesh, each (K, 3) points in metres: one box, or at most `pieces` others."""
    cache, key = Cache("hulls", limit=1 << 28), _key(mesh, pieces, keep_out)
    if (data := cache.get(key)) is None:
        data = save({str(number): hull for number, hull in enumerate(_decompose(mesh, pieces, keep_out))})
        cache.put(key, data)
    arrays = load(data)
    return tuple(arrays[str(number)] for number in range(len(arrays)))


def _key(mesh: Mesh, pieces: int, keep_out: KeepOutBox | None) -> str:
    state = hashlib.sha256(f"{VERSION} {pieces} {keep_out}".encode())
    state.update(np.ascontiguousarray(mesh.vertices).tobytes())
    state.update(np.ascontiguousarray(mesh.faces).tobytes())
    return state.hexdigest()


def _decompose(mesh: Mesh, pieces: int, keep_out: KeepOutBox | None) -> tuple[NDArray[np.float32], ...]:
    points, faces = mesh.vertices.astype(float), mesh.faces.astype(np.int64)
    low, high = points.min(axis=0), points.max(axis=0)
    box = box_of(low, np.maximum(high, low + _THIN))
    if pieces == 1:
        return (exact(_thinned(points)) if _solid(points) else exact(box),)
    if keep_out is None and fills_its_box(points, faces):
        return (exact(box),)
    parts = (
        [(points, faces)] if keep_out is None else [part for part in _around(points, faces, keep_out) if len(part[1])]
    )
    areas = [_area(*part) for part in parts]
    shares = [max(2, int(pieces * area / sum(areas))) for area in areas]
    hulls = [hull for part, count in zip(parts, shares, strict=True) for hull in _vhacd(*part, count)]
    flush = [_flush(hull, low, high) for hull in hulls]
    return tuple(exact(hull) for hull in flush if _solid(hull)) or (exact(box),)


def _flush(points: Array, low: Array, high: Array) -> Array:
    points = np.where(points < low + _FLUSH, low, points)
    return np.asarray(np.where(points > high - _FLUSH, high, points))


def _vhacd(points: Array, faces: NDArray[np.int64], count: int) -> list[Array]:
    import vhacdx

    pieces = vhacdx.compute_vhacd(
        np.ascontiguousarray(points), np.ascontiguousarray(faces, np.uint32), maxConvexHulls=count, resolution=_VOXELS,
        maxNumVerticesPerCH=_CORNERS, asyncACD=False, maxRecursionDepth=_DEPTH,
    )  # fmt: skip
    return [np.asarray(hull[0], float) for hull in pieces]


def _around(points: Array, faces: NDArray[np.int64], keep_out: KeepOutBox) -> Iterator[tuple[Array, NDArray[np.int64]]]:
    """Yield the parts of a mesh below a keep-out box and at its four sides; parts inside the box are left out."""
    below, above = _cut(points, faces, 1, keep_out.y)
    yield below
    for axis, at, side in ((2, keep_out.z0, 0), (2, keep_out.z1, 1), (0, keep_out.x0, 0), (0, keep_out.x1, 1)):
        halves = _cut(*above, axis, at)
        yield halves[side]
        above = halves[1 - side]


Halves = tuple[tuple[Array, NDArray[np.int64]], tuple[Array, NDArray[np.int64]]]


def _cut(points: Array, faces: NDArray[np.int64], axis: int, at: float) -> Halves:
    """Return a mesh on either side of the plane where a coordinate has a value: first the lower, then the higher."""
    from trimesh import intersections

    if not len(faces):
        return (points, faces), (points, faces)
    cut: Any = intersections.slice_faces_plane
    normal = np.eye(3)[axis]
    low, high = (cut(points, faces, sign * normal, at * normal)[:2] for sign in (-1, 1))
    return low, high


def _area(points: Array, faces: NDArray[np.int64]) -> float:
    a, b, c = (points[faces[:, k]] for k in range(3))
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


def surface(points: Array, faces: NDArray[np.int64], spacing: float = 0.012, most: int = 150_000) -> Array:
    """Return (N, 3) points all over a mesh, about so far apart; always the same for the same mesh."""
    a, b, c = (points[faces[:, k]] for k in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
    count = int(np.clip(area.sum() / spacing**2, 2_000, most))
    rng = np.random.default_rng(0)
    pick = np.searchsorted(np.cumsum(area) / area.sum(), (np.arange(count) + rng.random(count)) / count)
    u, v = rng.random((2, count, 1))
    flip = u + v > 1
    u, v = np.where(flip, 1 - u, u), np.where(flip, 1 - v, v)
    pick = np.minimum(pick, len(faces) - 1)
    return np.asarray(a[pick] + u * (b[pick] - a[pick]) + v * (c[pick] - a[pick]))


def fills_its_box(points: Array, faces: NDArray[np.int64]) -> bool:
    """Seen from every side but below, the mesh is as good as flush with its bounding box."""
    low, high = points.min(axis=0), points.max(axis=0)
    size = np.maximum(high - low, 1e-9)
    spots = (surface(points, faces) - low) / size
    sides = [(axis, far) for axis in range(3) for far in (False, True)]
    # Feet leave up to .15 of the height free from below.
    return all(_depth(spots, axis, far) < (_FILLED if (axis, far) != (1, False) else 0.25) for axis, far in sides)


def _depth(spots: Array, axis: int, far: bool) -> float:
    """Mean distance from one side of the unit box to the first surface behind it, in 16 by 16 cells."""
    a, b = (axis + 1) % 3, (axis + 2) % 3
    cell = np.minimum((spots[:, [a, b]] * 16).astype(int), 15)
    depth = np.ones((16, 16))
    np.minimum.at(depth, (cell[:, 0], cell[:, 1]), 1 - spots[:, axis] if far else spots[:, axis])
    return float(depth.mean())


def box_of(low: Array, high: Array) -> Array:
    """Return the (8, 3) corners of a box."""
    pick = np.array([[i, j, k] for i in (0, 1) for j in (0, 1) for k in (0, 1)])
    return np.where(pick == 1, high, low)


def _solid(points: Array) -> bool:
    """Thick enough in every direction to be a body."""
    if len(points) < 4:
        return False
    spread = points - points.mean(axis=0)
    _, _, axes = np.linalg.svd(spread, full_matrices=False)
    return bool(np.ptp(spread @ axes.T, axis=0).min() > _THIN)


def _thinned(points: Array) -> Array:
    """Return the corners of the convex hull, at most about 48 of them: those that reach farthest along directions all
    around."""
    from scipy.spatial import ConvexHull

    corners = points[ConvexHull(points).vertices]
    if len(corners) <= 48:
        return np.asarray(corners)
    turn = np.arange(48) * np.pi * (3 - 5**0.5)  # The golden angle: directions spread evenly over the sphere.
    y = 1 - (2 * np.arange(48) + 1) / 48
    ways = np.stack([np.sqrt(1 - y * y) * np.cos(turn), y, np.sqrt(1 - y * y) * np.sin(turn)])
    ways = np.concatenate([ways, np.eye(3), -np.eye(3)], axis=1)  # The extremes too: its bounding box stays.
    return np.asarray(corners[np.unique((corners @ ways).argmax(axis=0))])


def exact(points: Array) -> NDArray[np.float32]:
    """Round to hundredths of a millimetre, so that equal shapes have one digest."""
    return np.asarray(np.round(points, 5) + 0.0, np.float32)
