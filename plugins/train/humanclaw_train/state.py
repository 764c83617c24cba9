"""STATE_DOC"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Final

import numpy as np

from humanclaw.body import STANDING_HEIGHT
from humanclaw.pose import FPS, FUTURE, Array, rest_pose
from humanclaw_train import augment
from humanclaw_train.commands import Ints, Mask

SECONDS: Final = FUTURE / FPS
STAND: Final = 0.956
"""Pelvis height of a standing or passing body: the knees are never quite straight."""
TOE_OUT: Final = 0.12
AIRBORNE: Final = 0.004
"""A foot this far above the floor hangs, metres."""
SEATED: Final = 0.03
"""Hips this far behind the feet sit, metres."""


@dataclass(frozen=True)
class State:
    """N bodies at the end of a chunk; rates and velocities are per chunk. The root is that of the path, about which a
    walker sways.

    root, velocity (N, 3); yaw, yaw_rate, level of the floor (N,); seat (N,): how far the hips are behind the feet,
    nought when standing; foot, foot_velocity (N, 2, 3): the points under the ankles, left first; foot_yaw,
    foot_yaw_rate, foot_pitch, foot_pitch_rate (N, 2); next (N,): the foot that swings first unless the command or
    where the feet stand has a reason against it; pose, pose_rate (N, CHANNELS). phase (N,) of the step cycle and
    cadence (N,), nought for who does not walk; sway (N, 3): amplitudes of the pelvis about its path, as
    humanclaw_train.gait has them. height (N,): of the pelvis itself above the level. lacking (N,): by how much the
    chunk before missed 2 cm of clearance over the edge of a stair, metres.
    """

    root: Array
    velocity: Array
    yaw: Array
    yaw_rate: Array
    level: Array
    seat: Array
    foot: Array
    foot_velocity: Array
    foot_yaw: Array
    foot_yaw_rate: Array
    foot_pitch: Array
    foot_pitch_rate: Array
    next: Ints
    pose: Array
    pose_rate: Array
    phase: Array
    cadence: Array
    sway: Array
    height: Array
    lacking: Array

    @classmethod
    def standing(cls, pose: Array, next_foot: Ints) -> State:
        """At the origin in a quiet stance, the foot that will go first a little behind."""
        foot = np.tile([[0.085, 0.0, -0.02], [-0.085, 0.0, -0.02]], (len(pose), 1, 1))
        foot[np.arange(len(pose)), next_foot, 2] -= 0.03
        return cls._still(STAND, foot, TOE_OUT, next_foot, pose)

    @classmethod
    def resting(cls, next_foot: Ints) -> State:
        """In `rest_pose`, in which a body that has not moved yet is put into a scene."""
        n = len(next_foot)
        foot = np.tile([[0.09, 0.0, 0.0], [-0.09, 0.0, 0.0]], (n, 1, 1))
        return cls._still(STANDING_HEIGHT, foot, 0.0, next_foot, np.repeat(augment.channels(rest_pose(3))[:1], n, 0))

    @classmethod
    def _still(cls, height: float, foot: Array, toe_out: float, next_foot: Ints, pose: Array) -> State:
        n = len(pose)
        zero, two, three = np.zeros(n), np.zeros((n, 2)), np.zeros((n, 3))
        return cls(
            three + [0.0, height, 0.0], three, zero, zero, zero, zero, foot, np.zeros((n, 2, 3)), two + [toe_out,
            -toe_out],
            two, two, two, next_foot, pose, np.zeros_like(pose), zero, zero, three, zero + height, zero,
        )  # fmt: skip

    @property
    def seated(self) -> Mask:
        return self.seat > SEATED

    @property
    def hanging(self) -> Mask:
        """(N,) whether the next foot is in the air."""
        return np.asarray(self.of_foot(self.foot, self.next)[:, 1] - self.level > AIRBORNE)

    def of_foot(self, values: Array, foot: Ints) -> Array:
        """(N, 2, ...) to (N, ...) of one foot each."""
        return np.asarray(values[np.arange(len(foot)), foot])

    def where(self, which: Mask, other: State) -> State:
        """Return these bodies where `which` (N,), the other ones elsewhere."""
        pairs = ((getattr(self, field.name), getattr(other, field.name)) for field in fields(State))
        return State(*(np.where(which.reshape(-1, *(1 for _ in a.shape[1:])), a, b) for a, b in pairs))


@dataclass(frozen=True)
class Style:
    """What differs between bodies. gait (N, 1 + 2 HARMONICS, CHANNELS); stance (N, CHANNELS); seats (H, CHANNELS) as
    `seat_table` gives them; sway (T, CHANNELS) and the frame of it (N,) at which each body is."""

    gait: Array
    stance: Array
    seats: Array
    sway: Array
    frame: Ints
    tempo: Array
    swings: Array
    """(N, 3) by which the pelvis' swings to the side, ahead and up exceed those of the average walker."""
    roll: Array
    """(N,) the same of the feet's pitch and height."""
    width: Array
    """(N,) metres by which the feet are further apart."""
    riser: Array
    """(N,) 0 to 1: where on the treads of stairs the feet stand."""

    def later(self, frames: int) -> Style:
        return replace(self, frame=self.frame + frames)
