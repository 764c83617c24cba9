"""Anthropic's SDK: tools that its runner calls.

runner = client.beta.messages.tool_runner(tools=body.tools("anthropic"), model=..., messages=messages, max_tokens=4096)
runner.until_done()
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from anthropic import beta_tool
from anthropic.lib.tools import BetaFunctionTool, BetaFunctionToolResultType, ToolError

from humanclaw.skills import BodyTool, ToolResult, in_format


def wrap(tools: Sequence[BodyTool]) -> list[BetaFunctionTool[Any]]:
    """Make a runnable tool of each. `to_dict()` is the tool for messages.create, `call(block.input)` its result."""
    return [_tool(tool) for tool in tools]


def _tool(tool: BodyTool) -> BetaFunctionTool[Any]:
    (spec,) = in_format([tool.spec], "anthropic")

    def call(**arguments: Any) -> BetaFunctionToolResultType:
        result = tool(**arguments)
        if not result.picture:
            raise ToolError(result.text)
        return _blocks(result)

    return beta_tool(name=tool.name, description=tool.description, input_schema=spec["input_schema"])(call)


def _blocks(result: ToolResult) -> BetaFunctionToolResultType:
    return [
        {"type": "text", "text": result.text},
        {"type": "image", "source": {"type": "base64", "media_type": "image/jpeg", "data": result.base64}},
    ]
