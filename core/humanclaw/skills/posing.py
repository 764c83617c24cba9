"""The parts of a plan, and the motion of those that need no motion model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final, Literal

import numpy as np

from humanclaw.body.limits import within_limits
from humanclaw.body.pose import FPS, FUTURE, Array, Motion, Pose2D, matrix_from_vector, smoothstep, vector_from_matrix
from humanclaw.skills.aims import Gaze, Reach
from humanclaw.skills.plan import LONGEST_FAULT, Control, Keyframes, MotionError, check_duration, whole_chunks

Posed = Keyframes | Reach | Gaze | Motion
"""A part that is played without the motion model. A `Motion` is in the body's frame as the part begins."""
Part = Control | Posed
Plan = Part | Sequence[Part]
"""The plan of a call: one part, or a sequence of parts, each from the last pose of the one before."""
PartKind = Literal["control", "keyframes", "reach", "gaze", "motion"]
_KINDS: Final[Mapping[type, PartKind]] = {
    Control: "control",
    Keyframes: "keyframes",
    Reach: "reach",
    Gaze: "gaze",
    Motion: "motion",
}
_EASE: Final = 10
"""Frames in which the body comes from its own pose into a ready motion."""


def parts(plan: Plan) -> tuple[Part, ...]:
    """Return the parts of a plan, in order. Raises MotionError for a value that is not a plan, or above 10 s."""
    found = (plan,) if isinstance(plan, Part) else tuple(plan) if isinstance(plan, Sequence) else ()
    if not found or not all(isinstance(part, Part) for part in found):
        expected = "a skill returns a Control, Keyframes, a Reach, a Gaze, a Motion or a sequence of them"
        raise MotionError("plan-kind", f"{expected}; got {str(plan)[:LONGEST_FAULT]!r}")
    for part in found:
        if isinstance(part, Motion) and not (
            len(part) and np.isfinite(part.root).all() and np.isfinite(part.rotations).all()
        ):
            raise MotionError("motion-finite", "a Motion holds one frame or more of finite numbers")
    check_duration(sum(map(frames_of, found)) / FPS, "a call")
    return found


def frames_of(part: Part) -> int:
    """Return the number of frames of a part, whole chunks of 15."""
    if isinstance(part, Control):
        return FUTURE
    return whole_chunks(part.seconds) if isinstance(part, Motion) else part.frames


def kind_of(part: Part) -> PartKind:
    """Return the kind of a part, as records name it."""
    return _KINDS[type(part)]


def about(part: Posed) -> str:
    """Say which joints or which aim a part moves."""
    if isinstance(part, Keyframes):
        return ", ".join(part.rotations)
    return part.hand if isinstance(part, Reach) else ""


def wanted(part: Posed, pose: Motion) -> Motion:
    """Return the motion of a part over the last frame of a pose, whatever the limits of joints."""
    return _entered(part, pose) if isinstance(part, Motion) else part.over(pose)


def posed(part: Posed, pose: Motion) -> tuple[Motion, tuple[str, ...]]:
    """Return the motion of a part over the last frame of a pose, within the limits of joints, and what it could not do.

    The words continue "You could not do all of it: "."""
    motion, stopped = within_limits(wanted(part, pose), pose[-1:])
    told = [f"your {joint.replace('_', ' ')} turns no further" for joint in stopped]
    short = part.short(pose, motion) if isinstance(part, Reach | Gaze) else ""
    return motion, tuple(filter(None, (*told, short)))


def _entered(part: Motion, pose: Motion) -> Motion:
    """Return a ready motion where the body is, begun from its own pose, its last frame held to the end of a chunk."""
    here = Pose2D.of(pose)
    start = here.to_local(pose[-1:])
    held = np.minimum(np.arange(frames_of(part)), len(part) - 1)
    ease = smoothstep(np.arange(1, len(held) + 1) / _EASE)[:, None]
    root = start.root + ease * (part.root[held] - start.root)
    return here.to_world(Motion(root, _eased(start.rotations[0], part.rotations[held], ease)))


def _eased(start: Array, rotations: Array, ease: Array) -> Array:
    first = matrix_from_vector(start)
    turns = vector_from_matrix(np.swapaxes(first, -1, -2) @ matrix_from_vector(rotations))
    return vector_from_matrix(first @ matrix_from_vector(ease[:, None] * turns))
