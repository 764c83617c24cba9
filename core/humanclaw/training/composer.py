"""The step composer: continuous motion for any series of commands, from the profiles of real clips (edited training data).

Each command lasts one chunk of 15 frames. What happens in a chunk is a function of the body's state at its start and of its own
command, never of a later one, because the motion model sees no more than that. A chunk begins and ends as the feet pass each
other: one foot stands under the hips, the other hangs beside it or stands too. In its first part the one foot lands where the hips will
be, in its second part the other one follows. Walking, turning, stairs and stopping are the same two swings with other numbers.
Frames as in humanclaw.pose; s is the time within a chunk, 0 to 1; (N, ...) are N bodies at once. Needs numpy alone.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from humanclaw.body import JOINT_INDEX, N_JOINTS, OFFSETS, STANDING_HEIGHT
from humanclaw.pose import FPS, FUTURE, HISTORY, Motion, forward_kinematics, matrix_from_vector, rest_pose, vector_from_matrix
from humanclaw.training import augment, ik
from humanclaw.training.augment import CHANNELS, UPPER, Profiles, channel
from humanclaw.training.chunks import Chunks, cut

Array = NDArray[np.float64]
Ints = NDArray[np.int_]
Command = tuple[str, Mapping[str, float]]

SKILLS: Final = (
    "walk", "side_step", "step_back", "turn_in_place", "climb_upstairs", "walk_downstairs", "sit_in_place", "stop",
)  # fmt: skip
WALK, SIDE, BACK, TURN, UP, DOWN, SIT, STOP = range(8)

T: Final = FUTURE / FPS
GRID: Final = np.arange(FUTURE + 1) / FUTURE
STAND: Final = 0.956
"""Pelvis height of a standing or passing body: the knees are never quite straight."""
REACH: Final = 0.8175
TOE_OUT: Final = 0.12


# -- curves ------------------------------------------------------------------------------------------------------------
def smoother(u: Array) -> Array:
    """0 to 1 with no velocity and no acceleration at the ends."""
    u = np.clip(u, 0.0, 1.0)
    return np.asarray(u**3 * (10 - 15 * u + 6 * u * u))


def smooth(u: Array) -> Array:
    u = np.clip(u, 0.0, 1.0)
    return np.asarray(u * u * (3 - 2 * u))


def bump(u: Array) -> Array:
    """0 at the ends, 1 in the middle, with no velocity and no acceleration at the ends."""
    u = np.clip(u, 0.0, 1.0)
    return np.asarray(64 * (u * (1 - u)) ** 3)


def quintic(u: Array, p0: Array, v0: Array, a0: Array, p1: Array, v1: Array) -> Array:
    """Ends at p1 with velocity v1 and no acceleration; velocities and accelerations per unit of u."""
    d = p1 - p0 - v0 - a0 / 2
    e, f = v1 - v0 - a0, -a0
    c3, c4, c5 = 10 * d - 4 * e + f / 2, -15 * d + 7 * e - f, 6 * d - 3 * e + f / 2
    return np.asarray(p0 + u * (v0 + u * (a0 / 2 + u * (c3 + u * (c4 + u * c5)))))


def cubic(u: Array, p0: Array, v0: Array, p1: Array, v1: Array) -> Array:
    """Hermite, held at its ends outside [0, 1]; velocities per unit of u."""
    u = np.clip(u, 0.0, 1.0)
    d = p1 - p0
    return np.asarray(p0 + u * (v0 + u * ((3 * d - 2 * v0 - v1) + u * (v0 + v1 - 2 * d))))


def smooth_minimum(a: Array, b: Array, width: Array) -> Array:
    """The minimum with its corner rounded; exact where the two differ by more than width."""
    return np.asarray(np.minimum(a, b) - np.maximum(width - np.abs(a - b), 0.0) ** 2 / (4 * width))


def _turn(vector: Array, yaw: Array) -> Array:
    """(N, 2) floor vectors (x, z) turned by yaw."""
    sin, cos = np.sin(yaw), np.cos(yaw)
    return np.stack([vector[..., 0] * cos + vector[..., 1] * sin, vector[..., 1] * cos - vector[..., 0] * sin], -1)


# -- commands and state ------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Commands:
    """One command for each of N bodies. skill (N,) indexes SKILLS; x, z, yaw, h, d (N,) in metres and radians, z positive
    backwards for step_back, h the height of a stair step or of the seated pelvis."""

    skill: Ints
    x: Array
    z: Array
    yaw: Array
    h: Array
    d: Array

    @classmethod
    def of(cls, commands: Sequence[Command]) -> Commands:
        unknown = sorted({name for name, _ in commands} - set(SKILLS))
        if unknown:
            raise ValueError(f"the composer knows {', '.join(SKILLS)}; got {', '.join(unknown)}")
        values = {key: np.array([float(given.get(key, 0.0)) for _, given in commands]) for key in ("x", "z", "yaw", "h", "d")}
        return cls(np.array([SKILLS.index(name) for name, _ in commands], int), **values)

    def is_(self, *skills: int) -> NDArray[np.bool_]:
        return np.isin(self.skill, skills)


@dataclass(frozen=True)
class State:
    """N bodies at the end of a chunk. Velocities are per chunk, accelerations per chunk squared.

    root (N, 3), velocity (N, 3), acceleration (N, 3); yaw, yaw_rate, yaw_acceleration (N,); level (N,) of the floor; seat (N,) how far the
    hips are behind the feet, nought when standing; foot (N, 2, 3) point under each ankle, left first, with its velocity, yaw, yaw rate,
    pitch and pitch rate; next (N,) the foot that swings first by default; pose and pose_rate (N, CHANNELS).
    """

    root: Array
    velocity: Array
    acceleration: Array
    yaw: Array
    yaw_rate: Array
    yaw_acceleration: Array
    level: Array
    seat: Array
    foot: Array
    foot_velocity: Array
    foot_yaw: Array
    foot_yaw_rate: Array
    foot_pitch: Array
    foot_pitch_rate: Array
    next: Ints
    pose: Array
    pose_rate: Array

    @classmethod
    def standing(cls, pose: Array, next_foot: Ints) -> State:
        """At the origin in a quiet stance, the foot that will go first a little behind."""
        foot = np.tile([[0.085, 0.0, -0.02], [-0.085, 0.0, -0.02]], (len(pose), 1, 1))
        foot[np.arange(len(pose)), next_foot, 2] -= 0.03
        return cls._still(STAND, foot, TOE_OUT, next_foot, pose)

    @classmethod
    def resting(cls, n: int, next_foot: Ints) -> State:
        """In `rest_pose`, in which a body that has not moved yet is put into a scene."""
        foot = np.tile([[0.09, 0.0, 0.0], [-0.09, 0.0, 0.0]], (n, 1, 1))
        return cls._still(STANDING_HEIGHT, foot, 0.0, next_foot, np.repeat(augment.channels(rest_pose(3))[:1], n, 0))

    @classmethod
    def _still(cls, height: float, foot: Array, toe_out: float, next_foot: Ints, pose: Array) -> State:
        n = len(pose)
        zero, two, three = np.zeros(n), np.zeros((n, 2)), np.zeros((n, 3))
        return cls(
            three + [0.0, height, 0.0], three, three, zero, zero, zero, zero, zero, foot, np.zeros((n, 2, 3)),
            two + [toe_out, -toe_out], two, two, two, next_foot, pose, np.zeros_like(pose),
        )  # fmt: skip

    @property
    def seated(self) -> NDArray[np.bool_]:
        return self.seat > 0.03


@dataclass(frozen=True)
class Style:
    """What differs between bodies. gait (N, 1 + 2 HARMONICS, CHANNELS); stance (N, CHANNELS); idle (N,) frame of the idle sway."""

    gait: Array
    stance: Array
    idle: Ints


# -- where the hips go -------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Plan:
    """What one chunk will do: the state at its end and the amounts that shape the way there, all (N,) or (N, 2)."""

    end: Array
    end_velocity: Array
    yaw: Array
    yaw_rate: Array
    level: Array
    height: Array
    seat: Array
    flow: Array
    """0 to 1: how far the second foot still hangs in the air at the end."""
    forward: Array
    """Commanded displacement ahead, negative backwards."""
    base: Array
    """(N, 2) the point of the floor about which the feet come to stand."""
    first: Ints
    wrong: NDArray[np.bool_]
    """The hanging foot must land where it is before the other one may step."""


def seat_depth(height: Array) -> Array:
    """How far behind the feet a pelvis of this height sits (N,), metres: shins about upright, less for a high perch."""
    return np.asarray(np.interp(height, [0.2, 0.35, 0.5, 0.6, 0.7, 0.8, STAND], [0.42, 0.43, 0.41, 0.36, 0.29, 0.2, 0.0]))


def plan(state: State, c: Commands) -> Plan:
    v = _turn(state.velocity[:, [0, 2]], -state.yaw)
    still = c.is_(SIT, STOP)
    seat = np.where(c.is_(SIT), seat_depth(c.h), np.where(c.is_(STOP), state.seat, 0.0))
    settle = np.where(state.seated, 0.0, 1.0)[:, None] * v
    x = np.select([c.is_(WALK, SIDE), still | c.is_(TURN)], [c.x, 0.38 * settle[:, 0]], 0.0)
    drift = 0.38 * settle[:, 1] + state.seat - seat
    z = np.select([c.is_(WALK), c.is_(BACK), c.is_(UP, DOWN)], [c.z, -c.z, c.d], drift)
    step = np.stack([x, z], -1)
    yaw = np.where(c.is_(WALK, TURN), c.yaw, 0.0)
    asked = np.linalg.norm(step, axis=-1)
    moving = c.is_(WALK, BACK, UP, DOWN)
    flow = np.where(moving, smooth((np.abs(z) - 0.02) / 0.25), 0.0)
    shuffle = c.is_(SIDE) | c.is_(TURN) | (c.is_(WALK) & (np.abs(x) / 0.15 + np.abs(yaw) / 0.4 > 0.6 + np.abs(z) / 0.18))
    flow = np.where(shuffle, 0.0, flow)
    keep = np.where(moving, np.where(shuffle, 0.3, 1.0), np.where(c.is_(SIDE), 0.3, 0.0))
    # A steady arc is tangent half a turn away from its chord; from rest the end velocity overshoots the mean a little.
    chord = _turn(step, yaw / 2)
    excess = 0.25 * (chord - _turn(v, yaw))
    limit = 0.3 * asked / np.maximum(np.linalg.norm(excess, axis=-1), 1e-9)
    exit_ = keep[:, None] * (chord + np.where(moving & ~shuffle, np.minimum(limit, 1.0), 0.0)[:, None] * excess)
    end = state.root[:, [0, 2]] + _turn(step, state.yaw)
    end_yaw = state.yaw + yaw
    level = state.level + np.select([c.is_(UP), c.is_(DOWN)], [c.h, -c.h], 0.0)
    held = state.root[:, 1] - state.level
    height = np.where(c.is_(SIT), c.h, np.where(c.is_(STOP) & state.seated, held, STAND))
    base = end + _turn(np.stack([np.zeros_like(seat), seat], -1), end_yaw)
    first, wrong = _first_foot(state, c, x, yaw, shuffle)
    return Plan(
        end, _turn(exit_, state.yaw), end_yaw, np.where(c.is_(WALK), yaw * np.where(shuffle, 0.2, 1.0), 0.2 * yaw), level, height,
        seat, flow, z, base, first, wrong,
    )  # fmt: skip


def _first_foot(state: State, c: Commands, x: Array, yaw: Array, shuffle: NDArray[np.bool_]) -> tuple[Ints, NDArray[np.bool_]]:
    """Sideways and turning the foot on that side opens the step; else the foot that hangs or stands behind goes first."""
    push = np.where(c.is_(SIT, STOP), 0.0, x / 0.1 + yaw / 0.4)
    sided = (shuffle & (np.abs(push) > 0.3)) | (~_hanging(state) & (np.abs(push) > 0.8))
    first = np.where(sided, np.where(push > 0, 0, 1), state.next)
    return first.astype(int), (first != state.next) & _hanging(state)


def _hanging(state: State) -> NDArray[np.bool_]:
    rows = np.arange(len(state.next))
    return np.asarray(state.foot[rows, state.next, 1] - state.level > 0.004)


def hip_path(state: State, p: Plan, c: Commands) -> tuple[Array, Array]:
    """(N, 16, 3) pelvis and (N, 16) yaw on the way to the plan's end, before the legs have had their say about the height."""
    n = len(state.yaw)
    end = np.stack([p.end[:, 0], p.level + p.height, p.end[:, 1]], -1)
    climb = np.where(c.is_(UP), 0.5, np.where(c.is_(DOWN), 0.45, 0.0)) * (p.level - state.level)
    velocity = np.stack([p.end_velocity[:, 0], climb, p.end_velocity[:, 1]], -1)
    s = np.broadcast_to(GRID, (n, len(GRID)))[..., None]
    args = (state.root, state.velocity, state.acceleration, end, velocity)
    root = quintic(s, *(value[:, None] for value in args))
    yaw_args = (state.yaw, state.yaw_rate, state.yaw_acceleration, p.yaw, p.yaw_rate)
    return root, quintic(s[..., 0], *(value[:, None] for value in yaw_args))


# -- where the feet go -------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Feet:
    """Both feet over a chunk: sole (N, 2, 16, 3) point under the flat ankle, yaw, pitch and bend of the toes (N, 2, 16)."""

    sole: Array
    yaw: Array
    pitch: Array
    bend: Array


@dataclass(frozen=True)
class Swing:
    """How a skill lifts its feet, each (N,): heel pitch at lift and at landing for a metre of travel, clearance in metres, timing."""

    lift_pitch: Array
    land_pitch: Array
    clearance: Array
    width: Array
    land: Array
    lift: Array


def _swing(c: Commands, p: Plan, planted: NDArray[np.bool_]) -> Swing:
    pick = lambda *values: np.array(values)[c.skill]  # noqa: E731  one value a skill, in the order of SKILLS
    stairs = c.is_(UP, DOWN)
    width = pick(0.07, 0.085, 0.08, 0.085, 0.08, 0.08, 0.09, 0.085)
    width = np.where(c.is_(WALK), 0.088 - 0.025 * p.flow, width)
    clearance = pick(0.045, 0.045, 0.035, 0.045, 0.07, 0.05, 0.03, 0.035)
    land = np.where(p.wrong, 0.54, np.where(planted, 0.52, pick(0.37, 0.4, 0.42, 0.4, 0.42, 0.47, 0.3, 0.38)))
    lift = np.where(p.wrong | planted, np.where(c.is_(UP), 0.55, 0.61), pick(0.6, 0.58, 0.58, 0.58, 0.5, 0.58, 0.5, 0.55))
    return Swing(
        pick(1.5, 0.7, 1.0, 0.7, 1.1, 0.9, 0.5, 1.0), pick(-0.65, 0.0, 0.7, 0.0, -0.1, 0.9, 0.0, -0.1), clearance,
        width, np.where(stairs & planted, 0.5, land), lift,
    )  # fmt: skip


def feet(state: State, p: Plan, c: Commands, root: Array) -> Feet:
    """The first foot lands at swing.land, the second one leaves at swing.lift and hangs beside it at the end, or stands."""
    rows = np.arange(len(p.first))
    second = 1 - p.first
    planted = ~_hanging(state) | (p.first != state.next)
    swing = _swing(c, p, planted)
    opening = _first_swing(state, p, c, swing, root, rows, p.first, planted)
    closing = _second_swing(state, p, c, swing, rows, second)
    left_first = p.first == 0
    parts = []
    for one, other in zip(opening, closing, strict=True):
        swap = left_first.reshape(-1, *(1 for _ in one.shape[1:]))
        parts.append(np.stack([np.where(swap, one, other), np.where(swap, other, one)], 1))
    return Feet(*parts)


def _target(p: Plan, swing: Swing, foot: Ints, lag: Array) -> Array:
    """(N, 3) where a foot comes to stand: under the hips' end, a little behind the faster one goes."""
    side = np.where(foot == 0, 1.0, -1.0) * swing.width
    behind = -0.02 - 0.1 * np.abs(p.forward) * p.flow - lag
    point = p.base + _turn(np.stack([side, behind], -1), p.yaw)
    return np.stack([point[:, 0], p.level, point[:, 1]], -1)


def _settled(c: Commands, start: Array, target: Array, turn: Array, tolerance: Array) -> NDArray[np.bool_]:
    gap = np.linalg.norm((target - start)[:, [0, 2]], axis=-1)
    return np.asarray((gap < tolerance) & (np.abs(turn) < 0.15) & (np.abs(target[:, 1] - start[:, 1]) < 0.004))


def _first_swing(
    state: State, p: Plan, c: Commands, swing: Swing, root: Array, rows: Ints, foot: Ints, planted: NDArray[np.bool_]
) -> tuple[Array, Array, Array, Array]:
    start, velocity = state.foot[rows, foot], state.foot_velocity[rows, foot]
    yaw0, rate0 = state.foot_yaw[rows, foot], state.foot_yaw_rate[rows, foot]
    target = _target(p, swing, foot, np.zeros(len(foot)))
    yaw1 = p.yaw + np.where(foot == 0, TOE_OUT, -TOE_OUT)
    tolerance = np.where(c.is_(SIT, STOP), 0.05, np.where(state.seated, 0.1, 0.0))
    stay = planted & _settled(c, start, target, yaw1 - yaw0, tolerance)
    target = _within_reach(target, start, root, swing.land, p)
    target, yaw1 = np.where(stay[:, None], start, target), np.where(stay, yaw0, yaw1)
    begin = np.where(p.wrong, 0.14, np.where(planted, 0.02, 0.0))
    span = swing.land - begin
    u = (GRID - begin[:, None]) / span[:, None]
    sole = cubic(u[..., None], start[:, None], (velocity * span[:, None])[:, None], target[:, None], np.zeros((1, 1, 3)))
    gap = np.linalg.norm((target - start)[:, [0, 2]], axis=-1)
    effort = np.clip(gap / 0.15, 0, 1) + np.clip(np.abs(yaw1 - yaw0) / 0.5, 0, 0.6)
    ground, held = _stair(u, state.level, p.level, start[:, 1])
    arc = np.where(planted, swing.clearance * np.clip(effort, 0, 1), 0.3 * swing.clearance * c.is_(UP, DOWN))
    sole[..., 1] = ground + held + arc[:, None] * bump(np.clip(u, 0, 1) ** 0.8)
    yaw = cubic(u, yaw0[:, None], (rate0 * span)[:, None], yaw1[:, None], np.zeros((1, 1)))
    along = np.sum((target - start)[:, [0, 2]] * np.stack([np.sin(p.yaw), np.cos(p.yaw)], -1), -1)
    pitch0, pitch_rate = state.foot_pitch[rows, foot], state.foot_pitch_rate[rows, foot]
    land = swing.land_pitch * np.clip(np.abs(np.where(planted, along * 0.8, p.forward)), 0, 0.75) * np.where(stay, 0, 1)
    touch = (swing.land - 0.05)[:, None]
    pitch = cubic(GRID / touch, pitch0[:, None], pitch_rate[:, None] * touch, land[:, None], np.zeros((1, 1)))
    pitch = pitch + np.where(planted, 0.8 * swing.lift_pitch * np.clip(gap, 0, 0.6), 0.0)[:, None] * bump(u * 1.15)
    pitch = np.where(GRID > touch, land[:, None] * (1 - smooth((GRID - touch) / 0.2)), pitch)
    return sole, yaw, pitch, np.zeros_like(pitch)


def _stair(u: Array, level0: Array, level1: Array, start: Array) -> tuple[Array, Array]:
    """(N, 16) height of the ground line under a swing, which rises early and falls late, and the clearance left from the start."""
    up = (level1 > level0)[:, None]
    ease = smoother(np.where(up, np.clip(u, 0, 1) / 0.85, (np.clip(u, 0, 1) - 0.12) / 0.88))
    ground = level0[:, None] + (level1 - level0)[:, None] * ease
    return ground, (start - level0)[:, None] * (1 - smoother(u) ** 2)


def _within_reach(target: Array, start: Array, root: Array, land: Array, p: Plan) -> Array:
    """From rest or in a change the hips are not yet where a stride would have them: the foot lands as far ahead as a leg goes."""
    frame = np.clip(np.round(land * FUTURE).astype(int), 0, FUTURE)
    hips = root[np.arange(len(land)), frame]
    gap = _turn((target - hips)[:, [0, 2]], -p.yaw)
    low = np.where(p.seat > 0.03, 9.0, 1.0)  # the feet of a sitter are far ahead of the hips
    gap[:, 1] = np.clip(gap[:, 1], -0.36, np.maximum(0.4, 0.4 * low))
    gap[:, 0] = np.clip(gap[:, 0], -0.42, 0.42)
    point = hips[:, [0, 2]] + _turn(gap, p.yaw)
    return np.stack([point[:, 0], target[:, 1], point[:, 1]], -1)


def _second_swing(
    state: State, p: Plan, c: Commands, swing: Swing, rows: Ints, foot: Ints
) -> tuple[Array, Array, Array, Array]:
    start, velocity = state.foot[rows, foot], state.foot_velocity[rows, foot]
    yaw0, rate0 = state.foot_yaw[rows, foot], state.foot_yaw_rate[rows, foot]
    touch = np.array([start[:, 0] + 0.06 * velocity[:, 0], state.level, start[:, 2] + 0.06 * velocity[:, 2]]).T
    touch = np.where((start[:, 1] - state.level > 0.004)[:, None], touch, start)
    target = _target(p, swing, foot, 0.03 * (1 - p.flow) * (p.seat < 0.03))
    yaw1 = p.yaw + np.where(foot == 0, TOE_OUT, -TOE_OUT)
    tolerance = np.where(c.is_(SIT, STOP), 0.05, np.where(state.seated, 0.1, 0.0))
    stay = _settled(c, touch, target, yaw1 - yaw0, tolerance)
    target, yaw1 = np.where(stay[:, None], touch, target), np.where(stay, yaw0, yaw1)
    down, span = 0.2, (1 - swing.lift)
    zero3, zero = np.zeros((1, 1, 3)), np.zeros((1, 1))
    landing = cubic(GRID[None, :, None] / down, start[:, None], velocity[:, None] * down, touch[:, None], zero3)
    u = (GRID - swing.lift[:, None]) / span[:, None]
    leave = 1.5 * p.flow[:, None] * (target - touch) * [1.0, 0.0, 1.0]
    swung = cubic(u[..., None], touch[:, None], zero3, target[:, None], leave[:, None])
    away = (u > 0)[..., None]
    sole = np.where(away, swung, landing)
    gap = np.linalg.norm((target - touch)[:, [0, 2]], axis=-1)
    effort = np.clip(np.clip(gap / 0.15, 0, 1) + np.clip(np.abs(yaw1 - yaw0) / 0.5, 0, 0.6), 0, 1)
    ground, _ = _stair(u, state.level, p.level, state.level)
    drop = 0.45 * np.maximum(state.level - p.level, 0.0)  # downstairs the foot still hangs above the tread it passes
    hang = ((swing.clearance + drop) * p.flow)[:, None] * smooth(1.6 * u)
    arc = (swing.clearance * effort * np.where(c.is_(UP), 0.4, np.where(c.is_(DOWN), 0.0, 1 - p.flow)))[:, None] * bump(u)
    sole[..., 1] = np.where(u > 0, ground + hang + arc, landing[..., 1])
    yaw = np.where(
        u > 0, cubic(u, yaw0[:, None], zero, yaw1[:, None], zero), cubic(GRID / down, yaw0[:, None], rate0[:, None] * down, yaw0[:, None], zero)
    )
    return sole, yaw, *_second_pitch(state, p, swing, rows, foot, target - touch, down)


def _second_pitch(
    state: State, p: Plan, swing: Swing, rows: Ints, foot: Ints, travel: Array, down: float
) -> tuple[Array, Array]:
    along = np.sum(travel[:, [0, 2]] * np.stack([np.sin(p.yaw), np.cos(p.yaw)], -1), -1)
    amount = np.clip(np.linalg.norm(travel[:, [0, 2]], axis=-1), 0, 0.7)
    amount = np.where(along < -0.05, -0.35, 1.0) * amount
    peak = (np.abs(swing.lift_pitch) * amount)[:, None]
    pitch0, rate0 = state.foot_pitch[rows, foot][:, None], state.foot_pitch_rate[rows, foot][:, None]
    rise, top = 0.28, (swing.lift + 0.08)[:, None]
    hang, slope = 0.24 * p.flow[:, None] * peak, -2.0 * p.flow[:, None] * peak
    first = cubic(GRID / down, pitch0, rate0 * down, np.zeros((1, 1)), np.zeros((1, 1)))
    heel = peak * smooth((GRID - rise) / (top - rise))
    fall = cubic((GRID - top) / (1 - top), peak, np.zeros((1, 1)), hang, slope * (1 - top))
    pitch = first + np.where(GRID > top, fall, heel)
    fade = 1 - smooth((GRID - top) / 0.25)
    return pitch, np.maximum(heel, 0.0) * np.where(GRID > top, fade, 1.0)


# -- the upper body ----------------------------------------------------------------------------------------------------
def pose_targets(state: State, p: Plan, c: Commands, style: Style, seats: Array, idle: Array) -> Array:
    """(N, 16, CHANNELS) what the skill wants of pelvis tilt, spine, head and arms."""
    pick = lambda *values: np.array(values)[c.skill]  # noqa: E731
    speed = np.linalg.norm(p.end - state.root[:, [0, 2]], axis=-1) / T
    vigour = pick(1.0, 0.25, 0.6, 0.2, 1.1, 1.0, 0.0, 0.0) * np.clip(speed / 1.15, 0, 1.2)
    way = np.where(c.is_(BACK), -1.0, 1.0)[:, None]
    phase = np.where(p.first == 1, 0.0, 1.0)[:, None] + way * GRID
    gait = augment.basis(phase) @ style.gait
    mean = style.gait[:, :1]
    weight = vigour[:, None, None]
    stance = style.stance[:, None]
    # The mean posture follows the speed up to that of the clips; the swing goes on growing with it.
    posture = stance + np.minimum(weight, 1.0) * (mean - stance)
    target = posture + weight * (gait - mean)
    sway = idle[_ping_pong(style.idle[:, None] + np.arange(FUTURE + 1), len(idle))]
    target = target + (0.6 * (1 - np.minimum(weight, 1.0))) * sway
    seated = (p.seat > 0.03)[:, None, None]
    grid = np.linspace(0.2, 0.8, len(seats))
    place = np.clip((p.height - grid[0]) / (grid[1] - grid[0]), 0, len(seats) - 1.001)
    low = place.astype(int)
    share = (place - low)[:, None]
    seat_pose = seats[low] * (1 - share) + seats[low + 1] * share
    target = np.where(seated, seat_pose[:, None] + 0.5 * sway, target)
    return _with_lean(target, pick(0.0, 0.0, -0.02, 0.0, 0.14, 0.02, 0.0, 0.0), pick(0, 0, 0, 0, 0.1, 0.2, 0, 0))


def _with_lean(target: Array, lean: Array, look_down: Array) -> Array:
    target = target.copy()
    target[..., 0] += 0.5 * lean[:, None]
    target[..., channel("spine1")] += 0.5 * lean[:, None]
    target[..., channel("neck")] += (0.5 * look_down - 0.5 * lean)[:, None]
    target[..., channel("head")] += (0.5 * look_down - 0.5 * lean)[:, None]
    return target


def _ping_pong(index: Ints, length: int) -> Ints:
    index = index % (2 * length - 2)
    return np.where(index < length, index, 2 * length - 2 - index)


def upper_body(state: State, p: Plan, c: Commands, target: Array, root: Array, yaw: Array) -> Array:
    """(N, 16, CHANNELS): the targets, reached from the present pose and velocity without a jolt, and what moving the hips demands."""
    gap = state.pose - target[:, 0]
    rate = state.pose_rate - (target[:, 1] - target[:, 0]) * FUTURE
    zero = np.zeros_like(gap)[:, None]
    long = np.where((p.seat > 0.03) | state.seated, 1.0, 0.85)[:, None, None]
    u = np.minimum(GRID[None, :, None] / long, 1.0)
    values = target + quintic(u, gap[:, None], rate[:, None] * long, zero, zero, zero)
    change = np.abs(root[:, -1, 1] - root[:, 0, 1] - (p.level - state.level))
    lean = (1.1 * np.clip(change, 0, 0.6) * np.where(p.seat > state.seat, 1.0, 0.85))[:, None] * bump(GRID)
    for joint, part in (("spine1", 0.25), ("spine2", 0.2), ("neck", -0.2), ("head", -0.35)):
        values[..., channel(joint)] += part * lean
    values[..., 0] += 0.6 * lean
    turn = (np.where(c.is_(TURN), 1.0, 0.5) * (p.yaw - state.yaw))[:, None] * bump(GRID * 1.1)
    for joint, part in (("spine2", 0.05), ("spine3", 0.08), ("neck", 0.1), ("head", 0.12)):
        values[..., channel(joint, 1)] += part * turn
    return values


def seat_table(stance: Array, heights: int = 13) -> Array:
    """(heights, CHANNELS) seated poses for pelvis heights 0.20 to 0.80 m: upright, a slack back, the hands on the thighs."""
    height = np.linspace(0.2, 0.8, heights)
    pose = np.repeat(stance[None], heights, 0)
    low = np.clip((0.62 - height) / 0.42, 0, 1)
    for joint, amount in (("spine1", 0.16), ("spine2", 0.12), ("spine3", 0.04), ("neck", -0.06), ("head", -0.12)):
        pose[:, channel(joint)] += amount + 0.1 * low * (1 if "spine" in joint else -1.2)
    pose[:, 0] = -0.16 - 0.1 * low
    root = np.stack([0 * height, height, 0 * height], -1)
    rotations = np.zeros((heights, N_JOINTS, 3))
    rotations[:, 0, 0] = pose[:, 0]
    rotations[:, UPPER] = pose[:, 3:].reshape(heights, -1, 3)
    position, orientation = forward_kinematics(root, rotations)
    for side, sign in (("left", 1.0), ("right", -1.0)):
        hip = position[:, JOINT_INDEX[f"{side}_hip"]]
        ankle = np.stack([0 * height + sign * 0.09, 0 * height + 0.075, seat_depth(height) - 0.02], -1)
        thigh, _ = ik.solve(ik.Limb.leg(side), hip, ankle, np.broadcast_to([sign * 0.12, 0.35, 0.94], hip.shape))
        palm = hip + thigh @ np.array([0.0, -0.27, 0.085])
        shoulder = position[:, JOINT_INDEX[f"{side}_shoulder"]]
        pole = np.broadcast_to([sign * 0.6, -0.5, -0.8], palm.shape)
        upper, fore = ik.solve(ik.Limb.arm(side), shoulder, palm - [0, 0, 0.03], pole)
        collar = orientation[:, JOINT_INDEX[f"{side}_collar"]]
        for joint, parent, own in (("shoulder", collar, upper), ("elbow", upper, fore)):
            start = channel(f"{side}_{joint}")
            pose[:, start : start + 3] = vector_from_matrix(np.swapaxes(parent, -1, -2) @ own)
    return pose


# -- the legs ----------------------------------------------------------------------------------------------------------
def pelvis_orientation(yaw: Array, tilt: Array) -> Array:
    """yaw (...) and pitch, roll, extra yaw (..., 3) to (..., 3, 3): Ry Rz Rx, which keeps the hip line's heading exact."""
    vector = np.zeros((*yaw.shape, 3, 3))
    vector[..., 0, 1], vector[..., 1, 2], vector[..., 2, 0] = yaw + tilt[..., 2], tilt[..., 1], tilt[..., 0]
    matrix = matrix_from_vector(vector)
    return np.asarray(matrix[..., 0, :, :] @ matrix[..., 1, :, :] @ matrix[..., 2, :, :])


def _hips(root: Array, orientation: Array) -> Array:
    """(N, 16, 3), (N, 16, 3, 3) to (N, 2, 16, 3)."""
    offsets = OFFSETS[[JOINT_INDEX["left_hip"], JOINT_INDEX["right_hip"]]]
    return np.stack([root + orientation @ offset for offset in offsets], 1)


def _lowered(root: Array, orientation: Array, where: Feet, allowance: Array) -> Array:
    """The path with the hips no higher than legs of this length allow: one round dip at the tightest moment, then what is left."""
    ankle = ik.ankle_over(where.sole, where.yaw, where.pitch + allowance)
    hips = _hips(root, orientation)
    away = np.sum((ankle - hips)[..., [0, 2]] ** 2, -1)
    highest = (ankle[..., 1] + np.sqrt(np.maximum(REACH**2 - away, 0.04)) + (root[:, None, :, 1] - hips[..., 1])).min(1)
    height = root[..., 1]
    need = (height - highest + 0.006 * bump(GRID)) * (bump(GRID) > 0.2)
    tightest = need.argmax(1)
    skew = np.log(0.5) / np.log(np.clip(GRID[tightest], 0.4, 0.65))
    depth = np.maximum(need.max(1), 0.0)[:, None]
    lowered = root.copy()
    lowered[..., 1] = smooth_minimum(height - depth * bump(GRID ** skew[:, None]), highest, 0.004 + 0.02 * bump(GRID))
    return lowered


def _comfortable(root: Array, orientation: Array, where: Feet, yaw: Array, limit: float = 0.52) -> Feet:
    """A shin that leans further over its foot than an ankle bends takes the heel along."""
    hips = _hips(root, orientation)
    lean = np.zeros_like(where.pitch)
    for index, side in enumerate(("left", "right")):
        ankle = ik.ankle_over(where.sole[:, index], where.yaw[:, index], where.pitch[:, index])
        shin = ik.solve(ik.Limb.leg(side), hips[:, index], ankle, _pole(where.yaw[:, index], yaw))[1]
        foot = ik.foot_orientation(where.yaw[:, index], where.pitch[:, index])
        up = np.swapaxes(foot, -1, -2) @ shin[..., 1, None]
        lean[:, index] = np.arctan2(up[..., 2, 0], up[..., 1, 0])
    extra = 0.9 * _soft_excess(lean - limit, 0.2)
    return replace(where, pitch=where.pitch + extra, bend=where.bend + extra)


def _soft_excess(value: Array, width: float) -> Array:
    """max(value, 0) with its corner rounded over `width` on either side."""
    rounded = (value + width) ** 2 / (4 * width)
    return np.asarray(np.where(value > width, value, np.where(value > -width, rounded, 0.0)))


def _rolled(hips: Array, where: Feet, allowance: Array) -> Feet:
    """A standing foot that the hips leave behind raises its heel until the leg reaches."""
    extra = np.zeros_like(where.pitch)
    for _ in range(3):
        gap = np.linalg.norm(ik.ankle_over(where.sole, where.yaw, where.pitch + extra) - hips, axis=-1) - REACH
        extra = np.clip(extra + np.maximum(gap, 0.0) / 0.11, 0.0, allowance)
    return replace(where, pitch=where.pitch + extra, bend=where.bend + extra)


def _pole(foot_yaw: Array, yaw: Array) -> Array:
    """Knees point ahead and a little up, halfway between hips and foot."""
    aim = yaw + 0.5 * _wrap(foot_yaw - yaw)
    return np.stack([0.94 * np.sin(aim), np.full_like(aim, 0.35), 0.94 * np.cos(aim)], -1)


def legs(root: Array, orientation: Array, where: Feet, yaw: Array) -> dict[str, Array]:
    """Local rotations (N, 16, 3, 3) of hip, knee, ankle and foot on both sides."""
    hips = _hips(root, orientation)
    found = {}
    for index, side in enumerate(("left", "right")):
        ankle = ik.ankle_over(where.sole[:, index], where.yaw[:, index], where.pitch[:, index])
        thigh, shin = ik.solve(ik.Limb.leg(side), hips[:, index], ankle, _pole(where.yaw[:, index], yaw))
        foot = ik.foot_orientation(where.yaw[:, index], where.pitch[:, index])
        bend = np.zeros((*yaw.shape, 3))
        bend[..., 0] = -np.clip(where.bend[:, index], 0.0, 0.9)
        found[f"{side}_hip"] = np.swapaxes(orientation, -1, -2) @ thigh
        found[f"{side}_knee"] = np.swapaxes(thigh, -1, -2) @ shin
        found[f"{side}_ankle"] = np.swapaxes(shin, -1, -2) @ foot
        found[f"{side}_foot"] = matrix_from_vector(bend)
    return found


def _wrap(angle: Array) -> Array:
    return np.asarray((angle + np.pi) % (2 * np.pi) - np.pi)


# -- one chunk ---------------------------------------------------------------------------------------------------------
def advance(state: State, c: Commands, style: Style, seats: Array, idle: Array) -> tuple[State, Array, Array]:
    """One chunk: the new state, root (N, 15, 3) and rotations (N, 15, 24, 3)."""
    p = plan(state, c)
    root, yaw = hip_path(state, p, c)
    where = feet(state, p, c, root)
    values = upper_body(state, p, c, pose_targets(state, p, c, style, seats, idle), root, yaw)
    stride = np.clip(np.abs(p.forward) / 0.62, 0, 1.2) * c.is_(WALK, BACK)
    root[..., 1] -= (0.022 * stride**2 * p.flow)[:, None] * np.sin(np.pi * GRID) ** 2
    orientation = pelvis_orientation(yaw, values[..., :3])
    rear = np.arange(2)[None] == (1 - p.first)[:, None]
    allowance = np.where(rear[..., None], 0.5 * bump(np.clip(GRID * 1.05, 0, 1)), 0.0)
    root = _lowered(root, orientation, where, allowance)
    where = _rolled(_hips(root, orientation), where, allowance)
    where = _comfortable(root, orientation, where, yaw)
    rotations = np.zeros((len(yaw), len(GRID), N_JOINTS, 3))
    rotations[:, :, 0] = vector_from_matrix(orientation)
    rotations[:, :, UPPER] = values[..., 3:].reshape(*yaw.shape, -1, 3)
    for joint, matrix in legs(root, orientation, where, yaw).items():
        rotations[:, :, JOINT_INDEX[joint]] = vector_from_matrix(matrix)
    return _ended(state, p, c, where, values), root[:, 1:], rotations[:, 1:]


def _ended(state: State, p: Plan, c: Commands, where: Feet, values: Array) -> State:
    rows = np.arange(len(p.first))
    second = 1 - p.first
    rate = lambda array: (array[..., -1] - array[..., -2]) * FUTURE  # noqa: E731
    climb = np.where(c.is_(UP), 0.5, np.where(c.is_(DOWN), 0.45, 0.0)) * (p.level - state.level)
    sole_rate = rate(np.moveaxis(where.sole, -2, -1))
    hanging = np.zeros((len(rows), 2))
    hanging[rows, second] = p.flow > 0
    sole_rate = sole_rate * hanging[..., None]
    sole_rate[..., 1] = 0.0
    end = np.stack([p.end[:, 0], p.level + p.height, p.end[:, 1]], -1)
    zero = np.zeros_like(p.yaw)
    return State(
        end, np.stack([p.end_velocity[:, 0], climb, p.end_velocity[:, 1]], -1), np.zeros_like(end), p.yaw, p.yaw_rate, zero,
        p.level, p.seat, where.sole[..., -1, :], sole_rate, where.yaw[..., -1], rate(where.yaw) * hanging,
        where.pitch[..., -1], rate(where.pitch) * hanging, second, values[:, -1], (values[:, -1] - values[:, -2]) * FUTURE,
    )  # fmt: skip


# -- whole motions -----------------------------------------------------------------------------------------------------
def _style(profiles: Profiles, n: int, rng: np.random.Generator) -> Style:
    """The mean gait with a share of one walker's own manner, and arms that swing more or less."""
    which = rng.integers(1, len(profiles.gait), n)
    own = rng.uniform(0.0, 0.5, n)[:, None, None]
    gait = profiles.gait[0] + own * (profiles.gait[which] - profiles.gait[0])
    gait[:, 1:] *= rng.uniform(0.85, 1.1, n)[:, None, None]
    gait[:, 0] = _eyes_level(gait[:, 0], 0.06)
    stance = np.repeat(_eyes_level(profiles.stance, 0.04)[None], n, 0)
    return Style(gait, stance, rng.integers(0, len(profiles.idle), n))


def _eyes_level(pose: Array, down: float) -> Array:
    """The pose with the neck and head bent so that the eyes look ahead, `down` radians below the horizon."""
    pose = pose.copy()
    chain = [0, *(channel(joint) for joint in ("spine1", "spine2", "spine3", "neck", "head"))]
    missing = down - pose[..., chain].sum(-1)
    pose[..., channel("neck")] += 0.4 * missing
    pose[..., channel("head")] += 0.6 * missing
    return pose


def _play(profiles: Profiles, series: Sequence[Commands], rng: np.random.Generator, rested: float = 0.0) -> tuple[Array, Array]:
    """Root (N, 5 + 15 K, 3) and rotations (N, 5 + 15 K, 24, 3) of N bodies that carry out K commands each.

    They begin in a quiet stance, a share `rested` of them in `rest_pose`.
    """
    n = len(series[0].skill)
    style = _style(profiles, n, rng)
    seats = seat_table(style.stance[0])
    next_foot = rng.integers(0, 2, n)
    wait = Commands.of([("stop", {})] * n)
    state, root, rotations = advance(State.standing(style.stance, next_foot), wait, style, seats, profiles.idle)
    resting = rng.random(n) < rested
    state = _either(resting, State.resting(n, next_foot), state)
    rest = rest_pose(HISTORY)
    roots = [np.where(resting[:, None, None], rest.root, root[:, -HISTORY:])]
    turns = [np.where(resting[:, None, None, None], rest.rotations, rotations[:, -HISTORY:])]
    for commands in series:
        style = replace(style, idle=style.idle + FUTURE)
        state, root, rotations = advance(state, commands, style, seats, profiles.idle)
        roots.append(root)
        turns.append(rotations)
    return np.concatenate(roots, 1), np.concatenate(turns, 1)


def _either(which: NDArray[np.bool_], one: State, other: State) -> State:
    def pick(a: Array, b: Array) -> Array:
        return np.where(which.reshape(-1, *(1 for _ in a.shape[1:])), a, b)

    return State(*(pick(getattr(one, field.name), getattr(other, field.name)) for field in fields(State)))


def compose(clips: Sequence[Any] | Profiles, commands: Sequence[Command], seed: int) -> Motion:
    """One body that stands for 5 frames and then carries out the commands, 15 frames each: 5 + 15 K frames at 30 fps.

    clips: real clips (mappings with name, root, rotations) or the profiles measured on them. commands: (skill, parameters) with
    parameters named as in chunks.PARAMETERS, in metres and radians. What a command asks for is what `outcome` measures.
    """
    profiles = clips if isinstance(clips, Profiles) else Profiles.of(clips)
    root, rotations = _play(profiles, [Commands.of([command]) for command in commands], np.random.default_rng(seed))
    return Motion(root[0], rotations[0])


# -- the edited data set -----------------------------------------------------------------------------------------------
_FOLLOWS: Final = np.array(
    # walk side back turn  up down sit stop
    [
        [62, 5, 3, 10, 5, 5, 4, 6],
        [16, 40, 8, 14, 4, 4, 8, 6],
        [10, 8, 44, 14, 3, 3, 12, 6],
        [24, 7, 6, 42, 5, 5, 6, 5],
        [12, 4, 3, 5, 66, 4, 1, 5],
        [12, 4, 3, 5, 4, 66, 1, 5],
        [13, 6, 4, 10, 2, 2, 45, 18],
        [14, 8, 8, 12, 7, 7, 14, 30],
    ],
    float,
)
"""Odds that one skill follows another, rows before, columns after."""


def sample_commands(n: int, length: int, rng: np.random.Generator) -> list[Commands]:
    """Natural series of commands for n bodies: runs of one skill at about the same values, and every change of skill."""
    odds = np.cumsum(_FOLLOWS / _FOLLOWS.sum(1, keepdims=True), 1)
    skill = rng.integers(0, len(SKILLS), n)
    held = _draw(skill, rng)
    series = []
    for _ in range(length):
        following = (rng.random(n)[:, None] > odds[skill]).sum(1).clip(0, len(SKILLS) - 1)
        again = (following == skill) & (rng.random(n) < 0.8)
        held = np.where(again[:, None], _vary(held, skill, rng), _draw(following, rng))
        skill = following
        series.append(Commands(skill, *held.T))
    return series


def _draw(skill: Ints, rng: np.random.Generator) -> Array:
    """(N, 5) x, z, yaw, h, d over the schemas' whole ranges, a little beyond them, with more of what is asked for most."""
    n = len(skill)
    values = np.zeros((n, 5))
    wide = rng.random(n) < 0.5
    degrees = np.pi / 180

    def put(which: int, column: int, numbers: Array) -> None:
        values[:, column] = np.where(skill == which, numbers, values[:, column])

    straight = rng.random(n)
    put(WALK, 1, np.where(wide, rng.uniform(0, 0.82, n), rng.normal(0.48, 0.12, n).clip(0.05, 0.8)))
    put(WALK, 0, np.where(wide, rng.uniform(-0.31, 0.31, n), rng.normal(0, 0.05, n) * (straight > 0.4)))
    put(WALK, 2, np.where(wide, rng.uniform(-31, 31, n), rng.normal(0, 9, n) * (straight < 0.7)).clip(-31, 31) * degrees)
    put(SIDE, 0, rng.uniform(-0.42, 0.42, n))
    put(BACK, 1, rng.uniform(0.03, 0.47, n))
    put(TURN, 2, rng.uniform(-77, 77, n) * degrees)
    for stair in (UP, DOWN):
        put(stair, 3, np.where(wide, rng.uniform(0.07, 0.26, n), rng.normal(0.17, 0.02, n)))
        put(stair, 4, np.where(wide, rng.uniform(0.19, 0.41, n), rng.normal(0.28, 0.025, n)))
    put(SIT, 3, np.where(wide, rng.uniform(0.19, 0.81, n), rng.normal(0.54, 0.05, n)))
    return values


def _vary(values: Array, skill: Ints, rng: np.random.Generator) -> Array:
    """The same command again, give or take; a seat stays what it is."""
    noise = rng.normal(0, [0.015, 0.03, 0.05, 0.004, 0.006], values.shape) * (values != 0)
    noise[skill == SIT] = 0.0
    varied = values + noise
    varied[:, 0] = varied[:, 0].clip(-0.42, 0.42)
    varied[:, 1] = varied[:, 1].clip(0.0, 0.82)
    return varied


def edited_chunks(
    clips: Sequence[Any] | Profiles,
    seconds_per_skill: float,
    seed: int,
    progress: Callable[[float], None] | None = None,
    base_share: float = 4.0,
) -> dict[str, Chunks]:
    """Composed chunks of every skill, and of `base` at any offset, each also mirrored, with the parameters that they realise.

    seconds_per_skill: future seconds, so 2 chunks a second; base gets base_share times as much. progress hears 0 to 1.
    """
    profiles = clips if isinstance(clips, Profiles) else Profiles.of(clips)
    rng = np.random.default_rng(seed)
    wanted = {name: max(1, round(seconds_per_skill / T / 2)) for name in SKILLS}
    wanted["base"] = max(1, round(base_share * seconds_per_skill / T / 2))
    found: dict[str, list[Chunks]] = {name: [] for name in wanted}
    while missing := {name: count - sum(map(len, found[name])) for name, count in wanted.items()}:
        if max(missing.values()) <= 0:
            break
        for name, chunks in _batch(profiles, rng).items():
            if missing[name] > 0 and len(chunks):
                found[name].append(chunks[: missing[name]])
        if progress is not None:
            progress(1 - max(max(m, 0) / wanted[name] for name, m in missing.items()))
    return {name: _with_mirror(name, Chunks.join(parts)) for name, parts in found.items()}


def _with_mirror(skill: str, chunks: Chunks) -> Chunks:
    return Chunks.join([chunks, chunks.mirrored(skill)])


def _batch(profiles: Profiles, rng: np.random.Generator, bodies: int = 128, length: int = 16) -> dict[str, Chunks]:
    series = sample_commands(bodies, length, rng)
    motions = [Motion(*pair) for pair in zip(*_play(profiles, series, rng, rested=0.3), strict=True)]
    skill = np.stack([commands.skill for commands in series], 1)
    whole = [cut(motion, np.arange(length) * FUTURE) for motion in motions]
    root, rotations = np.stack([pair[0] for pair in whole]), np.stack([pair[1] for pair in whole])
    # Who rises from a seat rises by more than the stair; what was asked for is the stair.
    stair = np.isin(skill, (UP, DOWN)) & (root[:, :, HISTORY - 1, 1] < 0.9)
    asked = np.stack([np.stack([commands.h, commands.d], -1) for commands in series], 1)
    found = {}
    for index, name in enumerate(SKILLS):
        rows = skill == index
        chunks = Chunks.of(name, root[rows], rotations[rows], "composed", False)
        if index in (UP, DOWN):
            chunks = replace(chunks, params=np.where(stair[rows][:, None], asked[rows], chunks.params).astype(np.float32))
        found[name] = chunks
    offsets = [rng.integers(0, len(motion) - FUTURE - HISTORY + 1, 2 * length) for motion in motions]
    loose = [cut(motion, starts) for motion, starts in zip(motions, offsets, strict=True)]
    found["base"] = Chunks.of("base", *(np.concatenate(part) for part in zip(*loose, strict=True)), "composed", False)
    return found
