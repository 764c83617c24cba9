"""Convert annotated regions to rooms: cut polygons into rectangles, and snap their heights to the building's floors."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError

from humanclaw.body import Array
from humanclaw.world import Room
from humanclaw_habitat.attributes import Region

_STEP: Final = 0.25
"""Largest step into which slanted walls are cut, metres."""
_NEAR: Final = 0.4
"""Largest distance between a region's floor and the building's floor that it snaps to, metres."""
_NARROW: Final = 0.05
"""Strips narrower than this are left out, metres."""


def rooms(regions: Sequence[Region], levels: Sequence[tuple[float, float]]) -> tuple[Room, ...]:
    """Return the rectangles of all regions. The rectangles of one region share its name.

    levels: height (metres) and area (square metres) of each floor of the building.
    """
    names: dict[str, int] = {}
    areas: list[Room] = []
    for region in regions:
        kind = re.sub(r"[^a-z0-9]+", "_", (region.label or region.name or "room").lower()).strip("_")
        name = region.name or kind
        names[name] = names.get(name, 0) + 1
        if names[name] > 1:
            name = f"{name} {names[name]}"
        floor = _snapped(region.floor_height, levels)
        loop = np.array(region.poly_loop, float).reshape(-1, 3)[:, [0, 2]]
        areas += [Room(name, kind, *box, floor) for box in rectangles(loop)]
    return tuple(areas)


def _snapped(height: float, levels: Sequence[tuple[float, float]]) -> float:
    """Return the largest floor near a height; the height itself if no floor is near."""
    near = [(area, level) for level, area in levels if abs(level - height) <= _NEAR]
    return max(near)[1] if near else round(height, 3)


def floors(slabs: Sequence[Array], levels: Sequence[float]) -> tuple[Room, ...]:
    """Return rooms for a building without annotations: at each level, rectangles that cover its floor.

    slabs: (K, 3) points of each convex piece of the floor, metres. levels: heights, metres.
    """
    areas: list[Room] = []
    for number, level in enumerate(levels, 1):
        tops = [slab for slab in slabs if abs(slab[:, 1].max() - level) < 0.05]
        if not tops:
            continue
        points = np.concatenate(tops)[:, [0, 2]]
        x, z = (np.arange(a, b + _STEP, _STEP) for a, b in zip(points.min(axis=0), points.max(axis=0), strict=True))
        middle = np.stack(np.meshgrid(x[:-1] + _STEP / 2, z[:-1] + _STEP / 2, indexing="ij"), axis=-1)
        cells = np.zeros(middle.shape[:-1], bool)
        for slab in tops:
            cells |= covered(middle, slab[:, [0, 2]])
        boxes = [(float(x[a]), float(z[c]), float(x[b]), float(z[d])) for a, b, c, d in _blocks(cells)]
        areas += [Room(f"floor {number}", "room", *box, level) for box in boxes]
    return tuple(areas)


def covered(points: Array, corners: Array) -> NDArray[np.bool_]:
    """Return (...) whether (..., 2) points are within the convex hull of (K, 2) corners."""
    try:
        sides = ConvexHull(corners).equations
    except QhullError:  # A vertical piece is a line from above and covers nothing.
        return np.zeros(points.shape[:-1], bool)
    return np.asarray((points @ sides[:, :2].T + sides[:, 2] <= 1e-9).all(axis=-1))


def rectangles(loop: Array) -> list[tuple[float, float, float, float]]:
    """Cut an (N, 2) polygon into rectangles (x0, z0, x1, z1) that do not overlap; slanted sides are approximated."""
    from skimage.measure import points_in_poly  # Only annotated scenes need it.

    if len(loop) < 3:
        return []
    x, z = _lines(loop, 0), _lines(loop, 1)
    middle = np.stack(np.meshgrid((x[1:] + x[:-1]) / 2, (z[1:] + z[:-1]) / 2, indexing="ij"), axis=-1)
    inside = points_in_poly(middle.reshape(-1, 2), loop)  # type: ignore[no-untyped-call]  # scikit-image has no types.
    return [
        (float(x[a]), float(z[c]), float(x[b]), float(z[d]))
        for a, b, c, d in _blocks(inside.reshape(middle.shape[:-1]))
        if min(x[b] - x[a], z[d] - z[c]) >= _NARROW
    ]


def _lines(loop: Array, axis: int) -> Array:
    """Return the coordinates to cut at: those of every corner, and more along slanted edges."""
    cuts: list[float] = []
    for start, end in zip(loop, np.roll(loop, -1, axis=0), strict=True):
        slanted = np.abs(end - start).min() > 0.02
        count = int(np.ceil(abs(end[axis] - start[axis]) / _STEP)) if slanted else 1
        cuts += np.linspace(start[axis], end[axis], max(count, 1) + 1).tolist()
    return np.unique(np.round(cuts, 2))


def _blocks(cells: NDArray[np.bool_]) -> Iterator[tuple[int, int, int, int]]:
    """Yield rectangles that cover the set cells, each extended along z and then along x as far as it goes.

    A rectangle is the first and the last line along x, then along z.
    """
    left = cells.copy()
    for a, c in np.argwhere(cells):
        if not left[a, c]:
            continue
        b, d = a, c
        while d < left.shape[1] and left[a, d]:
            d += 1
        while b < left.shape[0] and left[b, c:d].all():
            b += 1
        left[a:b, c:d] = False
        yield int(a), int(b), int(c), int(d)
