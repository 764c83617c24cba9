"""Straight walks: drift after a hundred calls, and gait compared with that of real walks."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from humanclaw import Motion
from humanclaw.body import FPS, FUTURE, HISTORY, Array
from humanclaw.motion import DiTGenerator
from humanclaw.skills import Course
from humanclaw_train.chunks import Clip
from humanclaw_train.measures import Gait
from humanclaw_train.rollouts import Command, extend
from humanclaw_train.tables import cell, table


def straight_walks(
    generator: DiTGenerator, command: Command, speed: float, bodies: int, calls: int, seed: int
) -> list[Motion]:
    """Let bodies walk straight ahead from standing at a speed in m/s. All other parameters are zero."""
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
    """Continue all bodies by one chunk, in place. Like `humanclaw.Body`, correct heading errors in the next call."""
    asked = [command.named(row) for row in values]
    steered = [course.steer(command.declaration, row) for course, row in zip(courses, asked, strict=True)]
    histories = [motion[-HISTORY:] for motion in motions]
    rows = np.array([[row[name] for name in command.names] for row in steered])
    extend(generator, command, motions, np.arange(len(motions)), rows, key)
    for index, (history, row) in enumerate(zip(histories, asked, strict=True)):
        courses[index] = courses[index].after(command.declaration, row, history, motions[index][-FUTURE:])


def _ahead(command: Command) -> str:
    """Return the name of the parameter that commands travel ahead; empty if there is none."""
    return next((one.name for one in command.parameters if one.measure == "hips.forward"), "")


def walker(commands: Sequence[Command]) -> Command | None:
    """Return the skill that walks: the first that commands both travel ahead and heading."""
    for command in commands:
        if {"hips.forward", "heading.left"} <= {one.measure for one in command.parameters}:
            return command
    return None


# -- drift -------------------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Drift:
    """Where straight walks end: metres to the side and degrees turned, each as mean and 95th percentile of the size."""

    side: tuple[float, float]
    turned: tuple[float, float]


def drift(generator: DiTGenerator, command: Command, bodies: int = 10, calls: int = 100, seed: int = 0) -> Drift:
    """Measure the drift of straight walks at 1 m/s over the bodies."""
    walks = straight_walks(generator, command, 1.0, bodies, calls, seed)
    side = np.array([walk.root[-1, 0] - walk.root[0, 0] for walk in walks])
    turned = np.degrees([walk.yaw()[-1] - walk.yaw()[0] for walk in walks])
    pairs = ((float(one.mean()), float(np.percentile(np.abs(one), 95))) for one in (side, turned))
    return Drift(*pairs)


def drift_line(found: Drift) -> str:
    return (
        f"A hundred straight calls in a row, 50 m, end {found.side[0]:+.2f} m to the side "
        f"(95 % within {found.side[1]:.2f} m) "
        f"and turned by {found.turned[0]:+.1f} degrees (95 % within {found.turned[1]:.1f})."
    )


# -- gait --------------------------------------------------------------------------------------------------------------
_STRAIGHT: Final = 0.96
"""Least ratio of distance to path length of a straight walk."""


def real_gaits(clips: Iterable[Clip], tag: str) -> dict[str, Gait]:
    """Measure the longest straight span of a tag in each clip, if it has two steps and lasts a second. By clip."""
    found = {}
    for clip in clips:
        spans = sorted(clip.tagged(tag), key=lambda span: span[0] - span[1])
        walk = clip.motion[spans[0][0] : spans[0][1] + 1] if spans else None
        # Curves and slow steps have another gait than the straight generated walks.
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
    """Measure generated walks at several speeds from the third call on. Bodies differ only in their noise."""
    found = {}
    for speed in (0.9, 1.0, 1.3, 1.6):
        walks = straight_walks(generator, command, speed, bodies, calls, seed)
        # Two calls of starting to walk are left out.
        gaits = [Gait.of(walk[HISTORY + 2 * FUTURE :]) for walk in walks]
        found[f"generated, {speed:.1f} m/s"] = [gait for gait in gaits if gait is not None]
    return {name: gaits for name, gaits in found.items() if gaits}


_GAIT: Final = ("speed", "cadence", "step", "sway", "bob", "knee", "ripple", "arms", "toe")


def gait_table(real: Mapping[str, Gait], made: Mapping[str, Sequence[Gait]]) -> str:
    """Format one row per real clip and per generated speed: median, and 5th to 95th percentile over bodies."""
    units = ("m/s", "steps/s", "step m", "sway cm", "bob cm", "swing knee", "ripple", "arms cm", "slower toe cm/s")
    rows = [(name, *(cell(getattr(gait, key), 2) for key in _GAIT)) for name, gait in real.items()]
    for name, gaits in made.items():
        spread = [np.percentile([getattr(gait, key) for gait in gaits], [50, 5, 95]) for key in _GAIT]
        rows.append((name, *(f"{mid:.2f} ({low:.2f} to {high:.2f})" for mid, low, high in spread)))
    return table(("straight walk", *units), rows)
