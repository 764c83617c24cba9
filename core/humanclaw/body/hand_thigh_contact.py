"""Lay hands that rest on raised thighs flat on them.

The model points the fingers of a seated body into its thighs, by up to 8 cm. The correction depends on the pose of each
frame alone, so that it neither jumps nor adds up.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from humanclaw.body.ik import SIDES, Limb, bent
from humanclaw.body.pose import Array, Motion, forward_kinematics, matrix_from_vector, smoothstep, vector_from_matrix
from humanclaw.body.skeleton import JOINT_INDEX, LINKS, Capsule

RAISED: Final = 0.5
"""Bend of the straighter hip, radians, below which nobody sits. Walks and stairs bend it by .53 at most."""
_SITS: Final = 0.3
"""Radians more with which somebody does. A sit on a seat of 65 cm is commanded with a bend of .74."""
HIPS: Final = [JOINT_INDEX[f"{side}_hip"] for side in SIDES]
_MARGIN: Final = 0.012
"""Metres between hand and thigh: arms follow a seat that lifts the thighs with a delay."""
_CLEAR: Final = _MARGIN + sum(
    link.shape.radius for link in LINKS if link.joint in ("left_hip", "left_elbow") and isinstance(link.shape, Capsule)
)
"""Distance of a wrist from the axis of the thigh that it rests on, metres."""
_PALM: Final = _MARGIN + 0.084
"""Distance of a flat palm from the axis of the thigh, metres: its radius, and half the palm's thickness."""
_EDGE: Final = 0.06
"""Distance of the palm's inner edge from the wrist, to the side, metres: half its width, and what _INWARDS adds."""
_INWARDS: Final = 0.25
"""Sine of the angle by which fingers point inwards."""


def lay_hands(motion: Motion, hips: Array | None = None) -> Motion:
    """Return a motion (any frame) whose hands do not reach into the thighs below them.

    hips: (2, 3) rotation vectors of the thighs, left first, where a seat holds them otherwise than the motion.
    """
    bent_legs = motion.rotations.copy()
    if hips is not None:
        bent_legs[:, HIPS] = hips
    sits = smoothstep((-bent_legs[:, HIPS, 0].max(-1) - RAISED) / _SITS)
    if not sits.any():
        return motion
    positions, turns = forward_kinematics(motion.root, bent_legs)
    rotations = motion.rotations.copy()
    for side, sign in zip(SIDES, (1.0, -1.0), strict=True):
        _lay_hand(side, sign, sits, positions, turns, rotations)
    return Motion(motion.root, rotations)


def _lay_hand(side: str, sign: float, sits: Array, positions: Array, turns: Array, rotations: Array) -> None:
    """Move one arm, in place. positions (T, 24, 3), turns (T, 24, 3, 3), rotations (T, 24, 3). sign: 1 for the left.

    sits: (T,) 1 where the body sits.
    """
    hip, collar, shoulder, elbow, wrist, hand = (
        JOINT_INDEX[f"{side}_{joint}"] for joint in ("hip", "collar", "shoulder", "elbow", "wrist", "hand")
    )
    thigh = turns[:, hip]
    local = np.einsum("tji,tj->ti", thigh, positions[:, wrist] - positions[:, hip])
    rests = sits * _rests(local, thigh[:, 1, 2])
    raised = local.copy()
    raised[:, 2] = np.maximum(local[:, 2], _over(np.abs(local[:, 0])))
    lift = np.einsum("tij,tj->ti", thigh, raised - local)
    arm = positions[:, [shoulder, elbow, wrist]]
    upper, fore = bent(Limb.arm(side), arm, turns[:, [shoulder, elbow]], arm[:, 2] + rests[:, None] * lift)
    flat = thigh @ _flat(sign)
    way = vector_from_matrix(np.swapaxes(turns[:, wrist], -1, -2) @ flat)
    palm = turns[:, wrist] @ matrix_from_vector(rests[:, None] * way)
    for joint, parent, turn in ((shoulder, turns[:, collar], upper), (elbow, upper, fore), (wrist, fore, palm)):
        rotations[:, joint] = vector_from_matrix(np.swapaxes(parent, -1, -2) @ turn)
    rotations[:, hand] *= (1 - rests)[:, None]


def _over(aside: Array) -> Array:
    """Return the height of a wrist over the axis of the thigh (T,), whose forearm and palm are clear of it."""
    edge = np.maximum(aside - _EDGE, 0.0)
    return np.sqrt(np.maximum(np.maximum(_CLEAR**2 - aside**2, _PALM**2 - edge**2), 0.0))


def _rests(wrist: Array, level: Array) -> Array:
    """Return how far a wrist (T, 3), in the frame of a thigh, rests on it (T,), 0 to 1. level: cosine of its slope.

    The model's hands lie 7 to 13 cm over the axis, 14 to 24 cm from the hip and at most 4 cm aside, on slopes from .77
    on. All of that is 1; arms that hang beside the thigh (12 cm and more aside) are left alone.
    """
    x, y, z = wrist.T
    over = smoothstep((z + 0.12) / 0.08) * smoothstep((0.2 - z) / 0.05) * smoothstep((0.17 - np.abs(x)) / 0.06)
    return np.asarray(over * smoothstep((-y - 0.02) / 0.08) * smoothstep((level - 0.2) / 0.4))


def _flat(sign: float) -> Array:
    """Return the orientation of a hand in the frame of the thigh: palm down, fingers to the knee."""
    fingers = np.array([-sign * _INWARDS, -np.sqrt(1 - _INWARDS**2), 0.0])
    back = np.array([0.0, 0.0, 1.0])
    return np.stack([sign * fingers, back, np.cross(sign * fingers, back)], -1)
