"""Motion synthesis: continuous motion for any series of commands, made from profiles of real clips.

Each command lasts one chunk of 15 frames. A chunk depends only on the body's state at its start and on its own command,
because the motion model sees no more. A chunk begins and ends as the feet pass each other: one foot stands under the
hips; the other hangs beside it or stands too. First the hanging foot lands where the hips will be, then the other foot
follows. Walking, turning, stairs, sitting down and stopping are the same two swings with other numbers.

Shapes: N bodies move at once. A chunk has 16 instants at s = 0 ... 1; the first belongs to the previous chunk. Frames
as in humanclaw.body; "floor" vectors are (x, z). Needs only numpy.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from humanclaw.body import (
    FUTURE,
    HISTORY,
    JOINT_INDEX,
    N_JOINTS,
    Array,
    matrix_from_vector,
    rest_pose,
    vector_from_matrix as to_vector,
)
from humanclaw_train.synthesis import gait, ik
from humanclaw_train.synthesis.commands import Commands
from humanclaw_train.synthesis.curves import GRID, bump, raised, soft_minimum
from humanclaw_train.synthesis.ik import Feet
from humanclaw_train.synthesis.profiles import UPPER, Profiles, channel
from humanclaw_train.synthesis.state import State, Style
from humanclaw_train.synthesis.step_plan import StepPlan, hip_path, plan
from humanclaw_train.synthesis.striding import cycle, striding_feet, swaying
from humanclaw_train.synthesis.swings import feet
from humanclaw_train.synthesis.upper_body import pose_targets, seat_table, upper_body


# -- one chunk ---------------------------------------------------------------------------------------------------------
def advance(state: State, c: Commands, style: Style) -> tuple[State, Array, Array]:
    """Move the bodies by one chunk: returns the state at its end, root (N, 15, 3) and rotations (N, 15, 24, 3)."""
    p = plan(state, c)
    steps = cycle(state, p, style)
    path, yaw = hip_path(state, p)
    # The feet come first: hips and heels then follow what the legs can reach.
    stand, lacking = _feet(state, p, c, style, steps, path, yaw)
    values = upper_body(state, p, c, pose_targets(state, p, c, style, steps))
    pelvis = pelvis_orientation(yaw, values[..., :3])
    root, sway = swaying(state, p, style, steps, _bobbing(path, p, c), yaw)
    may_lift = _may_lift(p, steps)
    root = _lowered(root, ik.ceiling(root, pelvis, stand, may_lift), p, _lowest(state, p, c))
    stand = ik.ease_ankles(root, pelvis, ik.raise_heels(root, pelvis, stand, may_lift), yaw)
    rotations = np.zeros((*yaw.shape, N_JOINTS, 3))
    rotations[:, :, 0] = to_vector(pelvis)
    rotations[:, :, UPPER] = values[..., 3:].reshape(*yaw.shape, -1, 3)
    for joint, matrix in ik.place_legs(root, pelvis, stand, yaw).items():
        rotations[:, :, JOINT_INDEX[joint]] = to_vector(matrix)
    return _ended(p, stand, values, steps, sway, root[:, -1, 1], lacking), root[:, 1:], rotations[:, 1:]


def _feet(
    state: State, p: StepPlan, c: Commands, style: Style, steps: gait.Cycle, path: Array, yaw: Array
) -> tuple[Feet, Array]:
    two_swings, lacking = feet(state, p, c, style, path)
    return striding_feet(state, p, style, steps, path, yaw).where(p.stride, two_swings), lacking


def _may_lift(p: StepPlan, steps: gait.Cycle) -> Array:
    """Return the radians (N, 2, 16) by which a heel may rise if its leg would not reach; 0 for the front foot."""
    second = np.arange(2) == (1 - p.first)[:, None]
    two_swings = np.where(second[..., None], bump(1.05 * GRID), 0.0)
    behind = np.stack([bump((steps.since(foot) + 0.9) / 0.7) for foot in (0, 1)], 1)
    return 0.5 * np.where(p.stride[:, None, None], behind, two_swings)


def pelvis_orientation(yaw: Array, tilt: Array) -> Array:
    """Combine yaw (...) with pitch, roll and extra yaw (..., 3) to (..., 3, 3) matrices.

    The order Ry Rz Rx keeps the heading of the line through the hips exact.
    """
    vector = np.zeros((*yaw.shape, 3, 3))
    vector[..., 0, 1], vector[..., 1, 2], vector[..., 2, 0] = yaw + tilt[..., 2], tilt[..., 1], tilt[..., 0]
    matrix = matrix_from_vector(vector)
    return np.asarray(matrix[..., 0, :, :] @ matrix[..., 1, :, :] @ matrix[..., 2, :, :])


def _bobbing(root: Array, p: StepPlan, c: Commands) -> Array:
    """Lower the hips between two passings of the feet, as the spread legs of a walker do."""
    stride = np.clip(np.abs(p.ahead) / 0.62, 0, 1.2) * (c.does("stride") & ~c.stairs & ~p.stride)
    sunk = root.copy()
    sunk[..., 1] -= (0.022 * stride**2 * p.flow)[:, None] * np.sin(np.pi * GRID) ** 2
    return sunk


_LOWEST: Final = 0.88
"""Height of a walker's pelvis, metres, below which no leg pulls it: in fast steps aside a foot leaves the floor."""


def _lowest(state: State, p: StepPlan, c: Commands) -> Array:
    """Return the height (N,) below which no leg pulls the pelvis. A body that sets out on a long step lunges."""
    return np.where(state.hanging & ~c.stairs, p.level + _LOWEST, -np.inf)


def _lowered(root: Array, ceiling: Array, p: StepPlan, lowest: Array) -> Array:
    """Keep the path below its ceiling: one round dip at the tightest moment, then a soft minimum for the rest."""
    height = root[..., 1]
    need = (height - ceiling + 0.006 * bump(GRID)) * (bump(GRID) > 0.2)
    # This power moves the middle of the dip to the tightest moment.
    skew = np.log(0.5) / np.log(np.clip(GRID[need.argmax(1)], 0.4, 0.65))
    dip = np.maximum(need.max(1), 0.0)[:, None] * bump(GRID ** skew[:, None])
    lowered = root.copy()
    dipped = np.where(p.stride[:, None], height, height - dip)
    width = np.where(p.stride[:, None], 0.012, 0.004 + 0.02 * bump(GRID))
    reached = np.where(height > lowest[:, None], lowest[:, None], -np.inf)
    lowered[..., 1] = np.maximum(soft_minimum(dipped, ceiling, width), reached)
    return lowered


def _ended(
    p: StepPlan, stand: Feet, values: Array, steps: gait.Cycle, sway: Array, height: Array, lacking: Array
) -> State:
    """Return the state that the next chunk starts from. Only feet in the air have a velocity."""
    phase = np.where(p.stride, steps.phase[:, -1] % 2, p.first)
    passing = steps.swinging(phase)
    landed = steps.progress(passing)[:, -1] > 0.92  # A foot that is about to land counts as landed.
    next_foot = np.where(p.stride, gait.foot_of(passing + landed), 1 - p.first)
    hangs = (np.arange(2) == (1 - p.first)[:, None]) & (p.flow > 0)[:, None] | p.stride[:, None]
    cadence = np.where(p.stride, steps.end_rate, np.where(p.flow > 0.5, 1.0, 0.0))

    def rate(track: Array) -> Array:
        return np.asarray(
            (track[:, :, -1] - track[:, :, -2]) * FUTURE * hangs.reshape(*hangs.shape, *(1 for _ in track.shape[3:]))
        )

    return State(
        p.root, raised(p.velocity, p.rise), p.yaw, p.yaw_rate, p.level, p.seat,
        stand.sole[:, :, -1], rate(stand.sole), stand.yaw[:, :, -1], rate(stand.yaw), stand.pitch[:, :, -1],
        rate(stand.pitch), next_foot, values[:, -1], (values[:, -1] - values[:, -2]) * FUTURE, phase, cadence, sway,
        height - p.level, lacking,
    )  # fmt: skip


# -- whole motions -----------------------------------------------------------------------------------------------------
def _style(profiles: Profiles, n: int, rng: np.random.Generator) -> Style:
    """Draw styles: the mean gait mixed with that of one real walker, and parameters that vary as people do."""
    which = rng.integers(1, len(profiles.gait), n)
    own = rng.uniform(0.0, 0.9, n)[:, None, None]
    gaits = profiles.gait[0] + own * (profiles.gait[which] - profiles.gait[0])
    # The first coefficient is the mean posture; only the swing about it varies in size.
    gaits[:, 1:] *= rng.uniform(0.7, 1.25, n)[:, None, None]
    gaits[:, 0] = _eyes_level(gaits[:, 0], 0.06)
    stance = _eyes_level(profiles.stance, 0.04)
    return Style(
        gaits, np.repeat(stance[None], n, 0), seat_table(stance), profiles.sway, rng.integers(0, len(profiles.sway), n),
        tempo=rng.normal(1.0, 0.06, n).clip(0.86, 1.12), swings=rng.normal(1.0, 0.2, (n, 3)).clip(0.5, 1.5),
        roll=rng.normal(1.0, 0.1, n).clip(0.8, 1.2), width=rng.normal(0.0, 0.012, n).clip(-0.02, 0.03),
        riser=rng.random(n),
    )  # fmt: skip


def _eyes_level(pose: Array, down: float) -> Array:
    """Bend neck and head so that the eyes look `down` radians below the horizon, because the camera is in the head."""
    pose = pose.copy()
    trunk = pose[..., [0, *(channel(joint) for joint in ("spine1", "spine2", "spine3", "neck", "head"))]]
    missing = down - trunk.sum(-1)
    pose[..., channel("neck")] += 0.4 * missing
    pose[..., channel("head")] += 0.6 * missing
    return pose


def play(
    profiles: Profiles, series: Sequence[Commands], rng: np.random.Generator, rested: float = 0.0
) -> tuple[Array, Array, Array]:
    """Let N bodies carry out K commands each: root (N, 5 + 15 K, 3), rotations (N, 5 + 15 K, 24, 3), lacking (N, K).

    They begin in a quiet stance; a share `rested` of them begins in `rest_pose`. lacking: see State.
    """
    n = len(series[0].yaw)
    style = _style(profiles, n, rng)
    next_foot = rng.integers(0, 2, n)
    # The first chunk only provides the history.
    state, root, rotations = advance(State.standing(style.stance, next_foot), Commands.standing(n), style)
    resting = rng.random(n) < rested
    state = State.resting(next_foot).where(resting, state)
    rest = rest_pose(HISTORY)
    roots = [np.where(resting[:, None, None], rest.root, root[:, -HISTORY:])]
    turns = [np.where(resting[:, None, None, None], rest.rotations, rotations[:, -HISTORY:])]
    lacking = []
    for commands in series:
        style = style.later(FUTURE)
        state, root, rotations = advance(state, commands, style)
        roots.append(root)
        turns.append(rotations)
        lacking.append(state.lacking)
    return np.concatenate(roots, 1), np.concatenate(turns, 1), np.stack(lacking, 1)
