"""The agent and the verifier of an episode: their declarations, their inputs and their answers."""

from __future__ import annotations

import reprlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import Any, Final

import numpy as np

from humanclaw.body.pose import FUTURE
from humanclaw.errors import ANSWERING, CallError, PluginError, PluginRunError, blaming, in_words
from humanclaw.plugins.agents import Agent, EpisodeContext, HistoryEntry, Observation, Verifier
from humanclaw.plugins.validation import StandIn, admit, is_privileged, name_of, origin, settings_of
from humanclaw.records.decisions import Decision, Verdict
from humanclaw.skills.call import Call
from humanclaw.skills.contract import Skill, check_call

_AGENTS: Final = 82
"""Random stream of agents."""


def own_seed(seed: int) -> int:
    """Derive the seed of an agent's own random numbers. The body's motion follows from the episode's seed."""
    return int(np.random.SeedSequence([seed, _AGENTS]).generate_state(1)[0])


class EpisodeAgents:
    """Agent and verifier of an episode. `fault` keeps the first error in their code, with the name of their plugin.

    An agent that is only a name decides elsewhere and submits its decisions to the episode.
    """

    def __init__(self, agent: Agent | str, verifier: Verifier | None) -> None:
        self.agent = None if isinstance(agent, str) else agent
        self.verifier = verifier
        self.fault: PluginRunError | None = None
        self.refusal = ""
        """Reason of a PluginError that one of them raised, which ends the run."""
        # Read once, so that the record states exactly the settings that they run with.
        self.privileged = {role: self._is_privileged(agent) for role, agent in self._present().items()}
        self.settings = {"agent": self._settings(agent), "verifier": self._settings(verifier)}
        """Settings of agent and verifier; empty if asking for them failed."""
        self.views_between = self._views_between()
        """Number of views of each half second that the agent asks for."""
        self.packages = {origin(agent) for agent in self._present().values()}
        apart = [agent.versions for agent in self._present().values() if isinstance(agent, StandIn)]
        self.versions = {name: version for versions in apart for name, version in versions.items()}
        """Versions of distributions that are not loaded here."""
        self.names = self._name(agent), self._name(verifier)
        """Names of agent and verifier; the package instead of a name that a record cannot hold."""

    def _present(self) -> dict[str, Agent | Verifier]:
        pair: dict[str, Agent | Verifier | None] = {"agent": self.agent, "verifier": self.verifier}
        return {role: agent for role, agent in pair.items() if agent is not None}

    @contextmanager
    def noting(self) -> Iterator[None]:
        """Keep a plugin's error while there is no record yet: it ends the episode once there is one."""
        try:
            yield
        except PluginRunError as fault:
            self.fault = self.fault or fault

    def begin(self, context: EpisodeContext, known: Mapping[str, Any]) -> None:
        """Give agent and verifier their task.

        known: what privileged ones know besides: whole task, scene, true state, and the view with depth and ids.

        Raises PluginError if one cannot be used. Other errors are kept in `fault`.
        """
        for role, agent in self._present().items():
            with self.noting(), blaming(origin(agent), *ANSWERING):
                agent.begin(replace(context, **known) if self.privileged[role] else context)

    def decide(self, seen: Observation, history: Sequence[HistoryEntry]) -> Decision:
        """Return the agent's decision. Raises PluginRunError for an error or a malformed decision."""
        assert self.agent is not None
        with self._asking(self.agent):
            return admit(self.agent.decide(seen, history), Decision, f"decide() of {self.names[0]} returned")

    def verify(self, seen: Observation, call: Call, skill: Skill, goal: str) -> Verdict:
        """Return the verifier's verdict. Raises PluginRunError for an error or a malformed verdict."""
        assert self.verifier is not None
        with self._asking(self.verifier):
            verdict = self.verifier.verify(seen, call, skill, goal)
            verdict = admit(verdict, Verdict, f"verify() of {self.names[1]} returned")
            if not verdict.accepted and verdict.replacement is None:
                fault = f"verify() of {self.names[1]} returned a Verdict that neither accepts nor replaces the call"
                raise TypeError(f"{fault}; expected Verdict(True), or Verdict(False, another call)")
            return verdict

    @contextmanager
    def _asking(self, agent: Agent | Verifier) -> Iterator[None]:
        """Name the plugin of agent or verifier in every error of its code."""
        try:
            with blaming(origin(agent), *ANSWERING):
                yield
        except PluginError as fault:
            self.refusal = f"{origin(agent)} raised {in_words(fault)}"
            raise

    def dismiss(self) -> None:
        """Forget agent and verifier. Their context refers to the episode, and the cycle would keep its house in
        memory."""
        self.agent = self.verifier = None

    def _is_privileged(self, agent: Agent | Verifier) -> bool:
        with self.noting():
            return is_privileged(agent)
        return False

    def _settings(self, agent: object) -> Mapping[str, Any]:
        with self.noting():
            return settings_of(agent)
        return {}

    def _views_between(self) -> int:
        asked = self.settings["agent"].get("views_between", 0)
        with self.noting(), blaming(origin(self.agent)):
            if not isinstance(asked, int) or not 0 <= asked < FUTURE:
                raise TypeError(f"views_between is a whole number from 0 to {FUTURE - 1}; got {reprlib.repr(asked)}")
            return asked
        return 0

    def _name(self, agent: Agent | Verifier | str | None) -> str:
        if agent is None or isinstance(agent, str):
            return agent or ""
        with self.noting():
            return name_of(agent)
        return origin(agent)


def settled(verdict: Verdict, call: Call, skills: Mapping[str, Skill]) -> tuple[Verdict, Call]:
    """Return a verdict and the call to execute. An illegal replacement lets the proposal through; the verdict says
    so."""
    if verdict.accepted or verdict.replacement is None:
        return verdict, call
    try:
        return verdict, check_call(verdict.replacement, skills)
    except CallError as fault:
        return replace(verdict, accepted=True, replacement=None, failed_open=f"replacement refused: {fault}"), call
