"""The seams of the system, as protocols, and the values that cross them. An implementation is registered by a plugin hook."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from humanclaw.body import EYE, JOINT_INDEX, BodyGroup
from humanclaw.contract import Skill
from humanclaw.episode import EpisodeSpec
from humanclaw.pose import Array, Motion, forward_kinematics, yaw_matrix
from humanclaw.scene import Placement, Scene

if TYPE_CHECKING:
    from humanclaw.limits import Meter
    from humanclaw.plugins import Plugins
    from humanclaw.records import RecordedEpisode

BODY_ID: Final = -1
"""The value of the body's own pixels in an id image; 0 is where nothing was drawn."""


# -- the world ---------------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class WorldState:
    """A moment of the world: the body's pose (one frame, world frame) and where the movable objects are."""

    body: Motion
    objects: Mapping[int, Array]
    """Object id to (7,): position, then quaternion x, y, z, w. Movable objects only; the rest is where the scene says."""


@dataclass(frozen=True)
class Contact:
    """A link of the body touches an object in one frame of a chunk."""

    frame: int
    """0..14 within the chunk."""
    joint: str
    group: BodyGroup
    object_id: int
    movable: bool
    depth: float
    """Penetration in metres, positive inside."""
    height: float
    """World height of the contact point, metres."""


@dataclass(frozen=True)
class Execution:
    """What became of 15 commanded frames."""

    realised: Motion
    """15 frames in the world frame, as physics left them."""
    contacts: tuple[Contact, ...]
    touches: tuple[tuple[int, int, int], ...]
    """(frame, object id, object id): a movable object touches another object that is not the building."""
    objects: Mapping[int, Array]
    """Id of each movable object that moved in this chunk to its (15, 7) path."""


class Simulator(Protocol):
    """Half-physics (paper, section 3.4): the body follows commanded poses as contact and gravity allow."""

    def reset(self, scene: Scene, start: Placement) -> WorldState:
        """Load a scene and stand the body on its start. Raises SceneError if the body does not fit there."""

    def execute(self, motion: Motion) -> Execution:
        """Drive the body through consecutive frames given in the world frame; the vertical root motion is not commanded."""

    def state(self) -> WorldState: ...

    def close(self) -> None: ...


@dataclass(frozen=True)
class Camera:
    """A pinhole camera. position, forward, up: (3,) world frame. fov: vertical, degrees."""

    position: Array
    forward: Array
    up: Array
    fov: float = 90.0
    width: int = 512
    height: int = 512


@dataclass(frozen=True)
class View:
    """A picture. rgb: (H, W, 3) uint8. depth: (H, W) float32, metres along the optical axis. ids: (H, W) int32."""

    rgb: NDArray[np.uint8]
    depth: NDArray[np.float32]
    ids: NDArray[np.int32]


class Renderer(Protocol):
    """Draws moments of a world. It needs no simulator, so that records can be looked at later."""

    def load(self, scene: Scene) -> None: ...

    def render(self, state: WorldState, camera: Camera) -> View: ...

    def close(self) -> None: ...


GAZE_PITCH: Final = np.radians(-20.0)
"""The eyes are held level and 20 degrees below the horizon, as the vestibulo-ocular reflex would, so steps do not shake them."""


def ego_camera(body: Motion, size: int = 512) -> Camera:
    """The camera at the eyes of the last frame of a motion; it turns with the head and keeps the horizon level."""
    positions, orientations = forward_kinematics(body.root[-1], body.rotations[-1])
    head = orientations[JOINT_INDEX["head"]]
    eye = positions[JOINT_INDEX["head"]] + head @ np.array(EYE)
    facing = float(np.arctan2(head[0, 2], head[2, 2]))
    turn = yaw_matrix(facing)
    forward = turn @ np.array([0.0, np.sin(GAZE_PITCH), np.cos(GAZE_PITCH)])
    up = turn @ np.array([0.0, np.cos(GAZE_PITCH), -np.sin(GAZE_PITCH)])
    return Camera(eye, forward, up, 90.0, size, size)


class Reporter(Protocol):
    """Makes something to look at of a recorded episode."""

    def write(self, run: Path, episode: RecordedEpisode, plugins: Plugins) -> Mapping[str, Path]:
        """Write into the folder of a run or of the episode; returns each file by what a person calls it."""


# -- motion ------------------------------------------------------------------------------------------------------------
class MotionGenerator(Protocol):
    """A motion prior with skill adapters (paper, section 3.3)."""

    def start(self) -> Motion:
        """The five frames of standing that every episode begins from, at the origin facing +Z."""

    def generate(self, history: Motion, adapter: Path, values: Mapping[str, float], key: Sequence[int]) -> Motion:
        """15 frames that continue 5, in the frame of the history. The same key gives the same motion, bit for bit.

        values: each parameter that the adapter's header names, in SI; their order says nothing.
        """

    @property
    def digest(self) -> str:
        """Names the weights of the prior."""


# -- deciding ----------------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Call:
    """A skill and its parameters, as a model wrote them or after they were checked."""

    skill: str
    params: Mapping[str, Any] = field(default_factory=dict)

    def __str__(self) -> str:
        return f"{self.skill}({', '.join(f'{key}={value}' for key, value in self.params.items())})"


@dataclass(frozen=True)
class Usage:
    """What one answer cost. Tokens are the provider's own count unless estimated is true; cost is in US dollars."""

    tokens_in: int = 0
    tokens_out: int = 0
    cost: float = 0.0
    estimated: bool = False
    cost_estimated: bool = False
    """The cost is tokens times a listed price, or unknown and 0: the provider told none."""

    def __add__(self, other: Usage) -> Usage:
        return Usage(
            self.tokens_in + other.tokens_in,
            self.tokens_out + other.tokens_out,
            self.cost + other.cost,
            self.estimated or other.estimated,
            self.cost_estimated or other.cost_estimated,
        )


@dataclass(frozen=True)
class Observation:
    """What the decision maker may know: the ego view, the instruction and what became of the last step."""

    step: int
    instruction: str
    rgb: NDArray[np.uint8]
    feedback: str = ""
    """Result of the last step in words, or why the last answer could not be used."""


@dataclass(frozen=True)
class Decision:
    """One answer: perception, high-, mid- and low-level reasoning, and the calls (paper, section 3.2). One call is legal."""

    calls: tuple[Call, ...]
    visible_state: str = ""
    progress: str = ""
    mid_level_goal: str = ""
    mid_level_change: str = ""
    """'keep' or 'revise'."""
    reasoning: str = ""
    raw: str = ""
    prompt_digest: str = ""
    usage: Usage = field(default_factory=Usage)


@dataclass(frozen=True)
class Past:
    """One step as the text history tells it (paper: 'previous visual states, reasoning traces, selected actions')."""

    step: int
    decision: Decision
    executed: Call | None
    """None if nothing was executed."""
    feedback: str
    rgb: NDArray[np.uint8]


@dataclass(frozen=True)
class EpisodeContext:
    """What a decision maker is told before the first step."""

    spec: EpisodeSpec
    skills: Mapping[str, Skill]
    seed: int
    scene: Scene | None = None
    state: Callable[[], WorldState] | None = None
    """scene and state are given to privileged decision makers only: oracles, never models."""
    meter: Meter | None = None
    """What may still be used; whoever waits for a model should wait no longer than meter.seconds_left()."""


@runtime_checkable
class DecisionMaker(Protocol):
    """Anything that can call a tool: a model, a person, a script.

    If it has an attribute `settings`, a mapping that JSON can hold, the episode's record keeps it: what was in force, with the
    defaults filled in.
    """

    name: str
    privileged: bool

    def begin(self, context: EpisodeContext) -> None: ...

    def decide(self, observation: Observation, history: Sequence[Past]) -> Decision:
        """Raises ProviderError when no answer can be had; that is never turned into a decision.

        Raises LimitError when the meter of the episode leaves no time to wait for one.
        """


@dataclass(frozen=True)
class Answer:
    """A verifier's answer to one check."""

    check: str
    passed: bool
    note: str = ""


@dataclass(frozen=True)
class Verdict:
    """Accept the proposed call, or put another one from the same pool in its place."""

    accepted: bool
    replacement: Call | None = None
    answers: tuple[Answer, ...] = ()
    failed_open: str = ""
    """Why the call was let through unverified, if it was."""
    usage: Usage = field(default_factory=Usage)


class Verifier(Protocol):
    """The skill-specific spatial response verifier (paper, section 3.2 and appendix A): sees the current view alone.

    An attribute `settings` is recorded, as a decision maker's is. One with a true attribute `privileged` is told scene and state.
    """

    name: str

    def begin(self, context: EpisodeContext) -> None: ...

    def verify(self, observation: Observation, call: Call, skill: Skill, goal: str) -> Verdict: ...
