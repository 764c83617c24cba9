"""Chunks of a skill of your own, from a folder of motion.

The folder of the skill contains its schema.json, which names the measure of each parameter. Every window of every clip
is measured, and windows within the schema's bounds are kept. A recipe.py beside it may select among the windows. The
folder of motion contains .bvh files, .amc files with their .asf, AMASS .npz files, humanoid3d .txt files, or motion.npz
files of recorded episodes, in subfolders too.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from humanclaw import HumanclawError, Motion
from humanclaw.body import CHUNK, FUTURE, HISTORY, Array
from humanclaw.motion import load_base, shipped_base
from humanclaw.skills import Parameter, from_si, outcomes
from humanclaw_train.data.chunks import Chunks, cut
from humanclaw_train.data.curate import WINDOW_STRIDE, sane, travel
from humanclaw_train.data.retimed import retimed
from humanclaw_train.mocap.clips import Clip, Folder
from humanclaw_train.mocap.readers import AS_WRITTEN, Reading
from humanclaw_train.synthesis.commands import Trained

RETIMED: Final = "retimed"
"""Source name of chunks that are a clip's poses at another pace."""
_ROW: Final = 16
"""Half seconds in one row of retimed motion."""
_BEGUN: Final = 8
"""Rows of two half seconds from the prior's standing pose, for each row of _ROW."""
_SHOWN: Final = (0.01, 0.99)
"""Quantiles of a parameter that bound the range of an adapter."""
_MISSED: Final = 0.025
"""Share of that range by which bounds may exceed it."""
_BEYOND: Final = 0.15
"""Share of its range by which a chunk's parameter may exceed the schema's bounds. A model is least accurate at the edge
of its data."""


# -- chunks ------------------------------------------------------------------------------------------------------------
def chunks_of(
    skill: Trained, clips: Sequence[Clip], seconds: float, seed: int, standing: Motion | None = None
) -> Chunks:
    """Cut the skill's chunks: windows of the clips and their mirror images, with the parameters that they achieve.

    seconds: of retimed motion to add, if the recipe asks for it. standing: the prior's standing pose.
    Raises HumanclawError if no window shows the skill, PluginError for an unknown measure.
    """
    shown = [part for clip in clips if len(part := _of_windows(skill, clip))]
    if not shown:
        raise HumanclawError(
            f"None of the {len(clips)} clips shows {skill.name} within the bounds of its schema.json.",
            "Widen the bounds, correct x-measure, or give other clips.",
        )
    parts = list(shown)
    if skill.recipe.retimed and standing is not None:
        # Only clips that show the skill: others would add poses that it does not have.
        origins = {part.source[0] for part in shown}
        parts += _retimed(skill, [clip for clip in clips if _source(clip) in origins], standing, seconds, seed)
    licences = {f"{clip.source}: {clip.licence}" for clip in clips if clip.licence}
    whole = replace(Chunks.join(parts), licences=np.array(sorted(licences), np.str_))
    images = whole.mirrored(skill.measures)
    # The image of a skill of one side may not show it.
    return Chunks.join([whole, images[_shown(skill, images.root.astype(float), images.rotations.astype(float))]])


def _source(clip: Clip) -> str:
    return f"{clip.source}: {clip.name}"


def _of_windows(skill: Trained, clip: Clip) -> Chunks:
    starts = np.arange(0, len(clip.motion) - CHUNK + 1, WINDOW_STRIDE)
    return _kept(skill, *cut(clip.motion, starts), _source(clip), clip.real)


def _kept(skill: Trained, root: Array, rotations: Array, source: str, real: bool) -> Chunks:
    mask = sane(root, rotations, flat=not skill.declaration.climbs) & _shown(skill, root, rotations)
    return Chunks.of(skill.declaration.parameters, root[mask], rotations[mask], source, real, skill.measures)


def _shown(skill: Trained, root: Array, rotations: Array) -> NDArray[np.bool_]:
    """Return which canonical chunks show the skill (N,): those within its bounds that its recipe selects."""
    within = _within(skill, root, rotations)
    return within if skill.recipe.windows is None else within & skill.shown(travel(root, rotations))


def _within(skill: Trained, root: Array, rotations: Array) -> NDArray[np.bool_]:
    """Return which chunks are within the schema's bounds (N,), with a tolerance of _BEYOND."""
    parameters = skill.declaration.parameters
    achieved = outcomes(parameters, root, rotations, skill.measures)
    low, high = (np.array([getattr(parameter, edge) for parameter in parameters]) for edge in ("low", "high"))
    slack = _BEYOND * np.where(np.isfinite(high - low), high - low, 0.0)
    return np.asarray(((achieved >= low - slack) & (achieved <= high + slack)).all(1))


def _retimed(skill: Trained, clips: Sequence[Clip], standing: Motion, seconds: float, seed: int) -> Iterator[Chunks]:
    """Cut retimed chunks: a third at the calls, a third anywhere in between, a third in the first two calls after
    standing."""
    random = np.random.default_rng(seed)
    lowers = skill.declaration.commands("hips.height") is not None
    wanted = int(seconds * 2 / 2)  # Two a second; mirroring doubles them.
    for index in tqdm(range(-(-wanted // (2 * _ROW + 2 * _BEGUN))), unit="row", disable=None):
        clip = clips[index % len(clips)].motion
        motion = retimed(clip, standing, _ROW, random, lowers=lowers)
        loose = random.integers(0, len(motion) - CHUNK + 1, _ROW)
        starts = np.concatenate([np.arange(_ROW) * FUTURE, loose])
        yield _kept(skill, *cut(motion, starts), RETIMED, False)
        for _ in range(_BEGUN):
            first = retimed(clip, standing, 2, random, begun=True, lowers=lowers)
            yield _kept(skill, *cut(first, np.array([0, FUTURE])), RETIMED, False)


def saved(
    skill: Trained,
    clips: Path,
    out: Path,
    seconds: float,
    seed: int,
    base: Path | None = None,
    reading: Reading = AS_WRITTEN,
) -> tuple[Chunks, list[str]]:
    """Make the chunks of a skill from a folder of motion and write out/<skill>.npz.

    base: gives the standing pose; None for the shipped one. reading: what the files do not say. Returns the chunks, and
    warnings: of files that were left out, of what was assumed, and of every parameter whose bounds exceed the chunks'
    range, beyond which an adapter does not learn.
    """
    standing = load_base(base or shipped_base())
    start = Motion(standing.start_root.astype(float), standing.start_rotations.astype(float))
    folder = Folder.read(clips, reading)
    chunks = chunks_of(skill, folder.clips, seconds, seed, start[HISTORY - 1 :])
    chunks.save(out / f"{skill.name}.npz")
    shown = zip(skill.declaration.parameters, *np.quantile(chunks.params, _SHOWN, axis=0), strict=True)
    notes = [f"left out: {name} {reason}" for name, reason in folder.left_out.items()]
    notes += [f"{note} ({count} clips)" for note, count in Counter(clip.note for clip in folder.clips).items() if note]
    return chunks, notes + [_reach(*spread) for spread in shown if _wider(*spread)]


def _wider(parameter: Parameter, low: float, high: float) -> bool:
    slack = _MISSED * (high - low)
    return parameter.low < low - slack or parameter.high > high + slack


def _reach(parameter: Parameter, low: float, high: float) -> str:
    asked, shown = (
        " to ".join(f"{from_si(parameter.key, edge):.0f}" for edge in pair)
        for pair in ((parameter.low, parameter.high), (low, high))
    )
    return (
        f"warning: {parameter.key} may be {asked}, and the chunks show {shown}: narrow its bounds, or give more clips."
    )
