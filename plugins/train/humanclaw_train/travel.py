"""Where skills take a body besides what is asked: straight walks, their drift, and travel that nobody commanded."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from humanclaw import Motion
from humanclaw.body import FPS, FUTURE, HISTORY, Array
from humanclaw.motion import DiTGenerator
from humanclaw.skills import MEASURES, Course
from humanclaw_train.chunks import canonical
from humanclaw_train.rollouts import Command, extend
from humanclaw_train.tables import table


def straight_walks(
    generator: DiTGenerator, command: Command, speed: float, bodies: int, calls: int, seed: int
) -> list[Motion]:
    """Bodies that walk straight on from standing: the measure of travel ahead gets the speed, everything else
    nought."""
    values = np.tile([speed * FUTURE / FPS if name == _ahead(command) else 0.0 for name in command.names], (bodies, 1))
    motions, courses = [generator.start() for _ in range(bodies)], [Course()] * bodies
    for call in range(calls):
        _hold_course(generator, command, motions, courses, values, (seed, 11, call))
    return motions


def _hold_course(
    generator: DiTGenerator,
    command: Command,
    motions: list[Motion],
    courses: list[Course],
    values: Array,
    key: tuple[int, ...],
) -> None:
    """Let all bodies go on by one chunk, in place, as `humanclaw.Body` does: what was turned too little is owed."""
    asked = [command.named(row) for row in values]
    steered = [course.steer(command.declaration, row) for course, row in zip(courses, asked, strict=True)]
    histories = [motion[-HISTORY:] for motion in motions]
    rows = np.array([[row[name] for name in command.names] for row in steered])
    extend(generator, command, motions, np.arange(len(motions)), rows, key)
    for index, (history, row) in enumerate(zip(histories, asked, strict=True)):
        courses[index] = courses[index].after(command.declaration, row, history, motions[index][-FUTURE:])


def _ahead(command: Command) -> str:
    """Return the parameter that commands travel ahead, which the skill's declaration names; empty where none does."""
    return next((one.name for one in command.parameters if one.measure == "hips.forward"), "")


def walker(commands: Sequence[Command]) -> Command | None:
    """Return the skill that walks: it commands travel ahead and heading at once."""
    for command in commands:
        if {"hips.forward", "heading.left"} <= {one.measure for one in command.parameters}:
            return command
    return None


@dataclass(frozen=True)
class Drift:
    """Where straight walks end: metres to the side (mean, 95th percentile of the size) and degrees turned (the
    same)."""

    side: tuple[float, float]
    turned: tuple[float, float]


def drift(generator: DiTGenerator, command: Command, bodies: int = 10, calls: int = 100, seed: int = 0) -> Drift:
    """Of straight walks at 1 m/s, from body to body."""
    walks = straight_walks(generator, command, 1.0, bodies, calls, seed)
    side = np.array([walk.root[-1, 0] - walk.root[0, 0] for walk in walks])
    turned = np.degrees([walk.yaw()[-1] - walk.yaw()[0] for walk in walks])
    pairs = ((float(one.mean()), float(np.percentile(np.abs(one), 95))) for one in (side, turned))
    return Drift(*pairs)


# -- travel that nobody commanded --------------------------------------------------------------------------------------
Uncommanded = Mapping[str, tuple[float, float]]
"""Measure to its mean over bodies, SI: from standing, after walking. A measure that the skill commands is not there;
who commands `hips.back` commands `hips.forward`."""
_FREE: Final = ("hips.left", "hips.forward", "heading.left")


def uncommanded(
    generator: DiTGenerator, commands: Sequence[Command], walks: Command | None, bodies: int = 30, seed: int = 0
) -> dict[str, Uncommanded]:
    """Skill to what a call does though the skill does not command it, from standing and after walking at 1 m/s.

    walks: the skill that walks; without one all begin from standing.
    """
    standing = [generator.start() for _ in range(bodies)]
    before = (standing, straight_walks(generator, walks, 1.0, bodies, 2, seed) if walks else standing)
    found: dict[str, Uncommanded] = {}
    for command in commands:
        told = {one.measure.replace("back", "forward") for one in command.parameters}
        values = command.draw(bodies, np.random.default_rng(seed))
        rows = []
        for motions in map(list, before):
            extend(generator, command, motions, np.arange(bodies), values, (seed, 17))
            last = [motion[-HISTORY - FUTURE :] for motion in motions]
            local = canonical(*(np.stack([getattr(one, part) for one in last]) for part in ("root", "rotations")))
            rows.append({name: float(MEASURES[name](*local).mean()) for name in _FREE if name not in told})
        found[command.skill] = {name: (rows[0][name], rows[1][name]) for name in rows[0]}
    return found


def uncommanded_table(found: Mapping[str, Uncommanded]) -> str:
    """Standing, and after walking: cm to the left and ahead, degrees to the left; a dash where the skill commands
    it."""

    def cell(row: Uncommanded, name: str) -> str:
        scale = 180 / np.pi if name.startswith("heading") else 100.0
        return " / ".join(f"{scale * value:+.1f}" for value in row[name]) if name in row else "-"

    rows = [(skill, *(cell(row, name) for name in _FREE)) for skill, row in found.items()]
    return table(("uncommanded, from standing / after walking", "left cm", "ahead cm", "turn degrees"), rows)
