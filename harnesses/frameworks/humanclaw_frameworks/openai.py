"""OpenAI's chat completions, the API of most model servers.

tools = body.tools("openai")
message = client.chat.completions.create(model=..., messages=messages, tools=tools).choices[0].message
messages += [message, *tools.answer(message)]
"""

from __future__ import annotations

from collections.abc import Sequence
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

        A tool message holds only text, so the pictures follow in a user message, which more models read.
        """
        answered = [(call.id, self._run(call.function)) for call in message.tool_calls or ()]
        said = [{"role": "tool", "tool_call_id": key, "content": result.text} for key, result in answered]
        shown = [{"type": "image_url", "image_url": {"url": one.data_url}} for _, one in answered if one.picture]
        return [*said, {"role": "user", "content": shown}] if shown else said

    def _run(self, function: Any) -> ToolResult:
        if function.name not in self._tools:
            return ToolResult(f"There is no tool {function.name!r}; there are {', '.join(self._tools)}.")
        return self._tools[function.name].run(function.arguments)


def wrap(tools: Sequence[BodyTool]) -> Tools:
    """Make the tool list."""
    return Tools(tools)
