"""The plan of a call: a control of the motion model, a posed part, or a sequence of both."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from numbers import Real
from pathlib import Path
from typing import Any, Final

import numpy as np

from humanclaw.body.pose import (
    FPS,
    FUTURE,
    WHOLE_TURN,
    Array,
    Motion,
    Pose2D,
    matrix_from_vector,
    rest_pose,
    smoothstep,
    vector_from_matrix,
)
from humanclaw.body.skeleton import JOINT_INDEX
from humanclaw.motion.leg_ik import LEGS, keep_feet
from humanclaw.text.words import did_you_mean

LONGEST_FAULT: Final = 300  # Characters: what a model wrote comes back to it in the fault.
LONGEST_CALL: Final = 10.0
"""Maximum seconds of one call: the agent cannot decide during it."""


@dataclass(frozen=True)
class Control:
    """Run the motion model for one 0.5 s chunk with this adapter and condition."""

    adapter: Path
    values: Mapping[str, float]
    """Parameter to its value, SI: metres and radians, named as in the adapter's header (skills.measures.si_name)."""

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
    """Rotations of joints, and a path of the pelvis, played without the motion model.

    times: seconds, increasing from 0 to at most 10. rotations: by joint name, one rotation vector (radians, joint
    frame) for each time. root: for each time, the way of the pelvis since the beginning: left, up, ahead in metres.
    Legs bend so that both feet stay, unless rotations name a joint of a leg.

    Relative keyframes are added to the body's pose. Absolute ones are rotations from the rest pose, as in `Motion`, and
    the height in root is that above the floor. Their times begin above 0: the body comes from its own pose.
    """

    times: tuple[float, ...]
    rotations: Mapping[str, tuple[tuple[float, float, float], ...]]
    absolute: bool = False
    root: tuple[tuple[float, float, float], ...] = ()

    def __post_init__(self) -> None:
        unknown = sorted(set(self.rotations) - set(JOINT_INDEX))
        if unknown:
            meant = did_you_mean(unknown[0], JOINT_INDEX) or f"the joints are {', '.join(JOINT_INDEX)}"
            raise MotionError("keyframes-joints", f"unknown joint {unknown[0]!r} ({meant})")
        self._check_times()
        check_duration(self.times[-1], "keyframes")
        for joint, keys in {**self.rotations, **({"root": self.root} if len(self.root) else {})}.items():
            _check_keys(joint, keys if isinstance(keys, Sequence | np.ndarray) else (keys,))
            if len(keys) != len(self.times):
                raise MotionError("keyframes-times", f"{joint} has {len(keys)} keys for {len(self.times)} times")
            most = 0.0 if joint == "root" else np.abs(keys).max()
            if most > WHOLE_TURN:
                raise MotionError("keyframes-finite", f"{joint} has a key of {most:g}; keys are radians, not degrees")
            if joint != "pelvis" and most > np.pi + 0.01:  # The pelvis may spin.
                reason = f"{joint} has a key of {most:g}; keys are radians, at most 3.14 but for pelvis"
                raise MotionError("keyframes-finite", reason)

    def _check_times(self) -> None:
        if not isinstance(self.times, Sequence | np.ndarray) or not all(isinstance(time, Real) for time in self.times):
            raise MotionError("keyframes-times", f"times are seconds in a row, (0.0, 0.5); got {self.times!r:.60}")
        rising = len(self.times) > 0 and all(np.diff(self.times) > 0)
        if self.absolute and not (rising and self.times[0] > 0):
            raise MotionError("keyframes-times", f"absolute keys begin above 0 s and increase; got {self.times[:9]}")
        if not self.absolute and (len(self.times) < 2 or self.times[0] != 0 or not rising):
            raise MotionError("keyframes-times", f"key times must start at 0 and increase; got {self.times[:9]}")

    @classmethod
    def cycle(cls, joint: str, axis: str, degrees: float, seconds: float, times: int = 1) -> Keyframes:
        """Turn one joint about its own x, y or z axis and back again, `times` times, `seconds` each."""
        if axis not in ("x", "y", "z"):
            raise MotionError("keyframes-joints", f"axis must be x, y or z; got {axis!r}")
        if not seconds * times > 0:
            raise MotionError("keyframes-times", f"keyframes last more than 0 s; got {seconds * times:g} s")
        check_duration(seconds * times, "keyframes")
        if not abs(degrees) <= 180:
            raise MotionError("joint-limits", f"{joint} turns by at most 180 degrees; got {degrees:g}")
        peak = tuple(np.radians(degrees) * (name == axis) for name in "xyz")
        rest = (0.0, 0.0, 0.0)
        marks = tuple(seconds / 2 * index for index in range(2 * times + 1))
        keys = tuple(peak if index % 2 else rest for index in range(2 * times + 1))
        return cls(marks, {joint: keys})

    @classmethod
    def relax(cls, seconds: float) -> Keyframes:
        """Let trunk, head and arms return to the pose of standing."""
        free = [name for name in JOINT_INDEX if name not in (*LEGS, "pelvis")]
        usual = rest_pose().rotations[0]
        return cls((seconds,), {name: (_triple(usual[JOINT_INDEX[name]]),) for name in free}, absolute=True)

    @property
    def seconds(self) -> float:
        """How long they last."""
        return self.times[-1]

    def over(self, pose: Motion) -> Motion:
        """Return the motion of the keyframes over the last frame of a pose."""
        if not self.absolute and not len(self.root):
            return self._over(pose)
        here = Pose2D.of(pose)
        return here.to_world(self._over(here.to_local(pose[-1:])))

    def _over(self, pose: Motion) -> Motion:
        """Return the motion in the frame of the pose."""
        frames = whole_chunks(self.seconds)
        clock = np.minimum(np.arange(1, frames + 1) / FPS, self.seconds)
        still = pose.held(frames)
        root, rotations = still.root, still.rotations
        for joint, keys in self.rotations.items():
            index = JOINT_INDEX[joint]
            rotations[:, index] = self._turned(clock, rotations[0, index], np.array(keys, float))
        if not len(self.root):
            return Motion(root, rotations)
        moved = Motion(root + self._moved(clock, pose), rotations)
        return moved if set(self.rotations) & set(LEGS) else keep_feet(moved, pose)

    def _turned(self, clock: Array, start: Array, keys: Array) -> Array:
        """Return a joint's rotations (T, 3)."""
        times, first = np.array(self.times), matrix_from_vector(start)
        if self.absolute:  # Interpolated as turns from the start, along the shortest arc.
            times = np.array([0.0, *times])
            keys = np.concatenate([np.zeros((1, 3)), vector_from_matrix(first.T @ matrix_from_vector(keys))])
        return vector_from_matrix(first @ matrix_from_vector(_smooth(clock, times, keys)))

    def _moved(self, clock: Array, pose: Motion) -> Array:
        """Return the way of the pelvis (T, 3), metres."""
        times, keys = np.array(self.times), np.array(self.root, float)
        if self.absolute:
            times = np.array([0.0, *times])
            keys = np.concatenate([np.zeros((1, 3)), keys - [0.0, pose.root[-1, 1], 0.0]])
        return np.asarray(_smooth(clock, times, keys))


def _check_keys(joint: str, keys: Sequence[Any]) -> None:
    """Raise MotionError for the first key that is not three finite numbers."""
    with suppress(TypeError, ValueError):  # Texts, or keys of several lengths.
        if np.shape(keys) == (len(keys), 3) and np.isfinite(keys).all():
            return
    for number, key in enumerate(keys, 1):
        values = tuple(key) if isinstance(key, Iterable) else (key,)
        count = sum(isinstance(value, Real) and math.isfinite(value) for value in values)
        if (len(values), count) != (3, 3):
            reason = f"key {number} of {joint} is {key!r:.{LONGEST_FAULT}}; expected three finite numbers, got {count}"
            raise MotionError("keyframes-finite", reason)


def whole_chunks(seconds: float) -> int:
    """Return the frames of a duration, rounded up to whole chunks of 15."""
    return -(-int(np.ceil(seconds * FPS - 1e-9)) // FUTURE) * FUTURE


def _triple(vector: Array) -> tuple[float, float, float]:
    x, y, z = map(float, vector)
    return x, y, z


def _smooth(clock: np.ndarray[Any, Any], times: np.ndarray[Any, Any], keys: np.ndarray[Any, Any]) -> Any:
    """Interpolate keys with zero velocity at each of them."""
    index = np.clip(np.searchsorted(times, clock, side="right") - 1, 0, len(times) - 2)
    share = (clock - times[index]) / (times[index + 1] - times[index])
    ease = smoothstep(share)[:, None]
    return keys[index] * (1 - ease) + keys[index + 1] * ease


def check_lasting(seconds: float, what: str) -> None:
    """Raise MotionError for 0 s or less, and above 10 s."""
    if not seconds > 0:
        raise MotionError("duration", f"{what} takes more than 0 s; got {seconds!r}")
    check_duration(seconds, what)


def check_duration(seconds: float, what: str) -> None:
    """Raise MotionError above 10 s."""
    if not seconds <= LONGEST_CALL:  # Also NaN.
        raise MotionError("duration", f"{what} may last at most {LONGEST_CALL:g} s; got {seconds:g} s")
