"""The upper body of synthetic motion: pelvis tilt, spine, head and arms, standing, walking and seated.

Needs only numpy.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np

from humanclaw import Motion
from humanclaw.body import (
    FUTURE,
    JOINT_INDEX,
    N_JOINTS,
    SOLE,
    Array,
    forward_kinematics,
    lay_hands,
    vector_from_matrix as to_vector,
)
from humanclaw.motion import Limb, solve
from humanclaw_train.synthesis import gait, profiles
from humanclaw_train.synthesis.commands import Commands, Ints
from humanclaw_train.synthesis.curves import GRID, bump, quintic
from humanclaw_train.synthesis.profiles import CHANNELS, UPPER, channel
from humanclaw_train.synthesis.state import SECONDS, State, Style
from humanclaw_train.synthesis.step_plan import StepPlan, seat_depth

_TWIST: Final = 0.7
"""Swing of the trunk at most, in that of real walkers at 1.15 m/s: shoulders turn no more in a fast walk."""
_OUT: Final = 0.08
"""How far a walker's arms are away from the trunk, beyond the clips', radians: our hips are wider than the walkers'."""
_ASIDE_ON_STAIRS: Final = 0.06
"""Lean of the trunk to the side on stairs, radians."""
_ASIDE: Final = 0.8
"""How far hands go aside for hips that sink or rise by 1 m, radians: they pass the thighs on the outside."""
_TRUNK: Final = np.isin(np.arange(CHANNELS), [channel(joint, axis) for joint in (
    "spine1", "spine2", "spine3", "neck", "head", "left_collar", "right_collar") for axis in range(3)])  # fmt: skip


def pose_targets(state: State, p: StepPlan, c: Commands, style: Style, steps: gait.Cycle) -> Array:
    """Return the pose that the skill asks for at each instant (N, 16, CHANNELS)."""
    # A turn on the spot swings the arms as slow walking does.
    pace = np.hypot(p.speed, 0.35 * (p.yaw - state.yaw) / SECONDS)
    arms = (c.gait["arms"] * np.clip(pace / 1.15, 0, 1.3))[:, None, None]
    amplitude = np.where(_TRUNK, np.minimum(arms, _TWIST), arms)
    amplitude[..., 2] = np.select(
        [p.stride[:, None], c.stairs[:, None]], [gait.pelvis_yaw(p.speed)[:, None], 0.8], arms[..., 0]
    )
    # Walking backwards is the same poses in reverse.
    direction = np.where(c.does("stride") & (p.ahead < -0.02), -1.0, 1.0)[:, None]
    phase = np.where(p.stride[:, None], steps.phase, (1 - p.first)[:, None] + direction * GRID)
    walk = profiles.basis(phase) @ style.gait
    walk[..., 2] = gait.pinned(walk[..., 2])
    mean, stance = style.gait[:, :1], style.stance[:, None]
    sway = style.sway[_to_and_fro(style.frame[:, None] + np.arange(FUTURE + 1), len(style.sway))]
    # The mean posture follows the speed only up to that of the clips; the swing about it continues to grow.
    still = 1 - np.minimum(amplitude, 1.0)
    standing = stance + (1 - still) * (mean - stance) + amplitude * (walk - mean) + 0.6 * still * sway
    for side, sign in (("left", 1.0), ("right", -1.0)):
        standing[..., channel(f"{side}_shoulder", 2)] += sign * _OUT * np.minimum(arms[..., 0], 1.2)
    target = np.where(p.sits[:, None, None], _seat_pose(style.seats, p.height)[:, None] + 0.5 * sway, standing)
    lean = c.gait["lean"] + np.where(p.stride, gait.lean(p.speed), 0.0)
    target = _bent(target, {"pelvis": 0.5, "spine1": 0.5, "neck": -0.5, "head": -0.5}, 0, lean[:, None])
    # On stairs the trunk leans over the foot that stands, as the hips do.
    aside = (_ASIDE_ON_STAIRS * c.stairs * style.swings[:, 0])[:, None] * np.cos(np.pi * phase)
    target = _bent(target, {"spine1": 0.5, "spine2": 0.5}, 2, -aside)
    return _bent(target, {"neck": 0.5, "head": 0.5}, 0, c.gait["gaze_pitch"][:, None])


def _bent(values: Array, shares: Mapping[str, float], axis: int, angle: Array) -> Array:
    """Add an angle (N, 16) about one axis to the channels (N, 16, CHANNELS), split among joints by their shares."""
    values = values.copy()
    for joint, share in shares.items():
        values[..., 0 if joint == "pelvis" else channel(joint, axis)] += share * angle
    return values


def _to_and_fro(index: Ints, length: int) -> Ints:
    # Forwards and then backwards, so that the idle sway does not jump at its end.
    index = index % (2 * length - 2)
    return np.where(index < length, index, 2 * length - 2 - index)


def upper_body(state: State, p: StepPlan, c: Commands, target: Array) -> Array:
    """Return the upper body over the chunk (N, 16, CHANNELS).

    It moves smoothly from the present pose and rate to the targets, and leans and turns with the hips.
    """
    gap = (state.pose - target[:, 0])[:, None]
    rate = (state.pose_rate - (target[:, 1] - target[:, 0]) * FUTURE)[:, None]
    span = np.where(p.sits | state.seated, 1.0, 0.85)[:, None, None]
    zero = np.zeros_like(gap)
    values = target + quintic(np.minimum(GRID[:, None] / span, 1.0), gap, rate * span, zero, zero, zero)
    # In sitting down and rising the trunk leans forward to keep the weight over the feet; the head stays up.
    change = np.abs(p.height - (state.root[:, 1] - state.level))
    # A person (CMU 75_19) leans by 63 to 65 degrees to sit down and by 50 to rise, for hips that move by 0.58 m.
    lean = np.clip(change, 0, 0.6) * np.where(p.seat > state.seat, 1.9, 1.5)
    shares = {"pelvis": 0.6, "spine1": 0.25, "spine2": 0.2, "neck": -0.2, "head": -0.35}
    values = _bent(values, shares, 0, lean[:, None] * bump(GRID))
    outwards = _ASIDE * np.clip(change, 0, 0.6)[:, None] * bump(GRID)
    values = _bent(_bent(values, {"left_shoulder": 1.0}, 2, outwards), {"right_shoulder": -1.0}, 2, outwards)
    # A turn begins with the head.
    turn = c.gait["gaze_turn"] * (p.yaw - state.yaw)
    shares = {"spine2": 0.05, "spine3": 0.08, "neck": 0.1, "head": 0.12}
    return _bent(values, shares, 1, turn[:, None] * bump(1.1 * GRID))


# -- seats -------------------------------------------------------------------------------------------------------------
_SEATS: Final = np.linspace(0.2, 0.8, 13)
"""Heights of the pelvis, metres, that poses are made for; between them they are interpolated."""


def _seat_pose(seats: Array, height: Array) -> Array:
    """Interpolate seated poses (N, CHANNELS) for pelvis heights (N,)."""
    # Below the last height, because the one after it is read too.
    place = np.clip((height - _SEATS[0]) / (_SEATS[1] - _SEATS[0]), 0, len(_SEATS) - 1.001)
    low = place.astype(int)
    share = (place - low)[:, None]
    return np.asarray(seats[low] * (1 - share) + seats[low + 1] * share)


def seat_table(stance: Array) -> Array:
    """Return seated poses for pelvis heights 0.20 to 0.80 m (13, CHANNELS): upright, hands on the thighs."""
    low = np.clip((0.62 - _SEATS) / 0.42, 0, 1)  # Low seats round the back more.
    pose = np.repeat(stance[None], len(_SEATS), 0)
    pose[:, 0] = -0.16 - 0.1 * low
    for joint, amount, more in (
        ("spine1", 0.16, 0.1),
        ("spine2", 0.12, 0.1),
        ("spine3", 0.04, 0.1),
        ("neck", -0.06, -0.12),
        ("head", -0.12, -0.12),
    ):
        pose[:, channel(joint)] += amount + more * low
    rotations = np.zeros((len(_SEATS), N_JOINTS, 3))
    rotations[:, 0, 0], rotations[:, UPPER] = pose[:, 0], pose[:, 3:].reshape(len(_SEATS), -1, 3)
    position, orientation = forward_kinematics(_SEATS[:, None] * [0.0, 1.0, 0.0], rotations)
    for side, sign in (("left", 1.0), ("right", -1.0)):
        hip, shoulder = (position[:, JOINT_INDEX[f"{side}_{joint}"]] for joint in ("hip", "shoulder"))
        ankle = np.stack([np.full_like(low, sign * 0.09), np.full_like(low, SOLE), seat_depth(_SEATS) - 0.02], -1)
        thigh, _ = solve(Limb.leg(side), hip, ankle, np.array([sign * 0.12, 0.35, 0.94]))
        rotations[:, JOINT_INDEX[f"{side}_hip"]] = to_vector(np.swapaxes(orientation[:, 0], -1, -2) @ thigh)
        wrist = hip + thigh @ np.array([0.0, -0.27, 0.085]) - [0.0, 0.0, 0.03]
        upper, fore = solve(Limb.arm(side), shoulder, wrist, np.array([sign * 0.6, -0.5, -0.8]))
        for joint, parent, own in (
            ("shoulder", orientation[:, JOINT_INDEX[f"{side}_collar"]], upper),
            ("elbow", upper, fore),
        ):
            rotations[:, JOINT_INDEX[f"{side}_{joint}"]] = to_vector(np.swapaxes(parent, -1, -2) @ own)
    seated = lay_hands(Motion(_SEATS[:, None] * [0.0, 1.0, 0.0], rotations))
    pose[:, 3:] = seated.rotations[:, UPPER].reshape(len(_SEATS), -1)
    return pose
