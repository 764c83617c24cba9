"""Aims of the gaze, grips of a hand, and speech."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Final

import numpy as np

from humanclaw.body.limits import JOINT_LIMITS
from humanclaw.body.pose import (
    FPS,
    Array,
    Motion,
    Pose2D,
    forward_kinematics,
    matrix_from_vector,
    smoothstep,
    vector_from_matrix,
)
from humanclaw.body.skeleton import EYE, JOINT_INDEX, OFFSETS, STANDING_HEIGHT, Side as Side
from humanclaw.skills.plan import LONGEST_FAULT, MotionError, check_lasting, whole_chunks

Point = tuple[float, float, float]
_SPINE: Final = [JOINT_INDEX[f"spine{number}"] for number in (1, 2, 3)]
_PITCHES: Final = np.radians([-75.0, 50.0])
"""How far below and above the horizon head and eyes look together, radians."""

LONGEST_SPEECH: Final = 1000
"""Characters of one speech: it stands in the next feedback, and in the prompt, of all who hear it."""


@dataclass(frozen=True)
class Gaze:
    """Turn neck, head and eyes to a point in the body's frame as the part begins: left, up, ahead in metres.

    The eyes stay there until the body moves on.
    """

    at: Point
    seconds: float = 0.5

    def __post_init__(self) -> None:
        check_aim(self.at, self.seconds)

    @classmethod
    def towards(cls, left: float, up: float = 0.0, seconds: float = 0.5) -> Gaze:
        """Look in a direction: degrees to the left and above the horizon."""
        turn, rise = np.radians([left, up])
        flat = 10 * np.cos(rise)
        eyes = STANDING_HEIGHT + float(OFFSETS[[*_SPINE, JOINT_INDEX["neck"], JOINT_INDEX["head"]], 1].sum()) + EYE[1]
        return cls((float(flat * np.sin(turn)), float(eyes + 10 * np.sin(rise)), float(flat * np.cos(turn))), seconds)

    def over(self, pose: Motion) -> Motion:
        """Return the motion from the last frame of a pose to the target."""
        here = Pose2D.of(pose)
        start = here.to_local(pose[-1:])
        joints, turns = forward_kinematics(start.root[0], start.rotations[0])
        facing = _facing(np.array(self.at) - joints[JOINT_INDEX["head"]] - [0.0, EYE[1], 0.0])
        turn = vector_from_matrix(turns[_SPINE[-1]].T @ facing)
        most = float(np.radians(min(JOINT_LIMITS["neck"], JOINT_LIMITS["head"])))
        half = turn / 2 * min(1.0, most / max(float(np.linalg.norm(turn / 2)), 1e-9))
        rotations = start.rotations.copy()
        rotations[0, [JOINT_INDEX["neck"], JOINT_INDEX["head"]]] = half
        return here.to_world(between(start, Motion(start.root, rotations), self.seconds))

    def pitch(self, pose: Motion) -> float:
        """Return how far above the horizon the eyes of a pose look at the point, within human limits, radians."""
        _, up, ahead = Pose2D.of(pose).to_local(pose[-1:]).joints()[0, JOINT_INDEX["head"]] + [0.0, EYE[1], 0.0]
        left, rise, far = np.array(self.at) - [0.0, up, ahead]
        return float(np.clip(np.arctan2(rise, np.hypot(left, far)), *_PITCHES))

    def short(self, pose: Motion, motion: Motion) -> str:
        """Say by how much the head stays short of the direction, from 3 degrees; empty if it looks there."""
        end = Pose2D.of(pose).to_local(motion[-1:])
        joints, turns = forward_kinematics(end.root[0], end.rotations[0])
        head = JOINT_INDEX["head"]
        wanted = _facing(np.array(self.at) - joints[head] - [0.0, EYE[1], 0.0])[:, 2]
        gap = float(np.degrees(np.arccos(np.clip(turns[head][:, 2] @ wanted, -1.0, 1.0))))
        return f"your head stays {gap:.0f} degrees short" if gap > 3 else ""


@dataclass(frozen=True)
class Grip:
    """Close a hand on the nearest movable thing within 6 cm before its palm, or open it; the body stays as it is.

    What a hand holds goes where it goes. The arm then stays as it is while other parts move the rest of the body.
    """

    hand: Side
    closed: bool = True
    seconds: float = 0.5

    def __post_init__(self) -> None:
        check_hand(self.hand)
        check_lasting(self.seconds, "a grip")

    def over(self, pose: Motion) -> Motion:
        """Return the last frame of a pose as long as the part lasts."""
        return pose.held(whole_chunks(self.seconds))


@dataclass(frozen=True)
class Speech:
    """Say something to whoever is near; it takes no time, and the body stays as it is. Alone, nobody hears it."""

    text: str
    """1 to 1,000 characters, not all of them blank."""
    seconds: ClassVar[float] = 0.0

    def __post_init__(self) -> None:
        if not (isinstance(self.text, str) and self.text.strip() and len(self.text) <= LONGEST_SPEECH):
            long = isinstance(self.text, str) and len(self.text) > LONGEST_SPEECH
            got = f"{len(self.text)} characters" if long else repr(self.text)[:LONGEST_FAULT]
            raise MotionError("speech-text", f"speech is words of 1 to {LONGEST_SPEECH:,} characters; got {got}")

    def over(self, pose: Motion) -> Motion:
        """Return no frame."""
        return pose[:0]


def check_hand(hand: str) -> None:
    if hand not in ("left", "right"):
        raise MotionError("aim-hand", f"a hand is left or right; got {hand!r}")


def check_aim(at: Point, seconds: float) -> None:
    if np.shape(at) != (3,) or not np.isfinite(np.asarray(at, float)).all():
        raise MotionError("aim-finite", f"an aim is three finite numbers, metres; got {at!r}")
    check_lasting(seconds, "an aim")


def _facing(direction: Array) -> Array:
    """Return the orientation (3, 3) of an upright head that looks in a direction."""
    ahead = direction / max(float(np.linalg.norm(direction)), 1e-9)
    left = np.cross([0.0, 1.0, 0.0], ahead)
    left = left / max(float(np.linalg.norm(left)), 1e-9)
    return np.stack([left, np.cross(ahead, left), ahead], -1)


def between(start: Motion, goal: Motion, seconds: float, share: float = 1.0) -> Motion:
    """Return the frames from one pose to another, or of a share of the way, in whole chunks of 15."""
    return eased(start, goal, share * smoothstep(np.arange(1, whole_chunks(seconds) + 1) / FPS / seconds))


def eased(start: Motion, goal: Motion, share: Array) -> Motion:
    """Return the way from one pose to another, or to a motion, each joint along its shortest arc. share: (T,) of it."""
    first, ease = matrix_from_vector(start.rotations[0]), share[:, None]
    turns = vector_from_matrix(np.swapaxes(first, -1, -2) @ matrix_from_vector(goal.rotations))
    rotations = vector_from_matrix(first @ matrix_from_vector(ease[:, None] * turns))
    return Motion(start.root + ease * (goal.root - start.root), rotations)
