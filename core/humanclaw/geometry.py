"""Distances that scoring and records share. Metres, world frame."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from humanclaw.pose import Array


def distance_to_box(points: Array, low: Array, high: Array) -> Array:
    """(..., 3) points to (...) Euclidean distances to the axis-aligned box [low, high]; 0 inside."""
    outside = np.maximum(np.maximum(low - points, points - high), 0.0)
    return np.asarray(np.linalg.norm(outside, axis=-1))


def distance_to_nearest(points: Array, boxes: Iterable[tuple[Array, Array]]) -> float:
    """From the nearest of (..., 3) points to the nearest of several boxes, each (low, high); infinite without a box."""
    return min((float(distance_to_box(points, low, high).min()) for low, high in boxes), default=float("inf"))
