"""smolagents. Its tools return only text to the model; a callback adds the pictures.

tools = body.tools("smolagents")
ToolCallingAgent(tools, model, step_callbacks=[tools.see]).run(task)
"""

from __future__ import annotations

import io
from collections.abc import Sequence
from typing import Any

from PIL import Image
from smolagents import Tool

from humanclaw.skills import BodyTool


class BodyTools(list[Tool]):
    """The tools, and the callback `see`."""

    def __init__(self, tools: Sequence[BodyTool]) -> None:
        self._seen: list[bytes] = []
        super().__init__(_tool(tool, self._seen) for tool in tools)

    def see(self, step: Any, agent: Any = None) -> None:
        """Add the views of a step to its observations: a callback for `step_callbacks`."""
        if self._seen:
            step.observations_images = [Image.open(io.BytesIO(picture)) for picture in self._seen]
            self._seen.clear()


def _tool(tool: BodyTool, seen: list[bytes]) -> Tool:
    def forward(self: Tool, **arguments: Any) -> str:
        result = tool(**{key: value for key, value in arguments.items() if value is not None})
        seen.extend([result.picture] if result.picture else [])
        return result.text

    content = {
        "name": tool.name,
        "description": tool.description,
        "inputs": _inputs(tool),
        "output_type": "string",
        "skip_forward_signature_validation": True,
        "forward": forward,
    }
    return type(tool.name, (Tool,), content)()


def _inputs(tool: BodyTool) -> dict[str, Any]:
    """Return the inputs: smolagents marks optional ones as nullable, and requires a description of each."""
    required = set(tool.parameters.get("required", ()))
    return {
        key: {"description": key, **part, **({} if key in required else {"nullable": True})}
        for key, part in tool.parameters["properties"].items()
    }


def wrap(tools: Sequence[BodyTool]) -> BodyTools:
    """Make a Tool of each."""
    return BodyTools(tools)
