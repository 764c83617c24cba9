"""The protocols of agents, verifiers and reporters, and what each of them is given."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from humanclaw.world.view import DEFAULT_GAZE, GAZES, CameraMount, View

if TYPE_CHECKING:  # Whoever implements a protocol pays for none of the libraries behind what it is given.
    from humanclaw.records.decisions import Decision, Verdict
    from humanclaw.records.feedback import Feedback
    from humanclaw.records.limits import Meter
    from humanclaw.records.recorded_episode import RecordedEpisode
    from humanclaw.records.specification import EpisodeSpec
    from humanclaw.skills.call import Call
    from humanclaw.skills.contract import Skill
    from humanclaw.world.scene import Scene
    from humanclaw.world.simulator import WorldState


class Installed(Protocol):
    """The part of humanclaw.Plugins that reporters and sources of scenes use."""

    def scene(self, reference: str) -> Any: ...

    def make(self, kind: str, name: str, *args: Any, **options: Any) -> Any: ...

    def tell(self, hook: str, **event: Any) -> None: ...


class Reporter(Protocol):
    """Presents a recorded episode: as a page, a film, a log."""

    def write(self, run: Path, episode: RecordedEpisode, plugins: Installed) -> Mapping[str, Path]:
        """Write into the folder of a run or of the episode. Returns each file by a short label for people."""


# -- deciding ----------------------------------------------------------------------------------------------------------
def _nothing() -> Feedback:
    from humanclaw.records.feedback import Feedback

    return Feedback()


@dataclass(frozen=True)
class Observation:
    """What an agent may know: the ego view, the instruction, and the outcome of the last step."""

    step: int
    instruction: str
    rgb: NDArray[np.uint8]
    """(512, 512, 3), read-only: the verifier sees the same."""
    feedback: Feedback = field(default_factory=_nothing)
    """Outcome of the last step, or the reason why the last answer was refused; str() gives words."""
    jpeg: bytes = field(default=b"", repr=False)
    """The view as the record keeps it; empty if nothing is recorded."""
    between: tuple[bytes, ...] = field(default=(), repr=False)
    """JPEGs of views during the last call, oldest first, if the agent's settings ask for them; otherwise empty."""

    def __repr__(self) -> str:
        """Return one line, without the pixels."""
        size = " x ".join(map(str, self.rgb.shape))
        return f"Observation(step={self.step}, {self.instruction!r}, rgb {size}, {str(self.feedback)!r})"


@dataclass(frozen=True)
class HistoryEntry:
    """One past step, as an agent may recall it (paper, section 3.2: views, reasoning traces, selected actions)."""

    step: int
    decision: Decision
    feedback: Feedback
    view: NDArray[np.uint8] | bytes | Path = field(repr=False)
    """The view that it was decided from: pixels, a JPEG, or the file of one. Pixels take 0.8 MB."""

    @property
    def rgb(self) -> NDArray[np.uint8]:
        """The pixels of the view; a JPEG is decoded each time that somebody asks."""
        if isinstance(self.view, np.ndarray):
            return self.view
        from humanclaw.records.folder import FRAME_BYTES, reading
        from humanclaw.storage.files import read_file
        from humanclaw.storage.pictures import from_jpeg

        if isinstance(self.view, bytes):
            return from_jpeg(self.view)
        with reading(self.view):
            return from_jpeg(read_file(self.view, FRAME_BYTES))

    @property
    def executed(self) -> Call | None:
        """The call that was executed; None if there was none."""
        return self.feedback.executed


@dataclass(frozen=True)
class EpisodeContext:
    """What an agent or a verifier is given before the first step."""

    spec: EpisodeSpec
    """The part of the episode that an agent is told (EpisodeSpec.for_agent); the whole for privileged ones."""
    skills: Mapping[str, Skill]
    seed: int
    """For the agent's own random numbers; derived from the episode's."""
    scene: Scene | None = None
    state: Callable[[], WorldState] | None = None
    """scene and state go to privileged agents only: to oracles, never to models."""
    view: Callable[[], View] | None = None
    """Privileged too: the view of the current step with depth and object ids, for agents with perfect sight."""
    meter: Meter | None = None
    """The budget that is left. Wait for a model no longer than meter.seconds_left()."""
    gaze: CameraMount = GAZES[DEFAULT_GAZE]
    """The place and pitch of the eyes, as prompts describe them."""


@runtime_checkable
class Agent(Protocol):
    """Anything that can call a tool: a model, a person, a script.

    Optional attributes. settings: a mapping that JSON can hold, with the defaults filled in. The record keeps it, and
    an option that is not among its keys is refused. A number under its key `views_between`, up to 14, asks for so many
    views of each half second that the body moves (Observation.between); models are shown none. at_terminal: if true,
    a person who decides sees the terminal, and its progress lines leave out what only the scene knows.
    ready(instruction), also of a verifier: `humanclaw run` calls it before it makes a body; it raises PluginError where
    no episode can begin. show_result(result, run): `humanclaw run` calls it at the end with the outcome in words and
    the folder of the run, before the reporters write there.
    """

    name: str
    privileged: bool

    def begin(self, context: EpisodeContext) -> None: ...

    def decide(self, observation: Observation, history: Sequence[HistoryEntry]) -> Decision:
        """Decide on the next call.

        This method cannot be interrupted from outside. Ask the context's meter for seconds_left() while waiting: a time
        limit ends an agent that does not ask only when it returns.

        Raises:
            ProviderError: no answer can be had. It ends the episode as infra_error and never becomes a decision.
            LimitError: the meter leaves no time to wait for an answer.
            PluginError: here or in begin(), for what would stop every episode, such as a refused key. It ends the run;
                after the first step it also fails the episode.

        Any other exception is the agent's own error and fails the episode. So does a decision with a field of a wrong
        type.
        """


class Tasks(Protocol):
    """An endless source of episodes to train on. The same seed always gives the same episode."""

    rewards: Mapping[str, float]
    """Weights of the rewards that train for it, by name, unless a trainer names others."""
    goal: str
    """Name of the reward that is 1 at the step that solves a task."""

    def __call__(self, seed: int) -> EpisodeSpec:
        """Return the episode of a seed, a whole number from 0."""


class Verifier(Protocol):
    """The skill-specific spatial response verifier (paper, section 3.2 and appendix A): sees the current view alone.

    Its optional attribute `settings` is recorded, as an agent's is. If its attribute `privileged` is true, it is given
    scene and state.
    """

    name: str

    def begin(self, context: EpisodeContext) -> None: ...

    def verify(self, observation: Observation, call: Call, skill: Skill, goal: str) -> Verdict: ...
