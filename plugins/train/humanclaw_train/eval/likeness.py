"""Likeness of a skill's motion to human motion, in rows: feet, joints, and Frechet distances to real motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np

from humanclaw import Motion
from humanclaw.body import FUTURE, HISTORY, Array, forward_kinematics
from humanclaw.motion import DiTGenerator
from humanclaw.skills import Declaration
from humanclaw_train.data.chunks import Chunks, canonical, of_skill, stacked
from humanclaw_train.eval import measures
from humanclaw_train.eval.measures import Features
from humanclaw_train.eval.rollouts import Command, extend, others, roll
from humanclaw_train.markdown import cell, table

PRIOR: Final = "(the prior alone)"
_MOST: Final = 600
"""Largest number of chunks of one kind that a measure uses."""


@dataclass(frozen=True)
class NaturalnessRow:
    """Measures of one skill's motion, generated or from the data."""

    skill: str
    source: str
    """generated, real or synthetic."""
    chunks: int
    skate: float
    """Horizontal speed of toes on the ground, cm/s; NaN on stairs, where the ground is not at 0."""
    slower_toe: float
    """Horizontal speed of the slower toe, cm/s."""
    sunk: float
    """Depth of the lowest sole, cm; NaN on stairs."""
    jerk: float
    """Mean jerk of all joints, m/s^3."""
    beyond: float
    """Share of frames with a leg joint beyond its limits."""
    frechet: float = np.nan
    """Frechet distance to held-out chunks of the skill; the model gets their histories and parameters."""
    free: float = np.nan
    """Frechet distance to real chunks; the model starts from standing and gets only their parameters."""
    unseen: tuple[str, ...] = ()
    """The held-out clips; if there are too few chunks of them, there is no `frechet`."""


def naturalness_of(skill: Declaration, source: str, root: Array, rotations: Array) -> NaturalnessRow:
    """Measure canonical chunks, root (N, 20, 3) and rotations (N, 20, 24, 3)."""
    return _row(skill.skill, source, root, rotations, skill.climbs)


def _row(name: str, source: str, root: Array, rotations: Array, stairs: bool) -> NaturalnessRow:
    joints, _ = forward_kinematics(root, rotations)
    future = joints[:, HISTORY - 1 :]
    return NaturalnessRow(
        name, source, len(root),
        np.nan if stairs else measures.skate(future), measures.slower_toe(future),
        np.nan if stairs else measures.penetration(future), measures.joint_jerk(joints[:, HISTORY - 3 :]),
        float((measures.beyond_limits(rotations[:, HISTORY:]) > 0).mean()),
    )  # fmt: skip


def skills(
    generator: DiTGenerator, commands: Sequence[Command], folders: Sequence[Path], rollouts: int, seed: int
) -> list[NaturalnessRow]:
    """Measure the prior and every skill: generated motion and, where there are any, real or else synthetic chunks."""
    features = _features(folders)
    rows = prior(generator, folders, features, seed) if features else []
    for command in commands:
        rolled = roll(generator, command, others(command, commands), rollouts, seed)
        data = of_skill(folders, command.skill)
        made = naturalness_of(command.declaration, "generated", rolled.root, rolled.rotations)
        if data is None:
            rows.append(made)
            continue
        kind = "real" if data.real.any() else "synthetic"
        true = naturalness_of(command.declaration, kind, *_arrays(_some(data, _MOST, seed)))
        rows += _compared(generator, command, data, folders, features, seed, made, true) if features else [made, true]
    return rows


def _compared(
    generator: DiTGenerator, command: Command, data: Chunks, folders: Sequence[Path], features: Features, seed: int,
    made: NaturalnessRow, true: NaturalnessRow,
) -> list[NaturalnessRow]:  # fmt: skip
    """Add the Frechet distances to a skill's rows."""
    free = free_running(generator, command, data, features, seed)
    apart = held_out(folders, command.skill)
    if apart is None:
        return [replace(made, free=free), true]
    distance, least = likeness(generator, command, *apart, features, seed)
    unseen = apart[0].clips
    return [replace(made, frechet=distance, free=free, unseen=unseen), replace(true, frechet=least, unseen=unseen)]


def prior(generator: DiTGenerator, folders: Sequence[Path], features: Features, seed: int) -> list[NaturalnessRow]:
    """Measure the prior alone, which continues histories of held-out clips, beside those clips."""
    found = held_out(folders, "base")
    if found is None:
        return []
    held, rest = (_some(part, _MOST, seed) for part in found)
    histories = [held.motion(index)[:HISTORY] for index in range(len(held))]
    keys = [(seed, 9, index) for index in range(len(held))]
    # No adapter: the prior runs alone.
    futures = generator.generate_batch(histories, None, [{}] * len(held), keys)
    whole = [history.then(future) for history, future in zip(histories, futures, strict=True)]
    made, true, other = (_arrays(part) for part in (whole, held, rest))
    distance, least = (measures.frechet(features(*part), features(*true)) for part in (made, other))
    rows = (("generated", made, distance), ("held-out", true, least))
    unseen = found[0].clips
    return [replace(_row(PRIOR, name, *part, False), frechet=frechet, unseen=unseen) for name, part, frechet in rows]


def _arrays(motions: Sequence[Motion] | Chunks) -> tuple[Array, Array]:
    if isinstance(motions, Chunks):
        return motions.root.astype(float), motions.rotations.astype(float)
    return stacked(motions)


def likeness(
    generator: DiTGenerator, command: Command, held: Chunks, rest: Chunks, features: Features, seed: int
) -> tuple[float, float]:
    """Return two Frechet distances to held-out chunks: of generated motion, and of the other chunks.

    The model gets the histories and parameters of the held-out chunks. NaN for too few chunks.
    """
    held, rest = _some(held, _MOST, seed), _some(rest, _MOST, seed)
    motions = [held.motion(index)[:HISTORY] for index in range(len(held))]
    extend(generator, command, motions, np.arange(len(held)), _asked(command, held), (seed, 7))
    made = features(*_arrays(motions))
    true, other = (features(*_arrays(part)) for part in (held, rest))
    return measures.frechet(made, true), measures.frechet(other, true)


def _asked(command: Command, chunks: Chunks) -> Array:
    """Return the parameters that chunks achieve (N, k), clipped to the adapter's range."""
    values = chunks.params.astype(float)
    return np.clip(values, command.low, command.high) if len(command.low) else values


def free_running(
    generator: DiTGenerator, command: Command, data: Chunks, features: Features, seed: int, calls: int = 4
) -> float:
    """Return the Frechet distance to real chunks of motion that starts from standing and continues itself.

    The model gets only parameters, drawn from those of the chunks. The first call does not count. Windows begin at any
    frame, as those of real clips do: all bodies start with the same foot, so that their calls begin in step.
    """
    some = _some(data, _MOST // 3, seed)
    motions = [generator.start() for _ in range(len(some))]
    random = np.random.default_rng((seed, 8))
    for call in range(calls):
        values = _asked(command, some[random.permutation(len(some))])
        extend(generator, command, motions, np.arange(len(some)), values, (seed, 8, call))
    starts = random.integers(FUTURE, (calls - 1) * FUTURE + 1, (len(motions), calls - 1)).tolist()
    windows = [motion[at : at + HISTORY + FUTURE] for motion, own in zip(motions, starts, strict=True) for at in own]
    made = canonical(*_arrays(windows))
    return measures.frechet(features(*made), features(*_arrays(data)))


def held_out(folders: Sequence[Path], skill: str) -> tuple[Chunks, Chunks] | None:
    """Return chunks of held-out clips and real chunks of the other clips; None if they are too few for a distance."""
    held, rest = of_skill([folder / "held_out" for folder in folders], skill), of_skill(folders, skill)
    return (held, rest) if held and rest and len(held) >= 2 * measures.COMPONENTS else None


def _features(folders: Sequence[Path]) -> Features | None:
    base = of_skill(folders, "base")
    return Features.of(base.root[:4000].astype(float), base.rotations[:4000].astype(float)) if base else None


def _some(chunks: Chunks, most: int, seed: int) -> Chunks:
    # Sorted, so that chunks stay in the order of their clips.
    return chunks[np.sort(np.random.default_rng(seed).permutation(len(chunks))[:most])]


def skills_table(rows: Sequence[NaturalnessRow]) -> str:
    heads = (
        "skill",
        "motion",
        "chunks",
        "skate cm/s",
        "slower toe cm/s",
        "sunk cm",
        "joint jerk m/s3",
        "beyond limits",
        "Frechet",
        "free-running",
    )
    return table(heads, [
        (row.skill, row.source, str(row.chunks), cell(row.skate), cell(row.slower_toe), cell(row.sunk, 2),
         cell(row.jerk, 0), f"{100 * row.beyond:.1f} %", cell(row.frechet), cell(row.free))
        for row in rows
    ])  # fmt: skip
