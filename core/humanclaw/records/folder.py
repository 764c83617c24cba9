"""Write the folder of an episode's record: episode.json, steps.jsonl, motion.npz, frames/."""

from __future__ import annotations

import errno
import hashlib
import os
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

import numpy as np

from humanclaw.body.pose import Array
from humanclaw.errors import RecordError
from humanclaw.records.steps import EpisodeRecord, StepRecord
from humanclaw.storage.files import replacing, write_atomically

AGAIN = "Run the episode again, or remove its folder."


class EpisodeWriter:
    """Writes one episode folder; every step is on disk before the next begins."""

    def __init__(self, folder: Path, record: EpisodeRecord, kept: Sequence[StepRecord] = ()) -> None:
        """kept: steps of an earlier run that the folder begins with."""
        self.folder = folder
        lines = "".join(step.model_dump_json() + "\n" for step in kept)
        with writing(folder):
            (folder / "frames").mkdir(parents=True, exist_ok=True)
            write_record(folder, record.model_copy(update={"files": {}}))
            for old in ("motion.npz", *frames_in(folder)):
                (folder / old).unlink(missing_ok=True)  # Left by an earlier run; kept steps are drawn again.
            write_atomically(folder / "steps.jsonl", lines.encode())
            self._steps = (folder / "steps.jsonl").open("ab", buffering=0)

    def frame(self, name: str, data: bytes) -> str:
        """Write a picture. Returns its path relative to the folder."""
        with writing(self.folder):
            write_atomically(self.folder / "frames" / name, data)
        return f"frames/{name}"

    def step(self, step: StepRecord) -> None:
        """Append a line, whole or not at all. Raises RecordError if the disk is full."""
        line, before = step.model_dump_json().encode() + b"\n", self._steps.tell()
        with writing(self.folder):
            try:
                if self._steps.write(line) < len(line):
                    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
                os.fsync(self._steps.fileno())
            except OSError:
                self._steps.truncate(before)
                raise

    def end(self, record: EpisodeRecord, arrays: Mapping[str, Array]) -> None:
        """Close the record: write motion.npz, then the final episode.json. Raises RecordError if the disk is full."""
        self._steps.close()
        with writing(self.folder):
            with replacing(self.folder / "motion.npz") as stream:
                _write_npz(stream, arrays)
            close_record(self.folder, record)


def _write_npz(stream: BinaryIO, arrays: Mapping[str, Array]) -> None:
    """Write arrays as numpy.savez_compressed does, but hold only one of them at a time."""
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        for name in arrays:
            with archive.open(f"{name}.npy", "w", force_zip64=True) as member:
                np.lib.format.write_array(member, arrays[name], allow_pickle=False)


@contextmanager
def writing(folder: Path) -> Iterator[None]:
    """Turn an OSError, such as a full disk or a read-only folder, into a RecordError."""
    try:
        yield
    except OSError as error:
        reason = f"cannot write the record to {folder}: {error.strerror or error}."
        raise RecordError(reason, "Make room there, or name another folder with --out.") from error


def write_record(folder: Path, record: EpisodeRecord) -> None:
    """Write episode.json with its seal."""
    with writing(folder):
        write_atomically(folder / "episode.json", record.sealed.model_dump_json(indent=1).encode())


def close_record(folder: Path, record: EpisodeRecord) -> None:
    """Write the final episode.json, with the digest of every other file. From then on, damage is detected."""
    there = [name for name in ("steps.jsonl", "motion.npz") if (folder / name).exists()]
    digests = {name: hashlib.sha256(read_file(folder / name)).hexdigest() for name in (*there, *frames_in(folder))}
    write_record(folder, record.model_copy(update={"files": digests}))


def frames_in(folder: Path) -> list[str]:
    return sorted(f"frames/{path.name}" for path in (folder / "frames").glob("*.jpg"))


def read_file(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise RecordError(f"cannot read {path}: {error.strerror}.", AGAIN) from error
