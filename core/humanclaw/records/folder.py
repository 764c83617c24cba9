"""Write the folder of an episode's record: episode.json, steps.jsonl, motion.npz, frames/."""

from __future__ import annotations

import zipfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from itertools import chain
from pathlib import Path
from typing import BinaryIO

import numpy as np

from humanclaw.body.pose import Array
from humanclaw.errors import RecordError
from humanclaw.records.steps import EpisodeRecord, Outcome, StepRecord, spent
from humanclaw.storage.files import MIB, Folder, add_line, writing
from humanclaw.storage.overflow import Overflow

AGAIN = "Run the episode again, or remove its folder."
RECORD_BYTES, STEPS_BYTES, FRAME_BYTES, MOTION_BYTES = 16 * MIB, 128 * MIB, 16 * MIB, 1024 * MIB
"""Maximum bytes of episode.json, steps.jsonl, a frame, and motion.npz."""
_IN_MEMORY = 200
"""Pieces of motion that stay in memory, 5 MB: more than an episode of a benchmark has."""


class EpisodeWriter:
    """Keeps the record of an episode: in memory, and in a folder if it has one.

    A step is in its file before the next one begins, so that a kill costs no more than the step under way. Motion waits
    for the end, 23 kB a step, in memory or, of a long episode, in a file without a name: who resumes an episode plays
    its calls again.
    """

    def __init__(
        self, folder: Path | str | Folder | None, record: EpisodeRecord, at_rest: Mapping[str, Array] | None = None
    ) -> None:
        """Begin with an episode without steps.

        Args:
            folder: where to write; None keeps nothing on disk.
            at_rest: pose (7,) in which each movable object begins, by the name of its array, object_ID.
        """
        self.record = record
        self.steps: list[StepRecord] = []
        self._files = Folder.of(folder) if folder else None
        self.folder = self._files.path if self._files else None
        self._at_rest, self._pieces = at_rest or {}, list[Mapping[str, Array]]()
        self._overflow = Overflow()
        self._lines: BinaryIO | None = None
        """steps.jsonl, once the folder has begun."""

    def open(self) -> None:
        """Begin the folder, with the steps so far. Call it after a replay: one that fails leaves record and steps."""
        if not self._files:
            return
        kept = {step.frame_file for step in self.steps}
        with writing(self._files):
            self._files.root.mkdir(parents=True, exist_ok=True)
            write_record(self._files, self.record.model_copy(update={"files": {}}))
            for name in ("motion.npz", *frames_in(self._files)):
                if name not in kept:
                    self._files.remove(name)  # Left by an earlier run.
            lines = (step.model_dump_json() + "\n" for step in self.steps)
            self._files.write("steps.jsonl", "".join(lines).encode())
            self._lines = self._files.append("steps.jsonl")

    def frame(self, name: str, data: bytes) -> str:
        """Write a picture, which is on disk when the record ends. Returns its path relative to the folder."""
        if self._files:
            with writing(self._files):
                self._files.root.mkdir(parents=True, exist_ok=True)
                self._files.write(f"frames/{name}", data, settled=False)
        return f"frames/{name}"

    def move(self, *pieces: Mapping[str, Array]) -> None:
        """Append motion: arrays by name, {generated,simulated}_{root,rotations} and object_ID, one row a frame. Of
        objects only those that moved."""
        if self._files:
            self._pieces += [
                self._overflow.put(piece) if len(self._pieces) >= _IN_MEMORY else piece for piece in pieces
            ]

    def keep(self, step: StepRecord) -> None:
        """Append a step: once the folder has begun a line, whole or not at all. Raises RecordError for a full disk."""
        if self._files and self._lines:
            with writing(self._files):
                add_line(self._lines, step.model_dump_json().encode())
        self.steps.append(step)

    def end(self, record: EpisodeRecord) -> None:
        """Write motion.npz and the final episode.json. If the disk was full, make room and call it again."""
        if self._files and self._lines:
            frames = self._files / "frames"
            with writing(self._files):
                self._files.settle(["steps.jsonl"])
                if pictures := frames.names(".jpg"):
                    frames.settle(pictures)
                with self._files.replacing("motion.npz") as stream:
                    _write_npz(stream, sum(len(piece["generated_root"]) for piece in self._pieces), self._motion())
            close_record(self._files, record)
            self._lines.close()
            self._overflow.close()
        self.record = record

    def _motion(self) -> Iterator[tuple[str, Iterator[Array]]]:
        """Yield the parts of each array of the whole motion, by name: whole arrays would take as much memory again."""
        for name in sorted({name for piece in self._pieces for name in piece}):
            yield name, _parts(self._pieces, name, self._at_rest.get(name))

    @property
    def outcome(self) -> Outcome:
        """The outcome that follows from the steps so far: 'interrupted' as long as none of them ends the episode."""
        if self.steps and self.steps[-1].status == "stopped":
            return "stopped"
        return "out_of_steps" if spent(self.steps) >= self.record.spec.max_steps else "interrupted"

    @property
    def is_over(self) -> bool:
        """Whether the steps so far end the episode."""
        return self.outcome != "interrupted"


def _parts(pieces: Sequence[Mapping[str, Array]], name: str, at_rest: Array | None) -> Iterator[Array]:
    """Yield an array of the whole motion by pieces. An object that a piece does not name rests."""
    last = at_rest
    for piece in pieces:
        length = len(piece["generated_root"])
        part = piece[name] if name in piece else np.repeat(np.asarray(last, float)[None], length, 0)
        yield part
        last = part[-1] if length else last


def _write_npz(stream: BinaryIO, rows: int, arrays: Iterator[tuple[str, Iterator[Array]]]) -> None:
    """Write arrays of so many rows as numpy.savez_compressed does, but by parts: its buffers take 40 MB."""
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, parts in arrays:
            with archive.open(f"{name}.npy", "w", force_zip64=True) as member:
                first = next(parts)
                head = {"descr": "<f8", "fortran_order": False, "shape": (rows, *first.shape[1:])}
                np.lib.format.write_array_header_1_0(member, head)
                for part in chain([first], parts):
                    member.write(np.ascontiguousarray(part, "<f8").tobytes())


def write_record(folder: Path | Folder, record: EpisodeRecord) -> None:
    """Write episode.json with its seal."""
    with writing(folder):
        Folder.of(folder).write("episode.json", record.sealed.model_dump_json(indent=1).encode())


def close_record(folder: Path | Folder, record: EpisodeRecord) -> None:
    """Write the final episode.json, with the digest of every other file. From then on, damage is detected."""
    files = Folder.of(folder)
    with reading(files.path):
        names = [name for name in ("steps.jsonl", "motion.npz") if files.has(name)] + frames_in(files)
        digests = {name: files.digest(name, MOTION_BYTES) for name in names}
    write_record(files, record.model_copy(update={"files": digests}))


def frames_in(files: Folder) -> list[str]:
    return [f"frames/{name}" for name in (files / "frames").names(".jpg")]


@contextmanager
def reading(path: Path) -> Iterator[None]:
    """Turn an OSError into a RecordError. path: the file that is read."""
    try:
        yield
    except OSError as error:
        raise RecordError(f"cannot read {path}: {error.strerror or error}.", AGAIN) from error
