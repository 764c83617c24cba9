"""Products of unit quaternions x, y, z, w, many at a time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from humanclaw.body.pose import Array, Motion, vector_from_quaternion

_PRODUCT: Final = np.array([
    [[0, 0, 0, -1], [0, 0, -1, 0], [0, 1, 0, 0], [1, 0, 0, 0]],
    [[0, 0, 1, 0], [0, 0, 0, -1], [-1, 0, 0, 0], [0, 1, 0, 0]],
    [[0, -1, 0, 0], [1, 0, 0, 0], [0, 0, 0, -1], [0, 0, 1, 0]],
    [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]],
], float).reshape(4, 16)  # fmt: skip
"""For each component of b the matrix that maps a to its share of the product, flattened."""


def multiply(a: Array, b: Array) -> Array:
    """Multiply (..., 4) by (..., 4): the rotation b, then the rotation a."""
    # Two matrix products: written out for each component, numpy takes several times as long.
    by_b = (b @ _PRODUCT).reshape(*np.shape(b)[:-1], 4, 4)
    return np.asarray((a[..., None, :] @ by_b)[..., 0, :])


def conjugate(quaternion: Array) -> Array:
    """Return the inverse rotation of each (..., 4) unit quaternion."""
    return np.asarray(quaternion * np.array([-1.0, -1.0, -1.0, 1.0]))


def from_vector(vector: Array) -> Array:
    """Map (..., 3) rotation vectors to (..., 4) quaternions."""
    half = np.linalg.norm(vector, axis=-1, keepdims=True) / 2
    return np.concatenate([vector * (0.5 * np.sinc(half / np.pi)), np.cos(half)], -1)


def blend(a: Array, b: Array, share: float) -> Array:
    """Blend (..., 4) quaternions on the short way from a to b, nearly at a constant rate: made for neighbours."""
    mixed = a + share * (np.where(np.sum(a * b, -1, keepdims=True) < 0, -b, b) - a)
    return np.asarray(mixed / np.linalg.norm(mixed, axis=-1, keepdims=True))


@dataclass(frozen=True)
class Pose:
    """One pose of the tree. root: (3,). quaternions: (24, 4) x, y, z, w; the first in the world frame, others in the
    parent's."""

    root: Array
    quaternions: Array


def poses_of(motion: Motion) -> tuple[Pose, ...]:
    """Return one pose a frame."""
    return tuple(map(Pose, motion.root, from_vector(motion.rotations)))


def motion_of(poses: Sequence[Pose]) -> Motion:
    """Return the inverse of poses_of."""
    quaternions = np.stack([pose.quaternions for pose in poses])
    return Motion(np.stack([pose.root for pose in poses]), vector_from_quaternion(quaternions))
