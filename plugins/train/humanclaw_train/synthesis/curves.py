"""Curves of motion synthesis over u in [0, 1], and floor vectors (x, z). Needs only numpy."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from humanclaw.body import FUTURE, Array

GRID: Final = np.arange(FUTURE + 1) / FUTURE
"""The 16 instants of a chunk; the first belongs to the previous chunk."""


def smoother(u: Array) -> Array:
    """Ease from 0 to 1 with zero velocity and acceleration at the ends."""
    u = np.clip(u, 0.0, 1.0)
    return np.asarray(u**3 * (10 - 15 * u + 6 * u * u))


def bump(u: Array) -> Array:
    """Return 0 at the ends and 1 in the middle, with zero velocity and acceleration at the ends."""
    u = np.clip(u, 0.0, 1.0)
    return np.asarray(64 * (u * (1 - u)) ** 3)


def quintic(u: Array, p0: Array, v0: Array, a0: Array, p1: Array, v1: Array) -> Array:
    """Go from p0 to p1 with velocities v0 and v1 and accelerations a0 and zero, all per unit of u."""
    d, e = p1 - p0 - v0 - a0 / 2, v1 - v0 - a0
    c3, c4, c5 = 10 * d - 4 * e - a0 / 2, -15 * d + 7 * e + a0, 6 * d - 3 * e - a0 / 2
    return np.asarray(p0 + u * (v0 + u * (a0 / 2 + u * (c3 + u * (c4 + u * c5)))))


def cubic(u: Array, p0: Array, v0: Array | float, p1: Array, v1: Array | float) -> Array:
    """Go from p0 to p1 with velocities v0 and v1 per unit of u; constant outside [0, 1]."""
    u = np.clip(u, 0.0, 1.0)
    d = p1 - p0
    return np.asarray(p0 + u * (v0 + u * ((3 * d - 2 * v0 - v1) + u * (v0 + v1 - 2 * d))))


def soft_minimum(a: Array, b: Array, width: Array) -> Array:
    """Return the minimum with a rounded corner; exact where the two differ by more than width."""
    return np.asarray(np.minimum(a, b) - np.maximum(width - np.abs(a - b), 0.0) ** 2 / (4 * width))


def turned(vector: Array, yaw: Array) -> Array:
    """Turn floor vectors (..., 2) by yaw (...)."""
    sin, cos = np.sin(yaw), np.cos(yaw)
    return np.stack([vector[..., 0] * cos + vector[..., 1] * sin, vector[..., 1] * cos - vector[..., 0] * sin], -1)


def floor(points: Array) -> Array:
    """Project points (..., 3) to the floor (..., 2)."""
    return np.asarray(points[..., [0, 2]])


def raised(points: Array, height: Array) -> Array:
    """Lift floor points (..., 2) to a height (...): (..., 3)."""
    return np.stack([points[..., 0], np.broadcast_to(height, points.shape[:-1]), points[..., 1]], -1)


def moving(sole: Array) -> NDArray[np.bool_]:
    """Return at which instants a foot (N, 16, 3) moves (N, 16)."""
    moves = np.abs(np.diff(sole, axis=1, append=sole[:, -1:])).sum(-1) > 1e-4
    moves[:, -1] = moves[:, -2]  # The last instant has no difference of its own.
    return np.asarray(moves)
