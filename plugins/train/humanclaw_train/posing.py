"""POSING_DOC"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from humanclaw import Motion
from humanclaw.body import JOINT_INDEX, OFFSETS, PARENTS
from humanclaw.pose import Array, vector_from_matrix

STRAIGHT: Final = 0.9995
"""Share of its length that a leg may stretch to: one that is never quite straight keeps its knee from snapping."""
LEG: Final = float(
    np.linalg.norm(OFFSETS[JOINT_INDEX["left_knee"]]) + np.linalg.norm(OFFSETS[JOINT_INDEX["left_ankle"]])
)


@dataclass(frozen=True)
class Pose:
    """Root (T, 3) and world orientations (T, 24, 3, 3) of a motion that is being worked on."""

    root: Array
    world: Array

    def motion(self) -> Motion:
        return Motion(self.root, _local(self.world))

    def at(self, joint: str, offset: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Array:
        """(T, 3) world position of a point in a joint's frame."""
        index = JOINT_INDEX[joint]
        point = self.world[:, index] @ np.array(offset)
        while PARENTS[index] >= 0:
            point = point + self.world[:, PARENTS[index]] @ OFFSETS[index]
            index = PARENTS[index]
        return np.asarray(self.root + point)

    def turned(self, joint: str, turn: Array) -> Pose:
        """One joint's orientation replaced; the others keep theirs."""
        world = self.world.copy()
        world[:, JOINT_INDEX[joint]] = turn
        return replace(self, world=world)


def _local(world: Array) -> Array:
    """(T, 24, 3, 3) world orientations to (T, 24, 3) local rotation vectors."""
    parents = world[:, [max(parent, 0) for parent in PARENTS]].copy()
    parents[:, 0] = np.eye(3)
    return vector_from_matrix(np.swapaxes(parents, -1, -2) @ world)


def unit(vector: Array) -> Array:
    return np.asarray(vector / np.maximum(np.linalg.norm(vector, axis=-1, keepdims=True), 1e-12))


def swing(start: Array, end: Array) -> Array:
    """(..., 3, 3) the least rotation that carries direction start to direction end."""
    start, end = np.broadcast_arrays(unit(start), unit(end))
    axis = np.cross(start, end)
    x, y, z = np.moveaxis(axis, -1, 0)
    zero = np.zeros_like(x)
    cross = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], -1).reshape(*axis.shape[:-1], 3, 3)
    cos = np.sum(start * end, -1)[..., None, None]
    return np.asarray(np.eye(3) + cross + cross @ cross / np.maximum(1.0 + cos, 1e-6))


def reach_ankle(root: Array, world: Array, side: str, ankle: Array) -> Array:
    """Two-bone inverse kinematics: turn one leg so that its ankle lies at (T, 3) `ankle`, the knee bending in its old
    plane."""
    hip, knee, foot = (JOINT_INDEX[f"{side}_{name}"] for name in ("hip", "knee", "ankle"))
    thigh, shin = np.linalg.norm(OFFSETS[knee]), np.linalg.norm(OFFSETS[foot])
    start = root + world[:, 0] @ OFFSETS[hip]
    reach = ankle - start
    distance = np.clip(np.linalg.norm(reach, axis=-1, keepdims=True), 0.25 * (thigh + shin), STRAIGHT * (thigh + shin))
    along = unit(reach)
    hinge = world[:, hip, :, 0] + world[:, knee, :, 0]  # turns less than any other part of a leg, even in a deep squat
    forward = unit(np.cross(along, hinge))
    cos = (thigh**2 + distance**2 - shin**2) / (2 * thigh * distance)
    bend = thigh * (cos * along + np.sqrt(np.maximum(1 - cos**2, 0.0)) * forward)
    result = world.copy()
    result[:, hip] = swing(world[:, hip] @ OFFSETS[knee], bend) @ world[:, hip]
    result[:, knee] = swing(world[:, knee] @ OFFSETS[foot], distance * along - bend) @ world[:, knee]
    return result
