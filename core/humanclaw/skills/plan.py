"""The plan of a call: a control of the motion model, keyframes, or a sequence of both."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from numbers import Real
from pathlib import Path
from typing import Any, Final

import numpy as np

from humanclaw.body.pose import FPS, FUTURE, Motion, matrix_from_vector, smoothstep, vector_from_matrix
from humanclaw.body.skeleton import JOINT_INDEX

LONGEST_FAULT: Final = 300
LONGEST_CALL: Final = 10.0
"""Maximum seconds of one call: the agent cannot decide during it."""


@dataclass(frozen=True)
class Control:
    """Run the motion model for one 0.5 s chunk with this adapter and condition."""

    adapter: Path
    values: Mapping[str, float]
    """Parameter to its value, SI: metres and radians, named as in the adapter's header (humanclaw.skills.si_name)."""

    def __post_init__(self) -> None:
        if not isinstance(self.adapter, Path):
            raise MotionError("control-adapter", f"an adapter is the Path of its file; got {self.adapter!r}")
        if not isinstance(self.values, Mapping):
            raise MotionError("control-values", f"values are numbers by the name of a parameter; got {self.values!r}")
        for name, value in self.values.items():
            if not isinstance(value, Real) or not math.isfinite(value):
                raise MotionError("control-finite", f"a Control commands finite numbers; got {name}={value!r}")


class MotionError(ValueError):
    """Motion that cannot be played. check: name of the failed check."""

    def __init__(self, check: str, message: str) -> None:
        super().__init__(message)
        self.check = check


@dataclass(frozen=True)
class Keyframes:
    """Rotations added to the body's pose, played without the motion model.

    times: seconds, increasing from 0 to at most 10. rotations: by joint name, one rotation vector (radians, joint
    frame) for each time.
    """

    times: tuple[float, ...]
    rotations: Mapping[str, tuple[tuple[float, float, float], ...]]

    def __post_init__(self) -> None:
        unknown = sorted(set(self.rotations) - set(JOINT_INDEX))
        if unknown:
            known = ", ".join(JOINT_INDEX)
            raise MotionError("keyframes-joints", f"unknown joint {unknown[0]!r}; the joints are {known}")
        if len(self.times) < 2 or self.times[0] != 0 or not all(np.diff(self.times) > 0):
            raise MotionError("keyframes-times", f"key times must start at 0 and increase; got {self.times[:9]}")
        _check_duration(self.times[-1], "keyframes")
        for joint, keys in self.rotations.items():
            if len(keys) != len(self.times):
                raise MotionError("keyframes-times", f"{joint} has {len(keys)} keys for {len(self.times)} times")
            if np.shape(keys) != (len(keys), 3) or not np.isfinite(keys).all():
                raise MotionError("keyframes-finite", f"{joint} has keys that are not three finite numbers each")

    @classmethod
    def cycle(cls, joint: str, axis: str, degrees: float, seconds: float, times: int = 1) -> Keyframes:
        """Turn one joint about its own x, y or z axis and back again, `times` times, `seconds` each."""
        if axis not in ("x", "y", "z"):
            raise ValueError(f"axis must be x, y or z; got {axis!r}")
        if not seconds * times > 0:
            raise MotionError("keyframes-times", f"keyframes last more than 0 s; got {seconds * times:g} s")
        _check_duration(seconds * times, "keyframes")
        peak = tuple(np.radians(degrees) * (name == axis) for name in "xyz")
        rest = (0.0, 0.0, 0.0)
        marks = tuple(seconds / 2 * index for index in range(2 * times + 1))
        keys = tuple(peak if index % 2 else rest for index in range(2 * times + 1))
        return cls(marks, {joint: keys})

    @property
    def frames(self) -> int:
        """Number of frames, rounded up to whole chunks of 15."""
        return -(-int(np.ceil(self.times[-1] * FPS - 1e-9)) // FUTURE) * FUTURE

    def over(self, pose: Motion) -> Motion:
        """Return the motion of the keyframes over the last frame of a pose."""
        frames = self.frames
        clock = np.minimum(np.arange(1, frames + 1) / FPS, self.times[-1])
        root = np.repeat(pose.root[-1:], frames, axis=0)
        rotations = np.repeat(pose.rotations[-1:], frames, axis=0)
        for joint, keys in self.rotations.items():
            offsets = _smooth(clock, np.array(self.times), np.array(keys, float))
            index = JOINT_INDEX[joint]
            turned = matrix_from_vector(rotations[:, index]) @ matrix_from_vector(offsets)
            rotations[:, index] = vector_from_matrix(turned)
        return Motion(root, rotations)


def _smooth(clock: np.ndarray[Any, Any], times: np.ndarray[Any, Any], keys: np.ndarray[Any, Any]) -> Any:
    """Interpolate keys with zero velocity at each of them."""
    index = np.clip(np.searchsorted(times, clock, side="right") - 1, 0, len(times) - 2)
    share = (clock - times[index]) / (times[index + 1] - times[index])
    ease = smoothstep(share)[:, None]
    return keys[index] * (1 - ease) + keys[index + 1] * ease


Part = Control | Keyframes
Plan = Part | Sequence[Part]
"""The plan of a call: one part, or a sequence of parts, each from the last pose of the one before."""


def parts(plan: Plan) -> tuple[Part, ...]:
    """Return the parts of a plan, in order. Raises MotionError for a value that is not a plan, or above 10 s."""
    found = (plan,) if isinstance(plan, Part) else tuple(plan) if isinstance(plan, Sequence) else ()
    if not found or not all(isinstance(part, Part) for part in found):
        expected = "a skill returns a Control, Keyframes or a sequence of them"
        raise MotionError("plan-kind", f"{expected}; got {str(plan)[:LONGEST_FAULT]!r}")
    _check_duration(sum(part.frames if isinstance(part, Keyframes) else FUTURE for part in found) / FPS, "a call")
    return found


def _check_duration(seconds: float, what: str) -> None:
    if not seconds <= LONGEST_CALL:  # Also NaN.
        raise MotionError("duration", f"{what} may last at most {LONGEST_CALL:g} s; got {seconds:g} s")
