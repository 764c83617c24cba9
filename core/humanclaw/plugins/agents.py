"""The protocols of agents, verifiers and reporters, and what each of them is given."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from humanclaw.records.decisions import Decision, Verdict
from humanclaw.records.feedback import Feedback
from humanclaw.records.specification import EpisodeSpec
from humanclaw.skills.call import Call
from humanclaw.skills.contract import Skill
from humanclaw.world.scene import Scene
from humanclaw.world.simulator import WorldState
from humanclaw.world.view import View

if TYPE_CHECKING:
    from humanclaw.records.limits import Meter
    from humanclaw.records.reading import RecordedEpisode


class Installed(Protocol):
    """What a reporter asks of the plugins (humanclaw.Plugins)."""

    def scene(self, reference: str) -> Any: ...

    def make(self, kind: str, name: str, *args: Any, **options: Any) -> Any: ...

    def tell(self, hook: str, **event: Any) -> None: ...


class Reporter(Protocol):
    """Makes something to look at of a recorded episode."""

    def write(self, run: Path, episode: RecordedEpisode, plugins: Installed) -> Mapping[str, Path]:
        """Write into the folder of a run or of the episode; returns each file by what a person calls it."""


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
