"""Naturalness: generated motion compared with real motion, by feet, joints, likeness, transitions, gait and jerk.

    humanclaw naturalness --chunks REAL EDITED

* The prior alone continues the histories of held-out real chunks.
* Skills: the generated rollouts of the fidelity table and the data's own chunks get the same measures. For the Frechet
  distance, the model continues histories of held-out real chunks (CHUNKS/held_out) with the parameters that these
  achieve, so that only the style differs. If held-out clips show too little of a skill, half of the training chunks,
  split by clip, takes their place, marked with a star. The data's row has the distance of the other chunks.
  Free-running, the model starts from standing and continues its own motion.
* Transitions: peak joint acceleration where a second skill takes over, for every ordered pair of skills, over the peak
  in real motion (the 99.9th percentile of the same two-frame peak over real chunks that move).
* Life: 120 random calls in a row.
* Gait: straight walks of several speeds, their first calls and later ones, of the model and in half-physics, beside
  people's with --clips. Drift: where a hundred straight calls in a row end. Corners: the lowest hips of walks at every
  corner of the range, in half-physics.
* Inside: share of frames in which hands are in thighs or trunk, or the legs in each other.
* Seats: how installed skills sit down on seats in half-physics, and get up again.
* First steps: slide of the slower toe in the first chunk from standing, per skill.
* Sequences: root-rigid jerk of the six sequences that the paper names.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from humanclaw import HumanclawError, Simulator
from humanclaw.cli import show_markdown
from humanclaw.skills import MEASURES
from humanclaw_train.eval.fidelity import generator_options, made_generator
from humanclaw_train.eval.first_steps import first_steps, first_steps_table
from humanclaw_train.eval.likeness import skills, skills_table
from humanclaw_train.eval.long_rollout import life, life_line
from humanclaw_train.eval.long_walks import corners, corners_table, physical_gaits
from humanclaw_train.eval.rollouts import Command, Installed, Measures, adapters
from humanclaw_train.eval.seats import seats, seats_table
from humanclaw_train.eval.self_penetration import inside_table, self_penetration
from humanclaw_train.eval.sequences import sequence_jerks, sequences_table
from humanclaw_train.eval.simulated import Actor, Place
from humanclaw_train.eval.transitions import real_peak, transitions, transitions_table
from humanclaw_train.eval.walks import drift, drift_line, gait_table, generated_gaits, real_gaits, walker
from humanclaw_train.markdown import as_json
from humanclaw_train.mocap.clips import load_pack

if TYPE_CHECKING:
    from humanclaw.motion import DiTGenerator

T = TypeVar("T")


# -- the command line --------------------------------------------------------------------------------------------------
@dataclass
class _Printer:
    """Prints each result at once, because the whole takes minutes; or keeps all of them for JSON."""

    keeps: bool
    found: dict[str, object] = field(default_factory=dict)

    def __call__(self, name: str, found: T, words: Callable[[T], str]) -> None:
        if self.keeps:
            self.found[name] = found
        else:
            show_markdown(words(found) + "\n\n")


def main(
    arguments: Sequence[str] | None = None,
    installed: Installed | None = None,
    commanded: Measures = lambda: MEASURES,
    seat: Place | None = None,
    simulator: Callable[[str], Simulator] | None = None,
) -> int:
    """Run the command line.

    installed: returns the adapters to measure. commanded: returns the known measures. seat: puts a body into a scene;
    without it neither seats nor skills as played are measured. simulator: makes the named one; without it nothing walks
    in half-physics.
    """
    options = _parser().parse_args(arguments)
    show = _Printer(options.json)
    try:
        generator = made_generator(options)
        paths, known = adapters(options.adapters, options.skills, installed), commanded()
        there = installed() if installed else {}
        commands = [Command.of(skill, path, known, there) for skill, path in paths.items()]
        show("skills", skills(generator, commands, options.chunks, options.rollouts, options.seed), skills_table)
        show("sequences", sequence_jerks(generator, commands, seed=options.seed), sequences_table)
        show("first steps", first_steps(generator, commands, seed=options.seed), first_steps_table)
        if (walks := walker(commands)) is not None:
            _walks(show, generator, walks, options, simulator)
        found = self_penetration(generator, commands, options.rollouts, options.seed, seat)
        show("inside", found, inside_table)
        if seat is not None:
            show("seats", seats(seat, options.seed), seats_table)
        peak = real_peak(options.chunks, commands)
        show("transitions", transitions(generator, commands, peak, options.bodies, options.seed), transitions_table)
        show("life", life(generator, commands, options.calls, seed=options.seed), life_line)
    except HumanclawError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    show("solver", f"{generator.solver}; base {generator.digest}", str)
    if options.json:
        print(as_json(show.found))
    return 0


def _walks(
    show: _Printer,
    generator: DiTGenerator,
    walks: Command,
    options: argparse.Namespace,
    simulator: Callable[[str], Simulator] | None,
) -> None:
    """Show the gaits, the drift and, in half-physics, the corners of the range."""
    made = generated_gaits(generator, walks, min(24, options.bodies), seed=options.seed)
    real = real_gaits(load_pack(options.clips) if options.clips else [], walks.skill)
    actor = Actor(generator, simulator(options.simulator)) if simulator is not None else None
    if actor is not None:
        for speed, gaits in physical_gaits(actor, walks, options.seed).items():
            made[speed] |= gaits
    show("gaits", (real, made), lambda gaits: gait_table(*gaits))
    show("drift", drift(generator, walks, min(10, options.bodies), seed=options.seed), drift_line)
    if actor is not None and options.corners:
        found = corners(actor, walks, options.corners, min(6, options.bodies), options.seed)
        show("corners", found, corners_table)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="humanclaw naturalness", description=(__doc__ or "").splitlines()[0])
    generator_options(parser)
    parser.add_argument("--chunks", type=Path, nargs="*", default=[], help="folders of chunks to compare with")
    parser.add_argument("--clips", type=Path, help="folder with clips.csv, for the gait of real walks")
    parser.add_argument("--json", action="store_true", help="print JSON")
    parser.add_argument("--bodies", type=int, default=20, help="bodies per pair of skills (default: 20)")
    parser.add_argument("--calls", type=int, default=120, help="calls of the long life (default: 120)")
    parser.add_argument("--corners", type=int, default=100, help="calls at every corner; 0 for none (default: 100)")
    parser.add_argument("--simulator", default="", help="name of the simulator (default: as in episodes)")
    return parser


if __name__ == "__main__":
    sys.exit(main())
