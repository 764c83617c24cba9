"""Stretches of clips that show a steady straight walk or quiet standing. Synthesis measures its profiles on them."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Final

import numpy as np

from humanclaw import Motion
from humanclaw.body import FPS, JOINT_INDEX, STANDING_HEIGHT, Array
from humanclaw_train.mocap.foot_contacts import runs_of
from humanclaw_train.synthesis.commands import Mask

_SECONDS: Final = 2.0
"""Least length of a stretch: a walk shows a cycle of two steps in it."""
_MOST: Final = 32
"""Most stretches of a kind; more add no new style."""
_WALKING: Final = (0.7, 1.9)
"""m/s."""
_HANDS, _SHOULDERS, _TOES = (
    [JOINT_INDEX[f"{side}_{part}"] for side in ("left", "right")] for part in ("wrist", "shoulder", "foot")
)


def walks(motions: Iterable[Motion]) -> list[Motion]:
    """Return the longest steady straight walk of each motion that has one, of at most 32 motions."""
    return _longest(motions, _walking)


def idles(motions: Iterable[Motion]) -> list[Motion]:
    """Return the longest quiet standing of each motion that has some, of at most 32 motions."""
    return _longest(motions, _idling)


def _longest(motions: Iterable[Motion], rule: Callable[[Motion], Mask]) -> list[Motion]:
    least = round(_SECONDS * FPS)
    found = ((motion, runs_of(rule(motion), least)) for motion in motions if len(motion) >= least)
    parts = [max((motion[run] for run in runs), key=len) for motion, runs in found if runs]
    return [parts[index] for index in np.unique(np.linspace(0, len(parts) - 1, _MOST).astype(int))] if parts else []


def _walking(motion: Motion) -> Mask:
    velocity, yaw = _smooth(_rate(motion.root[:, [0, 2]])), np.unwrap(motion.yaw())
    ahead = np.sum(velocity * np.stack([np.sin(yaw), np.cos(yaw)], -1), -1)
    turning = np.abs(_smooth(_rate(yaw[:, None])))[:, 0]
    aside = np.sqrt(np.maximum(np.sum(velocity**2, -1) - ahead**2, 0))
    low, high = _WALKING
    straight = (aside < 0.3 * ahead) & (turning < 0.5)
    return np.asarray(_upright(motion) & (ahead > low) & (ahead < high) & straight)


def _idling(motion: Motion) -> Mask:
    toes = np.linalg.norm(_rate(motion.joints()[:, _TOES]), axis=-1).max(-1)
    return np.asarray(_upright(motion) & (np.linalg.norm(_rate(motion.root), axis=-1) < 0.15) & (toes < 0.1))


def _upright(motion: Motion) -> Mask:
    height = motion.joints()[..., 1]
    # Bounds on both sides: the floor of a clip on stairs is unknown.
    standing = np.abs(motion.root[:, 1] / STANDING_HEIGHT - 1) < 0.12
    return np.asarray(standing & (height[:, _HANDS].max(1) < height[:, _SHOULDERS].min(1)))


def _rate(track: Array) -> Array:
    """Return the change of a track (T, ...) per second; the last frame repeats the one before."""
    change = np.diff(track, axis=0) * FPS
    return np.concatenate([change, change[-1:]]) if len(change) else np.zeros_like(track)


def _smooth(track: Array) -> Array:
    """Return the mean of a track (T, k) over half a second, about a step."""
    kernel = np.full(FPS // 2, 2 / FPS)
    return np.stack([np.convolve(column, kernel, "same") for column in track.T], -1)
