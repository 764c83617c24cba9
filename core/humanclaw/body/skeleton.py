"""The body: 24 joints, their rest offsets, and one convex collision shape per link.

The joint order is the SMPL topology, so motion that uses it maps one to one; every length is our own, the rounded
median of the skeletons of the mocap that the motion model was trained on. Frame of the rest pose: metres, Y up, facing
+Z, left = +X, legs vertical, arms level along X (T-pose), origin at the pelvis. Needs numpy alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

JOINTS: Final = (
    "pelvis", "left_hip", "right_hip", "spine1", "left_knee", "right_knee", "spine2", "left_ankle", "right_ankle",
    "spine3", "left_foot", "right_foot", "neck", "left_collar", "right_collar", "head", "left_shoulder",
    "right_shoulder", "left_elbow", "right_elbow", "left_wrist", "right_wrist", "left_hand", "right_hand",
)  # fmt: skip
JOINT_INDEX: Final = {name: index for index, name in enumerate(JOINTS)}
PARENTS: Final = (-1, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 12, 13, 14, 16, 17, 18, 19, 20, 21)
"""Of each joint in the order of SMPL; -1 for the root."""
N_JOINTS: Final = len(JOINTS)

_LEFT_OFFSETS: Final = {
    "left_hip": (0.09, -0.07, 0.0),
    "left_knee": (0.0, -0.405, 0.0),
    "left_ankle": (0.0, -0.415, 0.0),
    "left_foot": (0.0, -0.055, 0.13),
    "left_collar": (0.05, 0.09, 0.0),
    "left_shoulder": (0.13, 0.02, 0.0),
    "left_elbow": (0.275, 0.0, 0.0),
    "left_wrist": (0.25, 0.0, 0.0),
    "left_hand": (0.08, 0.0, 0.0),
}
_CENTRE_OFFSETS: Final = {
    "pelvis": (0.0, 0.0, 0.0),
    "spine1": (0.0, 0.07, 0.0),
    "spine2": (0.0, 0.12, 0.0),
    "spine3": (0.0, 0.12, 0.0),
    "neck": (0.0, 0.135, 0.0),
    "head": (0.0, 0.10, 0.0),
}


def _offset(name: str) -> tuple[float, float, float]:
    if name in _CENTRE_OFFSETS:
        return _CENTRE_OFFSETS[name]
    x, y, z = _LEFT_OFFSETS[name.replace("right", "left")]
    return (x, y, z) if name.startswith("left") else (-x, y, z)


OFFSETS: Final[NDArray[np.float64]] = np.array([_offset(name) for name in JOINTS])
"""(24, 3) position of each joint in its parent's frame, metres."""

SOLE: Final = 0.075
"""Height of the ankle joint above the sole, metres."""
TOE_SOLE: Final = 0.02
"""Height of the foot (toe base) joint above the sole, metres."""
STANDING_HEIGHT: Final = 0.07 + 0.405 + 0.415 + SOLE
"""Pelvis height with straight legs, metres (0.965)."""

EYE: Final = (0.0, 0.08, 0.05)
"""Optical centre of the ego camera in the frame of the head joint, metres: behind the face, so that it sees limbs."""

Side = Literal["left", "right"]
BodyGroup = Literal["head", "torso", "arm_hand", "leg_foot"]
BODY_GROUPS: Final[tuple[BodyGroup, ...]] = ("head", "torso", "arm_hand", "leg_foot")


@dataclass(frozen=True)
class Capsule:
    """Segment from a to b in the joint frame, swept by a sphere. Metres."""

    a: tuple[float, float, float]
    b: tuple[float, float, float]
    radius: float


@dataclass(frozen=True)
class Box:
    """Axis-aligned box in the joint frame. Metres."""

    centre: tuple[float, float, float]
    half: tuple[float, float, float]


@dataclass(frozen=True)
class Link:
    """The solid part that moves with one joint."""

    joint: str
    shape: Capsule | Box
    group: BodyGroup
    mass: float
    """Kilograms; the sum over LINKS is 70."""


def _side(joint: str, shape: Capsule | Box, group: BodyGroup, mass: float) -> tuple[Link, Link]:
    if isinstance(shape, Box):
        other: Capsule | Box = Box((-shape.centre[0], *shape.centre[1:]), shape.half)
    else:
        other = Capsule((-shape.a[0], *shape.a[1:]), (-shape.b[0], *shape.b[1:]), shape.radius)
    return Link(f"left_{joint}", shape, group, mass), Link(f"right_{joint}", other, group, mass)


LINKS: Final[tuple[Link, ...]] = (
    Link("pelvis", Capsule((-0.065, -0.03, -0.005), (0.065, -0.03, -0.005), 0.11), "torso", 10.0),
    Link("spine1", Capsule((-0.06, 0.03, 0.0), (0.06, 0.03, 0.0), 0.1), "torso", 7.0),
    Link("spine2", Capsule((-0.07, 0.04, 0.0), (0.07, 0.04, 0.0), 0.105), "torso", 7.0),
    Link("spine3", Capsule((-0.085, 0.06, 0.0), (0.085, 0.06, 0.0), 0.105), "torso", 9.0),
    Link("neck", Capsule((0.0, 0.02, 0.0), (0.0, 0.08, 0.01), 0.05), "head", 1.5),
    Link("head", Capsule((0.0, 0.05, 0.015), (0.0, 0.12, 0.015), 0.09), "head", 4.5),
    *_side("hip", Capsule((0.0, -0.02, 0.0), (0.0, -0.39, 0.0), 0.07), "leg_foot", 7.0),
    *_side("knee", Capsule((0.0, -0.01, 0.0), (0.0, -0.38, 0.0), 0.05), "leg_foot", 3.4),
    *_side("ankle", Box((0.0, -0.04, 0.045), (0.045, 0.035, 0.105)), "leg_foot", 0.9),
    *_side("foot", Box((0.0, 0.0, 0.05), (0.045, 0.02, 0.045)), "leg_foot", 0.2),
    *_side("shoulder", Capsule((0.02, 0.0, 0.0), (0.26, 0.0, 0.0), 0.045), "arm_hand", 2.2),
    *_side("elbow", Capsule((0.01, 0.0, 0.0), (0.23, 0.0, 0.0), 0.036), "arm_hand", 1.3),
    *_side("wrist", Box((0.045, 0.0, 0.0), (0.04, 0.014, 0.04)), "arm_hand", 0.35),
    *_side("hand", Box((0.04, 0.0, 0.0), (0.045, 0.012, 0.035)), "arm_hand", 0.15),
)
"""One link a joint, without the two collars, which lie inside the chest."""
