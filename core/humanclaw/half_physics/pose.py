"""One pose of the body as a physics engine keeps it: a root position and unit quaternions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from humanclaw.half_physics.quaternions import from_vector
from humanclaw.pose import Array, Motion, vector_from_quaternion


@dataclass(frozen=True)
class Pose:
    """One pose of the tree. root: (3,). quaternions: (24, 4) x, y, z, w; the first in the world frame, others in the
    parent's."""

    root: Array
    quaternions: Array


def poses_of(motion: Motion) -> tuple[Pose, ...]:
    """Return one pose a frame."""
    return tuple(Pose(root, from_vector(turn)) for root, turn in zip(motion.root, motion.rotations, strict=True))


def motion_of(poses: Sequence[Pose]) -> Motion:
    """Return the inverse of poses_of."""
    quaternions = np.stack([pose.quaternions for pose in poses])
    return Motion(np.stack([pose.root for pose in poses]), vector_from_quaternion(quaternions))
