"""The records of a step and of an episode."""

from __future__ import annotations

import hashlib
import json
import operator
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Annotated, Any, ClassVar, Final, Literal

from pydantic import AfterValidator, Field

from humanclaw.body.pose import FUTURE, Pose2D
from humanclaw.body.skeleton import JOINT_INDEX
from humanclaw.records.decisions import Attempt, Decision, Usage, Verdict
from humanclaw.records.feedback import Feedback, Felt, HandAim
from humanclaw.records.specification import EpisodeSpec, Name, Record
from humanclaw.skills.call import Call
from humanclaw.skills.gaze_grip_speech import Side
from humanclaw.skills.plan_motion import PartKind
from humanclaw.text.json import STRICT
from humanclaw.text.words import legible
from humanclaw.world.scene import Vec3
from humanclaw.world.simulator import Contact
from humanclaw.world.view import CameraMount, gaze_of

FORMAT: Literal[5] = 5
Outcome = Literal["running", "stopped", "out_of_steps", "plugin_error", "infra_error", "limit_reached", "interrupted"]


MOST_FRAMES: Final = 100_000
"""An hour in one step. No call lasts longer than seconds, but a step may hold a sequence of them."""


def _of_the_body(contacts: tuple[Contact, ...]) -> tuple[Contact, ...]:
    """Raise ValueError for a contact of a joint that no body has."""
    for contact in contacts:
        if contact.joint not in JOINT_INDEX:
            raise ValueError(f"expected a joint of the body; got {contact.joint!r:.50}")
    return contacts


_Meeting = tuple[int, int, int]


@lru_cache(maxsize=1 << 16)
def _same(meeting: _Meeting) -> _Meeting:
    """Return one tuple for all that are equal: they were half the memory of a step, and most come again and again."""
    return meeting


def _shared(meetings: tuple[_Meeting, ...]) -> tuple[_Meeting, ...]:
    return tuple(map(_same, meetings))


@dataclass(frozen=True)
class PlayedPart:
    """One played part of a sequence."""

    __pydantic_config__: ClassVar = STRICT

    kind: PartKind
    chunks: int
    """Number of half seconds."""
    what: str = ""
    """The adapter's folder, the joints of keyframes, or the hand that reaches or closes."""
    values: dict[str, float] = field(default_factory=dict)
    """Values of a control, SI."""


class StepRecord(Record, Felt):  # type: ignore[misc]  # Frozen by its configuration, which mypy does not read.
    """One line of steps.jsonl: a decision and its outcome."""

    step: int
    status: Literal["executed", "stopped", "invalid"]
    """stopped: an active stop, which ends the episode. invalid: no usable call. In both nothing moves."""
    attempts: tuple[Attempt, ...]
    verdict: Verdict | None = None
    call: Call | None = None
    """The executed call, or the stop."""
    target_pixels: dict[int, int] = {}
    """Pixels of each target in the view before the decision."""
    frame_file: Annotated[str, Field(pattern=r"^(frames/[A-Za-z0-9_-][A-Za-z0-9._-]*)?$")] = ""
    motion_frames: Annotated[int, Field(ge=0, le=MOST_FRAMES)] = 0
    """Number of frames in motion.npz that belong to this step."""
    rise_frames: Annotated[int, Field(ge=0, le=MOST_FRAMES)] = 0
    """Those of them in which the body first rose from a low pose, before it could step."""
    parts: tuple[PlayedPart, ...] = ()
    """The played parts of a sequence; empty for a call of one part."""
    held: dict[Side, int] = {}
    """Id of the object in each hand that holds one, after the step."""
    aims: tuple[HandAim, ...] = ()
    """Where hands were to go, in order, and how far they ended from there."""
    joints: dict[int, float] = {}
    """State of each object on a joint that moved in the step, at its end: radians of a hinge, metres of a slide."""
    waypoints: tuple[Vec3, ...] = ()
    """Pelvis after each chunk but the last, metres."""
    start: Vec3 = (0.0, 0.0, 0.0)
    """Pelvis before the step, metres."""
    end: Vec3 = (0.0, 0.0, 0.0)
    """Pelvis after the step, metres."""
    yaw_start: float = 0.0
    """Heading before the step, radians."""
    yaw_end: float = 0.0
    contacts: Annotated[tuple[Contact, ...], AfterValidator(_of_the_body)] = ()
    touches: Annotated[tuple[_Meeting, ...], AfterValidator(_shared)] = ()
    """(frame of the step, object id, object id): a movable object touches another object."""
    targets: dict[int, tuple[Vec3, Vec3]] = {}
    """Bounding box of each target at the end of the step: movable targets change theirs."""
    target_distance: float | None = None
    """Smallest distance from any body point to any of these boxes, metres; None without a target."""
    pelvis_contacts: tuple[int, ...] = ()
    """Ids of the objects that the pelvis touched in the last physics frame."""
    geodesic: float | None = None
    """Shortest way from the pelvis to a place beside the nearest target, after the step, metres; None if not
    measured."""
    seconds: dict[str, float] = {}
    """Wall time of observe, decide, verify, generate, simulate."""

    @property
    def chunks(self) -> int:
        """Number of half seconds of motion."""
        return -(-self.motion_frames // FUTURE)

    @property
    def path(self) -> tuple[Vec3, ...]:
        """The pelvis before the step and after each of its chunks, metres."""
        return (self.start, *self.waypoints, self.end)

    @property
    def decision(self) -> Decision:
        """The last answer: the one whose call was used, if any."""
        return self.attempts[-1].decision if self.attempts else Decision()

    @property
    def usage(self) -> Usage:
        """Usage of all answers of the step, the verifier's included."""
        verified = self.verdict.usage if self.verdict else Usage()
        return sum((attempt.decision.usage for attempt in self.attempts), verified)

    @property
    def feedback(self) -> Feedback:
        """The feedback that the agent gets."""
        if self.call is None:
            return Feedback(refusal=self.attempts[-1].error if self.attempts else "")
        replaced = self.verdict is not None and not self.verdict.accepted and self.verdict.replacement is not None
        return Feedback(
            self.call,
            self.decision.calls[0] if replaced else None,
            self.verdict.failed if self.verdict and replaced else (),
            **self.felt,
        )


def spent(steps: Iterable[StepRecord]) -> int:
    """Return how many of its steps an episode has used up, those that passed in thought too."""
    return sum(1 + step.waited for step in steps)


@dataclass(frozen=True)
class SkillInfo:
    """A callable skill, as installed when the episode began."""

    __pydantic_config__: ClassVar = STRICT

    role: str
    """One of humanclaw.skills.ROLES."""
    owner: str = ""
    """The plugin that brought it."""
    version: str = ""
    digest: str = ""
    """SHA-256 of its schema, checks and adapter, and of its Python file if it is a function."""
    origin: str = ""
    """The distribution or the plugin file of the owner."""
    overrides: tuple[str, ...] = ()
    """Other plugins that have a skill of this name."""
    commands: dict[str, str] = field(default_factory=dict)
    """The measure that each parameter commands (humanclaw.skills.MEASURES)."""


class EpisodeRecord(Record):
    """episode.json: the task, the agent, the versions and weights in use, and the end."""

    format: Literal[5] = FORMAT
    spec: EpisodeSpec
    start: Pose2D
    agent: Name
    verifier: Name = ""
    options: dict[str, Any] = {}
    """Options of the run, as given."""
    settings: dict[str, dict[str, Any]] = {}
    """Effective settings, defaults included, under agent, verifier, body and limits. Under privileged: whether agent
    and verifier were given scene and true state."""
    versions: dict[str, str] = {}
    weights: dict[str, str] = {}
    """Digests by name of base or adapter."""
    scene_digest: str
    licences: tuple[str, ...] = ()
    """'licence: attribution' for everything in the scene."""
    targets: dict[int, tuple[Vec3, Vec3]] = {}
    """Bounding box of each target at the start."""
    movable: tuple[int, ...] = ()
    """Ids of the movable objects."""
    ground: tuple[int, ...] = ()
    """Ids of floors and stairs."""
    geodesic: float | None = None
    """Shortest way from the start to a place beside the nearest target, metres; None if not measured."""
    skills: dict[str, SkillInfo] = {}
    company: Annotated[tuple[Name, ...], Field(exclude_if=operator.not_)] = ()
    """Of several bodies in one scene the ids of all their episodes, in order, this one's too: their folders lie beside
    this one."""
    created: str = ""
    outcome: Outcome = "running"
    error: str = ""
    """Reason of plugin_error, infra_error or limit_reached, or an error for the user."""
    limit: str = ""
    """Scope of the limit that was reached: call, episode or run. After a run's limit no further episode may begin."""
    usage: Usage = Usage()
    """Usage of all answers, including those that belong to no step because the episode ended first."""
    steps: Annotated[int, Field(ge=0)] = 0
    files: dict[str, str] = {}
    """SHA-256 of every other file, by path in the folder; empty while the episode runs."""
    seal: str = ""
    """SHA-256 of this record without this field."""

    def ended(self, outcome: Outcome, error: str = "", **also: Any) -> EpisodeRecord:
        """Return the record with its end. error: may quote text of a model or a plugin; it is made safe to print."""
        return self.model_copy(update={"outcome": outcome, "error": legible(error)} | also)

    @property
    def gaze(self) -> CameraMount:
        """Where the eyes looked. Records that do not say are of `far`."""
        return gaze_of(self.settings.get("body", {}).get("gaze", "far"))

    @property
    def sealed(self) -> EpisodeRecord:
        """The record with its seal."""
        return self.model_copy(update={"seal": seal_of(self.model_dump_json().encode())})


def seal_of(data: bytes) -> str:
    """Return the seal of an episode.json: a digest of its content, whatever the layout.

    It covers the file, not the parsed record, so that fields of a later version do not break it.
    """
    content = {key: value for key, value in json.loads(data).items() if key != "seal"}
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()
