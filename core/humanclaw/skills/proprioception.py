"""What a skill may feel of its own body."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final, Literal, Self, TypeAlias

import numpy as np

from humanclaw.body.pose import Array, Motion, Pose2D, support_height
from humanclaw.body.skeleton import JOINT_INDEX, STANDING_HEIGHT

Posture: TypeAlias = Literal["standing upright", "standing with bent knees", "seated or squatting"]
_UPRIGHT: Final = 0.85
_BENT: Final = 0.62
"""Shares of the standing height down to which a body stands upright, and stands with bent knees."""


@dataclass(frozen=True)
class ProprioceptiveState:
    """The body as a person feels it, before a call. It never tells anything of the scene.

    Frame: origin on the floor under the pelvis, +X left, +Y up, +Z ahead; metres.
    """

    pose: Motion
    """One frame."""
    pelvis_height: float
    """Above the lower sole, metres."""
    posture: Posture
    held: tuple[str, ...] = ()
    """The hands that hold something, "left" before "right"."""

    @classmethod
    def of(cls, motion: Motion, held: Iterable[str] = ()) -> Self:
        """Return what a body feels in the last frame of a motion (any frame). held: the hands that hold something."""
        pose = Pose2D.of(motion).to_local(motion[-1:])
        height = float(pose.root[0, 1] - support_height(pose.joints())[0])
        return cls(pose, height, posture_of(height), tuple(sorted(held)))

    def joint(self, name: str) -> Array:
        """Return the position (3,) of a joint, metres."""
        return np.asarray(self.pose.joints()[0, JOINT_INDEX[name]])


def posture_of(pelvis_height: float) -> Posture:
    """Name the posture of a pelvis so many metres above the soles."""
    share = pelvis_height / STANDING_HEIGHT
    if share > _UPRIGHT:
        return "standing upright"
    return "standing with bent knees" if share > _BENT else "seated or squatting"
