"""Two-bone inverse kinematics: a leg or an arm whose end is to be somewhere.

Vectorised: (...) is any leading shape. Metres and radians, Y up; an orientation is a (3, 3) matrix from the part's
frame to the world. Needs numpy alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from humanclaw.body.pose import Array, matrix_from_vector
from humanclaw.body.skeleton import JOINT_INDEX, OFFSETS, SOLE, TOE_SOLE, Side

TOE_BASE: Final = np.array([0.0, TOE_SOLE - SOLE, 0.13])
"""From ankle to toe base in the frame of the foot."""
REACH: Final = 0.8175
"""From hip to ankle at most: a knee that locks straight would jerk as it bends again."""
SIDES: Final[tuple[Side, Side]] = ("left", "right")


@dataclass(frozen=True)
class Limb:
    """Two bones and their hinge. upper, lower: offsets of the hinge and of the end in the rest pose.

    hinge: the axis, in the rest frame, about which a positive angle bends the limb.
    """

    upper: Array
    lower: Array
    hinge: Array

    @property
    def reach(self) -> float:
        return float(np.linalg.norm(self.upper) + np.linalg.norm(self.lower))

    @classmethod
    def leg(cls, side: str) -> Limb:
        """Return the knee bends about +X, which carries the shin backwards."""
        knee, ankle = (OFFSETS[JOINT_INDEX[f"{side}_{joint}"]] for joint in ("knee", "ankle"))
        return cls(knee, ankle, np.array([1.0, 0.0, 0.0]))

    @classmethod
    def arm(cls, side: str) -> Limb:
        """Return the elbow bends about the vertical of the T-pose, which carries the hand forwards."""
        elbow, wrist = (OFFSETS[JOINT_INDEX[f"{side}_{joint}"]] for joint in ("elbow", "wrist"))
        return cls(elbow, wrist, np.array([0.0, -1.0 if side == "left" else 1.0, 0.0]))


def solve(limb: Limb, start: Array, end: Array, pole: Array, slack: float = 1e-4) -> tuple[Array, Array]:
    """World orientations (..., 3, 3) of the two bones that carry the limb from start (..., 3) to end (..., 3).

    pole: (..., 3) the direction in which the hinge points. An end out of reach is approached as far as the limb goes,
    less slack.
    """
    a, b = float(np.linalg.norm(limb.upper)), float(np.linalg.norm(limb.lower))
    span = np.asarray(end, float) - start
    distance = np.linalg.norm(span, axis=-1)
    reached = np.clip(distance, abs(a - b) + slack, a + b - slack)
    bend = np.arccos(np.clip((reached**2 - a * a - b * b) / (2 * a * b), -1.0, 1.0))
    fold = matrix_from_vector(bend[..., None] * limb.hinge)
    rest = _basis(limb.upper + fold @ limb.lower, np.broadcast_to(limb.hinge, span.shape))
    # The hinge lies square to the plane of start, end and pole; on a leg that hangs, pole x span is the body's left.
    side = _cross(pole, span) * float(np.sign(np.dot(_cross(_pole(limb), limb.upper), limb.hinge)))
    upper = _basis(span / np.maximum(distance, 1e-9)[..., None], side) @ np.swapaxes(rest, -1, -2)
    return upper, upper @ fold


def bent(limb: Limb, joints: Array, turns: Array, end: Array, reach: float = np.inf) -> tuple[Array, Array]:
    """Turn both bones just so much that a limb ends at `end` (T, 3), as far as `reach`; its hinge keeps its direction.

    joints: (T, 3, 3) start, hinge and end as they are. turns: (T, 2, 3, 3) of the bones. Returns both (T, 3, 3).
    """
    start, hinge, tip = np.moveaxis(joints, 1, 0)
    span = tip - start
    along = span / np.linalg.norm(span, axis=-1, keepdims=True)
    out = (hinge - start) - np.sum((hinge - start) * along, -1, keepdims=True) * along
    # Of a straight limb the hinge points nowhere; then it points where the upper bone faces.
    pole = out + 0.01 * turns[:, 0, :, 2]
    farthest = np.maximum(reach, np.linalg.norm(span, axis=-1))
    wanted = end - start
    distance = np.linalg.norm(wanted, axis=-1)
    reachable = start + wanted * np.minimum(1.0, farthest / distance)[:, None]
    (old, new), (old_lower, new_lower) = solve(limb, start, np.stack([tip, reachable]), pole)
    pairs = ((old, new), (old_lower, new_lower))
    upper, lower = (to @ np.swapaxes(was, -1, -2) @ turns[:, bone] for bone, (was, to) in enumerate(pairs))
    return upper, lower


def _pole(limb: Limb) -> Array:
    """Where the hinge points in the rest pose: away from where the end goes when the limb bends."""
    return -_cross(limb.hinge, limb.lower)


def _basis(along: Array, side: Array) -> Array:
    first = along / np.linalg.norm(along, axis=-1, keepdims=True)
    square = side - np.sum(side * first, -1, keepdims=True) * first
    second = square / np.maximum(np.linalg.norm(square, axis=-1, keepdims=True), 1e-9)
    return np.stack([first, second, _cross(first, second)], -1)


def _cross(a: Array, b: Array) -> Array:
    """Return (..., 3) cross products: numpy's own takes several times as long for few of them."""
    return a[..., _NEXT] * b[..., _LAST] - a[..., _LAST] * b[..., _NEXT]


_NEXT, _LAST = [1, 2, 0], [2, 0, 1]
