"""A long life: errors that accumulate when a body continues its own motion over many random calls."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from humanclaw.body import FUTURE, JOINT_INDEX
from humanclaw.motion import DiTGenerator
from humanclaw_train.eval import measures
from humanclaw_train.eval.rollouts import Command, extend


@dataclass(frozen=True)
class Life:
    """Joints of bodies after many random calls in a row. Angles in degrees."""

    calls: int
    bodies: int
    toes_up: float
    """Drift of the ankles: mean toes-up angle over the last 20 calls minus that over the first 20, all bodies."""
    worst_toes_up: float
    """The largest such drift of a single ankle."""
    beyond: float
    """Share of frames in the last 20 calls with a leg joint beyond its limits."""
    most: float
    """Largest excess over a limit in all calls."""


def life(
    generator: DiTGenerator, commands: Sequence[Command], calls: int = 120, bodies: int = 4, seed: int = 0
) -> Life:
    """Chain random calls of all skills. Bodies may rise or sink, because each chunk has its own floor."""
    random = np.random.default_rng((seed, 1))
    motions = [generator.start() for _ in range(bodies)]
    for call in range(calls):
        command = commands[int(random.integers(len(commands)))]
        extend(generator, command, motions, np.arange(bodies), command.draw(bodies, random), (seed, call))
    rotations = np.stack([motion.rotations for motion in motions])
    # Toes up is negative about X.
    ankles = -np.degrees(rotations[:, :, [JOINT_INDEX["left_ankle"], JOINT_INDEX["right_ankle"]], 0])
    span = FUTURE * min(20, calls)
    drift = ankles[:, -span:].mean(1) - ankles[:, :span].mean(1)
    over = measures.beyond_limits(rotations)
    return Life(
        calls, bodies, float(drift.mean()), float(drift.max()), float((over[:, -span:] > 0).mean()), float(over.max())
    )


def life_line(found: Life) -> str:
    return (
        f"{found.calls} random calls in a row, {found.bodies} bodies: ankles {found.toes_up:+.1f} degrees toes-up "
        f"(worst {found.worst_toes_up:+.1f}); a leg joint beyond its limits in {100 * found.beyond:.1f} % of the last "
        f"frames, by {found.most:.0f} degrees at most."
    )
