"""Motions that are easy to reason about."""

from __future__ import annotations

from typing import Final

import numpy as np

from humanclaw.body.pose import FPS, FUTURE, Array, Motion, rest_pose, smoothstep
from humanclaw.body.skeleton import JOINT_INDEX, OFFSETS, SOLE
from humanclaw.motion.leg_ik import solve_legs

_HIPS: Final = OFFSETS[[JOINT_INDEX["left_hip"], JOINT_INDEX["right_hip"]]] * [1.0, 0.0, 0.0]
"""(2, 3) how far beside the pelvis each foot stands, metres."""


def glide(x: float, z: float, frames: int = FUTURE) -> Motion:
    """Return a standing body that glides at a constant velocity, m/s: the simplest command with a known path."""
    motion = rest_pose(frames)
    path = np.arange(1, frames + 1)[:, None] / FPS * [x, 0.0, z]
    return Motion(motion.root + path, motion.rotations)


def gait(count: int, run: float, rise: float = 0.0) -> Motion:
    """Return steps from standing, 0.6 s each: `run` metres forward (the first one 0.45) and `rise` metres up."""
    feet, pelvis = [np.zeros(3), np.zeros(3)], np.array([0.0, 0.93, 0.0])
    roots: list[Array] = []
    ways: list[Array] = []
    for step in range(count + 1):
        moving, start, from_pelvis = step % 2, feet[step % 2], pelvis
        goal = np.array([0.0, rise * min(step + 1, count), 0.45 + run * min(step, count - 1)])
        other = feet[1 - moving]
        over = np.array([0.0, min(goal[1], other[1]) + 0.93, goal[2] if step == count else (goal[2] + other[2]) / 2])
        for t in np.arange(1, 19) / 18:
            smooth = smoothstep(t)
            foot = start + (goal - start) * smooth
            foot[1] = start[1] + (goal[1] - start[1]) * min(1.0, 1.6 * smooth) + 0.06 * np.sin(np.pi * t)
            feet[moving], pelvis = foot, from_pelvis + (over - from_pelvis) * smooth
            roots.append(pelvis)
            ways.append(np.stack(feet))
    walked = _on_feet(np.array(roots), np.array(ways))
    return walked.then(walked.held(FUTURE + (-len(roots)) % FUTURE))


def sitting_down(height: float, z: float) -> Motion:
    """Return 1.5 s of sitting down to a pelvis at (height, z) with still feet, then 1 s of sitting."""
    share = (np.arange(1, 46) / 45)[:, None]
    standing, seated = np.array([0.0, 0.96, 0.0]), np.array([0.0, height, z])
    roots = standing + (seated - standing) * share
    sat = _on_feet(roots, np.zeros((2, 3)))
    return sat.then(sat.held(FPS))


def _on_feet(roots: Array, feet: Array) -> Motion:
    """Return a body with a pelvis at (T, 3) and level feet at (T, 2, 3) or (2, 3), left first; its arms hang."""
    ankles = feet + _HIPS + [0.0, SOLE, 0.0]
    return solve_legs(Motion(roots, rest_pose(len(roots)).rotations), ankles, np.stack([np.eye(3)] * 2))
