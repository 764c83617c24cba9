"""A camera that follows a body: close, with a clear view, and without jerks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
import scipy
from numpy.typing import NDArray

from humanclaw import Motion, Scene
from humanclaw.body import JOINT_INDEX, Array
from humanclaw.world import Camera, OccupancyGrid

DISTANCE: Final = 3.0
"""Distance from the camera to the body, metres."""
AZIMUTHS: Final = np.radians(np.arange(0, 360, 30))
ELEVATIONS: Final = np.radians([25, 38, 52, 66, 80])
PREFERRED_ELEVATION: Final = float(np.radians(32))
_PARTS: Final = ("head", "pelvis", "left_wrist", "right_wrist", "left_knee", "right_knee", "left_foot", "right_foot")
WATCHED: Final = [JOINT_INDEX[name] for name in _PARTS]
BEHIND: Final = float(np.pi)
FACING: Final = float(np.pi / 6)
"""Sides from which a camera sees the body, radians from straight ahead of it."""
KEY: Final = 8
"""Frames between two key frames; the camera chooses a direction at each key frame."""


def sight(scene: Scene, floor: float) -> OccupancyGrid:
    """Return the plan of a storey for a camera above it, which sees the storey below through the stairwell."""
    plan = OccupancyGrid.of(scene, floor)
    well = np.isnan(plan.ground) & (plan.tops == 0)
    return replace(plan, tops=np.where(well, -np.inf, plan.tops))


def look_at(eye: Array, centre: Array, size: tuple[int, int], fov: float = 48.0) -> Camera:
    """Return a camera at eye that looks at centre without roll. size: width and height, pixels; fov: degrees."""
    forward = (centre - eye) / np.linalg.norm(centre - eye)
    right = np.cross(forward, [0.0, 1.0, 0.0])
    up = np.cross(right / np.linalg.norm(right), forward)
    return Camera(eye, forward, up, fov, *size)


def follow(plans: Sequence[OccupancyGrid], storeys: NDArray[np.int64], motion: Motion, side: float = BEHIND) -> Array:
    """Return (T, 3) positions, metres, of a camera that sees the body from one side and moves as little as possible.

    A Viterbi search finds the cheapest sequence of directions. A direction costs more if something hides the body, if
    it is far from the preferred side, and if the camera swings far to get there.

    Args:
        plans: Plan of each storey as it is shown.
        storeys: (T,) index of the storey that the body is on.
        side: Preferred direction of the camera from the body, radians; 0 is ahead of it.
    """
    keys = np.arange(0, len(motion), KEY)
    azimuth, elevation = (grid.ravel() for grid in np.meshgrid(AZIMUTHS, ELEVATIONS, indexing="ij"))
    ways = np.stack([np.cos(elevation) * np.sin(azimuth), np.sin(elevation), np.cos(elevation) * np.cos(azimuth)], -1)
    swing = np.arccos(np.clip(ways @ ways.T, -1, 1))
    cost = np.empty((len(keys), len(ways)))
    for k, plan in enumerate(plans):
        here = storeys[keys] == k
        cost[here] = _discomfort(plan, motion, keys[here], azimuth - side, elevation, ways)
    chosen = _cheapest(cost, 2.5 * swing)
    offsets = np.stack([np.interp(np.arange(len(motion)), keys, ways[chosen, axis]) for axis in range(3)], -1)
    offsets = smoothed(offsets, 9.0)
    # Between two directions the camera would cut the corner and come closer.
    offsets *= DISTANCE / np.linalg.norm(offsets, axis=1, keepdims=True)
    return smoothed(motion.root, 6.0) + offsets


def smoothed(values: Array, frames: float) -> Array:
    """Smooth (T, ...) values over time. frames: standard deviation of the Gaussian."""
    return np.asarray(scipy.ndimage.gaussian_filter1d(values, frames, axis=0, mode="nearest"))


def _discomfort(
    plan: OccupancyGrid, motion: Motion, keys: NDArray[np.int64], azimuth: Array, elevation: Array, ways: Array
) -> Array:
    """Return the (K, W) cost of each direction at each key frame. azimuth: from the preferred side."""
    joints, yaw = motion.joints()[keys], motion.yaw()[keys]
    aside = 0.5 * (1 - np.cos(azimuth[None] - yaw[:, None]))
    steep = np.abs(elevation - PREFERRED_ELEVATION)
    eyes = joints[:, None, 0] + DISTANCE * ways
    # The floor around the feet counts too: a picture says little if the top of a wall hides where the body stands.
    soles = joints[:, :, 1].min(1)[:, None, None] * [0, 1, 0]
    ground = joints[:, None, 0] * [1, 0, 1] + soles + [0, 0.05, 0] + _ring(0.8)
    hidden = 1 - plan.sees(eyes[:, :, None], joints[:, None, WATCHED]).mean(-1)
    veiled = 1 - plan.sees(eyes[:, :, None], ground[:, None]).mean(-1)
    return np.asarray(12.0 * hidden + 4.0 * veiled + aside + steep[None])


def _ring(radius: float) -> Array:
    """Return (6, 3) points on a horizontal circle around the origin. radius: metres."""
    angle = np.linspace(0, 2 * np.pi, 6, endpoint=False)
    return radius * np.stack([np.sin(angle), 0 * angle, np.cos(angle)], -1)


def _cheapest(cost: Array, change: Array) -> NDArray[np.int64]:
    """Return the (K,) states of least total cost (Viterbi).

    cost: (K, W) of each state at each key frame; change: (W, W) from one state to the next.
    """
    total, back = cost[0], []
    for row in cost[1:]:
        options = total[:, None] + change
        back.append(options.argmin(0))
        total = options.min(0) + row
    states = [int(total.argmin())]
    for came in reversed(back):
        states.append(int(came[states[-1]]))
    return np.array(states[::-1])
