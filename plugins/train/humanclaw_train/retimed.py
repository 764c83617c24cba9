"""Real clips of a posture, played at other paces: faster, slower, backwards and with halts, over planted feet.

A clip of somebody who squats goes down once and up once, at one pace. A skill has to go from any height to any other
one in half a second, so the poses of the clip, which are real, are passed through in another time. The feet stand
still, the legs follow by two-bone inverse kinematics, and whoever stands upright does so as the prior stands, so that
every other skill can follow. What is `begun` begins exactly as the prior stands, as the first call of an episode does,
and passes over into any pose of the clip in its first half second. Chunks made so are not marked as real. Needs numpy
and scipy alone.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from scipy.interpolate import CubicSpline, PchipInterpolator

from humanclaw import Motion
from humanclaw.body import (
    FUTURE,
    HISTORY,
    JOINT_INDEX,
    JOINTS,
    Array,
    heading,
    matrix_from_vector,
    smoothstep,
    vector_from_matrix,
)
from humanclaw.motion import SIDES
from humanclaw_train import ik
from humanclaw_train.augment import UPPER
from humanclaw_train.ik import Feet

PACE: Final = 1.5
"""Most frames of the clip that pass in one."""
HALTS: Final = 0.2
"""Share of the half seconds in which the body holds still."""
_QUIET: Final = 0.02
"""Metres from where it begins and ends within which a clip has not begun or has ended."""
_DOWN: Final = 0.5
"""Share of its height by which a body is down for the pose of its trunk to be wholly the clip's,"""
_ARMS: Final = 0.35
"""and how much of the clip's arms there is in it then: from overhead to hanging, half a second is too short."""
_ANKLES: Final = [JOINT_INDEX[f"{side}_ankle"] for side in SIDES]
_LIKENESS: Final = np.array([_ARMS if JOINTS[joint].startswith(("left", "right")) else 1.0 for joint in UPPER])


def retimed(clip: Motion, standing: Motion, chunks: int, rng: np.random.Generator, *, begun: bool = False) -> Motion:
    """Pass through the poses of a clip for `chunks` half seconds, after one history at rest; 5 + 15 chunks frames.

    standing: the prior's, of which the last frame is taken. begun: whether the rest is exactly that.
    """
    clip = clip[_moving(clip)]
    passed = _sampled(clip, _clock(len(clip), chunks, rng))
    turned = _upright(passed, standing, float(clip.root[:, 1].max()))
    if begun:
        return _replanted(_from_standing(turned, standing), _stance(turned, standing, share=1.0))
    return _replanted(turned, _stance(turned, standing, share=float(rng.random())))


def _moving(clip: Motion) -> slice:
    """Leave out the quiet beginning and end, in which time would be spent for nothing."""
    away = [np.linalg.norm(clip.root - clip.root[end], axis=-1) > _QUIET for end in (0, -1)]
    first, last = (int(one.argmax()) if one.any() else 0 for one in (away[0], away[1][::-1]))
    return slice(max(first - 1, 0), len(clip) - max(last - 1, 0))


def _clock(length: int, chunks: int, rng: np.random.Generator) -> Array:
    """Return (T,) frame of the clip that each frame shows: a walk with halts, turned back at either end, no jerk."""
    steps = rng.uniform(-PACE * FUTURE, PACE * FUTURE, chunks) * (rng.random(chunks) >= HALTS)
    last = length - 1.0
    marks = np.empty(chunks + 1)
    marks[0] = rng.choice([0.0, rng.uniform(0.0, last)])
    for index, step in enumerate(steps):
        onward = marks[index] + step
        marks[index + 1] = onward if 0 <= onward <= last else np.clip(marks[index] - step, 0.0, last)
    times = HISTORY - 1 + FUTURE * np.arange(chunks + 1)
    frames = np.arange(HISTORY + FUTURE * chunks).clip(HISTORY - 1)
    return np.asarray(PchipInterpolator(times, marks)(frames))


def _sampled(clip: Motion, clock: Array) -> Motion:
    """Sample the clip between its frames."""
    frames = np.arange(len(clip))
    matrices = CubicSpline(frames, matrix_from_vector(clip.rotations))(clock)
    left, _, right = np.linalg.svd(matrices)  # the nearest rotation
    return Motion(CubicSpline(frames, clip.root)(clock), vector_from_matrix(left @ right))


def _upright(motion: Motion, standing: Motion, height: float) -> Motion:
    """Hold trunk, arms and head as in the clip where the body is down, as in standing where it is up."""
    down = smoothstep((1 - motion.root[:, 1] / height).clip(0) / _DOWN)
    rotations = motion.rotations.copy()
    # Of rotation vectors, which no joint but the root turns half round: an arm from overhead to hanging has no jump.
    stood = standing.rotations[-1:, UPPER]
    rotations[:, UPPER] = stood + (down[:, None] * _LIKENESS)[..., None] * (rotations[:, UPPER] - stood)
    return Motion(motion.root, rotations)


def _from_standing(motion: Motion, standing: Motion) -> Motion:
    """Stand as the prior does for one history, and be wholly in the motion half a second later."""
    middle, turn = _place(motion, standing)
    stood, vectors = standing.root[-1], standing.rotations[-1].copy()
    vectors[0] = vector_from_matrix(turn @ matrix_from_vector(vectors[0]))
    begun = middle + (stood - standing[-1:].joints()[0, _ANKLES].mean(0) * [1, 0, 1]) @ turn.T
    share = smoothstep((np.arange(len(motion)) - HISTORY + 1) / FUTURE)[:, None]
    root = begun + share * (motion.root - begun)
    first = matrix_from_vector(vectors)
    away = vector_from_matrix(np.swapaxes(first, -1, -2) @ matrix_from_vector(motion.rotations))
    return Motion(root, vector_from_matrix(first @ matrix_from_vector(share[..., None] * away)))


def _replanted(motion: Motion, feet: Feet) -> Motion:
    """Bend the legs so that both feet are where they are said to be."""
    pelvis, yaw = matrix_from_vector(motion.rotations[:, 0]), heading(motion.rotations[:, 0])
    root = motion.root.copy()
    lift = np.full(feet.pitch.shape, 0.0)
    root[:, 1] = np.minimum(root[:, 1], ik.ceiling(root[None], pelvis[None], feet, lift)[0])
    stand = ik.ease_ankles(root[None], pelvis[None], feet, yaw[None])
    turned = motion.rotations.copy()
    for joint, matrix in ik.place_legs(root[None], pelvis[None], stand, yaw[None]).items():
        turned[:, JOINT_INDEX[joint]] = vector_from_matrix(matrix[0])
    return Motion(root, turned)


def _stance(motion: Motion, standing: Motion, share: float) -> Feet:
    """Return feet still on the floor: where those of the clip are on the whole, moved by a share towards where those
    of standing are."""
    shown = np.median(motion.joints()[:, _ANKLES], axis=0)
    middle, turn = _place(motion, standing)
    stood = standing[-1:].joints()[0, _ANKLES]
    other = middle + (stood - stood.mean(0)) @ turn.T
    sole = (1 - share) * shown + share * other
    sole[:, 1] = 0.0
    shape = (1, 2, len(motion))
    spread = np.broadcast_to(sole[None, :, None], (*shape, 3))
    out = np.array([0.12, -0.12])[None, :, None] + float(np.median(motion.yaw()))
    return Feet(spread, np.broadcast_to(out, shape), np.zeros(shape), np.zeros(shape))


def _place(motion: Motion, standing: Motion) -> tuple[Array, Array]:
    """Return the point of the floor between the feet (3,), and the rotation (3, 3) from how standing faces."""
    middle = np.median(motion.joints()[:, _ANKLES], axis=0).mean(0) * [1, 0, 1]
    facing = float(np.median(motion.yaw()))
    return middle, matrix_from_vector(np.array([0.0, facing - standing.yaw()[-1], 0.0]))
