"""What came of it: the record of a step and of an episode."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass, field
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field

from humanclaw.body.pose import FUTURE, Pose2D
from humanclaw.records.decisions import Attempt, Decision, Usage, Verdict
from humanclaw.records.feedback import Feedback, Proprioception, Touch
from humanclaw.records.specification import EpisodeSpec, Name, Record
from humanclaw.skills.call import Call
from humanclaw.text.json import STRICT
from humanclaw.text.words import legible
from humanclaw.world.scene import Vec3
from humanclaw.world.simulator import Contact

FORMAT: Literal[2] = 2
Outcome = Literal["running", "stopped", "out_of_steps", "plugin_error", "infra_error", "limit_reached", "interrupted"]


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
        return self.model_copy(update={"seal": seal_of(self.model_dump_json().encode())})


def seal_of(data: bytes) -> str:
    """Return the seal of an episode.json, of what it says and not of how it is laid out.

    Of the file itself and not of the record read from it: a field that a later version knows besides breaks no seal.
    """
    content = {key: value for key, value in json.loads(data).items() if key != "seal"}
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()
