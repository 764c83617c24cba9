"""LangChain, and with it LangGraph: create_agent(model, body.tools("langchain"))."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from langchain_core.tools import StructuredTool, ToolException

from humanclaw.skills import BodyTool


def wrap(tools: Sequence[BodyTool]) -> list[StructuredTool]:
    """Make a StructuredTool of each. A result is a list of content blocks: text, and the picture. A refused call
    becomes a ToolMessage with status "error"."""
    return [_tool(tool) for tool in tools]


def _tool(tool: BodyTool) -> StructuredTool:
    def call(**arguments: Any) -> list[dict[str, Any]]:
        result = tool(**arguments)
        if not result.picture:
            raise ToolException(result.text)
        picture = {"type": "image", "base64": result.base64, "mime_type": "image/jpeg"}
        return [{"type": "text", "text": result.text}, picture]

    return StructuredTool.from_function(
        call,
        name=tool.name,
        description=tool.description,
        args_schema=tool.parameters,
        infer_schema=False,
        handle_tool_error=True,
    )
