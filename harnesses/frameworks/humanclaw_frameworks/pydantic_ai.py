"""Pydantic AI: Agent(model, tools=body.tools("pydantic_ai"))."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from pydantic_ai import BinaryContent, Tool

from humanclaw.skills import BodyTool


def wrap(tools: Sequence[BodyTool]) -> list[Tool[Any]]:
    """Make a Tool of each. A result is its text and the picture."""
    return [_tool(tool) for tool in tools]


def _tool(tool: BodyTool) -> Tool[Any]:
    def call(**arguments: Any) -> str | list[str | BinaryContent]:
        result = tool(**arguments)
        return [result.text, BinaryContent(result.picture, media_type="image/jpeg")] if result.picture else result.text

    return Tool.from_schema(call, tool.name, tool.description, tool.parameters, sequential=True)
