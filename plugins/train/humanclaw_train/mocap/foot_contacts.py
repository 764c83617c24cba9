"""Planting feet: captured feet are levelled and held still where they stand, and the legs follow. Needs only numpy."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from humanclaw.body import FPS, JOINT_INDEX, SOLE, TOE_SOLE, Array, Side, matrix_from_vector, vector_from_matrix
from humanclaw.motion import SIDES
from humanclaw_train.mocap.world_pose import LEG, STRAIGHT, Pose, reach_ankle, swing

_CONTACT_SPEED: Final = 0.25
"""A toe base slower than this stands, m/s. Measured: standing feet move at 0.06 m/s, swinging feet above 1 m/s."""
_LEVEL_TILT: Final = 0.35
"""A standing foot tilted less than this is flat on the floor, radians. A lifted heel tilts it more."""
_FLAT_RANGE: Final = 0.07
"""Standing toes that differ in height by less than this stand on one floor, metres. A stair is at least 0.1 m."""
_LIFTED: Final = 0.05
"""A toe this far above a known floor is in the air even if it moves slowly, metres."""
_FADE: Final = 6
"""Frames within which a levelled foot returns to its captured tilt."""
_UP: Final = np.array([0.0, 1.0, 0.0])
_UNDERSIDE: Final = (("ankle", (0.0, -SOLE, -0.06)), ("foot", (0.0, -TOE_SOLE, 0.0)), ("foot", (0.0, -TOE_SOLE, 0.09)))
"""Heel, ball and tip of the sole: joint, and offset in its frame."""


def plant(pose: Pose) -> Pose:
    """Level the feet where they stand, hold them still there, and let the legs follow."""
    for side in SIDES:
        pose = _calibrated(pose, side)
    floor = _one_floor(pose)  # Needs level soles, so only after calibration.
    for side in SIDES:
        pose = _levelled(pose, side, floor)
    shifts = {side: _hold(pose, side, runs_of(_bearing(pose, side, floor)), floor) for side in SIDES}
    # Both feet off by the same height is an error of the root, so the legs need not bend for it.
    common = float(np.median(np.concatenate([shift[:, 1] for shift in shifts.values()])))
    ankles = {side: pose.at(f"{side}_ankle") + shift for side, shift in shifts.items()}
    root = pose.root + [0.0, common, 0.0]
    root = root - _overreach(replace(pose, root=root), ankles)[:, None] * _UP
    world = pose.world
    for side, ankle in ankles.items():
        world = reach_ankle(root, world, side, ankle)
    return Pose(root, world)


def _calibrated(pose: Pose, side: str) -> Pose:
    """Make the sole level in the clip's flattest stances, because sources differ in the height of ankle over toe."""
    frames = np.flatnonzero(_bearing(pose, side, None))
    if not len(frames):
        return pose
    rise = (pose.at(f"{side}_ankle") - pose.at(f"{side}_foot"))[frames, 1]
    flattest = frames[rise <= np.percentile(rise, 10) + 0.015]
    for joint in (f"{side}_ankle", f"{side}_foot"):
        turn = pose.world[:, JOINT_INDEX[joint]]
        up = np.median(turn[flattest, 1, :], axis=0)  # The vertical in the foot's frame.
        pose = pose.turned(joint, turn @ swing(_UP, up))
    return pose


def _levelled(pose: Pose, side: str, floor: float | None) -> Pose:
    """Lay the foot exactly level in flat stances, and the toes whenever they bear. The correction fades elsewhere."""
    bears = _bearing(pose, side, floor)
    flat = bears & _slow(pose, f"{side}_ankle")
    for joint, stands, most in ((f"{side}_ankle", flat, _LEVEL_TILT), (f"{side}_foot", bears, 1.0)):
        turn = pose.world[:, JOINT_INDEX[joint]]
        level = runs_of(stands & (np.arccos(np.clip(turn[:, 1, 1], -1.0, 1.0)) < most))
        correction = _between(level, vector_from_matrix(swing(turn[:, :, 1], _UP)), _FADE)
        pose = pose.turned(joint, matrix_from_vector(correction) @ turn)
    return pose


def _one_floor(pose: Pose) -> float | None:
    """Return the height of the floor, or None if the feet stand on several levels (stairs, blocks).

    Nine tenths of the standing frames must agree.
    """
    toes = [pose.at(f"{side}_foot")[_bearing(pose, side, None), 1] - TOE_SOLE for side in SIDES]
    heights = np.concatenate(toes)
    if not len(heights) or np.subtract(*np.percentile(heights, [95, 5])) > _FLAT_RANGE:
        return None
    return float(np.median(heights))


def _hold(pose: Pose, side: str, runs: list[slice], floor: float | None) -> Array:
    """Return the displacement (T, 3) that holds the ball of the foot still in every stance.

    It also keeps soles from sinking below the lower one of two neighbouring stances.
    """
    toe = pose.at(f"{side}_foot")
    target = toe.copy()
    for run in runs:
        target[run] = _steady(toe[run])
        # On stairs no common floor is known, so each stance keeps its own height.
        target[run, 1] = np.median(toe[run, 1]) if floor is None else floor + TOE_SOLE
    shift = _between(runs, target - toe)
    if runs:
        lowest = np.min([pose.at(f"{side}_{joint}", point)[:, 1] for joint, point in _UNDERSIDE], axis=0) + shift[:, 1]
        shift[:, 1] += np.maximum(_ground(runs, target[:, 1] - TOE_SOLE) - lowest, 0.0)
    return shift


def _ground(runs: list[slice], heights: Array) -> Array:
    """Return the lowest height allowed to a foot (T,): its stance's, and between two stances the lower one's."""
    ground = np.empty(len(heights))
    ground[: runs[0].start] = heights[runs[0].start]
    for run, following in zip(runs, [*runs[1:], None], strict=True):
        ground[run] = heights[run]
        ahead = slice(run.stop, following.start if following else len(heights))
        ground[ahead] = min(heights[run.start], heights[following.start]) if following else heights[run.start]
    return ground


def _steady(points: Array) -> Array:
    """Return the mean of a stance (T, 3), or the moving average over two seconds of a longer one."""
    window = 2 * FPS  # The capture of a longer stance may drift slowly.
    if len(points) <= window:
        return np.broadcast_to(points.mean(axis=0), points.shape)
    padded = np.pad(points, ((window // 2, window - window // 2 - 1), (0, 0)), mode="edge")
    sums = np.cumsum(np.concatenate([np.zeros((1, 3)), padded]), axis=0)
    return np.asarray((sums[window:] - sums[:-window]) / window)


def _overreach(pose: Pose, ankles: Mapping[Side, Array]) -> Array:
    """Return how far the pelvis must sink for both legs to reach their ankles (T,), metres, smoothed over time."""
    sink = np.zeros(len(pose.root))
    for side, ankle in ankles.items():
        reach = pose.at(f"{side}_hip") - ankle
        # Less than STRAIGHT, so that the root below is of a positive number.
        level = np.minimum(np.linalg.norm(reach[:, [0, 2]], axis=-1), 0.9 * LEG)
        sink = np.maximum(sink, reach[:, 1] - np.sqrt((STRAIGHT * LEG) ** 2 - level**2))
    # A moving maximum, then a moving mean: smooth, and never less than needed.
    # Each of two windows of 7 takes 3 frames from both ends.
    wide = np.pad(sink, 6, mode="edge")
    highest = np.lib.stride_tricks.sliding_window_view(wide, 7).max(-1)
    return np.asarray(np.lib.stride_tricks.sliding_window_view(highest, 7).mean(-1))


# -- when feet stand ---------------------------------------------------------------------------------------------------
def _bearing(pose: Pose, side: str, floor: float | None) -> NDArray[np.bool_]:
    """Return when a foot bears (T,): its ball stands still and, where the floor is known, is close to it."""
    toe = f"{side}_foot"
    slow = _slow(pose, toe)
    if floor is not None:
        slow &= pose.at(toe)[:, 1] < floor + TOE_SOLE + _LIFTED
    return _mask(runs_of(slow), len(slow))


def _slow(pose: Pose, joint: str) -> NDArray[np.bool_]:
    """Return when a joint of the foot stands still (T,), with short gaps filled."""
    points = pose.at(joint)
    if len(points) < 3:
        return np.zeros(len(points), bool)
    return _bridged(np.linalg.norm(np.gradient(points, axis=0), axis=-1) * FPS < _CONTACT_SPEED, points)


def _bridged(mask: NDArray[np.bool_], points: Array) -> NDArray[np.bool_]:
    """Fill gaps of the mask shorter than any step, 4 frames, in which the point hardly moves, by less than 2 cm."""
    filled = mask.copy()
    for gap in runs_of(~mask, least=1):
        inner = gap.start > 0 and gap.stop < len(mask) and gap.stop - gap.start < 4
        if inner and np.linalg.norm(points[gap.stop] - points[gap.start - 1]) < 0.02:
            filled[gap] = True
    return filled


def runs_of(mask: NDArray[np.bool_], least: int = 3) -> list[slice]:
    """Return the stretches of at least `least` frames in which the mask is true."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]])))
    return [slice(first, last) for first, last in edges.reshape(-1, 2) if last - first >= least]


def _mask(runs: list[slice], length: int) -> NDArray[np.bool_]:
    mask = np.zeros(length, bool)
    for run in runs:
        mask[run] = True
    return mask


def _between(runs: list[slice], values: Array, fade: int | None = None) -> Array:
    """Keep values (T, n) inside the runs and interpolate them across the gaps. All zero if there is no run.

    fade: frames from a run within which the values fall to zero instead.
    """
    known = _mask(runs, len(values))
    if not known.any():
        return np.zeros_like(values)
    frames, inside = np.arange(len(values)), np.flatnonzero(known)
    filled = np.stack([np.interp(frames, inside, column[known]) for column in values.T], -1)
    if fade is None:
        return filled
    after = np.clip(np.searchsorted(inside, frames), 0, len(inside) - 1)
    away = np.minimum(np.abs(inside[after] - frames), np.abs(inside[np.maximum(after - 1, 0)] - frames))
    weight = np.clip(1.0 - away / (fade + 1), 0.0, 1.0)[:, None]
    return np.asarray(filled * weight * weight * (3.0 - 2.0 * weight))
