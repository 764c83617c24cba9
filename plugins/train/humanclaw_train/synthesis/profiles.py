"""Profiles of real clips, for synthesis: upper-body gait over the step cycle, quiet stance and idle sway.

A cycle of two steps has phase [0, 2): at phase 0 the right foot passes the left one on its way forward, at phase 1 the
left foot passes the right one. Channels: pelvis pitch, roll and yaw about the path, then the rotation vectors of UPPER.
Needs only numpy.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from humanclaw import Motion
from humanclaw.body import FPS, JOINT_INDEX, JOINTS, STANDING_HEIGHT, Array, matrix_from_vector
from humanclaw_train.mocap.clips import Clip
from humanclaw_train.mocap.foot_contacts import runs_of
from humanclaw_train.mocap.source_motion import MocapError

UPPER: Final = tuple(
    JOINT_INDEX[name] for name in JOINTS if not any(part in name for part in ("pelvis", "hip", "knee", "ankle", "foot"))
)
CHANNELS: Final = 3 + 3 * len(UPPER)
"""Of a frame: a rotation vector of the pelvis, and one of each joint of the upper body."""
HARMONICS: Final = 4
"""Of the step cycle, to which the gait of the upper body is fitted."""
# Of the clips that the shipped prior learnt from: level walks at several speeds, and idlers who look ahead.
_WALKS: Final = ("02_01", "005_01", "006_01", "007_02", "007_03", "007_09", "007_11")
_IDLES: Final = ("000_genuine", "010_genuine", "014_genuine", "015_genuine")


def channel(joint: str, axis: int = 0) -> int:
    """Return the channel that holds one axis of one upper-body joint's rotation vector."""
    return 3 + 3 * UPPER.index(JOINT_INDEX[joint]) + axis


def _mirror_map() -> tuple[NDArray[np.int64], Array]:
    source, sign = [0, 1, 2], [1.0, -1.0, -1.0]
    for joint in UPPER:
        name = JOINTS[joint].replace("left", "?").replace("right", "left").replace("?", "right")
        source += [channel(name, axis) for axis in range(3)]
        sign += [1.0, -1.0, -1.0]
    return np.array(source), np.array(sign)


_SOURCE, _SIGN = _mirror_map()


def mirror_channels(values: Array) -> Array:
    """Exchange left and right in channels (..., CHANNELS)."""
    return np.asarray(values[..., _SOURCE] * _SIGN)


def channels(motion: Motion) -> Array:
    """Return the channels of a motion (T, CHANNELS). A quadratic trend of the yaw stands for the path's direction."""
    matrix = matrix_from_vector(motion.rotations[:, 0])
    yaw = np.unwrap(motion.yaw())
    time = np.linspace(-1, 1, len(motion))
    roll = np.arcsin(np.clip(matrix[:, 1, 0], -1, 1))  # R = Ry Rz Rx keeps the yaw of the hips free of roll and pitch.
    pitch = np.arctan2(-matrix[:, 1, 2], matrix[:, 1, 1])
    swing = yaw - np.polyval(np.polyfit(time, yaw, 2), time)
    return np.concatenate([np.stack([pitch, roll, swing], 1), motion.rotations[:, UPPER].reshape(len(motion), -1)], 1)


def passings(motion: Motion) -> tuple[Array, NDArray[np.bool_]]:
    """Return the fractional frames at which one ankle passes the other (K,), and whether the left one led (K,)."""
    joints, yaw = motion.joints(), motion.yaw()
    gap = joints[:, JOINT_INDEX["left_ankle"]] - joints[:, JOINT_INDEX["right_ankle"]]
    lead = np.sum(gap[:, [0, 2]] * np.stack([np.sin(yaw), np.cos(yaw)], -1), -1)
    # Zero crossings with a minimum speed: standing feet cross by noise.
    cross = np.flatnonzero((lead[:-1] * lead[1:] < 0) & (np.abs(np.diff(lead)) > 0.01))
    return np.asarray(cross + lead[cross] / (lead[cross] - lead[cross + 1])), lead[cross] > 0


def step_phase(motion: Motion) -> tuple[Array, NDArray[np.bool_]]:
    """Return a straight walk's phase in steps (T,), and which frames lie between two passings of the feet (T,)."""
    (time, left_led), frames = passings(motion), np.arange(len(motion))
    inside = (frames >= time[0]) & (frames <= time[-1])
    return np.interp(frames, time, np.arange(len(time))) + (0 if left_led[0] else 1), inside


def basis(phase: Array) -> Array:
    """Return the Fourier basis of period 2 (..., 1 + 2 HARMONICS) at phases (...)."""
    parts = [np.ones_like(phase)]
    for k in range(1, HARMONICS + 1):
        parts += [np.cos(np.pi * k * phase), np.sin(np.pi * k * phase)]
    return np.stack(parts, -1)


@dataclass(frozen=True)
class Profiles:
    """Profiles of real walkers and idlers.

    gait: (S, 1 + 2 HARMONICS, CHANNELS) styles, the first their mean. stance: (CHANNELS,). sway:
    (T, CHANNELS) idle deviations from the stance at 30 fps.
    """

    gait: Array
    stance: Array
    sway: Array

    @classmethod
    def of(cls, clips: Sequence[Clip]) -> Profiles:
        """Measure the profiles on the clips named above, or else on walks and idles that any clips show.

        Raises MocapError if no clip shows a steady straight walk, or none quiet standing.
        """
        named = {clip.name: clip.motion for clip in clips}
        walks = [named[name] for name in _WALKS if name in named] or _longest(named.values(), _walking)
        idles = [named[name] for name in _IDLES if name in named] or _longest(named.values(), _idling)
        for shown, lacking in ((walks, "a straight walk"), (idles, "quiet standing")):
            if not shown:
                raise MocapError(
                    f"None of {len(named)} clips shows {lacking} of 2 s, which synthetic motion is modelled on.",
                    "Add such clips, or build without synthetic motion: --seconds 0.",
                )
        gaits = np.stack([_gait(walk) for walk in walks])
        stance = np.mean([np.median(channels(idle), 0) for idle in idles], 0)
        stance = (stance + mirror_channels(stance)) / 2
        stance[2] = 0.0  # The stance faces along its path.
        styles, sway = np.concatenate([gaits.mean(0)[None], gaits]), np.concatenate([_sway(idle) for idle in idles])
        return cls(styles, stance, sway)


def _gait(walk: Motion) -> Array:
    """Fit the cycle and its mirror image half a cycle later by least squares.

    A gait is symmetric, but a single short clip is not.
    """
    phase, inside = step_phase(walk)
    values = channels(walk)[inside]
    rows = np.concatenate([basis(phase[inside]), basis(phase[inside] + 1)])
    fit = np.linalg.lstsq(rows, np.concatenate([values, mirror_channels(values)]), rcond=None)[0]
    odd = np.isin(np.arange(len(fit)), (2, 6))  # Odd sines, so that the pelvis yaw is zero whenever the feet pass.
    fit[~odd, 2] = 0.0
    return np.asarray(fit)


def _sway(idle: Motion) -> Array:
    """Return deviations from the clip's median (T, CHANNELS), radians, smoothed over a second."""
    limit = 0.06  # Small, because the camera is in the head.
    values = channels(idle)
    values = values - np.median(values, 0)
    # Without the zeros at its ends: 31 frames, a second.
    kernel = np.hanning(33)[1:-1]
    smooth = np.stack([np.convolve(column, kernel / kernel.sum(), "valid") for column in values.T], 1)
    smooth[:, 2] = 0.0
    return np.asarray(limit * np.tanh(smooth / limit))


# -- stretches of clips that show a walk or quiet standing -------------------------------------------------------------
_SECONDS: Final = 2.0
"""Least length of a stretch: a walk shows a cycle of two steps in it."""
_MOST: Final = 32
"""Most stretches of a kind; more add no new style."""
_WALKING: Final = (0.7, 1.9)
"""m/s."""
_HANDS, _SHOULDERS, _TOES = (
    [JOINT_INDEX[f"{side}_{part}"] for side in ("left", "right")] for part in ("wrist", "shoulder", "foot")
)


def _longest(motions: Iterable[Motion], rule: Callable[[Motion], NDArray[np.bool_]]) -> list[Motion]:
    """Return the longest stretch of each motion that has one by a rule, of at most 32 motions."""
    least = round(_SECONDS * FPS)
    stretches = ((motion, runs_of(rule(motion), least)) for motion in motions if len(motion) >= least)
    parts = [max((motion[run] for run in runs), key=len) for motion, runs in stretches if runs]
    return [parts[index] for index in np.unique(np.linspace(0, len(parts) - 1, _MOST).astype(int))] if parts else []


def _walking(motion: Motion) -> NDArray[np.bool_]:
    """Return in which frames (T,) a body walks straight and steadily."""
    velocity, yaw = _smooth(_rate(motion.root[:, [0, 2]])), np.unwrap(motion.yaw())
    ahead = np.sum(velocity * np.stack([np.sin(yaw), np.cos(yaw)], -1), -1)
    turning = np.abs(_smooth(_rate(yaw[:, None])))[:, 0]
    aside = np.sqrt(np.maximum(np.sum(velocity**2, -1) - ahead**2, 0))
    low, high = _WALKING
    straight = (aside < 0.3 * ahead) & (turning < 0.5)
    return np.asarray(_upright(motion) & (ahead > low) & (ahead < high) & straight)


def _idling(motion: Motion) -> NDArray[np.bool_]:
    """Return in which frames (T,) a body stands quietly."""
    toes = np.linalg.norm(_rate(motion.joints()[:, _TOES]), axis=-1).max(-1)
    return np.asarray(_upright(motion) & (np.linalg.norm(_rate(motion.root), axis=-1) < 0.15) & (toes < 0.1))


def _upright(motion: Motion) -> NDArray[np.bool_]:
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
