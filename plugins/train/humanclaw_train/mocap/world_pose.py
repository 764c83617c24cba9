"""Poses in work: world orientations of our body, and the rotations that move its limbs. Needs only numpy."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from humanclaw import Motion
from humanclaw.body import JOINT_INDEX, OFFSETS, PARENTS, Array, matrix_from_vector, vector_from_matrix
from humanclaw.motion import Limb, solve

STRAIGHT: Final = 0.9995
"""Share of its length to which a leg may stretch. A leg that is never quite straight keeps its knee from snapping."""
LEG: Final = Limb.leg("left").reach
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


def reach_ankle(root: Array, world: Array, side: str, ankle: Array, hinge: Array | None = None) -> Array:
    """Turn one leg so that its ankle is at `ankle` (T, 3), by two-bone inverse kinematics.

    hinge: (T, 3) axis of the knee; None for its own. Returns the world orientations (T, 24, 3, 3).
    """
    hip, knee = JOINT_INDEX[f"{side}_hip"], JOINT_INDEX[f"{side}_knee"]
    start = root + world[:, 0] @ OFFSETS[hip]
    # The knee bends in its old plane: its axis turns least of all parts of a leg, even in a deep squat.
    pole = np.cross(ankle - start, world[:, hip, :, 0] + world[:, knee, :, 0] if hinge is None else hinge)
    result = world.copy()
    result[:, hip], result[:, knee] = solve(Limb.leg(side), start, ankle, pole, slack=(1 - STRAIGHT) * LEG)
    return result


def hinge_of(world: Array, side: str, thigh: Array, shin: Array) -> Array:
    """Return the axis of a knee (T, 3), turned about the thigh by one angle, across the plane that the knee bends in.

    thigh, shin: (T, 3), as captured. A reference pose that is a frame of the motion, or whose bones are mirrored, gives
    a leg another twist.
    """
    along, normal = unit(thigh), np.cross(unit(thigh), unit(shin))
    hinge = world[:, JOINT_INDEX[f"{side}_hip"], :, 0] + world[:, JOINT_INDEX[f"{side}_knee"], :, 0]
    bent = np.linalg.norm(normal, axis=-1) > _BENT
    sine, cosine = np.sum(along * np.cross(hinge, normal), -1), np.sum(hinge * normal, -1)
    if bent.sum() < _SHOWN:  # Even then no thigh faces back.
        return hinge if np.sum(hinge * world[:, 0, :, 0]) > 0 else world[:, 0, :, 0]
    angle = np.arctan2(sine[bent].sum(), cosine[bent].sum())
    return np.asarray((matrix_from_vector(angle * along) @ hinge[..., None])[..., 0])
