"""The gait of synthetic walks: phase of the step cycle, feet and pelvis, for steps that do not wait for chunks.

The phase counts steps as in `profiles`: at even numbers the right foot passes the left one, at odd numbers the left
foot passes the right one. A chunk advances it at the cadence of real walkers at that speed, so chunks begin anywhere in
a cycle. A foot in the air goes on to a landing that each command plans anew. The numbers were fitted to 13 real walks
of CMU subjects 2, 5, 6 and 7 (0.9 to 1.65 m/s), which are all trained on. Needs only numpy.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from humanclaw.body import FPS, FUTURE, Array, smoothstep
from humanclaw_train.synthesis.commands import Ints
from humanclaw_train.synthesis.curves import GRID, bump, cubic, smoother

LIFT: Final = 0.42
"""Phase before the feet pass, in steps, at which the toes of a slow walker leave the ground."""
LAND: Final = 0.39
"""Phase after the feet pass, in steps, at which the heel comes down."""
SWING: Final = LIFT + LAND
"""Duration of a swing, in steps."""


# -- effects of speed --------------------------------------------------------------------------------------------------
def cadence(speed: Array) -> Array:
    """Return the steps in a chunk at a speed in m/s: 1.5 a second at 0.9 m/s, 1.9 at 1.6 m/s."""
    return np.asarray(1.54 * np.clip(speed, 0.3, 2.0) ** 0.43 * FUTURE / FPS)


def longer(speed: Array) -> Array:
    """Return how much longer than a slow walker's a swing is, as a factor: both feet stand 17 % of the time at 1 m/s
    and 6 % at 1.6 m/s."""
    return np.asarray(1.0 + 0.1 * np.clip((speed - 0.5) / 0.9, 0.0, 1.0))


def amplitudes(speed: Array) -> Array:
    """Return how far the pelvis swings to the side, ahead and up, metres (N, 3): the coefficients of `pelvis`."""
    side = np.clip(0.062 - 0.045 * (speed - 0.9), 0.028, 0.065)
    ripple = np.clip(0.26 - 0.1 * (speed - 0.9), 0.12, 0.28)
    ahead = ripple * speed / (2 * np.pi * cadence(speed) * FPS / FUTURE)
    up = np.clip(0.019 + 0.017 * (speed - 0.9), 0.008, 0.026)
    fade = smoothstep(speed / 0.5)
    return np.asarray(np.stack([side, ahead, up], -1) * fade[:, None])


def pelvis_height(speed: Array) -> Array:
    """Return the mean height of a walker's pelvis, metres. Long steps lower it."""
    return np.asarray(0.949 - 0.034 * np.clip(speed, 0.0, 1.8))


def half_width(speed: Array) -> Array:
    """Return how far feet land from the middle, metres. Fast walkers set them closer together."""
    return np.asarray(0.038 - 0.016 * np.clip(speed - 0.9, 0.0, 0.9))


def lean(speed: Array) -> Array:
    """Return how far the trunk leans to the front beyond the walkers' mean, radians: 5 degrees more at 1.6 m/s."""
    return np.asarray(0.09 * smoothstep((speed - 0.9) / 0.7))


def pelvis_yaw(speed: Array) -> Array:
    """Return the swing of the pelvis' yaw in that of the walkers: theirs hardly depends on the speed.

    It is larger, because a chunk takes the pelvis exactly to the commanded heading, whatever its phase.
    """
    return np.asarray(1.8 * np.clip(speed / 0.6, 0.0, 1.0))


def pelvis(phase: Array) -> Array:
    """Return the swing of the pelvis to the side, ahead and up (..., 3), each between -1 and 1.

    It is over the standing foot, and fastest and lowest between two steps.
    """
    return np.stack([np.cos(np.pi * phase), -np.sin(2 * np.pi * phase), np.cos(2 * np.pi * phase)], -1)


def pinned(values: Array) -> Array:
    """Subtract a smooth passage from first to last instant (N, 16, ...), so that both ends are zero."""
    ease = smoother(GRID).reshape(-1, *(1 for _ in values.shape[2:]))
    return np.asarray(values - values[:, :1] * (1 - ease) - values[:, -1:] * ease)


def _curve(points: Array) -> tuple[Array, Array]:
    """Return straight lines between points (K, 2) with rounded corners, sampled over the phase."""
    at = np.linspace(-1.5, 1.5, 601)  # Beyond [-1, 1), so that smoothing has no edges inside.
    kernel = np.hanning(29)  # Half its width is .07 of the phase.
    values = np.interp(at, points[:, 0], points[:, 1])
    padded = np.pad(values, len(kernel) // 2, mode="edge")
    return at, np.convolve(padded, kernel / kernel.sum(), "valid")


_PITCH: Final = _curve(
    np.array(
        [
            [-0.72, 0.0], [-0.56, 0.18], [-0.44, 0.6], [-0.31, 0.98], [-0.19, 0.84], [-0.06, 0.58], [0.06, 0.2],
            [0.19, -0.2], [0.31, -0.46], [0.39, -0.42], [0.47, -0.2], [0.58, 0.0],
        ]
    )
)  # fmt: skip
"""Heel pitch of a foot, radians at 1.1 m/s, over the phase since it passed the other foot."""


def pitch(since: Array, speed: Array) -> Array:
    """Return the heel pitch in radians at a phase in [-1, 1) and a speed in m/s."""
    return np.interp(since, *_PITCH) * np.clip(0.95 + 0.18 * speed, 0.95, 1.25)


def swing_height(progress: Array) -> Array:
    """Return the height of the toes, 0 to 1: they rise at once and sink before the heel lands."""
    return bump(np.sqrt(np.clip(progress, 0.0, 1.0)))


# -- the feet of a chunk -----------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Cycle:
    """The step cycle over a chunk: phase (N, 16), rates at its ends (N,) in steps a chunk, speed (N,) in m/s."""

    phase: Array
    rate: Array
    end_rate: Array
    speed: Array

    @classmethod
    def of(cls, start: Array, rate: Array, end_rate: Array, speed: Array) -> Cycle:
        """Return the cycle whose rate changes linearly over the chunk."""
        moved = rate[:, None] * GRID + (end_rate - rate)[:, None] * GRID**2 / 2
        return cls(start[:, None] + moved, rate, end_rate, speed)

    @property
    def longer(self) -> Array:
        """(N,) Duration of the swings, in that of a slow walker."""
        return longer(self.speed)

    @property
    def first(self) -> Ints:
        """(N,) Number of the passing of the foot that is in the air, or that leaves next."""
        return self.swinging(self.phase[:, 0])

    def swinging(self, phase: Array) -> Ints:
        """Return the number of the passing of the foot that swings, or leaves next, at a phase (N,)."""
        return np.asarray(np.ceil(phase - LAND * self.longer).astype(int))

    def since(self, foot: int) -> Array:
        """Return the phase since a foot passed the other one (N, 16), in [-1, 1), as if swings were a slow walker's."""
        return ((self.phase + foot) % 2 - 1) / self.longer[:, None]

    def progress(self, passing: Ints) -> Array:
        """Return the progress of a swing (N, 16): 0 as the toes leave, 1 as the heel lands, and beyond."""
        return ((self.phase - passing[:, None]) / self.longer[:, None] + LIFT) / SWING


def foot_of(passing: Ints) -> Ints:
    """Return the foot that swings at a passing: left 0, right 1."""
    return (passing + 1) % 2


def reached(cycle: Cycle, path: Array, velocity: Array, phase: Array) -> Array:
    """Return the point (N, k) of a path (N, 16, k) at which the cycle reaches a phase (N,).

    Beyond the chunk's end the path goes on at its last velocity (N, k).
    """
    order = np.array([np.interp(at, row, GRID) for at, row in zip(phase, cycle.phase, strict=True)]) * FUTURE
    low = np.clip(order.astype(int), 0, FUTURE - 1)
    share = (order - low)[:, None]
    rows = np.arange(len(path))
    later = np.clip((phase - cycle.phase[:, -1]) / cycle.end_rate, 0.0, 1.2)[:, None]
    return np.asarray((1 - share) * path[rows, low] + share * path[rows, low + 1] + later * velocity)


def swung(cycle: Cycle, passing: Ints, value: Array, rate: Array, target: Array) -> Array:
    """Return the track of a foot (N, 16, k) from where it is to its target (N, k) at the landing.

    value, rate (N, k): at the start of the chunk, and the change per chunk. The curve is the same in whichever chunk it
    is planned. Shortly before the landing the target no longer changes.
    """
    progress = cycle.progress(passing)
    begun = np.clip(progress[:, 0], 0.0, 0.995)
    left = (1 - begun) * SWING * cycle.longer / cycle.rate
    moving = (progress[:, 0] > 0)[:, None]
    rate = np.where(moving, rate, 0.0)
    late = np.clip((1 - begun) / 0.35, 0.0, 1.0)[:, None]
    goal = late * target + (1 - late) * (value + rate * left[:, None] / 2)
    share = (progress - begun[:, None]) / (1 - begun)[:, None]
    return cubic(share[..., None], value[:, None], (rate * left[:, None])[:, None], goal[:, None], 0.0)


def settled(value: Array, rate: Array, goal: Array, span: Array | float = 0.5) -> Array:
    """Return a goal (N, 16) that begins at the chunk's first value and rate (N,); the difference fades over `span`."""
    gap = (value - goal[:, 0])[:, None]
    drift = (rate - (goal[:, 1] - goal[:, 0]) * FUTURE)[:, None]
    return goal + cubic(GRID / span, gap, drift * span, np.zeros_like(gap), 0.0)
