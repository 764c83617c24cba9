"""The parts of a plan, and the motion of those that need no motion model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Final, Literal

import numpy as np

from humanclaw.body.ik import SIDES
from humanclaw.body.limits import within_limits
from humanclaw.body.pose import FPS, FUTURE, Array, Motion, Pose2D, smoothstep
from humanclaw.motion.carrying import ARM
from humanclaw.skills.gaze_grip_speech import Gaze, Grip, Side, Speech, eased
from humanclaw.skills.plan import LONGEST_FAULT, Control, Keyframes, MotionError, check_duration, whole_chunks
from humanclaw.skills.reaching import Reach

Posed = Keyframes | Reach | Gaze | Grip | Speech | Motion
"""A part that is played without the motion model. A `Motion` is in the body's frame as the part begins."""
Part = Control | Posed
Plan = Part | Sequence[Part]
"""The plan of a call: one part, or a sequence of parts, each from the last pose of the one before."""
PartKind = Literal["control", "keyframes", "reach", "gaze", "grip", "speech", "motion"]
_KINDS: Final[Mapping[type, PartKind]] = {
    Control: "control",
    Keyframes: "keyframes",
    Reach: "reach",
    Gaze: "gaze",
    Grip: "grip",
    Speech: "speech",
    Motion: "motion",
}
_EASE: Final = 10
"""Frames in which the body comes from its own pose into a ready motion."""


def parts(plan: Plan) -> tuple[Part, ...]:
    """Return the parts of a plan, in order. Raises MotionError for a value that is not a plan, or above 10 s."""
    listed = (plan,) if isinstance(plan, Part) else tuple(plan) if isinstance(plan, Sequence) else ()
    if not listed or not all(isinstance(part, Part) for part in listed):
        expected = "a plan is a Control, Keyframes, a Reach, a Gaze, a Grip, a Speech, a Motion or a sequence of them"
        raise MotionError("plan-kind", f"{expected}; got {str(plan)[:LONGEST_FAULT]!r}")
    for part in listed:
        if isinstance(part, Motion) and not (
            len(part) and np.isfinite(part.root).all() and np.isfinite(part.rotations).all()
        ):
            raise MotionError("motion-finite", "a Motion holds one frame or more of finite numbers")
    check_duration(sum(map(frames_of, listed)) / FPS, "a call")
    return listed


def frames_of(part: Part) -> int:
    """Return the number of frames of a part, whole chunks of 15."""
    return FUTURE if isinstance(part, Control) else whole_chunks(part.seconds)


def kind_of(part: Part) -> PartKind:
    """Return the kind of a part, as records name it."""
    return _KINDS[type(part)]


def about(part: Posed) -> str:
    """Say which joints or which hand a part moves."""
    if isinstance(part, Keyframes):
        return ", ".join(part.rotations)
    if isinstance(part, Grip):
        return part.hand if part.closed else f"{part.hand} opens"
    return part.hand if isinstance(part, Reach) else ""


def arms_of(part: Part) -> frozenset[Side]:
    """Return the sides of the arms that a part moves itself."""
    if isinstance(part, Reach):
        return frozenset({part.hand})
    if isinstance(part, Keyframes):
        return frozenset(side for side in SIDES if {f"{side}_{joint}" for joint in ARM} & set(part.rotations))
    return frozenset(SIDES if isinstance(part, Motion) else ())


def unlimited_motion(part: Posed, pose: Motion, palms: Mapping[Side, Array] = MappingProxyType({})) -> Motion:
    """Return the motion of a part over the last frame of a pose, whatever the limits of joints. palms: turns (3, 3) in
    the frame of the heading that palms keep, by side."""
    if isinstance(part, Reach):
        return part.over(pose, palms)
    return _entered(part, pose) if isinstance(part, Motion) else part.over(pose)


def part_motion(
    part: Posed, pose: Motion, palms: Mapping[Side, Array] = MappingProxyType({})
) -> tuple[Motion, tuple[str, ...]]:
    """Return the motion of a part over the last frame of a pose, within the limits of joints, and what it could not do.

    palms: as for unlimited_motion. The words continue "Your body could not do all of it: ". How far a hand stays
    short is felt afterwards."""
    if isinstance(part, Speech):
        return part.over(pose), ()
    motion, stopped = within_limits(unlimited_motion(part, pose, palms), pose[-1:])
    limits = [f"your {joint.replace('_', ' ')} turns no further" for joint in stopped]
    short = part.short(pose, motion) if isinstance(part, Gaze) else ""
    return motion, tuple(filter(None, (*limits, short)))


def _entered(part: Motion, pose: Motion) -> Motion:
    """Return a ready motion where the body is, begun from its own pose, its last frame held to the end of a chunk."""
    here = Pose2D.of(pose)
    start = here.to_local(pose[-1:])
    held = np.minimum(np.arange(frames_of(part)), len(part) - 1)
    goal = Motion(part.root[held], part.rotations[held])
    return here.to_world(eased(start, goal, smoothstep(np.arange(1, len(held) + 1) / _EASE)))
