"""Links of the body inside one another: hands in thighs and trunk, shoes and shins in each other."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING, Final

import numpy as np

from humanclaw.body import HISTORY, JOINT_INDEX, LINKS, Array, Box, forward_kinematics
from humanclaw_train.rollouts import Command, Rollouts, others, roll
from humanclaw_train.tables import cell, table

if TYPE_CHECKING:
    from humanclaw.motion import DiTGenerator

_LINK: Final = {link.joint: link for link in LINKS}
_ARM, _SHOE = ("elbow", "wrist", "hand"), ("ankle", "foot")
PAIRS: Final[Mapping[str, Sequence[tuple[str, str]]]] = {
    "arms in legs or trunk": [
        (f"{side}_{part}", other)
        for side, part in product(("left", "right"), _ARM)
        for other in ("left_hip", "right_hip", "pelvis", "spine1", "spine2")
    ],
    "legs in each other": [
        *((f"left_{one}", f"right_{other}") for one, other in product(_SHOE, _SHOE)),
        ("left_knee", "right_knee"),
        ("left_hip", "right_hip"),
    ],
}
"""Pairs of links that do not touch in a healthy pose, by group."""
_TOUCH: Final = 0.002
"""Depth, metres, up to which links touch and are not inside one another."""


@dataclass(frozen=True)
class Inside:
    """Share of frames, %, in which a link is inside another, and the greatest depth, cm."""

    share: float
    depth: float


def inside(rollouts: Rollouts) -> dict[str, Inside]:
    """Measure the futures of one skill's chunks, by group of PAIRS."""
    joints, turns = forward_kinematics(rollouts.root[:, HISTORY:], rollouts.rotations[:, HISTORY:])
    found = {}
    for group, pairs in PAIRS.items():
        depth = np.max([_depth(joints, turns, *pair) for pair in pairs], axis=0)
        found[group] = Inside(float(100 * (depth > _TOUCH).mean()), float(100 * max(depth.max(), 0.0)))
    return found


def self_penetration(
    generator: DiTGenerator, commands: Sequence[Command], rollouts: int, seed: int
) -> dict[str, dict[str, Inside]]:
    """Measure the generated rollouts of every skill."""
    return {one.skill: inside(roll(generator, one, others(one, commands), rollouts, seed)) for one in commands}


def _depth(joints: Array, turns: Array, first: str, second: str) -> Array:
    """Return how deep two links are in each other (...), metres; negative where they are apart."""
    return np.maximum(_within(joints, turns, first, second), _within(joints, turns, second, first))


def _within(joints: Array, turns: Array, first: str, second: str) -> Array:
    """Return the depth of the deepest point of the first link in the second."""
    points, radius = _points(first)
    one, other = JOINT_INDEX[first], JOINT_INDEX[second]
    world = joints[..., one, None, :] + np.einsum("...ij,pj->...pi", turns[..., one, :, :], points)
    local = np.einsum("...ji,...pj->...pi", turns[..., other, :, :], world - joints[..., other, None, :])
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


def inside_table(found: Mapping[str, Mapping[str, Inside]]) -> str:
    """Format one row per skill: share of frames, and greatest depth."""
    heads = ("skill", *(f"{group}: % of frames, deepest cm" for group in PAIRS))
    rows = [
        (skill, *(f"{cell(groups[group].share)}, {cell(groups[group].depth)}" for group in PAIRS))
        for skill, groups in found.items()
    ]
    return table(heads, rows)
