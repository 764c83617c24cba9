"""How human the motion is, beside real motion: feet, joints, likeness, transitions, and the jerk of whole sequences.

    humanclaw naturalness --chunks REAL EDITED

* Skills: the generated rollouts of the fidelity table, and the data's own chunks, through the same measures. For the Frechet
  distance the model continues the histories of held-out real chunks with the parameters that those realise, so that only the
  manner differs; its floor is the distance between two halves of the real chunks, split by clip.
* Transitions: every ordered pair of the skills; the peak joint acceleration where the second skill takes over, against the peak in
  real motion (the 99.9th percentile of the same two-frame peak over all windows of the real chunks that move).
* Life: 120 random calls in a row, as the model feeds on its own motion.
* Sequences: the root-rigid jerk of the six sequences that the paper names.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from humanclaw.body import JOINT_INDEX
from humanclaw.errors import HumanclawError
from humanclaw.measures import Declaration, suited
from humanclaw.motion.generator import DiTGenerator
from humanclaw.pose import FUTURE, HISTORY, Array, Motion, forward_kinematics, root_jerk
from humanclaw_train import measures
from humanclaw_train.chunks import Chunks
from humanclaw_train.fidelity import generator_options, made_generator
from humanclaw_train.measures import SEAM, Features
from humanclaw_train.rollouts import Command, adapters, extend, others, roll

_NAN: Final = float("nan")
_MOST: Final = 600
"""Chunks of one kind that a measure looks at."""


# -- skills ------------------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Manner:
    """One skill's motion in numbers, generated or from the data."""

    skill: str
    source: str
    """generated, real or edited."""
    chunks: int
    skate: float
    """Horizontal speed of toes on the ground, cm/s; NaN on stairs, whose ground is not at 0."""
    slower_toe: float
    """Horizontal speed of the slower toe, cm/s."""
    sunk: float
    """Depth of the lowest sole, cm; NaN on stairs."""
    jerk: float
    """Of all joints, m/s^3."""
    beyond: float
    """Share of frames with a leg joint beyond its limits."""
    frechet: float = _NAN
    """To held-out real chunks of the skill."""


def manner(skill: Declaration, source: str, root: Array, rotations: Array, frechet: float = _NAN) -> Manner:
    """Measure canonical chunks, root (N, 20, 3) and rotations (N, 20, 24, 3)."""
    joints, _ = forward_kinematics(root, rotations)
    future, stairs = joints[:, HISTORY - 1 :], skill.climbs
    return Manner(
        skill.skill, source, len(root),
        _NAN if stairs else measures.skate(future), measures.slower_toe(future),
        _NAN if stairs else measures.penetration(future), measures.joint_jerk(joints[:, HISTORY - 3 :]),
        float((measures.beyond_limits(rotations[:, HISTORY:]) > 0).mean()), frechet,
    )  # fmt: skip


def skills(
    generator: DiTGenerator, commands: Sequence[Command], folders: Sequence[Path], rollouts: int, seed: int
) -> list[Manner]:
    """For every skill what is generated and, where the folders have it, what the data show: real chunks, else edited ones."""
    features = _features(folders)
    rows: list[Manner] = []
    for command in commands:
        rolled = roll(generator, command, others(command, commands), rollouts, seed)
        data = _of_skill(folders, command.skill)
        distance, least = likeness(generator, command, data, features, seed) if data and features else (_NAN, _NAN)
        rows.append(manner(command.declaration, "generated", rolled.root, rolled.rotations, distance))
        if data:
            kind = "real" if data.real.any() else "edited"
            some = _some(data, _MOST, seed)
            rows.append(manner(command.declaration, kind, some.root.astype(float), some.rotations.astype(float), least))
    return rows


def likeness(
    generator: DiTGenerator, command: Command, data: Chunks, features: Features, seed: int
) -> tuple[float, float]:
    """Frechet distances to held-out chunks: of what the model makes of their histories and parameters, and of the other chunks.

    Clips are dealt out to the two halves; a skill whose chunks come from one clip is split in time. NaN for too few chunks.
    """
    held, rest = halves(data)
    held, rest = _some(held, _MOST, seed), _some(rest, _MOST, seed)
    motions = [held.motion(index)[:HISTORY] for index in range(len(held))]
    values = np.clip(held.params.astype(float), command.low, command.high) if len(command.low) else held.params
    extend(generator, command, motions, np.arange(len(held)), values.astype(float), (seed, 7))
    made = features(*(np.stack([getattr(motion, part) for motion in motions]) for part in ("root", "rotations")))
    true = features(held.root.astype(float), held.rotations.astype(float))
    other = features(rest.root.astype(float), rest.rotations.astype(float))
    return measures.frechet(made, true), measures.frechet(other, true)


def halves(chunks: Chunks) -> tuple[Chunks, Chunks]:
    """Two halves of about the same size without a clip in common; of a single clip its first and its second half."""
    names, counts = np.unique(chunks.source, return_counts=True)
    if len(names) == 1:
        middle = len(chunks) // 2
        return chunks[:middle], chunks[middle:]
    first: list[str] = []
    sizes = [0, 0]
    for index in np.argsort(-counts):
        side = int(sizes[0] > sizes[1])
        sizes[side] += int(counts[index])
        if side == 0:
            first.append(str(names[index]))
    mask = np.isin(chunks.source, first)
    return chunks[mask], chunks[~mask]


def _of_skill(folders: Sequence[Path], skill: str) -> Chunks | None:
    """The real chunks of a skill, and edited ones where there is none."""
    files = [folder / f"{skill}.npz" for folder in folders if (folder / f"{skill}.npz").is_file()]
    if not files:
        return None
    chunks = Chunks.join(Chunks.load(file) for file in files)
    return chunks[chunks.real] if chunks.real.any() else chunks


def _features(folders: Sequence[Path]) -> Features | None:
    base = _of_skill(folders, "base")
    return Features.of(base.root[:4000].astype(float), base.rotations[:4000].astype(float)) if base else None


def _some(chunks: Chunks, most: int, seed: int) -> Chunks:
    return chunks[np.sort(np.random.default_rng(seed).permutation(len(chunks))[:most])]


# -- transitions -------------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Transitions:
    """Peak joint accelerations (k, k) at the seam from a row's skill to a column's, m/s^2.

    worst, median: of the bodies. real: the peak of real motion.
    """

    skills: tuple[str, ...]
    worst: Array
    median: Array
    real: float


def transitions(
    generator: DiTGenerator, commands: Sequence[Command], real: float, bodies: int = 20, seed: int = 0
) -> Transitions:
    """From standing one chunk of the first skill, one of the second, with random parameters; all ordered pairs."""
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
    """99.9th percentile, over all windows of the real chunks of skills that move, of the peak that a seam is judged by, m/s^2."""
    peaks = [
        _window_peaks(data)
        for one in commands
        if one.declaration.role != "stop" and (data := _of_skill(folders, one.skill)) and data.real.all()
    ]
    return float(np.percentile(np.concatenate(peaks), 99.9)) if peaks else _NAN


def _window_peaks(chunks: Chunks) -> Array:
    joints, _ = forward_kinematics(chunks.root.astype(float), chunks.rotations.astype(float))
    size = measures.acceleration(joints)
    return np.maximum(size[:, 1:], size[:, :-1]).ravel()


# -- a long life -------------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Life:
    """What many random calls in a row do to a body. Degrees."""

    calls: int
    bodies: int
    toes_up: float
    """Mean of the ankles' toes-up angle over the last 20 calls of all bodies, less that over the first 20: a drift."""
    worst_toes_up: float
    """The largest mean over the last 20 calls of one body's ankle, less that over its first 20."""
    beyond: float
    """Share of frames of the last 20 calls with a leg joint beyond its limits."""
    most: float
    """The furthest that any is beyond, in all the calls."""


def life(
    generator: DiTGenerator, commands: Sequence[Command], calls: int = 120, bodies: int = 4, seed: int = 0
) -> Life:
    """Chain random calls of all the skills. Bodies that end up higher or lower do so because each chunk has its own floor."""
    random = np.random.default_rng((seed, 1))
    motions = [generator.start() for _ in range(bodies)]
    for call in range(calls):
        command = commands[int(random.integers(len(commands)))]
        extend(generator, command, motions, np.arange(bodies), command.draw(bodies, random), (seed, call))
    rotations = np.stack([motion.rotations for motion in motions])
    ankles = -np.degrees(rotations[:, :, [JOINT_INDEX["left_ankle"], JOINT_INDEX["right_ankle"]], 0])
    span = FUTURE * min(20, calls)
    drift = ankles[:, -span:].mean(1) - ankles[:, :span].mean(1)
    over = measures.beyond_limits(rotations)
    return Life(
        calls, bodies, float(drift.mean()), float(drift.max()), float((over[:, -span:] > 0).mean()), float(over.max())
    )


# -- sequences ---------------------------------------------------------------------------------------------------------
_WALK: Final = ("hips.forward", 0.4)
_SIDE: Final = ("hips.left", 0.2)
_TURN: Final = ("heading.left", float(np.radians(37.5)))
Call = tuple[str, float]
"""A measure and how much of it, SI: asked of the skill on the level that commands it and least besides, all else being 0."""
SEQUENCES: Final[Mapping[str, tuple[tuple[Call, ...], float]]] = {
    "forward walk": ((_WALK,) * 10, 5.2),
    "turn": ((_TURN,) * 10, 4.3),
    "walk, turn, walk": ((*[_WALK] * 4, *[_TURN] * 2, *[_WALK] * 4), 5.8),
    "five walks, then five side steps": ((*[_WALK] * 5, *[_SIDE] * 5), 4.7),
    "the same ten, interleaved": ((_WALK, _SIDE) * 5, 7.4),
    "aimless": ((), 9.7),
}
"""Ten chunks each, and the paper's jerk (section 5.2). Aimless draws steps ahead, aside and back, and turns, at random. The
paper gives neither parameters nor lengths; ours are the middle of each range: 40 cm ahead, 20 cm to the left, 37.5 degrees."""
_AIMLESS: Final = ("hips.forward", "hips.left", "hips.back", "heading.left")


def sequence_jerks(
    generator: DiTGenerator, commands: Sequence[Command], bodies: int = 20, seed: int = 0
) -> dict[str, float]:
    """Name to the mean root-rigid jerk, m/s^3, of the sequences whose skills are all there."""
    known = _by_measure(commands)
    found = {}
    for number, (name, (calls, _)) in enumerate(SEQUENCES.items()):
        if {measure for measure, _ in calls} <= set(known) and set(_AIMLESS) <= set(known):
            motions = _sequence(generator, known, calls, bodies, (seed, number))
            found[name] = float(np.mean([root_jerk(motion) for motion in motions]))
    return found


def _by_measure(commands: Sequence[Command]) -> dict[str, Command]:
    """For each measure that a sequence asks for the skill that is asked, as far as there is one."""
    level = {one.skill: one for one in commands if not one.declaration.climbs}
    found = {measure: suited((one.declaration for one in level.values()), measure) for measure in _AIMLESS}
    return {measure: level[one.skill] for measure, one in found.items() if one is not None}


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
    """Of all pairs of sequences, how many stand in the paper's order, and how many pairs there are."""
    names = list(found)
    pairs = [(a, b) for index, a in enumerate(names) for b in names[index + 1 :]]
    same = sum((found[a] < found[b]) == (SEQUENCES[a][1] < SEQUENCES[b][1]) for a, b in pairs)
    return same, len(pairs)


# -- tables ------------------------------------------------------------------------------------------------------------
def _table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [heads, ["---"] * len(heads), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def _cell(value: float, digits: int = 1) -> str:
    return f"{value:.{digits}f}" if np.isfinite(value) else "-"


def skills_table(rows: Sequence[Manner]) -> str:
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
    )
    return _table(heads, [
        (row.skill, row.source, str(row.chunks), _cell(row.skate), _cell(row.slower_toe), _cell(row.sunk, 2),
         _cell(row.jerk, 0), f"{100 * row.beyond:.1f} %", _cell(row.frechet))
        for row in rows
    ])  # fmt: skip


def transitions_table(found: Transitions) -> str:
    """Worst of the bodies over the peak of real motion; rows are the skill before, columns the one that takes over."""
    ratio = found.worst / found.real
    rows = [(skill, *(_cell(value, 2) for value in line)) for skill, line in zip(found.skills, ratio, strict=True)]
    order = np.argsort(-found.worst, axis=None)[:5]
    pairs = ", ".join(
        f"{found.skills[i]} to {found.skills[j]} {found.worst[i, j]:.0f}"
        for i, j in zip(*np.unravel_index(order, ratio.shape), strict=True)
    )
    notes = (
        f"Peak of real motion {found.real:.0f} m/s2; {int((ratio > 1.5).sum())} of {ratio.size} pairs over 1.5 times that. "
        f"Median seam {np.median(found.median):.0f} m/s2. Worst, m/s2: {pairs}."
    )
    heads = ("from, to", *found.skills)
    return f"{_table(heads, rows)}\n\n{notes}"


def life_line(found: Life) -> str:
    return (
        f"{found.calls} random calls in a row, {found.bodies} bodies: ankles {found.toes_up:+.1f} degrees toes-up "
        f"(worst {found.worst_toes_up:+.1f}); a leg joint beyond its limits in {100 * found.beyond:.1f} % of the last frames, "
        f"by {found.most:.0f} degrees at most."
    )


def sequences_table(found: Mapping[str, float]) -> str:
    rows = [(name, _cell(value), _cell(SEQUENCES[name][1])) for name, value in found.items()]
    same, pairs = agreement(found)
    return f"{_table(('sequence', 'jerk m/s3', 'paper'), rows)}\n\n{same} of {pairs} pairs stand in the paper's order."


def main(arguments: Sequence[str] | None = None) -> int:
    """The command line."""
    options = _parser().parse_args(arguments)
    try:
        generator = made_generator(options)
        commands = [Command.of(skill, path) for skill, path in adapters(options.adapters, options.skills).items()]
        print(skills_table(skills(generator, commands, options.chunks, options.rollouts, options.seed)), flush=True)
        print("\n" + sequences_table(sequence_jerks(generator, commands, seed=options.seed)), flush=True)
        peak = real_peak(options.chunks, commands)
        print(
            "\n" + transitions_table(transitions(generator, commands, peak, options.bodies, options.seed)), flush=True
        )
        print("\n" + life_line(life(generator, commands, options.calls, seed=options.seed)))
    except HumanclawError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    print(f"\n{generator.solver}; base {generator.digest}")
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="humanclaw naturalness", description=(__doc__ or "").splitlines()[0])
    generator_options(parser)
    parser.add_argument("--chunks", type=Path, nargs="*", default=[], help="folders of chunks to compare with")
    parser.add_argument("--bodies", type=int, default=20, help="for each pair of skills")
    parser.add_argument("--calls", type=int, default=120, help="of a long life")
    return parser


if __name__ == "__main__":
    sys.exit(main())
