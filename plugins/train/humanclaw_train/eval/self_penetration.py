"""Links of the body inside one another: hands in thighs and trunk, shoes and shins in each other."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import product
from typing import Final

import numpy as np

from humanclaw.body import JOINT_INDEX, LINKS, Array, Box, forward_kinematics
from humanclaw_train.markdown import Row

_LINK: Final = {link.joint: link for link in LINKS}
_ARM, _LEG = ("elbow", "wrist", "hand"), ("knee", "ankle", "foot")
ARMS: Final = "arms in legs or trunk"
PAIRS: Final[Mapping[str, Sequence[tuple[str, str]]]] = {
    ARMS: [
        (f"{side}_{part}", other)
        for side, part in product(("left", "right"), _ARM)
        for other in ("left_hip", "right_hip", "pelvis", "spine1", "spine2")
    ],
    "legs in each other": [
        *((f"left_{left}", f"right_{right}") for left, right in product(_LEG, _LEG)),
        ("left_hip", "right_hip"),
    ],
}
"""Pairs of links that do not touch in a healthy pose, by group."""
_TOUCH: Final = 0.002
"""Depth, metres, up to which links touch and are not inside one another."""


def summary(root: Array, rotations: Array) -> Row:
    """Return the share of poses (..., 3) and (..., 24, 3) in which links are in each other, and the greatest depth."""
    joints, turns = forward_kinematics(root, rotations)
    row = {}
    for group in PAIRS:
        deep = depth(joints, turns, group)
        row[f"{group}, % of frames"] = float(100 * (deep > _TOUCH).mean())
        row[f"{group}, deepest cm"] = float(100 * max(deep.max(), 0.0))
    return row


def depth(joints: Array, turns: Array, group: str) -> Array:
    """Return how deep links of a group are in each other (...), metres, for joints (..., 24, 3) and their orientations;
    negative where they are apart."""
    return np.asarray(np.max([_depth(joints, turns, *pair) for pair in PAIRS[group]], axis=0))


def _depth(joints: Array, turns: Array, first: str, second: str) -> Array:
    """Return how deep two links are in each other (...), metres; negative where they are apart."""
    return np.maximum(_within(joints, turns, first, second), _within(joints, turns, second, first))


def _within(joints: Array, turns: Array, first: str, second: str) -> Array:
    """Return the depth of the deepest point of the first link in the second."""
    points, radius = _points(first)
    inner, outer = JOINT_INDEX[first], JOINT_INDEX[second]
    world = joints[..., inner, None, :] + np.einsum("...ij,pj->...pi", turns[..., inner, :, :], points)
    local = np.einsum("...ji,...pj->...pi", turns[..., outer, :, :], world - joints[..., outer, None, :])
    return np.asarray((radius - _outside(local, second)).max(-1))


def _points(joint: str) -> tuple[Array, float]:
    """Return points (P, 3) in the frame of a joint, and the radius of the balls about them that fill its link."""
    shape = _LINK[joint].shape
    if isinstance(shape, Box):
        grid = np.array(list(product((-1, 0, 1), repeat=3)))
        return shape.centre + grid * shape.half, 0.0
    share = np.linspace(0, 1, 7)[:, None]
    return (1 - share) * np.array(shape.a) + share * np.array(shape.b), shape.radius


def _outside(points: Array, joint: str) -> Array:
    """Return the distance of points (..., 3) from the surface of a link; negative inside."""
    shape = _LINK[joint].shape
    if isinstance(shape, Box):
        away = np.abs(points - shape.centre) - shape.half
        return np.asarray(np.linalg.norm(np.maximum(away, 0.0), axis=-1) + np.minimum(away.max(-1), 0.0))
    a, axis = np.array(shape.a), np.subtract(shape.b, shape.a)
    along = np.clip((points - a) @ axis / (axis @ axis), 0.0, 1.0)
    return np.asarray(np.linalg.norm(points - a - along[..., None] * axis, axis=-1) - shape.radius)
