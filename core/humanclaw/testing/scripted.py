"""An agent that says what a test tells it to."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

from humanclaw.errors import ProviderError
from humanclaw.plugins.agents import EpisodeContext, HistoryEntry, Observation
from humanclaw.records.decisions import Decision
from humanclaw.skills.call import Call

Line = Decision | Call | Exception


class ScriptedAgent:
    """Answers with the next line of a script: a decision, a call, or an exception to raise. `heard` keeps what it was
    told."""

    name = "scripted"
    privileged = False

    def __init__(self, script: Iterable[Line]) -> None:
        self._script: Iterator[Line] = iter(script)
        self.heard: list[Observation] = []
        self.context: EpisodeContext | None = None

    def begin(self, context: EpisodeContext) -> None:
        self.context = context

    def decide(self, observation: Observation, history: Sequence[HistoryEntry]) -> Decision:
        self.heard.append(observation)
        line = next(self._script, ProviderError("the script has ended"))
        if isinstance(line, Exception):
            raise line
        return Decision((line,)) if isinstance(line, Call) else line
