"""First steps: how far both feet slide when a standing body starts to move.

A history of standing does not show which foot moves first. A model that averages both cases slides on both feet.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from humanclaw.body import HISTORY, Array
from humanclaw.motion import DiTGenerator
from humanclaw_train.eval import measures
from humanclaw_train.eval.rollouts import Command, extend
from humanclaw_train.markdown import cell, table

BODIES: Final = 1200
"""Bodies per skill. Only a hundredth of them decides the 99th percentile."""
GLIDES: Final = 2.0
"""A body glides if both toes slide further than this in its first step, cm."""


@dataclass(frozen=True)
class FirstSteps:
    """Slide of the slower toe in first chunks from standing, cm."""

    bodies: int
    p95: float
    p99: float
    most: float
    gliding: int
    """Number of bodies that glide."""

    @classmethod
    def of(cls, slides: Array) -> FirstSteps:
        """Summarise slides (bodies,), cm."""
        p95, p99 = (float(np.percentile(slides, share)) for share in (95, 99))
        return cls(len(slides), p95, p99, float(slides.max()), int((slides > GLIDES).sum()))


def first_steps(
    generator: DiTGenerator, commands: Sequence[Command], bodies: int = BODIES, seed: int = 0
) -> dict[str, FirstSteps]:
    """Measure the first steps of each skill over the whole ranges of its schema."""
    found = {}
    for command in commands:
        motions = [generator.start() for _ in range(bodies)]
        values = _first_commands(command, bodies, np.random.default_rng(seed))
        extend(generator, command, motions, np.arange(bodies), values, (seed, 13))
        # From the last history frame on, so that a jump at the seam counts as a slide.
        slides = [measures.slide(motion[HISTORY - 1 :].joints()) for motion in motions]
        found[command.skill] = FirstSteps.of(np.array(slides))
    return found


def _first_commands(command: Command, bodies: int, random: np.random.Generator) -> Array:
    """Draw commands over the whole ranges (bodies, k).

    Every second command is straight: all parameters that can be zero are, except the primary one. Models call these
    most, and in them either foot might move first. In every third command the primary parameter is small: it is drawn
    from the lowest fifth of its range.
    """
    low, high = (np.array([getattr(one, end) for one in command.parameters]) for end in ("low", "high"))
    values = random.uniform(low, high, (bodies, len(low)))
    # The value closest to zero that each range allows.
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
