"""A camera that follows a body from one side."""

from __future__ import annotations

from typing import Final

import numpy as np
import scipy

from humanclaw import Motion
from humanclaw.body import Array

DISTANCE: Final = 3.0
"""Distance from the camera to the body, metres."""
ELEVATION: Final = float(np.radians(38))
"""Height of the camera over the body, radians: above most furniture, and the picture shows where the body goes."""
BEHIND: Final = float(np.pi * 0.8)
FACING: Final = float(np.pi / 6)
"""Sides from which a camera sees the body, radians from straight ahead of it. Aside of its back, a picture also shows
how it sits."""


def follow(motion: Motion, side: float = BEHIND) -> Array:
    """Return (T, 3) positions, metres, of a camera that sees the body from one side.

    side: direction of the camera from the body, radians; 0 is ahead of it.
    """
    yaw = motion.yaw() + side
    # A mean over two seconds: a camera that turned with every step would shake.
    flat = smoothed(np.stack([np.sin(yaw), np.cos(yaw)], -1), 20.0)
    flat *= np.cos(ELEVATION) / np.linalg.norm(flat, axis=1, keepdims=True)
    ways = np.stack([flat[:, 0], np.full(len(flat), np.sin(ELEVATION)), flat[:, 1]], -1)
    return smoothed(motion.root, 6.0) + DISTANCE * ways


def smoothed(values: Array, frames: float) -> Array:
    """Smooth (T, ...) values over time. frames: standard deviation of the Gaussian."""
    return np.asarray(scipy.ndimage.gaussian_filter1d(values, frames, axis=0, mode="nearest"))
