"""Sequences: root-rigid jerk of the six sequences of ten chunks that the paper names (section 5.2)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np

from humanclaw import Motion
from humanclaw.body import root_jerk
from humanclaw.motion import DiTGenerator
from humanclaw.skills import suited
from humanclaw_train.eval.rollouts import Command, extend
from humanclaw_train.markdown import cell, table

_WALK: Final = ("hips.forward", 0.4)
_SIDE: Final = ("hips.left", 0.2)
_TURN: Final = ("heading.left", float(np.radians(37.5)))
Call = tuple[str, float]
"""A measure and its amount, SI. The flat-ground skill that commands it and the fewest other measures executes it; its
other parameters are 0."""
SEQUENCES: Final[Mapping[str, tuple[tuple[Call, ...], float]]] = {
    "forward walk": ((_WALK,) * 10, 5.2),
    "turn": ((_TURN,) * 10, 4.3),
    "walk, turn, walk": ((*[_WALK] * 4, *[_TURN] * 2, *[_WALK] * 4), 5.8),
    "five walks, then five side steps": ((*[_WALK] * 5, *[_SIDE] * 5), 4.7),
    "the same ten, interleaved": ((_WALK, _SIDE) * 5, 7.4),
    "aimless": ((), 9.7),
}
"""Ten calls each, and the paper's jerk (m/s^3). Aimless: random steps ahead, aside and back, and turns.

The paper gives neither parameters nor lengths. Ours are the middle of each range: 40 cm ahead, 20 cm to the left, 37.5
degrees.
"""
_AIMLESS: Final = ("hips.forward", "hips.left", "hips.back", "heading.left")


def sequence_jerks(
    generator: DiTGenerator, commands: Sequence[Command], bodies: int = 20, seed: int = 0
) -> dict[str, float]:
    """Return the mean root-rigid jerk, m/s^3, of each sequence whose skills are all available."""
    known = _by_measure(commands)
    found = {}
    for number, (name, (calls, _)) in enumerate(SEQUENCES.items()):
        if {measure for measure, _ in calls} <= set(known) and set(_AIMLESS) <= set(known):
            motions = _sequence(generator, known, calls, bodies, (seed, number))
            found[name] = float(np.mean([root_jerk(motion) for motion in motions]))
    return found


def _by_measure(commands: Sequence[Command]) -> dict[str, Command]:
    """Return the skill to ask for each measure of the sequences, if there is one."""
    named = {one.skill: one for one in commands}
    found = {measure: suited((one.declaration for one in commands), measure) for measure in _AIMLESS}
    return {measure: named[one.skill] for measure, one in found.items() if one is not None}


def _sequence(
    generator: DiTGenerator, known: Mapping[str, Command], calls: Sequence[Call], bodies: int, key: tuple[int, int]
) -> list[Motion]:
    random = np.random.default_rng(key)
    motions = [generator.start() for _ in range(bodies)]
    everyone = np.arange(bodies)
    for step in range(10):
        if calls:
            measure, amount = calls[step]
            values = np.array([[amount * (one.measure == measure) for one in known[measure].parameters]] * bodies)
            extend(generator, known[measure], motions, everyone, values, (*key, step))
            continue
        chosen = random.integers(len(_AIMLESS), size=bodies)
        for index, measure in enumerate(_AIMLESS):
            these, command = np.flatnonzero(chosen == index), known[measure]
            extend(generator, command, motions, these, command.draw(len(these), random), (*key, step))
    return motions


def agreement(found: Mapping[str, float]) -> tuple[int, int]:
    """Return how many pairs of sequences have the paper's order, and how many pairs there are."""
    names = list(found)
    pairs = [(a, b) for index, a in enumerate(names) for b in names[index + 1 :]]
    # Data and body differ from the paper's, so the order is compared and not the values.
    same = sum((found[a] < found[b]) == (SEQUENCES[a][1] < SEQUENCES[b][1]) for a, b in pairs)
    return same, len(pairs)


def sequences_table(found: Mapping[str, float]) -> str:
    rows = [(name, cell(value), cell(SEQUENCES[name][1])) for name, value in found.items()]
    same, pairs = agreement(found)
    return f"{table(('sequence', 'jerk m/s3', 'paper'), rows)}\n\n{same} of {pairs} pairs are in the paper's order."
