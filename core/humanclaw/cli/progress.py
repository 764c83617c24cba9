"""Progress of an episode on the terminal."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Final

from rich.padding import Padding

from humanclaw.cli.terminal import Console
from humanclaw.plugins.hookspecs import hookimpl
from humanclaw.records.instructions import ALIASES, SEATS
from humanclaw.records.specification import EpisodeSpec
from humanclaw.records.steps import EpisodeRecord, StepRecord
from humanclaw.text.words import counted
from humanclaw.world.simulator import Chunk

_WIDE: Final = 120
"""Columns of a terminal that has room for a call and its reason on one line."""


class StepProgress:
    """Prints one line for each step: call, distance, time and reasoning."""

    def __init__(self, console: Console, max_steps: int, distances: bool = True) -> None:
        """distances: whether to print the distance to the target; a person who decides at this terminal must not see
        it."""
        self._console, self._distances = console, distances
        self._width = len(str(max_steps))
        self._chunks: Counter[tuple[str, int]] = Counter()
        """Chunks of each step of each episode."""
        self._begun = False
        self._wide = not console.is_terminal or console.width >= _WIDE

    def _print(self, line: str) -> None:
        """Print a line, under the head if it is the first. An error in place of a first step has no head."""
        if not self._begun:
            near = "to target" if self._distances else ""
            self._console.print(f"{'':>{self._width}}  {'call':<44} {near:>9} {'time':>6}", style="dim")
        self._begun = True
        self._console.print(line, soft_wrap=True)

    @hookimpl
    def humanclaw_chunk(self, episode: EpisodeRecord, step: int, chunk: Chunk) -> None:
        """Print a line for each chunk of a call after the first."""
        self._chunks[episode.spec.id, step] += 1
        if (played := self._chunks[episode.spec.id, step]) > 1:
            x, _, z = chunk.execution.simulated.root[-1]
            self._print(f"{'':>{self._width}}  ... {_by(episode)}{played / 2:g} s, at x {x:.2f} z {z:.2f}")

    @hookimpl
    def humanclaw_step(self, episode: EpisodeRecord, step: StepRecord) -> None:
        thought = (step.feedback.refusal or step.decision.reasoning).split("\n")[0]
        known = self._distances and step.target_distance is not None
        near = f"{step.target_distance:.2f} m" if known else ""
        call = _by(episode) + str(step.call or "(no usable call)")
        took = f"{sum(step.seconds.values()):4.1f} s" if step.seconds else ""
        line = f"{step.step:>{self._width}}  {call:<44} {near:>9} {took:>6}"
        if self._wide:
            self._print(f"{line}  {thought}".rstrip())
        else:
            self._print(line)
            self._console.print(Padding(thought, (0, 0, 0, self._width + 2)), style="dim")


def _by(episode: EpisodeRecord) -> str:
    """Say whose line it is, where there are several bodies: two of them may have agents of one name."""
    return f"{episode.agent} {episode.company.index(episode.spec.id) + 1}: " if episode.company else ""


def scoring(spec: EpisodeSpec) -> str:
    """Return one sentence about what the episode of a free instruction is scored by, as its words were understood."""
    if not spec.target_category:
        known = ", ".join(ALIASES).replace("_", " ")
        return f"Not scored: the instruction names none of {known}."
    sits = ", sitting on it" if spec.interact else ", not sitting on it" if spec.target_category in SEATS else ""
    return f"Scored: reaching a {spec.target_category.replace('_', ' ')}{sits}."


def summary(record: EpisodeRecord, steps: Sequence[StepRecord]) -> str:
    """Return one sentence about the end of the episode."""
    parts = [f"{_by(record)}{record.outcome.replace('_', ' ')} after {counted(record.steps, 'step')}"]
    if steps and steps[-1].target_distance is not None:
        category = record.spec.target_category.replace("_", " ")
        parts.append(f"{steps[-1].target_distance:.2f} m from the nearest {category}")
    if record.spec.interact and steps:
        sat = bool(set(steps[-1].pelvis_contacts) & set(record.spec.target_ids))
        parts.append("sitting on it" if sat else "not sitting on it")
    return ", ".join(parts) + "."
