"""First steps: how far both feet of a body that stands slide as it sets out.

A history of standing does not tell which foot goes first; a model that averages the two glides on both.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from humanclaw.body import HISTORY, Array
from humanclaw.motion import DiTGenerator
from humanclaw_train import measures
from humanclaw_train.rollouts import Command, extend
from humanclaw_train.tables import cell, table

BODIES: Final = 1200
"""Bodies whose first steps are measured: a 99th percentile rests on a hundredth of them."""
GLIDES: Final = 2.0
"""A first step in which both toes slide further than this glides, cm."""


@dataclass(frozen=True)
class FirstSteps:
    """How far the slower toe slides in first chunks from standing, cm."""

    bodies: int
    p95: float
    p99: float
    most: float
    gliding: int
    """Bodies that glide."""

    @classmethod
    def of(cls, slides: Array) -> FirstSteps:
        """slides: (bodies,) cm."""
        p95, p99 = (float(np.percentile(slides, share)) for share in (95, 99))
        return cls(len(slides), p95, p99, float(slides.max()), int((slides > GLIDES).sum()))


def first_steps(
    generator: DiTGenerator, commands: Sequence[Command], bodies: int = BODIES, seed: int = 0
) -> dict[str, FirstSteps]:
    """Return what the first steps of each skill are like, over the whole ranges of its schema."""
    found = {}
    for command in commands:
        motions = [generator.start() for _ in range(bodies)]
        values = _first_commands(command, bodies, np.random.default_rng(seed))
        extend(generator, command, motions, np.arange(bodies), values, (seed, 13))
        slides = [measures.slide(motion[HISTORY - 1 :].joints()) for motion in motions]
        found[command.skill] = FirstSteps.of(np.array(slides))
    return found


def _first_commands(command: Command, bodies: int, random: np.random.Generator) -> Array:
    """(bodies, k) over the whole range. Every other one is straight: whatever can be nought but what the skill is for
    is nought; that is what is called most, and where either foot might go first. Every third is small: of what the
    skill is for, from the lowest fifth of the range."""
    low, high = (np.array([getattr(one, end) for one in command.parameters]) for end in ("low", "high"))
    values = random.uniform(low, high, (bodies, len(low)))
    least, primary = np.clip(0.0, low, high), np.arange(len(low)) == command.primary
    values[::3, primary] = (least + 0.2 * (values[::3] - least))[:, primary]
    values[::2, (least == 0) & ~primary] = 0.0
    return values


def first_steps_table(found: Mapping[str, FirstSteps]) -> str:
    rows = [
        (skill, *(cell(value, 2) for value in (one.p95, one.p99, one.most)), f"{one.gliding} of {one.bodies}")
        for skill, one in found.items()
    ]
    heads = ("first chunk from standing", "slower toe slides cm, 95 %", "99 %", "most", f"over {GLIDES:g} cm")
    return table(heads, rows)
