"""Measures of motion from joint positions and poses: ground contact, smoothness, joint limits, likeness and gait.

Shapes: T frames at 30 fps, ... any number of leading axes; joints (..., T, 24, 3) in metres, Y up. Needs only numpy.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from humanclaw import Motion
from humanclaw.body import (
    FPS,
    HISTORY,
    JOINT_INDEX,
    JOINT_LIMITS,
    JOINTS,
    TOE_SOLE,
    Array,
    forward_kinematics,
    support_height,
)
from humanclaw_train.synthesis.profiles import passings

_TOUCH: Final = 0.02
"""A sole below this height touches the ground, metres."""
_TOES: Final = (JOINT_INDEX["left_foot"], JOINT_INDEX["right_foot"])
_LEGS: Final = [JOINT_INDEX[f"{side}_{part}"] for side in ("left", "right") for part in ("hip", "knee", "ankle")]


# -- contact with the ground -------------------------------------------------------------------------------------------
def skate(joints: Array) -> float:
    """Return the mean horizontal speed of toes that touch a floor at 0, cm/s; NaN if none does."""
    low = joints[..., _TOES, 1] - TOE_SOLE < _TOUCH
    # A speed lies between two frames, and the toe must touch in both.
    both = low[..., 1:, :] & low[..., :-1, :]
    speed = _toe_speed(joints)
    return float(speed[both].mean()) if both.any() else float("nan")


def slower_toe(joints: Array) -> float:
    """Return the mean horizontal speed of the slower toe, cm/s.

    In steps one foot always stands, so this is the skate of the standing foot at any height of the ground.
    """
    return float(_toe_speed(joints).min(-1).mean())


def slide(joints: Array) -> Array:
    """Return how far the slower toe slides over T frames (...), cm: zero for clean steps."""
    return np.asarray(_toe_speed(joints).min(-1).sum(-1) / FPS)


def _toe_speed(joints: Array) -> Array:
    steps = np.diff(joints[..., _TOES, :], axis=-3)[..., [0, 2]]
    return np.asarray(100 * FPS * np.linalg.norm(steps, axis=-1))


def penetration(joints: Array) -> float:
    """Return the mean depth of the lowest sole under a floor at 0, cm."""
    return float(100 * np.clip(-support_height(joints), 0, None).mean())


# -- smoothness --------------------------------------------------------------------------------------------------------
def acceleration(joints: Array) -> Array:
    """Return the largest acceleration of any joint (..., T - 2), m/s^2; entry t is that at frame t + 1."""
    return np.asarray(np.linalg.norm(np.diff(joints, n=2, axis=-3), axis=-1).max(-1) * FPS**2)


SEAM: Final = slice(HISTORY - 2, HISTORY)
"""The accelerations across the seam of history and future, of a chunk's 18."""


def joint_jerk(joints: Array) -> float:
    """Return the mean third derivative of all joint positions, m/s^3, from one-frame differences."""
    return float(np.linalg.norm(np.diff(joints, n=3, axis=-3), axis=-1).mean() * FPS**3)


# -- joint limits ------------------------------------------------------------------------------------------------------
def beyond_limits(rotations: Array) -> float:
    """Return the share of poses (..., 24, 3) in which a joint of a leg turns further than JOINT_LIMITS, %."""
    turned = np.degrees(np.linalg.norm(rotations[..., _LEGS, :], axis=-1))
    return float(100 * (turned > [JOINT_LIMITS[JOINTS[joint]] for joint in _LEGS]).any(-1).mean())


# -- likeness ----------------------------------------------------------------------------------------------------------
COMPONENTS: Final = 16
"""Principal components of the Frechet distance. A distance needs twice as many chunks."""


@dataclass(frozen=True)
class Features:
    """Features for the Frechet distance: canonical joint positions (m) and velocities (m/s) of 15 future frames.

    Each of the 2160 numbers is scaled to mean 0 and standard deviation 1 over real motion. Then they are projected on
    the first 16 principal components of real motion, in units of each component's standard deviation. mean, scale:
    (2160,). axes: (2160, 16).
    """

    mean: Array
    scale: Array
    axes: Array

    @classmethod
    def of(cls, root: Array, rotations: Array) -> Features:
        """Fit to canonical chunks of real motion, root (N, 20, 3) and rotations (N, 20, 24, 3)."""
        raw = _raw(root, rotations)
        # Noise in what hardly varies would else count as much as the gait.
        mean, scale = raw.mean(0), np.maximum(raw.std(0), 0.01)
        _, spread, axes = np.linalg.svd((raw - mean) / scale, full_matrices=False)
        kept = min(COMPONENTS, len(axes))
        return cls(mean, scale, axes[:kept].T * (np.sqrt(len(raw)) / spread[:kept]))

    def __call__(self, root: Array, rotations: Array) -> Array:
        """Return the features of canonical chunks (N, 16)."""
        return np.asarray((_raw(root, rotations) - self.mean) / self.scale @ self.axes)


def _raw(root: Array, rotations: Array) -> Array:
    joints, _ = forward_kinematics(root[:, HISTORY - 1 :], rotations[:, HISTORY - 1 :])
    velocity = np.diff(joints, axis=1) * FPS
    return np.concatenate([joints[:, 1:], velocity], -1).reshape(len(root), -1)


def frechet(a: NDArray[np.float64], b: NDArray[np.float64]) -> float:
    """Return the Frechet distance of two samples, (N, k) and (M, k), as normal distributions.

    NaN if either has fewer than 2 k rows. |m_a - m_b|^2 + tr(C_a + C_b - 2 (C_a C_b)^(1/2)).
    """
    if min(len(a), len(b)) < 2 * a.shape[1]:
        return float("nan")
    first, second = np.cov(a.T), np.cov(b.T)
    # tr (C_a C_b)^(1/2) by the symmetric C_a^(1/2) C_b C_a^(1/2), which has the same eigenvalues.
    values, vectors = np.linalg.eigh(first)
    root = vectors * np.sqrt(values.clip(0)) @ vectors.T
    cross = np.sqrt(np.linalg.eigvalsh(root @ second @ root).clip(0)).sum()
    return float(np.square(a.mean(0) - b.mean(0)).sum() + np.trace(first) + np.trace(second) - 2 * cross)


# -- gait --------------------------------------------------------------------------------------------------------------
SPEED: Final = "speed m/s"


def gait(walk: Motion) -> dict[str, float] | None:
    """Measure a straight walk over its whole steps, by heading with its unit; angles in degrees.

    None for less than two steps.
    """
    crossed, _ = passings(walk)
    if len(crossed) < 3:
        return None
    walk = walk[int(np.ceil(crossed[0])) : int(crossed[-1]) + 1]
    joints, facing = walk.joints(), walk.yaw()
    ahead = np.stack([np.sin(facing), np.cos(facing)], -1)
    floor, velocity = walk.root[:, [0, 2]], np.gradient(walk.root[:, [0, 2]], axis=0)
    along = (floor[-1] - floor[0]) / np.linalg.norm(floor[-1] - floor[0])
    aside = np.array([along[1], -along[0]])
    knees = np.linalg.norm(walk.rotations[:, [JOINT_INDEX["left_knee"], JOINT_INDEX["right_knee"]]], axis=-1)
    arm = joints[:, JOINT_INDEX["left_wrist"]] - joints[:, JOINT_INDEX["left_shoulder"]]
    width, double = _stances(joints, aside)
    return {
        SPEED: float(FPS * np.linalg.norm(velocity, axis=-1).mean()),  # Of the pelvis over the floor.
        "steps/s": float(FPS * (len(crossed) - 1) / (crossed[-1] - crossed[0])),
        # Peak to peak of the pelvis: its height, and across its path.
        "bob cm": 100 * _about_trend(walk.root[:, 1], 1),
        "sway cm": 100 * _about_trend(floor @ aside, 3),
        "swing knee": float(np.degrees(np.percentile(knees, 98))),  # Not the most, which capture noise exceeds.
        "toe-off": _heel_pitch(walk),
        # Peak to peak.
        "pelvis yaw": _about_trend(np.degrees(np.unwrap(facing)), 2),
        "shoulder yaw": _about_trend(np.degrees(np.unwrap(_yaw(joints, "shoulder"))), 2),
        "trunk": _lean(joints, ahead),
        "width cm": width,
        "both feet %": double,
        "arms cm": float(100 * np.ptp(np.sum(arm[:, [0, 2]] * ahead, -1))),  # Of a wrist ahead of its shoulder.
        "slower toe cm/s": slower_toe(joints),
        "jerk m/s3": joint_jerk(joints),
    }


def _heel_pitch(walk: Motion) -> float:
    """Return the mean over the feet of the greatest heel pitch, degrees."""
    _, turns = forward_kinematics(walk.root, walk.rotations)
    down = -turns[:, [JOINT_INDEX["left_ankle"], JOINT_INDEX["right_ankle"]], 1, 2]
    return float(np.degrees(np.arcsin(down.max(0).clip(-1, 1))).mean())


def _yaw(joints: Array, pair: str) -> Array:
    """Return the yaw of the line from the right to the left joint of a pair (T,)."""
    line = joints[:, JOINT_INDEX[f"left_{pair}"]] - joints[:, JOINT_INDEX[f"right_{pair}"]]
    return np.asarray(np.arctan2(-line[:, 2], line[:, 0]))


def _lean(joints: Array, ahead: Array) -> float:
    """Return the mean lean of the trunk to the front, degrees."""
    trunk = joints[:, JOINT_INDEX["neck"]] - joints[:, JOINT_INDEX["pelvis"]]
    return float(np.degrees(np.arctan2(np.sum(trunk[:, [0, 2]] * ahead, -1), trunk[:, 1])).mean())


_STANDS: Final = 40.0
"""Speed of toes, cm/s, below which a foot stands."""


def _stances(joints: Array, aside: Array) -> tuple[float, float]:
    """Return the distance of standing ankles across the path, cm, and the share of frames in which both stand, %."""
    stands = _toe_speed(joints) < _STANDS
    ankles = 100 * joints[:-1, [JOINT_INDEX["left_ankle"], JOINT_INDEX["right_ankle"]]][..., [0, 2]] @ aside
    ankles -= _trend(ankles.mean(1), 3)[:, None]
    left, right = (ankles[stands[:, foot], foot] for foot in (0, 1))
    width = float(left.mean() - right.mean()) if len(left) and len(right) else float("nan")
    return width, float(100 * stands.all(1).mean())


def _trend(values: Array, degree: int) -> Array:
    time = np.linspace(-1, 1, len(values))
    return np.asarray(np.polyval(np.polyfit(time, values, degree), time))


def _about_trend(values: Array, degree: int) -> float:
    return float(np.ptp(values - _trend(values, degree)))
