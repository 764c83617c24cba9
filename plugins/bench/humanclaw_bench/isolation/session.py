"""The agents' side: make agent and verifier, and answer requests about one episode after another."""

from __future__ import annotations

import time
import traceback
from collections.abc import Callable, Mapping
from typing import Any, Final

from humanclaw import (
    Call,
    Decision,
    HistoryEntry,
    HumanclawError,
    LimitError,
    Meter,
    PluginError,
    Plugins,
    ProviderClosedError,
    ProviderError,
    Verdict,
)  # fmt: skip
from humanclaw.plugins import admit, name_of, noun, origin, settings_of
from humanclaw_bench.isolation.messages import Json, context_of, entry_of, from_json, observation_of, to_json

LONGEST_ERROR: Final = 2000
"""Characters of an error that are told: a model's answer may be part of it."""


class Remaining(Meter):
    """The budget of the other side, as its last request told it."""

    _until = float("inf")

    def tell(self, seconds: float | None) -> None:
        """Note the seconds that are left to a question that begins now; None for no limit."""
        self.begin("call")
        self._until = float("inf") if seconds is None else time.monotonic() + seconds

    def seconds_left(self) -> float:
        return max(0.0, self._until - time.monotonic())


class Session:
    """Agent and verifier of a worker, and what they have seen of the current episode."""

    def __init__(self, plugins: Plugins) -> None:
        self._plugins = plugins
        self._made: dict[str, Any] = {}
        self._meter = Remaining()
        self._history: list[HistoryEntry] = []
        self._views: dict[int, bytes] = {}
        self._methods: Mapping[str, Callable[[Json], Any]] = {
            "initialize": self._initialize,
            "begin": self._begin,
            "decide": self._decide,
            "verify": self._verify,
        }

    def answer(self, request: Json) -> Json:
        """Answer a request. What agent and verifier raise, even SystemExit, is in the answer."""
        try:
            return {"result": self._methods[request["method"]](request["params"])}
        except BaseException as fault:
            if not isinstance(fault, PluginError | ProviderError | LimitError):
                traceback.print_exc()
            return {"error": _told(fault)}

    def _initialize(self, params: Json) -> Json:
        """Make the agent and the verifier of an episode."""
        self._history, self._views, self._meter = [], {}, Remaining()
        self._made = {kind: self._make(kind, params) for kind in ("agents", "verifiers") if params.get(kind)}
        return {
            kind: _introduced(agent) | {"versions": self._versions(kind, params[kind])}
            for kind, agent in self._made.items()
        }

    def _versions(self, kind: str, name: str) -> dict[str, str]:
        """Return the version of the distribution that brings an agent or a verifier, by its name."""
        item = f"{noun(kind)} {name.rpartition(':')[2]}"
        owners = [info for info in self._plugins.infos if item in info.provides and info.version]
        return {info.origin: info.version for info in owners}

    def _make(self, kind: str, params: Json) -> Any:
        return self._plugins.make_agent(kind, params[kind], params["options"], params["names"].get(kind, ""))

    def _begin(self, params: Json) -> Json:
        """Tell the agent or the verifier its task."""
        self._meter.limits = params["limits"]  # Of both: each keeps the meter that it is given here.
        self._meter.tell(params["seconds"])
        self._context = context_of(params, self._meter)
        self._made[params["role"]].begin(self._context)
        return {}

    def _decide(self, params: Json) -> Any:
        """Let the agent decide. The history grows by the steps that ended since the last question."""
        self._meter.tell(params["seconds"])
        self._history += [entry_of(entry, self._views) for entry in params["history"]]
        agent, seen = self._made["agents"], observation_of(params, self._context.spec.instruction)
        self._views[seen.step] = seen.jpeg
        decision = agent.decide(seen, tuple(self._history))
        return to_json(admit(decision, Decision, f"decide() of {name_of(agent)} returned"))

    def _verify(self, params: Json) -> Any:
        """Let the verifier judge a proposed call by the current view."""
        self._meter.tell(params["seconds"])
        verifier, seen = self._made["verifiers"], observation_of(params, self._context.spec.instruction)
        call = from_json(Call, params["call"])
        verdict = verifier.verify(seen, call, self._context.skills[call.skill], params["goal"])
        return to_json(admit(verdict, Verdict, f"verify() of {name_of(verifier)} returned"))


def _introduced(agent: Any) -> Json:
    """Return name, settings and package of an agent or a verifier."""
    return {"name": name_of(agent), "settings": settings_of(agent), "owner": origin(agent)}


def _told(fault: BaseException) -> Json:
    """Return what the other side needs to raise an error again."""
    kinds = (ProviderClosedError, PluginError, ProviderError, LimitError)
    kind = next((each.__name__ for each in kinds if isinstance(fault, each)), "")
    message = fault.message if isinstance(fault, HumanclawError) else str(fault)
    more = {"remedy": getattr(fault, "remedy", ""), "scope": getattr(fault, "scope", "")}
    return {"kind": kind, "type": type(fault).__name__, "message": message[:LONGEST_ERROR]} | more
