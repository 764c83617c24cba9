"""The synthetic part of the training data: chunks of synthetic motion for every skill (`synthesize`)."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import cycle
from typing import Final

import numpy as np
from tqdm import tqdm

from humanclaw import Motion
from humanclaw.body import FUTURE, HISTORY, Array, lay_hands
from humanclaw.skills import Draw
from humanclaw_train.data.chunks import Chunks, cut
from humanclaw_train.synthesis.commands import Commands, Ints, Trained
from humanclaw_train.synthesis.profiles import Profiles
from humanclaw_train.synthesis.state import SECONDS
from humanclaw_train.synthesis.synthesize import play

LENGTHS: Final = (16, 4, 1)
"""Commands in a series, in turn. Short series provide first steps from standing, which are rare in long ones."""
BASE_SHARE: Final = 4
"""Chunks of the base per chunk of a skill."""
CHUNKS_A_BATCH: Final = 2048
"""Chunks that are synthesised at once."""
PLAIN: Final = 0.3
"""Share of calls with one parameter other than zero, such as a short step straight ahead.

Models call these most, but independent draws of the parameters rarely produce them.
"""
CORNERS: Final = 0.08
"""Share of calls near a corner of the range, all parameters at once, where independent draws are rarer still."""
STEADY: Final = 0.3
"""Share of bodies that continue one skill at about the same values.

A walker's phase takes every value at the start of a chunk only after about a dozen fast steps, and chance alone rarely
produces such long runs.
"""


Call = tuple[Ints, Array]
"""One command for each of N bodies: skill (N,) as index, and values (N, k), 0 beyond a skill's parameters."""


def sample_calls(skills: Sequence[Trained], n: int, length: int, rng: np.random.Generator) -> list[Call]:
    """Draw series of commands for n bodies: runs of one skill at similar values, and all changes of skill."""
    share = np.array([skill.recipe.share for skill in skills])
    repeats = np.array([skill.recipe.repeats for skill in skills])
    skill = rng.choice(len(skills), n, p=share / share.sum())
    values, steady = _drawn(skills, skill, rng), rng.random(n) < STEADY
    series = []
    for _ in range(length):
        goes_on = steady | (rng.random(n) < repeats[skill])
        following = np.where(goes_on, skill, rng.choice(len(skills), n, p=share / share.sum()))
        again = (following == skill) & (steady | (rng.random(n) < 0.8))
        values = np.where(again[:, None], _varied(skills, skill, values, rng), _drawn(skills, following, rng))
        skill = following
        series.append((skill, values))
    return series


def _names(skill: Trained) -> tuple[str, ...]:
    return tuple(parameter.name for parameter in skill.declaration.parameters)


def _drawn(skills: Sequence[Trained], skill: Ints, rng: np.random.Generator) -> Array:
    """Draw values over the whole ranges of the recipes, half of them near the usual value (N, k)."""
    values = np.zeros((len(skill), max(len(_names(trained)) for trained in skills)))
    for index, trained in enumerate(skills):
        rows = np.flatnonzero(skill == index)
        plain, corner = rng.random(len(rows)) < PLAIN, rng.random(len(rows)) < CORNERS
        for column, name in enumerate(_names(trained)):
            how = trained.recipe.commands[name]
            values[rows, column] = np.where(plain & (how.nought > 0), 0.0, _draw(how, len(rows), rng))
            end = np.where(rng.random(len(rows)) < 0.5, how.low, how.high) * rng.uniform(0.75, 1.0, len(rows))
            values[rows, column] = np.where(corner, end.clip(how.low, how.high), values[rows, column])
    return values


def _draw(how: Draw, n: int, rng: np.random.Generator) -> Array:
    """Draw one parameter independently, so that short steps also go straight ahead and long ones aside."""
    even = rng.uniform(how.low, how.high, n)
    if how.usual is None:
        return even
    usual = rng.normal(how.usual, how.spread, n) * (rng.random(n) >= how.nought)
    return np.asarray(np.where(rng.random(n) < 0.5, even, usual).clip(how.low, how.high))


def _varied(skills: Sequence[Trained], skill: Ints, values: Array, rng: np.random.Generator) -> Array:
    """Vary commands slightly. Values of exactly zero stay zero."""
    values = values.copy()
    for index, trained in enumerate(skills):
        rows = np.flatnonzero(skill == index)
        for column, name in enumerate(_names(trained)):
            how, held = trained.recipe.commands[name], values[rows, column]
            moved = (held + rng.normal(0.0, how.jitter, len(rows))).clip(how.low, how.high)
            values[rows, column] = np.where(held == 0, 0.0, moved)
    return values


def synthetic_chunks(
    profiles: Profiles,
    skills: Sequence[Trained],
    seconds_per_skill: float,
    seed: int,
) -> dict[str, Chunks]:
    """Synthesise chunks of every skill, and of `base` at any offset. Half of them are mirrored.

    seconds_per_skill: of future frames, so 2 chunks a second.
    """
    rng = np.random.default_rng(seed)
    half = max(1, round(seconds_per_skill / SECONDS / 2))
    skills = [skill for skill in skills if skill.synthetic]
    # Mirroring doubles the chunks at the end, so half of them is enough.
    wanted = dict.fromkeys((skill.name for skill in skills), half) | {"base": BASE_SHARE * half}
    made: dict[str, list[Chunks]] = {name: [] for name in wanted}
    lengths = cycle(LENGTHS)
    with tqdm(total=sum(wanted.values()), desc="synthesis", unit="chunk", disable=None) as bar:
        while any(sum(map(len, made[name])) < count for name, count in wanted.items()):
            for name, chunks in _batch(profiles, skills, rng, next(lengths)).items():
                made[name].append(chunks[: wanted[name] - sum(map(len, made[name]))])
                bar.update(len(made[name][-1]))
    whole = {name: Chunks.join(parts) for name, parts in made.items()}
    return {name: Chunks.join([chunks, chunks.mirrored()]) for name, chunks in whole.items()}


def _batch(profiles: Profiles, skills: Sequence[Trained], rng: np.random.Generator, length: int) -> dict[str, Chunks]:
    bodies = CHUNKS_A_BATCH // length  # Fewer bodies for longer series, so that memory stays the same.
    series = sample_calls(skills, bodies, length, rng)
    roots, turns, lacking = play(profiles, [Commands.of(skills, *call) for call in series], rng, rested=0.3)
    motions = [lay_hands(Motion(*pair)) for pair in zip(roots, turns, strict=True)]
    root, rotations = _stacked(cut(motion, np.arange(length) * FUTURE) for motion in motions)
    skill, values = (np.stack(parts, 1) for parts in zip(*series, strict=True))
    skill, values = skill.ravel(), values.reshape(skill.size, -1)
    chunks_of = {}
    for index, trained in enumerate(skills):
        rows = (skill == index) & (lacking.ravel() < 0.01)  # Feet that cut no edge of a stair.
        chunks = Chunks.of(trained.declaration.parameters, root[rows], rotations[rows], "composed", False)
        chunks_of[trained.name] = _as_asked(chunks, values[rows]) if trained.declaration.climbs else chunks
    # The base also learns from chunks that begin between two commands.
    starts = rng.integers(0, len(motions[0]) - FUTURE - HISTORY + 1, (bodies, 2 * length))
    loose = _stacked(cut(motion, at) for motion, at in zip(motions, starts, strict=True))
    return chunks_of | {"base": Chunks.of((), *loose, "composed", False)}


def _as_asked(chunks: Chunks, values: Array) -> Chunks:
    """Keep the commanded rise for stairs out of a seat, where the pelvis rises by more than the stair."""
    seated = chunks.root[:, HISTORY - 1, 1] < 0.8
    asked = values[:, : chunks.params.shape[1]]
    return replace(chunks, params=np.where(seated[:, None], asked, chunks.params).astype(np.float32))


def _stacked(pairs: Iterable[tuple[Array, Array]]) -> tuple[Array, Array]:
    first, second = zip(*pairs, strict=True)
    return np.concatenate(first), np.concatenate(second)
