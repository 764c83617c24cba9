"""Stairs under synthetic feet: the ground line of a swing, and clearance over the edge of a tread. Needs only numpy."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from humanclaw.body import Array, smoothstep
from humanclaw.motion import widened
from humanclaw_train.synthesis import ik
from humanclaw_train.synthesis.commands import Commands
from humanclaw_train.synthesis.curves import GRID, floor, moving, smoother
from humanclaw_train.synthesis.ik import Track
from humanclaw_train.synthesis.state import State, Style
from humanclaw_train.synthesis.step_plan import StepPlan

NOSE: Final = 0.025
"""Clearance of every point of a swinging foot over the edge of a tread, metres."""


def ground_line(u: Array, level0: Array, level1: Array) -> Array:
    """Return the ground line under a swing (N, 16). It rises early and falls late, as the edge of the tread demands.

    u: (N, 16) progress of the swing. level0, level1: (N,) floor before and after, metres.
    """
    u = np.clip(u, 0, 1)
    ease = smoother(np.where((level1 > level0)[:, None], u / 0.85, (u - 0.12) / 0.88))
    return np.asarray(level0[:, None] + (level1 - level0)[:, None] * ease)


def nosing(p: StepPlan, c: Commands, style: Style) -> Array:
    """Return where the edge between this chunk's two treads is (N,), metres along the facing from the plan's base.

    Upstairs, standing toes keep 5 to 15 cm from the next riser; on shallow treads the heels reach over the edge.
    Downstairs, a landing heel keeps 4 cm or more from the riser behind it.
    """
    ankle = -0.02 - 0.1 * np.abs(p.ahead) * p.flow
    up = np.maximum(p.ahead - 0.25 - 0.1 * style.riser, -0.06)
    down = 0.1 + style.riser * np.maximum(p.ahead - 0.24, 0.02)
    return np.asarray(ankle - np.where(c.rise > 0, up, down))


def before_the_riser(state: State, p: StepPlan, c: Commands, style: Style) -> StepPlan:
    """Return the plan with a base further ahead where a foot already stands past the riser that the step implies."""
    toes = np.max(np.sum(floor(state.foot) * p.facing[:, None], -1), -1) + 0.22
    past = toes - (np.sum(p.base * p.facing, -1) + nosing(p, c, style))
    further = np.where((c.rise > 0) & ~state.seated, np.clip(past, 0.0, 0.16), 0.0)
    return replace(p, base=p.base + further[:, None] * p.facing)


def cleared(state: State, p: StepPlan, c: Commands, edge: Array, track: Track) -> Track:
    """Lift the track of a foot where it would cut the edge of a tread."""
    sole, yaw, pitch, bend = track
    lack = clearance_lack(state, p, edge, track, NOSE) * (smoothstep(GRID / 0.2) * c.stairs[:, None])
    raised_by = widened(lack * moving(sole))
    sole = sole.copy()
    sole[..., 1] += raised_by * smoothstep(GRID / 0.15)
    return sole, yaw, pitch, bend


def clearance_lack(state: State, p: StepPlan, edge: Array, track: Track, margin: float) -> Array:
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
