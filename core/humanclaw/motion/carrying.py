"""Keep an arm as it is, over any motion of the rest of the body: a hand that holds something does not swing.

The hand keeps its place and its turn in the frame of the pelvis, with the horizon level, so that what lies on a tray
stays there. As with resting hands, the motion model goes on from its own arms: it has never seen others.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, Self

import numpy as np

from humanclaw.body.ik import SIDES, Limb, bent
from humanclaw.body.pose import (
    Array,
    Motion,
    forward_kinematics,
    heading,
    matrix_from_vector,
    smoothstep,
    vector_from_matrix,
    yaw_matrix,
)
from humanclaw.body.skeleton import JOINT_INDEX, Side

ARM: Final = ("collar", "shoulder", "elbow", "wrist", "hand")
_STRAIGHT: Final = 0.005
"""Metres that an arm stays shorter than stretched out."""


@dataclass(frozen=True, eq=False)
class Carrying:
    """An arm that stays as it is."""

    side: Side
    rotations: Array
    """(5, 3) of ARM."""
    place: Array
    """(3,) of the wrist from the pelvis, metres, in the frame of the heading."""
    turn: Array
    """(3, 3) of the palm in the frame of the heading."""

    @classmethod
    def of(cls, motion: Motion, side: Side) -> Self:
        """Return one arm of the last frame of a motion."""
        joints, turns = forward_kinematics(motion.root[-1], motion.rotations[-1])
        wrist, level = JOINT_INDEX[f"{side}_wrist"], yaw_matrix(heading(motion.rotations[-1, 0]))
        return cls(
            side, motion.rotations[-1, _arm(side)], level.T @ (joints[wrist] - joints[0]), level.T @ turns[wrist]
        )

    def over(self, motion: Motion, still: Array | None = None) -> Motion:
        """Return a motion with this arm. still: (3,) where the wrist stays; None for its place at the pelvis."""
        collar, shoulder, elbow, wrist, _ = arm = _arm(self.side)
        rotations = motion.rotations.copy()
        rotations[:, arm] = self.rotations
        joints, turns = forward_kinematics(motion.root, rotations)
        level = yaw_matrix(heading(rotations[:, 0]))
        due = motion.root + level @ self.place if still is None else np.broadcast_to(still, motion.root.shape)
        limb = Limb.arm(self.side)
        points = joints[:, [shoulder, elbow, wrist]]
        upper, fore = bent(limb, points, turns[:, [shoulder, elbow]], due, limb.reach - _STRAIGHT)
        pairs = ((shoulder, turns[:, collar], upper), (elbow, upper, fore), (wrist, fore, level @ self.turn))
        for joint, parent, turned in pairs:
            rotations[:, joint] = vector_from_matrix(np.swapaxes(parent, -1, -2) @ turned)
        return Motion(motion.root, rotations)

    def let_go(self, motion: Motion) -> Motion:
        """Return a motion whose arm comes from here into its own."""
        arm, share = _arm(self.side), smoothstep(np.arange(1, len(motion) + 1) / len(motion))[:, None, None]
        first, last = (matrix_from_vector(held.rotations[:, arm]) for held in (self.over(motion), motion))
        way = vector_from_matrix(np.swapaxes(first, -1, -2) @ last)
        rotations = motion.rotations.copy()
        rotations[:, arm] = vector_from_matrix(first @ matrix_from_vector(share * way))
        return Motion(motion.root, rotations)


def turned_palm(motion: Motion, side: Side, palm: Array) -> Motion:
    """Return a motion whose palm keeps a turn (3, 3) in the frame of the heading."""
    _, turns = forward_kinematics(motion.root, motion.rotations)
    level, rotations = yaw_matrix(heading(motion.rotations[:, 0])), motion.rotations.copy()
    fore = np.swapaxes(turns[:, JOINT_INDEX[f"{side}_elbow"]], -1, -2)
    rotations[:, JOINT_INDEX[f"{side}_wrist"]] = vector_from_matrix(fore @ level @ palm)
    return Motion(motion.root, rotations)


class Arms:
    """Which arms of a body are kept over its motion, from chunk to chunk."""

    def __init__(self) -> None:
        self._kept: dict[Side, Carrying] = {}
        self._left: dict[Side, Carrying] = {}
        """Arms that have let go, and are still to come down."""

    @property
    def palms(self) -> Mapping[Side, Array]:
        """Turns (3, 3) of the palms that hold something, in the frame of the heading, by side."""
        return {side: arm.turn for side, arm in self._kept.items()}

    def over(self, motion: Motion, moved: frozenset[Side], before: Motion) -> Motion:
        """Return the motion of a chunk with the arms that are kept, but for those that it moves itself.

        While one hand moves over feet that stay, the other one stays where it is in a pose before.
        """
        for side, arm in self._kept.items():
            still = before.joints()[-1, JOINT_INDEX[f"{side}_wrist"]] if moved else None
            motion = motion if side in moved else arm.over(motion, still)
        for side, arm in self._left.items():
            motion = motion if side in moved else arm.let_go(motion)
        return motion

    def pose(self, history: Motion) -> Motion:
        """Return the pose that a history ends in, with arms as they are."""
        for arm in (*self._kept.values(), *self._left.values()):
            history = arm.over(history)
        return history

    def after(self, simulated: Motion, held: Mapping[Side, int], moved: frozenset[Side]) -> None:
        """Keep the arms that hold something after a chunk, as it ends. moved: those that it moved itself."""
        self._left = {side: arm for side, arm in self._kept.items() if side not in held and side not in moved}
        for side in SIDES:
            if side not in held:
                self._kept.pop(side, None)
            elif moved or side not in self._kept:
                self._kept[side] = Carrying.of(simulated, side)


def _arm(side: Side) -> list[int]:
    return [JOINT_INDEX[f"{side}_{joint}"] for joint in ARM]
