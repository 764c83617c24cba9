"""Straight walks: gait beside that of people, drift after a hundred calls, every corner of the range, and coasting."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import product
from typing import Any, Final

import numpy as np

from humanclaw import Motion
from humanclaw.body import FPS, FUTURE, HISTORY, Array
from humanclaw.motion import DiTGenerator
from humanclaw.skills import MEASURES, HeadingCorrection, floor_scene, from_si
from humanclaw_train.data.chunks import canonical, stacked
from humanclaw_train.eval.measures import SPEED, gait
from humanclaw_train.eval.rollouts import Command, Subject, extend
from humanclaw_train.eval.simulated import Actor
from humanclaw_train.markdown import Row, table
from humanclaw_train.mocap.clips import Clip

_BODIES: Final = 3
"""Bodies that walk in half-physics at each speed."""
_FLOOR: Final = 300.0
"""Side of the floor, metres: a hundred calls go 80 m far."""


def straight_walks(
    generator: DiTGenerator, command: Command, speed: float, bodies: int, calls: int, seed: int
) -> list[Motion]:
    """Let bodies walk straight ahead from standing at a speed in m/s. All other parameters are zero."""
    motions, everyone = [generator.start() for _ in range(bodies)], np.arange(bodies)

    def act(call: int, rows: Array) -> None:
        extend(generator, command, motions, everyone, rows, (seed, 11, call))

    _corrected(command, straight(command, speed), calls, act, lambda: motions)
    return motions


def _physical_walk(
    actor: Actor, command: Command, asked: Mapping[str, float], calls: int, key: tuple[int, ...]
) -> Motion:
    """Call a skill again and again in half-physics, from standing."""
    actor.stand(floor_scene(f"side={_FLOOR}"))
    _corrected(
        command, asked, calls, lambda call, rows: actor.act(command, rows[0], (*key, call)), lambda: [actor.simulated]
    )
    return actor.simulated


def _corrected(
    command: Command,
    asked: Mapping[str, float],
    calls: int,
    act: Callable[[int, Array], None],
    bodies: Callable[[], Sequence[Motion]],
) -> None:
    """Ask the same of all bodies, again and again. Like `humanclaw.Body`, correct heading errors in the next call.

    act: executes a call, by its number and the values of each body (N, k). bodies: their motion until now.
    """
    corrections = [HeadingCorrection()] * len(bodies())
    for call in range(calls):
        steered = [correction.steer(command.declaration, asked) for correction in corrections]
        histories = [motion[-HISTORY:] for motion in bodies()]
        act(call, np.array([[row[name] for name in command.names] for row in steered]))
        ends = zip(corrections, histories, bodies(), strict=True)
        corrections = [
            correction.after(command.declaration, asked, history, motion[-FUTURE:])
            for correction, history, motion in ends
        ]


def straight(command: Command, speed: float) -> dict[str, float]:
    """Return the values that walk straight ahead at a speed in m/s."""
    ahead = next((parameter.name for parameter in command.parameters if parameter.measure == "hips.forward"), "")
    return {name: speed * FUTURE / FPS if name == ahead else 0.0 for name in command.names}


# -- drift and corners -------------------------------------------------------------------------------------------------
def drift(subject: Subject, calls: int = 100) -> list[Row]:
    """Measure where straight walks at 1 m/s end: means over at most ten bodies, and 95th percentiles of the size."""
    if subject.walks is None:
        return []
    motions = straight_walks(subject.generator, subject.walks, 1.0, min(10, subject.bodies), calls, subject.seed)
    side = np.array([motion.root[-1, 0] - motion.root[0, 0] for motion in motions])
    turned = np.degrees([motion.yaw()[-1] - motion.yaw()[0] for motion in motions])
    row: Row = {}
    for name, values in (("to the side m", side), ("turned degrees", turned)):
        row |= {name: float(values.mean()), f"95 % within, {name}": float(np.percentile(np.abs(values), 95))}
    return [row]


def corners(subject: Subject) -> list[Row]:
    """Let at most six bodies walk at every corner of the schema's range. Returns the lowest hips over all calls."""
    command = subject.walks
    if command is None or subject.simulator is None or not subject.corners:
        return []
    actor, rows = Actor(subject.generator, subject.simulator), list[Row]()
    for values in product(*((parameter.low, parameter.high) for parameter in command.parameters)):
        asked, bodies = command.named(np.array(values)), range(min(6, subject.bodies))
        motions = [_physical_walk(actor, command, asked, subject.corners, (subject.seed, body)) for body in bodies]
        pairs = zip(command.parameters, values, strict=True)
        named = {parameter.key: round(from_si(parameter.key, value)) for parameter, value in pairs}
        rows.append(named | {"lowest hips cm": 100 * min(float(motion.root[:, 1].min()) for motion in motions)})
    return rows


# -- gait --------------------------------------------------------------------------------------------------------------
SPEEDS: Final = (0.6, 1.0, 1.4, 1.6)
"""Speeds of generated walks, m/s: calls of 30, 50, 70 and 80 cm."""
SPANS: Final = {"calls 3 to 10": (2, 10), "calls 11 to 20": (10, 20)}
"""The first two calls start to walk."""
_LAST: Final = 20
"""Calls of a walk: SPANS end there."""
_NEAR: Final = 0.15
"""Difference in speed, m/s, up to which a person walks at the speed of a generated walk."""
_STRAIGHT: Final = 0.96
"""Least ratio of distance to path length of a straight walk."""


def gaits(subject: Subject) -> list[Row]:
    """Return the medians of each span of generated walks, and least and most of the people who walk as fast."""
    command = subject.walks
    if command is None:
        return []
    people, rows = real_gaits(subject.clips, command.skill), list[Row]()
    for speed in SPEEDS:
        length = f"{100 * speed * FUTURE / FPS:.0f} cm"
        for kind, motions in _walks(subject, command, speed).items():
            for name, (start, stop) in SPANS.items():
                parts = (motion[HISTORY + start * FUTURE : HISTORY + stop * FUTURE] for motion in motions)
                measured = [walk for part in parts if (walk := gait(part)) is not None]
                rows += _gait_rows(f"{length}, {name}{kind}", measured, {"": np.median})
        same = [walk for walk in people if abs(walk[SPEED] - speed) < _NEAR]
        rows += _gait_rows(
            f"{len(same)} clips of people at {speed:.1f} m/s", same, {", least": np.min, ", most": np.max}
        )
    return rows


def _walks(subject: Subject, command: Command, speed: float) -> dict[str, list[Motion]]:
    """Return walks of the model, whose bodies differ only in their noise, and of three bodies in half-physics."""
    made = {"": straight_walks(subject.generator, command, speed, min(24, subject.bodies), _LAST, subject.seed)}
    if subject.simulator is None:
        return made
    actor, asked = Actor(subject.generator, subject.simulator), straight(command, speed)
    physical = [_physical_walk(actor, command, asked, _LAST, (subject.seed, body)) for body in range(_BODIES)]
    return made | {", half-physics": physical}


def _gait_rows(name: str, walks: Sequence[Mapping[str, float]], kinds: Mapping[str, Any]) -> list[Row]:
    return [
        {"gait": name + kind} | {heading: float(summary([walk[heading] for walk in walks])) for heading in walks[0]}
        for kind, summary in kinds.items()
        if walks
    ]


def real_gaits(clips: Iterable[Clip], tag: str) -> list[dict[str, float]]:
    """Measure the longest straight span of a tag in each clip, if it has two steps and lasts a second."""
    gaits_of_people = []
    for clip in clips:
        spans = sorted(clip.tagged(tag), key=lambda span: span[0] - span[1])
        walk = clip.motion[spans[0][0] : spans[0][1] + 1] if spans else None
        # Curves and slow steps have another gait than the straight generated walks.
        if walk is not None and len(walk) > FPS and _straightness(walk) > _STRAIGHT:
            measured = gait(walk)
            if measured is not None and measured[SPEED] > SPEEDS[0] - _NEAR:
                gaits_of_people.append(measured)
    return gaits_of_people


def _straightness(walk: Motion) -> float:
    floor = walk.root[:, [0, 2]]
    return float(np.linalg.norm(floor[-1] - floor[0]) / np.linalg.norm(np.diff(floor, axis=0), axis=-1).sum())


# -- uncommanded travel ------------------------------------------------------------------------------------------------
Uncommanded = Mapping[str, tuple[float, float]]
"""Measure to its mean over bodies, SI: from standing, and after walking. Commanded measures are left out.

A skill that commands `hips.back` also commands `hips.forward`.
"""
_FREE: Final = ("hips.left", "hips.forward", "heading.left")


def uncommanded(
    generator: DiTGenerator, commands: Sequence[Command], walks: Command | None, bodies: int = 30, seed: int = 0
) -> dict[str, Uncommanded]:
    """Measure each skill's uncommanded travel, from standing and after walking at 1 m/s.

    walks: the skill that walks; without one, all bodies begin from standing.
    """
    standing = [generator.start() for _ in range(bodies)]
    before = (standing, straight_walks(generator, walks, 1.0, bodies, 2, seed) if walks else standing)
    travel: dict[str, Uncommanded] = {}
    for command in commands:
        # hips.back is hips.forward with the other sign, so it commands the same axis.
        commanded = {parameter.measure.replace("back", "forward") for parameter in command.parameters}
        values = command.draw(bodies, np.random.default_rng(seed))
        rows = []
        for motions in map(list, before):
            extend(generator, command, motions, np.arange(bodies), values, (seed, 17))
            last = [motion[-HISTORY - FUTURE :] for motion in motions]
            local = canonical(*stacked(last))
            rows.append({name: float(MEASURES[name](*local).mean()) for name in _FREE if name not in commanded})
        travel[command.skill] = {name: (rows[0][name], rows[1][name]) for name in rows[0]}
    return travel


def uncommanded_table(travel: Mapping[str, Uncommanded]) -> str:
    """Format travel from standing and after walking: cm to the left and ahead, degrees to the left; a dash if
    commanded."""

    def cell(row: Uncommanded, name: str) -> str:
        scale = 180 / np.pi if name.startswith("heading") else 100.0
        return " / ".join(f"{scale * value:+.1f}" for value in row[name]) if name in row else "-"

    rows = [(skill, *(cell(row, name) for name in _FREE)) for skill, row in travel.items()]
    return table(("uncommanded, from standing / after walking", "left cm", "ahead cm", "turn degrees"), rows)
