"""Move the pelvis over feet whose places are given."""

from __future__ import annotations

from typing import Final

import numpy as np

from humanclaw.body.ik import REACH, SIDES, Limb, solve
from humanclaw.body.pose import Array, Motion, forward_kinematics, matrix_from_vector, vector_from_matrix
from humanclaw.body.skeleton import JOINT_INDEX, OFFSETS

LEGS: Final = tuple(f"{side}_{joint}" for side in SIDES for joint in ("hip", "knee", "ankle", "foot"))
LEG_JOINTS: Final = np.array([[JOINT_INDEX[f"{side}_{part}"] for part in ("hip", "knee", "ankle")] for side in SIDES])
"""(2, 3) Hip, knee and ankle of both legs, left first."""
_UP: Final = np.array([0.0, 0.4, 0.0])
"""Knees of a body that lies come up, and not through the floor."""
ANKLES: Final = (JOINT_INDEX["left_ankle"], JOINT_INDEX["right_ankle"])
FEET: Final = (JOINT_INDEX["left_foot"], JOINT_INDEX["right_foot"])


def keep_feet(motion: Motion, pose: Motion) -> Motion:
    """Return a motion with legs that keep both feet as they are in the last frame of a pose, as far as legs reach."""
    joints, orientations = forward_kinematics(pose.root[-1], pose.rotations[-1])
    return solve_legs(motion, joints[list(ANKLES)], orientations[list(ANKLES)])


def solve_legs(motion: Motion, ankles: Array, feet: Array) -> Motion:
    """Return a motion with legs whose ankles (..., 2, 3) and feet (..., 2, 3, 3), left first, are where given, as far
    as legs reach; for all frames, or each of T."""
    rotations = motion.rotations.copy()
    root = matrix_from_vector(rotations[:, 0])
    for index, (side, (hip, knee, ankle)) in enumerate(zip(SIDES, LEG_JOINTS, strict=True)):
        foot = np.broadcast_to(feet[..., index, :, :], root.shape)
        start = motion.root + root @ OFFSETS[hip]
        thigh, shin = _leg(side, start, ankles[..., index, :], foot)
        for joint, parent, turned in ((hip, root, thigh), (knee, thigh, shin), (ankle, shin, foot)):
            rotations[:, joint] = vector_from_matrix(np.swapaxes(parent, -1, -2) @ turned)
    return Motion(motion.root, rotations)


def _leg(side: str, start: Array, ankle: Array, foot: Array) -> tuple[Array, Array]:
    """Return the orientations (T, 3, 3) of thigh and shin. The knee points where the foot does, and slightly up."""
    limb = Limb.leg(side)
    ahead = foot[..., 2] + _UP
    return solve(limb, start, np.broadcast_to(ankle, start.shape), ahead, slack=limb.reach - REACH)
