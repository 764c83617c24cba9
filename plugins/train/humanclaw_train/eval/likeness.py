"""Likeness of a skill's motion to human motion: feet, joints, and Frechet distances to real motion."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np

from humanclaw import Motion
from humanclaw.body import FUTURE, HISTORY, Array, forward_kinematics
from humanclaw.motion import DiTGenerator
from humanclaw_train.data.chunks import Chunks, canonical, of_skill, stacked
from humanclaw_train.eval import measures
from humanclaw_train.eval.measures import Features
from humanclaw_train.eval.rollouts import Command, Subject, extend, others, roll
from humanclaw_train.markdown import Row

PRIOR: Final = "(the prior alone)"
_MOST: Final = 600
"""Largest number of chunks of one kind that a measure uses."""
_CALLS: Final = 4
"""Calls of a body that continues itself."""


def skills(subject: Subject) -> list[Row]:
    """Measure the prior and every skill: generated motion and, where there are any, real or else synthetic chunks."""
    generator, folders, seed = subject.generator, subject.chunks, subject.seed
    features = _features(folders)
    rows = prior(generator, folders, features, seed) if features else []
    for command in subject.commands:
        stairs, data = command.declaration.climbs, of_skill(folders, command.skill)
        rolled = roll(generator, command, others(command, subject.commands), subject.rollouts, seed)
        distance = least = free = np.nan
        if data is not None and features is not None:
            free = free_running(generator, command, data, features, seed)
            if (apart := held_out(folders, command.skill)) is not None:
                distance, least = likeness(generator, command, *apart, features, seed)
        rows.append(naturalness(command.skill, "generated", rolled.root, rolled.rotations, stairs, distance, free))
        if data is not None:
            kind, chunks = "real" if data.real.any() else "synthetic", _arrays(_some(data, _MOST, seed))
            rows.append(naturalness(command.skill, kind, *chunks, stairs, least))
    return rows


def naturalness(
    skill: str, motion: str, root: Array, rotations: Array, stairs: bool, held_out: float = np.nan, free: float = np.nan
) -> Row:
    """Measure canonical chunks, root (N, 20, 3) and rotations (N, 20, 24, 3).

    stairs: the ground is not at 0, so that neither skate nor depth of the soles is known. held_out, free: Frechet
    distances of `likeness` and `free_running`.
    """
    joints, _ = forward_kinematics(root, rotations)
    future = joints[:, HISTORY - 1 :]
    return {
        "skill": skill,
        "motion": motion,
        "chunks": len(root),
        "skate cm/s": np.nan if stairs else measures.skate(future),
        "slower toe cm/s": measures.slower_toe(future),
        "sunk cm": np.nan if stairs else measures.penetration(future),
        # Jerk is a third difference: from three frames before the seam on, it counts the seam.
        "joint jerk m/s3": measures.joint_jerk(joints[:, HISTORY - 3 :]),
        "beyond limits %": measures.beyond_limits(rotations[:, HISTORY:]),
        "Frechet": held_out,
        "free-running": free,
    }


def prior(generator: DiTGenerator, folders: Sequence[Path], features: Features, seed: int) -> list[Row]:
    """Measure the prior alone, which continues histories of held-out clips, beside those clips."""
    apart = held_out(folders, "base")
    if apart is None:
        return []
    held, rest = (_some(part, _MOST, seed) for part in apart)
    histories = [held.motion(index)[:HISTORY] for index in range(len(held))]
    keys = [(seed, 9, index) for index in range(len(held))]
    # No adapter: the prior runs alone.
    futures = generator.generate_batch(histories, None, [{}] * len(held), keys)
    whole = [history.then(future) for history, future in zip(histories, futures, strict=True)]
    made, true, other = (_arrays(part) for part in (whole, held, rest))
    distance, least = (measures.frechet(features(*part), features(*true)) for part in (made, other))
    rows = (("generated", made, distance), ("held-out", true, least))
    return [naturalness(PRIOR, motion, *part, False, frechet) for motion, part, frechet in rows]


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


def free_running(generator: DiTGenerator, command: Command, data: Chunks, features: Features, seed: int) -> float:
    """Return the Frechet distance to real chunks of motion that starts from standing and continues itself.

    The model gets only parameters, drawn from those of the chunks. The first call does not count. Windows begin at any
    frame, as those of real clips do: all bodies start with the same foot, so that their calls begin in step.
    """
    some = _some(data, _MOST // 3, seed)
    motions = [generator.start() for _ in range(len(some))]
    random = np.random.default_rng((seed, 8))
    for call in range(_CALLS):
        values = _asked(command, some[random.permutation(len(some))])
        extend(generator, command, motions, np.arange(len(some)), values, (seed, 8, call))
    starts = random.integers(FUTURE, (_CALLS - 1) * FUTURE + 1, (len(motions), _CALLS - 1)).tolist()
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
