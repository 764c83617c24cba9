"""What is kept of an episode (folder: episode.json, steps.jsonl, motion.npz, frames/): enough to score it without a simulator."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from humanclaw.episode import EpisodeSpec, StartPose
from humanclaw.errors import RecordError
from humanclaw.files import write_atomically
from humanclaw.pose import Array, Motion

FORMAT: Literal[1] = 1
Outcome = Literal["running", "stopped", "out_of_steps", "infra_error", "limit_reached", "interrupted"]
Vec3 = tuple[float, float, float]


class Record(BaseModel):
    """Base of all records: frozen, and strict about unknown fields, so that an old reader never misreads a new record."""

    model_config = ConfigDict(frozen=True, extra="forbid")


class CallRecord(Record):
    """A call as it was made or executed."""

    skill: str
    params: dict[str, Any] = {}


class UsageRecord(Record):
    """Tokens and US dollars of one or more provider requests; estimated where the provider did not say."""

    tokens_in: int = 0
    tokens_out: int = 0
    cost: float = 0.0
    estimated: bool = False
    cost_estimated: bool = False


class AttemptRecord(Record):
    """One answer of the decision maker, usable or not."""

    calls: tuple[CallRecord, ...] = ()
    visible_state: str = ""
    progress: str = ""
    mid_level_goal: str = ""
    mid_level_change: str = ""
    reasoning: str = ""
    raw: str = ""
    prompt_digest: str = ""
    error: str = ""
    """Why the answer was handed back; empty if its call was used."""
    usage: UsageRecord = UsageRecord()


class AnswerRecord(Record):
    check: str
    passed: bool
    note: str = ""


class VerdictRecord(Record):
    """What the verifier said of the proposed call."""

    verifier: str
    accepted: bool
    replacement: CallRecord | None = None
    answers: tuple[AnswerRecord, ...] = ()
    failed_open: str = ""
    usage: UsageRecord = UsageRecord()


class ContactRecord(Record):
    """A body link against an object during a step: the frames of it, the deepest and the highest point."""

    joint: str
    group: str
    object_id: int
    movable: bool
    frames: tuple[int, ...]
    depth: float
    height: float


class StepRecord(Record):
    """One line of steps.jsonl: a decision and what became of it."""

    step: int
    status: Literal["executed", "stopped", "invalid"]
    """stopped: the body executed an active stop. invalid: no usable call came; nothing was executed."""
    attempts: tuple[AttemptRecord, ...]
    verdict: VerdictRecord | None = None
    call: CallRecord | None = None
    """The call that was executed."""
    feedback: str = ""
    target_pixels: dict[int, int] = {}
    """Pixels of each target in the view that this decision was made from."""
    frame_file: str = ""
    motion_frames: int = 0
    """How many frames of motion.npz belong to this step."""
    start: Vec3 = (0.0, 0.0, 0.0)
    """Pelvis before the step, metres."""
    end: Vec3 = (0.0, 0.0, 0.0)
    """Pelvis after it."""
    yaw_start: float = 0.0
    """Heading before the step, radians."""
    yaw_end: float = 0.0
    contacts: tuple[ContactRecord, ...] = ()
    touches: tuple[tuple[int, int, int], ...] = ()
    """(frame of the step, object, object): a movable object touches another."""
    target_distance: float | None = None
    """Least distance from any body point to the bounding box of a target in the step's last frame, metres."""
    pelvis_contacts: tuple[int, ...] = ()
    """Ids that the pelvis touches in the step's last frame."""
    geodesic: float | None = None
    """Shortest way from the pelvis after the step to a place beside the nearest target, metres; None if not measured."""
    seconds: dict[str, float] = {}
    """Wall time of observe, decide, verify, generate, simulate."""


class SkillInfo(Record):
    """A skill that could be called, as the episode found it."""

    role: str
    """What it is: locomotion, sit, posture, gesture or stop."""
    owner: str = ""
    """The plugin that brought it."""
    version: str = ""
    commands: dict[str, str] = {}
    """Parameter, as calls name it, to the measure that it commands (humanclaw.measures)."""


class EpisodeRecord(Record):
    """episode.json: what was asked, of whom, with what; and how it ended."""

    format: Literal[1] = FORMAT
    spec: EpisodeSpec
    start: StartPose
    agent: str
    verifier: str = ""
    options: dict[str, Any] = {}
    """As they were given."""
    settings: dict[str, dict[str, Any]] = {}
    """What was in force, defaults filled in, under decision_maker, verifier and limits."""
    versions: dict[str, str] = {}
    weights: dict[str, str] = {}
    """Adapter or base name to digest."""
    scene_digest: str
    licences: tuple[str, ...] = ()
    """'licence: whom to name', of everything in the scene."""
    targets: dict[int, tuple[Vec3, Vec3]] = {}
    """Target id to its bounding box."""
    movable: tuple[int, ...] = ()
    ground: tuple[int, ...] = ()
    """Ids of the floors and stairs: what feet are meant to stand on."""
    """Ids of the objects that can be moved."""
    geodesic: float | None = None
    """Shortest way from the start to a place beside the nearest target, metres; None if not measured."""
    skills: dict[str, SkillInfo] = {}
    """Every skill that could be called, by name."""
    created: str = ""
    outcome: Outcome = "running"
    error: str = ""
    """Why it ended as infra_error or limit_reached, or what the user is to mend."""
    limit: str = ""
    """Whose limit was reached: call, episode or run; after a run's no further episode may begin."""
    usage: UsageRecord = UsageRecord()
    """All that the episode's answers took, those included that no step holds because the episode ended first."""
    steps: Annotated[int, Field(ge=0)] = 0


class EpisodeWriter:
    """Writes one episode folder; every step is on disk before the next begins."""

    def __init__(self, folder: Path, record: EpisodeRecord, kept: Sequence[StepRecord] = ()) -> None:
        """kept: the steps that the folder begins with, those of an earlier run."""
        self.folder = folder
        lines = "".join(step.model_dump_json() + "\n" for step in kept)
        try:
            (folder / "frames").mkdir(parents=True, exist_ok=True)
            write_atomically(folder / "episode.json", record.model_dump_json(indent=1).encode())
            write_atomically(folder / "steps.jsonl", lines.encode())
            self._steps = (folder / "steps.jsonl").open("a", encoding="utf-8")
        except OSError as error:
            reason = f"cannot write the record to {folder}: {error.strerror}."
            raise RecordError(reason, "Name another folder with --out.") from error

    def frame(self, name: str, data: bytes) -> str:
        """Keep a picture; returns its path relative to the folder."""
        write_atomically(self.folder / "frames" / name, data)
        return f"frames/{name}"

    def step(self, step: StepRecord) -> None:
        self._steps.write(step.model_dump_json() + "\n")
        self._steps.flush()
        os.fsync(self._steps.fileno())

    def end(self, record: EpisodeRecord, arrays: Mapping[str, Array]) -> None:
        """Close the record: motion.npz, then the final episode.json."""
        self._steps.close()
        partial = self.folder / "motion.partial.npz"
        np.savez_compressed(partial, **arrays)  # type: ignore[arg-type]
        partial.replace(self.folder / "motion.npz")
        write_atomically(self.folder / "episode.json", record.model_dump_json(indent=1).encode())


class RecordedEpisode:
    """An episode folder, read back."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.record = EpisodeRecord.model_validate_json(_read(folder / "episode.json"))
        self.steps = tuple(_read_steps(folder / "steps.jsonl"))

    def motion(self, kind: Literal["generated", "realised"] = "realised") -> Motion:
        """All frames of the episode: the five of standing first, then motion_frames a step. World frame."""
        with np.load(self.folder / "motion.npz") as data:
            return Motion(data[f"{kind}_root"].astype(float), data[f"{kind}_rotations"].astype(float))

    def objects(self) -> dict[int, Array]:
        """Movable object id to (T, 7) position and quaternion, a row a frame of motion()."""
        with np.load(self.folder / "motion.npz") as data:
            return {int(key[7:]): data[key].astype(float) for key in data.files if key.startswith("object_")}

    @property
    def digest(self) -> str:
        """SHA-256 over all that happened: record, steps, frames and motion. Two runs that did the same have the same.

        When it was and how long it took is left out, as is what was made of the record later on.
        """
        state = hashlib.sha256(self.record.model_dump_json(exclude={"created"}).encode())
        for step in self.steps:
            state.update(step.model_dump_json(exclude={"seconds"}).encode())
            if step.frame_file:
                state.update((self.folder / step.frame_file).read_bytes())
        if (self.folder / "motion.npz").exists():
            with np.load(self.folder / "motion.npz") as data:
                for key in sorted(data.files):
                    state.update(key.encode() + data[key].tobytes())
        return state.hexdigest()


def load_run(folder: Path) -> list[RecordedEpisode]:
    """All episodes under a folder, by name. Raises RecordError if there are none."""
    found = sorted(path.parent for path in folder.rglob("episode.json"))
    if not found:
        raise RecordError(
            f"there is no episode record in {folder}.",
            "Name a folder that `humanclaw run` or `humanclaw bench run` wrote.",
        )
    return [RecordedEpisode(path) for path in found]


def _read_steps(path: Path) -> Iterator[StepRecord]:
    """Complete lines only: a line cut off by a crash is not a step."""
    if not path.exists():
        return
    for line in _read(path).splitlines(keepends=True):
        if line.endswith("\n"):
            yield _parse(line, path)


def _parse(line: str, path: Path) -> StepRecord:
    try:
        return StepRecord.model_validate_json(line)
    except ValidationError as error:
        raise RecordError(f"{path} holds a line that is not a step: {error.errors()[0]['msg']}.") from error


def _read(path: Path) -> str:
    try:
        return path.read_text("utf-8")
    except OSError as error:
        raise RecordError(f"cannot read {path}: {error.strerror}.") from error
