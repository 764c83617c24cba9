"""Links of the body inside one another: hands in thighs and trunk, shoes and shins in each other."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING, Final

import numpy as np

from humanclaw import Motion
from humanclaw.body import HISTORY, JOINT_INDEX, LINKS, Array, Box, forward_kinematics
from humanclaw_train.eval.rollouts import CHUNKS_IN_A_ROW, Command, others, roll
from humanclaw_train.eval.simulated import Place, called, stage
from humanclaw_train.markdown import cell, table

if TYPE_CHECKING:
    from humanclaw import Body
    from humanclaw.motion import DiTGenerator

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
        *((f"left_{one}", f"right_{other}") for one, other in product(_LEG, _LEG)),
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


def inside(root: Array, rotations: Array) -> dict[str, Inside]:
    """Measure poses (..., 3) and (..., 24, 3), by group of PAIRS."""
    joints, turns = forward_kinematics(root, rotations)
    found = {}
    for group in PAIRS:
        deep = depth(joints, turns, group)
        found[group] = Inside(float(100 * (deep > _TOUCH).mean()), float(100 * max(deep.max(), 0.0)))
    return found


def depth(joints: Array, turns: Array, group: str) -> Array:
    """Return how deep links of a group are in each other (...), metres, for joints (..., 24, 3) and their orientations;
    negative where they are apart."""
    return np.asarray(np.max([_depth(joints, turns, *pair) for pair in PAIRS[group]], axis=0))


def self_penetration(
    generator: DiTGenerator, commands: Sequence[Command], rollouts: int, seed: int, place: Place | None = None
) -> dict[str, dict[str, dict[str, Inside]]]:
    """Measure the futures of every skill: of the model alone and, with a place, of the installed skill as played."""
    found = {}
    for one in commands:
        before = others(one, commands)
        alone = roll(generator, one, before, rollouts, seed)
        found[one.skill] = {"model": inside(alone.root[:, HISTORY:], alone.rotations[:, HISTORY:])}
        if place is not None:
            parts = [_played(place, one, before, (seed, body)) for body in range(rollouts)]
            root, rotations = (np.concatenate([getattr(part, key) for part in parts]) for key in ("root", "rotations"))
            found[one.skill]["played"] = inside(root, rotations)
    return found


def _played(place: Place, command: Command, before: Sequence[Command], key: tuple[int, int]) -> Motion:
    """Call a skill three times in half-physics. On a flat floor every second body has called another skill before."""
    random, index = np.random.default_rng(key), key[1]
    values = command.draw(1, random)[0]
    scene = stage(command.declaration, command.named(values))
    with place(scene, index) as body:
        if before and index % 2 and len(scene.objects) == 1:
            other = before[index // 2 % len(before)]
            _call(body, other, other.draw(1, random)[0])
        parts = [_call(body, command, values) for _ in range(CHUNKS_IN_A_ROW)]
    return Motion(np.concatenate([part.root for part in parts]), np.concatenate([part.rotations for part in parts]))


def _call(body: Body, command: Command, values: Array) -> Motion:
    measures = (one.measure for one in command.parameters)
    return called(body, body.skills[command.skill], dict(zip(measures, values.tolist(), strict=True)))


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


def inside_table(found: Mapping[str, Mapping[str, Mapping[str, Inside]]]) -> str:
    """Format a row for each skill, of the model alone and as played: share of frames, and greatest depth."""
    heads = ("skill", "motion", *(f"{group}: % of frames, deepest cm" for group in PAIRS))
    rows = [
        (skill, motion, *(f"{cell(groups[group].share)}, {cell(groups[group].depth)}" for group in PAIRS))
        for skill, motions in found.items()
        for motion, groups in motions.items()
    ]
    return table(heads, rows)
