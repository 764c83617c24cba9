"""How far joints turn, and where a pose has its weight. Needs numpy alone."""

from __future__ import annotations

from itertools import product
from typing import Final

import numpy as np
from numpy.typing import NDArray

from humanclaw.body.pose import Array, Motion, matrix_from_vector, rest_pose, vector_from_matrix
from humanclaw.body.skeleton import JOINT_INDEX, JOINTS, LINKS, Box, Capsule

_KINDS: Final = {
    "pelvis": 360, "spine": 60, "hip": 135, "knee": 160, "ankle": 70, "foot": 70, "neck": 50, "collar": 60, "head": 55,
    "shoulder": 180, "elbow": 160, "wrist": 100, "hand": 80,
}  # fmt: skip
JOINT_LIMITS: Final = {joint: next(most for kind, most in _KINDS.items() if kind in joint) for joint in JOINTS}
"""Degrees that each joint turns from the standing pose about any axis. Pelvis and shoulders are not limited."""
KNEE_BACK: Final = 20.0
"""Degrees that a knee bends the wrong way."""
_MOST: Final = np.radians([JOINT_LIMITS[joint] for joint in JOINTS])
_KNEES: Final = [JOINT_INDEX["left_knee"], JOINT_INDEX["right_knee"]]
_STANDING: Final = matrix_from_vector(rest_pose().rotations[0])
_TOLERANCE: Final = 1e-6
"""Radians: below any angle that shows, and above what rounding leaves of a held joint. Smaller ones count as no
turn."""
_CENTRES: Final = np.array(
    [np.add(link.shape.a, link.shape.b) / 2 if isinstance(link.shape, Capsule) else link.shape.centre for link in LINKS]
)
_MASSES: Final = np.array([link.mass for link in LINKS])
_SIGNS: Final = np.array(list(product((-1, 1), repeat=3)))
"""(8, 3): which way each corner of a box lies from its centre."""
_SHAPES: Final = {link.joint: link.shape for link in LINKS if isinstance(link.shape, Box)}
SHOES: Final = {
    JOINT_INDEX[joint]: _SHAPES[joint].centre + _SIGNS * _SHAPES[joint].half
    for joint in ("left_ankle", "left_foot", "right_ankle", "right_foot")
}
"""Joint of each part of a shoe to the (8, 3) corners of its box, in the joint's frame, metres."""
_SHOE_PARTS, _SHOE_CORNERS = list(SHOES), np.array(list(SHOES.values()))
_LINKED: Final = [JOINT_INDEX[link.joint] for link in LINKS]


def within_limits(motion: Motion, pose: Motion) -> tuple[Motion, tuple[str, ...]]:
    """Return a motion with every joint turned back to its limit, and the names of the joints that were.

    pose: one frame before the motion. A joint that is beyond its limit there may stay, but goes no further.
    """
    turns, before = _from_standing(motion.rotations), _from_standing(pose.rotations[-1])
    angles = np.linalg.norm(turns, axis=-1)
    most = np.maximum(_MOST, np.linalg.norm(before, axis=-1))
    held = turns * np.minimum(1.0, most / np.maximum(angles, _TOLERANCE))[..., None]
    back = np.minimum(-np.radians(KNEE_BACK), before[_KNEES, 0])
    held[:, _KNEES, 0] = np.maximum(held[:, _KNEES, 0], back)
    over: NDArray[np.bool_] = (np.abs(held - turns) > _TOLERANCE).any((0, 2))
    rotations = motion.rotations.copy()
    rotations[:, over] = vector_from_matrix(_STANDING[over] @ matrix_from_vector(held[:, over]))
    return Motion(motion.root, rotations), tuple(joint for joint, beyond in zip(JOINTS, over, strict=True) if beyond)


def angles_from_standing(rotations: Array) -> Array:
    """Return how far each joint of (..., 24, 3) rotations is turned from the standing pose, (..., 24) degrees."""
    return np.asarray(np.degrees(np.linalg.norm(_from_standing(rotations), axis=-1)))


def _from_standing(rotations: Array) -> Array:
    """Return the turns (..., 24, 3) from the standing pose, rotation vectors."""
    return vector_from_matrix(np.swapaxes(_STANDING, -1, -2) @ matrix_from_vector(rotations))


def centre_of_mass(joints: Array, orientations: Array) -> Array:
    """Map joint positions (..., 24, 3) and orientations (..., 24, 3, 3) to the centre of mass (..., 3), metres."""
    centres = joints[..., _LINKED, :] + np.einsum("...lij,lj->...li", orientations[..., _LINKED, :, :], _CENTRES)
    return np.asarray(np.einsum("l,...li->...i", _MASSES / _MASSES.sum(), centres))


def shoe_heights(joints: Array, orientations: Array) -> Array:
    """Map joint positions (..., 24, 3) and orientations (..., 24, 3, 3) to the height of the lowest point of each shoe
    (..., 2), left first, metres. Unlike support_height, it knows how a foot tilts."""
    corners = joints[..., _SHOE_PARTS, 1][..., None] + np.einsum(
        "...lj,lcj->...lc", orientations[..., _SHOE_PARTS, 1, :], _SHOE_CORNERS
    )
    return np.asarray(corners.min(-1).reshape(*corners.shape[:-2], 2, 2).min(-1))
