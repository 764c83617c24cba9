"""Move the pelvis over feet that stay where they are."""

from __future__ import annotations

from typing import Final

import numpy as np

from humanclaw.body.pose import Array, Motion, forward_kinematics, matrix_from_vector, vector_from_matrix
from humanclaw.body.skeleton import JOINT_INDEX, OFFSETS
from humanclaw.motion.ik import REACH, SIDES, Limb, solve

LEGS: Final = tuple(f"{side}_{joint}" for side in SIDES for joint in ("hip", "knee", "ankle", "foot"))


def planted(motion: Motion, pose: Motion) -> Motion:
    """Return a motion with legs that keep both feet as they are in the last frame of a pose, as far as legs reach."""
    joints, orientations = forward_kinematics(pose.root[-1], pose.rotations[-1])
    rotations = motion.rotations.copy()
    root = matrix_from_vector(rotations[:, 0])
    for side in SIDES:
        hip, knee, ankle = (JOINT_INDEX[f"{side}_{joint}"] for joint in ("hip", "knee", "ankle"))
        start = motion.root + root @ OFFSETS[hip]
        thigh, shin = _leg(side, start, joints[ankle], orientations[ankle])
        for joint, parent, turned in ((hip, root, thigh), (knee, thigh, shin), (ankle, shin, orientations[ankle])):
            rotations[:, joint] = vector_from_matrix(np.swapaxes(parent, -1, -2) @ turned)
    return Motion(motion.root, rotations)


def _leg(side: str, start: Array, ankle: Array, foot: Array) -> tuple[Array, Array]:
    """Return the orientations (T, 3, 3) of thigh and shin. The knee points where the foot does."""
    limb = Limb.leg(side)
    ahead = np.broadcast_to(foot[:, 2], start.shape)
    return solve(limb, start, np.broadcast_to(ankle, start.shape), ahead, slack=limb.reach - REACH)
