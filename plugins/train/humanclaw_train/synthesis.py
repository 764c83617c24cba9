"""Motion synthesis: continuous motion for any series of commands, from the profiles of real clips (synthetic training
data).

Each command lasts one chunk of 15 frames. What happens in a chunk is a function of the body's state at its start and of
its own command, never of a later one, because the motion model sees no more than that. A chunk begins and ends as the
feet pass each other: one foot stands under the hips, the other one hangs beside it, or stands too. In the chunk's first
part the hanging foot lands where the hips will be; in its second part the other one follows. Walking, turning, stairs,
sitting down and stopping are the same two swings with other numbers.

Shapes: N bodies move at once; a chunk has 16 instants at s = 0 ... 1, the first of which belongs to the chunk before.
Frames as in humanclaw.pose; "floor" vectors are (x, z). Needs numpy alone.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from humanclaw import Motion
from humanclaw.body import (
    FPS,
    FUTURE,
    HISTORY,
    JOINT_INDEX,
    N_JOINTS,
    SOLE,
    STANDING_HEIGHT,
    forward_kinematics,
    matrix_from_vector,
    rest_pose,
    smoothstep,
    vector_from_matrix as to_vector,
)
from humanclaw.motion import Limb, solve
from humanclaw_train import augment, gait, ik
from humanclaw_train.augment import UPPER, Profiles, RealClip, channel
from humanclaw_train.commands import Commands, Trained
from humanclaw_train.curves import (
    Array,
    bump,
    cubic,
    floor,
    quintic,
    raised,
    smoother,
    soft_minimum,
    turned,
)
from humanclaw_train.ik import Feet

Ints = NDArray[np.int_]
Mask = NDArray[np.bool_]
Command = tuple[Trained, Mapping[str, float]]

SECONDS: Final = FUTURE / FPS
GRID: Final = np.arange(FUTURE + 1) / FUTURE
STAND: Final = 0.956
"""Pelvis height of a standing or passing body: the knees are never quite straight."""
COAST: Final = 0.2
"""Share of a chunk at their speed by which the hips go on where no travel is commanded: nobody stops dead."""
TOE_OUT: Final = 0.12
AIRBORNE: Final = 0.004
"""A foot this far above the floor hangs, metres."""
LEVEL_FEET: Final = 0.005
"""Feet that stand this close to level, metres along the facing, may both go first."""
SEATED: Final = 0.03
"""Hips this far behind the feet sit, metres."""


# -- state -------------------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class State:
    """N bodies at the end of a chunk; rates and velocities are per chunk. The root is that of the path, about which a
    walker sways.

    root, velocity (N, 3); yaw, yaw_rate, level of the floor (N,); seat (N,): how far the hips are behind the feet,
    nought when standing; foot, foot_velocity (N, 2, 3): the points under the ankles, left first; foot_yaw,
    foot_yaw_rate, foot_pitch, foot_pitch_rate (N, 2); next (N,): the foot that swings first unless the command or
    where the feet stand has a reason against it; pose, pose_rate (N, CHANNELS). phase (N,) of the step cycle and
    cadence (N,), nought for who does not walk; sway (N, 3): amplitudes of the pelvis about its path, as
    humanclaw_train.gait has them. height (N,): of the pelvis itself above the level. lacking (N,): by how much the
    chunk before missed 2 cm of clearance over the edge of a stair, metres.
    """

    root: Array
    velocity: Array
    yaw: Array
    yaw_rate: Array
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
    phase: Array
    cadence: Array
    sway: Array
    height: Array
    lacking: Array

    @classmethod
    def standing(cls, pose: Array, next_foot: Ints) -> State:
        """At the origin in a quiet stance, the foot that will go first a little behind."""
        foot = np.tile([[0.085, 0.0, -0.02], [-0.085, 0.0, -0.02]], (len(pose), 1, 1))
        foot[np.arange(len(pose)), next_foot, 2] -= 0.03
        return cls._still(STAND, foot, TOE_OUT, next_foot, pose)

    @classmethod
    def resting(cls, next_foot: Ints) -> State:
        """In `rest_pose`, in which a body that has not moved yet is put into a scene."""
        n = len(next_foot)
        foot = np.tile([[0.09, 0.0, 0.0], [-0.09, 0.0, 0.0]], (n, 1, 1))
        return cls._still(STANDING_HEIGHT, foot, 0.0, next_foot, np.repeat(augment.channels(rest_pose(3))[:1], n, 0))

    @classmethod
    def _still(cls, height: float, foot: Array, toe_out: float, next_foot: Ints, pose: Array) -> State:
        n = len(pose)
        zero, two, three = np.zeros(n), np.zeros((n, 2)), np.zeros((n, 3))
        return cls(
            three + [0.0, height, 0.0], three, zero, zero, zero, zero, foot, np.zeros((n, 2, 3)), two + [toe_out,
            -toe_out],
            two, two, two, next_foot, pose, np.zeros_like(pose), zero, zero, three, zero + height, zero,
        )  # fmt: skip

    @property
    def seated(self) -> Mask:
        return self.seat > SEATED

    @property
    def hanging(self) -> Mask:
        """(N,) whether the next foot is in the air."""
        return np.asarray(self.of_foot(self.foot, self.next)[:, 1] - self.level > AIRBORNE)

    def of_foot(self, values: Array, foot: Ints) -> Array:
        """(N, 2, ...) to (N, ...) of one foot each."""
        return np.asarray(values[np.arange(len(foot)), foot])

    def where(self, which: Mask, other: State) -> State:
        """Return these bodies where `which` (N,), the other ones elsewhere."""
        pairs = ((getattr(self, field.name), getattr(other, field.name)) for field in fields(State))
        return State(*(np.where(which.reshape(-1, *(1 for _ in a.shape[1:])), a, b) for a, b in pairs))


@dataclass(frozen=True)
class Style:
    """What differs between bodies. gait (N, 1 + 2 HARMONICS, CHANNELS); stance (N, CHANNELS); seats (H, CHANNELS) as
    `seat_table` gives them; sway (T, CHANNELS) and the frame of it (N,) at which each body is."""

    gait: Array
    stance: Array
    seats: Array
    sway: Array
    frame: Ints
    tempo: Array
    swings: Array
    """(N, 3) by which the pelvis' swings to the side, ahead and up exceed those of the average walker."""
    roll: Array
    """(N,) the same of the feet's pitch and height."""
    width: Array
    """(N,) metres by which the feet are further apart."""
    riser: Array
    """(N,) 0 to 1: where on the treads of stairs the feet stand."""

    def later(self, frames: int) -> Style:
        return replace(self, frame=self.frame + frames)


# -- the plan of a chunk -----------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class StepPlan:
    """Where a chunk ends, all (N,) unless said otherwise.

    end, velocity (N, 2): hips over the floor; yaw, yaw_rate; level: of the floor; height: of the pelvis above it; rise:
    velocity of that; seat: as in State; ahead: displacement along the facing; flow: 0 to 1, how much the second foot
    still hangs; base (N, 2): the point about which the feet come to stand; first: the foot that lands first; wrong: the
    other foot hangs, and must come down before the first one may leave. speed: over the floor, m/s. stride: goes on
    walking, in steps of its own time.
    """

    end: Array
    velocity: Array
    yaw: Array
    yaw_rate: Array
    level: Array
    height: Array
    rise: Array
    seat: Array
    ahead: Array
    flow: Array
    base: Array
    first: Ints
    wrong: Mask
    speed: Array
    stride: Mask

    @property
    def sits(self) -> Mask:
        return self.seat > SEATED

    @property
    def root(self) -> Array:
        """(N, 3) pelvis at the end."""
        return raised(self.end, self.level + self.height)

    @property
    def facing(self) -> Array:
        return np.stack([np.sin(self.yaw), np.cos(self.yaw)], -1)


def seat_depth(height: Array) -> Array:
    """How far behind the feet a pelvis of this height sits (N,), metres: shins about upright, less for a high perch."""
    heights = [0.2, 0.35, 0.5, 0.6, 0.7, 0.8, STAND]
    return np.asarray(np.interp(height, heights, [0.42, 0.43, 0.41, 0.36, 0.29, 0.2, 0.0]))


def plan(state: State, c: Commands) -> StepPlan:
    """Return what the commands ask of the bodies in this state."""
    step, seat, height = _displacement(state, c)
    x, z = step.T
    yaw, stair = np.nan_to_num(c.yaw), c.rise
    # Steps that lead sideways or round on the spot open and close the feet; crossing them would tie the legs in a knot.
    tight = c.does("stride") & (np.abs(x) / 0.15 + np.abs(yaw) / 0.4 > 0.6 + np.abs(z) / 0.18)
    shuffle = tight | c.does("shuffle")
    strides = c.does("stride") & ~shuffle
    flow = np.where(strides, smoothstep((np.abs(z) - 0.02) / 0.25), 0.0)
    end = floor(state.root) + turned(step, state.yaw)
    base = end + turned(np.stack([np.zeros_like(seat), seat], -1), state.yaw + yaw)
    first = _first_foot(state, c, step, yaw, shuffle)
    speed = np.linalg.norm(step, axis=-1) / SECONDS
    stride = _goes_on(state, c, step, yaw, flow)
    return StepPlan(
        end=end,
        velocity=turned(_exit_velocity(state, c, step, yaw, strides, tight), state.yaw),
        yaw=state.yaw + yaw,
        yaw_rate=yaw * np.where(tight, 0.2, c.gait["turn_exit"]),
        level=state.level + stair,
        height=np.where(stride, gait.pelvis_height(speed), height),
        rise=stair * np.where(stair > 0, 0.5, 0.45),
        seat=seat,
        ahead=z,
        flow=flow,
        base=base,
        first=first,
        wrong=(first != state.next) & state.hanging,
        speed=speed,
        stride=stride,
    )


def _goes_on(state: State, c: Commands, step: Array, yaw: Array, flow: Array) -> Mask:
    """(N,) who walks and is to walk on at about that speed; starting, and all other skills, take two swings a chunk."""
    along = np.sum(turned(floor(state.velocity), -state.yaw) * step, -1)
    level = c.does("stride") & ~c.stairs & (step[:, 1] > 0)
    near = (along > 0.5 * np.sum(step**2, -1)) & (along < 2.2 * np.sum(step**2, -1))
    return np.asarray(level & (flow > 0.6) & (state.cadence > 0) & near & (np.abs(yaw) < 0.45))


def _displacement(state: State, c: Commands) -> tuple[Array, Array, Array]:
    """Hips' displacement (N, 2) in the body's frame, seat and pelvis height (N,).

    What a command leaves open goes to running out a walk or to standing up from a seat.
    """
    stays = c.stays_seated & state.seated & ~c.sits
    seat = np.select([c.sits, stays], [seat_depth(np.nan_to_num(c.height, nan=STAND)), state.seat], 0.0)
    run_out = np.where(state.seated[:, None], 0.0, COAST * turned(floor(state.velocity), -state.yaw))
    x = np.where(np.isnan(c.x), run_out[:, 0], c.x)
    z = np.where(np.isnan(c.z), run_out[:, 1] + state.seat - seat, c.z)
    # On stairs a walker's pelvis stays as low as it is, so that it rises by the height of the step.
    low = np.where(state.seated, STAND, np.clip(state.height, 0.8, STAND))
    held = state.root[:, 1] - state.level
    height = np.select([c.sits, stays, c.stairs], [c.height, held, low], STAND)
    return np.stack([x, z], -1), seat, height


def _exit_velocity(state: State, c: Commands, step: Array, yaw: Array, strides: Mask, tight: Mask) -> Array:
    """(N, 2) in the frame of the start.

    A steady arc is tangent half a turn away from its chord. Who speeds up ends above the mean velocity.
    """
    chord = turned(step, yaw / 2)
    gain = 0.25 * (chord - turned(turned(floor(state.velocity), -state.yaw), yaw))
    limit = 0.3 * np.linalg.norm(step, axis=-1) / np.maximum(np.linalg.norm(gain, axis=-1), 1e-9)
    share = np.where(tight, 0.3, c.gait["exit"])[:, None]
    return np.asarray(share * (chord + np.where(strides, np.minimum(limit, 1.0), 0.0)[:, None] * gain))


def _first_foot(state: State, c: Commands, step: Array, yaw: Array, shuffle: Mask) -> Ints:
    """Return the foot that hangs, or the one of two standing ones that has further to go; but sideways and round the
    one on that side.

    A history tells of no more than where the feet are. Were it chance which of them goes first, a model of few steps
    would set out with the average of the two, and both would slide.
    """
    push = np.where(c.does("settle"), 0.0, step[:, 0] / 0.1 + yaw / 0.4)
    sided = (shuffle & (np.abs(push) > 0.3)) | (~state.hanging & (np.abs(push) > 0.8))
    left_ahead = turned(floor(state.foot[:, 0] - state.foot[:, 1]), -state.yaw)[:, 1] * np.sign(step[:, 1])
    apart = ~state.hanging & (np.abs(left_ahead) > LEVEL_FEET)
    straight = np.where(apart, np.where(left_ahead > 0, 1, 0), state.next)
    return np.where(sided, np.where(push > 0, 0, 1), straight).astype(int)


def hip_path(state: State, p: StepPlan) -> tuple[Array, Array]:
    """(N, 16, 3) pelvis and (N, 16) yaw on the way to the plan's end, before the legs have had their say about the
    height."""
    end_velocity = raised(p.velocity, p.rise)
    at = [value[:, None] for value in (state.root, state.velocity, np.zeros_like(state.root), p.root, end_velocity)]
    turn = [value[:, None] for value in (state.yaw, state.yaw_rate, np.zeros_like(state.yaw), p.yaw, p.yaw_rate)]
    return quintic(GRID[:, None], *at), quintic(GRID, *turn)


class Steps(NamedTuple):
    """Of `GaitParameters` those of the feet (N,), adapted to the state that a chunk begins in."""

    width: Array
    clearance: Array
    land: Array
    lift: Array
    lift_pitch: Array
    land_pitch: Array


# -- where the feet go -------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Swing:
    """One foot of each body on its way to a new place, all (N, ...).

    foot: left 0, right 1. start, velocity, yaw0, yaw_rate, pitch0, pitch_rate: as the chunk before left it. target,
    yaw1: where it will stand.
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
        """Towards the hips' end, a little behind it the faster they go, and `lag` metres."""
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
        """(N,) 0 to 1: how high this swing is worth lifting."""
        turn = np.clip(np.abs(self.yaw1 - self.yaw0) / 0.5, 0, 0.6)
        return np.clip(np.clip(self.distance / 0.15, 0, 1) + turn, 0, 1)

    def settled(self, tolerance: Array, free: Mask | bool = True) -> Swing:
        """Return a foot that stands where it should, give or take, stays."""
        near = (self.distance < tolerance) & (np.abs(self.yaw1 - self.yaw0) < 0.15)
        stay = near & (np.abs(self.target - self.start)[:, 1] < AIRBORNE) & free
        return replace(
            self, target=np.where(stay[:, None], self.start, self.target), yaw1=np.where(stay, self.yaw0, self.yaw1)
        )


def feet(state: State, p: StepPlan, c: Commands, style: Style, root: Array) -> tuple[Feet, Array]:
    """Both feet over a chunk: the first one lands, then the second one leaves and hangs beside it at the end, or
    stands.

    The second value, (N,), is by how much they clear the edge of a stair by less than 2 cm, metres.
    """
    p = _before_the_riser(state, p, c, style)
    m = _timed(c, p, in_stance=~state.hanging | p.wrong)
    tolerance = np.where(c.does("settle"), 0.08, np.where(state.seated, 0.1, 0.0))
    first = _first_swing(state, p, c, m, root, tolerance)
    second = _second_swing(state, p, c, m, tolerance)
    edge = nosing(p, c, style)
    first, second = (_cleared(state, p, c, edge, track) for track in (first, second))
    lacking = np.maximum(*(clearance_lack(state, p, edge, track, 0.02).max(1) for track in (first, second)))
    left = p.first == 0
    pairs = zip(first, second, strict=True)
    swap = ((left.reshape(-1, *(1 for _ in a.shape[1:])), a, b) for a, b in pairs)
    both = Feet(*(np.stack([np.where(is_left, a, b), np.where(is_left, b, a)], 1) for is_left, a, b in swap))
    return both, np.where(c.stairs, lacking, 0.0)


def _timed(c: Commands, p: StepPlan, in_stance: Mask) -> Steps:
    """Time the steps: a first foot that stands has half a swing more to do; striding feet pass closer than standing
    ones are apart."""
    m = Steps(*(c.gait[name] for name in Steps._fields))
    land = np.select([c.stairs & in_stance, p.wrong, in_stance], [0.5, 0.54, 0.52], m.land)
    lift = np.where(in_stance, np.where(c.rise > 0, 0.55, 0.61), m.lift)
    return m._replace(land=land, lift=lift, width=m.width - c.gait["narrowing"] * p.flow)


def _first_swing(
    state: State, p: StepPlan, c: Commands, m: Steps, root: Array, tolerance: Array
) -> tuple[Array, Array, Array, Array]:
    in_stance = ~state.hanging | p.wrong
    swing = Swing.of(state, p, m, p.first, 0.0)
    stays = swing.settled(tolerance, in_stance)
    moving = stays.distance > 0
    swing = replace(
        swing,
        target=np.where(moving[:, None], _within_reach(swing.target, root, m.land, p), swing.start),
        yaw1=stays.yaw1,
    )
    begin = np.select([p.wrong, in_stance], [0.14, 0.02], 0.0)
    span = m.land - begin
    u = (GRID - begin[:, None]) / span[:, None]
    sole = cubic(
        u[..., None], swing.start[:, None], (swing.velocity * span[:, None])[:, None], swing.target[:, None], 0.0
    )
    # What is left of the hanging foot's height goes last: it still has ground to cover.
    held = (swing.start[:, 1] - state.level)[:, None] * (1 - smoother(u) ** 2)
    arc = m.clearance * np.where(in_stance, swing.effort, 0.3 * c.stairs)
    line = _stair(u, state.level, p.level) + held
    # Whoever hangs above the next tread already only sinks.
    above = np.maximum(swing.start[:, 1] - p.level, 0.0)[:, None] * (1 - smoother(u) ** 2)
    sinks = (c.rise > 0) & (swing.start[:, 1] > p.level)
    line = np.where(sinks[:, None], p.level[:, None] + above, line)
    sole[..., 1] = line + arc[:, None] * bump(np.clip(u, 0, 1) ** 0.8)
    yaw = cubic(u, swing.yaw0[:, None], (swing.yaw_rate * span)[:, None], swing.yaw1[:, None], 0.0)
    return sole, yaw, _landing_pitch(swing, p, m, u, in_stance, moving), np.zeros_like(yaw)


def _within_reach(target: Array, root: Array, land: Array | float, p: StepPlan) -> Array:
    """While the hips speed up they lag behind a steady stride's: the foot lands as far ahead as a leg goes."""
    frame = np.clip(np.round(np.asarray(land) * FUTURE).astype(int), 0, FUTURE)
    hips = floor(root[np.arange(len(frame)), frame])
    gap = turned(floor(target) - hips, -p.yaw)
    gap[:, 0] = np.clip(gap[:, 0], -0.42, 0.42)
    gap[:, 1] = np.clip(gap[:, 1], -0.36, np.where(p.sits, 9.0, 0.4))  # a sitter's feet are far ahead of the hips
    return raised(hips + turned(gap, p.yaw), target[:, 1])


def _stair(u: Array, level0: Array, level1: Array) -> Array:
    """(N, 16) the ground line under a swing: it rises early and falls late, because that is where the tread's nose
    is."""
    u = np.clip(u, 0, 1)
    ease = smoother(np.where((level1 > level0)[:, None], u / 0.85, (u - 0.12) / 0.88))
    return np.asarray(level0[:, None] + (level1 - level0)[:, None] * ease)


def nosing(p: StepPlan, c: Commands, style: Style) -> Array:
    """(N,) where the edge between the two treads of this chunk lies, metres along the facing from the base of the feet.

    Upstairs the toes of who stands keep 5 to 15 cm from the next riser; on shallow treads the heels hang over the edge.
    Downstairs the heel of who lands keeps 4 cm and more from the riser behind it.
    """
    ankle = -0.02 - 0.1 * np.abs(p.ahead) * p.flow
    up = np.maximum(p.ahead - 0.25 - 0.1 * style.riser, -0.06)
    down = 0.1 + style.riser * np.maximum(p.ahead - 0.24, 0.02)
    return np.asarray(ankle - np.where(c.rise > 0, up, down))


def _before_the_riser(state: State, p: StepPlan, c: Commands, style: Style) -> StepPlan:
    """Return the plan with the feet going further where one of them is past the riser that the step would have."""
    toes = np.max(np.sum(floor(state.foot) * p.facing[:, None], -1), -1) + 0.22
    past = toes - (np.sum(p.base * p.facing, -1) + nosing(p, c, style))
    further = np.where((c.rise > 0) & ~state.seated, np.clip(past, 0.0, 0.16), 0.0)
    return replace(p, base=p.base + further[:, None] * p.facing)


NOSE: Final = 0.025
"""By how much every point of a swinging foot clears the edge of a tread, metres."""


def _cleared(
    state: State, p: StepPlan, c: Commands, edge: Array, track: tuple[Array, Array, Array, Array]
) -> tuple[Array, Array, Array, Array]:
    """Return the track of a foot, lifted where it would cut the edge of a tread."""
    sole, yaw, pitch, bend = track
    lack = clearance_lack(state, p, edge, track, NOSE) * (smoothstep(GRID / 0.2) * c.stairs[:, None])
    moving = np.abs(np.diff(sole, axis=1, append=sole[:, -1:])).sum(-1) > 1e-4
    moving[:, -1] = moving[:, -2]
    kernel = np.hanning(7)[1:-1] / np.hanning(7)[1:-1].sum()
    wide = np.lib.stride_tricks.sliding_window_view(
        np.pad(lack * moving, ((0, 0), (4, 4)), mode="edge"), 5, axis=1
    ).max(-1)
    raised_by = np.lib.stride_tricks.sliding_window_view(wide, 5, axis=1) @ kernel
    sole = sole.copy()
    sole[..., 1] += raised_by * smoothstep(GRID / 0.15)
    return sole, yaw, pitch, bend


def clearance_lack(
    state: State, p: StepPlan, edge: Array, track: tuple[Array, Array, Array, Array], margin: float
) -> Array:
    """(N, 16) metres by which heel or toes are lower than `margin` above the upper tread where they are over it."""
    sole, yaw, pitch, _ = track
    ankle = ik.ankle_over(sole, yaw, pitch)
    orientation = ik.foot_orientation(yaw, pitch)
    up = (p.level > state.level)[:, None]
    top = np.maximum(p.level, state.level)[:, None]
    nose = (np.sum(p.base * p.facing, -1) + edge)[:, None]
    # Next to where it stands before or after, a foot is on its way to or from the tread itself.
    away = np.minimum(*(np.linalg.norm(floor(sole - sole[:, at, None]), axis=-1) for at in (0, -1)))
    tread = top + margin * np.clip(away / 0.08, 0.0, 1.0)
    lacks = []
    for point in ik.SOLE_POINTS:
        place = ankle + orientation @ point
        ahead = np.sum(floor(place) * p.facing[:, None], -1) - nose
        lacks.append(np.where(np.where(up, ahead > 0.0, ahead < 0.0), tread - place[..., 1], 0.0))
    return np.asarray(np.maximum(np.max(lacks, axis=0), 0.0))


def _landing_pitch(swing: Swing, p: StepPlan, m: Steps, u: Array, in_stance: Mask, moving: Mask) -> Array:
    """(N, 16) heel pitch: to what it is at the landing, then flat."""
    along = np.where(in_stance, 0.8 * np.sum(swing.travel * p.facing, -1), p.ahead)
    land = (m.land_pitch * np.clip(np.abs(along), 0, 0.75) * moving)[:, None]
    touch = np.asarray(m.land - 0.05)[:, None]
    swung = cubic(GRID / touch, swing.pitch0[:, None], swing.pitch_rate[:, None] * touch, land, 0.0)
    kick = np.where(in_stance, 0.8 * m.lift_pitch * np.clip(swing.distance, 0, 0.6), 0.0)
    swung = swung + kick[:, None] * bump(1.15 * u)
    return np.where(touch < GRID, land * (1 - smoothstep((GRID - touch) / 0.2)), swung)


def _second_swing(
    state: State, p: StepPlan, c: Commands, m: Steps, tolerance: Array
) -> tuple[Array, Array, Array, Array]:
    lag = 0.03 * (1 - p.flow) * ~p.sits
    swing = Swing.of(state, p, m, 1 - p.first, lag)
    came = swing
    touch = raised(floor(swing.start + 0.06 * swing.velocity), state.level)
    hangs = swing.start[:, 1] - state.level > AIRBORNE
    swing = replace(swing, start=np.where(hangs[:, None], touch, swing.start)).settled(tolerance)
    down = 0.2  # of the chunk, in which a hanging foot that is not to go first comes down
    landing = cubic(GRID[:, None] / down, came.start[:, None], came.velocity[:, None] * down, swing.start[:, None], 0.0)
    u = (GRID - np.asarray(m.lift)[:, None]) / (1 - np.asarray(m.lift))[:, None]
    leave = raised(
        1.5 * p.flow[:, None] * swing.travel, np.zeros(1)
    )  # from which the next swing goes on without a jolt
    sole = cubic(u[..., None], swing.start[:, None], 0.0, swing.target[:, None], leave[:, None])
    sole[..., 1] = _stair(u, state.level, p.level) + _lift(state, p, c, m, swing, u)
    sole = np.where((u > 0)[..., None], sole, landing)
    rest = cubic(GRID / down, swing.yaw0[:, None], swing.yaw_rate[:, None] * down, swing.yaw0[:, None], 0.0)
    yaw = np.where(u > 0, cubic(u, swing.yaw0[:, None], 0.0, swing.yaw1[:, None], 0.0), rest)
    return sole, yaw, *_leaving_pitch(swing, p, m, down)


def _lift(state: State, p: StepPlan, c: Commands, m: Steps, swing: Swing, u: Array) -> Array:
    """(N, 16) height above the ground line: what hangs at the end, and an arc on the way there."""
    # On stairs the foot that passes is on its way over an edge.
    drop = np.where(p.level > state.level, 0.45, 0.6) * np.abs(p.level - state.level)
    arc = np.select([c.rise > 0, c.rise < 0], [np.full_like(p.flow, 0.4), np.zeros_like(p.flow)], 1 - p.flow)
    hang = (m.clearance + drop) * p.flow
    return np.asarray(hang[:, None] * smoothstep(1.3 * u) + (m.clearance * swing.effort * arc)[:, None] * bump(u))


def _leaving_pitch(swing: Swing, p: StepPlan, m: Steps, down: float) -> tuple[Array, Array]:
    """(N, 16) heel pitch and toe bend: the heel rises behind the hips, peaks as the toes leave, sinks in the swing."""
    backwards = np.sum(swing.travel * p.facing, -1) < -0.05
    peak = (m.lift_pitch * np.clip(swing.distance, 0, 0.7) * np.where(backwards, -0.35, 1.0))[:, None]
    rise, top = 0.28, np.asarray(m.lift + 0.08)[:, None]
    heel = peak * smoothstep((GRID - rise) / (top - rise))
    hang, slope = 0.24 * p.flow[:, None] * peak, -2.0 * p.flow[:, None] * peak
    fall = cubic((GRID - top) / (1 - top), peak, 0.0, hang, slope * (1 - top))
    before = cubic(GRID / down, swing.pitch0[:, None], swing.pitch_rate[:, None] * down, np.zeros((1, 1)), 0.0)
    bend = np.maximum(heel, 0.0) * np.where(top < GRID, 1 - smoothstep((GRID - top) / 0.25), 1.0)
    return before + np.where(top < GRID, fall, heel), bend


def cycle(state: State, p: StepPlan, style: Style) -> gait.Cycle:
    """Return the step cycle of who strides; of everybody else what is left of it fades at its own rate."""
    end_rate = np.where(p.stride, style.tempo * gait.cadence(p.speed), state.cadence)
    rate = np.maximum(state.cadence, 0.5)
    return gait.Cycle.of(state.phase, rate, np.maximum(end_rate, 0.5), p.speed)


def striding_feet(state: State, p: StepPlan, style: Style, steps: gait.Cycle, root: Array, yaw: Array) -> Feet:
    """Both feet of who strides: each swings in its own time to where the hips will be when the other one passes it."""
    whose = np.stack([gait.foot_of(steps.first), gait.foot_of(steps.first + 1)], 1)
    feet = [_striding_foot(foot, state, p, style, steps, root, yaw, whose) for foot in (0, 1)]
    return Feet(*(np.stack(pair, 1) for pair in zip(*feet, strict=True)))


def _striding_foot(
    foot: int, state: State, p: StepPlan, style: Style, steps: gait.Cycle, root: Array, yaw: Array, whose: Ints
) -> tuple[Array, Array, Array, Array]:
    passing = steps.first + (whose[:, 1] == foot)
    path = np.concatenate([floor(root), yaw[..., None]], -1)
    velocity = np.concatenate([p.velocity, p.yaw_rate[:, None]], -1)
    over = gait.reached(steps, path, velocity, passing + 1.0)
    left = 1.0 if foot == 0 else -1.0
    aside = np.stack([left * (0.05 + style.width), -0.03 - 0.045 * p.speed], -1)
    target = np.concatenate([over[:, :2] + turned(aside, over[:, 2]), over[:, 2:] + left * TOE_OUT], -1)
    value = np.concatenate([floor(state.foot[:, foot]), state.foot_yaw[:, foot, None]], -1)
    rate = np.concatenate([floor(state.foot_velocity[:, foot]), state.foot_yaw_rate[:, foot, None]], -1)
    track = gait.swung(steps, passing, gait.Leg(value, rate), target)
    high = 0.07 * style.roll * np.clip(0.6 + 0.35 * p.speed, 0.6, 1.2)
    height = high[:, None] * gait.swing_height(steps.progress(passing))
    height = gait.settled(state.foot[:, foot, 1] - state.level, state.foot_velocity[:, foot, 1], height, 0.4)
    pitch = style.roll[:, None] * gait.pitch(steps.since(foot), p.speed[:, None])
    pitch = gait.settled(state.foot_pitch[:, foot], state.foot_pitch_rate[:, foot], pitch)
    bend = np.maximum(pitch, 0.0) * (1 - smoothstep((steps.since(foot) + gait.LIFT) / 0.25))
    return raised(track[..., :2], state.level[:, None] + np.maximum(height, 0.0)), track[..., 2], pitch, bend


def swaying(state: State, p: StepPlan, style: Style, steps: gait.Cycle, root: Array, yaw: Array) -> tuple[Array, Array]:
    """Return the path (N, 16, 3) with the pelvis swinging about it, and the amplitudes (N, 3) at the end.

    Where a chunk begins and ends the pelvis is where its command has it; between the two it goes over the standing
    foot.
    """
    last = np.where(p.stride[:, None], gait.amplitudes(p.speed) * style.swings, 0.0)
    size = state.sway[:, None] + (last - state.sway)[:, None] * smoother(GRID)[:, None]
    swing = size * gait.pelvis(steps.phase)
    flat = turned(gait.pinned(swing[..., :2]), yaw)
    return root + raised(flat, swing[..., 2]), last


# -- the upper body ----------------------------------------------------------------------------------------------------
def pose_targets(state: State, p: StepPlan, c: Commands, style: Style, steps: gait.Cycle) -> Array:
    """(N, 16, CHANNELS) what the skill wants of pelvis tilt, spine, head and arms."""
    # Who turns on the spot swings the arms as who walks slowly does.
    pace = np.hypot(p.speed, 0.35 * (p.yaw - state.yaw) / SECONDS)
    amplitude = (c.gait["arms"] * np.clip(pace / 1.15, 0, 1.3))[:, None, None]
    direction = np.where(c.does("stride") & (p.ahead < -0.02), -1.0, 1.0)[
        :, None
    ]  # who walks backwards goes through the same poses in reverse
    phase = np.where(p.stride[:, None], steps.phase, (1 - p.first)[:, None] + direction * GRID)
    walk = augment.basis(phase) @ style.gait
    walk[..., 2] = gait.pinned(walk[..., 2])
    mean, stance = style.gait[:, :1], style.stance[:, None]
    sway = style.sway[_to_and_fro(style.frame[:, None] + np.arange(FUTURE + 1), len(style.sway))]
    # The mean posture follows the speed up to that of the clips; the swing about it goes on growing.
    still = 1 - np.minimum(amplitude, 1.0)
    standing = stance + (1 - still) * (mean - stance) + amplitude * (walk - mean) + 0.6 * still * sway
    target = np.where(p.sits[:, None, None], _seat_pose(style.seats, p.height)[:, None] + 0.5 * sway, standing)
    target = _bent(target, {"pelvis": 0.5, "spine1": 0.5, "neck": -0.5, "head": -0.5}, 0, c.gait["lean"][:, None])
    return _bent(target, {"neck": 0.5, "head": 0.5}, 0, c.gait["gaze_pitch"][:, None])


def _bent(values: Array, shares: Mapping[str, float], axis: int, angle: Array) -> Array:
    """(N, 16, CHANNELS) with an angle (N, 16) about one axis shared out to joints."""
    values = values.copy()
    for joint, share in shares.items():
        values[..., 0 if joint == "pelvis" else channel(joint, axis)] += share * angle
    return values


def _to_and_fro(index: Ints, length: int) -> Ints:
    index = index % (2 * length - 2)
    return np.where(index < length, index, 2 * length - 2 - index)


def upper_body(state: State, p: StepPlan, c: Commands, target: Array) -> Array:
    """(N, 16, CHANNELS): the targets, reached from the present pose and its rate without a jolt, and what the hips
    demand."""
    gap = (state.pose - target[:, 0])[:, None]
    rate = (state.pose_rate - (target[:, 1] - target[:, 0]) * FUTURE)[:, None]
    span = np.where(p.sits | state.seated, 1.0, 0.85)[:, None, None]
    zero = np.zeros_like(gap)
    values = target + quintic(np.minimum(GRID[:, None] / span, 1.0), gap, rate * span, zero, zero, zero)
    # Sitting down and rising the trunk leans forward, which keeps the weight over the feet; the eyes stay up.
    change = np.abs(p.height - (state.root[:, 1] - state.level))
    lean = np.clip(change, 0, 0.6) * np.where(p.seat > state.seat, 1.1, 0.935)
    shares = {"pelvis": 0.6, "spine1": 0.25, "spine2": 0.2, "neck": -0.2, "head": -0.35}
    values = _bent(values, shares, 0, lean[:, None] * bump(GRID))
    # A turn begins with the head.
    turn = c.gait["gaze_turn"] * (p.yaw - state.yaw)
    shares = {"spine2": 0.05, "spine3": 0.08, "neck": 0.1, "head": 0.12}
    return _bent(values, shares, 1, turn[:, None] * bump(1.1 * GRID))


_SEATS: Final = np.linspace(0.2, 0.8, 13)


def _seat_pose(seats: Array, height: Array) -> Array:
    """(N, CHANNELS) interpolated for pelvis heights (N,)."""
    place = np.clip((height - _SEATS[0]) / (_SEATS[1] - _SEATS[0]), 0, len(_SEATS) - 1.001)
    low = place.astype(int)
    share = (place - low)[:, None]
    return np.asarray(seats[low] * (1 - share) + seats[low + 1] * share)


def seat_table(stance: Array) -> Array:
    """(13, CHANNELS) seated poses for pelvis heights 0.20 to 0.80 m: upright, a slack back, the hands on the thighs."""
    low = np.clip((0.62 - _SEATS) / 0.42, 0, 1)
    pose = np.repeat(stance[None], len(_SEATS), 0)
    pose[:, 0] = -0.16 - 0.1 * low
    for joint, amount, more in (
        ("spine1", 0.16, 0.1), ("spine2", 0.12, 0.1), ("spine3", 0.04, 0.1), ("neck", -0.06, -0.12), ("head", -0.12,
        -0.12)
    ):  # fmt: skip
        pose[:, channel(joint)] += amount + more * low
    rotations = np.zeros((len(_SEATS), N_JOINTS, 3))
    rotations[:, 0, 0], rotations[:, UPPER] = pose[:, 0], pose[:, 3:].reshape(len(_SEATS), -1, 3)
    position, orientation = forward_kinematics(_SEATS[:, None] * [0.0, 1.0, 0.0], rotations)
    for side, sign in (("left", 1.0), ("right", -1.0)):
        hip, shoulder = (position[:, JOINT_INDEX[f"{side}_{joint}"]] for joint in ("hip", "shoulder"))
        ankle = np.stack([np.full_like(low, sign * 0.09), np.full_like(low, SOLE), seat_depth(_SEATS) - 0.02], -1)
        thigh, _ = solve(Limb.leg(side), hip, ankle, np.array([sign * 0.12, 0.35, 0.94]))
        wrist = hip + thigh @ np.array([0.0, -0.27, 0.085]) - [0.0, 0.0, 0.03]
        upper, fore = solve(Limb.arm(side), shoulder, wrist, np.array([sign * 0.6, -0.5, -0.8]))
        for joint, parent, own in (
            ("shoulder", orientation[:, JOINT_INDEX[f"{side}_collar"]], upper),
            ("elbow", upper, fore),
        ):
            at = channel(f"{side}_{joint}")
            pose[:, at : at + 3] = to_vector(np.swapaxes(parent, -1, -2) @ own)
    return pose


# -- one chunk ---------------------------------------------------------------------------------------------------------
def advance(state: State, c: Commands, style: Style) -> tuple[State, Array, Array]:
    """One chunk: the state at its end, root (N, 15, 3) and rotations (N, 15, 24, 3)."""
    p = plan(state, c)
    steps = cycle(state, p, style)
    path, yaw = hip_path(state, p)
    stand, lacking = _feet(state, p, c, style, steps, path, yaw)
    values = upper_body(state, p, c, pose_targets(state, p, c, style, steps))
    pelvis = pelvis_orientation(yaw, values[..., :3])
    root, sway = swaying(state, p, style, steps, _bobbing(path, p, c), yaw)
    may_lift = _may_lift(p, steps)
    root = _lowered(root, ik.ceiling(root, pelvis, stand, may_lift), p.stride)
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
    """(N, 2, 16) by how much a heel may rise where its leg would not reach: that of the foot that is left behind."""
    second = np.arange(2) == (1 - p.first)[:, None]
    two_swings = np.where(second[..., None], bump(1.05 * GRID), 0.0)
    behind = np.stack([bump((steps.since(foot) + 0.9) / 0.7) for foot in (0, 1)], 1)
    return 0.5 * np.where(p.stride[:, None, None], behind, two_swings)


def pelvis_orientation(yaw: Array, tilt: Array) -> Array:
    """yaw (...) and pitch, roll, extra yaw (..., 3) to (..., 3, 3): Ry Rz Rx, which keeps the hip line's heading
    exact."""
    vector = np.zeros((*yaw.shape, 3, 3))
    vector[..., 0, 1], vector[..., 1, 2], vector[..., 2, 0] = yaw + tilt[..., 2], tilt[..., 1], tilt[..., 0]
    matrix = matrix_from_vector(vector)
    return np.asarray(matrix[..., 0, :, :] @ matrix[..., 1, :, :] @ matrix[..., 2, :, :])


def _bobbing(root: Array, p: StepPlan, c: Commands) -> Array:
    """Between two passings of the feet the hips sink, as over the two legs of a pair of compasses."""
    stride = np.clip(np.abs(p.ahead) / 0.62, 0, 1.2) * (c.does("stride") & ~c.stairs & ~p.stride)
    sunk = root.copy()
    sunk[..., 1] -= (0.022 * stride**2 * p.flow)[:, None] * np.sin(np.pi * GRID) ** 2
    return sunk


def _lowered(root: Array, ceiling: Array, stride: Mask) -> Array:
    """Return the path kept below its ceiling: one round dip at the tightest moment, then a soft minimum for what is
    left."""
    height = root[..., 1]
    need = (height - ceiling + 0.006 * bump(GRID)) * (bump(GRID) > 0.2)
    skew = np.log(0.5) / np.log(np.clip(GRID[need.argmax(1)], 0.4, 0.65))
    dip = np.maximum(need.max(1), 0.0)[:, None] * bump(GRID ** skew[:, None])
    lowered = root.copy()
    dipped = np.where(stride[:, None], height, height - dip)
    width = np.where(stride[:, None], 0.012, 0.004 + 0.02 * bump(GRID))
    lowered[..., 1] = soft_minimum(dipped, ceiling, width)
    return lowered


def _ended(
    p: StepPlan, stand: Feet, values: Array, steps: gait.Cycle, sway: Array, height: Array, lacking: Array
) -> State:
    """Return the state that the next chunk starts from; only a foot in the air has a velocity."""
    phase = np.where(p.stride, steps.phase[:, -1] % 2, p.first)
    progress = steps.progress(np.ceil(phase - gait.LAND).astype(int))[:, -1]
    passing = np.ceil(phase - gait.LAND) + (progress > 0.92)  # a foot that is about to land has landed
    next_foot = np.where(p.stride, gait.foot_of(passing.astype(int)), 1 - p.first)
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
    """Return the mean gait with a share of one walker's own, and gait parameters that differ as people do."""
    which = rng.integers(1, len(profiles.gait), n)
    own = rng.uniform(0.0, 0.9, n)[:, None, None]
    gaits = profiles.gait[0] + own * (profiles.gait[which] - profiles.gait[0])
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
    """Return the pose with neck and head bent so that the eyes look `down` radians below the horizon: the camera is in
    the head."""
    pose = pose.copy()
    missing = down - pose[..., [0, *(channel(joint) for joint in ("spine1", "spine2", "spine3", "neck", "head"))]].sum(
        -1
    )
    pose[..., channel("neck")] += 0.4 * missing
    pose[..., channel("head")] += 0.6 * missing
    return pose


def play(
    profiles: Profiles, series: Sequence[Commands], rng: np.random.Generator, rested: float = 0.0
) -> tuple[Array, Array, Array]:
    """Root (N, 5 + 15 K, 3), rotations (N, 5 + 15 K, 24, 3) and lacking (N, K) of N bodies that carry out K commands
    each.

    They begin in a quiet stance, a share `rested` of them in `rest_pose`.
    """
    n = len(series[0].yaw)
    style = _style(profiles, n, rng)
    next_foot = rng.integers(0, 2, n)
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


def synthesize(clips: Sequence[RealClip] | Profiles, commands: Sequence[Command], seed: int) -> Motion:
    """One body that stands for 5 frames and then carries out the commands, 15 frames each: 5 + 15 K frames at 30 fps.

    clips: real clips, or the profiles measured on them. commands: (skill, parameters), the parameters in SI by their
    names behind the contract. What a command asks for is what its measures say, but for a stair straight out of a seat,
    where the pelvis rises by both. Raises HumanclawError for unknown parameters and skills without gait.
    """
    profiles = clips if isinstance(clips, Profiles) else Profiles.of(clips)
    root, rotations, _ = play(profiles, [Commands.of([command]) for command in commands], np.random.default_rng(seed))
    return Motion(root[0], rotations[0])
