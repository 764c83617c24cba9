"""The body's side of the wall: an agent and a verifier that ask their other halves."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final, TypeVar
from urllib.parse import urlsplit

from pydantic import ValidationError

from humanclaw import (
    Call,
    Decision,
    EpisodeContext,
    HistoryEntry,
    HumanclawError,
    Meter,
    Observation,
    PluginError,
    Skill,
    Verdict,
)
from humanclaw.plugins import StandIn
from humanclaw_bench.wall.links import GRACE, STARTING, Link, OverdueError, ProcessLink, UrlLink
from humanclaw_bench.wall.messages import PROTOCOL, Json, from_json, past, seen, task, to_json

T = TypeVar("T")
PROCESS: Final = "process"
"""The place of an agent or a verifier in a process of this machine; other places are URLs."""
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
    """An agent or a verifier on the other side of the wall. It is told nothing but its task."""

    privileged: Final = False

    def __init__(self, link: Link, role: str, told: Introduction) -> None:
        self.name, self.owner = told.name, told.owner or "the agent's side"
        self.settings, self.versions = told.settings, told.versions
        self._link, self._role, self._meter = link, role, Meter()

    def begin(self, context: EpisodeContext) -> None:
        self._meter = context.meter or self._meter
        self._ask("begin", task(context) | {"role": self._role})

    def _ask(self, method: str, params: Json) -> Any:
        """Return the answer to a request. Raises what the other side raises, and LimitError when time is up."""
        left = self._meter.seconds_left()
        told = params | {"seconds": left if left < LONGEST else None}
        try:
            return self._link.ask(method, told, min(left + GRACE, LONGEST))
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


def introduce(link: Link, kinds: Sequence[str], params: Json) -> dict[str, Introduction]:
    """Have agent and verifier made. Returns what is said of each, by kind.

    Raises PluginError and ProviderError, as their factories may, RuntimeError for a side that cannot answer, and
    TypeError for an answer that is no introduction.
    """
    told = link.ask("initialize", {"protocolVersion": PROTOCOL, **params}, STARTING)
    if not isinstance(told, Mapping) or told.get("protocolVersion") != PROTOCOL:
        raise RuntimeError(f"it does not speak protocol {PROTOCOL}: {str(told)[:80]}")
    return {kind: _read(Introduction, told.get(kind), "initialize") for kind in kinds}


_SERVE: Final = "`humanclaw bench agent` serves an agent and prints its address."


def require_answer(url: str, asked: Json) -> None:
    """Have the server at an address make its agent once. Raises HumanclawError if it cannot. asked: as for Wall."""
    require_address(url)
    try:
        Wall({"agents": url}, asked, {}).make()
    except PluginError:
        raise
    except Exception as error:  # The server names errors of its agent, of any class.
        raise HumanclawError(f"{error}".rstrip(".") + ".", _SERVE) from error


def require_address(url: str) -> None:
    """Raise HumanclawError for what is no address of a server, and for one with a secret: records hold the address."""
    try:
        if (parts := urlsplit(url)).scheme not in ("http", "https") or not parts.hostname or parts.port == 0:
            raise ValueError
    except ValueError:  # Also of a port that is no number.
        told = f"--agent-url takes an address of http or https, such as http://127.0.0.1:8000/; got {url!r}."
        raise HumanclawError(told, _SERVE) from None
    if parts.username or parts.password or parts.query:
        told = "--agent-url takes no user, password or query, since the records hold the address."
        raise HumanclawError(told, "Let the server know its callers in another way.")


class Wall:
    """The other side of one worker: its links, and the halves of agent and verifier for each episode."""

    def __init__(self, places: Mapping[str, str], asked: Mapping[str, Any], loads: Mapping[str, Any]) -> None:
        """Prepare the links; nothing starts yet.

        Args:
            places: kind ("agents", "verifiers") to "process", or to the URL where it answers.
            asked: names by kind and options, for the factories.
            loads: plugin files and choice of plugins, for the process.
        """
        self._places, self._asked = places, asked
        own = ProcessLink([json.dumps(loads)])
        self._links: dict[str, Link] = {
            place: own if place == PROCESS else UrlLink(place) for place in dict.fromkeys(places.values())
        }

    def make(self) -> dict[str, Any]:
        """Return new halves of agent and verifier by kind, for the next episode.

        Raises PluginError and ProviderError, as their factories may, and PluginError for a side that dies meanwhile.
        """
        made: dict[str, Any] = {}
        for place, link in self._links.items():
            kinds = [kind for kind, where in self._places.items() if where == place]
            elsewhere = KINDS.keys() - kinds
            try:
                asked = {name: one for name, one in self._asked.items() if name not in elsewhere}
                made |= {kind: KINDS[kind](link, kind, told) for kind, told in introduce(link, kinds, asked).items()}
            except (RuntimeError, TypeError, OverdueError) as fault:
                said = f"agent and verifier cannot be made: {fault}."
                raise PluginError(said, "Mend the plugin that brings them.") from fault
        return made

    def close(self) -> None:
        for link in self._links.values():
            link.close()
