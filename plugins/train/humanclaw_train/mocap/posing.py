"""Poses in work: world orientations of our body, and the rotations that move its limbs. Needs only numpy."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from humanclaw import Motion
from humanclaw.body import JOINT_INDEX, OFFSETS, PARENTS, Array, matrix_from_vector, vector_from_matrix

STRAIGHT: Final = 0.9995
"""Share of its length to which a leg may stretch. A leg that is never quite straight keeps its knee from snapping."""
LEG: Final = float(
    np.linalg.norm(OFFSETS[JOINT_INDEX["left_knee"]]) + np.linalg.norm(OFFSETS[JOINT_INDEX["left_ankle"]])
)
"""Length of our legs, metres."""
_BENT: Final = 0.35
"""Sine of a bend of 20 degrees: a straighter knee shows no plane, and one that is bent so far the wrong way is rare."""
_SHOWN: Final = 10
"""Frames with a bent knee, from which the twist of a leg is known."""


@dataclass(frozen=True)
class Pose:
    """A motion while it is retargeted: root (T, 3) and world orientations (T, 24, 3, 3)."""

    root: Array
    world: Array

    def motion(self) -> Motion:
        """Return it with local rotation vectors."""
        return Motion(self.root, _local(self.world))

    def at(self, joint: str, offset: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Array:
        """Return the world position (T, 3) of a point in a joint's frame."""
        index = JOINT_INDEX[joint]
        point = self.world[:, index] @ np.array(offset)
        while PARENTS[index] >= 0:
            point = point + self.world[:, PARENTS[index]] @ OFFSETS[index]
            index = PARENTS[index]
        return np.asarray(self.root + point)

    def turned(self, joint: str, turn: Array) -> Pose:
        """Replace one joint's world orientation (T, 3, 3); the others keep theirs."""
        world = self.world.copy()
        world[:, JOINT_INDEX[joint]] = turn
        return replace(self, world=world)


def _local(world: Array) -> Array:
    """Turn world orientations (T, 24, 3, 3) into local rotation vectors (T, 24, 3)."""
    parents = world[:, [max(parent, 0) for parent in PARENTS]].copy()
    parents[:, 0] = np.eye(3)
    return vector_from_matrix(np.swapaxes(parents, -1, -2) @ world)


def unit(vector: Array) -> Array:
    """Scale vectors (..., 3) to length 1."""
    return np.asarray(vector / np.maximum(np.linalg.norm(vector, axis=-1, keepdims=True), 1e-12))


def swing(start: Array, end: Array) -> Array:
    """Return the smallest rotation (..., 3, 3) that turns direction start to direction end."""
    start, end = np.broadcast_arrays(unit(start), unit(end))
    axis = np.cross(start, end)
    x, y, z = np.moveaxis(axis, -1, 0)
    zero = np.zeros_like(x)
    cross = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], -1).reshape(*axis.shape[:-1], 3, 3)
    cos = np.sum(start * end, -1)[..., None, None]
    # Rodrigues' formula without angles; the bound keeps opposite directions finite.
    return np.asarray(np.eye(3) + cross + cross @ cross / np.maximum(1.0 + cos, 1e-6))


def reach_ankle(root: Array, world: Array, side: str, ankle: Array) -> Array:
    """Turn one leg so that its ankle is at `ankle` (T, 3), by two-bone inverse kinematics.

    The knee keeps bending in its old plane. Returns the world orientations (T, 24, 3, 3).
    """
    hip, knee, foot = (JOINT_INDEX[f"{side}_{name}"] for name in ("hip", "knee", "ankle"))
    thigh, shin = np.linalg.norm(OFFSETS[knee]), np.linalg.norm(OFFSETS[foot])
    start = root + world[:, 0] @ OFFSETS[hip]
    reach = ankle - start
    # Neither folded together nor quite straight: at both ends the plane of the knee would be undefined.
    distance = np.clip(np.linalg.norm(reach, axis=-1, keepdims=True), 0.25 * (thigh + shin), STRAIGHT * (thigh + shin))
    along = unit(reach)
    hinge = world[:, hip, :, 0] + world[:, knee, :, 0]  # Turns least of all parts of a leg, even in a deep squat.
    forward = unit(np.cross(along, hinge))
    cos = (thigh**2 + distance**2 - shin**2) / (2 * thigh * distance)
    bend = thigh * (cos * along + np.sqrt(np.maximum(1 - cos**2, 0.0)) * forward)
    result = world.copy()
    result[:, hip] = swing(world[:, hip] @ OFFSETS[knee], bend) @ world[:, hip]
    result[:, knee] = swing(world[:, knee] @ OFFSETS[foot], distance * along - bend) @ world[:, knee]
    return result


def hinged(world: Array, side: str, thigh: Array, shin: Array) -> Array:
    """Turn thigh and shin about themselves by one angle, which lays the knee's hinge across the plane that it bends in.

    thigh, shin: (T, 3), as captured. A reference pose that is a frame of the motion, or whose bones are mirrored, gives
    a leg another twist. Returns the world orientations (T, 24, 3, 3).
    """
    hip, knee = JOINT_INDEX[f"{side}_hip"], JOINT_INDEX[f"{side}_knee"]
    along, normal = unit(thigh), np.cross(unit(thigh), unit(shin))
    hinge = world[:, hip, :, 0] + world[:, knee, :, 0]
    bent = np.linalg.norm(normal, axis=-1) > _BENT
    sine, cosine = np.sum(along * np.cross(hinge, normal), -1), np.sum(hinge * normal, -1)
    if bent.sum() < _SHOWN:
        return world
    angle = np.arctan2(sine[bent].sum(), cosine[bent].sum())
    result = world.copy()
    for joint, bone in ((hip, along), (knee, unit(shin))):
        result[:, joint] = matrix_from_vector(angle * bone) @ world[:, joint]
    return result
