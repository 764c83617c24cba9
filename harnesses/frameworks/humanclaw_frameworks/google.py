"""Google's Gen AI SDK: declared functions, executed by `answer`.

tools = body.tools("google")
response = client.models.generate_content(model=..., contents=contents, config=GenerateContentConfig(tools=tools))
contents += [response.candidates[0].content, *tools.answer(response)]
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from google.genai import types

from humanclaw.skills import BodyTool, ToolResult, in_format


class Tools(list[types.Tool]):
    """A list of types.Tool that also executes calls."""

    def __init__(self, tools: Sequence[BodyTool]) -> None:
        super().__init__(types.Tool.model_validate(one) for one in in_format([tool.spec for tool in tools], "gemini"))
        self._tools = {tool.name: tool for tool in tools}

    def answer(self, response: types.GenerateContentResponse | Mapping[str, Any]) -> list[types.Content]:
        """Execute the calls of a response in order; return the contents that answer it, none without a call.

        response: the client's object, or the same as a dictionary.

        Pictures are a content of their own: only the newest models read pictures within a function's response.
        """
        if isinstance(response, Mapping):
            response = types.GenerateContentResponse.model_validate(response)
        answered = [(call, self._run(call)) for call in response.function_calls or ()]
        said = [_said(call, result) for call, result in answered]
        shown = [types.Part.from_bytes(data=one.picture, mime_type="image/jpeg") for _, one in answered if one.picture]
        return [types.Content(role="user", parts=parts) for parts in (said, shown) if parts]

    def _run(self, call: types.FunctionCall) -> ToolResult:
        if call.name not in self._tools:
            return ToolResult(f"There is no tool {call.name!r}; there are {', '.join(self._tools)}.")
        return self._tools[call.name].run(call.args or {})


def _said(call: types.FunctionCall, result: ToolResult) -> types.Part:
    told = {"output" if result.picture else "error": result.text}
    return types.Part(function_response=types.FunctionResponse(id=call.id, name=call.name, response=told))


def wrap(tools: Sequence[BodyTool]) -> Tools:
    """Make the tool list."""
    return Tools(tools)
