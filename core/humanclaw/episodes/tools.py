"""The tools of a body: every skill that can run, and `look`."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, Final, Protocol

from humanclaw.episodes.agents import EpisodeAgents, settled
from humanclaw.errors import CallError
from humanclaw.plugins.agents import EpisodeContext, Observation, Verifier
from humanclaw.records.instructions import free_episode
from humanclaw.skills.answer_parsing import read_call
from humanclaw.skills.body_tool import LOOK, BodyTool, ToolResult
from humanclaw.skills.call import Call
from humanclaw.skills.contract import Skill, check_call
from humanclaw.skills.tool_schemas import Json, tool_spec
from humanclaw.storage.pictures import jpeg
from humanclaw.world.scene import Scene
from humanclaw.world.view import CameraMount

_LOOK: Final[Json] = {
    "name": LOOK,
    "description": "See what the body sees, without moving.",
    "parameters": {"type": "object", "properties": {}, "required": [], "additionalProperties": False},
}


class Driven(Protocol):
    """The part of Body that the tools use."""

    scene: Scene
    resets: int
    gaze: CameraMount
    turn: threading.Lock

    @property
    def skills(self) -> Mapping[str, Skill]: ...

    def observe(self, instruction: str = "") -> Observation: ...

    def call(self, skill: str, /, **params: Any) -> Observation: ...


def _verified(body: Driven, verifier: Verifier, instruction: str) -> Callable[..., Observation]:
    """Return the body's call(), which a verifier checks first and may replace (paper, section 3.2).

    It raises CallError for a call that cannot be executed, before the verifier is asked. Raises PluginRunError for an
    error of the verifier as it begins.
    """
    agents, spec = EpisodeAgents("", verifier), free_episode(instruction or "Do as you are asked.", body.scene)
    agents.begin(EpisodeContext(spec.for_agent, body.skills, 0, gaze=body.gaze), {})
    if agents.fault:
        raise agents.fault

    def call(skill: str, /, **params: Any) -> Observation:
        skills = body.skills
        proposed = check_call(Call(skill, params), skills)
        verdict = agents.verify(body.observe(instruction), proposed, skills[skill], "")
        verdict, chosen = settled(verdict, proposed, skills)
        seen = body.call(chosen.skill, **chosen.params)
        if chosen is proposed:
            return seen
        return replace(seen, feedback=replace(seen.feedback, replaced=proposed, failed=verdict.failed))

    return call


def body_tools(body: Driven, verifier: Verifier | None = None, instruction: str = "") -> tuple[BodyTool, ...]:
    """Return a tool for every skill that can run, and `look`. The body's lock makes calls wait, from
    any list of its tools and from acall(): a body does one thing at a time.

    After a skill of role stop the body moves no more until it is reset. verifier: checks each call before the body
    moves, and may replace it. instruction: the task, as the verifier is told it.
    """
    call = _verified(body, verifier, instruction) if verifier else body.call
    stopped: set[int] = set()
    ready = [skill for skill in body.skills.values() if skill.trained]
    specs = [tool_spec(skill, reasoning=False) for skill in ready]

    def runner(name: str) -> Callable[[str | Mapping[str, Any]], ToolResult]:
        def run(arguments: str | Mapping[str, Any]) -> ToolResult:
            with body.turn:
                if name != LOOK and body.resets in stopped:
                    return ToolResult("Nothing was executed: you have stopped, and the task is over.")
                done = _run(body, call, name, arguments)
                if done.picture and name != LOOK and body.skills[name].role == "stop":
                    stopped.add(body.resets)
                return done

        return run

    return tuple(BodyTool(**spec, run=runner(spec["name"])) for spec in (*specs, _LOOK))


def _run(body: Driven, call: Callable[..., Observation], name: str, arguments: str | Mapping[str, Any]) -> ToolResult:
    try:
        _, asked = read_call(name, arguments)
        seen = body.observe() if name == LOOK else call(name, **asked.params)
    except CallError as error:
        return ToolResult(str(error))
    words = str(seen.feedback) if name != LOOK else ""
    return ToolResult(f"{words} The picture is what you see now.".strip(), jpeg(seen.rgb))
