"""State and style of bodies whose motion is synthesised: what a chunk begins from, and how bodies differ.

Shapes: N bodies move at once. Frames as in humanclaw.body. Needs only numpy.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Final

import numpy as np

from humanclaw.body import FPS, FUTURE, STANDING_HEIGHT, Array, rest_pose
from humanclaw_train.synthesis import profiles
from humanclaw_train.synthesis.commands import Ints, Mask

SECONDS: Final = FUTURE / FPS
"""Duration of a chunk's future: 0.5 s."""
STAND: Final = 0.956
"""Pelvis height, metres, of a body that stands or whose feet pass each other. The knees stay slightly bent."""
TOE_OUT: Final = 0.12
"""Outward turn of a standing foot, radians."""
AIRBORNE: Final = 0.004
"""Height above the floor, metres, from which a foot counts as in the air."""
SEATED: Final = 0.03
"""Distance of the hips behind the feet, metres, from which a body counts as seated."""


@dataclass(frozen=True)
class State:
    """N bodies at the end of a chunk. Rates and velocities are per chunk.

    * root, velocity (N, 3): of the path of the pelvis, without its sway. yaw, yaw_rate (N,).
    * level (N,): height of the floor. height (N,): of the pelvis above the level, with its sway. Metres.
    * seat (N,): distance of the hips behind the feet, metres; zero when standing.
    * foot, foot_velocity (N, 2, 3): the points under the ankles, left first.
    * foot_yaw, foot_yaw_rate, foot_pitch, foot_pitch_rate (N, 2).
    * next (N,): the foot that swings first, unless the command or the position of the feet requires the other.
    * pose, pose_rate (N, CHANNELS): of the upper body.
    * phase, cadence (N,): of the step cycle; the cadence is zero for a body that does not walk.
    * sway (N, 3): amplitudes of the pelvis about its path, as `gait.amplitudes` returns them.
    * lacking (N,): by how many metres the previous chunk's clearance over the edge of a stair fell short of 2 cm.
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
        """Return bodies at the origin in a quiet stance, with the next foot slightly behind the other."""
        foot = np.tile([[0.085, 0.0, -0.02], [-0.085, 0.0, -0.02]], (len(pose), 1, 1))
        foot[np.arange(len(pose)), next_foot, 2] -= 0.03
        return cls._still(STAND, foot, TOE_OUT, next_foot, pose)

    @classmethod
    def resting(cls, next_foot: Ints) -> State:
        """Return bodies in `rest_pose`, the pose in which an episode begins."""
        n = len(next_foot)
        foot = np.tile([[0.09, 0.0, 0.0], [-0.09, 0.0, 0.0]], (n, 1, 1))
        return cls._still(STANDING_HEIGHT, foot, 0.0, next_foot, np.repeat(profiles.channels(rest_pose(3))[:1], n, 0))

    @classmethod
    def _still(cls, height: float, foot: Array, toe_out: float, next_foot: Ints, pose: Array) -> State:
        n = len(pose)
        zero, two, three = np.zeros(n), np.zeros((n, 2)), np.zeros((n, 3))
        return cls(
            three + [0.0, height, 0.0], three, zero, zero, zero, zero, foot, np.zeros((n, 2, 3)),
            two + [toe_out, -toe_out], two, two, two, next_foot, pose, np.zeros_like(pose),
            zero, zero, three, zero + height, zero,
        )  # fmt: skip

    @property
    def seated(self) -> Mask:
        return self.seat > SEATED

    @property
    def hanging(self) -> Mask:
        """(N,) Whether the next foot is in the air."""
        return np.asarray(self.of_foot(self.foot, self.next)[:, 1] - self.level > AIRBORNE)

    def of_foot(self, values: Array, foot: Ints) -> Array:
        """Pick one foot of each body: (N, 2, ...) to (N, ...)."""
        return np.asarray(values[np.arange(len(foot)), foot])

    def where(self, which: Mask, other: State) -> State:
        """Return this state where `which` (N,) is true and the other state elsewhere."""
        pairs = ((getattr(self, field.name), getattr(other, field.name)) for field in fields(State))
        return State(*(np.where(which.reshape(-1, *(1 for _ in a.shape[1:])), a, b) for a, b in pairs))


@dataclass(frozen=True)
class Style:
    """How bodies differ from one another."""

    gait: Array
    """(N, 1 + 2 HARMONICS, CHANNELS) of the upper body over the step cycle."""
    stance: Array
    """(N, CHANNELS)"""
    seats: Array
    """(H, CHANNELS) from `seat_table`."""
    sway: Array
    """(T, CHANNELS) idle sway over time."""
    frame: Ints
    """(N,) each body's current frame of `sway`."""
    tempo: Array
    """(N,) cadence relative to the average walker at the same speed."""
    swings: Array
    """(N, 3) swings of the pelvis to the side, ahead and up, relative to the average walker."""
    roll: Array
    """(N,) pitch and height of the feet, relative to the average walker."""
    width: Array
    """(N,) extra distance of each foot from the middle, metres."""
    riser: Array
    """(N,) 0 to 1: where the feet stand on the treads of stairs."""

    def later(self, frames: int) -> Style:
        """Return the style with the idle sway advanced by some frames."""
        return replace(self, frame=self.frame + frames)
