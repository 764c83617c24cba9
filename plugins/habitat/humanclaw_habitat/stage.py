"""Split the building of a scene into floors, ceilings and walls, and make their collision shapes.

A stage is a hollow shell of triangles, so no convex shape fits it. Each of its planes is cut into convex polygons, and
each polygon collides as a thin slab behind it.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import ConvexHull, QhullError

from humanclaw.body import Array
from humanclaw.world import Mesh, Part, bake, exact

Faces = NDArray[np.int64]

_LEVEL: Final = 0.7
"""A surface is level if its normal is within 45 degrees of the vertical: the cosine of that angle."""
_THICK: Final = {"floor": 0.1, "ceiling": 0.05, "wall": 0.05}
"""Thickness of a slab behind its surface, metres."""
_LEAST: Final = 4e-4
"""Smallest polygon that collides, square metres."""
_HEADROOM: Final = 1.8
"""Smallest height between a floor and the top of the building, metres. A higher surface is a roof or its ceiling."""
_STOREY: Final = 4.0
"""Smallest area of level surface at one height that counts as a floor, square metres."""
_WALLS: Final = 150
"""Number of wall pieces that become separate objects; the rest become one object."""


@dataclass(frozen=True, eq=False)
class Piece:
    """A part of a building, in the world frame."""

    category: str
    mesh: Mesh
    hulls: tuple[NDArray[np.float32], ...]


def pieces(parts: Sequence[Part], shell: Sequence[Part] | None, solid: bool) -> list[Piece]:
    """Split a stage into floor, ceiling and walls.

    shell: the collision model, if it is another model. solid: whether the stage collides at all.
    """
    categories = _by_category(parts)
    shells = {} if shell is None else _by_category(shell)
    walls = categories.pop("wall", [])
    groups = [*categories.items(), *(("wall", group) for group in ([walls] if shells else _standing(walls)) if group)]
    # A triangle without an area, of which files have some, may be a piece of its own: nothing is left of it.
    return [
        Piece(name, mesh, slabs(shells.get(name, ()) if shells else group, name) if solid else ())
        for name, group in groups
        if len((mesh := bake(group)).faces)
    ]


def _by_category(parts: Sequence[Part]) -> dict[str, list[Part]]:
    """Split parts into floor, ceiling and wall."""
    roof, categories = _roof(parts), defaultdict[str, list[Part]](list)
    for part in parts:
        for category, faces in _sorted(part, roof):
            categories[category].append(replace(part, faces=faces))
    return categories


def _roof(parts: Sequence[Part]) -> float:
    """Return the height above which a level surface is not a floor, because nobody could stand on it.

    A building lower than two headrooms keeps the surfaces in its lowest 1.8 m.
    """
    heights = np.concatenate([part.vertices[:, 1] for part in parts])
    return float(max(heights.max() - _HEADROOM, heights.min() + _HEADROOM))


def _sorted(part: Part, roof: float) -> Iterator[tuple[str, Faces]]:
    """Yield the faces of a part by category: level faces that look up below the roof are floor, others ceiling."""
    points, up = part.vertices[part.faces], _up(part)
    low = points[..., 1].min(axis=1) <= roof
    kinds = np.where(np.abs(up) < _LEVEL, "wall", np.where((up > 0) & low, "floor", "ceiling"))
    for name in ("floor", "ceiling", "wall"):
        if (kinds == name).any():
            yield name, part.faces[kinds == name]


def _up(part: Part) -> Array:
    """Return (M,) the vertical component of the unit normal of each face."""
    points = part.vertices[part.faces]
    normal = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
    return np.asarray(normal[:, 1] / np.maximum(np.linalg.norm(normal, axis=1), 1e-12))


def righted(parts: Sequence[Part]) -> Sequence[Part]:
    """Turn over the level faces of a building without one that looks up: a single sheet has two sides."""
    if any((_up(part) >= _LEVEL).any() for part in parts):
        return parts
    return [
        replace(part, faces=np.where((_up(part) <= -_LEVEL)[:, None], part.faces[:, ::-1], part.faces))
        for part in parts
    ]


def floor_levels(parts: Sequence[Part]) -> list[tuple[float, float]]:
    """Return height (metres, world frame) and area (square metres) of each floor of a building, lowest first."""
    roof = _roof(parts)
    corners = [part.vertices[faces] for part in parts for name, faces in _sorted(part, roof) if name == "floor"]
    if not corners:
        return []
    points = np.concatenate(corners)
    area = np.linalg.norm(np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0]), axis=1) / 2
    height = points[..., 1].mean(axis=1)
    order = np.argsort(height)
    # A gap of more than 5 cm between sorted heights separates two floors.
    groups = np.split(order, np.flatnonzero(np.diff(height[order]) > 0.05) + 1)
    levels = [
        (float(np.average(height[group], weights=area[group] + 1e-9)), float(area[group].sum())) for group in groups
    ]
    return [(round(y, 3), size) for y, size in levels if size >= _STOREY]


def _standing(parts: Sequence[Part]) -> list[list[Part]]:
    """Split walls into connected pieces, the largest first; the smallest together form the last piece."""
    pieces: list[tuple[float, Part]] = []
    for part in parts:
        label = together(_welded(part))
        for number in np.unique(label):
            piece = replace(part, faces=part.faces[label == number])
            pieces.append((_area(piece), piece))
    pieces.sort(key=lambda pair: -pair[0])
    single = [[piece] for _, piece in pieces[:_WALLS]]
    return [*single, [piece for _, piece in pieces[_WALLS:]]]


def _area(part: Part) -> float:
    points = part.vertices[part.faces]
    return float(np.linalg.norm(np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0]), axis=1).sum() / 2)


def _welded(part: Part) -> Faces:
    """Return the faces with one number for all corners at the same place."""
    _, place = np.unique(np.round(part.vertices, 4), axis=0, return_inverse=True)
    return np.asarray(place.ravel()[part.faces], np.int64)


def together(faces: Faces) -> NDArray[np.int32]:
    """Return (M,) the number of the connected piece that each face belongs to."""
    count = int(faces.max()) + 1
    edges = np.concatenate([faces[:, :2], faces[:, 1:]])
    _, label = connected_components(coo_array((np.ones(len(edges)), edges.T), (count, count)), directed=False)
    return np.asarray(label[faces[:, 0]])


# -- slabs -------------------------------------------------------------------------------------------------------------
def slabs(parts: Sequence[Part], category: str) -> tuple[NDArray[np.float32], ...]:
    """Return convex pieces behind the surfaces of some parts, each (K, 3) points."""
    return tuple(
        exact(np.concatenate([polygon, polygon - _THICK[category] * normal]))
        for part in parts
        for polygon, normal in polygons(part)
    )


def polygons(part: Part) -> Iterator[tuple[Array, Array]]:
    """Merge the faces of a part into flat convex polygons; yield each with its (3,) normal.

    A polygon is (K, 3) points. The algorithm of Hertel and Mehlhorn removes an edge between two polygons if the merged
    polygon is convex and flat: then its hull is as large as both.
    """
    points, place = np.unique(np.round(part.vertices, 4), axis=0, return_inverse=True)
    faces = place.ravel()[part.faces]
    a, b, c = (points[faces[:, k]] for k in range(3))
    cross = np.cross(b - a, c - a)
    size = np.linalg.norm(cross, axis=1)
    faces, normals = faces[size > 1e-8], (cross / np.maximum(size, 1e-12)[:, None])[size > 1e-8]
    areas, owner = (size[size > 1e-8] / 2).tolist(), np.arange(len(faces))
    loops: dict[int, list[int]] = {number: face.tolist() for number, face in enumerate(faces)}
    for first, second in _neighbours(faces, points):
        left, right = int(owner[first]), int(owner[second])
        # 0.9999 is the cosine of 0.8 degrees: larger angles are edges of the building.
        if left == right or normals[left] @ normals[right] < 0.9999:
            continue
        both = list({*loops[left], *loops[right]})
        hull = _hull(points[both], normals[left])
        if hull and hull[1] <= 1.0005 * (areas[left] + areas[right]):
            loops[left], areas[left] = [both[k] for k in hull[0]], hull[1]
            owner[owner == right] = left
            del loops[right]
    yield from ((points[loop], normals[number]) for number, loop in loops.items() if areas[number] > _LEAST)


def _hull(corners: Array, normal: Array) -> tuple[list[int], float] | None:
    """Return which corners bound the convex hull of some in a plane, in order, and its area; None if they are not
    flat."""
    along = np.cross(normal, np.eye(3)[np.abs(normal).argmin()])
    try:
        hull = ConvexHull(corners @ np.stack([along, np.cross(normal, along)], axis=1) / np.linalg.norm(along))
    except QhullError:  # Slivers on a line.
        return None
    flat = np.ptp(corners @ normal) < 2e-3
    return (hull.vertices.tolist(), float(hull.volume)) if flat else None


def _neighbours(faces: Faces, points: Array) -> Iterator[tuple[int, int]]:
    """Yield the pairs of faces that alone have an edge in common, those with the longest edge first."""
    sides: dict[tuple[int, int], list[int]] = defaultdict(list)
    for number, face in enumerate(faces.tolist()):
        for k in range(3):
            sides[face[k], face[(k + 1) % 3]].append(number)
    shared = [
        (start, end) for (start, end), mine in sides.items()
        if start < end and len(mine) == 1 and len(sides.get((end, start), ())) == 1
    ]  # fmt: skip
    length = [float(np.linalg.norm(points[start] - points[end])) for start, end in shared]
    for k in np.argsort(np.negative(length), kind="stable"):
        start, end = shared[k]
        yield sides[start, end][0], sides[end, start][0]
