"""The two swings of a chunk: one foot lands, then the other leaves; over the edges of stairs too. Needs only numpy."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np

from humanclaw.body import FUTURE, Array, smoothstep
from humanclaw.motion import apart, widened
from humanclaw_train.synthesis import ik
from humanclaw_train.synthesis.commands import Commands, Ints, Mask
from humanclaw_train.synthesis.curves import GRID, bump, cubic, floor, moving, raised, smoother, turned
from humanclaw_train.synthesis.ik import Feet, Track
from humanclaw_train.synthesis.state import AIRBORNE, TOE_OUT, State, Style
from humanclaw_train.synthesis.step_plan import StepPlan


class Steps(NamedTuple):
    """The parameters of feet in `GaitParameters` (N,), adapted to the state that a chunk begins in."""

    width: Array
    clearance: Array
    land: Array
    lift: Array
    lift_pitch: Array
    land_pitch: Array


@dataclass(frozen=True)
class Swing:
    """One foot of each body on its way to a new place. All (N, ...).

    foot: left 0, right 1. start, velocity, yaw0, yaw_rate, pitch0, pitch_rate: at the end of the previous chunk.
    target, yaw1: where the foot will stand.
    """

    foot: Ints
    start: Array
    velocity: Array
    yaw0: Array
    yaw_rate: Array
    pitch0: Array
    pitch_rate: Array
    target: Array
    yaw1: Array

    @classmethod
    def of(cls, state: State, p: StepPlan, m: Steps, foot: Ints, lag: Array | float) -> Swing:
        """Aim below the end of the hips, further behind the faster they go, and `lag` metres more."""
        left = np.where(foot == 0, 1.0, -1.0)
        behind = -0.02 - 0.1 * np.abs(p.ahead) * p.flow - lag
        target = raised(p.base + turned(np.stack([left * m.width, behind], -1), p.yaw), p.level)
        return cls(
            foot,
            state.of_foot(state.foot, foot),
            state.of_foot(state.foot_velocity, foot),
            state.of_foot(state.foot_yaw, foot),
            state.of_foot(state.foot_yaw_rate, foot),
            state.of_foot(state.foot_pitch, foot),
            state.of_foot(state.foot_pitch_rate, foot),
            target,
            p.yaw + left * TOE_OUT,
        )

    @property
    def travel(self) -> Array:
        return floor(self.target - self.start)

    @property
    def distance(self) -> Array:
        return np.asarray(np.linalg.norm(self.travel, axis=-1))

    @property
    def effort(self) -> Array:
        """(N,) 0 to 1: height of the lift, which grows with distance and turn."""
        turn = np.clip(np.abs(self.yaw1 - self.yaw0) / 0.5, 0, 0.6)
        return np.clip(np.clip(self.distance / 0.15, 0, 1) + turn, 0, 1)

    def beside(self, target: Array, other: Array, yaw: Array) -> Array:
        """Return a target (N, 3) that is clear of the other foot at (N, 3) with its yaw (N,)."""
        return np.asarray(target + apart(target, self.yaw1, other, yaw, np.where(self.foot == 0, 1.0, -1.0)))

    def settled(self, tolerance: Array, free: Mask | bool = True) -> Swing:
        """Return the swing without movement where the foot already stands within `tolerance` metres of its target."""
        near = (self.distance < tolerance) & (np.abs(self.yaw1 - self.yaw0) < 0.15)
        stay = near & (np.abs(self.target - self.start)[:, 1] < AIRBORNE) & free
        return replace(
            self, target=np.where(stay[:, None], self.start, self.target), yaw1=np.where(stay, self.yaw0, self.yaw1)
        )


def feet(state: State, p: StepPlan, c: Commands, style: Style, root: Array) -> tuple[Feet, Array]:
    """Return both feet over a chunk, and by how many metres their clearance over a stair falls short of 2 cm (N,).

    The first foot lands, then the second leaves. At the end the second hangs beside the first, or stands.
    """
    p = _before_the_riser(state, p, c, style)
    m = _timed(c, p, in_stance=~state.hanging | p.wrong)
    tolerance = np.where(c.does("settle"), 0.08, np.where(state.seated, 0.1, 0.0))
    first = _first_swing(state, p, c, m, root, tolerance)
    second = _second_swing(state, p, c, m, tolerance, first)
    side = np.where(p.first == 0, 1.0, -1.0)
    first, second = past(first, second, side), past(second, first, -side)
    edge = _nosing(p, c, style)
    first, second = (_cleared(state, p, c, edge, track) for track in (first, second))
    lacking = np.maximum(*(_clearance_lack(state, p, edge, track, 0.02).max(1) for track in (first, second)))
    left = p.first == 0
    pairs = zip(first, second, strict=True)
    swap = ((left.reshape(-1, *(1 for _ in a.shape[1:])), a, b) for a, b in pairs)
    both = Feet(*(np.stack([np.where(is_left, a, b), np.where(is_left, b, a)], 1) for is_left, a, b in swap))
    return both, np.where(c.stairs, lacking, 0.0)


def past(track: Track, other: Track, side: Array) -> Track:
    """Swing a foot around the other one: its track (N, 16, ...) without moments at which shoes are in each other.

    side: (N,) 1 for a left foot, -1 for a right one.
    """
    sole, yaw, pitch, bend = track
    shift = apart(sole, yaw, other[0], other[1], side[:, None]) * moving(sole)[..., None]
    size = np.linalg.norm(shift, axis=-1, keepdims=True)
    way = shift.sum(1, keepdims=True)
    way = way / np.maximum(np.linalg.norm(way, axis=-1, keepdims=True), 1e-9)
    return sole + (widened(size[..., 0]) * smoothstep(GRID / 0.15))[..., None] * way, yaw, pitch, bend


def _timed(c: Commands, p: StepPlan, in_stance: Mask) -> Steps:
    """Set the times of landing and leaving, and the distance between the feet.

    A first foot that still stands has half a swing more to do. Striding feet pass closer together than feet stand. The
    further hips of a walker go aside, the sooner the second foot leaves: legs do not cross.
    """
    m = Steps(*(c.gait[name] for name in Steps._fields))
    land = np.select([c.stairs & in_stance, p.wrong, in_stance], [0.5, 0.54, 0.52], m.land)
    lift = np.where(in_stance, np.where(c.rise > 0, 0.55, 0.61), m.lift)
    lift = lift - 0.35 * np.clip((p.aside - 0.15) / 0.35, 0.0, 1.0) * (c.does("stride") & ~in_stance)
    return m._replace(land=land, lift=lift, width=m.width - c.gait["narrowing"] * p.flow)


def _first_swing(state: State, p: StepPlan, c: Commands, m: Steps, root: Array, tolerance: Array) -> Track:
    in_stance = ~state.hanging | p.wrong
    swing = Swing.of(state, p, m, p.first, 0.0)
    stays = swing.settled(tolerance, in_stance)
    moves = stays.distance > 0
    other = state.of_foot(state.foot, 1 - p.first), state.of_foot(state.foot_yaw, 1 - p.first)
    aim = swing.beside(_within_reach(swing.target, root, m.land, p), *other)
    swing = replace(swing, target=np.where(moves[:, None], aim, swing.start), yaw1=stays.yaw1)
    begin = np.select([p.wrong, in_stance], [0.14, 0.02], 0.0)
    span = m.land - begin
    u = (GRID - begin[:, None]) / span[:, None]
    sole = cubic(
        u[..., None], swing.start[:, None], (swing.velocity * span[:, None])[:, None], swing.target[:, None], 0.0
    )
    # A foot in the air loses its remaining height last, because it still has ground to cover.
    held = (swing.start[:, 1] - state.level)[:, None] * (1 - smoother(u) ** 2)
    arc = m.clearance * np.where(in_stance, swing.effort, 0.3 * c.stairs)
    line = _ground_line(u, state.level, p.level) + held
    # A foot that is already above the next tread only sinks.
    above = np.maximum(swing.start[:, 1] - p.level, 0.0)[:, None] * (1 - smoother(u) ** 2)
    sinks = (c.rise > 0) & (swing.start[:, 1] > p.level)
    line = np.where(sinks[:, None], p.level[:, None] + above, line)
    sole[..., 1] = line + arc[:, None] * bump(np.clip(u, 0, 1) ** 0.8)
    yaw = cubic(u, swing.yaw0[:, None], (swing.yaw_rate * span)[:, None], swing.yaw1[:, None], 0.0)
    return sole, yaw, _landing_pitch(swing, p, m, u, in_stance, moves), np.zeros_like(yaw)


def _within_reach(target: Array, root: Array, land: Array | float, p: StepPlan) -> Array:
    """Limit the target to a leg's reach at the landing: while the hips speed up, they lag behind a steady stride."""
    frame = np.clip(np.round(np.asarray(land) * FUTURE).astype(int), 0, FUTURE)
    hips = floor(root[np.arange(len(frame)), frame])
    gap = turned(floor(target) - hips, -p.yaw)
    gap[:, 0] = np.clip(gap[:, 0], -0.42, 0.42)
    # Feet of a seated body are far ahead of the hips: no limit there.
    gap[:, 1] = np.clip(gap[:, 1], -0.36, np.where(p.sits, 9.0, 0.4))
    return raised(hips + turned(gap, p.yaw), target[:, 1])


def _landing_pitch(swing: Swing, p: StepPlan, m: Steps, u: Array, in_stance: Mask, moves: Mask) -> Array:
    """Return the heel pitch of the first foot (N, 16): up to its value at the landing, then flat."""
    along = np.where(in_stance, 0.8 * np.sum(swing.travel * p.facing, -1), p.ahead)
    land = (m.land_pitch * np.clip(np.abs(along), 0, 0.75) * moves)[:, None]
    touch = np.asarray(m.land - 0.05)[:, None]
    swung = cubic(GRID / touch, swing.pitch0[:, None], swing.pitch_rate[:, None] * touch, land, 0.0)
    kick = np.where(in_stance, 0.8 * m.lift_pitch * np.clip(swing.distance, 0, 0.6), 0.0)
    swung = swung + kick[:, None] * bump(1.15 * u)
    return np.where(touch < GRID, land * (1 - smoothstep((GRID - touch) / 0.2)), swung)


def _second_swing(state: State, p: StepPlan, c: Commands, m: Steps, tolerance: Array, first: Track) -> Track:
    lag = 0.03 * (1 - p.flow) * ~p.sits
    swing = Swing.of(state, p, m, 1 - p.first, lag)
    swing = replace(swing, target=swing.beside(swing.target, first[0][:, -1], first[1][:, -1]))
    came = swing
    touch = raised(floor(swing.start + 0.06 * swing.velocity), state.level)
    hangs = swing.start[:, 1] - state.level > AIRBORNE
    swing = replace(swing, start=np.where(hangs[:, None], touch, swing.start)).settled(tolerance)
    down = 0.2  # Share of the chunk in which a foot in the air that does not go first comes down.
    landing = cubic(GRID[:, None] / down, came.start[:, None], came.velocity[:, None] * down, swing.start[:, None], 0.0)
    u = (GRID - np.asarray(m.lift)[:, None]) / (1 - np.asarray(m.lift))[:, None]
    # The foot is still moving at the end, so that the next chunk continues the swing smoothly.
    leave = raised(1.5 * p.flow[:, None] * swing.travel, np.zeros(1))
    sole = cubic(u[..., None], swing.start[:, None], 0.0, swing.target[:, None], leave[:, None])
    sole[..., 1] = _ground_line(u, state.level, p.level) + _lift(state, p, c, m, swing, u)
    sole = np.where((u > 0)[..., None], sole, landing)
    rest = cubic(GRID / down, swing.yaw0[:, None], swing.yaw_rate[:, None] * down, swing.yaw0[:, None], 0.0)
    yaw = np.where(u > 0, cubic(u, swing.yaw0[:, None], 0.0, swing.yaw1[:, None], 0.0), rest)
    return sole, yaw, *_leaving_pitch(swing, p, m, down)


def _lift(state: State, p: StepPlan, c: Commands, m: Steps, swing: Swing, u: Array) -> Array:
    """Return the height of the second foot above the ground line (N, 16): its height at the end, plus an arc."""
    # On stairs the passing foot has to clear an edge.
    drop = np.where(p.level > state.level, 0.45, 0.6) * np.abs(p.level - state.level)
    arc = np.select([c.rise > 0, c.rise < 0], [np.full_like(p.flow, 0.4), np.zeros_like(p.flow)], 1 - p.flow)
    hang = (m.clearance + drop) * p.flow
    return np.asarray(hang[:, None] * smoothstep(1.3 * u) + (m.clearance * swing.effort * arc)[:, None] * bump(u))


def _leaving_pitch(swing: Swing, p: StepPlan, m: Steps, down: float) -> tuple[Array, Array]:
    """Return heel pitch and toe bend of the second foot (N, 16).

    The heel rises behind the hips, peaks as the toes leave the ground and sinks in the swing.
    """
    backwards = np.sum(swing.travel * p.facing, -1) < -0.05
    peak = (m.lift_pitch * np.clip(swing.distance, 0, 0.7) * np.where(backwards, -0.35, 1.0))[:, None]
    rise, top = 0.28, np.asarray(m.lift + 0.08)[:, None]
    heel = peak * smoothstep((GRID - rise) / (top - rise))
    hang, slope = 0.24 * p.flow[:, None] * peak, -2.0 * p.flow[:, None] * peak
    fall = cubic((GRID - top) / (1 - top), peak, 0.0, hang, slope * (1 - top))
    before = cubic(GRID / down, swing.pitch0[:, None], swing.pitch_rate[:, None] * down, np.zeros((1, 1)), 0.0)
    bend = np.maximum(heel, 0.0) * np.where(top < GRID, 1 - smoothstep((GRID - top) / 0.25), 1.0)
    return before + np.where(top < GRID, fall, heel), bend


# -- stairs ------------------------------------------------------------------------------------------------------------
NOSE: Final = 0.025
"""Clearance of every point of a swinging foot over the edge of a tread, metres."""


def _ground_line(u: Array, level0: Array, level1: Array) -> Array:
    """Return the ground line under a swing (N, 16). It rises early and falls late, as the edge of the tread demands.

    u: (N, 16) progress of the swing. level0, level1: (N,) floor before and after, metres.
    """
    u = np.clip(u, 0, 1)
    ease = smoother(np.where((level1 > level0)[:, None], u / 0.85, (u - 0.12) / 0.88))
    return np.asarray(level0[:, None] + (level1 - level0)[:, None] * ease)


def _nosing(p: StepPlan, c: Commands, style: Style) -> Array:
    """Return where the edge between this chunk's two treads is (N,), metres along the facing from the plan's base.

    Upstairs, standing toes keep 5 to 15 cm from the next riser; on shallow treads the heels reach over the edge.
    Downstairs, a landing heel keeps 4 cm or more from the riser behind it.
    """
    ankle = -0.02 - 0.1 * np.abs(p.ahead) * p.flow
    up = np.maximum(p.ahead - 0.25 - 0.1 * style.riser, -0.06)
    down = 0.1 + style.riser * np.maximum(p.ahead - 0.24, 0.02)
    return np.asarray(ankle - np.where(c.rise > 0, up, down))


def _before_the_riser(state: State, p: StepPlan, c: Commands, style: Style) -> StepPlan:
    """Return the plan with a base further ahead where a foot already stands past the riser that the step implies."""
    toes = np.max(np.sum(floor(state.foot) * p.facing[:, None], -1), -1) + 0.22
    past = toes - (np.sum(p.base * p.facing, -1) + _nosing(p, c, style))
    further = np.where((c.rise > 0) & ~state.seated, np.clip(past, 0.0, 0.16), 0.0)
    return replace(p, base=p.base + further[:, None] * p.facing)


def _cleared(state: State, p: StepPlan, c: Commands, edge: Array, track: Track) -> Track:
    """Lift the track of a foot where it would cut the edge of a tread."""
    sole, yaw, pitch, bend = track
    lack = _clearance_lack(state, p, edge, track, NOSE) * (smoothstep(GRID / 0.2) * c.stairs[:, None])
    raised_by = widened(lack * moving(sole))
    sole = sole.copy()
    sole[..., 1] += raised_by * smoothstep(GRID / 0.15)
    return sole, yaw, pitch, bend


def _clearance_lack(state: State, p: StepPlan, edge: Array, track: Track, margin: float) -> Array:
    """Return by how many metres heel or toes fall short of `margin` above the upper tread while over it (N, 16)."""
    sole, yaw, pitch, _ = track
    ankle = ik.ankle_over(sole, yaw, pitch)
    orientation = ik.foot_orientation(yaw, pitch)
    up = (p.level > state.level)[:, None]
    top = np.maximum(p.level, state.level)[:, None]
    nose = (np.sum(p.base * p.facing, -1) + edge)[:, None]
    # Close to where it stands before or after, a foot comes from or goes to the tread: no margin there.
    away = np.minimum(*(np.linalg.norm(floor(sole - sole[:, at, None]), axis=-1) for at in (0, -1)))
    tread = top + margin * np.clip(away / 0.08, 0.0, 1.0)
    lacks = []
    for point in ik.SOLE_POINTS:
        place = ankle + orientation @ point
        ahead = np.sum(floor(place) * p.facing[:, None], -1) - nose
        lacks.append(np.where(np.where(up, ahead > 0.0, ahead < 0.0), tread - place[..., 1], 0.0))
    return np.asarray(np.maximum(np.max(lacks, axis=0), 0.0))
