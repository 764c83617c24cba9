"""Clips of a folder: a pack with clips.csv, or any tree of motion files, such as AMASS's."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Final

import numpy as np
from tqdm import tqdm

from humanclaw import Motion
from humanclaw_train import mocap
from humanclaw_train.chunks import Clip, load_pack
from humanclaw_train.retarget import retarget
from humanclaw_train.source_motion import UNREADABLE, MocapError

TERMS: Final = "LICENCE.txt"
SUFFIXES: Final = (".amc", ".bvh", ".npz", ".txt")


@dataclass(frozen=True)
class Folder:
    """The retargeted clips of a folder, and for each file that is no motion the reason."""

    clips: list[Clip]
    left_out: Mapping[str, str] = field(default_factory=dict)

    @classmethod
    def read(cls, folder: Path) -> Folder:
        """Read what `folder/clips.csv` lists or, without such a table, every motion file of the folder and below.

        Raises MocapError if no clip can be read.
        """
        if (folder / "clips.csv").is_file():
            return cls(load_pack(folder))
        found = (file for file in folder.glob("**/*") if file.suffix.lower() in SUFFIXES)
        files = sorted(file for file in found if file.name != TERMS)
        clips, left_out = [], {}
        for file in tqdm(files, unit="clip", disable=None):
            try:
                clips.append(_clip(file, folder))
            except MocapError as error:
                # Without the file's name, so that a report can group files by reason.
                left_out[str(file.relative_to(folder))] = error.message.removeprefix(str(file)).lstrip(": ")
        if not clips:
            raise MocapError(
                f"{folder} holds no motion ({len(left_out)} files were tried).",
                "Give a folder of .npz (AMASS), .bvh, .amc with .asf, or .txt (humanoid3d) files.",
            )
        return cls(clips, left_out)


def _clip(file: Path, folder: Path) -> Clip:
    recorded = _recorded(file) if file.suffix.lower() == ".npz" else None
    motion = retarget(mocap.load(file)) if recorded is None else recorded
    below = file.relative_to(folder)
    # AMASS/STUDIO/SUBJECT/CLIP: licences belong to studios.
    studio = folder / below.parts[0] if len(below.parts) > 2 else folder
    source, licence = terms(studio)
    return Clip(str(below.with_suffix("")), motion, None, source, licence, real=recorded is None)


@cache
def terms(folder: Path) -> tuple[str, str]:
    """Return the source and licence of a folder of motion: `SOURCE: LICENCE` in the first line of its LICENCE.txt.

    Without such a file, the folder's name and an empty licence. Raises MocapError for another first line.
    """
    file = folder / TERMS
    if not file.is_file():
        return folder.resolve().name, ""
    source, _, licence = (line.strip() for line in file.read_text("utf-8").partition("\n")[0].partition(":"))
    if not source or not licence:
        raise MocapError(f"{file} does not begin with SOURCE: LICENCE.", 'Write such as "HDM05: CC BY-SA 3.0".')
    return source, licence


def _recorded(file: Path) -> Motion | None:
    """Return the body's motion in a recorded episode, which is not captured motion, or None for other files."""
    try:
        with np.load(file, allow_pickle=False) as arrays:
            if "simulated_root" not in arrays:
                return None
            return Motion(arrays["simulated_root"].astype(float), arrays["simulated_rotations"].astype(float))
    except UNREADABLE as error:
        raise MocapError(f"{file} cannot be read: {error}.", "Check that the file is complete.") from error
