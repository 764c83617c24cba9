"""The product's server with the fixtures of the official suite: python harnesses/mcp/conformance/server.py

The fixtures are only answers. Sessions, streams, progress, log messages, subscriptions and errors are those of
`humanclaw mcp`: its handlers with longer lists, served by its own function for HTTP, with the body and its skills.
"""

from __future__ import annotations

import base64
import io
import json
import time
import wave
from typing import Any

import anyio
import click
import mcp_types as types
from mcp.shared.message import ServerMessageMetadata
from PIL import Image

from humanclaw import HumanclawError
from humanclaw_mcp.bodies import Bodies
from humanclaw_mcp.handlers import Handlers
from humanclaw_mcp.serve import serve_http
from humanclaw_mcp.settings import Settings
from humanclaw_mcp.telling import Context, apart

TELL_EVERY = 0.05
"""Seconds between two progress messages: the suite's calls are short."""
DIALECT = "https://json-schema.org/draft/2020-12/schema"
ADDRESS = {"type": "object", "properties": {"street": {"type": "string"}, "city": {"type": "string"}}}
SCHEMA_2020_12 = {
    "$schema": DIALECT,
    "type": "object",
    "$defs": {"address": ADDRESS},
    "properties": {"name": {"type": "string"}, "address": {"$ref": "#/$defs/address"}},
    "additionalProperties": False,
}
CONTACT = {
    "type": "object",
    "properties": {
        "username": {"type": "string", "description": "User's response"},
        "email": {"type": "string", "description": "User's email address"},
    },
    "required": ["username", "email"],
}
DEFAULTS = {
    "type": "object",
    "properties": {
        "name": {"type": "string", "default": "John Doe"},
        "age": {"type": "integer", "default": 30},
        "score": {"type": "number", "default": 95.5},
        "status": {"type": "string", "enum": ["active", "inactive", "pending"], "default": "active"},
        "verified": {"type": "boolean", "default": True},
    },
}


def titled(*names: str) -> list[dict[str, str]]:
    return [{"const": f"value{number}", "title": name} for number, name in enumerate(names, 1)]


OPTIONS = ["option1", "option2", "option3"]
ENUMS = {
    "type": "object",
    "properties": {
        "untitledSingle": {"type": "string", "enum": OPTIONS},
        "titledSingle": {"type": "string", "oneOf": titled("First Option", "Second Option", "Third Option")},
        "legacyEnum": {
            "type": "string",
            "enum": ["opt1", "opt2", "opt3"],
            "enumNames": ["Option One", "Option Two", "Option Three"],
        },
        "untitledMulti": {"type": "array", "items": {"type": "string", "enum": OPTIONS}},
        "titledMulti": {"type": "array", "items": {"anyOf": titled("First Choice", "Second Choice", "Third Choice")}},
    },
}
ELICITATIONS = {
    "test_elicitation": CONTACT,
    "test_elicitation_sep1034_defaults": DEFAULTS,
    "test_elicitation_sep1330_enums": ENUMS,
}


# -- content -----------------------------------------------------------------------------------------------------------
def text(words: str) -> types.TextContent:
    return types.TextContent(text=words)


def png() -> str:
    """One red pixel."""
    buffer = io.BytesIO()
    Image.new("RGB", (1, 1), "red").save(buffer, "PNG")
    return base64.b64encode(buffer.getvalue()).decode()


def wav() -> str:
    """Return a hundredth of a second of silence."""
    buffer = io.BytesIO()
    with wave.open(buffer, "wb") as sound:
        sound.setparams((1, 2, 8000, 0, "NONE", "not compressed"))
        sound.writeframes(bytes(160))
    return base64.b64encode(buffer.getvalue()).decode()


def image() -> types.ImageContent:
    return types.ImageContent(data=png(), mime_type="image/png")


def embedded(uri: str, kind: str, words: str) -> types.EmbeddedResource:
    return types.EmbeddedResource(resource=types.TextResourceContents(uri=uri, mime_type=kind, text=words))


CONTENTS: dict[str, list[Any]] = {
    "test_simple_text": [text("This is a simple text response for testing.")],
    "test_image_content": [image()],
    "test_audio_content": [types.AudioContent(data=wav(), mime_type="audio/wav")],
    "test_embedded_resource": [
        embedded("test://embedded-resource", "text/plain", "This is an embedded resource content.")
    ],
    "test_multiple_content_types": [
        text("Multiple content types test:"),
        image(),
        embedded("test://mixed-content-resource", "application/json", '{"test":"data","value":123}'),
    ],
    "json_schema_2020_12_tool": [text("{}")],
}
RESOURCES: dict[str, types.TextResourceContents | types.BlobResourceContents] = {
    "test://static-text": types.TextResourceContents(
        uri="test://static-text", mime_type="text/plain", text="This is the content of the static text resource."
    ),
    "test://static-binary": types.BlobResourceContents(uri="test://static-binary", mime_type="image/png", blob=png()),
    "test://watched-resource": types.TextResourceContents(
        uri="test://watched-resource", mime_type="text/plain", text="Watched."
    ),
}
PROMPTS = {
    "test_simple_prompt": (),
    "test_prompt_with_arguments": ("arg1", "arg2"),
    "test_prompt_with_embedded_resource": ("resourceUri",),
    "test_prompt_with_image": (),
}


# -- the server --------------------------------------------------------------------------------------------------------
class Fixtures(Handlers):
    """The product's handlers with the suite's fixtures in their lists."""

    def __init__(self, bodies: Bodies) -> None:
        super().__init__(bodies)
        acting = ("test_error_handling", "test_tool_with_logging", "test_tool_with_progress", "test_reconnection")
        plain = [*CONTENTS, *ELICITATIONS, *acting, "test_sampling"]
        self.tools = [*self.tools, *(tool(name) for name in plain)]
        self.resources = [*self.resources, *(types.Resource(uri=uri, name=uri) for uri in RESOURCES)]
        template = types.ResourceTemplate(uri_template="test://template/{id}/data", name="template")
        self.templates = [*self.templates, template]
        self.prompts = [*self.prompts, *(prompt(name, arguments) for name, arguments in PROMPTS.items())]

    async def call(self, ctx: Context, name: str, arguments: dict[str, Any]) -> types.CallToolResult:
        if name in CONTENTS:
            return types.CallToolResult(content=CONTENTS[name])
        if name in ELICITATIONS:
            return await self._elicit(ctx, arguments.get("message", "Please answer."), ELICITATIONS[name])
        acting = {
            "test_error_handling": self._fail,
            "test_tool_with_logging": self._log,
            "test_tool_with_progress": self._progress,
            "test_reconnection": self._reconnect,
            "test_sampling": self._sample,
        }
        if name in acting:
            return await acting[name](ctx, arguments)
        return await super().call(ctx, name, arguments)

    async def _fail(self, ctx: Context, arguments: dict[str, Any]) -> types.CallToolResult:
        raise HumanclawError("This tool intentionally returns an error for testing")

    async def _log(self, ctx: Context, arguments: dict[str, Any]) -> types.CallToolResult:
        for words in ("Tool execution started", "Tool processing data", "Tool execution completed"):
            await self.log(ctx, "info", words)
            await anyio.sleep(0.05)
        return said("Logged three times.")

    async def _progress(self, ctx: Context, arguments: dict[str, Any]) -> types.CallToolResult:
        await apart(ctx, lambda: time.sleep(4 * TELL_EVERY), lambda: "Sleeping.", TELL_EVERY)
        return said("Done.")

    async def _reconnect(self, ctx: Context, arguments: dict[str, Any]) -> types.CallToolResult:
        if ctx.close_sse_stream:
            await ctx.close_sse_stream()
        await anyio.sleep(0.1)
        return said("The stream was closed while this call was under way.")

    async def _sample(self, ctx: Context, arguments: dict[str, Any]) -> types.CallToolResult:
        question = types.SamplingMessage(role="user", content=text(arguments["prompt"]))
        params = types.CreateMessageRequestParams(messages=[question], max_tokens=100)
        request = types.CreateMessageRequest(params=params)
        # On the stream of this call, because a client may have no other open.
        metadata = ServerMessageMetadata(related_request_id=ctx.request_id)
        answer = await ctx.session.send_request(request, types.CreateMessageResult, metadata=metadata)
        return said(f"LLM response: {getattr(answer.content, 'text', '')}")

    async def _elicit(self, ctx: Context, message: str, schema: dict[str, Any]) -> types.CallToolResult:
        answer = await ctx.session.elicit_form(message, schema, related_request_id=ctx.request_id)
        return said(f"Elicitation completed: action={answer.action}, content={json.dumps(answer.content)}")

    async def read(self, ctx: Context, uri: str) -> types.TextResourceContents | types.BlobResourceContents:
        if uri in RESOURCES:
            return RESOURCES[uri]
        if uri.startswith("test://template/") and uri.endswith("/data"):
            name = uri.split("/")[3]
            words = json.dumps({"id": name, "templateTest": True, "data": f"Data for ID: {name}"})
            return types.TextResourceContents(uri=uri, mime_type="application/json", text=words)
        return await super().read(ctx, uri)

    def prompt(self, name: str, arguments: dict[str, str]) -> list[types.PromptMessage] | None:
        contents: dict[str, list[Any]] = {
            "test_simple_prompt": [text("This is a simple prompt for testing.")],
            "test_prompt_with_arguments": [
                text(f"Prompt with arguments: arg1='{arguments.get('arg1')}', arg2='{arguments.get('arg2')}'")
            ],
            "test_prompt_with_embedded_resource": [
                embedded(arguments.get("resourceUri", ""), "text/plain", "Embedded resource content for testing."),
                text("Please process the embedded resource above."),
            ],
            "test_prompt_with_image": [image(), text("Please analyze the image above.")],
        }
        if name not in contents:
            return super().prompt(name, arguments)
        return [types.PromptMessage(role="user", content=part) for part in contents[name]]


def tool(name: str) -> types.Tool:
    wanted = {"test_sampling": "prompt", "test_elicitation": "message"}.get(name)
    schema: dict[str, Any] = {"type": "object", "properties": {wanted: {"type": "string"}} if wanted else {}}
    schema |= {"required": [wanted]} if wanted else {}
    return types.Tool(
        name=name,
        description="A fixture of the conformance suite.",
        input_schema=SCHEMA_2020_12 if name.startswith("json_schema") else schema,
    )


def prompt(name: str, arguments: tuple[str, ...]) -> types.Prompt:
    listed = [types.PromptArgument(name=each, required=True) for each in arguments]
    return types.Prompt(name=name, description="A fixture of the conformance suite.", arguments=listed)


def said(words: str) -> types.CallToolResult:
    return types.CallToolResult(content=[text(words)])


if __name__ == "__main__":
    fixtures = Fixtures(Bodies(Settings(tell_every=TELL_EVERY)))
    anyio.run(serve_http, fixtures, 0, lambda url: click.echo(f"Listening on {url}", err=True))
