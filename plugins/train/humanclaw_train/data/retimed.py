"""Retimed motion: real clips of a posture at other paces, faster, slower, backwards and with halts.

A clip of a squat goes down once and up once, at one pace. A skill has to go from any height to any other in half a
second, so the clip's real poses are played back in another time. The feet stand still and the legs follow by two-bone
inverse kinematics. Upright poses blend into the prior's standing pose, so that every other skill can follow. Motion
that is `begun` starts exactly in the prior's standing pose, like an episode, and blends into the clip in its first half
second. The resulting chunks are not marked as real. Needs only numpy and scipy.
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
from humanclaw_train.synthesis import ik
from humanclaw_train.synthesis.ik import Feet
from humanclaw_train.synthesis.profiles import UPPER

PACE: Final = 1.5
"""Highest pace: frames of the clip per frame."""
HALTS: Final = 0.2
"""Share of half seconds in which the body holds still."""
_QUIET: Final = 0.02
"""Distance of the root from its first or last position, metres, within which a clip counts as at rest."""
_DOWN: Final = 0.5
"""Drop of the root, as a share of its height, from which the trunk's pose is entirely the clip's."""
_ARMS: Final = 0.35
"""Share of the clip's arms in that pose, because half a second is too short from overhead to hanging."""
_AWAY: Final = 0.6
"""Radians of a joint from which the pose of a skill that keeps the hips high is entirely the clip's."""
_ANKLES: Final = [JOINT_INDEX[f"{side}_ankle"] for side in SIDES]
_LIKENESS: Final = np.array([_ARMS if JOINTS[joint].startswith(("left", "right")) else 1.0 for joint in UPPER])


def retimed(
    clip: Motion, standing: Motion, chunks: int, rng: np.random.Generator, *, begun: bool = False, lowers: bool = True
) -> Motion:
    """Play the poses of a clip for `chunks` half seconds after a history at rest: 5 + 15 * chunks frames.

    standing: the prior's standing pose; its last frame counts. begun: whether to start exactly in that pose. lowers:
    whether the skill lowers the hips; otherwise it moves the arms, as the clip does.
    """
    if lowers:
        clip = clip[_moving(clip)]  # Otherwise the clock would spend most of its time at rest.
    passed = _sampled(clip, _clock(len(clip), chunks, rng))
    turned = _upright(passed, standing, float(clip.root[:, 1].max())) if lowers else _at_rest(passed, standing, clip)
    if begun:
        return _replanted(_from_standing(turned, standing), _stance(turned, standing, share=1.0))
    return _replanted(turned, _stance(turned, standing, share=float(rng.random())))


def _moving(clip: Motion) -> slice:
    """Return the clip's frames without rest at the beginning and the end; all of them if the hips hardly move."""
    away = [np.linalg.norm(clip.root - clip.root[end], axis=-1) > _QUIET for end in (0, -1)]
    first, last = (int(mask.argmax()) if mask.any() else 0 for mask in (away[0], away[1][::-1]))
    moving = slice(max(first - 1, 0), len(clip) - max(last - 1, 0))
    # Hips that drift by less than twice _QUIET leave the start only after they are near the end: nothing is between.
    return moving if moving.stop - moving.start >= 2 else slice(0, len(clip))


def _clock(length: int, chunks: int, rng: np.random.Generator) -> Array:
    """Draw the clip's frame to show at each time (T,): a smooth random walk with halts, reflected at both ends."""
    steps = rng.uniform(-PACE * FUTURE, PACE * FUTURE, chunks) * (rng.random(chunks) >= HALTS)
    last = length - 1.0
    marks = np.empty(chunks + 1)
    marks[0] = rng.choice([0.0, rng.uniform(0.0, last)])
    for index, step in enumerate(steps):
        onward = marks[index] + step
        # Reflected: a clock that stopped at an end would show the extremes too often.
        marks[index + 1] = onward if 0 <= onward <= last else np.clip(marks[index] - step, 0.0, last)
    # Monotone between marks (PCHIP), so that a halt stays a halt.
    times = HISTORY - 1 + FUTURE * np.arange(chunks + 1)
    frames = np.arange(HISTORY + FUTURE * chunks).clip(HISTORY - 1)
    return np.asarray(PchipInterpolator(times, marks)(frames))


def _sampled(clip: Motion, clock: Array) -> Motion:
    """Sample the clip between its frames."""
    frames = np.arange(len(clip))
    matrices = CubicSpline(frames, matrix_from_vector(clip.rotations))(clock)
    left, _, right = np.linalg.svd(matrices)  # Splines of matrices are no rotations; this gives the nearest ones.
    return Motion(CubicSpline(frames, clip.root)(clock), vector_from_matrix(left @ right))


def _upright(motion: Motion, standing: Motion, height: float) -> Motion:
    """Blend trunk, arms and head from the standing pose, when the body is up, to the clip's, when it is down."""
    down = smoothstep((1 - motion.root[:, 1] / height).clip(0) / _DOWN)
    return _blended(motion, standing, down[:, None] * _LIKENESS)


def _at_rest(motion: Motion, standing: Motion, clip: Motion) -> Motion:
    """Blend trunk, arms and head from the standing pose, when they are as at the clip's beginning, to the clip's."""
    away = np.linalg.norm(motion.rotations[:, UPPER] - clip.rotations[0, UPPER], axis=-1).max(axis=1, keepdims=True)
    return _blended(motion, standing, smoothstep(away / _AWAY))


def _blended(motion: Motion, standing: Motion, share: Array) -> Motion:
    """Blend the upper body from the standing pose to the motion. share: of the motion, (T, joints) or (T, 1)."""
    rotations = motion.rotations.copy()
    # Blend rotation vectors: only the root turns by half a turn, so no joint jumps.
    stood = standing.rotations[-1:, UPPER]
    rotations[:, UPPER] = stood + share[..., None] * (rotations[:, UPPER] - stood)
    return Motion(motion.root, rotations)


def _from_standing(motion: Motion, standing: Motion) -> Motion:
    """Begin with one history in the prior's standing pose, and blend into the motion within half a second."""
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
    """Bend the legs so that both feet are at `feet`."""
    pelvis, yaw = matrix_from_vector(motion.rotations[:, 0]), heading(motion.rotations[:, 0])
    root = motion.root.copy()
    lift = np.full(feet.pitch.shape, 0.0)
    # The feet have moved, so the hips may have to sink for both legs to reach them.
    root[:, 1] = np.minimum(root[:, 1], ik.ceiling(root[None], pelvis[None], feet, lift)[0])
    stand = ik.ease_ankles(root[None], pelvis[None], feet, yaw[None])
    turned = motion.rotations.copy()
    for joint, matrix in ik.place_legs(root[None], pelvis[None], stand, yaw[None]).items():
        turned[:, JOINT_INDEX[joint]] = vector_from_matrix(matrix[0])
    return Motion(root, turned)


def _stance(motion: Motion, standing: Motion, share: float) -> Feet:
    """Return feet that stand still: at the clip's median position, moved by a share towards the standing pose's."""
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
    """Return the floor point between the feet (3,), and the rotation (3, 3) from the standing pose's facing."""
    middle = np.median(motion.joints()[:, _ANKLES], axis=0).mean(0) * [1, 0, 1]
    facing = float(np.median(motion.yaw()))
    return middle, matrix_from_vector(np.array([0.0, facing - standing.yaw()[-1], 0.0]))
