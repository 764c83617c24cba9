"""Aims of a hand, reached by inverse kinematics within the limits of joints and balance."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

import numpy as np

from humanclaw.body.ik import Limb, solve
from humanclaw.body.limits import centre_of_mass
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
from humanclaw.body.skeleton import JOINT_INDEX, OFFSETS, STANDING_HEIGHT
from humanclaw.motion.carrying import turned_palm
from humanclaw.motion.leg_ik import keep_feet
from humanclaw.skills.gaze_grip_speech import Point, Side, between, check_aim, check_hand
from humanclaw.skills.plan import whole_chunks
from humanclaw.skills.proprioception import ProprioceptiveState

_HAND_SPEED: Final = 2.0
"""Metres a second of a hand at most."""
_SPINE: Final = [JOINT_INDEX[f"spine{number}"] for number in (1, 2, 3)]
_SOLES: Final = [JOINT_INDEX[f"{side}_{part}"] for side in ("left", "right") for part in ("ankle", "foot")]
_STEP: Final = 2.0**-26
"""Difference by which slopes of the cost are found: half of the digits."""
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
    stay, as far as the body keeps its balance. Seated, only trunk and arm move. A hand that would be faster than 2 m/s
    ends on its way. The feedback says how far it stays short of its target. `Keyframes.relax` takes the arm down again.
    """

    hand: Side
    at: Point
    seconds: float = 1.0

    def __post_init__(self) -> None:
        check_hand(self.hand)
        check_aim(self.at, self.seconds)

    def over(self, pose: Motion, palms: Mapping[Side, Array] = MappingProxyType({})) -> Motion:
        """Return the motion from the last frame of a pose to the target.

        palms: by side the turn (3, 3), in the frame of the heading, of palms that hold something. This hand keeps it,
        where others have a straight wrist; the other hand must be able to stay where it is.
        """
        here = Pose2D.of(pose)
        start, palm = here.to_local(pose[-1:]), palms.get(self.hand)
        goal = self._arm(self._trunk(start, palm, [side for side in palms if side != self.hand]), palm)
        share = 1.0
        while (fastest := self._fastest(start, moved := self._moved(start, goal, palm, share))) > _HAND_SPEED:
            share *= 0.98 * _HAND_SPEED / fastest
        return here.to_world(moved)

    def short(self, pose: Motion, motion: Motion) -> float:
        """Return how far the hand ends from the target, metres."""
        return float(np.linalg.norm(Pose2D.of(pose).point_to_local(self._path(motion[-1:])[0]) - self.at))

    def _fastest(self, start: Motion, moved: Motion) -> float:
        """Return the highest speed of the hand, m/s."""
        return float(np.linalg.norm(np.diff(self._path(start.then(moved)), axis=0), axis=1).max()) * FPS

    def _path(self, motion: Motion) -> Array:
        """Return the path (T, 3) of the hand."""
        return np.asarray(motion.joints()[:, JOINT_INDEX[f"{self.hand}_hand"]])

    def _moved(self, start: Motion, goal: Motion, palm: Array | None, share: float) -> Motion:
        """Return that share of the motion from one pose to another, over feet that stay."""
        moved = between(start, goal, self.seconds, share)
        moved = moved if _is_seated(start) else keep_feet(moved, start)
        moved = self._swung(moved, start, goal, palm, share)
        return moved if palm is None else turned_palm(moved, self.hand, palm)

    def _swung(self, moved: Motion, start: Motion, goal: Motion, palm: Array | None, share: float) -> Motion:
        """Return a motion whose hand goes round the shoulder, before the body: an elbow turned along its shortest arc
        would take it behind the back."""
        (limb, end), (collar, shoulder, elbow) = self._end(palm), self._joints("collar", "shoulder", "elbow")
        last = self._joints("hand" if palm is None else "wrist")[0]
        first = start.joints()[0, last] - start.joints()[0, shoulder]
        ways = _ways(first, end - goal.joints()[0, shoulder], self._outwards, self._ease(share))
        joints, turns = forward_kinematics(
            *(np.concatenate(pair) for pair in zip(vars(start).values(), vars(moved).values(), strict=True))
        )
        upper, fore = solve(limb, joints[:, shoulder], joints[:, shoulder] + ways, self._pole)
        rotations = moved.rotations.copy()
        for joint, parent, turned in ((shoulder, turns[:, collar], upper), (elbow, upper, fore)):
            local = np.swapaxes(parent, -1, -2) @ turned
            own = vector_from_matrix(local[0].T @ matrix_from_vector(start.rotations[0, joint]))
            blended = local @ matrix_from_vector((1 - self._ease(1.0))[:, None] * own)
            rotations[:, joint] = vector_from_matrix(blended)[1:]
        return Motion(moved.root, rotations)

    def _ease(self, share: float) -> Array:
        """Return (T + 1,) from 0 to a share."""
        return share * smoothstep(np.arange(whole_chunks(self.seconds) + 1) / FPS / self.seconds)

    def _joints(self, *parts: str) -> list[int]:
        return [JOINT_INDEX[f"{self.hand}_{part}"] for part in parts]

    @property
    def _outwards(self) -> float:
        return 1.0 if self.hand == "left" else -1.0

    @property
    def _pole(self) -> Array:
        """Where the elbow points."""
        return np.array([0.5 * self._outwards, -0.6, -0.6])

    def _trunk(self, start: Motion, palm: Array | None, others: Sequence[Side]) -> Motion:
        """Return the pose whose trunk brings the shoulder near enough, and takes those of others not too far."""
        ends = [(_shoulder(self.hand), *self._end(palm))]
        ends += [(_shoulder(side), Limb.arm(side), start.joints()[0, JOINT_INDEX[f"{side}_wrist"]]) for side in others]
        usual = np.array([max(start.root[0, 1], 0.97 * STANDING_HEIGHT), 0.0, 0.0, 0.0, 0.0])
        low, high, seated = _LOW.copy(), _HIGH.copy(), _is_seated(start)
        middle = None if seated else start.joints()[0, _SOLES].mean(0)
        if seated:
            usual[0] = start.root[0, 1]
            low[0], high[0] = usual[0] - 1e-6, usual[0] + 1e-6
        usual = np.clip(usual, low, high)

        from scipy.optimize import least_squares  # Every command loads this module; few aim a hand.

        def costs(bends: Array) -> Array:
            return _costs(_bent(start, bends, seated), middle, _EFFORT * (bends - usual), ends)

        def slopes(bend: Array) -> Array:
            steps = np.where(bend + _STEP < high, _STEP, -_STEP)
            here, *there = costs(np.vstack([bend, bend + np.diag(steps)]))
            return np.transpose((there - here) / steps[:, None])

        begin = np.clip(usual, low + 1e-7, high - 1e-7)
        solution = least_squares(lambda bend: costs(bend[None])[0], begin, slopes, bounds=(low, high), max_nfev=40)
        return _bent(start, solution.x[None], seated)

    def _end(self, palm: Array | None) -> tuple[Limb, Array]:
        """Return the limb that reaches, and where its end (3,) is to be: the knuckles, or the wrist of a palm."""
        if palm is None:
            return _straight(self.hand), np.array(self.at)
        return Limb.arm(self.hand), self.at - palm @ OFFSETS[JOINT_INDEX[f"{self.hand}_hand"]]

    def _arm(self, pose: Motion, palm: Array | None) -> Motion:
        """Return the pose with this arm stretched out to the target."""
        limb, end = self._end(palm)
        joints, turns = forward_kinematics(pose.root[0], pose.rotations[0])
        collar, shoulder, elbow, wrist, hand = self._joints("collar", "shoulder", "elbow", "wrist", "hand")
        upper, fore = solve(limb, joints[shoulder], end, self._pole)
        rotations = pose.rotations.copy()
        rotations[0, shoulder] = vector_from_matrix(turns[collar].T @ upper)
        rotations[0, elbow] = vector_from_matrix(upper.T @ fore)
        rotations[0, [wrist, hand]] = 0.0
        reached = Motion(pose.root, rotations)
        return reached if palm is None else turned_palm(reached, self.hand, palm)


def _shoulder(side: str) -> int:
    return JOINT_INDEX[f"{side}_shoulder"]


def _costs(poses: Motion, middle: Array | None, effort: Array, ends: Sequence[tuple[int, Limb, Array]]) -> Array:
    """Weigh (N, ...) what arms cannot cover, the loss of balance, and the effort (N, 5), of N poses.

    middle: (3,) of the feet that carry the body; None on a seat. ends: shoulder, limb and end (3,) of arms.
    """
    joints, turns = forward_kinematics(poses.root, poses.rotations)
    away = np.stack([np.linalg.norm(joints[:, shoulder] - end, axis=1) for shoulder, _, end in ends], axis=1)
    far = np.maximum(away - [limb.reach - 0.01 for _, limb, _ in ends], 0.0)
    near = np.maximum(_NEAR - away, 0.0)
    sway = np.zeros((len(away), 2)) if middle is None else (centre_of_mass(joints, turns) - middle)[:, [0, 2]]
    return np.hstack([60 * far, 60 * near, 60 * np.maximum(np.abs(sway) - _SWAY, 0.0), effort])


def _is_seated(start: Motion) -> bool:
    return ProprioceptiveState.of(start).posture == "seated or squatting"


def _straight(side: str) -> Limb:
    """Return an arm whose lower bone is forearm and hand, with a straight wrist."""
    arm = Limb.arm(side)
    return Limb(arm.upper, arm.lower + OFFSETS[JOINT_INDEX[f"{side}_hand"]], arm.hinge)


def _bent(start: Motion, bends: Array, seated: bool) -> Motion:
    """Return N poses from (N, 5): pelvis height, pitch of the pelvis, and the bend of the spine."""
    root, rotations = (np.repeat(each, len(bends), axis=0) for each in (start.root, start.rotations))
    root[:, 1] = bends[:, 0]
    rotations[:, 0] = bends[:, 1, None] * np.eye(3)[0]
    rotations[:, _SPINE] = bends[:, None, 2:]
    rotations[:, [JOINT_INDEX["left_collar"], JOINT_INDEX["right_collar"]]] = 0.0
    bent = Motion(root, rotations)
    return bent if seated else keep_feet(bent, start)


def _ways(first: Array, last: Array, outwards: float, share: Array) -> Array:
    """Return (T, 3) ways from a shoulder to a hand, from the first to the last (3,), the longer the more before the
    body. share: (T,) 0 to 1."""
    near, far = (float(np.linalg.norm(way)) for way in (first, last))
    start, end = first / near, last / max(far, 1e-9)
    before = (start + end) / 2 + 0.6 * (1 - start @ end) * np.array([0.4 * outwards, 0.0, 1.0])
    t = share[:, None]
    way = (1 - t) ** 2 * start + 2 * t * (1 - t) * before + t**2 * end
    return np.asarray((near + t * (far - near)) * way / np.linalg.norm(way, axis=1, keepdims=True))
