"""What is asked of a body and what is kept of it: specifications, records, and the folder that holds them.

A folder (episode.json, steps.jsonl, motion.npz, frames/) is enough to score an episode without a simulator.
"""

from __future__ import annotations

import errno
import hashlib
import io
import json
import math
import os
import re
import zipfile
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, ClassVar, Final, Literal

import numpy as np
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError

from humanclaw._decisions import STRICT, Answer, Attempt, Call, Decision, Refusal, Usage, Verdict
from humanclaw._feedback import Displacement, Feedback, Proprioception, Touch
from humanclaw._files import within, write_atomically
from humanclaw._notebook import card, spread, table
from humanclaw._words import counted, legible
from humanclaw.body import BodyGroup
from humanclaw.errors import RecordError
from humanclaw.pose import FUTURE, Array, Motion, Pose2D

__all__ = [
    "Answer", "Attempt", "Call", "Contact", "Decision", "Difficulty", "Displacement", "EpisodeRecord", "EpisodeSpec",
    "EpisodeWriter", "Feedback", "Outcome", "PlayedPart", "Proprioception", "Record", "RecordedEpisode",
    "RecordedRun", "Refusal", "SkillInfo", "StepRecord", "Touch", "Usage", "Vec3", "Verdict", "close_record",
    "load_run", "name_of", "write_record", "writing",
]  # fmt: skip

FORMAT: Literal[2] = 2
Outcome = Literal["running", "stopped", "out_of_steps", "plugin_error", "infra_error", "limit_reached", "interrupted"]
Vec3 = tuple[float, float, float]
_LARGEST: Final = 1 << 30
"""Bytes of all arrays of motion: 10,000 steps of half a second take a sixth of it, and a hundred objects that move the
rest."""
_ROWS: Final = {"root": (3,), "rotations": (24, 3), "object": (7,)}
"""Shape of a row of an array of motion."""
_ARRAY: Final = re.compile(r"(?:(?:generated|simulated)_(root|rotations)|(object)_\d{1,9})\.npy")
_FARTHEST: Final = 10_000.0
_AGAIN = "Run the episode again, or remove its folder."


class Record(BaseModel):
    """Base of all records: frozen, and strict about unknown fields, so that an old reader never misreads a new record.

    What a model wrote as NaN or Infinity is kept as that word: JSON has no such number.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", ser_json_inf_nan="strings")


Name = Annotated[str, Field(pattern=r"^[^\x00-\x1f\x7f-\x9f]*$")]
"""What a terminal prints and does not obey."""


# -- what is asked -----------------------------------------------------------------------------------------------------
class Difficulty(Record):
    """How hard the shortest way to the nearest target is (paper, section 4.1)."""

    distance: float
    """Its length, metres."""
    turns: int
    """Of more than 30 degrees."""
    rooms: int
    """That it enters, the one of the start included."""
    obstacles: float
    """Pieces of furniture within a metre, averaged along it."""


def _on_the_map(start: Pose2D) -> Pose2D:
    """Hold a start to where floats still tell millimetres."""
    if max(map(abs, (start.x, start.z, start.floor))) > _FARTHEST:
        raise ValueError(f"a start lies within {_FARTHEST:g} m of the origin")
    return start


class EpisodeSpec(Record):
    """One episode: an instruction, a scene and a start."""

    id: Annotated[str, Field(pattern=r"^[A-Za-z0-9_-][A-Za-z0-9._-]{0,99}$")]
    instruction: Annotated[str, Field(min_length=1)]
    scene: str
    """Scheme and name, such as house:0."""
    scene_digest: str = ""
    """If given, a scene with another digest is refused."""
    start: Annotated[Pose2D, AfterValidator(_on_the_map)] | None = None
    """None: where the scene says."""
    target_category: str = ""
    """Empty for a free instruction, which is then not scored."""
    target_ids: tuple[int, ...] = ()
    interact: bool = False
    """Whether the target is to be sat on."""
    max_steps: Annotated[int, Field(ge=1, le=10_000)] = 100
    seed: Annotated[int, Field(ge=0)] = 0
    difficulty: Difficulty | None = None
    """Known of the episodes of a split."""


def name_of(scene: str) -> str:
    """Make a scene reference part of an episode's id: house:3 becomes house-3, and so does whatever a file cannot be
    called."""
    return re.sub(r"[^A-Za-z0-9._]+", "-", scene).strip("-")[:60]


# -- what came of it ---------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Contact:
    """A link of the body against an object: in which frames, and the deepest and highest point of them.

    A simulator tells of the 15 frames of a chunk, one or more at a time; a record of all frames of a step.
    """

    __pydantic_config__: ClassVar = STRICT

    frames: tuple[int, ...]
    """Counted from the first of the chunk or step."""
    joint: str
    group: BodyGroup
    object_id: int
    movable: bool
    depth: float
    """Penetration in metres, positive inside."""
    height: float
    """World height of the contact point, metres."""


@dataclass(frozen=True)
class PlayedPart:
    """What was played of one part of a sequence."""

    __pydantic_config__: ClassVar = STRICT

    kind: Literal["control", "keyframes"]
    chunks: int
    """Half-seconds."""
    what: str = ""
    """The folder of the adapter; the joints of keyframes."""
    values: dict[str, float] = field(default_factory=dict)
    """Of a control, SI."""


class StepRecord(Record):
    """One line of steps.jsonl: a decision and what became of it."""

    step: int
    status: Literal["executed", "stopped", "invalid"]
    """stopped: an active stop, which ends the episode where the body is. invalid: no usable call came. Neither moves
    anything."""
    attempts: tuple[Attempt, ...]
    verdict: Verdict | None = None
    call: Call | None = None
    """The call that was executed, or the stop."""
    proprioception: Proprioception | None = None
    tactile: tuple[Touch, ...] | None = None
    """What the body felt, as far as its sensors were on."""
    target_pixels: dict[int, int] = {}
    """Pixels of each target in the view that this decision was made from."""
    frame_file: Annotated[str, Field(pattern=r"^(frames/[A-Za-z0-9_-][A-Za-z0-9._-]*)?$")] = ""
    motion_frames: int = 0
    """How many frames of motion.npz belong to this step."""
    parts: tuple[PlayedPart, ...] = ()
    """Of a call that plays a sequence, what was played; empty for a call of one part."""
    cancelled: bool = False
    """Whether the call was broken off between two chunks."""
    waypoints: tuple[Vec3, ...] = ()
    """Pelvis after each chunk but the last, metres; empty for a step of one chunk."""
    start: Vec3 = (0.0, 0.0, 0.0)
    """Pelvis before the step, metres."""
    end: Vec3 = (0.0, 0.0, 0.0)
    """Pelvis after it."""
    yaw_start: float = 0.0
    """Heading before the step, radians."""
    yaw_end: float = 0.0
    contacts: tuple[Contact, ...] = ()
    touches: tuple[tuple[int, int, int], ...] = ()
    """(frame of the step, object, object): a movable object touches another."""
    targets: dict[int, tuple[Vec3, Vec3]] = {}
    """Target id to its bounding box when the step ends: what can be pushed is not where it was."""
    target_distance: float | None = None
    """Least distance from any body point to any of these boxes, metres; None without a target."""
    pelvis_contacts: tuple[int, ...] = ()
    """Ids that the pelvis touches in the last physics frame up to the end of the step."""
    geodesic: float | None = None
    """Shortest way from the pelvis after the step to a place beside the nearest target, metres; None if not
    measured."""
    seconds: dict[str, float] = {}
    """Wall time of observe, decide, verify, generate, simulate."""

    @property
    def chunks(self) -> int:
        """Half-seconds of motion."""
        return -(-self.motion_frames // FUTURE)

    @property
    def path(self) -> tuple[Vec3, ...]:
        """Where the pelvis was: before the step and after each of its chunks."""
        return (self.start, *self.waypoints, self.end)

    @property
    def decision(self) -> Decision:
        """The last answer: the one whose call was used, if any was."""
        return self.attempts[-1].decision if self.attempts else Decision()

    @property
    def usage(self) -> Usage:
        """What all answers of the step took, the verifier's included."""
        verified = self.verdict.usage if self.verdict else Usage()
        return sum((attempt.decision.usage for attempt in self.attempts), verified)

    @property
    def feedback(self) -> Feedback:
        """What the agent is told of the step."""
        if self.call is None:
            return Feedback(refusal=self.attempts[-1].error if self.attempts else "")
        if self.verdict is None or self.verdict.accepted or self.verdict.replacement is None:
            return Feedback(
                self.call, proprioception=self.proprioception, tactile=self.tactile, cancelled=self.cancelled
            )
        proposed = self.decision.calls[0]
        told = self.proprioception, self.tactile, self.cancelled
        return Feedback(self.call, proposed, self.verdict.failed, "", *told)


@dataclass(frozen=True)
class SkillInfo:
    """A skill that could be called, as the episode found it."""

    __pydantic_config__: ClassVar = STRICT

    role: str
    """What it is: locomotion, sit, posture, gesture or stop."""
    owner: str = ""
    """The plugin that brought it."""
    version: str = ""
    digest: str = ""
    """SHA-256 of its schema, checks and adapter, and of its Python file if it is a function."""
    origin: str = ""
    """The distribution or the plugin file that it came from."""
    overrides: tuple[str, ...] = ()
    """Plugins whose skills of this name gave way to it."""
    commands: dict[str, str] = field(default_factory=dict)
    """Parameter, as calls name it, to the measure that it commands (humanclaw.measures)."""


class EpisodeRecord(Record):
    """episode.json: what was asked, of whom, with what; and how it ended."""

    format: Literal[2] = FORMAT
    spec: EpisodeSpec
    start: Pose2D
    agent: Name
    verifier: Name = ""
    options: dict[str, Any] = {}
    """As they were given."""
    settings: dict[str, dict[str, Any]] = {}
    """What was in force, defaults filled in, under agent, verifier, body and limits; under privileged whether agent and
    verifier were told scene and true state (records made before that was kept do not say)."""
    versions: dict[str, str] = {}
    weights: dict[str, str] = {}
    """Adapter or base name to digest."""
    scene_digest: str
    licences: tuple[str, ...] = ()
    """'licence: whom to name', of everything in the scene."""
    targets: dict[int, tuple[Vec3, Vec3]] = {}
    """Target id to its bounding box at the start."""
    movable: tuple[int, ...] = ()
    """Ids of the objects that can be moved."""
    ground: tuple[int, ...] = ()
    """Ids of the floors and stairs: what feet are meant to stand on."""
    geodesic: float | None = None
    """Shortest way from the start to a place beside the nearest target, metres; None if not measured."""
    skills: dict[str, SkillInfo] = {}
    created: str = ""
    outcome: Outcome = "running"
    error: str = ""
    """Why it ended as plugin_error, infra_error or limit_reached, or what the user is to mend."""
    limit: str = ""
    """Whose limit was reached: call, episode or run; after a run's no further episode may begin."""
    usage: Usage = Usage()
    """All that the episode's answers took, those included that no step holds because the episode ended first."""
    steps: Annotated[int, Field(ge=0)] = 0
    files: dict[str, str] = {}
    """SHA-256 of every other file of the record, by path in its folder; none as long as it is being written."""
    seal: str = ""
    """SHA-256 of this record without this line."""

    def ended(self, outcome: Outcome, error: str = "", **also: Any) -> EpisodeRecord:
        """Return the same with its end. error: may quote what a model or a plugin wrote, whatever that is."""
        return self.model_copy(update={"outcome": outcome, "error": legible(error)} | also)

    @property
    def sealed(self) -> EpisodeRecord:
        """The same with the seal that belongs to it."""
        return self.model_copy(update={"seal": _seal(self.model_dump_json().encode())})


def _seal(data: bytes) -> str:
    """Return the seal of an episode.json, of what it says and not of how it is laid out.

    Of the file itself and not of the record read from it: a field that a later version knows besides breaks no seal.
    """
    content = {key: value for key, value in json.loads(data).items() if key != "seal"}
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


# -- the folder --------------------------------------------------------------------------------------------------------
class EpisodeWriter:
    """Writes one episode folder; every step is on disk before the next begins."""

    def __init__(self, folder: Path, record: EpisodeRecord, kept: Sequence[StepRecord] = ()) -> None:
        """kept: the steps that the folder begins with, those of an earlier run."""
        self.folder = folder
        lines = "".join(step.model_dump_json() + "\n" for step in kept)
        with writing(folder):
            (folder / "frames").mkdir(parents=True, exist_ok=True)
            write_record(folder, record.model_copy(update={"files": {}}))
            for old in ("motion.npz", *_frames(folder)):
                (folder / old).unlink(missing_ok=True)  # Of an earlier run: what is kept of it is drawn again.
            write_atomically(folder / "steps.jsonl", lines.encode())
            self._steps = (folder / "steps.jsonl").open("ab", buffering=0)

    def frame(self, name: str, data: bytes) -> str:
        """Keep a picture; returns its path relative to the folder."""
        with writing(self.folder):
            write_atomically(self.folder / "frames" / name, data)
        return f"frames/{name}"

    def step(self, step: StepRecord) -> None:
        """Append a line, whole or not at all. Raises RecordError if there is no room for it."""
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
        """Close the record: motion.npz, then the final episode.json. Raises RecordError if there is no room for
        them."""
        self._steps.close()
        motion = io.BytesIO()
        np.savez_compressed(motion, **arrays)  # type: ignore[arg-type]
        with writing(self.folder):
            write_atomically(self.folder / "motion.npz", motion.getvalue())
            close_record(self.folder, record)


@contextmanager
def writing(folder: Path) -> Iterator[None]:
    """Tell of a full disk, a folder that cannot be written to and the like as RecordError, in a sentence."""
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
    """Write the last episode.json, which holds the digest of every other file: from then on damage is found."""
    there = [name for name in ("steps.jsonl", "motion.npz") if (folder / name).exists()]
    digests = {name: hashlib.sha256(_read(folder / name)).hexdigest() for name in (*there, *_frames(folder))}
    write_record(folder, record.model_copy(update={"files": digests}))


def _frames(folder: Path) -> list[str]:
    return sorted(f"frames/{path.name}" for path in (folder / "frames").glob("*.jpg"))


class RecordedEpisode:
    """An episode folder, read back. Raises RecordError, which names the file and the line, if anything in it is
    damaged."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.record = _read_record(folder / "episode.json")
        _verify(folder, self.record)
        self.steps = tuple(_read_steps(folder / "steps.jsonl"))
        if self.record.files and len(self.steps) != self.record.steps:
            raise RecordError(
                f"{folder} holds {counted(len(self.steps), 'step')}; its record says {self.record.steps}.", _AGAIN
            )

    @property
    def has_motion(self) -> bool:
        """Whether there is a motion.npz: an episode that is under way, or was cut short, has none."""
        return (self.folder / "motion.npz").is_file()

    def motion(self, kind: Literal["generated", "simulated"] = "simulated") -> Motion:
        """Return all frames of the episode: the five of standing first, then motion_frames a step. World frame."""
        arrays = self._arrays(f"{kind}_root", f"{kind}_rotations")
        return Motion(*(part.astype(float) for part in arrays.values()))

    def objects(self) -> dict[int, Array]:
        """Movable object id to (T, 7) position and quaternion, a row a frame of motion()."""
        return {int(key[7:]): path.astype(float) for key, path in self._arrays().items() if key.startswith("object_")}

    def _arrays(self, *names: str) -> dict[str, Array]:
        """Return the arrays of motion.npz by name, of these names or all. Raises RecordError if they are damaged.

        What a file says of its size is checked before room is made for it.
        """
        path = self.folder / "motion.npz"
        try:
            with zipfile.ZipFile(path) as archive:
                _check_arrays(archive)
            with np.load(path) as data:
                found = {name: data[name] for name in names or sorted(data.files)}
            if not all(np.isfinite(array).all() for array in found.values()):
                raise ValueError("it holds values that are no finite number")
        except Exception as error:  # What damage makes of them numpy, zipfile and its unpackers tell by a dozen kinds.
            raise RecordError(f"{path} cannot be read: {error}.", _AGAIN) from error
        return found

    def _repr_html_(self) -> str:
        """Return what was asked and done, and a strip of what the eyes saw, for a notebook."""
        spec, count = self.record.spec, len(self.steps)
        kept = [step for step in self.steps if step.frame_file and (self.folder / step.frame_file).is_file()]
        pictures = [(f"step {kept[k].step}", _read(self.folder / kept[k].frame_file)) for k in spread(len(kept))]
        ended = f"{self.record.outcome.replace('_', ' ')} after {counted(count, 'step')}"
        return card(f"Episode {spec.id}", [f"{self.record.agent}: {spec.instruction}", ended], pictures)

    @property
    def digest(self) -> str:
        """SHA-256 over all that happened: record, steps, frames and motion. Two runs that did the same have the same.

        When it was and how long it took is left out, as is what was made of the record later on.
        """
        state = hashlib.sha256(self.record.model_dump_json(exclude={"created", "files", "seal"}).encode())
        for step in self.steps:
            state.update(step.model_dump_json(exclude={"seconds"}).encode())
            if step.frame_file:
                state.update(_read(_within(self.folder, step.frame_file)))
        if (self.folder / "motion.npz").exists():
            for key, array in self._arrays().items():
                state.update(key.encode() + array.tobytes())
        return state.hexdigest()


class RecordedRun(list[RecordedEpisode]):
    """The episodes of a run, a list that shows itself in a notebook."""

    def _repr_html_(self) -> str:
        """Return how many episodes came to which end, and a line for each of the first."""
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
    """In a run every episode lies in the folder of its name; a copy beside it would count twice."""
    for episode in episodes:
        if episode.folder.name != episode.record.spec.id:
            raise RecordError(f"{episode.folder} holds the record of {episode.record.spec.id!r}.", "Remove the copy.")


def _read_record(path: Path) -> EpisodeRecord:
    try:
        data = _read(path)
        record = EpisodeRecord.model_validate_json(data)
    except ValidationError as error:
        raise RecordError(f"{path}{_where(error)} is no record: {_told(error)}.", _AGAIN) from error
    if record.seal and _seal(data) != record.seal:
        raise RecordError(f"{path} has been changed since it was written.", _AGAIN)
    return record


def _verify(folder: Path, record: EpisodeRecord) -> None:
    """Hold every file to the digest that the record has of it."""
    for name, digest in record.files.items():
        if hashlib.sha256(_read(_within(folder, name))).hexdigest() != digest:
            raise RecordError(f"{folder / name} has been changed since it was written.", _AGAIN)


def _within(folder: Path, name: str) -> Path:
    """Return a file of a record; what a record says must not lead out of its folder."""
    try:
        path = within(folder, name)
        inside = path.resolve().is_relative_to(folder.resolve())
    except ValueError:  # Also of what no file can be called.
        inside = False
    if not inside:
        raise RecordError(f"the record in {folder} names {name!r}, which lies elsewhere.", _AGAIN)
    return path


def _check_arrays(archive: zipfile.ZipFile) -> None:
    """Raise ValueError for an array that is none of motion or not as large as its header says, for arrays that are of
    different lengths, and if all are together larger than any episode's."""
    shapes = {member.filename: _shape(archive, member) for member in archive.infolist()}
    for name, shape in shapes.items():
        kind = _ARRAY.fullmatch(name)
        if not kind or shape[1:] != _ROWS[kind[1] or kind[2]]:
            raise ValueError(f"{name} {shape} is no array of motion")
    if len({shape[0] for shape in shapes.values()}) > 1:
        raise ValueError("its arrays are of different lengths")
    if sum(member.file_size for member in archive.infolist()) > _LARGEST:
        raise ValueError(f"its arrays are larger than {_LARGEST >> 20} MiB")


def _shape(archive: zipfile.ZipFile, member: zipfile.ZipInfo) -> tuple[int, ...]:
    """Return the shape in an array's header. Raises ValueError if the array has another size, or holds no numbers."""
    with archive.open(member) as stream:
        version = np.lib.format.read_magic(stream)
        read = {1: np.lib.format.read_array_header_1_0, 2: np.lib.format.read_array_header_2_0}[version[0]]
        shape, _, kind = read(stream)
        size = math.prod(shape) * kind.itemsize
        if stream.tell() + size != member.file_size or kind.kind != "f":
            raise ValueError(f"{member.filename} is not {size} bytes of numbers long")
    return shape


def _read_steps(path: Path) -> Iterator[StepRecord]:
    """Complete lines only: a line cut off by a crash is not a step."""
    if not path.exists():
        return
    # Only this byte ends a line: str.splitlines would also break at what a model may write, such as U+2028.
    for number, line in enumerate(_read(path).split(b"\n")[:-1], 1):
        step = _parse(line, f"{path}:{number}")
        if step.step != number - 1:
            raise RecordError(f"{path}:{number} holds step {step.step}: lines are missing or in another order.", _AGAIN)
        yield step


def _parse(line: bytes, where: str) -> StepRecord:
    if b"NaN" in line or b"Infinity" in line:
        _refuse_infinite(line, where)
    try:
        return StepRecord.model_validate_json(line)
    except ValidationError as error:
        raise RecordError(f"{where} holds a line that is not a step: {_told(error)}.", _AGAIN) from error


def _refuse_infinite(line: bytes, where: str) -> None:
    """Refuse a value that no episode writes; words may be what they like."""

    def refuse(value: str) -> None:
        raise RecordError(f"{where} holds {value}, which is no finite number.", _AGAIN)

    with suppress(ValueError):
        json.loads(line, parse_constant=refuse)


def _told(error: ValidationError) -> str:
    first = error.errors(include_url=False)[0]
    where = ".".join(map(str, first["loc"]))
    return f"{where}: {first['msg']}" if where else first["msg"]


def _where(error: ValidationError) -> str:
    """':line' where the text stops being JSON."""
    found = re.search(r"at line (\d+)", error.errors()[0]["msg"])
    return f":{found[1]}" if found else ""


def _read(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise RecordError(f"cannot read {path}: {error.strerror}.", _AGAIN) from error
