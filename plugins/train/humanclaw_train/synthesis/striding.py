"""Striding: feet and pelvis of a body whose steps do not wait for chunks, from `gait`. Needs only numpy."""

from __future__ import annotations

import numpy as np

from humanclaw.body import Array, smoothstep
from humanclaw.motion import apart
from humanclaw_train.synthesis import gait
from humanclaw_train.synthesis.commands import Ints
from humanclaw_train.synthesis.curves import GRID, floor, raised, smoother, turned
from humanclaw_train.synthesis.ik import Feet, Track
from humanclaw_train.synthesis.state import TOE_OUT, State, Style
from humanclaw_train.synthesis.step_plan import StepPlan
from humanclaw_train.synthesis.swings import past


def cycle(state: State, p: StepPlan, style: Style) -> gait.Cycle:
    """Return the step cycle. In bodies that do not stride, the rest of it continues at its own rate."""
    end_rate = np.where(p.stride, style.tempo * gait.cadence(p.speed), state.cadence)
    rate = np.maximum(state.cadence, 0.5)  # Half a step a chunk, so that a body that stood begins to step.
    return gait.Cycle.of(state.phase, rate, np.maximum(end_rate, 0.5), p.speed)


def striding_feet(state: State, p: StepPlan, style: Style, steps: gait.Cycle, root: Array, yaw: Array) -> Feet:
    """Return both feet of striding bodies. Each swings to where the hips will be when the other foot passes it."""
    aims = _aims(state, p, style, steps, root, yaw)
    left, right = (_striding_foot(foot, state, p, style, steps, aims[foot]) for foot in (0, 1))
    side = np.ones(len(p.first))
    pairs = zip(past(left, right, side), past(right, left, -side), strict=True)
    return Feet(*(np.stack(pair, 1) for pair in pairs))


def _aims(state: State, p: StepPlan, style: Style, steps: gait.Cycle, root: Array, yaw: Array) -> list[Array]:
    """Return where each foot lands next: x, z and yaw (N, 3).

    The foot that lands first keeps clear of where the other one stands, and the other one of where the first will land.
    """
    path = np.concatenate([floor(root), yaw[..., None]], -1)
    velocity = np.concatenate([p.velocity, p.yaw_rate[:, None]], -1)
    aims, leads = [], gait.foot_of(steps.first)
    for foot, left in ((0, 1.0), (1, -1.0)):
        over = gait.reached(steps, path, velocity, np.asarray(_passing(steps, foot) + 1.0))
        aside = np.stack([left * (gait.half_width(p.speed) + style.width), -0.03 - 0.045 * p.speed], -1)
        aims.append(np.concatenate([over[:, :2] + turned(aside, over[:, 2]), over[:, 2:] + left * TOE_OUT], -1))
    stands = [np.concatenate([floor(state.foot[:, foot]), state.foot_yaw[:, foot, None]], -1) for foot in (0, 1)]
    first = [_clear(foot, aims[foot], stands[1 - foot]) for foot in (0, 1)]
    later = [_clear(foot, aims[foot], first[1 - foot]) for foot in (0, 1)]
    return [np.where((leads == foot)[:, None], first[foot], later[foot]) for foot in (0, 1)]


def _clear(foot: int, aim: Array, other: Array) -> Array:
    """Return an aim (N, 3) that is clear of the other foot's place (N, 3)."""
    zero = np.zeros(len(aim))
    shift = apart(raised(aim[:, :2], zero), aim[:, 2], raised(other[:, :2], zero), other[:, 2], 1.0 - 2.0 * foot)
    return np.concatenate([aim[:, :2] + floor(shift), aim[:, 2:]], -1)


def _passing(steps: gait.Cycle, foot: int) -> Ints:
    return np.asarray(steps.first + (gait.foot_of(steps.first) != foot))


def _striding_foot(foot: int, state: State, p: StepPlan, style: Style, steps: gait.Cycle, aim: Array) -> Track:
    passing = _passing(steps, foot)
    value = np.concatenate([floor(state.foot[:, foot]), state.foot_yaw[:, foot, None]], -1)
    rate = np.concatenate([floor(state.foot_velocity[:, foot]), state.foot_yaw_rate[:, foot, None]], -1)
    track = gait.swung(steps, passing, value, rate, aim)
    high = 0.07 * style.roll * np.clip(0.6 + 0.35 * p.speed, 0.6, 1.2)
    height = high[:, None] * gait.swing_height(steps.progress(passing))
    height = gait.settled(state.foot[:, foot, 1] - state.level, state.foot_velocity[:, foot, 1], height, 0.4)
    pitch = style.roll[:, None] * gait.pitch(steps.since(foot), p.speed[:, None])
    pitch = gait.settled(state.foot_pitch[:, foot], state.foot_pitch_rate[:, foot], pitch)
    bend = np.maximum(pitch, 0.0) * (1 - smoothstep((steps.since(foot) + gait.LIFT) / 0.25))
    return raised(track[..., :2], state.level[:, None] + np.maximum(height, 0.0)), track[..., 2], pitch, bend


def swaying(state: State, p: StepPlan, style: Style, steps: gait.Cycle, root: Array, yaw: Array) -> tuple[Array, Array]:
    """Return the path of the pelvis with its sway (N, 16, 3), and the amplitudes at the end (N, 3).

    At the ends of a chunk the pelvis is exactly where its command puts it; in between it moves over the standing foot.
    """
    last = np.where(p.stride[:, None], gait.amplitudes(p.speed) * style.swings, 0.0)
    size = state.sway[:, None] + (last - state.sway)[:, None] * smoother(GRID)[:, None]
    swing = size * gait.pelvis(steps.phase)
    flat = turned(gait.pinned(swing[..., :2]), yaw)
    return root + raised(flat, swing[..., 2]), last
