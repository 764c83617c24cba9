"""Reflexes of the body: it lifts a toe over an edge, and its thighs give way to a seat.

A generated motion does not know the scene: its feet clear a step by millimetres or miss it by millimetres, and its
thighs slope where a seat is level. A person would not notice. Half-physics without reflexes would lose the stair, and
would leave the body on its thighs with the hips in the air. Both reflexes are bounded: an edge higher than a toe still
blocks.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from humanclaw.body.pose import FPS, Array, forward_kinematics
from humanclaw.body.skeleton import JOINT_INDEX, LINKS, Box
from humanclaw.world.half_physics.profile import Profile
from humanclaw.world.half_physics.quaternions import Pose, motion_of
from humanclaw.world.half_physics.world import TOUCHING, Touch, World

_PUSH: Final = 50.0
"""A foot that meets less than this is not held back, newtons."""
LEVEL: Final = 0.7
"""Upward part of a normal from which on a contact carries and does not block."""
_REACH: Final = 0.02
"""How far behind an edge its upper side is looked for, metres."""
_PELVIS: Final = JOINT_INDEX["pelvis"]
_THIGHS: Final = tuple(JOINT_INDEX[f"{side}_hip"] for side in ("left", "right"))
_PATIENCE: Final = 0.2
"""A thigh that has carried nothing for so long carries no more, seconds."""
_CORNERS: Final[Mapping[int, Array]] = {
    JOINT_INDEX[link.joint]: np.array(
        [
            np.array(link.shape.centre) + np.multiply(link.shape.half, (x, y, z))
            for x in (-1, 1)
            for y in (-1, 1)
            for z in (-1, 1)
        ]
    )
    for link in LINKS
    if link.group == "leg_foot" and isinstance(link.shape, Box)
}
"""Joint of each part of a foot to the (8, 3) corners of its box."""


@dataclass(frozen=True)
class Reflex:
    """The reflexes that the last physics step calls for."""

    lift: float = 0.0
    """How far the body must rise for a foot to clear the edge that holds it back, metres."""
    borne: Mapping[int, float] = field(default_factory=dict)
    """Joints of the hips whose thighs carry weight, or did a moment ago, to the seconds since."""
    seated: bool = False
    """Whether the pelvis carries some too."""


CALM: Final = Reflex()


def feel(world: World, profile: Profile, movable: Collection[int], touches: Sequence[Touch], before: Reflex) -> Reflex:
    """Read the contacts of the body that one physics step has left. movable: ids of the objects that are."""
    touches = [touch for touch in touches if touch.distance <= TOUCHING]
    carrying = {touch.joint for touch in touches if touch.normal[1] > LEVEL}
    borne = _borne(carrying, before, 1 / (FPS * profile.substeps)) if profile.yielding else {}
    return Reflex(_lift(world, profile, movable, touches), borne, _PELVIS in carrying)


def _borne(carrying: set[int], before: Reflex, step: float) -> Mapping[int, float]:
    """Let a thigh that loses touch for a moment stay down: else it would come back down and push the body off
    the seat."""
    since = {thigh: 0.0 if thigh in carrying else before.borne.get(thigh, np.inf) + step for thigh in _THIGHS}
    return {thigh: seconds for thigh, seconds in since.items() if seconds < _PATIENCE}


def _lift(world: World, profile: Profile, movable: Collection[int], touches: Sequence[Touch]) -> float:
    held = [touch for touch in touches if _holds_back(touch) and touch.object_id not in movable]
    if not held or not profile.step_offset:
        return 0.0
    soles = _soles(world.pose())
    return max(_missing(world, profile.step_offset, soles[touch.joint], touch) for touch in held)


def _holds_back(touch: Touch) -> bool:
    return touch.joint in _CORNERS and touch.normal[1] <= LEVEL and touch.force >= _PUSH


def _soles(pose: Pose) -> Mapping[int, float]:
    """Height of the lowest corner of each part of a foot."""
    motion = motion_of([pose])
    joints, turns = forward_kinematics(motion.root[0], motion.rotations[0])
    return {
        joint: float((corners @ turns[joint].T)[:, 1].min() + joints[joint, 1]) for joint, corners in _CORNERS.items()
    }


def _missing(world: World, offset: float, sole: float, touch: Touch) -> float:
    """How far a foot that something holds back is too low to pass over it; 0 if that is more than a step's offset."""
    x, _, z = touch.normal
    ahead = np.array(touch.point) - _REACH * np.array([x, 0.0, z]) / max(float(np.hypot(x, z)), 1e-9)
    above, below = ahead.copy(), ahead
    above[1], below[1] = sole + offset, sole - TOUCHING
    top = world.top(touch.object_id, above, below)
    return 0.0 if top is None else top - sole + TOUCHING
