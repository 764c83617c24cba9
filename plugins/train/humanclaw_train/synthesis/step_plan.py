"""Plans of chunks: where a command takes hips and feet, given the state that the chunk begins in. Needs only numpy."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from humanclaw.body import Array, smoothstep
from humanclaw_train.synthesis import gait
from humanclaw_train.synthesis.commands import Commands, Ints, Mask
from humanclaw_train.synthesis.curves import GRID, floor, quintic, raised, turned
from humanclaw_train.synthesis.state import SEATED, SECONDS, STAND, State

COAST: Final = 0.2
"""How far the hips go on where no travel is commanded, as a share of one chunk at the current speed."""
OVER_FOOT: Final = 0.03
"""How far to the side the hips of a body on stairs are at the end of a chunk, metres, over the foot that stands."""
LEVEL_FEET: Final = 0.005
"""Distance along the facing, metres, within which standing feet count as level, so that either may go first."""


@dataclass(frozen=True)
class StepPlan:
    """Where a chunk ends. All (N,) unless said otherwise.

    * end, velocity (N, 2): of the hips over the floor, at the end. yaw, yaw_rate.
    * level: height of the floor. height: of the pelvis above it. rise: vertical velocity of the pelvis.
    * seat: as in State. ahead: displacement along the facing. aside: size of that across the mean of the facings.
    * speed: over the floor, m/s.
    * flow: 0 to 1, how far the second foot is still in the air at the end.
    * base (N, 2): the point between the feet when they stand.
    * first: the foot that lands first. wrong: the other foot is in the air and must come down before.
    * stride: whether the body goes on walking, in steps that do not wait for chunks.
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
    aside: Array
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
        """(N, 3) Position of the pelvis at the end."""
        return raised(self.end, self.level + self.height)

    @property
    def facing(self) -> Array:
        return np.stack([np.sin(self.yaw), np.cos(self.yaw)], -1)


def seat_depth(height: Array) -> Array:
    """Return how far behind the feet a seated pelvis of this height is (N,), metres: the shins are about upright."""
    heights = [0.2, 0.35, 0.5, 0.6, 0.7, 0.8, STAND]
    return np.asarray(np.interp(height, heights, [0.42, 0.43, 0.41, 0.36, 0.29, 0.2, 0.0]))


def plan(state: State, c: Commands) -> StepPlan:
    """Turn commands into plans for bodies in this state."""
    step, seat, height = _displacement(state, c)
    x, z = step.T
    yaw, stair = np.nan_to_num(c.yaw), c.rise
    # Steps to the side and turns on the spot open and close the feet: if feet crossed, the legs would collide.
    tight = c.does("stride") & (np.abs(x) / 0.15 + np.abs(yaw) / 0.4 > 0.6 + np.abs(z) / 0.18)
    shuffle = tight | c.does("shuffle")
    strides = c.does("stride") & ~shuffle
    flow = np.where(strides, smoothstep((np.abs(z) - 0.02) / 0.25), 0.0)
    first = _first_foot(state, c, step, yaw, shuffle)
    middle, over = floor(state.root) + turned(step, state.yaw), np.where(_climbs(state, c), OVER_FOOT, 0.0)
    end = middle + turned(np.stack([over * (1.0 - 2.0 * first), np.zeros_like(over)], -1), state.yaw + yaw)
    base = middle + turned(np.stack([np.zeros_like(seat), seat], -1), state.yaw + yaw)
    speed = np.linalg.norm(step, axis=-1) / SECONDS
    aside = np.abs(turned(step, -yaw / 2)[:, 0])
    stride = _goes_on(state, c, step, yaw, flow) & (aside <= 0.15)
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
        aside=aside,
        flow=flow,
        base=base,
        first=first,
        wrong=(first != state.next) & state.hanging,
        speed=speed,
        stride=stride,
    )


def _goes_on(state: State, c: Commands, step: Array, yaw: Array, flow: Array) -> Mask:
    """Return which walking bodies continue at about their speed (N,).

    All other bodies, including those that start to walk, take two swings a chunk.
    """
    along = np.sum(turned(floor(state.velocity), -state.yaw) * step, -1)
    level = c.does("stride") & ~c.stairs & (step[:, 1] > 0)
    near = (along > 0.5 * np.sum(step**2, -1)) & (along < 2.2 * np.sum(step**2, -1))
    return np.asarray(level & (flow > 0.6) & (state.cadence > 0) & near & (np.abs(yaw) <= 0.45))


def _climbs(state: State, c: Commands) -> Mask:
    return np.asarray(c.stairs & ~state.seated)


def _displacement(state: State, c: Commands) -> tuple[Array, Array, Array]:
    """Return the hips' displacement (N, 2) in the body's frame, the seat (N,) and the pelvis height (N,).

    Travel that a command leaves open is used to slow down from a walk or to stand up from a seat; on stairs the hips
    return to the middle between the feet.
    """
    stays = c.stays_seated & state.seated & ~c.sits
    seat = np.select([c.sits, stays], [seat_depth(np.nan_to_num(c.height, nan=STAND)), state.seat], 0.0)
    run_out = np.where(state.seated[:, None], 0.0, COAST * turned(floor(state.velocity), -state.yaw))
    between = turned(floor(state.foot.mean(1) - state.root), -state.yaw)[:, 0]
    x = np.where(np.isnan(c.x), np.where(_climbs(state, c), between, run_out[:, 0]), c.x)
    z = np.where(np.isnan(c.z), run_out[:, 1] + state.seat - seat, c.z)
    # On stairs the pelvis keeps its height above the tread, so that it rises by exactly the height of the step.
    low = np.where(state.seated, STAND, np.clip(state.height, 0.8, STAND))
    held = state.root[:, 1] - state.level
    height = np.select([c.sits, stays, c.stairs], [c.height, held, low], STAND)
    return np.stack([x, z], -1), seat, height


def _exit_velocity(state: State, c: Commands, step: Array, yaw: Array, strides: Mask, tight: Mask) -> Array:
    """Return the velocity of the hips at the end (N, 2), in the frame of the start.

    The tangent of a steady arc differs from its chord by half the turn. A body that speeds up ends above its mean
    velocity. On stairs the hips come to rest to the side.
    """
    chord = turned(step * np.stack([~_climbs(state, c), np.ones(len(yaw))], -1), yaw / 2)
    gain = 0.25 * (chord - turned(turned(floor(state.velocity), -state.yaw), yaw))
    limit = 0.3 * np.linalg.norm(step, axis=-1) / np.maximum(np.linalg.norm(gain, axis=-1), 1e-9)
    share = np.where(tight, 0.3, c.gait["exit"])[:, None]
    return np.asarray(share * (chord + np.where(strides, np.minimum(limit, 1.0), 0.0)[:, None] * gain))


def _first_foot(state: State, c: Commands, step: Array, yaw: Array, shuffle: Mask) -> Ints:
    """Return the foot that moves first (N,).

    That is the foot in the air, or of two standing feet the one with further to go. To the side and in turns it is
    the foot on that side. A history shows only where the feet are. If chance chose the foot, a model with few solver
    steps would learn the average of both, and both feet would slide.
    """
    push = np.where(c.does("settle"), 0.0, step[:, 0] / 0.1 + yaw / 0.4)
    sided = (shuffle & (np.abs(push) > 0.3)) | (~state.hanging & (np.abs(push) > 0.8))
    left_ahead = turned(floor(state.foot[:, 0] - state.foot[:, 1]), -state.yaw)[:, 1] * np.sign(step[:, 1])
    apart = ~state.hanging & (np.abs(left_ahead) > LEVEL_FEET)
    straight = np.where(apart, np.where(left_ahead > 0, 1, 0), state.next)
    return np.where(sided, np.where(push > 0, 0, 1), straight).astype(int)


def hip_path(state: State, p: StepPlan) -> tuple[Array, Array]:
    """Return the path of the pelvis (N, 16, 3) and its yaw (N, 16), before the legs limit the height."""
    end_velocity = raised(p.velocity, p.rise)
    at = [value[:, None] for value in (state.root, state.velocity, np.zeros_like(state.root), p.root, end_velocity)]
    turn = [value[:, None] for value in (state.yaw, state.yaw_rate, np.zeros_like(state.yaw), p.yaw, p.yaw_rate)]
    return quintic(GRID[:, None], *at), quintic(GRID, *turn)
