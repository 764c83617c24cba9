"""A tool of one body, as an agent framework wraps it."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final

from humanclaw.skills.tool_schemas import Json
from humanclaw.storage.pictures import data_url, in_base64

LOOK: Final = "look"
"""Name of the tool that sees and does not move."""


@dataclass(frozen=True)
class ToolResult:
    """The result of a call: feedback in words, and the current view."""

    text: str
    picture: bytes = b""
    """A JPEG of 512 x 512; empty if the call was refused, since nothing has moved."""

    @property
    def base64(self) -> str:
        """The picture in base64; empty if there is none."""
        return in_base64(self.picture)

    @property
    def data_url(self) -> str:
        """The picture as a data URL; empty if there is none."""
        return data_url(self.picture) if self.picture else ""


@dataclass(frozen=True)
class BodyTool:
    """A tool of one body, for an agent framework to wrap in its own objects (hook humanclaw_frameworks).

    Calling it is safe from any thread. A fault that a model can correct raises nothing: the result is a refusal in
    words.
    """

    name: str
    description: str
    parameters: Json
    """JSON Schema of an object, without $ref, anyOf, oneOf and allOf."""
    run: Callable[[str | Mapping[str, Any]], ToolResult]
    """Arguments, an object or the JSON text of one, to the result."""

    @property
    def spec(self) -> Json:
        """Name, description and parameters, as in_format takes them."""
        return {"name": self.name, "description": self.description, "parameters": self.parameters}

    def __call__(self, **arguments: Any) -> ToolResult:
        """Call the tool with its parameters by name."""
        return self.run(arguments)

    async def acall(self, **arguments: Any) -> ToolResult:
        """Do the same in a thread, so that an event loop goes on."""
        return await asyncio.to_thread(self.run, arguments)
