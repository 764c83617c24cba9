"""Read episode folders back, and check them for damage."""

from __future__ import annotations

import hashlib
import json
import math
import re
import zipfile
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Final, Literal

import numpy as np
from pydantic import ValidationError

from humanclaw.body.pose import Array, Motion
from humanclaw.errors import RecordError
from humanclaw.records.folder import AGAIN, read_file
from humanclaw.records.steps import EpisodeRecord, StepRecord, seal_of
from humanclaw.storage.files import within
from humanclaw.text.json import first_fault
from humanclaw.text.notebook import card, spread, table
from humanclaw.text.words import counted

_LARGEST: Final = 1 << 30
"""Maximum bytes of all arrays of motion. 10,000 steps take a sixth of it, 100 moving objects the rest."""
_ROWS: Final = {"root": (3,), "rotations": (24, 3), "object": (7,)}
"""Shape of one row, by kind of array."""
_ARRAY: Final = re.compile(r"(?:(?:generated|simulated)_(root|rotations)|(object)_\d{1,9})\.npy")


class RecordedEpisode:
    """An episode folder, read back. Raises RecordError, with file and line, if anything in it is damaged."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.record = _read_record(folder / "episode.json")
        _verify(folder, self.record)
        self.steps = tuple(_read_steps(folder / "steps.jsonl"))
        if self.record.files and len(self.steps) != self.record.steps:
            raise RecordError(
                f"{folder} holds {counted(len(self.steps), 'step')}; its record says {self.record.steps}.", AGAIN
            )

    @property
    def has_motion(self) -> bool:
        """Whether there is a motion.npz. A running or killed episode has none."""
        return (self.folder / "motion.npz").is_file()

    def motion(self, kind: Literal["generated", "simulated"] = "simulated") -> Motion:
        """Return all frames of the episode (world frame): five of standing, then motion_frames for each step."""
        arrays = self._arrays(f"{kind}_root", f"{kind}_rotations")
        return Motion(*(part.astype(float) for part in arrays.values()))

    def objects(self) -> dict[int, Array]:
        """Return (T, 7) position and quaternion by object id, one row for each frame of motion()."""
        return {int(key[7:]): path.astype(float) for key, path in self._arrays().items() if key.startswith("object_")}

    def _arrays(self, *names: str) -> dict[str, Array]:
        """Return the named arrays of motion.npz, or all. Raises RecordError if they are damaged.

        Sizes are checked before memory is allocated.
        """
        path = self.folder / "motion.npz"
        try:
            with zipfile.ZipFile(path) as archive:
                _check_arrays(archive)
            with np.load(path) as data:
                found = {name: data[name] for name in names or sorted(data.files)}
            if not all(np.isfinite(array).all() for array in found.values()):
                raise ValueError("it holds values that are not finite")
            lasting, held = sum(step.motion_frames for step in self.steps), min(map(len, found.values()), default=0)
            if held < lasting:
                raise ValueError(f"it holds {held} frames, and its steps last {lasting}")
        except Exception as error:  # Damage raises a dozen kinds of errors in numpy, zipfile and its unpackers.
            raise RecordError(f"{path} cannot be read: {error}.", AGAIN) from error
        return found

    def _repr_html_(self) -> str:
        """Return the task, the outcome and a strip of views, for a notebook."""
        spec, count = self.record.spec, len(self.steps)
        kept = [step for step in self.steps if step.frame_file and (self.folder / step.frame_file).is_file()]
        pictures = [(f"step {kept[k].step}", read_file(self.folder / kept[k].frame_file)) for k in spread(len(kept))]
        ended = f"{self.record.outcome.replace('_', ' ')} after {counted(count, 'step')}"
        return card(f"Episode {spec.id}", [f"{self.record.agent}: {spec.instruction}", ended], pictures)

    @property
    def digest(self) -> str:
        """SHA-256 over record, steps, frames and motion. Runs that did the same have the same digest.

        Times, durations and later additions to the record are left out.
        """
        state = hashlib.sha256(self.record.model_dump_json(exclude={"created", "files", "seal"}).encode())
        for step in self.steps:
            state.update(step.model_dump_json(exclude={"seconds"}).encode())
            if step.frame_file:
                state.update(read_file(_within(self.folder, step.frame_file)))
        if (self.folder / "motion.npz").exists():
            for key, array in self._arrays().items():
                state.update(key.encode() + array.tobytes())
        return state.hexdigest()


class RecordedRun(list[RecordedEpisode]):
    """The episodes of a run: a list with a table for notebooks."""

    def _repr_html_(self) -> str:
        """Return the number of episodes by outcome, and a row for each of the first."""
        ends = Counter(episode.record.outcome.replace("_", " ") for episode in self)
        told = ", ".join(f"{count} {outcome}" for outcome, count in ends.most_common())
        head = ("episode", "instruction", "agent", "outcome", "steps", "to the target")
        return table(f"{counted(len(self), 'episode')}: {told}", head, [_cells(episode) for episode in self])


def _cells(episode: RecordedEpisode) -> tuple[str, ...]:
    record, last = episode.record, episode.steps[-1].target_distance if episode.steps else None
    return (
        record.spec.id,
        record.spec.instruction,
        record.agent,
        record.outcome.replace("_", " "),
        str(len(episode.steps)),
        "" if last is None else f"{last:.2f} m",
    )


def load_run(folder: Path) -> RecordedRun:
    """Read all episodes under a folder, by name. Raises RecordError if there are none."""
    found = sorted(path.parent for path in folder.rglob("episode.json"))
    if not found:
        raise RecordError(
            f"there is no episode record in {folder}.",
            "Name a folder that `humanclaw run` or `humanclaw bench run` wrote.",
        )
    episodes = RecordedRun(map(RecordedEpisode, found))
    for run in {path.parent for path in found if (path.parent / "run.json").exists()}:
        _refuse_copies([episode for episode in episodes if episode.folder.parent == run])
    return episodes


def _refuse_copies(episodes: Sequence[RecordedEpisode]) -> None:
    """Raise RecordError for an episode in a folder of another name: a copy would count twice."""
    for episode in episodes:
        if episode.folder.name != episode.record.spec.id:
            raise RecordError(f"{episode.folder} holds the record of {episode.record.spec.id!r}.", "Remove the copy.")


def _read_record(path: Path) -> EpisodeRecord:
    try:
        data = read_file(path)
        record = EpisodeRecord.model_validate_json(data)
    except ValidationError as error:
        raise RecordError(f"{path}{_where(error)} is no record: {first_fault(error)}.", AGAIN) from error
    if record.seal and seal_of(data) != record.seal:
        raise RecordError(f"{path} has been changed since it was written.", AGAIN)
    return record


def _verify(folder: Path, record: EpisodeRecord) -> None:
    """Raise RecordError if a file differs from its digest in the record."""
    for name, digest in record.files.items():
        if hashlib.sha256(read_file(_within(folder, name))).hexdigest() != digest:
            raise RecordError(f"{folder / name} has been changed since it was written.", AGAIN)


def _within(folder: Path, name: str) -> Path:
    """Return the path of a record's file. Raises RecordError if it leads out of the folder."""
    try:
        path = within(folder, name)
        inside = path.resolve().is_relative_to(folder.resolve())
    except ValueError:  # Also for names that no file can have.
        inside = False
    if not inside:
        raise RecordError(f"the record in {folder} names {name!r}, which lies elsewhere.", AGAIN)
    return path


def _check_arrays(archive: zipfile.ZipFile) -> None:
    """Raise ValueError for an array of an unknown name or shape, one that differs from its header, arrays of different
    lengths, and a total size above _LARGEST."""
    shapes = {member.filename: _shape(archive, member) for member in archive.infolist()}
    for name, shape in shapes.items():
        kind = _ARRAY.fullmatch(name)
        if not kind or shape[1:] != _ROWS[kind[1] or kind[2]]:
            raise ValueError(f"{name} {shape} is not an array of motion")
    if len({shape[0] for shape in shapes.values()}) > 1:
        raise ValueError("its arrays are of different lengths")
    if sum(member.file_size for member in archive.infolist()) > _LARGEST:
        raise ValueError(f"its arrays are larger than {_LARGEST >> 20} MiB")


def _shape(archive: zipfile.ZipFile, member: zipfile.ZipInfo) -> tuple[int, ...]:
    """Return the shape in an array's header. Raises ValueError if the data have another size or no numbers."""
    with archive.open(member) as stream:
        version = np.lib.format.read_magic(stream)
        read = {1: np.lib.format.read_array_header_1_0, 2: np.lib.format.read_array_header_2_0}[version[0]]
        shape, _, kind = read(stream)
        size = math.prod(shape) * kind.itemsize
        if stream.tell() + size != member.file_size or kind.kind != "f":
            raise ValueError(f"{member.filename} does not hold {size} bytes of numbers")
    return shape


def _read_steps(path: Path) -> Iterator[StepRecord]:
    """Yield the complete lines. A line cut off by a crash is not a step."""
    if not path.exists():
        return
    # str.splitlines would also break at characters that a model may write, such as U+2028.
    for number, line in enumerate(read_file(path).split(b"\n")[:-1], 1):
        step = _parse(line, f"{path}:{number}")
        if step.step != number - 1:
            raise RecordError(f"{path}:{number} holds step {step.step}: lines are missing or in another order.", AGAIN)
        yield step


def _parse(line: bytes, where: str) -> StepRecord:
    if b"NaN" in line or b"Infinity" in line:
        _refuse_infinite(line, where)
    try:
        return StepRecord.model_validate_json(line)
    except ValidationError as error:
        raise RecordError(f"{where} holds a line that is not a step: {first_fault(error)}.", AGAIN) from error


def _refuse_infinite(line: bytes, where: str) -> None:
    """Raise RecordError for NaN or Infinity outside of strings: no episode writes them."""

    def refuse(value: str) -> None:
        raise RecordError(f"{where} holds {value}, which is not a finite number.", AGAIN)

    with suppress(ValueError):
        json.loads(line, parse_constant=refuse)


def _where(error: ValidationError) -> str:
    """Return ':line' where the text stops being JSON; empty if it does not."""
    found = re.search(r"at line (\d+)", error.errors()[0]["msg"])
    return f":{found[1]}" if found else ""
