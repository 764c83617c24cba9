"""Products of unit quaternions x, y, z, w, many at a time."""

from __future__ import annotations

import numpy as np

from humanclaw.pose import Array


def multiply(a: Array, b: Array) -> Array:
    """(..., 4) times (..., 4): the rotation b, then the rotation a."""
    vector_a, vector_b, w_a, w_b = a[..., :3], b[..., :3], a[..., 3:], b[..., 3:]
    vector = w_a * vector_b + w_b * vector_a + np.cross(vector_a, vector_b)
    return np.concatenate([vector, w_a * w_b - np.sum(vector_a * vector_b, -1, keepdims=True)], -1)


def conjugate(quaternion: Array) -> Array:
    """The inverse rotation of each (..., 4) unit quaternion."""
    return np.asarray(quaternion * np.array([-1.0, -1.0, -1.0, 1.0]))


def from_vector(vector: Array) -> Array:
    """(..., 3) rotation vectors to (..., 4) quaternions."""
    half = np.linalg.norm(vector, axis=-1, keepdims=True) / 2
    return np.concatenate([vector * (0.5 * np.sinc(half / np.pi)), np.cos(half)], -1)


def capped(vector: Array, limit: float) -> Array:
    """(..., 3) rotation vectors (or velocities) shortened to a length of at most limit, direction kept."""
    length = np.linalg.norm(vector, axis=-1, keepdims=True)
    return np.asarray(vector * np.minimum(1.0, limit / np.maximum(length, 1e-12)))
