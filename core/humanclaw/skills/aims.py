"""Aims of a hand and of the gaze, reached by inverse kinematics within the limits of joints and balance."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from humanclaw.body.limits import JOINT_LIMITS, centre_of_mass
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
from humanclaw.body.skeleton import EYE, JOINT_INDEX, OFFSETS, STANDING_HEIGHT
from humanclaw.motion.ik import Limb, solve
from humanclaw.motion.planted import planted
from humanclaw.skills.own_body import OwnBody
from humanclaw.skills.plan import MotionError, check_duration, whole_chunks

Point = tuple[float, float, float]
_SPINE: Final = [JOINT_INDEX[f"spine{number}"] for number in (1, 2, 3)]
_SOLES: Final = [JOINT_INDEX[f"{side}_{part}"] for side in ("left", "right") for part in ("ankle", "foot")]
_NEAR: Final = 0.15
"""Metres from shoulder to hand within which an elbow cannot bend further."""
_SWAY: Final = 0.09
"""Metres that the centre of mass may leave the middle of the feet."""
_LOW: Final = np.array([0.45, -0.1, -0.3, -0.5, -0.4])
_HIGH: Final = np.array([STANDING_HEIGHT, 1.2, 0.5, 0.5, 0.4])
"""Bounds of pelvis height (metres), pitch of the pelvis, bend of each joint of the spine (radians)."""
_EFFORT: Final = np.array([0.6, 0.15, 0.2, 0.15, 0.15])
"""Cost of each of them: the arm goes first, then the trunk, then the knees."""


@dataclass(frozen=True)
class Reach:
    """Bring a hand to a point in the body's frame as the part begins: left, up, ahead in metres.

    Origin: the floor under the pelvis. The arm goes first; then the trunk leans and the knees bend, over feet that
    stay, as far as the body keeps its balance. Seated, only trunk and arm move. The feedback says how far a hand stays
    short of its target. `Keyframes.relax` takes the arm down again.
    """

    hand: Literal["left", "right"]
    at: Point
    seconds: float = 1.0

    def __post_init__(self) -> None:
        if self.hand not in ("left", "right"):
            raise MotionError("aim-hand", f"a hand is left or right; got {self.hand!r}")
        _check_aim(self.at, self.seconds)

    @property
    def frames(self) -> int:
        """Number of frames, rounded up to whole chunks of 15."""
        return whole_chunks(self.seconds)

    def over(self, pose: Motion) -> Motion:
        """Return the motion from the last frame of a pose to the target."""
        here = Pose2D.of(pose)
        start = here.to_local(pose[-1:])
        goal = self._arm(self._trunk(start))
        moved = _between(start, goal, self.frames, self.seconds)
        return here.to_world(moved if _is_seated(start) else planted(moved, start))

    def short(self, pose: Motion, motion: Motion) -> str:
        """Say how far the hand ends from the target, from 3 cm; empty if it is there."""
        hand = Pose2D.of(pose).point_to_local(motion[-1:].joints()[0, JOINT_INDEX[f"{self.hand}_hand"]])
        gap = float(np.linalg.norm(hand - self.at))
        return f"your {self.hand} hand stays {100 * gap:.0f} cm short" if gap > 0.03 else ""

    def _trunk(self, start: Motion) -> Motion:
        """Return the pose whose trunk brings the shoulder near enough."""
        usual = np.array([max(start.root[0, 1], 0.97 * STANDING_HEIGHT), 0.0, 0.0, 0.0, 0.0])
        low, high = _LOW.copy(), _HIGH.copy()
        if _is_seated(start):
            usual[0] = start.root[0, 1]
            low[0], high[0] = usual[0] - 1e-6, usual[0] + 1e-6
        usual = np.clip(usual, low, high)

        from scipy.optimize import least_squares  # Every command loads this module; few aim a hand.

        def cost(bend: Array) -> Array:
            return self._cost(_bent(start, bend), start, _EFFORT * (bend - usual))

        found = least_squares(cost, np.clip(usual, low + 1e-7, high - 1e-7), bounds=(low, high), max_nfev=40)
        return _bent(start, found.x)

    def _cost(self, pose: Motion, start: Motion, effort: Array) -> Array:
        """Weigh what the arm cannot cover, the loss of balance, and the effort."""
        joints, turns = forward_kinematics(pose.root[0], pose.rotations[0])
        away = float(np.linalg.norm(joints[JOINT_INDEX[f"{self.hand}_shoulder"]] - self.at))
        far, near = max(away - _straight(self.hand).reach + 0.01, 0.0), max(_NEAR - away, 0.0)
        sway = (centre_of_mass(joints, turns) - start.joints()[0, _SOLES].mean(0))[[0, 2]]
        lost = np.maximum(np.abs(sway) - _SWAY, 0.0) if not _is_seated(start) else np.zeros(2)
        return np.array([60 * far, 60 * near, *(60 * lost), *effort])

    def _arm(self, pose: Motion) -> Motion:
        """Return the pose with this arm stretched out to the target."""
        joints, turns = forward_kinematics(pose.root[0], pose.rotations[0])
        shoulder, elbow = (JOINT_INDEX[f"{self.hand}_{joint}"] for joint in ("shoulder", "elbow"))
        outwards = 1.0 if self.hand == "left" else -1.0
        pole = np.array([0.5 * outwards, -0.6, -0.6])
        upper, fore = solve(_straight(self.hand), joints[shoulder], np.array(self.at), pole)
        rotations = pose.rotations.copy()
        rotations[0, shoulder] = vector_from_matrix(turns[JOINT_INDEX[f"{self.hand}_collar"]].T @ upper)
        rotations[0, elbow] = vector_from_matrix(upper.T @ fore)
        rotations[0, [JOINT_INDEX[f"{self.hand}_{joint}"] for joint in ("wrist", "hand")]] = 0.0
        return Motion(pose.root, rotations)


@dataclass(frozen=True)
class Gaze:
    """Turn neck and head to a point in the body's frame as the part begins: left, up, ahead in metres."""

    at: Point
    seconds: float = 0.5

    def __post_init__(self) -> None:
        _check_aim(self.at, self.seconds)

    @classmethod
    def towards(cls, left: float, up: float = 0.0, seconds: float = 0.5) -> Gaze:
        """Look in a direction: degrees to the left and above the horizon."""
        turn, rise = np.radians([left, up])
        flat = 10 * np.cos(rise)
        eyes = STANDING_HEIGHT + float(OFFSETS[[*_SPINE, JOINT_INDEX["neck"], JOINT_INDEX["head"]], 1].sum()) + EYE[1]
        return cls((float(flat * np.sin(turn)), float(eyes + 10 * np.sin(rise)), float(flat * np.cos(turn))), seconds)

    @property
    def frames(self) -> int:
        """Number of frames, rounded up to whole chunks of 15."""
        return whole_chunks(self.seconds)

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
        return here.to_world(_between(start, Motion(start.root, rotations), self.frames, self.seconds))

    def short(self, pose: Motion, motion: Motion) -> str:
        """Say by how much the head stays short of the direction, from 3 degrees; empty if it looks there."""
        end = Pose2D.of(pose).to_local(motion[-1:])
        joints, turns = forward_kinematics(end.root[0], end.rotations[0])
        head = JOINT_INDEX["head"]
        wanted = _facing(np.array(self.at) - joints[head] - [0.0, EYE[1], 0.0])[:, 2]
        gap = float(np.degrees(np.arccos(np.clip(turns[head][:, 2] @ wanted, -1.0, 1.0))))
        return f"your head stays {gap:.0f} degrees short" if gap > 3 else ""


def _check_aim(at: Point, seconds: float) -> None:
    if np.shape(at) != (3,) or not np.isfinite(np.asarray(at, float)).all():
        raise MotionError("aim-finite", f"an aim is three finite numbers, metres; got {at!r}")
    if not seconds > 0:
        raise MotionError("duration", f"an aim takes more than 0 s; got {seconds!r}")
    check_duration(seconds, "an aim")


def _is_seated(start: Motion) -> bool:
    return OwnBody.of(start).posture == "seated or squatting"


def _straight(side: str) -> Limb:
    """Return an arm whose lower bone is forearm and hand, with a straight wrist."""
    arm = Limb.arm(side)
    return Limb(arm.upper, arm.lower + OFFSETS[JOINT_INDEX[f"{side}_hand"]], arm.hinge)


def _bent(start: Motion, bend: Array) -> Motion:
    """Return a pose: pelvis height, pitch of the pelvis, and the bend of the spine."""
    root, rotations = start.root.copy(), start.rotations.copy()
    root[0, 1] = bend[0]
    rotations[0, 0] = (bend[1], 0.0, 0.0)
    rotations[0, _SPINE] = bend[2:]
    rotations[0, [JOINT_INDEX["left_collar"], JOINT_INDEX["right_collar"]]] = 0.0
    bent = Motion(root, rotations)
    return bent if _is_seated(start) else planted(bent, start)


def _facing(direction: Array) -> Array:
    """Return the orientation (3, 3) of an upright head that looks in a direction."""
    ahead = direction / max(float(np.linalg.norm(direction)), 1e-9)
    left = np.cross([0.0, 1.0, 0.0], ahead)
    left = left / max(float(np.linalg.norm(left)), 1e-9)
    return np.stack([left, np.cross(ahead, left), ahead], -1)


def _between(start: Motion, goal: Motion, frames: int, seconds: float) -> Motion:
    """Return the frames from one pose to another, each joint along its shortest arc."""
    ease = smoothstep(np.arange(1, frames + 1) / FPS / seconds)[:, None]
    first, last = matrix_from_vector(start.rotations[0]), matrix_from_vector(goal.rotations[0])
    turn = vector_from_matrix(np.swapaxes(first, -1, -2) @ last)
    rotations = vector_from_matrix(first @ matrix_from_vector(ease[:, None] * turn))
    return Motion(start.root + ease * (goal.root - start.root), rotations)
