"""The body's side: an agent and a verifier that ask their other halves in another process."""

from __future__ import annotations

import json
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final, TypeVar

from pydantic import ValidationError

from humanclaw import (
    Call,
    Decision,
    EpisodeContext,
    HistoryEntry,
    Meter,
    Observation,
    PluginError,
    Skill,
    Verdict,
)
from humanclaw.plugins import StandIn
from humanclaw_bench.isolation.messages import Json, from_json, past, seen, task, to_json
from humanclaw_bench.isolation.transports import GRACE, STARTING, OverdueError, ProcessTransport

T = TypeVar("T")
PROCESS: Final = "process"
"""The place of an agent or a verifier in a process of its own, as records name it."""
LONGEST: Final = 24 * 3600.0
"""Seconds to wait for an answer without a time limit."""


@dataclass(frozen=True)
class Introduction:
    """What the other side says of an agent or a verifier."""

    name: str
    settings: dict[str, Any] = field(default_factory=dict)
    owner: str = ""
    """The package that brings it."""
    versions: dict[str, str] = field(default_factory=dict)


class _Apart(StandIn):
    """An agent or a verifier in a process of its own. It is told nothing but its task."""

    privileged: Final = False

    def __init__(self, link: ProcessTransport, role: str, introduction: Introduction) -> None:
        self.name, self.owner = introduction.name, introduction.owner or "the agent's side"
        self.settings, self.versions = introduction.settings, introduction.versions
        self._link, self._role, self._meter = link, role, Meter()

    def begin(self, context: EpisodeContext) -> None:
        self._meter = context.meter or self._meter
        self._ask("begin", task(context) | {"role": self._role})

    def _ask(self, method: str, params: Json) -> Any:
        """Return the answer to a request. Raises what the other side raises, and LimitError when time is up."""
        left = self._meter.seconds_left()
        timed = params | {"seconds": left if left < LONGEST else None}
        try:
            return self._link.ask(method, timed, min(left + GRACE, LONGEST))
        except OverdueError:
            self._meter.check()
            raise


class ApartAgent(_Apart):
    """The agent's half beside the body. Its history is told as it grows, each picture once."""

    _first: int | None = None
    """First step that the other side was asked about: it has not seen the pictures of those before."""
    _told = 0
    """Number of steps that the other side knows."""

    def decide(self, observation: Observation, history: Sequence[HistoryEntry]) -> Decision:
        self._first = observation.step if self._first is None else self._first
        new = past(history[self._told :], self._first)
        answer = self._ask("decide", seen(observation) | {"history": new})
        self._told = len(history)
        return _read(Decision, answer, "decide")


class ApartVerifier(_Apart):
    """The verifier's half beside the body."""

    def verify(self, observation: Observation, call: Call, skill: Skill, goal: str) -> Verdict:
        params = seen(observation) | {"call": to_json(call), "goal": goal}
        return _read(Verdict, self._ask("verify", params), "verify")


def _read(kind: type[T], answer: object, method: str) -> T:
    try:
        return from_json(kind, answer)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        where = ".".join(map(str, first["loc"]))
        raise TypeError(f"its answer to {method} is no {kind.__name__}: {where}: {first['msg']}") from None


KINDS: Final = {"agents": ApartAgent, "verifiers": ApartVerifier}


class IsolatedAgents:
    """The other side of one worker: its process, and the halves of agent and verifier for each episode."""

    def __init__(self, kinds: Collection[str], asked: Mapping[str, Any], loads: Mapping[str, Any]) -> None:
        """Prepare the process; nothing starts yet.

        Args:
            kinds: those of "agents" and "verifiers" that play there.
            asked: names by kind and options, for the factories.
            loads: plugin files and choice of plugins, for the process.
        """
        self._kinds = list(kinds)
        elsewhere = KINDS.keys() - kinds
        self._asked = {name: value for name, value in asked.items() if name not in elsewhere}
        self._link = ProcessTransport([json.dumps(loads)])

    def make(self) -> dict[str, Any]:
        """Return new halves of agent and verifier by kind, for the next episode.

        Raises PluginError and ProviderError, as their factories may, and PluginError for a side that dies meanwhile.
        """
        if not self._kinds:
            return {}
        try:
            answer = self._link.ask("initialize", self._asked, STARTING)
            introductions = {kind: _read(Introduction, answer.get(kind), "initialize") for kind in self._kinds}
        except (RuntimeError, TypeError, AttributeError, OverdueError) as fault:
            said = f"agent and verifier cannot be made: {fault}."
            raise PluginError(said, "Mend the plugin that brings them.") from fault
        return {kind: KINDS[kind](self._link, kind, introduction) for kind, introduction in introductions.items()}

    def close(self) -> None:
        self._link.close()
