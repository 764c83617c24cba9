"""Clips of a folder: a pack with clips.csv, or any tree of motion files, such as AMASS's."""

from __future__ import annotations

import csv
import re
import tarfile
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache, partial
from pathlib import Path
from types import MappingProxyType
from typing import Final

import numpy as np
from tqdm import tqdm

from humanclaw import Motion
from humanclaw.body import FPS
from humanclaw_train.mocap.readers import AS_WRITTEN, Reading, load
from humanclaw_train.mocap.retarget import retarget
from humanclaw_train.mocap.source_motion import UNREADABLE, MocapError, SourceMotion

Spans = Mapping[str, tuple[tuple[int, int], ...]]
TERMS: Final = "LICENCE.txt"
SUFFIXES: Final = (".amc", ".bvh", ".npz", ".txt")


@dataclass(frozen=True)
class Clip:
    """One retargeted clip. real: False once edited."""

    name: str
    motion: Motion
    spans: Spans | None
    """Tag to (first, last) frames at 30 fps, both included. None if nobody has labelled the clip."""
    source: str
    licence: str
    real: bool = True
    note: str = ""
    """What was assumed when it was read."""

    def tagged(self, tag: str) -> tuple[tuple[int, int], ...]:
        """Return the spans of a tag. An unlabelled clip may show anything anywhere."""
        return ((0, len(self.motion) - 1),) if self.spans is None else self.spans.get(tag, ())


_COLUMNS: Final = ("file", "source", "licence", "skill_tags", "notes")


def _rows(table: Path) -> Iterable[dict[str, str]]:
    with table.open(newline="", encoding="utf-8-sig", errors="replace") as lines:
        rows = csv.DictReader(lines, restval="")
        if lacking := [name for name in _COLUMNS if name not in (rows.fieldnames or ())]:
            needed = f"It needs {', '.join(_COLUMNS)}, with commas between them."
            raise MocapError(f"{table} has no column {', '.join(lacking)}.", needed)
        yield from rows


def _unpack(archive: Path, folder: Path) -> None:
    try:
        with tarfile.open(archive) as tar:
            tar.extractall(folder, filter="data")  # Rejects links and paths that lead outside.
    except (OSError, tarfile.TarError) as error:
        raise MocapError(f"{archive} cannot be unpacked: {error}.", "Download the archive again.") from error


def _row_clip(row: Mapping[str, str], file: Path, reading: Reading) -> Clip:
    source, first = _without_setup_pose(load(file, reading))
    motion = retarget(source)
    spans = {tag: _at_30_fps(ranges, first, source.fps, len(motion)) for tag, ranges in _tagged(row["notes"]).items()}
    if "base" in row["skill_tags"].split():
        spans["base"] = ((0, len(motion) - 1),)
    return Clip(file.stem, motion, MappingProxyType(spans), row["source"], row["licence"], note=source.note)


def _without_setup_pose(source: SourceMotion) -> tuple[SourceMotion, int]:
    """Cut the set-up pose that opens CMU's BVH conversions. Returns the motion and the number of its first frame.

    In one conversion the zero angles are arbitrary, so the set-up pose is the reference there.
    """
    if "CC_Base_Hip" in source.joints:
        return source.with_reference_frame(0)[1:], 1
    return (source[1:], 1) if "LHipJoint" in source.joints else (source, 0)


def _tagged(notes: str) -> dict[str, list[tuple[int, int]]]:
    """Parse the spans of `frames walk 0-340 400-480; stop 500-620. ...`, in source frames."""
    listed = re.match(r"frames ([^.]*)", notes)
    spans: dict[str, list[tuple[int, int]]] = {}
    for tag, *ranges in filter(None, map(str.split, listed[1].split(";") if listed else ())):
        pairs = [re.fullmatch(r"(\d+)-(\d+)", item) for item in ranges]
        if not all(pairs):
            raise MocapError(f"expected notes such as `frames walk 0-340 400-480; stop 500-620.`; got `{notes}`.")
        spans[tag] = [(int(pair[1]), int(pair[2])) for pair in pairs if pair]
    return spans


def _at_30_fps(spans: Iterable[tuple[int, int]], start: int, fps: float, length: int) -> tuple[tuple[int, int], ...]:
    scaled = ((round((first - start) * FPS / fps), round((last - start) * FPS / fps)) for first, last in spans)
    kept = ((max(first, 0), min(last, length - 1)) for first, last in scaled)
    return tuple((first, last) for first, last in kept if last > first)


# -- a folder ----------------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Folder:
    """The retargeted clips of a folder, and for each file that is no motion the reason."""

    clips: list[Clip]
    left_out: Mapping[str, str] = field(default_factory=dict)

    @classmethod
    def read(cls, folder: Path, reading: Reading = AS_WRITTEN) -> Folder:
        """Read what `folder/clips.csv` lists or, without such a table, every motion file of the folder and below.

        Rows of the table name their file, or `archive.tar.xz!member`. Archives are unpacked into a temporary folder.
        reading: what the files do not say. Raises MocapError if no clip can be read.
        """
        clips, left_out = [], {}
        with tempfile.TemporaryDirectory() as temporary:
            for name, file, read in tqdm([*_listed(folder, Path(temporary), reading)], unit="clip", disable=None):
                try:
                    clips.append(read())
                except MocapError as error:
                    # Without the file's name, so that a report can group files by reason.
                    left_out[name] = str(error).removeprefix(str(file)).lstrip(": ")
                except (ArithmeticError, LookupError, MemoryError, TypeError, ValueError) as error:
                    # One file of an exporter that nobody foresaw must not end the reading of the others.
                    left_out[name] = f"cannot be read: {type(error).__name__}: {error}"
        if not clips:
            first = next((f"; the first, {name}: {reason}" for name, reason in left_out.items()), "")
            raise MocapError(
                f"{folder} holds no motion ({len(left_out)} files were tried{first}).",
                "Give a folder of .npz (AMASS), .bvh, .amc with .asf, or .txt (humanoid3d) files.",
            )
        return cls(clips, left_out)


def _listed(folder: Path, temporary: Path, reading: Reading) -> Iterator[tuple[str, Path, Callable[[], Clip]]]:
    """Yield the name, the file and the reader of each clip of a folder."""
    if not (folder / "clips.csv").is_file():
        files = (file for file in folder.glob("**/*") if file.suffix.lower() in SUFFIXES and file.name != TERMS)
        yield from (
            (str(file.relative_to(folder)), file, partial(_file_clip, file, folder, reading)) for file in sorted(files)
        )
        return
    rows = list(_rows(folder / "clips.csv"))
    for archive in sorted({row["file"].split("!")[0] for row in rows if "!" in row["file"]}):
        _unpack(folder / archive, temporary)
    for row in rows:
        file = (temporary if "!" in row["file"] else folder) / row["file"].split("!")[-1]
        yield row["file"], file, partial(_row_clip, row, file, reading)


def _file_clip(file: Path, folder: Path, reading: Reading) -> Clip:
    below = file.relative_to(folder)
    # AMASS/STUDIO/SUBJECT/CLIP: licences belong to studios.
    studio, licence = terms(folder / below.parts[0] if len(below.parts) > 2 else folder)
    name, recorded = str(below.with_suffix("")), _recorded(file) if file.suffix.lower() == ".npz" else None
    if recorded is not None:
        return Clip(name, recorded, None, studio, licence, real=False)
    source = load(file, reading)
    return Clip(name, retarget(source), None, studio, licence, note=source.note)


@cache
def terms(folder: Path) -> tuple[str, str]:
    """Return the source and licence of a folder of motion: `SOURCE: LICENCE` in the first line of its LICENCE.txt.

    Without such a file, the folder's name and an empty licence. Raises MocapError for another first line.
    """
    file = folder / TERMS
    if not file.is_file():
        return folder.resolve().name, ""
    first = file.read_text("utf-8", "replace").partition("\n")[0]
    source, _, licence = (line.strip() for line in first.partition(":"))
    if not source or not licence or "\ufffd" in first:
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
