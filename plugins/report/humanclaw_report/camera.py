"""Cameras that follow a body: in a house from behind and above, on an open floor from the side that shows most."""

from __future__ import annotations

from typing import Final

import numpy as np
import scipy

from humanclaw import Motion
from humanclaw.body import JOINT_INDEX, Array, forward_kinematics

DISTANCE: Final = 3.0
"""Distance from the camera to the body, metres."""
ELEVATION: Final = float(np.radians(38))
"""Height of the camera over the body, radians: above most furniture, and the picture shows where the body goes."""
BEHIND: Final = float(np.pi * 0.8)
"""Side from which a camera sees the body in a house, radians from straight ahead of it. Aside of its back, a picture
also shows how it sits."""
SIDES: Final = (BEHIND, -BEHIND, np.pi * 0.55, -np.pi * 0.55, np.pi * 0.3, -np.pi * 0.3)
"""Sides from which a film may see the body in a house, radians; those that show where it goes first."""
FOV: Final = 48.0
"""Vertical field of view, degrees."""
FACING, BESIDE = float(np.radians(30)), float(np.radians(65))
"""Sides from which a camera sees gestures and side steps, and motion ahead or back, radians."""
LOW: Final = float(np.radians(14))
"""Height of the camera over the body on an open floor, radians."""
_FACE: Final = (0.0, 0.2, 0.1)
"""A place in the head's frame that nodding and shaking moves, metres."""
_STILL: Final = 0.03
"""A part moves if it gets farther than this, metres."""
_MARGIN, _NEAREST = 0.16, 0.3
"""Metres: the flesh around joints, and half the height of the smallest picture."""


def framed(motion: Motion) -> tuple[Array, Array]:
    """Return (T, 3) positions of a camera that fills the picture with the parts that move, and (T, 3) what it looks at.

    The head is always in the picture. Nothing on the floor may hide the body.
    """
    joints, turns = forward_kinematics(motion.root, motion.rotations)
    head = JOINT_INDEX["head"]
    points = np.concatenate([joints, joints[:, [head]] + turns[:, [head]] @ _FACE], axis=1)
    moving = np.ptp(points, axis=0).max(-1) > _STILL
    moving[[head, -1]] = True
    low, high = points[:, moving].min(1), points[:, moving].max(1)
    centres = smoothed((low + high) / 2, 6.0)
    wide, tall, deep = np.maximum(high - centres, centres - low).max(0)
    distance = (max(tall + _MARGIN, _NEAREST) / np.tan(np.radians(FOV) / 2)) + np.hypot(wide, deep)
    yaw = motion.yaw()[0] + side(motion)
    way = np.array([np.cos(LOW) * np.sin(yaw), np.sin(LOW), np.cos(LOW) * np.cos(yaw)])
    return centres + distance * way, centres


def side(motion: Motion) -> float:
    """Return the side that shows the way of a body: across it, as far as its face can be seen."""
    yaw, (x, _, z) = motion.yaw()[0], motion.root[-1] - motion.root[0]
    ahead, left = x * np.sin(yaw) + z * np.cos(yaw), x * np.cos(yaw) - z * np.sin(yaw)
    return BESIDE if abs(ahead) > max(abs(left), 0.1) else FACING


def follow(motion: Motion, side: float = BEHIND) -> Array:
    """Return (T, 3) positions, metres, of a camera that sees the body from a side (radians) and above."""
    yaw = motion.yaw() + side
    # A mean over two seconds: a camera that turned with every step would shake.
    flat = smoothed(np.stack([np.sin(yaw), np.cos(yaw)], -1), 20.0)
    flat *= np.cos(ELEVATION) / np.linalg.norm(flat, axis=1, keepdims=True)
    ways = np.stack([flat[:, 0], np.full(len(flat), np.sin(ELEVATION)), flat[:, 1]], -1)
    return smoothed(motion.root, 6.0) + DISTANCE * ways


def smoothed(values: Array, frames: float) -> Array:
    """Smooth (T, ...) values over time. frames: standard deviation of the Gaussian."""
    return np.asarray(scipy.ndimage.gaussian_filter1d(values, frames, axis=0, mode="nearest"))
