"""The tools of a body: every skill that can run, and `look`."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from typing import Any, Final, Protocol

from humanclaw.errors import CallError
from humanclaw.plugins.agents import Observation
from humanclaw.skills.body_tool import LOOK, BodyTool, ToolResult
from humanclaw.skills.contract import Skill
from humanclaw.skills.publishing import Json, tellable, tool_spec
from humanclaw.skills.reading import read_call
from humanclaw.storage.pictures import jpeg

_LOOK: Final[Json] = {
    "name": LOOK,
    "description": "See what the body sees, without moving.",
    "parameters": {"type": "object", "properties": {}, "required": [], "additionalProperties": False},
}


class Driven(Protocol):
    """The part of Body that the tools use."""

    @property
    def skills(self) -> Mapping[str, Skill]: ...

    def observe(self) -> Observation: ...

    def call(self, skill: str, /, **params: Any) -> Observation: ...


def body_tools(body: Driven) -> tuple[BodyTool, ...]:
    """Return a tool for every skill that can run, and `look`. A lock makes calls wait: a body does one thing at a
    time."""
    turn = threading.Lock()
    ready = tellable((skill for skill in body.skills.values() if skill.trained), "openai")
    specs = [tool_spec(skill, reasoning=False) for skill in ready]

    def runner(name: str) -> Callable[[str | Mapping[str, Any]], ToolResult]:
        def run(arguments: str | Mapping[str, Any]) -> ToolResult:
            with turn:
                return _run(body, name, arguments)

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
