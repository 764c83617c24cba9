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
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Final

from humanclaw import CheckpointError, HumanclawError
from humanclaw.cli import show_markdown
from humanclaw.measures import MEASURES
from humanclaw_train.chunks import load_pack
from humanclaw_train.fidelity import generator_options, made_generator
from humanclaw_train.first_steps import FirstSteps, first_steps, first_steps_table
from humanclaw_train.life import life, life_line
from humanclaw_train.likeness import PRIOR, NaturalnessRow, skills, skills_table
from humanclaw_train.rollouts import Command, Installed, Measures, adapters, file_digest
from humanclaw_train.sequences import sequence_jerks, sequences_table
from humanclaw_train.tables import as_json, numbers, save
from humanclaw_train.transitions import real_peak, transitions, transitions_table
from humanclaw_train.walks import drift, drift_line, gait_table, generated_gaits, real_gaits, walker

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


# -- the command line --------------------------------------------------------------------------------------------------
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
