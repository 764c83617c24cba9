"""Read episode folders back, and check them for damage."""

from __future__ import annotations

import hashlib
import io
import json
import re
import zipfile
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from functools import lru_cache
from itertools import accumulate, pairwise
from pathlib import Path
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from humanclaw.body.pose import HISTORY, Array, Motion
from humanclaw.errors import RecordError
from humanclaw.records.folder import (
    AGAIN,
    FRAME_BYTES,
    MOTION_BYTES,
    RECORD_BYTES,
    STEPS_BYTES,
    reading,
)
from humanclaw.records.steps import FORMAT, MOST_FRAMES, EpisodeRecord, StepRecord, seal_of
from humanclaw.storage.files import Folder, lacking, state_of
from humanclaw.storage.pictures import from_jpeg
from humanclaw.text.json import first_fault
from humanclaw.text.notebook import card, spread, table
from humanclaw.text.words import counted
from humanclaw.world.simulator import person_id

REPORT: Final = "report.html"
"""File of the page that a reporter writes into the folder of an episode or a run."""
_LARGEST: Final = 1 << 30
"""Maximum bytes of all arrays of motion. 10,000 steps take a sixth of it, 100 moving objects the rest."""
_ROWS: Final = {"root": (3,), "rotations": (24, 3), "object": (7,)}
"""Shape of one row, by kind of array."""
_ARRAY: Final = re.compile(r"(?:(?:generated|simulated)_(root|rotations)|(object)_\d{1,9})\.npy")


class RecordedEpisode:
    """An episode folder, read back. Raises RecordError, with file and line, if anything in it is damaged."""

    def __init__(self, folder: Path | str | Folder) -> None:
        self.files = Folder.of(folder)
        self.folder = folder = self.files.path
        self.record = _read_record(self.files)
        _verify(self.files, self.record)
        self.steps = tuple(_read_steps(self.files))
        if self.record.files and len(self.steps) != self.record.steps:
            raise RecordError(
                f"{folder} holds {counted(len(self.steps), 'step')}; its record says {self.record.steps}.", AGAIN
            )

    @property
    def has_motion(self) -> bool:
        """Whether the record holds motion. It is written when an episode ends."""
        return self.files.has("motion.npz")

    @property
    def spans(self) -> tuple[tuple[int, int], ...]:
        """First frame of each step in motion(), and the frame after its last; equal if nothing moved."""
        return tuple(pairwise(accumulate((step.motion_frames for step in self.steps), initial=HISTORY)))

    def motion(self, kind: Literal["generated", "simulated"] = "simulated") -> Motion:
        """Return all frames of the episode (world frame): five of standing, then motion_frames for each step."""
        arrays = self._arrays(f"{kind}_root", f"{kind}_rotations")
        return Motion(*(part.astype(float) for part in arrays.values()))

    def company(self) -> dict[int, RecordedEpisode]:
        """Return the episode of each other body in the scene by `person_id`.

        Whoever's record is not beside this one, or holds no motion, is left out.
        """
        names, own = self.record.company, self.record.spec.id
        # A partner's record lies inside its episode's, and all names lead from where that lies.
        inside = max((name.count("/") for name in names if name.rpartition("/")[2] == own), default=0)
        others = {person_id(k): self.folder.parents[inside] / name for k, name in enumerate(names)}
        folders = {k: path for k, path in others.items() if path != self.folder and Folder(path).has("motion.npz")}
        return {k: RecordedEpisode(path) for k, path in folders.items()}

    def people(self) -> dict[int, Motion]:
        """Return the motion of each of company(), as long as motion(): who has ended stands."""
        frames = np.arange(len(self.motion()))
        return {
            k: Motion(*(part[np.minimum(frames, len(part) - 1)] for part in (way.root, way.rotations)))
            for k, way in ((k, other.motion()) for k, other in self.company().items())
        }

    def objects(self) -> dict[int, Array]:
        """Return (T, 7) position and quaternion by object id, one row for each frame of motion()."""
        return {int(key[7:]): path.astype(float) for key, path in self._arrays().items() if key.startswith("object_")}

    def _arrays(self, *names: str) -> dict[str, Array]:
        """Return the named arrays of motion, or all. Raises RecordError if they are damaged.

        Sizes are checked before memory is allocated.
        """
        try:
            lasting = sum(step.motion_frames for step in self.steps)
            arrays = _read_arrays(self.files, state_of(self.files.status("motion.npz")), lasting + MOST_FRAMES)
            held = min(map(len, arrays.values()), default=0)
            if held < lasting:
                raise ValueError(f"it holds {held} frames, and its steps last {lasting}")
            return {name: arrays[name] for name in names or sorted(arrays)}
        except Exception as error:  # Damage raises a dozen kinds of errors in numpy, zipfile and its unpackers.
            reason = error.strerror if isinstance(error, OSError) else error
            raise RecordError(f"{self.folder / 'motion.npz'} cannot be read: {reason}.", AGAIN) from error

    def view(self, step: StepRecord) -> bytes:
        """Return the view before a step as JPEG; empty if the record does not hold it."""
        name = step.frame_file
        with reading(self.folder / name), suppress(FileNotFoundError):
            return self.files.read(name, FRAME_BYTES) if name else b""
        return b""

    def picture(self, step: StepRecord) -> NDArray[np.uint8] | None:
        """Return the view before a step as (height, width, 3); None if the record does not hold it."""
        data = self.view(step)
        with reading(self.folder / step.frame_file):
            return from_jpeg(data) if data else None

    def _repr_html_(self) -> str:
        """Return the task, the outcome and a strip of views, for a notebook."""
        spec, count = self.record.spec, len(self.steps)
        kept = [step for step in self.steps if step.frame_file and self.files.has(step.frame_file)]
        pictures = [(f"step {kept[k].step}", self.view(kept[k])) for k in spread(len(kept))]
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
                with reading(self.folder / step.frame_file):
                    state.update(self.files.read(step.frame_file, FRAME_BYTES))
        if self.has_motion:
            for key, array in self._arrays().items():
                state.update(key.encode() + array.tobytes())
        return state.hexdigest()


class RecordedRun(list[RecordedEpisode]):
    """The episodes of a run: a list with a table for notebooks."""

    def _repr_html_(self) -> str:
        """Return the number of episodes by outcome, and a row for each of the first."""
        ends = Counter(episode.record.outcome.replace("_", " ") for episode in self)
        summary = ", ".join(f"{count} {outcome}" for outcome, count in ends.most_common())
        head = ("episode", "instruction", "agent", "outcome", "steps", "to the target")
        return table(f"{counted(len(self), 'episode')}: {summary}", head, [_cells(episode) for episode in self])


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


def load_run(folder: Path | str) -> RecordedRun:
    """Read all episodes under a folder, by name. Raises RecordError if there are none."""
    folders = Folder(Path(folder)).holding("episode.json")
    if not folders:
        remedy = "Name a folder that `humanclaw run` or `humanclaw bench run` wrote."
        raise lacking(Path(folder), "episode record", remedy)
    episodes = RecordedRun(map(RecordedEpisode, folders))
    for run in {episode.folder.parent for episode in episodes}:
        if Folder(run).has("run.json"):
            _refuse_copies([episode for episode in episodes if episode.folder.parent == run])
    return episodes


def _refuse_copies(episodes: Sequence[RecordedEpisode]) -> None:
    """Raise RecordError for an episode in a folder of another name: a copy would count twice."""
    for episode in episodes:
        if episode.folder.name != episode.record.spec.id:
            raise RecordError(f"{episode.folder} holds the record of {episode.record.spec.id!r}.", "Remove the copy.")


def _read_record(files: Folder) -> EpisodeRecord:
    path = files.path / "episode.json"
    try:
        with reading(path):
            data = files.read(path.name, RECORD_BYTES)
        record = EpisodeRecord.model_validate_json(data)
    except ValidationError as error:
        if (first := error.errors()[0])["loc"] == ("format",):
            other = f"another version of humanclaw wrote it, in format {first['input']!r:.20}; this one reads {FORMAT}"
            raise RecordError(f"{path} cannot be read: {other}.", AGAIN) from error
        raise RecordError(f"{path}{_where(error)} is no record: {first_fault(error)}.", AGAIN) from error
    if record.seal and seal_of(data) != record.seal:
        raise RecordError(f"{path} has been changed since it was written.", AGAIN)
    return record


def _verify(files: Folder, record: EpisodeRecord) -> None:
    """Raise RecordError if a file differs from its digest in the record."""
    for name, digest in record.files.items():
        with reading(files.path / name):
            actual = files.digest(name, MOTION_BYTES)
        if actual != digest:
            raise RecordError(f"{files.path / name} has been changed since it was written.", AGAIN)


@lru_cache(maxsize=1)
def _read_arrays(files: Folder, state: tuple[int, ...], most: int) -> Mapping[str, Array]:
    """Read and check motion.npz. Whoever scores or shows an episode asks for its arrays several times.

    state: of the file, so that a changed one is read again. most: maximum frames, those of the steps and of one that
    broke off.
    """
    with files.open("motion.npz", MOTION_BYTES) as stream, zipfile.ZipFile(stream) as archive:
        # A member never yields more bytes than its entry says, so this bounds the memory.
        if sum(member.file_size for member in archive.infolist()) > _LARGEST:
            raise ValueError(f"its arrays are larger than {_LARGEST >> 20} MiB")
        arrays = {name: _array(archive, name) for name in archive.namelist()}
    _check_arrays(arrays, most)
    return {name.removesuffix(".npy"): array for name, array in arrays.items()}


def _check_arrays(arrays: Mapping[str, Array], most: int) -> None:
    """Raise ValueError for an array of an unknown name, shape or type, values that are not finite, arrays of different
    lengths, and more frames than most."""
    for name, array in arrays.items():
        kind = _ARRAY.fullmatch(name)
        if not kind or array.shape[1:] != _ROWS[kind[1] or kind[2]] or array.dtype.kind != "f":
            raise ValueError(f"{name} {array.shape} is not an array of motion")
        if not np.isfinite(array).all():
            raise ValueError("it holds values that are not finite")
    if len(set(map(len, arrays.values()))) > 1:
        raise ValueError("its arrays are of different lengths")
    if any(len(array) > most for array in arrays.values()):
        raise ValueError("it holds far more frames than its steps last")


def _array(archive: zipfile.ZipFile, name: str) -> Array:
    with archive.open(name) as stream:
        return np.asarray(np.lib.format.read_array(stream, allow_pickle=False))


def _read_steps(files: Folder) -> Iterator[StepRecord]:
    """Yield the complete lines. A line cut off by a crash is not a step."""
    path, data = files.path / "steps.jsonl", b""
    with reading(path), suppress(FileNotFoundError):
        data = files.read(path.name, STEPS_BYTES)
    # str.splitlines would also break at characters that a model may write, such as U+2028.
    for number, line in enumerate(io.BytesIO(data), 1):
        if not line.endswith(b"\n"):
            return
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
    place = re.search(r"at line (\d+)", error.errors()[0]["msg"])
    return f":{place[1]}" if place else ""
