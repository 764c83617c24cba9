"""The decision maker."""

from __future__ import annotations

from collections.abc import Sequence

from humanclaw import Call, Decision, EpisodeContext, HistoryEntry, Observation, PluginError
from humanclaw.measures import from_si, suited


class ExampleAgent:
    """Walks straight on, and stops after some steps. It knows skills by what they say of themselves, not by name."""

    name = "example"
    privileged = False

    def __init__(self, steps: int = 10, metres: float = 0.4) -> None:
        self.steps = steps
        self.metres = metres

    def begin(self, context: EpisodeContext) -> None:
        """Look for a skill that goes forward and for one that stops. Raises PluginError if one is missing."""
        declared = [skill.declaration for skill in context.skills.values()]
        walks = suited(declared, "hips.forward")
        stop = next((one.skill for one in declared if one.role == "stop"), None)
        if walks is None or stop is None:
            raise PluginError("agent 'example' needs a skill that goes forward and one that stops.")
        ahead = walks.commands("hips.forward")
        assert ahead is not None
        self._ahead = Call(walks.skill, {ahead.key: round(from_si(ahead.key, self.metres))})
        self._stop = Call(stop)

    def decide(self, observation: Observation, history: Sequence[HistoryEntry]) -> Decision:
        """Answer with one call. `observation.rgb` is what the eyes see, `observation.instruction` the task."""
        ended = observation.step >= self.steps
        reasoning = "Far enough." if ended else "The way ahead is as good as any."
        return Decision((self._stop if ended else self._ahead,), reasoning=reasoning)
