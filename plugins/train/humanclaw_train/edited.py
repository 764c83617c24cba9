"""The edited part of the training data: chunks of composed motion for every skill (see humanclaw_train.composer)."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from humanclaw.pose import FUTURE, HISTORY, Motion
from humanclaw_train.augment import Profiles, RealClip
from humanclaw_train.chunks import Chunks, cut
from humanclaw_train.composer import (
    BACK,
    DOWN,
    SECONDS,
    SIDE,
    SIT,
    SKILLS,
    TURN,
    UP,
    WALK,
    Array,
    Commands,
    Ints,
    play,
)

_FOLLOWS: Final = np.array(
    # walk, side, back, turn, up, down, sit, stop
    [
        [75, 5, 3, 10, 5, 5, 4, 6],
        [16, 40, 8, 14, 4, 4, 8, 6],
        [10, 8, 44, 14, 3, 3, 12, 6],
        [24, 7, 6, 42, 5, 5, 6, 5],
        [12, 4, 3, 5, 66, 4, 1, 5],
        [12, 4, 3, 5, 4, 66, 1, 5],
        [13, 6, 4, 10, 1, 1, 45, 18],
        [14, 8, 8, 12, 7, 7, 14, 30],
    ],
    float,
)
"""Odds that one skill follows another, rows before, columns after."""


def sample_commands(n: int, length: int, rng: np.random.Generator) -> list[Commands]:
    """Natural series of commands for n bodies: runs of one skill at about the same values, and every change of skill."""
    odds = np.cumsum(_FOLLOWS / _FOLLOWS.sum(1, keepdims=True), 1)
    skill = rng.integers(0, len(SKILLS), n)
    held = _drawn(skill, rng)
    series = []
    for _ in range(length):
        following = (rng.random(n)[:, None] > odds[skill]).sum(1).clip(0, len(SKILLS) - 1)
        again = (following == skill) & (rng.random(n) < 0.8)
        held = np.where(again[:, None], _varied(held, skill, rng), _drawn(following, rng))
        skill = following
        series.append(Commands(skill, *held.T))
    return series


def _drawn(skill: Ints, rng: np.random.Generator) -> Array:
    """(N, 5) x, z, yaw, h, d over the schemas' whole ranges and a little beyond, half of them near what is asked for most."""
    n = len(skill)
    wide, straight = rng.random(n) < 0.5, rng.random(n)

    def mixed(low: float, high: float, usual: Array) -> Array:
        return np.where(wide, rng.uniform(low, high, n), usual).clip(low, high)

    values = np.zeros((len(SKILLS), 5, n))
    values[WALK, 0] = mixed(-0.31, 0.31, rng.normal(0, 0.05, n) * (straight > 0.4))
    values[WALK, 1] = mixed(0.0, 0.82, rng.normal(0.48, 0.12, n))
    values[WALK, 2] = np.deg2rad(mixed(-31, 31, rng.normal(0, 9, n) * (straight < 0.7)))
    values[SIDE, 0] = rng.uniform(-0.42, 0.42, n)
    values[BACK, 1] = rng.uniform(0.03, 0.47, n)
    values[TURN, 2] = np.deg2rad(rng.uniform(-77, 77, n))
    values[[UP, DOWN], 3] = mixed(0.07, 0.26, rng.normal(0.17, 0.02, n))
    values[[UP, DOWN], 4] = mixed(0.19, 0.41, rng.normal(0.28, 0.025, n))
    values[SIT, 3] = mixed(0.19, 0.81, rng.normal(0.54, 0.05, n))
    return np.asarray(values[skill, :, np.arange(n)])


def _varied(values: Array, skill: Ints, rng: np.random.Generator) -> Array:
    """The same command again, give or take; a seat stays what it is."""
    noise = rng.normal(0, [0.015, 0.03, 0.05, 0.004, 0.006], values.shape) * (values != 0) * (skill != SIT)[:, None]
    within = (values + noise).clip([-0.42, 0.0, -1.35, 0.07, 0.19], [0.42, 0.82, 1.35, 0.82, 0.41])
    return np.asarray(within * (values != 0))


def edited_chunks(
    clips: Sequence[RealClip] | Profiles,
    seconds_per_skill: float,
    seed: int,
    progress: Callable[[float], object] | None = None,
    base_share: float = 4.0,
) -> dict[str, Chunks]:
    """Composed chunks of every skill, and of `base` at any offset, half of them mirrored, with the parameters that they realise.

    seconds_per_skill: of future frames, so 2 chunks a second; base gets base_share times as much. progress hears 0 to 1.
    """
    profiles = clips if isinstance(clips, Profiles) else Profiles.of(clips)
    rng = np.random.default_rng(seed)
    half = max(1, round(seconds_per_skill / SECONDS / 2))
    wanted = dict.fromkeys(SKILLS, half) | {"base": max(1, round(base_share * half))}
    found: dict[str, list[Chunks]] = {name: [] for name in wanted}
    done = 0.0
    while done < 1.0:
        for name, chunks in _batch(profiles, rng).items():
            found[name].append(chunks[: wanted[name] - sum(map(len, found[name]))])
        done = min(sum(map(len, found[name])) / count for name, count in wanted.items())
        if progress is not None:
            progress(done)
    whole = {name: Chunks.join(parts) for name, parts in found.items()}
    return {name: Chunks.join([chunks, chunks.mirrored(name)]) for name, chunks in whole.items()}


def _batch(profiles: Profiles, rng: np.random.Generator, bodies: int = 128, length: int = 16) -> dict[str, Chunks]:
    series = sample_commands(bodies, length, rng)
    roots, turns, lacking = play(profiles, series, rng, rested=0.3)
    motions = [Motion(*pair) for pair in zip(roots, turns, strict=True)]
    clean = lacking.ravel() < 0.01
    root, rotations = _stacked(cut(motion, np.arange(length) * FUTURE) for motion in motions)
    skill = np.concatenate([commands.skill for commands in series]).reshape(length, bodies).T.ravel()
    found = {
        name: Chunks.of(name, root[(skill == i) & clean], rotations[(skill == i) & clean], "composed", False)
        for i, name in enumerate(SKILLS)
    }
    asked = np.stack([np.stack([commands.h, commands.d], -1) for commands in series], 1).reshape(-1, 2)
    for index in (UP, DOWN):
        # Who rises from a seat rises by more than the stair; what was asked for is the stair.
        rows = (skill == index) & clean
        seated = root[rows, HISTORY - 1, 1] < 0.9
        params = np.where(seated[:, None], asked[rows], found[SKILLS[index]].params).astype(np.float32)
        found[SKILLS[index]] = replace(found[SKILLS[index]], params=params)
    starts = rng.integers(0, len(motions[0]) - FUTURE - HISTORY + 1, (bodies, 2 * length))
    loose = _stacked(cut(motion, at) for motion, at in zip(motions, starts, strict=True))
    return found | {"base": Chunks.of("base", *loose, "composed", False)}


def _stacked(pairs: Iterable[tuple[Array, Array]]) -> tuple[Array, Array]:
    first, second = zip(*pairs, strict=True)
    return np.concatenate(first), np.concatenate(second)
