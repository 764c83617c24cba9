"""Legs of synthetic motion: feet that roll on the ground, and hips within the reach of both legs.

Everything is vectorised: (...) is any leading shape, (N, 2, T) are the left and right feet of N bodies over T frames.
Metres and radians, Y up; an orientation is a (3, 3) matrix from the part's frame to the world. Needs only numpy.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from humanclaw.body import JOINT_INDEX, OFFSETS, SOLE, Array, matrix_from_vector, smoothstep, wrap_angle
from humanclaw.motion import REACH, SIDES, TOE_BASE, Limb, solve

HEEL: Final = np.array([0.0, -SOLE, -0.06])
"""Rear edge of the sole, from the ankle in the frame of the foot."""

SOLE_POINTS: Final = (HEEL, np.array([0.0, -SOLE, 0.13]), np.array([0.0, -SOLE, 0.19]))
"""Rear edge, ball and tip of the sole, from the ankle in the frame of a foot with straight toes."""


def foot_orientation(yaw: Array, pitch: Array) -> Array:
    """Turn yaw and pitch (...) of a foot, positive with the heel up, into world orientations (..., 3, 3)."""
    sin, cos, down, level = np.sin(yaw), np.cos(yaw), np.sin(pitch), np.cos(pitch)
    zero = np.zeros_like(sin)
    rows = [[cos, sin * down, sin * level], [zero, level, -down], [-sin, cos * down, cos * level]]
    return np.stack([np.stack(np.broadcast_arrays(*row), -1) for row in rows], -2)


def ankle_over(sole: Array, yaw: Array, pitch: Array) -> Array:
    """Return the ankle (..., 3) of a foot that rolls on the ground. sole: the point below the ankle of the flat foot.

    A raised heel (pitch > 0) pivots about the toe base, raised toes (pitch < 0) about the heel. Within .14 radians
    of flat the two pivots are mixed, so that the ankle's velocity is continuous.
    """
    flat, tilted = foot_orientation(yaw, np.zeros_like(pitch)), foot_orientation(yaw, pitch)
    weight = smoothstep((pitch / 0.14 + 1) / 2)[..., None]
    up = np.array([0.0, SOLE, 0.0])
    toe = sole + up + flat @ TOE_BASE - tilted @ TOE_BASE
    heel = sole + up + flat @ HEEL - tilted @ HEEL
    return np.asarray(weight * toe + (1 - weight) * heel)


Track = tuple[Array, Array, Array, Array]
"""One foot of `Feet` over a chunk: sole (N, 16, 3), yaw, pitch and bend (N, 16)."""


# -- both legs of a body -----------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Feet:
    """Both feet over time.

    sole (N, 2, T, 3): the point on the ground below the ankle of a flat foot. yaw, pitch, bend (N, 2, T). Positive
    pitch raises the heel; positive bend of the toes keeps them flat when the heel is up.
    """

    sole: Array
    yaw: Array
    pitch: Array
    bend: Array

    def ankles(self, lift: Array | float = 0.0) -> Array:
        """Return the ankles (N, 2, T, 3), with the heels raised by `lift` radians more."""
        return ankle_over(self.sole, self.yaw, self.pitch + lift)

    def where(self, which: NDArray[np.bool_], other: Feet) -> Feet:
        """Return these feet for the bodies in `which` (N,) and the other feet elsewhere."""
        pairs = ((getattr(self, field.name), getattr(other, field.name)) for field in fields(self))
        return Feet(*(np.where(which.reshape(-1, *(1 for _ in a.shape[1:])), a, b) for a, b in pairs))

    def tilted(self, extra: Array) -> Feet:
        """Raise the heels further while the toes stay in place."""
        return replace(self, pitch=self.pitch + extra, bend=self.bend + extra)


def hips(root: Array, pelvis: Array) -> Array:
    """Return the hip joints (N, 2, T, 3) of a pelvis at (N, T, 3) with orientation (N, T, 3, 3)."""
    return np.stack([root + pelvis @ OFFSETS[JOINT_INDEX[f"{side}_hip"]] for side in SIDES], 1)


def ceiling(root: Array, pelvis: Array, feet: Feet, lift: Array) -> Array:
    """Return the highest pelvis (N, T) from which both legs reach their feet, if heels may rise by `lift` (N, 2, T)."""
    ankle, hip = feet.ankles(lift), hips(root, pelvis)
    away = np.sum((ankle - hip)[..., [0, 2]] ** 2, -1)
    highest = ankle[..., 1] + np.sqrt(np.maximum(REACH**2 - away, 0.04)) + root[:, None, :, 1] - hip[..., 1]
    return np.asarray(highest.min(1))


def raise_heels(root: Array, pelvis: Array, feet: Feet, lift: Array) -> Feet:
    """Raise heels by at most `lift` (N, 2, T) where a leg would not reach its foot."""
    hip = hips(root, pelvis)
    extra = np.zeros_like(feet.pitch)
    for _ in range(3):  # Each radian of heel brings the ankle about 0.11 m closer; three steps converge.
        gap = np.linalg.norm(feet.ankles(extra) - hip, axis=-1) - REACH
        extra = np.clip(extra + np.maximum(gap, 0.0) / 0.11, 0.0, lift)
    return feet.tilted(extra)


def ease_ankles(root: Array, pelvis: Array, feet: Feet, yaw: Array) -> Feet:
    """Raise heels where a shin leans further over its foot than an ankle bends, .52 rad. yaw: (N, T) of the hips."""
    shin = _legs(root, pelvis, feet, yaw)[1]
    up = np.swapaxes(foot_orientation(feet.yaw, feet.pitch), -1, -2) @ shin[..., 1, None]
    lean = np.arctan2(up[..., 2, 0], up[..., 1, 0])
    return feet.tilted(0.9 * _excess(lean - 0.52, 0.2))


def place_legs(root: Array, pelvis: Array, feet: Feet, yaw: Array) -> dict[str, Array]:
    """Return local rotations (N, T, 3, 3) of hips, knees, ankles and feet by joint name that place the feet."""
    thigh, shin = _legs(root, pelvis, feet, yaw)
    foot = foot_orientation(feet.yaw, feet.pitch)
    toes = np.zeros((*feet.bend.shape, 3))
    toes[..., 0] = -np.clip(feet.bend, 0.0, 0.9)
    parts = {
        "hip": np.swapaxes(pelvis, -1, -2)[:, None] @ thigh,
        "knee": np.swapaxes(thigh, -1, -2) @ shin,
        "ankle": np.swapaxes(shin, -1, -2) @ foot,
        "foot": matrix_from_vector(toes),
    }
    return {f"{side}_{part}": both[:, index] for part, both in parts.items() for index, side in enumerate(SIDES)}


def _legs(root: Array, pelvis: Array, feet: Feet, yaw: Array) -> tuple[Array, Array]:
    """Return the orientations of thighs and shins. Knees point ahead and slightly up, halfway between hips and foot."""
    aim = yaw[:, None] + 0.5 * wrap_angle(feet.yaw - yaw[:, None])
    pole = np.stack([0.94 * np.sin(aim), np.full_like(aim, 0.35), 0.94 * np.cos(aim)], -1)
    return solve(Limb.leg("left"), hips(root, pelvis), feet.ankles(), pole)  # Both legs have the same bones.


def _excess(value: Array, width: float) -> Array:
    """Return max(value, 0) with its corner rounded over `width` on either side."""
    return np.asarray(np.where(value > width, value, np.maximum(value + width, 0.0) ** 2 / (4 * width)))
