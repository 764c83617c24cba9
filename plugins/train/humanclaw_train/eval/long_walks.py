"""Long walks in half-physics on an empty floor: the body's gait, and every corner of a skill's range."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Final

import numpy as np

from humanclaw import Motion
from humanclaw.body import FUTURE, HISTORY
from humanclaw.skills import HeadingCorrection, from_si
from humanclaw_train.eval.measures import Gait
from humanclaw_train.eval.rollouts import Command
from humanclaw_train.eval.simulated import Actor, flat
from humanclaw_train.eval.walks import SPEEDS, STRETCHES, Gaits, part_of, straight
from humanclaw_train.markdown import cell, table

_BODIES: Final = 3
_FLOOR: Final = 300.0
"""Side of the floor, metres: a hundred calls go 80 m far."""


def physical_gaits(actor: Actor, command: Command, seed: int = 0) -> Gaits:
    """Measure stretches of straight walks of three bodies, by speed."""
    last = max(stop for _, stop in STRETCHES.values())
    found: Gaits = {}
    for speed in SPEEDS:
        walks = [_walk(actor, command, straight(command, speed), last, (seed, body)) for body in range(_BODIES)]
        for name in STRETCHES:
            gaits = [gait for walk in walks if (gait := Gait.of(part_of(walk, name))) is not None]
            found.setdefault(speed, {})[f"{name}, half-physics"] = gaits
    return found


@dataclass(frozen=True)
class Corner:
    """One corner of a skill's range, by parameter in the schema's units. lowest: the hips over all calls, cm."""

    asked: Mapping[str, float]
    lowest: float


def corners(actor: Actor, command: Command, calls: int, bodies: int, seed: int = 0) -> list[Corner]:
    """Let some bodies walk at every corner of the schema's range."""
    found = []
    for values in product(*((one.low, one.high) for one in command.parameters)):
        asked = command.named(np.array(values))
        walks = [_walk(actor, command, asked, calls, (seed, body)) for body in range(bodies)]
        named = {one.key: from_si(one.key, value) for one, value in zip(command.parameters, values, strict=True)}
        found.append(Corner(named, 100 * min(float(walk.root[:, 1].min()) for walk in walks)))
    return found


def _walk(actor: Actor, command: Command, asked: Mapping[str, float], calls: int, key: tuple[int, ...]) -> Motion:
    """Call a skill again and again from standing. Like `humanclaw.Body`, correct heading errors in the next call."""
    actor.stand(flat(_FLOOR))
    course = HeadingCorrection()
    for call in range(calls):
        steered = course.steer(command.declaration, asked)
        history = actor.simulated[-HISTORY:]
        actor.act(command, np.array([steered[name] for name in command.names]), (*key, call))
        course = course.after(command.declaration, asked, history, actor.simulated[-FUTURE:])
    return actor.simulated


def corners_table(found: Sequence[Corner]) -> str:
    """Format one row per corner."""
    heads = (*found[0].asked, "lowest hips cm")
    return table(heads, [(*(f"{value:.0f}" for value in one.asked.values()), cell(one.lowest)) for one in found])
