"""Straight walks: drift after a hundred calls, and gait compared with that of real walks."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from humanclaw import Motion
from humanclaw.body import FPS, FUTURE, HISTORY, Array
from humanclaw.motion import DiTGenerator
from humanclaw.skills import HeadingCorrection
from humanclaw_train.eval.measures import Gait
from humanclaw_train.eval.rollouts import Command, extend
from humanclaw_train.markdown import cell, table
from humanclaw_train.mocap.clips import Clip


def straight_walks(
    generator: DiTGenerator, command: Command, speed: float, bodies: int, calls: int, seed: int
) -> list[Motion]:
    """Let bodies walk straight ahead from standing at a speed in m/s. All other parameters are zero."""
    values = np.tile(list(straight(command, speed).values()), (bodies, 1))
    motions, courses = [generator.start() for _ in range(bodies)], [HeadingCorrection()] * bodies
    for call in range(calls):
        _hold_course(generator, command, motions, courses, values, (seed, 11, call))
    return motions


def _hold_course(
    generator: DiTGenerator,
    command: Command,
    motions: list[Motion],
    courses: list[HeadingCorrection],
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


def straight(command: Command, speed: float) -> dict[str, float]:
    """Return the values that walk straight ahead at a speed in m/s."""
    ahead = next((one.name for one in command.parameters if one.measure == "hips.forward"), "")
    return {name: speed * FUTURE / FPS if name == ahead else 0.0 for name in command.names}


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
            if gait is not None and gait.speed > SPEEDS[0] - _NEAR:
                found[f"{clip.source.split()[0]} {clip.name}"] = gait
    return found


def _straightness(walk: Motion) -> float:
    floor = walk.root[:, [0, 2]]
    return float(np.linalg.norm(floor[-1] - floor[0]) / np.linalg.norm(np.diff(floor, axis=0), axis=-1).sum())


SPEEDS: Final = (0.6, 1.0, 1.4, 1.6)
"""Speeds of generated walks, m/s: calls of 30, 50, 70 and 80 cm."""
STRETCHES: Final = {"calls 3 to 10": (2, 10), "calls 11 to 20": (10, 20)}
"""The first two calls start to walk."""


Gaits = dict[float, dict[str, list[Gait]]]
"""Gaits of bodies by speed and stretch."""


def part_of(walk: Motion, stretch: str) -> Motion:
    """Return a stretch of a walk that begins with a history."""
    start, stop = STRETCHES[stretch]
    return walk[HISTORY + start * FUTURE : HISTORY + stop * FUTURE]


def generated_gaits(generator: DiTGenerator, command: Command, bodies: int = 24, seed: int = 0) -> Gaits:
    """Measure stretches of generated walks, by speed. Bodies differ only in their noise."""
    found: Gaits = {}
    last = max(stop for _, stop in STRETCHES.values())
    for speed in SPEEDS:
        walks = straight_walks(generator, command, speed, bodies, last, seed)
        for name in STRETCHES:
            gaits = [gait for walk in walks if (gait := Gait.of(part_of(walk, name))) is not None]
            found.setdefault(speed, {})[name] = gaits
    return found


_COLUMNS: Final = {
    "cadence": "steps/s", "bob": "bob cm", "sway": "sway cm", "knee": "swing knee", "toe_off": "toe-off",
    "pelvis": "pelvis yaw", "shoulders": "shoulder yaw", "trunk": "trunk", "width": "width cm",
    "double": "both feet %", "arms": "arms cm", "toe": "slower toe cm/s", "jerk": "jerk m/s3",
}  # fmt: skip
_NEAR: Final = 0.15
"""Difference in speed, m/s, up to which a person walks at the speed of a generated walk."""


def gait_table(real: Mapping[str, Gait], made: Mapping[float, Mapping[str, Sequence[Gait]]]) -> str:
    """Format the medians of each generated stretch, and below them least to most of the people who walk as fast."""
    rows = []
    for speed, stretches in made.items():
        for name, gaits in stretches.items():
            if gaits:
                values = np.median([[getattr(gait, key) for key in _COLUMNS] for gait in gaits], 0)
                rows.append((f"{100 * speed * FUTURE / FPS:.0f} cm, {name}", *(cell(value) for value in values)))
        people = [gait for gait in real.values() if abs(gait.speed - speed) < _NEAR]
        if people:
            columns = [[getattr(gait, key) for gait in people] for key in _COLUMNS]
            spread = (f"{cell(min(column))} to {cell(max(column))}" for column in columns)
            rows.append((f"people at {speed:.1f} m/s, {len(people)} clips", *spread))
    return table(("straight walk, degrees", *_COLUMNS.values()), rows)
