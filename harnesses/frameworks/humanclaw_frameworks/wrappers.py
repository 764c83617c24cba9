"""One function for each framework: the tools of a body as the framework's own objects.

Each imports its framework inside, because none is required and each takes seconds. A result is text and the view; a
refused call has text alone.
"""

from __future__ import annotations

import asyncio
import io
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from PIL import Image

from humanclaw.skills import BodyTool, ToolResult, in_format

if TYPE_CHECKING:
    from agents import FunctionTool
    from anthropic.lib.tools import BetaFunctionTool
    from google.genai import types
    from langchain_core.tools import StructuredTool
    from pydantic_ai import Tool as PydanticTool

Json = dict[str, Any]


# -- clients that leave the calls to the caller ------------------------------------------------------------------------
class AnsweringTools(list[Any]):
    """A tool list that also executes calls."""

    def __init__(self, specs: Sequence[Any], tools: Sequence[BodyTool]) -> None:
        super().__init__(specs)
        self._tools = {tool.name: tool for tool in tools}

    def run(self, name: str | None, arguments: str | Mapping[str, Any]) -> ToolResult:
        """Execute a call; an unknown name is answered in text."""
        if name not in self._tools:
            return ToolResult(f"There is no tool {name!r}; there are {', '.join(self._tools)}.")
        return self._tools[name].run(arguments)


class OpenAITools(AnsweringTools):
    """The list for `tools=` of chat completions, the API of most model servers.

    message = client.chat.completions.create(model=..., messages=messages, tools=tools).choices[0].message
    messages += [message, *tools.answer(message)]
    """

    def answer(self, message: Any) -> list[Json]:
        """Execute the calls of a message in order; return the messages that answer it, none without a call.

        message: the client's object, or the same as a dictionary.
        A tool message holds only text, so the pictures follow in a user message, which more models read.
        """
        results = [(_of(call, "id"), self._call(_of(call, "function"))) for call in _of(message, "tool_calls") or ()]
        texts = [{"role": "tool", "tool_call_id": key, "content": result.text} for key, result in results]
        pictures = [
            {"type": "image_url", "image_url": {"url": result.data_url}} for _, result in results if result.picture
        ]
        return [*texts, {"role": "user", "content": pictures}] if pictures else texts

    def _call(self, function: Any) -> ToolResult:
        return self.run(_of(function, "name"), _of(function, "arguments"))


def _of(value: Any, name: str) -> Any:
    """Return a field of an object or of a dictionary."""
    return value.get(name) if isinstance(value, Mapping) else getattr(value, name)


def openai(tools: Sequence[BodyTool]) -> OpenAITools:
    """Make the tool list."""
    return OpenAITools(in_format([tool.spec for tool in tools], "openai"), tools)


class GoogleTools(AnsweringTools):
    """A list of types.Tool.

    response = client.models.generate_content(model=..., contents=contents, config=GenerateContentConfig(tools=tools))
    contents += [response.candidates[0].content, *tools.answer(response)]
    """

    def answer(self, response: types.GenerateContentResponse | Mapping[str, Any]) -> list[types.Content]:
        """Execute the calls of a response in order; return the contents that answer it, none without a call.

        response: the client's object, or the same as a dictionary.

        Pictures are a content of their own: only the newest models read pictures within a function's response.
        """
        from google.genai import types

        if isinstance(response, Mapping):
            response = types.GenerateContentResponse.model_validate(response)
        results = [(call, self.run(call.name, call.args or {})) for call in response.function_calls or ()]
        texts = [_response(call, result) for call, result in results]
        pictures = [
            types.Part.from_bytes(data=result.picture, mime_type="image/jpeg")
            for _, result in results
            if result.picture
        ]
        return [types.Content(role="user", parts=parts) for parts in (texts, pictures) if parts]


def _response(call: types.FunctionCall, result: ToolResult) -> types.Part:
    from google.genai import types

    response = {"output" if result.picture else "error": result.text}
    return types.Part(function_response=types.FunctionResponse(id=call.id, name=call.name, response=response))


def google(tools: Sequence[BodyTool]) -> GoogleTools:
    """Make the tool list."""
    from google.genai import types

    return GoogleTools(
        [types.Tool.model_validate(spec) for spec in in_format([t.spec for t in tools], "gemini")], tools
    )


# -- frameworks that call the tools ------------------------------------------------------------------------------------
def anthropic(tools: Sequence[BodyTool]) -> list[BetaFunctionTool[Any]]:
    """Make a runnable tool of each. `to_dict()` is the tool for messages.create, `call(block.input)` its result.

    runner = client.beta.messages.tool_runner(tools=tools, model=..., messages=messages, max_tokens=4096)
    runner.until_done()
    """
    return [_anthropic(tool) for tool in tools]


def _anthropic(tool: BodyTool) -> BetaFunctionTool[Any]:
    from anthropic import beta_tool
    from anthropic.lib.tools import ToolError

    (spec,) = in_format([tool.spec], "anthropic")

    def call(**arguments: Any) -> Any:  # Evaluated by the SDK, which knows no import of this file.
        result = tool(**arguments)
        if not result.picture:
            raise ToolError(result.text)
        return [
            {"type": "text", "text": result.text},
            {"type": "image", "source": {"type": "base64", "media_type": "image/jpeg", "data": result.base64}},
        ]

    return beta_tool(name=tool.name, description=tool.description, input_schema=spec["input_schema"])(call)


def pydantic_ai(tools: Sequence[BodyTool]) -> list[PydanticTool[Any]]:
    """Make a Tool of each, for Agent(model, tools=...). A result is its text and the picture."""
    return [_pydantic_ai(tool) for tool in tools]


def _pydantic_ai(tool: BodyTool) -> PydanticTool[Any]:
    from pydantic_ai import BinaryContent, Tool

    def call(**arguments: Any) -> Any:
        result = tool(**arguments)
        return [result.text, BinaryContent(result.picture, media_type="image/jpeg")] if result.picture else result.text

    return Tool.from_schema(call, tool.name, tool.description, tool.parameters, sequential=True)


def langchain(tools: Sequence[BodyTool]) -> list[StructuredTool]:
    """Make a StructuredTool of each, for create_agent(model, tools). A result is a list of content blocks.

    A refused call becomes a ToolMessage with status "error".
    """
    return [_langchain(tool) for tool in tools]


def _langchain(tool: BodyTool) -> StructuredTool:
    from langchain_core.tools import StructuredTool, ToolException

    def call(**arguments: Any) -> list[Json]:
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


def openai_agents(tools: Sequence[BodyTool]) -> list[FunctionTool]:
    """Make a FunctionTool of each. The schemas are not strict: strict mode has no optional parameters."""
    return [_openai_agents(tool) for tool in tools]


def _openai_agents(tool: BodyTool) -> FunctionTool:
    from agents import FunctionTool, ToolOutputImage, ToolOutputText

    async def call(_: Any, arguments: str) -> Any:
        result = await asyncio.to_thread(tool.run, arguments)
        if not result.picture:
            return result.text
        return [ToolOutputText(text=result.text), ToolOutputImage(image_url=result.data_url)]

    return FunctionTool(tool.name, tool.description, tool.parameters, call, strict_json_schema=False)


# -- smolagents: its tools return only text to the model, and a callback adds the pictures -----------------------------
class SmolagentsTools(list[Any]):
    """The tools, and the callback `see`: ToolCallingAgent(tools, model, step_callbacks=[tools.see])."""

    def __init__(self, tools: Sequence[BodyTool]) -> None:
        self._seen: list[bytes] = []
        super().__init__(_smolagents(tool, self._seen) for tool in tools)

    def see(self, step: Any, agent: Any = None) -> None:
        """Add the views of a step to its observations: a callback for `step_callbacks`."""
        if self._seen:
            step.observations_images = [Image.open(io.BytesIO(picture)) for picture in self._seen]
            self._seen.clear()


def _smolagents(tool: BodyTool, seen: list[bytes]) -> Any:
    from smolagents import Tool

    def forward(self: Any, **arguments: Any) -> str:
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


def _inputs(tool: BodyTool) -> Json:
    """Return the inputs: smolagents marks optional ones as nullable, and requires a description of each."""
    required = set(tool.parameters.get("required", ()))
    return {
        key: {"description": key, **part, **({} if key in required else {"nullable": True})}
        for key, part in tool.parameters["properties"].items()
    }


smolagents = SmolagentsTools
