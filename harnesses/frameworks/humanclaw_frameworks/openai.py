"""OpenAI's chat completions, the API of most model servers.

tools = body.tools("openai")
message = client.chat.completions.create(model=..., messages=messages, tools=tools).choices[0].message
messages += [message, *tools.answer(message)]
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from humanclaw.skills import BodyTool, ToolResult, in_format

Json = dict[str, Any]


class Tools(list[Json]):
    """The tool list, which also executes calls."""

    def __init__(self, tools: Sequence[BodyTool]) -> None:
        super().__init__(in_format([tool.spec for tool in tools], "openai"))
        self._tools = {tool.name: tool for tool in tools}

    def answer(self, message: Any) -> list[Json]:
        """Execute the calls of a message in order; return the messages that answer it, none without a call.

        message: the client's object, or the same as a dictionary.
        A tool message holds only text, so the pictures follow in a user message, which more models read.
        """
        answered = [(_of(call, "id"), self._run(_of(call, "function"))) for call in _of(message, "tool_calls") or ()]
        said = [{"role": "tool", "tool_call_id": key, "content": result.text} for key, result in answered]
        shown = [{"type": "image_url", "image_url": {"url": one.data_url}} for _, one in answered if one.picture]
        return [*said, {"role": "user", "content": shown}] if shown else said

    def _run(self, function: Any) -> ToolResult:
        name = _of(function, "name")
        if name not in self._tools:
            return ToolResult(f"There is no tool {name!r}; there are {', '.join(self._tools)}.")
        return self._tools[name].run(_of(function, "arguments"))


def _of(value: Any, name: str) -> Any:
    """Return a field of an object or of a dictionary."""
    return value.get(name) if isinstance(value, Mapping) else getattr(value, name)


def wrap(tools: Sequence[BodyTool]) -> Tools:
    """Make the tool list."""
    return Tools(tools)
