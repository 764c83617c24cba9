"""Posture: what nobody commands does not add up.

The model writes the change of a pose, and people hold their wrists, toes and heads in ways of their own, so it goes on
with whatever it finds in its history. Its own small errors are found there as well: in eighty calls in a row a wrist
turns by a right angle, and in a hundred a body is no body any more. People correct that without thinking. So here each
joint that carries no weight comes back, within every chunk, by a tenth of how far it is from its usual pose.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from humanclaw.body.pose import FUTURE, Array, Motion, smoothstep
from humanclaw.body.skeleton import JOINT_INDEX, N_JOINTS

_BACK: Final = 0.1
"""Share by which it comes back in a chunk. The fastest of these errors grows by 7 % a chunk."""
_MOST: Final = 0.35
"""Radians: of what is further off no more than this counts. An arm that a skill holds up is no error."""
_WITHIN: Final = 10
"""Frames in which it comes back, so that the next history begins there."""
_LOADED: Final = ("pelvis", "left_hip", "right_hip", "left_knee", "right_knee")
"""Joints that carry weight: they are left alone, and the ankles' swing to and fro is, too."""


def _free() -> Array:
    """(24, 3) 1 for what carries no weight."""
    free = np.ones((N_JOINTS, 3))
    free[[JOINT_INDEX[name] for name in _LOADED]] = 0
    free[[JOINT_INDEX["left_ankle"], JOINT_INDEX["right_ankle"]], 0] = 0
    return free


_RAMP: Final = smoothstep(np.arange(1, FUTURE + 1) / _WITHIN)[:, None, None]
_FREE: Final = _free()


def settle(history: Motion, future: Motion, usual: Array) -> Motion:
    """Return the future with what carries no weight nearer to its usual pose. usual: (24, 3) rotation vectors,
    radians."""
    off = np.clip(history.rotations[-1] - usual, -_MOST, _MOST)
    return Motion(future.root, future.rotations - _BACK * _RAMP * _FREE * off)
