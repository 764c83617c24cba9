"""The synthetic part of the training data: chunks of synthetic motion for every skill (see
humanclaw_train.synthesis)."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import cycle
from typing import Final

import numpy as np

from humanclaw import Motion
from humanclaw.pose import FUTURE, HISTORY, Array
from humanclaw.recipes import Draw
from humanclaw_train.augment import Profiles, RealClip
from humanclaw_train.chunks import Chunks, cut
from humanclaw_train.commands import Commands, Ints, Trained
from humanclaw_train.state import SECONDS
from humanclaw_train.synthesis import play

LENGTHS: Final = (16, 4, 1)
"""Commands in a series, by turns. Who has just begun to stand is rare in long ones, and first steps are what bodies are
seen to do most."""
CHUNKS_A_BATCH: Final = 2048
PLAIN: Final = 0.3
"""Share of the calls that ask for one thing alone, such as a short step straight ahead: what is asked for most, and by
parameters drawn each by itself seldom comes about."""
STEADY: Final = 0.3
"""Share of the bodies that go on with one skill at about the same values: only after a dozen fast steps in a row has a
walker's phase against the chunks been everywhere, and by chance alone hardly one goes on for so long."""


@dataclass(frozen=True)
class Call:
    """One command for each of N bodies: the skills (N,) as indices, and the values (N, k) as far as each has
    parameters."""

    skill: Ints
    values: Array


def sample_calls(skills: Sequence[Trained], n: int, length: int, rng: np.random.Generator) -> list[Call]:
    """Natural series of commands for n bodies: runs of one skill at about the same values, and every change of
    skill."""
    share = np.array([one.recipe.share for one in skills])
    repeats = np.array([one.recipe.repeats for one in skills])
    skill = rng.choice(len(skills), n, p=share / share.sum())
    values, steady = _drawn(skills, skill, rng), rng.random(n) < STEADY
    series = []
    for _ in range(length):
        goes_on = steady | (rng.random(n) < repeats[skill])
        following = np.where(goes_on, skill, rng.choice(len(skills), n, p=share / share.sum()))
        again = (following == skill) & (steady | (rng.random(n) < 0.8))
        values = np.where(again[:, None], _varied(skills, skill, values, rng), _drawn(skills, following, rng))
        skill = following
        series.append(Call(skill, values))
    return series


def commands(skills: Sequence[Trained], call: Call) -> Commands:
    """Return the call as synthesis takes it."""
    pairs = zip(call.skill.tolist(), call.values.tolist(), strict=True)
    return Commands.of([(skills[index], dict(zip(_names(skills[index]), row, strict=False))) for index, row in pairs])


def _names(skill: Trained) -> tuple[str, ...]:
    return tuple(one.name for one in skill.declaration.parameters)


def _drawn(skills: Sequence[Trained], skill: Ints, rng: np.random.Generator) -> Array:
    """(N, k) over the whole ranges of the recipes, half of them near what is asked for most; 0 beyond a skill's
    parameters."""
    values = np.zeros((len(skill), max(len(_names(one)) for one in skills)))
    for index, one in enumerate(skills):
        rows = np.flatnonzero(skill == index)
        plain = rng.random(len(rows)) < PLAIN
        for column, name in enumerate(_names(one)):
            how = one.recipe.commands[name]
            values[rows, column] = np.where(plain & (how.nought > 0), 0.0, _draw(how, len(rows), rng))
    return values


def _draw(how: Draw, n: int, rng: np.random.Generator) -> Array:
    """Each parameter by itself, so that a short step is also practised straight ahead, and a long one aside."""
    even = rng.uniform(how.low, how.high, n)
    if how.usual is None:
        return even
    usual = rng.normal(how.usual, how.spread, n) * (rng.random(n) >= how.nought)
    return np.asarray(np.where(rng.random(n) < 0.5, even, usual).clip(how.low, how.high))


def _varied(skills: Sequence[Trained], skill: Ints, values: Array, rng: np.random.Generator) -> Array:
    """Return the same command again, give or take; what is exactly nought stays so."""
    values = values.copy()
    for index, one in enumerate(skills):
        rows = np.flatnonzero(skill == index)
        for column, name in enumerate(_names(one)):
            how, held = one.recipe.commands[name], values[rows, column]
            moved = (held + rng.normal(0.0, how.jitter, len(rows))).clip(how.low, how.high)
            values[rows, column] = np.where(held == 0, 0.0, moved)
    return values


def synthetic_chunks(
    clips: Sequence[RealClip] | Profiles,
    skills: Sequence[Trained],
    seconds_per_skill: float,
    seed: int,
    progress: Callable[[float], object] | None = None,
    base_share: float = 4.0,
) -> dict[str, Chunks]:
    """Composed chunks of every skill, and of `base` at any offset, half of them mirrored, with the parameters that they
    realise.

    seconds_per_skill: of future frames, so 2 chunks a second; base gets base_share times as much. progress hears 0 to
    1.
    """
    profiles = clips if isinstance(clips, Profiles) else Profiles.of(clips)
    rng = np.random.default_rng(seed)
    half = max(1, round(seconds_per_skill / SECONDS / 2))
    skills = [one for one in skills if one.synthetic]
    wanted = dict.fromkeys((one.name for one in skills), half) | {"base": max(1, round(base_share * half))}
    found: dict[str, list[Chunks]] = {name: [] for name in wanted}
    done, lengths = 0.0, cycle(LENGTHS)
    while done < 1.0:
        for name, chunks in _batch(profiles, skills, rng, next(lengths)).items():
            found[name].append(chunks[: wanted[name] - sum(map(len, found[name]))])
        done = min(sum(map(len, found[name])) / count for name, count in wanted.items())
        if progress is not None:
            progress(done)
    whole = {name: Chunks.join(parts) for name, parts in found.items()}
    return {name: Chunks.join([chunks, chunks.mirrored()]) for name, chunks in whole.items()}


def _batch(profiles: Profiles, skills: Sequence[Trained], rng: np.random.Generator, length: int) -> dict[str, Chunks]:
    bodies = CHUNKS_A_BATCH // length
    series = sample_calls(skills, bodies, length, rng)
    roots, turns, lacking = play(profiles, [commands(skills, call) for call in series], rng, rested=0.3)
    motions = [Motion(*pair) for pair in zip(roots, turns, strict=True)]
    root, rotations = _stacked(cut(motion, np.arange(length) * FUTURE) for motion in motions)
    skill = np.stack([call.skill for call in series], 1).ravel()
    values = np.stack([call.values for call in series], 1).reshape(len(skill), -1)
    found = {}
    for index, one in enumerate(skills):
        rows = (skill == index) & (lacking.ravel() < 0.01)  # whose feet cut no edge of a stair
        chunks = Chunks.of(one.declaration.parameters, root[rows], rotations[rows], "composed", False)
        found[one.name] = _as_asked(chunks, values[rows]) if one.declaration.climbs else chunks
    starts = rng.integers(0, len(motions[0]) - FUTURE - HISTORY + 1, (bodies, 2 * length))
    loose = _stacked(cut(motion, at) for motion, at in zip(motions, starts, strict=True))
    return found | {"base": Chunks.of((), *loose, "composed", False)}


def _as_asked(chunks: Chunks, values: Array) -> Chunks:
    """Who rises from a seat rises by more than the stair; what was asked for is the stair."""
    seated = chunks.root[:, HISTORY - 1, 1] < 0.8
    asked = values[:, : chunks.params.shape[1]]
    return replace(chunks, params=np.where(seated[:, None], asked, chunks.params).astype(np.float32))


def _stacked(pairs: Iterable[tuple[Array, Array]]) -> tuple[Array, Array]:
    first, second = zip(*pairs, strict=True)
    return np.concatenate(first), np.concatenate(second)
