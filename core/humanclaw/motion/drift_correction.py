"""Keep posture errors from adding up: joints without a command return slowly to their usual pose.

The model continues any pose of its history, its own small errors included. Without correction a wrist turns by a right
angle within eighty calls. So each joint that carries no weight comes closer to its usual pose, by a share of each
frame's distance; a knee bends like a hinge, and an ankle stops at its limit. A shift by the distance of the history
would drive the swing of the trunk: in straight walks of 80 cm shoulders turned by 37 degrees instead of 15.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from humanclaw.body.pose import FUTURE, Array, Motion, smoothstep
from humanclaw.body.skeleton import JOINT_INDEX, N_JOINTS
from humanclaw.motion.leg_ik import LEG_JOINTS

_BACK: Final = 0.1
"""Share of the return in a chunk. The fastest of these errors grows by 7 % a chunk."""
_TWIST: Final = 0.2
"""The same for the twist of feet in the air, which grows by 5 degrees a chunk in fast curves, until they point
backwards. Foot locking keeps the heading of feet that stand."""
_MOST: Final = 0.035
"""Radians of the return in a chunk at most: an arm that a skill holds up is no error."""
_EASY, _LAST = np.radians([55.0, 13.0])
"""Where the last degrees of an ankle begin, and how many they are: within `JOINT_LIMITS`, which count from standing."""
_WITHIN: Final = 10
"""Frames of the return, so that the next history begins corrected."""
_HIPS, _KNEES, _ANKLES = LEG_JOINTS.T


def _shares() -> Array:
    """Return (24, 3) shares of the return in a chunk, 0 for the axes that carry weight."""
    shares = np.full((N_JOINTS, 3), _BACK)
    shares[_ANKLES, 1] = _TWIST
    shares[_KNEES] = 1  # In fifty side steps 30 degrees of sideways bend added up, and twisted the feet by 90.
    shares[[JOINT_INDEX["pelvis"], *_HIPS]] = 0
    shares[[*_KNEES, *_ANKLES], 0] = 0
    return shares


_RAMP: Final = smoothstep(np.arange(1, FUTURE + 1) / _WITHIN)[:, None, None]
_SOON: Final = smoothstep(np.arange(1, FUTURE + 1) / 4)[:, None, None]
"""Only histories begin with an ankle beyond its limit; at once it would throw the foot."""
_SHARES: Final = _shares()
_LIMITS: Final = np.where(np.isin(np.arange(N_JOINTS), _ANKLES), np.pi, _MOST)[:, None]
"""Radians of the return in a chunk at most (24, 1): the twist of an ankle is always an error."""


def correct_drift(future: Motion, usual: Array) -> Motion:
    """Return the future with weightless joints nearer to their usual pose and ankles within their limit.

    usual: (24, 3) rotation vectors, radians. Foot locking, which comes later, may turn an ankle by a few degrees more.
    """
    rotations = future.rotations - _RAMP * np.clip(_SHARES * (future.rotations - usual), -_LIMITS, _LIMITS)
    # Foot locking bends a knee further the way it is bent: one that is 3 degrees beyond straight, by 60 backwards.
    # Hip and ankle turn back by half as much, so that the foot stays: in fast curves it jolted at 150 m/s².
    rotations[:, LEG_JOINTS, 0] += np.maximum(-rotations[:, _KNEES, 0], 0.0)[..., None] * [-0.5, 1.0, -0.5]
    rotations[:, _ANKLES] += _SOON * (_eased(rotations[:, _ANKLES]) - rotations[:, _ANKLES])
    return Motion(future.root, rotations)


def _eased(ankles: Array) -> Array:
    """Return rotation vectors (..., 3) that turn by no more than the joint's limit. The last degrees come gently."""
    angles = np.linalg.norm(ankles, axis=-1, keepdims=True)
    eased = np.minimum(angles, _EASY) + _LAST * np.tanh(np.maximum(angles - _EASY, 0.0) / _LAST)
    return np.asarray(ankles * (eased / np.maximum(angles, 1e-9)))
