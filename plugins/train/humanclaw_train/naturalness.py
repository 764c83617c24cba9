"""How human the motion is, beside real motion: feet, joints, likeness, transitions, and the jerk of whole sequences.

    humanclaw naturalness --chunks REAL EDITED

* The prior alone: it continues the histories of held-out real chunks, whatever they show.
* Skills: the generated rollouts of the fidelity table, and the data's own chunks, through the same measures. For the
  Frechet distance the model continues the histories of held-out real chunks (CHUNKS/held_out, of clips that nothing
  learnt from; where they show too little of a skill a half of what was learnt from, split by clip and marked with a
  star) with the parameters that those realise, so that only the style differs; its floor is the distance of the other
  chunks. Free-running, it begins from standing and feeds on its own motion.
* Transitions: every ordered pair of the skills; the peak joint acceleration where the second skill takes over, against
  the peak in real motion (the 99.9th percentile of the same two-frame peak over all windows of the real chunks that
  move).
* Life: 120 random calls in a row, as the model feeds on its own motion.
* Gait (with --clips): cadence, sway, bob, swing knee, speed ripple and arms of straight walks, real clips one by one
  beside walks generated at their speeds; the spread is over seeds. Heading: where a hundred straight calls in a row end
  up.
* First steps: how far the slower toe slides in the first chunk from standing, per skill.
* Sequences: the root-rigid jerk of the six sequences that the paper names.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np

from humanclaw import CheckpointError, HumanclawError, Motion
from humanclaw.body import FPS, FUTURE, HISTORY, JOINT_INDEX, Array, forward_kinematics, root_jerk
from humanclaw.cli import show_markdown
from humanclaw.motion import DiTGenerator
from humanclaw.skills import MEASURES, suited
from humanclaw_train import measures
from humanclaw_train.chunks import Chunks, Clip, load_pack
from humanclaw_train.fidelity import generator_options, made_generator
from humanclaw_train.first_steps import FirstSteps, first_steps, first_steps_table
from humanclaw_train.likeness import PRIOR, NaturalnessRow, of_skill, skills, skills_table
from humanclaw_train.measures import SEAM, Gait
from humanclaw_train.rollouts import Command, Installed, Measures, adapters, extend, file_digest
from humanclaw_train.tables import as_json, cell, numbers, save, table
from humanclaw_train.travel import Drift, drift, straight_walks, walker

_NAN: Final = float("nan")


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
    """99.9th percentile, over all windows of the real chunks of skills that move, of the peak that a seam is judged by,
    m/s^2."""
    peaks = [
        _window_peaks(data)
        for one in commands
        if one.declaration.role != "stop" and (data := of_skill(folders, one.skill)) and data.real.all()
    ]
    return float(np.percentile(np.concatenate(peaks), 99.9)) if peaks else _NAN


def _window_peaks(chunks: Chunks) -> Array:
    joints, _ = forward_kinematics(chunks.root.astype(float), chunks.rotations.astype(float))
    size = measures.acceleration(joints)
    return np.maximum(size[:, 1:], size[:, :-1]).ravel()


# -- gait --------------------------------------------------------------------------------------------------------------
_STRAIGHT: Final = 0.96
"""Least ratio of the way from end to end over the path of a walk that counts as straight."""


def real_gaits(clips: Iterable[Clip], tag: str) -> dict[str, Gait]:
    """Clip to the gait of its longest straight span of a tag, for clips that show one of two steps and a second."""
    found = {}
    for clip in clips:
        spans = sorted(clip.spans.get(tag, ()), key=lambda span: span[0] - span[1])
        walk = clip.motion[spans[0][0] : spans[0][1] + 1] if spans else None
        if walk is not None and len(walk) > FPS and _straightness(walk) > _STRAIGHT:
            gait = Gait.of(walk)
            if gait is not None and gait.speed > 0.7:
                found[f"{clip.source.split()[0]} {clip.name}"] = gait
    return found


def _straightness(walk: Motion) -> float:
    floor = walk.root[:, [0, 2]]
    return float(np.linalg.norm(floor[-1] - floor[0]) / np.linalg.norm(np.diff(floor, axis=0), axis=-1).sum())


def generated_gaits(
    generator: DiTGenerator, command: Command, bodies: int = 24, calls: int = 8, seed: int = 0
) -> dict[str, list[Gait]]:
    """Speeds from slow to fast to the gaits of bodies that differ in nothing but their noise, from the third call
    on."""
    found = {}
    for speed in (0.9, 1.0, 1.3, 1.6):
        walks = straight_walks(generator, command, speed, bodies, calls, seed)
        gaits = [Gait.of(walk[HISTORY + 2 * FUTURE :]) for walk in walks]
        found[f"generated, {speed:.1f} m/s"] = [gait for gait in gaits if gait is not None]
    return {name: gaits for name, gaits in found.items() if gaits}


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
    """Chain random calls of all the skills. Bodies that end up higher or lower do so because each chunk has its own
    floor."""
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
"""A measure and how much of it, SI: asked of the skill on the level that commands it and least besides, all else being
0."""
SEQUENCES: Final[Mapping[str, tuple[tuple[Call, ...], float]]] = {
    "forward walk": ((_WALK,) * 10, 5.2),
    "turn": ((_TURN,) * 10, 4.3),
    "walk, turn, walk": ((*[_WALK] * 4, *[_TURN] * 2, *[_WALK] * 4), 5.8),
    "five walks, then five side steps": ((*[_WALK] * 5, *[_SIDE] * 5), 4.7),
    "the same ten, interleaved": ((_WALK, _SIDE) * 5, 7.4),
    "aimless": ((), 9.7),
}
"""Ten chunks each, and the paper's jerk (section 5.2). Aimless draws steps ahead, aside and back, and turns, at random.
The paper gives neither parameters nor lengths; ours are the middle of each range: 40 cm ahead, 20 cm to the left, 37.5
degrees."""
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
    """Of all pairs of sequences, how many stand in the paper's order, and how many pairs there are."""
    names = list(found)
    pairs = [(a, b) for index, a in enumerate(names) for b in names[index + 1 :]]
    same = sum((found[a] < found[b]) == (SEQUENCES[a][1] < SEQUENCES[b][1]) for a, b in pairs)
    return same, len(pairs)


# -- the report --------------------------------------------------------------------------------------------------------
REPORT: Final = "naturalness.json"
"""Where the report lies, beside the base."""


@dataclass(frozen=True)
class NaturalnessReport:
    """What model cards quote: what `--save` writes."""

    base: str
    """Digest of the base."""
    solver: str
    adapters: Mapping[str, str]
    """Skill to the digest of its adapter's file."""
    rows: tuple[NaturalnessRow, ...]
    first_steps: Mapping[str, FirstSteps]

    @classmethod
    def load(cls, path: Path) -> NaturalnessReport:
        """Read what `--save` wrote. Raises CheckpointError for anything else."""
        try:
            content = json.loads(path.read_text("utf-8"))
            rows = tuple(NaturalnessRow(**numbers(row) | {"unseen": tuple(row["unseen"])}) for row in content["rows"])
            first = {skill: FirstSteps(**one) for skill, one in content["first_steps"].items()}
            return cls(**content | {"rows": rows, "first_steps": first})
        except (OSError, ValueError, KeyError, TypeError) as error:
            hint = f"Measure with: humanclaw naturalness --chunks CHUNKS --save {path}"
            raise CheckpointError(f"{path} holds no naturalness report ({error}).", hint) from error

    def of(self, skill: str, adapter: str) -> tuple[NaturalnessRow, ...]:
        """Return the rows of the skill whose adapter has this digest; none for other weights."""
        return tuple(row for row in self.rows if row.skill == skill) if self.adapters.get(skill) == adapter else ()

    @property
    def prior(self) -> tuple[NaturalnessRow, ...]:
        """Return the rows of the prior alone."""
        return tuple(row for row in self.rows if row.skill == PRIOR)


# -- tables ------------------------------------------------------------------------------------------------------------
_GAIT: Final = ("speed", "cadence", "step", "sway", "bob", "knee", "ripple", "arms", "toe")


def gait_table(real: Mapping[str, Gait], made: Mapping[str, Sequence[Gait]]) -> str:
    """Return a row a real clip and a row a generated speed, whose cells are the median and the 5th to 95th percentile
    over seeds."""
    heads = (
        "straight walk", "m/s", "steps/s", "step m", "sway cm", "bob cm", "swing knee", "ripple", "arms cm",
        "slower toe cm/s"
    )  # fmt: skip
    rows = [(name, *(cell(getattr(gait, key), 2) for key in _GAIT)) for name, gait in real.items()]
    for name, gaits in made.items():
        spread = [np.percentile([getattr(gait, key) for gait in gaits], [50, 5, 95]) for key in _GAIT]
        rows.append((name, *(f"{mid:.2f} ({low:.2f} to {high:.2f})" for mid, low, high in spread)))
    return table(heads, rows)


def drift_line(found: Drift) -> str:
    return (
        f"A hundred straight calls in a row, 50 m, end {found.side[0]:+.2f} m to the side (95 % within "
        f"{found.side[1]:.2f} m) "
        f"and turned by {found.turned[0]:+.1f} degrees (95 % within {found.turned[1]:.1f})."
    )


def transitions_table(found: Transitions) -> str:
    """Worst of the bodies over the peak of real motion; rows are the skill before, columns the one that takes over."""
    ratio = found.worst / found.real
    rows = [(skill, *(cell(value, 2) for value in line)) for skill, line in zip(found.skills, ratio, strict=True)]
    order = np.argsort(-found.worst, axis=None)[:5]
    pairs = ", ".join(
        f"{found.skills[i]} to {found.skills[j]} {found.worst[i, j]:.0f}"
        for i, j in zip(*np.unravel_index(order, ratio.shape), strict=True)
    )
    notes = (
        f"Peak of real motion {found.real:.0f} m/s2; {int((ratio > 1.5).sum())} of {ratio.size} pairs over 1.5 times "
        "that. "
        f"Median seam {np.median(found.median):.0f} m/s2. Worst, m/s2: {pairs}."
    )
    heads = ("from, to", *found.skills)
    return f"{table(heads, rows)}\n\n{notes}"


def life_line(found: Life) -> str:
    return (
        f"{found.calls} random calls in a row, {found.bodies} bodies: ankles {found.toes_up:+.1f} degrees toes-up "
        f"(worst {found.worst_toes_up:+.1f}); a leg joint beyond its limits in {100 * found.beyond:.1f} % of the last "
        "frames, "
        f"by {found.most:.0f} degrees at most."
    )


def sequences_table(found: Mapping[str, float]) -> str:
    rows = [(name, cell(value), cell(SEQUENCES[name][1])) for name, value in found.items()]
    same, pairs = agreement(found)
    return f"{table(('sequence', 'jerk m/s3', 'paper'), rows)}\n\n{same} of {pairs} pairs stand in the paper's order."


@dataclass
class _Teller:
    """Shows each thing as soon as it is found, or keeps all for JSON: the whole takes minutes."""

    keeps: bool
    found: dict[str, Any] = field(default_factory=dict)

    def __call__(self, name: str, found: Any, words: Callable[[Any], str]) -> None:
        if self.keeps:
            self.found[name] = found
        else:
            show_markdown(words(found) + "\n\n")


def main(
    arguments: Sequence[str] | None = None, installed: Installed | None = None, commanded: Measures = lambda: MEASURES
) -> int:
    """Run the command line.

    installed: finds the skills that are measured. commanded: finds what they command.
    """
    options = _parser().parse_args(arguments)
    tell = _Teller(options.json)
    try:
        generator = made_generator(options)
        paths, known = adapters(options.adapters, options.skills, installed), commanded()
        commands = [Command.of(skill, path, known) for skill, path in paths.items()]
        rows = skills(generator, commands, options.chunks, options.rollouts, options.seed)
        tell("skills", rows, skills_table)
        tell("sequences", sequence_jerks(generator, commands, seed=options.seed), sequences_table)
        first = first_steps(generator, commands, seed=options.seed)
        tell("first steps", first, first_steps_table)
        if options.save:
            digests = {one.skill: file_digest(one.adapter) for one in commands}
            report = NaturalnessReport(generator.digest, str(generator.solver), digests, tuple(rows), first)
            save(options.save, asdict(report))
        if (walks := walker(commands)) is not None:
            made = generated_gaits(generator, walks, min(24, options.bodies), seed=options.seed)
            real = real_gaits(load_pack(options.clips) if options.clips else [], walks.skill)
            tell("gaits", (real, made), lambda gaits: gait_table(*gaits))
            tell("drift", drift(generator, walks, min(10, options.bodies), seed=options.seed), drift_line)
        peak = real_peak(options.chunks, commands)
        tell("transitions", transitions(generator, commands, peak, options.bodies, options.seed), transitions_table)
        tell("life", life(generator, commands, options.calls, seed=options.seed), life_line)
    except HumanclawError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    tell("solver", f"{generator.solver}; base {generator.digest}", str)
    if options.json:
        print(as_json(tell.found))
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="humanclaw naturalness", description=(__doc__ or "").splitlines()[0])
    generator_options(parser)
    parser.add_argument("--chunks", type=Path, nargs="*", default=[], help="folders of chunks to compare with")
    parser.add_argument(
        "--clips", type=Path, help="folder with clips.csv, whose straight walks the gait is compared with"
    )
    parser.add_argument("--save", type=Path, metavar="FILE", help="write rows and first steps as JSON, for the cards")
    parser.add_argument("--json", action="store_true", help="print JSON")
    parser.add_argument("--bodies", type=int, default=20, help="for each pair of skills")
    parser.add_argument("--calls", type=int, default=120, help="of a long life")
    return parser


if __name__ == "__main__":
    sys.exit(main())
