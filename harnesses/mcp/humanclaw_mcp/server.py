"""The protocol's side: requests in, content out. What a body does is decided in session.py and the core."""

from __future__ import annotations

import logging
import uuid
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from typing import Any, Final

import anyio
import anyio.to_thread
import jsonschema
import mcp_types as types
from mcp.server import Server
from mcp.server.context import CallNext, HandlerResult, ServerRequestContext
from mcp.shared.exceptions import MCPError
from mcp_types.version import HANDSHAKE_PROTOCOL_VERSIONS

import humanclaw_mcp
from humanclaw.errors import CallError, HumanclawError
from humanclaw.interfaces import Decision
from humanclaw.tools import read_call
from humanclaw_mcp import content
from humanclaw_mcp.bodies import Bodies
from humanclaw_mcp.session import Moment, NewEpisode, Session

logger = logging.getLogger(__name__)

STATE: Final = "humanclaw://body/state"
LOG: Final = "humanclaw://episode/log"
PROMPT: Final = "task"
INSTRUCTIONS: Final = (
    "These tools move a human body in an indoor scene, half a second a call, and answer with what its eyes see. "
    f"Begin with `{content.LOOK}`. The prompt `{PROMPT}` explains the body, its skills and their rules."
)
SESSION_HEADER: Final = "mcp-session-id"

Context = ServerRequestContext[str, Any]


def make_server(bodies: Bodies) -> Server[str]:
    """A server for any transport. Over streams it has one client and one body, over HTTP a body for each session."""
    handlers = _Handlers(bodies)

    @asynccontextmanager
    async def lifespan(_: Server[str]) -> AsyncIterator[str]:
        """Names the only client of a transport that knows no sessions."""
        key = uuid.uuid4().hex
        async with anyio.create_task_group() as tasks:
            tasks.start_soon(bodies.tend)
            try:
                yield key
            finally:
                tasks.cancel_scope.cancel()
                with anyio.CancelScope(shield=True):
                    await bodies.release(key)

    server: Server[str] = Server(
        "humanclaw",
        version=humanclaw_mcp.__version__,
        title="HumanCLAW",
        description="A human body for any tool-calling model.",
        instructions=INSTRUCTIONS,
        lifespan=lifespan,
        on_list_tools=handlers.list_tools,
        on_call_tool=handlers.call_tool,
        on_list_resources=handlers.list_resources,
        on_read_resource=handlers.read_resource,
        on_list_prompts=handlers.list_prompts,
        on_get_prompt=handlers.get_prompt,
    )
    server.middleware.append(_needs_a_session)
    return server


async def _needs_a_session(ctx: Context, call_next: CallNext) -> HandlerResult:
    """Refuse HTTP requests of the sessionless protocol: a body belongs to somebody.

    Clients that speak both fall back to the handshake. Streams have one client each, and need no session.
    """
    if ctx.request is not None and ctx.protocol_version not in HANDSHAKE_PROTOCOL_VERSIONS:
        data = {"supported": list(HANDSHAKE_PROTOCOL_VERSIONS), "requested": ctx.protocol_version}
        text = "over HTTP this server needs a session, since every session has a body of its own; begin with initialize"
        raise MCPError(types.UNSUPPORTED_PROTOCOL_VERSION, text, data)
    return await call_next(ctx)


class _Handlers:
    def __init__(self, bodies: Bodies) -> None:
        self._bodies = bodies
        self._skills = bodies.plugins.skills
        # Made once, so that a skill that cannot be published stops the server and not a client.
        self._tools = content.tools(self._skills.values(), bodies.settings)

    def _session(self, ctx: Context) -> Session:
        who = ctx.session.client_params
        return self._bodies.of(_key(ctx), who.client_info.name[:60] if who else "")

    # -- tools -----------------------------------------------------------------------------------------------------
    async def list_tools(self, ctx: Context, params: types.PaginatedRequestParams | None) -> types.ListToolsResult:
        return types.ListToolsResult(tools=self._tools)

    async def call_tool(self, ctx: Context, params: types.CallToolRequestParams) -> types.CallToolResult:
        """Whatever goes wrong is told in words, for the model to mend or to report."""
        try:
            return await self._call(ctx, params.name, params.arguments or {})
        except (CallError, HumanclawError) as error:
            return content.failure(str(error))
        except Exception:
            logger.exception("the call of %s failed", params.name)
            return content.failure(
                f"{params.name} failed inside the server; its log says why. Call reset and try again."
            )

    async def _call(self, ctx: Context, name: str, arguments: dict[str, Any]) -> types.CallToolResult:
        if name == content.LOOK:
            _hold_to(name, arguments, {"type": "object", "additionalProperties": False})
            return content.result(await _apart(self._session(ctx).look), executed=False)
        if name == content.RESET:
            episode = self._new_episode(_key(ctx), arguments)
            session = self._session(ctx)
            return content.result(await _apart(lambda: session.restart(episode)), executed=False)
        said, call = read_call(name, arguments)
        decision = Decision((call,), **vars(said))
        session = self._session(ctx)
        return content.result(await _apart(lambda: session.call(decision)))

    def _new_episode(self, key: str, arguments: dict[str, Any]) -> NewEpisode:
        settings = self._bodies.settings
        _hold_to(content.RESET, arguments, content.reset_schema(settings))
        session = self._bodies.find(key)
        before = session.episode if session else NewEpisode(settings.instruction, settings.scenes[0], settings.seed)
        return NewEpisode(**(vars(before) | arguments))

    # -- resources -------------------------------------------------------------------------------------------------
    async def list_resources(
        self, ctx: Context, params: types.PaginatedRequestParams | None
    ) -> types.ListResourcesResult:
        state = types.Resource(
            uri=STATE,
            name="body-state",
            title="The body",
            description="Joints, way made, turn, touch: what the body knows of itself, and nothing of the scene.",
            mime_type="application/json",
        )
        log = types.Resource(
            uri=LOG,
            name="episode-log",
            title="The episode so far",
            description="One JSON object a line for each step: what was called, and what became of it.",
            mime_type="application/jsonl",
        )
        return types.ListResourcesResult(resources=[state, log])

    async def read_resource(self, ctx: Context, params: types.ReadResourceRequestParams) -> types.ReadResourceResult:
        if params.uri == STATE:
            moment = await _apart(self._session(ctx).look)
            return _text(STATE, "application/json", content.body_state(moment).model_dump_json(indent=1))
        if params.uri == LOG:
            session = self._bodies.find(_key(ctx))
            return _text(LOG, "application/jsonl", content.log(session.steps if session else ()))
        raise MCPError(types.INVALID_PARAMS, f"there is no resource {params.uri!r}; there are {STATE} and {LOG}")

    # -- prompts ---------------------------------------------------------------------------------------------------
    async def list_prompts(self, ctx: Context, params: types.PaginatedRequestParams | None) -> types.ListPromptsResult:
        argument = types.PromptArgument(name="instruction", description="What the body is to do.", required=False)
        prompt = types.Prompt(
            name=PROMPT,
            title="Have a body",
            description="Explains the body, its skills and their rules, and gives it something to do.",
            arguments=[argument],
        )
        return types.ListPromptsResult(prompts=[prompt])

    async def get_prompt(self, ctx: Context, params: types.GetPromptRequestParams) -> types.GetPromptResult:
        if params.name != PROMPT:
            raise MCPError(types.INVALID_PARAMS, f"there is no prompt {params.name!r}; there is {PROMPT!r}")
        settings = self._bodies.settings
        wanted = (params.arguments or {}).get("instruction") or settings.instruction
        words = content.task(wanted, self._skills.values(), settings)
        message = types.PromptMessage(role="user", content=types.TextContent(text=words))
        return types.GetPromptResult(description="How to live in this body", messages=[message])


def _key(ctx: Context) -> str:
    """Names the session: the transport's own name for it, or that of the connection where there is only one client."""
    if ctx.request is None:
        return ctx.lifespan_context
    return str(ctx.request.headers[SESSION_HEADER])


async def _apart(work: Callable[[], Moment]) -> Moment:
    """Off the event loop: a body takes a second, and other clients shall be heard meanwhile."""
    return await anyio.to_thread.run_sync(work)


def _hold_to(name: str, arguments: dict[str, Any], schema: dict[str, Any]) -> None:
    fault = jsonschema.exceptions.best_match(jsonschema.Draft202012Validator(schema).iter_errors(arguments))
    if fault:
        where = ".".join(map(str, fault.absolute_path))
        raise CallError(f"{name} was not executed: {where + ': ' if where else ''}{fault.message}.")


def _text(uri: str, kind: str, text: str) -> types.ReadResourceResult:
    return types.ReadResourceResult(contents=[types.TextResourceContents(uri=uri, mime_type=kind, text=text)])
