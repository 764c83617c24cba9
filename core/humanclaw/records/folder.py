"""Write the folder of an episode's record: episode.json, steps.jsonl, motion.npz, frames/."""

from __future__ import annotations

import zipfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import BinaryIO

import numpy as np

from humanclaw.body.pose import Array
from humanclaw.errors import RecordError
from humanclaw.records.steps import EpisodeRecord, StepRecord
from humanclaw.storage.files import MIB, Folder, begin_line, writing

AGAIN = "Run the episode again, or remove its folder."
RECORD_BYTES, STEPS_BYTES, FRAME_BYTES, MOTION_BYTES = 16 * MIB, 128 * MIB, 16 * MIB, 1024 * MIB
"""Maximum bytes of episode.json, steps.jsonl, a frame, and motion.npz."""


class EpisodeWriter:
    """Writes one episode folder. The disk works while the next view is drawn: before that view is kept, and so before
    the next step is decided, everything earlier but the views is on disk."""

    def __init__(self, folder: Path | Folder, record: EpisodeRecord, kept: Sequence[StepRecord] = ()) -> None:
        """kept: steps of an earlier run that the folder begins with."""
        self._files = files = Folder.of(folder)
        self.folder = files.path
        lines = "".join(step.model_dump_json() + "\n" for step in kept)
        with writing(files):
            files.root.mkdir(parents=True, exist_ok=True)
            write_record(files, record.model_copy(update={"files": {}}), settled=bool(kept))
            for old in ("motion.npz", *frames_in(files), *pieces_in(files)):
                files.remove(old)  # Left by an earlier run; kept steps are drawn again.
            files.write("steps.jsonl", lines.encode(), settled=bool(kept))
            self._steps = files.append("steps.jsonl")
        self._pieces = 0
        self._disk = ThreadPoolExecutor(1)
        self._later(partial(files.settle, ("episode.json", "steps.jsonl")))

    def frame(self, name: str, data: bytes) -> str:
        """Write a picture. Returns its path relative to the folder. It is on disk when the record ends: who continues
        an episode draws its steps again."""
        self._settle()
        with writing(self._files):
            self._files.write(f"frames/{name}", data, settled=False)
        return f"frames/{name}"

    def move(self, piece: Mapping[str, Array]) -> None:
        """Write the motion of a chunk, which `humanclaw watch` shows; at the end motion.npz holds it."""
        with writing(self._files), self._files.replacing(f"frames/{self._pieces:06d}.npz", settled=False) as stream:
            _write_npz(stream, piece, zipfile.ZIP_STORED)
        self._pieces += 1

    def step(self, step: StepRecord) -> None:
        """Append a line, whole or not at all. Raises RecordError if the disk is full."""
        self._settle()
        with writing(self._files):
            self._later(begin_line(self._steps, step.model_dump_json().encode()))

    def _later(self, settle: Callable[[], None]) -> None:
        """Let the disk work meanwhile."""
        self._due, self._settling = settle, self._disk.submit(settle)

    def _settle(self) -> None:
        """Wait until what was written before is on disk. Where that fails, the next call tries again."""
        with writing(self._files):
            try:
                self._settling.result()
            except OSError:
                self._later(self._due)
                raise

    def end(self, record: EpisodeRecord, arrays: Mapping[str, Array]) -> None:
        """Close the record: write motion.npz, then the final episode.json. Raises RecordError if the disk is full."""
        self._settle()
        self._steps.close()
        frames = self._files / "frames"
        with writing(self._files):
            if pictures := frames.names(".jpg"):
                self._later(partial(frames.settle, pictures))
            with self._files.replacing("motion.npz") as stream:
                _write_npz(stream, arrays)
        self._settle()
        close_record(self._files, record)
        self._disk.shutdown()


def _write_npz(stream: BinaryIO, arrays: Mapping[str, Array], packing: int = zipfile.ZIP_DEFLATED) -> None:
    """Write arrays as numpy.savez_compressed does, but a thousand rows at a time: its buffers take 40 MB."""
    with zipfile.ZipFile(stream, "w", packing) as archive:
        for name in arrays:
            with archive.open(f"{name}.npy", "w", force_zip64=True) as member:
                array = np.ascontiguousarray(arrays[name])
                np.lib.format.write_array_header_1_0(member, np.lib.format.header_data_from_array_1_0(array))
                for first in range(0, len(array), 1000):
                    member.write(array[first : first + 1000].tobytes())


def write_record(folder: Path | Folder, record: EpisodeRecord, settled: bool = True) -> None:
    """Write episode.json with its seal. settled: as Folder.replacing() has it."""
    with writing(folder):
        Folder.of(folder).write("episode.json", record.sealed.model_dump_json(indent=1).encode(), settled)


def close_record(folder: Path | Folder, record: EpisodeRecord) -> None:
    """Write the final episode.json, with the digest of every other file. From then on, damage is detected."""
    files = Folder.of(folder)
    with reading(files.path):
        names = [name for name in ("steps.jsonl", "motion.npz") if files.has(name)] + frames_in(files)
        digests = {name: files.digest(name, MOTION_BYTES) for name in names}
    with writing(files):
        for piece in pieces_in(files):
            files.remove(piece)  # Before the seal: nobody opens a sealed record again to clear what a kill has left.
    write_record(files, record.model_copy(update={"files": digests}))


def frames_in(files: Folder) -> list[str]:
    return [f"frames/{name}" for name in (files / "frames").names(".jpg")]


def pieces_in(files: Folder) -> list[str]:
    """Return the files of motion that an episode in progress has, in order."""
    return [f"frames/{name}" for name in (files / "frames").names(".npz")]


def joined(pieces: Sequence[Mapping[str, Array]], name: str, rest: Array | None = None) -> Array:
    """Return an array of the whole motion from those of its pieces. An object that a piece does not name rests.

    rest: an object's pose before it first moves; by default the first one that is known.
    """
    lasting = [len(next(iter(piece.values()))) for piece in pieces]
    last = next(piece[name][0] for piece in pieces if name in piece) if rest is None else rest
    parts = []
    for piece, length in zip(pieces, lasting, strict=True):
        parts.append(piece[name] if name in piece else np.repeat(last[None], length, 0))
        last = parts[-1][-1] if length else last
    return np.concatenate(parts)


@contextmanager
def reading(path: Path) -> Iterator[None]:
    """Turn an OSError into a RecordError. path: the file that is read."""
    try:
        yield
    except OSError as error:
        raise RecordError(f"cannot read {path}: {error.strerror or error}.", AGAIN) from error
