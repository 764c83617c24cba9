"""Hold standing feet still, after Kovar, Schreiner and Gleicher (2002).

A small model lets a standing foot creep by a few millimetres a frame. Here each stance (a foot whose toes hardly move)
is held at one point with a level sole, and the leg follows by two-bone inverse kinematics. The pelvis, and with it the
outcome of the skill, stays. A stance that began in the history is held where the history has it, so that errors do not
add up. A foot on its way first gives way to the other one, and knees swivel apart, so that legs do not pass through
each other. No shoe is below the floor or drags over it, and never do both hover: in half-physics the one would push the
whole body up, and the other would let it fall.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from humanclaw.body.ik import REACH, SIDES, TOE_BASE, Limb, bent
from humanclaw.body.limits import shoe_heights
from humanclaw.body.pose import (
    FPS,
    HISTORY,
    Array,
    Motion,
    forward_kinematics,
    matrix_from_vector,
    smoothstep,
    vector_from_matrix,
    yaw_matrix,
)
from humanclaw.body.skeleton import TOE_SOLE
from humanclaw.motion.leg_collision_avoidance import SHOE, TOES, apart, knees_apart, widened
from humanclaw.motion.leg_ik import ANKLES, FEET, LEG_JOINTS

_SLOW: Final = 0.25
"""Metres a second below which a toe counts as standing."""
_FADE: Final = 5
"""Frames over which a correction fades in and out."""
_GIVES: Final = 2
"""Frames in which a foot begins to give way to the other one."""
_SETTLE: Final = 8
"""Frames in which a tilted foot of the history is laid level."""
_FLAT: Final = 0.30
"""Radians. A foot tilted further stands on its toes or heel on purpose."""
_STEP: Final = 0.03
"""Metres. A stance this close to the chunk's floor stands on it; a higher one stands on a stair."""
_STAIR: Final = 0.05
"""Metres that no shoe sinks into a floor or hovers over it. Stairs go further down or up."""
_CLEARS, _STANDS, _SWINGS = 0.006, 0.3, 1.3
"""Metres over the floor at which a shoe swings: between two frames it comes up to 2 mm lower. It swings by as much
as it is faster than the other one: not at the first of two speeds, m/s, and fully at the second."""
_LEAST: Final = 3
"""Frames of the shortest stance."""


@dataclass(frozen=True)
class _Stance:
    """Frames start to stop in which a foot stands; `held` when it did already at the end of the history."""

    start: int
    stop: int
    held: bool


def lock_feet(history: Motion, future: Motion) -> Motion:
    """Return the future with its standing feet held still. Both in the canonical frame of the chunk (floor of the
    history at 0)."""
    whole = history.then(future)
    positions, turns = forward_kinematics(whole.root, whole.rotations)
    soles = shoe_heights(positions, turns)
    # A heel or a toe tip may be lower than the soles that the canonical frame stands on.
    floor = soles[:HISTORY].min()
    positions[..., 1] -= floor
    stances = [_stances(positions[:, toe]) for toe in FEET]
    turned = [_laid(own, turns[:, ankle]) for own, ankle in zip(stances, ANKLES, strict=True)]
    swung = _parted(positions, turned, stances, soles - floor)
    feet = [
        (toe + _corrections(own, _holding(own, toe)), turn)
        for own, toe, turn in zip(stances, swung, turned, strict=True)
    ]
    heights = _heights(feet, whole.rotations)
    rise = _on_floor(heights, _swinging(np.stack([toes for toes, _ in feet])))
    for (toes, _), by in zip(feet, rise, strict=True):
        toes[:, 1] += by
    return Motion(future.root, _bent(feet, positions, turns, whole.rotations)[HISTORY:])


def _parted(positions: Array, turned: Sequence[Array], stances: Sequence[list[_Stance]], soles: Array) -> list[Array]:
    """Return the toes of both feet (T, 3), each swinging around the other foot, without change in the history.

    turned: orientations (T, 3, 3) of both feet. soles: (T, 2) heights of the lowest points of both shoes.
    """
    # Of a foot whose toes point straight down, its side alone tells the heading.
    yaw = [np.arctan2(-turn[:, 2, 0], turn[:, 0, 0]) for turn in turned]
    over = (soles - positions[:, ANKLES[::-1], 1]).max(-1)  # The top of a shoe is at its ankle.
    ankles = [positions[:, toe] - turn @ TOE_BASE for toe, turn in zip(FEET, turned, strict=True)]
    # The other foot stays where it stands, however far the model's creeps away.
    stand = [ankle + _holding(own, positions[:, toe]) for ankle, own, toe in zip(ankles, stances, FEET, strict=True)]
    parted = []
    for foot, side in ((0, 1.0), (1, -1.0)):
        shift = apart(ankles[foot], yaw[foot], stand[1 - foot], yaw[1 - foot], side, over)
        size, way = np.linalg.norm(shift, axis=-1), shift.sum(0)
        gives = widened(size) * _begun(len(size), _GIVES)
        # A foot can swing into the other one between the history and the first frame.
        gives[HISTORY] = max(gives[HISTORY], size[HISTORY])
        parted.append(positions[:, FEET[foot]] + gives[:, None] * way / max(np.linalg.norm(way), 1e-9))
    return parted


def _laid(stances: list[_Stance], turn: Array) -> Array:
    """Return the orientations (T, 3, 3) of a foot that is level where it stands. turn: (T, 3, 3) as it is."""
    level = [stance for stance in stances if _level(stance, turn)]
    return matrix_from_vector(_corrections(level, _levelling(level, turn))) @ turn


def _bent(feet: Sequence[tuple[Array, Array]], positions: Array, turns: Array, rotations: Array) -> Array:
    """Return rotations (T, 24, 3) with legs bent so that their feet are where given, and with knees apart.

    feet: toes (T, 3) and orientations (T, 3, 3).
    """
    rotations = rotations.copy()
    bones = [
        bent(Limb.leg(side), positions[:, leg], turns[:, leg[:2]], toes - foot @ TOE_BASE, REACH)
        for side, leg, (toes, foot) in zip(SIDES, LEG_JOINTS, feet, strict=True)
    ]
    hips = np.stack([positions[:, leg[0]] for leg in LEG_JOINTS])
    for leg, (_, foot), (thigh, shin), swivel in zip(LEG_JOINTS, feet, bones, knees_apart(hips, bones), strict=True):
        parts = np.stack([swivel @ thigh, swivel @ shin, foot], 1)
        parents = np.concatenate([turns[:, :1], parts[:, :2]], 1)
        rotations[:, leg] = vector_from_matrix(np.swapaxes(parents, -1, -2) @ parts)
    return rotations


def _heights(feet: Sequence[tuple[Array, Array]], rotations: Array) -> Array:
    """Return the heights of the lowest corners of both shoes (2, T). feet: toes (T, 3) and orientations (T, 3, 3)."""
    bends = matrix_from_vector(rotations[:, FEET])
    return np.stack([_height(*foot, bends[:, index]) for index, foot in enumerate(feet)])


def _swinging(toes: Array) -> Array:
    """Return how much each foot swings (2, T), 0 to 1. toes: (2, T, 3)."""
    speeds = np.linalg.norm(np.gradient(toes[..., [0, 2]], 1 / FPS, axis=1), axis=-1)
    return smoothstep((speeds - speeds[::-1] - _STANDS) / (_SWINGS - _STANDS))


def _on_floor(heights: Array, swinging: Array) -> Array:
    """Return how far each foot must rise (2, T), metres, for no shoe to sink into the floor or drag over it, and none
    to hover while the other does.

    A shoe that goes down a stair may sink, and two that go up one hover. swinging: (2, T), 0 to 1.
    """
    parts = [*np.maximum(_CLEARS * swinging - heights, 0.0), np.maximum(heights.min(0), 0.0)]
    left, right, both = (_gradually(part) if part.max() < _STAIR else np.zeros_like(part) for part in parts)
    return np.stack([left, right]) - both


def _height(toes: Array, foot: Array, bend: Array) -> Array:
    """Return the height of a shoe's lowest corner (T,). toes: (T, 3). foot, bend: (T, 3, 3) of the foot, and of the
    toes in it."""
    parts = ((SHOE, toes - foot @ TOE_BASE, foot), (TOES, toes, foot @ bend))
    lowest = [
        at[:, 1] + turn[:, 1] @ np.array(box.centre) - np.abs(turn[:, 1]) @ np.array(box.half)
        for box, at, turn in parts
    ]
    return np.asarray(np.minimum(*lowest))


def _gradually(gap: Array) -> Array:
    """Return (T,) what is to be made up of a gap (T,), none of it at the end of the history."""
    return np.asarray(np.maximum(gap - gap[HISTORY - 1] * (1 - _begun(len(gap))), 0.0))


def _begun(frames: int, fade: int = _FADE) -> Array:
    """Return (frames,) from 0 at the end of the history to 1, `fade` frames later."""
    return smoothstep((np.arange(frames) - HISTORY + 1) / fade)


def _stances(toe: Array) -> list[_Stance]:
    """Return the stances of a toe (T, 3) that reach into the future."""
    slow = np.linalg.norm(np.diff(toe, axis=0, prepend=toe[:1]), axis=-1) * FPS < _SLOW
    slow[0] = slow[1]
    edges = np.flatnonzero(np.diff(np.concatenate([[False], slow, [False]]).astype(int))).reshape(-1, 2)
    runs = [(max(int(start), HISTORY - 1), int(stop)) for start, stop in edges if stop - start >= _LEAST]
    return [_Stance(start, stop, start == HISTORY - 1) for start, stop in runs if stop > HISTORY]


def _level(stance: _Stance, turn: Array) -> bool:
    """Tell whether a foot is flat for a whole stance. turn: (T, 3, 3)."""
    tilt = np.arccos(np.clip(turn[stance.start : stance.stop, 1, 1], -1.0, 1.0))
    return bool(tilt.max() < _FLAT)


def _holding(stances: list[_Stance], toe: Array) -> Array:
    """(T, 3) displacements that keep the toe of each stance at one point, on the floor if it is close to it."""
    shift = np.zeros_like(toe)
    for stance in stances:
        frames = slice(stance.start, stance.stop)
        point = toe[stance.start] if stance.held else toe[stance.start : stance.start + _LEAST].mean(0)
        target = np.broadcast_to(point, toe[frames].shape).copy()
        if abs(point[1] - TOE_SOLE) < _STEP:
            share = _arrival(stance) if stance.held else 1.0
            target[:, 1] += share * (TOE_SOLE - point[1])
        shift[frames] = target - toe[frames]
    return shift


def _levelling(stances: list[_Stance], turn: Array) -> Array:
    """(T, 3) rotation vectors that lay the foot of each stance flat and keep its heading. turn: (T, 3, 3)."""
    vectors = np.zeros((len(turn), 3))
    for stance in stances:
        frames = slice(stance.start, stance.stop)
        yaws = np.arctan2(turn[frames, 0, 2], turn[frames, 2, 2])
        flat = yaw_matrix(yaws[0] if stance.held else np.unwrap(yaws).mean())
        askew = vector_from_matrix(flat.T @ turn[stance.start]) if stance.held else np.zeros(3)
        wanted = flat @ matrix_from_vector((1 - _arrival(stance))[:, None] * askew)
        vectors[frames] = vector_from_matrix(wanted @ np.swapaxes(turn[frames], -1, -2))
    return vectors


def _arrival(stance: _Stance) -> Array:
    """(stop - start,) from 0 at the end of the history to 1 when a stance under way has come to where it should be."""
    return smoothstep(np.arange(stance.stop - stance.start) / _SETTLE)


def _corrections(stances: list[_Stance], inside: Array) -> Array:
    """(T, 3) corrections of the stances, fading in before them and out after them, and none in the history."""
    total, frames = inside.copy(), np.arange(len(inside))
    bounds = [
        HISTORY - 1,
        *(edge for stance in stances for edge in (stance.start, stance.stop - 1)),
        len(inside) + _FADE,
    ]
    for index, stance in enumerate(stances):
        before, after = stance.start - bounds[2 * index], bounds[2 * index + 3] - (stance.stop - 1)
        rising = smoothstep(1 - (stance.start - frames) / min(max(before, 1), _FADE))
        falling = smoothstep(1 - (frames - stance.stop + 1) / min(max(after, 1), _FADE))
        total += np.where(frames < stance.start, rising, 0.0)[:, None] * inside[stance.start]
        total += np.where(frames >= stance.stop, falling, 0.0)[:, None] * inside[stance.stop - 1]
    total[:HISTORY] = 0
    return total
