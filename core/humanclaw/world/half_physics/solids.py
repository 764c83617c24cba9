"""What an engine needs to know of convex hulls."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from humanclaw.body.pose import Array

_BOX_TOLERANCE: Final = 1e-5
"""Metres from a face of its box within which a corner lies on it: above the rounding of single precision in a house."""
_FLAT, _THICK = 1e-4, 1e-3
"""A hull that is thinner than this, and how thick it becomes, metres: no engine takes one without a volume."""


def solids(hulls: Sequence[NDArray[np.float32]]) -> list[Array]:
    """Return the hulls of an asset as engines take them: flat ones, and such of one or two points, 1 mm thick."""
    return [_thickened(hull.astype(float)) for hull in hulls]


def _thickened(hull: Array) -> Array:
    spread = hull - hull.mean(axis=0)
    _, axes = np.linalg.eigh(spread.T @ spread)
    for axis in axes.T[np.ptp(spread @ axes, axis=0) < _FLAT]:
        hull = np.concatenate([hull - _THICK / 2 * axis, hull + _THICK / 2 * axis])
    return hull


def box_of(hull: Array) -> tuple[Array, Array] | None:
    """Centre and half extents of a hull that is an axis-aligned box; None for any other."""
    low, high = hull.min(axis=0), hull.max(axis=0)
    on_face = np.minimum(np.abs(hull - low), np.abs(hull - high)) < _BOX_TOLERANCE
    corners = {tuple(row) for row in (hull > (low + high) / 2).tolist()}
    if not on_face.all() or len(corners) != 8:
        return None
    return (low + high) / 2, (high - low) / 2


def nearest_point(hull: Array, point: Array) -> Array:
    """Return the point (3,) of a convex hull, given by points (K, 3), that is nearest to a point."""
    from scipy.optimize import nnls  # Every command loads this module; few ask.

    away, much = hull - point, 1e3
    shares, _ = nnls(np.vstack([away.T, np.full(len(hull), much)]), np.array([0.0, 0.0, 0.0, much]))
    return np.asarray(point + shares @ away / shares.sum())


def centre_of_mass(hulls: Sequence[Array]) -> Array:
    """Return (3,) centre of the hulls, each counted by the volume of its bounding box."""
    size, middle, _ = _boxes(hulls)
    return np.asarray(size @ middle / size.sum())


def inertia(hulls: Sequence[Array], mass: float) -> Array:
    """Return (3, 3) inertia about the centre of mass, kg m2, each hull taken for its bounding box."""
    size, middle, extent = _boxes(hulls)
    total = np.zeros((3, 3))
    for weight, centre, edges in zip(mass * size / size.sum(), middle - centre_of_mass(hulls), extent, strict=True):
        own = np.diag((edges**2).sum() - edges**2) / 12
        total += weight * (own + centre @ centre * np.eye(3) - np.outer(centre, centre))
    return total


def _boxes(hulls: Sequence[Array]) -> tuple[Array, Array, Array]:
    """(n,) volumes, (n, 3) centres and (n, 3) edges of the hulls' bounding boxes."""
    extent = np.array([np.ptp(hull, axis=0) for hull in hulls])
    middle = np.array([(hull.min(axis=0) + hull.max(axis=0)) / 2 for hull in hulls])
    return np.prod(extent, axis=1) + 1e-9, middle, extent
