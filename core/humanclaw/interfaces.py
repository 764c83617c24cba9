"""The seams of the system, as protocols, and the values that cross them. An implementation is registered by a plugin
hook."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Final, Protocol, TypeAlias, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from humanclaw._feedback import Feedback
from humanclaw.body import EYE, JOINT_INDEX
from humanclaw.contract import Skill
from humanclaw.pose import Array, Motion, Pose2D, forward_kinematics, re_rooted, yaw_matrix
from humanclaw.records import Call, Contact, Decision, EpisodeSpec, Verdict
from humanclaw.scene import Scene

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
    """Object id to (7,): position, then quaternion x, y, z, w. Movable objects only; the rest is where the scene
    says."""


@dataclass(frozen=True)
class Execution:
    """What became of 15 commanded frames."""

    simulated: Motion
    """15 frames in the world frame, as physics left them."""
    contacts: tuple[Contact, ...]
    touches: tuple[tuple[int, int, int], ...]
    """(frame, object id, object id): a movable object touches another object that is not the building."""
    objects: Mapping[int, Array]
    """Id of each movable object that moved in this chunk to its (15, 7) path."""


class Simulator(Protocol):
    """Half-physics (paper, section 3.4): the body follows commanded poses as contact and gravity allow."""

    def reset(self, scene: Scene, start: Pose2D) -> WorldState:
        """Load a scene and stand the body on its start, in any pose: the first frames that it is then driven through,
        five of them, are the stance in which the motion model begins. Raises SceneError if the body does not fit there.
        """

    def execute(self, motion: Motion) -> Execution:
        """Drive the body through consecutive frames given in the world frame; the vertical root motion is not
        commanded."""

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
"""The eyes are held level and 20 degrees below the horizon, as the vestibulo-ocular reflex would, so steps do not shake
them."""


def ego_camera(body: Motion, size: int = 512) -> Camera:
    """Return the camera at the eyes of the last frame of a motion.

    It turns with the head and keeps the horizon level.
    """
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


DistanceFn: TypeAlias = Callable[[Array], float]
"""From a pelvis (3,) to the length of the shortest way to a target, metres; infinite if there is none."""
DistanceFactory: TypeAlias = Callable[[Scene, Sequence[int], float], DistanceFn]
"""Makes a DistanceFn for a scene, the ids of its targets and the height of the floor at the start."""


# -- motion ------------------------------------------------------------------------------------------------------------
class MotionGenerator(Protocol):
    """A motion prior with skill adapters (paper, section 3.3)."""

    def start(self) -> Motion:
        """Return the five frames of standing that every episode begins from, at the origin facing +Z."""

    def generate(self, history: Motion, adapter: Path, values: Mapping[str, float], key: Sequence[int]) -> Motion:
        """15 frames that continue 5, in the frame of the history. The same key gives the same motion, bit for bit.

        values: each parameter that the adapter's header names, in SI; their order says nothing.
        """

    @property
    def digest(self) -> str:
        """Names the weights of the prior."""


def stand(simulator: Simulator, generator: MotionGenerator, scene: Scene, start: Pose2D) -> Motion:
    """Put a body into a scene, in the stance that motion goes on from: a simulator stands it there in a pose of its
    own. Returns the five frames of it, the history of the first motion, world frame."""
    stance = re_rooted(generator.start(), simulator.reset(scene, start).body)
    return re_rooted(stance, simulator.execute(stance).simulated)


# -- deciding ----------------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Observation:
    """What an agent may know: the ego view, the instruction and what became of the last step."""

    step: int
    instruction: str
    rgb: NDArray[np.uint8]
    """(512, 512, 3), read-only: the verifier sees the same."""
    feedback: Feedback = field(default_factory=Feedback)
    """Of the last step, or why the last answer could not be used; str() says it in words."""


@dataclass(frozen=True)
class HistoryEntry:
    """One step as an agent remembers it (paper: 'previous visual states, reasoning traces, selected actions')."""

    step: int
    decision: Decision
    feedback: Feedback
    rgb: NDArray[np.uint8]
    """What it was decided from."""

    @property
    def executed(self) -> Call | None:
        """The call that was carried out; None if none was."""
        return self.feedback.executed


@dataclass(frozen=True)
class EpisodeContext:
    """What an agent or a verifier is told before the first step."""

    spec: EpisodeSpec
    skills: Mapping[str, Skill]
    seed: int
    scene: Scene | None = None
    state: Callable[[], WorldState] | None = None
    """scene and state are given to privileged agents only: oracles, never models."""
    view: Callable[[], View] | None = None
    """Likewise: the view of the step under way with its depth and ids, for those who see perfectly and know no more."""
    meter: Meter | None = None
    """What may still be used; whoever waits for a model should wait no longer than meter.seconds_left()."""


@runtime_checkable
class Agent(Protocol):
    """Anything that can call a tool: a model, a person, a script.

    If it has an attribute `settings`, a mapping that JSON can hold, the episode's record keeps it: what was in force,
    with the defaults filled in; an option that is not among them is then refused. With a true attribute `at_terminal`
    it decides at the terminal, where nothing is then told that only the scene knows.
    """

    name: str
    privileged: bool

    def begin(self, context: EpisodeContext) -> None: ...

    def decide(self, observation: Observation, history: Sequence[HistoryEntry]) -> Decision:
        """Decide on the next call. Raises ProviderError when no answer can be had; that is never turned into a
        decision.

        Nobody can end it from outside: whoever waits asks the context's meter for seconds_left(), and a limit on time
        ends one that does not ask only when it returns.

        Raises LimitError when the meter of the episode leaves no time to wait for one, and PluginError, here or in
        begin(), for what stands in the way of every episode, such as a key that is refused: it ends the run, and after
        the first step the episode has failed. Whatever else it raises, a ReplayError or a worker's KeyboardInterrupt
        included, is its own error, and so is a decision whose fields are not of their types: the episode has failed.
        """


class Verifier(Protocol):
    """The skill-specific spatial response verifier (paper, section 3.2 and appendix A): sees the current view alone.

    An attribute `settings` is recorded, as an agent's is. One with a true attribute `privileged` is told scene and
    state.
    """

    name: str

    def begin(self, context: EpisodeContext) -> None: ...

    def verify(self, observation: Observation, call: Call, skill: Skill, goal: str) -> Verdict: ...
