"""Curation: from retargeted clips to the real chunks of each skill and of the base (paper, section 3.3).

A window belongs to a skill if the clip's spans name the skill and the window's geometry agrees. In a clip without
labels geometry decides alone, with stricter rules. Needs only numpy.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from humanclaw.body import (
    CHUNK,
    FPS,
    FUTURE,
    HISTORY,
    JOINT_INDEX,
    STANDING_HEIGHT,
    TOE_SOLE,
    Array,
    forward_kinematics,
    heading,
    support_height,
)
from humanclaw.skills import MEASURES, WindowTravel
from humanclaw_train.data.chunks import Chunks, cut
from humanclaw_train.markdown import Row, rows_table
from humanclaw_train.mocap.clips import Clip, Spans
from humanclaw_train.synthesis.commands import Mask, Trained

WINDOW_STRIDE: Final = 3
"""Frames between the starts of windows."""
IDLE_SHARE: Final = 0.25
"""Largest share of standing still in the base set. Four fifths of our motion capture is idling."""

_FEET, _HANDS, _SHOULDERS = (
    [JOINT_INDEX[f"{side}_{part}"] for side in ("left", "right")] for part in ("foot", "hand", "shoulder")
)


# -- geometry ----------------------------------------------------------------------------------------------------------
def travel(root: Array, rotations: Array) -> WindowTravel:
    """Measure canonical chunks, root (N, 20, 3) and rotations (N, 20, 24, 3), for the rules of recipes."""
    moved = root[:, -1] - root[:, HISTORY - 1]
    joints = forward_kinematics(root, rotations)[0]
    feet = joints[:, HISTORY - 1 :, _FEET][..., [0, 2]]
    path = np.linalg.norm(np.diff(feet, axis=1), axis=-1).sum(axis=1).mean(axis=-1)
    last = joints[:, -1, :, 1]
    neutral = (last[:, 0] > 0.88 * STANDING_HEIGHT) & (last[:, _HANDS].max(axis=1) < last[:, _SHOULDERS].min(axis=1))
    toes = joints[:, HISTORY - 1 :, _FEET, 1] - TOE_SOLE
    level = (toes.min(axis=(1, 2)) > -0.03) & (toes.max(axis=(1, 2)) < 0.12)
    turned = heading(rotations[:, -1, 0])
    across, up, forward = moved.T
    return WindowTravel(across, up, forward, turned, path, neutral, level, root, rotations)


# -- sanity ------------------------------------------------------------------------------------------------------------
# Limits of a plausible chunk, measured on clean clips with a margin.
_SPEED: Final = 7.0
"""Largest speed of a joint relative to the pelvis, m/s."""
_TURN: Final = 1.0
"""Largest change of a rotation vector's numbers, radians a frame: excludes flips and the wrap at half a turn."""
_ACCELERATION: Final = 120.0
"""Largest acceleration of a joint, m/s^2: excludes glitches, which move a joint for one frame and back."""
_SUNK: Final = 0.05
"""Depth of a sole under the floor, metres, on flat ground."""
_LOWEST: Final = 0.25
"""Least height of the pelvis, metres above the floor."""
_ON_FLAT: Final = ("lying down", "a foot under the floor")
"""Flaws on flat ground alone. On stairs the floor of the canonical frame may lie above the lower tread."""


def flaws(root: Array, rotations: Array) -> dict[str, Mask]:
    """Return which canonical chunks have each flaw (N,)."""
    joints = forward_kinematics(root, rotations)[0]
    relative = np.diff(joints - joints[:, :, :1], axis=1) * FPS
    acceleration = np.linalg.norm(np.diff(joints, 2, axis=1), axis=-1).max(axis=(1, 2)) * FPS**2
    lowest = root[..., 1].min(axis=1)
    return {
        "too fast": np.linalg.norm(relative, axis=-1).max(axis=(1, 2)) > _SPEED,
        "a joint that flips": np.abs(np.diff(rotations, axis=1)).max(axis=(1, 2, 3)) > _TURN,
        "a glitch": acceleration > _ACCELERATION,
        "hips under the floor": lowest < 0.0,
        "lying down": lowest < _LOWEST,
        "a foot under the floor": -support_height(joints).min(axis=1) > _SUNK,
    }


def without(flawed: Mapping[str, Mask], flat: bool) -> Mask:
    """Return which chunks have no flaw (N,). flat: on flat ground, where no foot may be under the floor."""
    return np.asarray(~np.any([mask for flaw, mask in flawed.items() if flat or flaw not in _ON_FLAT], axis=0))


def sane(root: Array, rotations: Array, flat: bool) -> Mask:
    """Return which canonical chunks are plausible (N,), on flat ground or not."""
    return without(flaws(root, rotations), flat)


# -- building ----------------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Use:
    """What became of one clip or file. chunks: its windows in the base, before standing still is thinned out."""

    name: str
    source: str
    outcome: Literal["trained on", "held out", "left out"]
    reason: str = ""
    seconds: float = 0.0
    windows: int = 0
    chunks: int = 0

    @classmethod
    def of(cls, clip: Clip, windows: int, chunks: Mapping[str, int], flawed: Mapping[str, int]) -> Use:
        """Describe the use of a clip: its windows, chunks of each skill, and the windows with each flaw.

        A clip without a plausible window is left out, for the commonest reason.
        """
        size = (seconds_of(clip), windows, chunks.get("base", 0))
        if chunks:
            return cls(clip.name, clip.source, "trained on", clip.note, *size)
        reason = max(flawed, key=flawed.__getitem__) if any(flawed.values()) else "no label"
        reason = reason if windows else f"shorter than {CHUNK / FPS:.2f} s"
        return cls(clip.name, clip.source, "left out", reason, *size)


def seconds_of(clip: Clip) -> float:
    """Return the duration of a clip."""
    return round(len(clip.motion) / FPS, 2)


def build_real(
    clips: Iterable[Clip], skills: Sequence[Trained], report: Callable[[Use], object] = lambda use: None
) -> dict[str, Chunks]:
    """Return the real chunks of every skill that the clips show, and `base`: all plausible chunks.

    Idling makes up at most IDLE_SHARE of the base. report: called with the use of each clip, before that.
    """
    parts: dict[str, list[Chunks]] = {}
    for clip in clips:
        starts = np.arange(0, len(clip.motion) - CHUNK + 1, WINDOW_STRIDE)
        chunks_of_clip, flawed = _of_clip(clip, starts, skills) if len(starts) else ({}, {})
        report(Use.of(clip, len(starts), {skill: len(chunks) for skill, chunks in chunks_of_clip.items()}, flawed))
        for skill, chunks in chunks_of_clip.items():
            parts.setdefault(skill, []).append(chunks)
    joined = {skill: Chunks.join(chunks) for skill, chunks in parts.items()}
    if "base" in joined:
        joined["base"] = _less_idle(joined["base"])
    return {skill: chunks for skill, chunks in joined.items() if len(chunks)}


def _of_clip(
    clip: Clip, starts: NDArray[np.int_], skills: Sequence[Trained]
) -> tuple[dict[str, Chunks], dict[str, int]]:
    """Return the chunks of each skill, and the number of windows with each flaw."""
    root, rotations = cut(clip.motion, starts)
    windows, flawed = travel(root, rotations), flaws(root, rotations)
    if clip.spans is None:
        shown = _by_geometry(skills, windows, flawed, root[:, HISTORY - 1, 1])
    else:
        shown = _as_labelled(clip, clip.spans, starts, skills, windows, flawed)
    kept, name = {}, f"{clip.source}: {clip.name}"
    declared = {skill.name: (skill.declaration.parameters, skill.measures) for skill in skills}
    for skill, mask in shown.items():
        if mask.any():
            parameters, measures = declared.get(skill, ((), MEASURES))
            kept[skill] = Chunks.of(parameters, root[mask], rotations[mask], name, clip.real, measures)
    return kept, {flaw: int(mask.sum()) for flaw, mask in flawed.items()}


def _as_labelled(
    clip: Clip,
    spans: Spans,
    starts: NDArray[np.int_],
    skills: Sequence[Trained],
    windows: WindowTravel,
    flawed: Mapping[str, Mask],
) -> dict[str, Mask]:
    """Return which windows (N,) show each skill, and `base`, by the clip's spans and the windows' geometry."""
    uneven = any(skill.declaration.climbs and skill.tag in spans for skill in skills)
    good, shown = without(flawed, flat=not uneven), {}
    for skill in skills:
        shown[skill.name] = good & skill.shown(windows) & covered(clip, skill.tag, starts)
        if uneven and not skill.declaration.climbs:  # A step onto the next block is neither a walk nor a turn.
            shown[skill.name] &= windows.level
    return shown | {"base": good & covered(clip, "base", starts)}


def _by_geometry(
    skills: Sequence[Trained], windows: WindowTravel, flawed: Mapping[str, Mask], pelvis: Array
) -> dict[str, Mask]:
    """Return which windows (N,) show each skill, and `base`, in a clip that nobody has labelled.

    Only upright bodies with lowered hands show a skill: others may crawl or carry something. Feet that leave the
    floor's height show a climb, and only they may be below it. pelvis: height at the end of the history (N,).
    """
    level = without(flawed, flat=True) & windows.level & windows.neutral
    steps = without(flawed, flat=False) & ~windows.level & (pelvis > 0.88 * STANDING_HEIGHT)
    shown = {skill.name: skill.shown(windows) & (steps if skill.declaration.climbs else level) for skill in skills}
    return shown | {"base": np.any([without(flawed, flat=True), *shown.values()], axis=0)}


def covered(clip: Clip, tag: str, starts: NDArray[np.int_]) -> Mask:
    """Return whether spans of the tag cover at least two thirds of the future of the chunk at each start (N,)."""
    inside = np.zeros(len(clip.motion) + 1)
    for first, last in clip.tagged(tag):
        inside[first + 1 : last + 2] = 1.0
    total = np.cumsum(inside)
    return np.asarray(total[starts + CHUNK] - total[starts + HISTORY] >= 2 / 3 * FUTURE)


def _less_idle(base: Chunks) -> Chunks:
    """Keep evenly spaced idle chunks until they make up IDLE_SHARE of the set."""
    still = travel(base.root.astype(float), base.rotations.astype(float)).idle
    moving, idling = np.flatnonzero(~still), np.flatnonzero(still)
    most = int(len(moving) * IDLE_SHARE / (1 - IDLE_SHARE)) if len(moving) else len(idling)
    if len(idling) > most:
        idling = idling[np.linspace(0, len(idling) - 1, most).astype(int)]
    return base[np.sort(np.concatenate([moving, idling]))]


# -- statistics --------------------------------------------------------------------------------------------------------
def statistics(chunks: Mapping[str, Chunks]) -> list[Row]:
    """Return for each skill the numbers of chunks, the seconds of their futures, and 5, 50 and 95 % of parameters, SI.

    Windows of real motion overlap; each of their frames counts once.
    """
    return [_statistics(skill, data) for skill, data in chunks.items()]


def _statistics(skill: str, chunks: Chunks) -> Row:
    real = int(chunks.real.sum())
    synthetic = len(chunks) - real
    spread = np.percentile(chunks.params, [5, 50, 95], axis=0).T if len(chunks) else np.zeros((0, 3))
    return {
        "skill": skill,
        "real": real,
        "synthetic": synthetic,
        "real s": real * WINDOW_STRIDE / FPS,
        "synthetic s": synthetic * FUTURE / FPS,
        "5 / 50 / 95 %": dict(zip(chunks.names.tolist(), spread.tolist(), strict=True)),
    }


def table(chunks: Mapping[str, Chunks]) -> str:
    """Return the statistics as a Markdown table."""
    rows, last = statistics(chunks), "5 / 50 / 95 %"
    for row in rows:
        spread = (f"{name} " + " / ".join(f"{value:.2f}" for value in values) for name, values in row[last].items())
        row[last] = "; ".join(spread) or "-"
    return rows_table(rows)
