"""The tools of a body: every skill that can run, and `look`."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, Final, Protocol

from humanclaw.episodes.panel import Panel, settled
from humanclaw.errors import CallError
from humanclaw.plugins.agents import EpisodeContext, Observation, Verifier
from humanclaw.records.tasks import free_episode
from humanclaw.skills.body_tool import LOOK, BodyTool, ToolResult
from humanclaw.skills.call import Call, check_call
from humanclaw.skills.contract import Skill
from humanclaw.skills.publishing import Json, tool_spec
from humanclaw.skills.reading import read_call
from humanclaw.storage.pictures import jpeg
from humanclaw.world.scene import Scene
from humanclaw.world.view import Gaze

_LOOK: Final[Json] = {
    "name": LOOK,
    "description": "See what the body sees, without moving.",
    "parameters": {"type": "object", "properties": {}, "required": [], "additionalProperties": False},
}


class Driven(Protocol):
    """The part of Body that the tools use."""

    @property
    def scene(self) -> Scene: ...

    @property
    def skills(self) -> Mapping[str, Skill]: ...

    @property
    def resets(self) -> int: ...

    @property
    def gaze(self) -> Gaze: ...

    @property
    def turn(self) -> threading.Lock: ...

    def observe(self, instruction: str = "") -> Observation: ...

    def call(self, skill: str, /, **params: Any) -> Observation: ...


class Verified:
    """A body whose calls a verifier checks before they move it (paper, section 3.2)."""

    def __init__(self, body: Driven, verifier: Verifier, instruction: str) -> None:
        """Begin the verifier's task. Raises PluginRunError for an error of the verifier."""
        self._body, self._instruction, self._panel = body, instruction, Panel("", verifier)
        spec = free_episode(instruction or "Do as you are asked.", body.scene)
        self._panel.begin(EpisodeContext(spec.told, body.skills, 0, gaze=body.gaze), {})
        if self._panel.fault:
            raise self._panel.fault

    @property
    def scene(self) -> Scene:
        return self._body.scene

    @property
    def skills(self) -> Mapping[str, Skill]:
        return self._body.skills

    @property
    def resets(self) -> int:
        return self._body.resets

    @property
    def gaze(self) -> Gaze:
        return self._body.gaze

    @property
    def turn(self) -> threading.Lock:
        return self._body.turn

    def observe(self, instruction: str = "") -> Observation:
        return self._body.observe(instruction)

    def call(self, skill: str, /, **params: Any) -> Observation:
        """Execute a call, or the one that the verifier puts in its place.

        Raises CallError for a call that cannot be executed, before the verifier is asked.
        """
        proposed = check_call(Call(skill, params), self.skills)
        verdict = self._panel.verify(self.observe(self._instruction), proposed, self.skills[skill], "")
        verdict, call = settled(verdict, proposed, self.skills)
        seen = self._body.call(call.skill, **call.params)
        if call is proposed:
            return seen
        return replace(seen, feedback=replace(seen.feedback, replaced=proposed, failed=verdict.failed))


def body_tools(body: Driven) -> tuple[BodyTool, ...]:
    """Return a tool for every skill that can run, and `look`. The body's lock makes calls wait, from
    any list of its tools and from acall(): a body does one thing at a time.

    After a skill of role stop the body moves no more until it is reset.
    """
    stopped: set[int] = set()
    ready = [skill for skill in body.skills.values() if skill.trained]
    specs = [tool_spec(skill, reasoning=False) for skill in ready]

    def runner(name: str) -> Callable[[str | Mapping[str, Any]], ToolResult]:
        def run(arguments: str | Mapping[str, Any]) -> ToolResult:
            with body.turn:
                if name != LOOK and body.resets in stopped:
                    return ToolResult("Nothing was executed: you have stopped, and the task is over.")
                done = _run(body, name, arguments)
                if done.picture and name != LOOK and body.skills[name].role == "stop":
                    stopped.add(body.resets)
                return done

        return run

    return tuple(BodyTool(**spec, run=runner(spec["name"])) for spec in (*specs, _LOOK))


def _run(body: Driven, name: str, arguments: str | Mapping[str, Any]) -> ToolResult:
    try:
        _, call = read_call(name, arguments)
        seen = body.observe() if name == LOOK else body.call(name, **call.params)
    except CallError as error:
        return ToolResult(str(error))
    words = str(seen.feedback) if name != LOOK else ""
    return ToolResult(f"{words} The picture is what you see now.".strip(), jpeg(seen.rgb))
