"""Transitions: peak joint acceleration where one skill takes over from another, for all ordered pairs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from humanclaw.body import FUTURE, HISTORY, Array, forward_kinematics
from humanclaw.motion import DiTGenerator
from humanclaw_train.data.chunks import Chunks, of_skill
from humanclaw_train.eval import measures
from humanclaw_train.eval.measures import SEAM
from humanclaw_train.eval.rollouts import Command, extend
from humanclaw_train.markdown import cell, table


@dataclass(frozen=True)
class Transitions:
    """Peak joint accelerations at the seam from a row's skill to a column's (k, k), m/s^2.

    worst, median: over the bodies. real: the peak of real motion.
    """

    skills: tuple[str, ...]
    worst: Array
    median: Array
    real: float


def transitions(
    generator: DiTGenerator, commands: Sequence[Command], real: float, bodies: int = 20, seed: int = 0
) -> Transitions:
    """Measure all ordered pairs: from standing, one chunk of each skill with random parameters."""
    worst, median = (np.zeros((len(commands), len(commands))) for _ in range(2))
    for row, first in enumerate(commands):
        random = np.random.default_rng((seed, row))
        motions = [generator.start() for _ in range(bodies)]
        extend(generator, first, motions, np.arange(bodies), first.draw(bodies, random), (seed, row))
        for column, second in enumerate(commands):
            both = list(motions)
            extend(generator, second, both, np.arange(bodies), second.draw(bodies, random), (seed, row, column + 1))
            peaks = _seam_peaks(np.stack([motion[-HISTORY - FUTURE :].joints() for motion in both]))
            worst[row, column], median[row, column] = peaks.max(), np.median(peaks)
    return Transitions(tuple(command.skill for command in commands), worst, median, real)


def _seam_peaks(joints: Array) -> Array:
    return np.asarray(measures.acceleration(joints)[:, SEAM].max(1))


def real_peak(folders: Sequence[Path], commands: Sequence[Command]) -> float:
    """Return the 99.9th percentile of the same two-frame peak over real chunks of skills that move, m/s^2."""
    peaks = [
        _window_peaks(data)
        for one in commands
        if one.declaration.role != "stop" and (data := of_skill(folders, one.skill)) and data.real.all()
    ]
    return float(np.percentile(np.concatenate(peaks), 99.9)) if peaks else np.nan


def _window_peaks(chunks: Chunks) -> Array:
    joints, _ = forward_kinematics(chunks.root.astype(float), chunks.rotations.astype(float))
    size = measures.acceleration(joints)
    # A seam has two accelerations; every pair of neighbouring frames is compared in the same way.
    return np.maximum(size[:, 1:], size[:, :-1]).ravel()


def transitions_table(found: Transitions) -> str:
    """Format the worst seam over the peak of real motion; rows: the skill before, columns: the skill after."""
    ratio = found.worst / found.real
    rows = [(skill, *(cell(value, 2) for value in line)) for skill, line in zip(found.skills, ratio, strict=True)]
    order = np.argsort(-found.worst, axis=None)[:5]
    pairs = ", ".join(
        f"{found.skills[i]} to {found.skills[j]} {found.worst[i, j]:.0f}"
        for i, j in zip(*np.unravel_index(order, ratio.shape), strict=True)
    )
    notes = (
        f"Peak of real motion {found.real:.0f} m/s2; {int((ratio > 1.5).sum())} of {ratio.size} pairs over 1.5 times "
        f"that. Median seam {np.median(found.median):.0f} m/s2. Worst, m/s2: {pairs}."
    )
    heads = ("from, to", *found.skills)
    return f"{table(heads, rows)}\n\n{notes}"
