"""OpenAI's Agents SDK: Agent("walker", tools=body.tools("openai_agents"))."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from typing import Any

from agents import FunctionTool, ToolOutputImage, ToolOutputText

from humanclaw.skills import BodyTool


def wrap(tools: Sequence[BodyTool]) -> list[FunctionTool]:
    """Make a FunctionTool of each. The schemas are not strict: strict mode has no optional parameters."""
    return [_tool(tool) for tool in tools]


def _tool(tool: BodyTool) -> FunctionTool:
    async def call(_: Any, arguments: str) -> str | list[ToolOutputText | ToolOutputImage]:
        result = await asyncio.to_thread(tool.run, arguments)
        if not result.picture:
            return result.text
        return [ToolOutputText(text=result.text), ToolOutputImage(image_url=result.data_url)]

    return FunctionTool(tool.name, tool.description, tool.parameters, call, strict_json_schema=False)
