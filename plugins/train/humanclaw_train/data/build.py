"""Build the training chunks: from motion capture to one npz per skill and one for the prior.

SOURCE is a folder of AMASS .npz, .amc with .asf, .bvh or humanoid3d .txt files, in subfolders too. A clips.csv in it
may name the clips and label their frames. Without labels, geometry alone decides which windows show a skill.
"""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import fields, replace
from fnmatch import fnmatch
from pathlib import Path, PurePath
from typing import Final

from humanclaw import HumanclawError
from humanclaw_train.data.chunks import Chunks
from humanclaw_train.data.curate import Use, build_real, seconds_of
from humanclaw_train.markdown import table
from humanclaw_train.mocap.clips import Clip, Folder
from humanclaw_train.mocap.readers import AS_WRITTEN, Reading
from humanclaw_train.mocap.source_motion import MocapError
from humanclaw_train.synthesis.commands import Trained
from humanclaw_train.synthesis.profiles import Profiles
from humanclaw_train.synthesis.synthetic import synthetic_chunks

REPORT: Final = "report.csv"
"""In the folder of the chunks."""
HELD_OUT: Final = ("12_*", "131_*", "03_04", "75_17", "HDM_dg_*", "011_*")
"""Patterns of clips of the shipped prior's pack that neither profiles nor weights learn from.

They are all clips of CMU subjects 12 and 131, of HDM05's subject dg and of one idler, the second of two walks over
blocks and the first of two clips of sitting, each of which only one subject did.
"""
_ONE_IN: Final = 20
"""One in so many folders of an unlabelled tree is held out; of a tree with fewer folders, one in so many clips."""


def held_out(clips: Sequence[Clip], patterns: Sequence[str] | None = None) -> set[str]:
    """Return the names of the clips that match one of the patterns.

    patterns: None for HELD_OUT among labelled clips, and for one in twenty folders of others: folders are subjects.
    """
    if patterns is not None or all(clip.spans is not None for clip in clips):
        wanted = HELD_OUT if patterns is None else patterns
        return {clip.name for clip in clips if any(fnmatch(clip.name, pattern) for pattern in wanted)}
    folders = sorted({PurePath(clip.name).parent for clip in clips})
    if len(folders) >= _ONE_IN:
        return {clip.name for clip in clips if PurePath(clip.name).parent in folders[_ONE_IN - 1 :: _ONE_IN]}
    return {clip.name for clip in clips[::-_ONE_IN]} if len(clips) > 1 else set()


def build(
    source: Path,
    out: Path,
    skills: Sequence[Trained],
    seconds: float,
    seed: int,
    without: Sequence[str] = (),
    hold_out: Sequence[str] | None = None,
    reading: Reading = AS_WRITTEN,
) -> tuple[dict[str, Chunks], str]:
    """Build real and synthetic chunks and save them as out/<skill>.npz, those of held-out clips in out/held_out.

    seconds: of synthetic motion per skill. without: sources to leave out, such as `HDM05`. hold_out: patterns of names
    of clips (held_out). reading: what the files do not say. Returns the chunks of every skill and of `base`, and a
    report as Markdown. Raises HumanclawError if no clip can be read or none has a plausible window.
    """
    folder = Folder.read(source, reading)
    every = [clip for clip in folder.clips if clip.source not in without]
    # Before anything is measured on clips: profiles of synthetic motion must not see held-out people either.
    back = held_out(every, hold_out)
    clips = [clip for clip in every if clip.name not in back]
    uses, kept_back = list[Use](), list[Use]()
    real = build_real(clips, skills, uses.append)
    apart = build_real([clip for clip in every if clip.name in back], skills, kept_back.append)
    synthetic, note = _synthetic(clips, skills, seconds, seed)
    uses += [replace(use, outcome="held out") if use.outcome == "trained on" else use for use in kept_back]
    uses += [
        Use(clip.name, clip.source, "left out", f"--without {clip.source}", seconds_of(clip))
        for clip in folder.clips
        if clip.source in without
    ]
    uses += [Use(name, "", "left out", reason) for name, reason in folder.left_out.items()]
    text = "\n\n".join(filter(None, (_summary(uses), note)))
    if "base" not in real:
        raise HumanclawError(f"No clip of {source} can be trained on.", f"Give other clips.\n\n{text}")
    names = list(dict.fromkeys((*real, *synthetic)))
    whole = {name: Chunks.join(part[name] for part in (real, synthetic) if name in part) for name in names}
    for name, chunks in whole.items():
        chunks.save(out / f"{name}.npz")
    for name, chunks in apart.items():
        chunks.save(out / "held_out" / f"{name}.npz")
    _save(uses, out)
    return whole, text


def _synthetic(
    clips: Sequence[Clip], skills: Sequence[Trained], seconds: float, seed: int
) -> tuple[dict[str, Chunks], str]:
    """Return synthetic chunks of every skill; or none, and the reason."""
    if not seconds:
        return {}, "No synthetic motion: none was asked for."
    try:
        profiles = Profiles.of(clips)
    except MocapError as error:
        return {}, f"No synthetic motion: {error.message}"
    return synthetic_chunks(profiles, skills, seconds, seed), ""


def _save(uses: Sequence[Use], folder: Path) -> None:
    """Write one line for each clip and file."""
    with (folder / REPORT).open("w", newline="", encoding="utf-8") as file:
        lines = csv.writer(file)
        lines.writerow(field.name for field in fields(Use))
        lines.writerows(tuple(vars(use).values()) for use in uses)


def _summary(uses: Sequence[Use]) -> str:
    """Return a Markdown table of outcomes and reasons."""
    groups: dict[tuple[str, str], list[Use]] = {}
    for use in uses:
        groups.setdefault((use.outcome, use.reason), []).append(use)
    heads = ("clips", "why", "number", "seconds", "windows", "chunks", "for example")
    rows = []
    for (outcome, reason), members in groups.items():
        total = f"{sum(use.seconds for use in members):.1f}"
        counts = (sum(use.windows for use in members), sum(use.chunks for use in members))
        rows.append([outcome, reason, *map(str, (len(members), total, *counts)), members[0].name])
    return table(heads, rows)
