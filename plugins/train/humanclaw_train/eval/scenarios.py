"""Naturalness: scenarios that compare generated motion with real motion. Each returns the rows of a table.

* The prior alone continues the histories of held-out real chunks.
* Skills: generated rollouts and the data's own chunks get the same measures. For the Frechet distance, the model
  continues histories of held-out real chunks (CHUNKS/held_out) with the parameters that these achieve, so that only the
  style differs. The data's row has the distance of the other chunks. Free-running, the model starts from standing and
  continues its own motion.
* Sequences: root-rigid jerk of the six sequences that the paper names.
* First steps: slide of the slower toe in the first chunk from standing.
* Gait: straight walks of several speeds, their first calls and later ones, of the model and in half-physics, beside
  people's. Drift: where a hundred straight calls in a row end. Corners: the lowest hips of walks at every corner of the
  range, in half-physics.
* Self-penetration: share of frames in which hands are in thighs or trunk, or the legs in each other.
* Transitions: peak joint acceleration where a second skill takes over, for every ordered pair of skills, over the peak
  in real motion (the 99.9th percentile of the same two-frame peak over real chunks that move).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np

from humanclaw import Body, Motion
from humanclaw.body import (
    FUTURE,
    HISTORY,
    Array,
    forward_kinematics,
    overlap,
    root_jerk,
)
from humanclaw.motion import DiTGenerator
from humanclaw.skills import check_call, floor_for, floor_scene, suited
from humanclaw_train.data.chunks import Chunks, of_skill
from humanclaw_train.eval import likeness, measures, walks
from humanclaw_train.eval.measures import SEAM
from humanclaw_train.eval.rollouts import CHUNKS_IN_A_ROW, Command, Subject, extend, others, roll
from humanclaw_train.markdown import Row

if TYPE_CHECKING:
    from humanclaw import Plugins

# -- sequences ---------------------------------------------------------------------------------------------------------
_WALK: Final = ("hips.forward", 0.4)
_SIDE: Final = ("hips.left", 0.2)
_TURN: Final = ("heading.left", float(np.radians(37.5)))
Asked = tuple[str, float]
"""A measure and its amount, SI. The flat-ground skill that commands it and the fewest other measures executes it; its
other parameters are 0."""
SEQUENCES: Final[Mapping[str, tuple[tuple[Asked, ...], float]]] = {
    "forward walk": ((_WALK,) * 10, 5.2),
    "turn": ((_TURN,) * 10, 4.3),
    "walk, turn, walk": ((*[_WALK] * 4, *[_TURN] * 2, *[_WALK] * 4), 5.8),
    "five walks, then five side steps": ((*[_WALK] * 5, *[_SIDE] * 5), 4.7),
    "the same ten, interleaved": ((_WALK, _SIDE) * 5, 7.4),
    "aimless": ((), 9.7),
}
"""Ten calls each, and the paper's jerk (m/s^3). Aimless: random steps ahead, aside and back, and turns.

The paper gives neither parameters nor lengths. Ours are the middle of each range: 40 cm ahead, 20 cm to the left, 37.5
degrees. Data and body differ from the paper's, so compare the order and not the values.
"""
_AIMLESS: Final = ("hips.forward", "hips.left", "hips.back", "heading.left")
_SEQUENCE_BODIES: Final = 20
"""Bodies of a sequence, whose jerk is averaged: with fewer, noise could change the order of the rows."""


def sequences(subject: Subject) -> list[Row]:
    """Return the mean root-rigid jerk of each sequence, if the skills for all of them are there."""
    known = _by_measure(subject.commands)
    if len(known) < len(_AIMLESS):
        return []
    rows = list[Row]()
    for number, (name, (calls, paper)) in enumerate(SEQUENCES.items()):
        motions = _sequence(subject.generator, known, calls, (subject.seed, number))
        jerk = float(np.mean([root_jerk(motion) for motion in motions]))
        rows.append({"sequence": name, "jerk m/s3": jerk, "paper": paper})
    return rows


def _by_measure(commands: Sequence[Command]) -> dict[str, Command]:
    """Return the skill to ask for each measure of the sequences, if there is one."""
    named = {command.skill: command for command in commands}
    skills = {measure: suited((command.declaration for command in commands), measure) for measure in _AIMLESS}
    return {measure: named[skill.name] for measure, skill in skills.items() if skill is not None}


def _sequence(
    generator: DiTGenerator, known: Mapping[str, Command], calls: Sequence[Asked], key: tuple[int, int]
) -> list[Motion]:
    random = np.random.default_rng(key)
    motions = [generator.start() for _ in range(_SEQUENCE_BODIES)]
    everyone = np.arange(len(motions))
    for step in range(10):
        if calls:
            measure, amount = calls[step]
            asked = [amount * (parameter.measure == measure) for parameter in known[measure].parameters]
            extend(generator, known[measure], motions, everyone, np.array([asked] * len(motions)), (*key, step))
            continue
        chosen = random.integers(len(_AIMLESS), size=len(motions))
        for index, measure in enumerate(_AIMLESS):
            these, command = np.flatnonzero(chosen == index), known[measure]
            extend(generator, command, motions, these, command.draw(len(these), random), (*key, step))
    return motions


# -- first steps -------------------------------------------------------------------------------------------------------
_FIRST_BODIES: Final = 1200
"""Bodies per skill. Only a hundredth of them decides the 99th percentile."""
GLIDES: Final = 2.0
"""A body glides if both toes slide further than this in its first step, cm."""


def first_steps(subject: Subject) -> list[Row]:
    """Measure how far both feet slide when a standing body starts to move, over the whole range of each schema.

    A history of standing does not show which foot moves first. A model that averages both cases slides on both feet.
    """
    rows = list[Row]()
    for command in subject.commands:
        motions = [subject.generator.start() for _ in range(_FIRST_BODIES)]
        values = _first_commands(command, len(motions), np.random.default_rng(subject.seed))
        extend(subject.generator, command, motions, np.arange(len(motions)), values, (subject.seed, 13))
        # From the last history frame on, so that a jump at the seam counts as a slide.
        slides = np.array([measures.slide(motion[HISTORY - 1 :].joints()) for motion in motions])
        rows.append({"skill": command.skill} | slid(slides))
    return rows


def slid(slides: Array) -> Row:
    """Summarise slides (bodies,), cm."""
    p95, p99 = (float(np.percentile(slides, share)) for share in (95, 99))
    gliding = int((slides > GLIDES).sum())
    return {
        "slower toe slides cm, 95 %": p95, "99 %": p99, "most": float(slides.max()),
        f"over {GLIDES:g} cm": gliding, "bodies": len(slides),
    }  # fmt: skip


def _first_commands(command: Command, bodies: int, random: np.random.Generator) -> Array:
    """Draw commands over the whole ranges (bodies, k).

    Every second command is straight: all parameters that can be zero are, except the primary one. Models call these
    most, and in them either foot might move first. In every third command the primary parameter is small: it is drawn
    from the lowest fifth of its range.
    """
    low, high = (np.array([getattr(parameter, end) for parameter in command.parameters]) for end in ("low", "high"))
    values = random.uniform(low, high, (bodies, len(low)))
    # The value closest to zero that each range allows.
    least, primary = np.clip(0.0, low, high), np.arange(len(low)) == command.primary
    values[::3, primary] = (least + 0.2 * (values[::3] - least))[:, primary]
    values[::2, (least == 0) & ~primary] = 0.0
    return values


# -- links in each other -----------------------------------------------------------------------------------------------
_ARM, _LEG = ("elbow", "wrist", "hand"), ("knee", "ankle", "foot")
ARMS: Final = "arms in legs or trunk"
PAIRS: Final[Mapping[str, Sequence[tuple[str, str]]]] = {
    ARMS: [
        (f"{side}_{part}", other)
        for side, part in product(("left", "right"), _ARM)
        for other in ("left_hip", "right_hip", "pelvis", "spine1", "spine2")
    ],
    "legs in each other": [
        *((f"left_{left}", f"right_{right}") for left, right in product(_LEG, _LEG)),
        ("left_hip", "right_hip"),
    ],
}
"""Pairs of links that do not touch in a healthy pose, by group."""
_TOUCH: Final = 0.002
"""Depth, metres, up to which links touch and are not inside one another."""


def overlaps(root: Array, rotations: Array) -> Row:
    """Return the share of poses (..., 3) and (..., 24, 3) in which links are in each other, and the greatest depth."""
    joints, turns = forward_kinematics(root, rotations)
    row = {}
    for group in PAIRS:
        deep = depth(joints, turns, group)
        row[f"{group}, % of frames"] = float(100 * (deep > _TOUCH).mean())
        row[f"{group}, deepest cm"] = float(100 * max(deep.max(), 0.0))
    return row


def depth(joints: Array, turns: Array, group: str) -> Array:
    """Return how deep links of a group are in each other (...), metres, for joints (..., 24, 3) and their orientations;
    negative where they are apart."""
    return np.asarray(np.max([overlap(joints, turns, *pair) for pair in PAIRS[group]], axis=0))


def self_penetration(subject: Subject) -> list[Row]:
    """Measure the futures of every skill: of the model alone and of the installed skill as played."""
    rows = list[Row]()
    for command in subject.commands:
        before = others(command, subject.commands)
        alone = roll(subject.generator, command, before, subject.rollouts, subject.seed)
        futures = alone.root[:, HISTORY:], alone.rotations[:, HISTORY:]
        rows.append({"skill": command.skill, "motion": "model"} | overlaps(*futures))
        if subject.plugins is not None:
            parts = [
                _played(subject.plugins, command, before, (subject.seed, body)) for body in range(subject.rollouts)
            ]
            played = _joined(parts)
            rows.append({"skill": command.skill, "motion": "played"} | overlaps(played.root, played.rotations))
    return rows


def _played(plugins: Plugins, command: Command, before: Sequence[Command], key: tuple[int, int]) -> Motion:
    """Call a skill three times in half-physics. On a flat floor every second body has called another skill before."""
    random, index = np.random.default_rng(key), key[1]
    values = command.draw(1, random)[0]
    scene = floor_scene(floor_for(command.declaration, command.named(values), CHUNKS_IN_A_ROW))
    with Body(scene, seed=index, plugins=plugins) as body:
        if before and index % 2 and len(scene.objects) == 1:
            other = before[index // 2 % len(before)]
            _called(body, other, other.draw(1, random)[0])
        return _joined([_called(body, command, values) for _ in range(CHUNKS_IN_A_ROW)])


def _called(body: Body, command: Command, values: Array) -> Motion:
    """Call a skill of a body as an agent would, with values (k,) in SI; returns the simulated motion."""
    measures, skill = (parameter.measure for parameter in command.parameters), body.skills[command.skill]
    call = check_call(skill.call(dict(zip(measures, values.tolist(), strict=True))), body.skills)
    return _joined([chunk.execution.simulated for chunk in body.execute(call).chunks])


def _joined(motions: Sequence[Motion]) -> Motion:
    """Return motions one after another."""
    root, rotations = (np.concatenate([getattr(part, key) for part in motions]) for key in ("root", "rotations"))
    return Motion(root, rotations)


# -- transitions -------------------------------------------------------------------------------------------------------
def transitions(subject: Subject) -> list[Row]:
    """Return for each skill the worst seam to every other one, over the peak of real motion, and the median seam.

    From standing, one chunk of each of both skills with random parameters.
    """
    commands, generator = subject.commands, subject.generator
    everyone, peak, rows = np.arange(subject.bodies), real_peak(subject.chunks, commands), list[Row]()
    for number, first in enumerate(commands):
        random, key = np.random.default_rng((subject.seed, number)), (subject.seed, number)
        motions = [generator.start() for _ in everyone]
        extend(generator, first, motions, everyone, first.draw(len(everyone), random), key)
        seams = {}
        for column, second in enumerate(commands):
            both = list(motions)
            extend(generator, second, both, everyone, second.draw(len(both), random), (*key, column + 1))
            seams[second.skill] = _seam_peaks(np.stack([motion[-HISTORY - FUTURE :].joints() for motion in both]))
        worst = {skill: float(peaks.max() / peak) for skill, peaks in seams.items()}
        most = max(float(peaks.max()) for peaks in seams.values())
        median = float(np.median([np.median(peaks) for peaks in seams.values()]))
        rows.append({"from, to": first.skill, **worst, "worst m/s2": most, "median m/s2": median, "real m/s2": peak})
    return rows


def _seam_peaks(joints: Array) -> Array:
    return np.asarray(measures.acceleration(joints)[:, SEAM].max(1))


def real_peak(folders: Sequence[Path], commands: Sequence[Command]) -> float:
    """Return the 99.9th percentile of the same two-frame peak over real chunks of skills that move, m/s^2."""
    peaks = [
        _window_peaks(data)
        for command in commands
        if command.declaration.role != "stop" and (data := of_skill(folders, command.skill)) and data.real.all()
    ]
    return float(np.percentile(np.concatenate(peaks), 99.9)) if peaks else np.nan


def _window_peaks(chunks: Chunks) -> Array:
    joints, _ = forward_kinematics(chunks.root.astype(float), chunks.rotations.astype(float))
    size = measures.acceleration(joints)
    # A seam has two accelerations; every pair of neighbouring frames is compared in the same way.
    return np.maximum(size[:, 1:], size[:, :-1]).ravel()


SCENARIOS: Final[Mapping[str, Callable[[Subject], list[Row]]]] = {
    "skills": likeness.skills,
    "sequences": sequences,
    "first steps from standing": first_steps,
    "gait of straight walks, degrees": walks.gaits,
    "drift of a hundred straight calls, 50 m": walks.drift,
    "corners of the range in half-physics": walks.corners,
    "links in each other": self_penetration,
    "transitions, over the peak of real motion": transitions,
}
"""Every scenario by the title of its table, in the order in which they are shown."""
