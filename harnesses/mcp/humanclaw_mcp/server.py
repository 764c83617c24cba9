"""The MCP server for any transport: it translates between the protocol and sessions; session.py moves the bodies."""

from __future__ import annotations

import logging
import time
import uuid
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from typing import Any, Final, TypeVar, get_args

import anyio
import anyio.to_thread
import jsonschema
import mcp_types as types
from mcp.server import Server
from mcp.server.context import CallNext, HandlerResult, ServerRequestContext
from mcp.server.subscriptions import InMemorySubscriptionBus, ListenHandler, ResourceUpdated
from mcp.shared.exceptions import MCPError
from mcp_types.version import HANDSHAKE_PROTOCOL_VERSIONS

import humanclaw_mcp
from humanclaw import CallError, Decision, HumanclawError
from humanclaw.skills import read_call
from humanclaw_mcp import content
from humanclaw_mcp.bodies import Bodies
from humanclaw_mcp.content import LOG, LOOK, RESET, STATE, VIEW
from humanclaw_mcp.session import SESSION_HEADER, SESSIONS, Session, Snapshot, Task

logger = logging.getLogger(__name__)

PROMPT: Final = "task"


class Handlers:
    """Answers the requests of every session."""

    def __init__(self, bodies: Bodies) -> None:
        self.bodies = bodies
        self.skills = {name: skill for name, skill in bodies.plugins.skills.items() if skill.trained}
        # Made at the start, so that a skill that cannot be published stops the server and not a client.
        self.tools = content.tools(self.skills.values(), bodies.settings)
        self.resources = content.resources()
        self.bus = InMemorySubscriptionBus()
        self._subscriptions: dict[str, Subscription] = {}

    # -- lists ---------------------------------------------------------------------------------------------------------
    async def list_tools(self, ctx: Context, params: types.PaginatedRequestParams | None) -> types.ListToolsResult:
        return types.ListToolsResult(tools=self.tools)

    async def list_resources(
        self, ctx: Context, params: types.PaginatedRequestParams | None
    ) -> types.ListResourcesResult:
        return types.ListResourcesResult(resources=self.resources)

    async def list_prompts(self, ctx: Context, params: types.PaginatedRequestParams | None) -> types.ListPromptsResult:
        return types.ListPromptsResult(prompts=[content.task_prompt(PROMPT)])

    # -- tools ---------------------------------------------------------------------------------------------------------
    async def call_tool(self, ctx: Context, params: types.CallToolRequestParams) -> types.CallToolResult:
        """Call a tool. Failures become text, which the model can correct or report."""
        try:
            return await self.call(ctx, params.name, params.arguments or {})
        except (CallError, HumanclawError) as error:
            await self.log(ctx, "warning", str(error))
            return content.failure(str(error))
        except Exception:
            logger.exception("the call of %s failed", params.name)
            text = f"{params.name} failed inside the server; its log says why. Call reset and try again."
            await self.log(ctx, "error", text)
            return content.failure(text)

    async def call(self, ctx: Context, name: str, arguments: dict[str, Any]) -> types.CallToolResult:
        """Call a tool. Raises CallError for invalid arguments and HumanclawError if the call is impossible now."""
        if name == LOOK:
            _hold_to(name, arguments, {"type": "object", "additionalProperties": False})
            session = self._session(ctx)
            return content.result(await self._act(ctx, session, session.look), executed=False)
        if name == RESET:
            task = self._new_task(key_of(ctx), arguments)
            session = self._session(ctx)
            return content.result(await self._act(ctx, session, lambda: session.restart(task)), executed=False)
        said, call = read_call(name, arguments)
        decision = Decision((call,), **vars(said))
        session = self._session(ctx)
        return content.result(await self._act(ctx, session, lambda: session.call(decision)))

    def _session(self, ctx: Context) -> Session:
        who = ctx.session.client_params
        asked = ctx.request.query_params.get("body", "") if ctx.request is not None else ""
        return self.bodies.of(key_of(ctx), who.client_info.name[:60] if who else "", asked)

    def _new_task(self, key: str, arguments: dict[str, Any]) -> Task:
        settings = self.bodies.settings
        _hold_to(RESET, arguments, content.reset_schema(settings))
        session = self.bodies.find(key)
        before = session.task if session else Task(settings.instruction, settings.scenes[0], settings.seed)
        return Task(**(vars(before) | arguments))

    async def _act(self, ctx: Context, session: Session, command: Callable[[], Snapshot]) -> Snapshot:
        """Run a command; then log it and announce changed resources to clients that asked for this."""
        before = (session.title, len(session.steps))
        snapshot = await self._run(ctx, session, command)
        if (session.title, len(snapshot.steps)) != before:
            await self._announce(ctx)
        await self.log(ctx, *content.note(snapshot))
        return snapshot

    async def _run(self, ctx: Context, session: Session, command: Callable[[], Snapshot]) -> Snapshot:
        return await run_in_thread(ctx, command, lambda: session.doing, self.bodies.settings.progress_every)

    # -- resources -----------------------------------------------------------------------------------------------------
    async def read_resource(self, ctx: Context, params: types.ReadResourceRequestParams) -> types.ReadResourceResult:
        """Read a resource. Raises MCPError if there is no such resource, or if no body is available."""
        try:
            return types.ReadResourceResult(contents=[await self._read(ctx, params.uri)])
        except HumanclawError as error:
            raise MCPError(types.INTERNAL_ERROR, str(error)) from error

    async def _read(self, ctx: Context, uri: str) -> types.TextResourceContents | types.BlobResourceContents:
        if uri == LOG:
            session = self.bodies.find(key_of(ctx))
            return content.log(session.steps if session else ())
        if uri in (STATE, VIEW):
            session = self._session(ctx)
            snapshot = await self._run(ctx, session, session.look)
            return content.state(snapshot) if uri == STATE else content.view(snapshot)
        raise self._no_resource(uri)

    def _no_resource(self, uri: str) -> MCPError:
        known = ", ".join(resource.uri for resource in self.resources)
        return MCPError(types.INVALID_PARAMS, f"there is no resource {uri!r}; there are {known}")

    async def subscribe(self, ctx: Context, params: types.SubscribeRequestParams) -> types.EmptyResult:
        if params.uri not in {resource.uri for resource in self.resources}:
            raise self._no_resource(params.uri)
        self.subscription(ctx).uris.add(params.uri)
        return types.EmptyResult()

    async def unsubscribe(self, ctx: Context, params: types.UnsubscribeRequestParams) -> types.EmptyResult:
        self.subscription(ctx).uris.discard(params.uri)
        return types.EmptyResult()

    # -- prompts -------------------------------------------------------------------------------------------------------
    async def get_prompt(self, ctx: Context, params: types.GetPromptRequestParams) -> types.GetPromptResult:
        if params.name != PROMPT:
            raise MCPError(types.INVALID_PARAMS, f"there is no prompt {params.name!r}; there is {PROMPT}")
        settings, given = self.bodies.settings, (params.arguments or {}).get("instruction")
        words = content.task(given or settings.instruction, self.skills.values(), settings)
        message = types.PromptMessage(role="user", content=types.TextContent(text=words))
        return types.GetPromptResult(messages=[message])

    async def complete(self, ctx: Context, params: types.CompleteRequestParams) -> types.CompleteResult:
        """Complete the instruction of the prompt: the benchmark's tasks."""
        typed = params.argument.value.lower()
        choices = [task for task in content.INSTRUCTIONS if typed in task.lower()]
        values = sorted(choices, key=lambda task: not task.lower().startswith(typed))
        return types.CompleteResult(completion=types.Completion(values=values, total=len(values), has_more=False))

    # -- notifications -------------------------------------------------------------------------------------------------
    def subscription(self, ctx: Context) -> Subscription:
        return self._subscriptions.setdefault(key_of(ctx), Subscription())

    async def end_session(self, key: str) -> None:
        """Forget what a session asked for, and close its body."""
        self._subscriptions.pop(key, None)
        await self.bodies.release(key)

    @asynccontextmanager
    async def lifespan(self, server: Server[str]) -> AsyncIterator[str]:
        """Close idle bodies while a server runs, and all of them at its end.

        Yields the name of the only client of a transport without sessions.
        """
        async with anyio.create_task_group() as tasks:
            tasks.start_soon(self.bodies.reap_idle)
            try:
                yield uuid.uuid4().hex
            finally:
                tasks.cancel_scope.cancel()
                # Here and not after the server, because uvicorn raises the signal that ended it, and SIGTERM kills.
                with anyio.CancelScope(shield=True):
                    await self.bodies.close()

    async def in_session(self, ctx: Context, call_next: CallNext) -> HandlerResult:
        """Refuse HTTP requests of the sessionless protocol, and close a session's body when its connection ends.

        Clients that speak both protocols fall back to the handshake. A standard stream has one client and needs no
        session.
        """
        if ctx.request is not None and ctx.protocol_version not in HANDSHAKE_PROTOCOL_VERSIONS:
            data = {"supported": list(HANDSHAKE_PROTOCOL_VERSIONS), "requested": ctx.protocol_version}
            words = "over HTTP this server needs a session, as each has a body of its own; begin with initialize"
            raise MCPError(types.UNSUPPORTED_PROTOCOL_VERSION, words, data)
        if ctx.method == "initialize" and ctx.request is not None:
            connection = ctx.session._connection  # The SDK shows its handlers no other way to it.
            connection.exit_stack.push_async_callback(self.end_session, str(connection.session_id))
        return await call_next(ctx)

    async def set_level(self, ctx: Context, params: types.SetLevelRequestParams) -> types.EmptyResult:
        self.subscription(ctx).level = params.level
        return types.EmptyResult()

    async def log(self, ctx: Context, level: types.LoggingLevel, words: str) -> None:
        """Send a log message, on the stream of its request, to a client that asked for this level."""
        least = self.subscription(ctx).level
        if least is None or LEVELS.index(level) < LEVELS.index(least):
            return
        params = types.LoggingMessageNotificationParams(level=level, logger=_LOGGER, data=words)
        await ctx.session.send_notification(types.LoggingMessageNotification(params=params), ctx.request_id)

    async def _announce(self, ctx: Context) -> None:
        """Announce the resources that a step changes, in the way of the client's protocol version."""
        for uri in content.BODY_RESOURCES:
            if ctx.protocol_version not in HANDSHAKE_PROTOCOL_VERSIONS:
                await self.bus.publish(ResourceUpdated(uri=uri))
            elif uri in self.subscription(ctx).uris:
                await ctx.session.send_resource_updated(uri)


def key_of(ctx: Context) -> str:
    """Return the session's name: from the HTTP header, or from the connection if it has one client."""
    if ctx.request is None:
        return ctx.lifespan_context
    return str(ctx.request.headers[SESSION_HEADER])


def _hold_to(name: str, arguments: dict[str, Any], schema: dict[str, Any]) -> None:
    fault = jsonschema.exceptions.best_match(jsonschema.Draft202012Validator(schema).iter_errors(arguments))
    if fault:
        where = ".".join(map(str, fault.absolute_path))
        raise CallError(f"{name} was not executed: {where + ': ' if where else ''}{fault.message[:300]}.")


# -- notifications -----------------------------------------------------------------------------------------------------
Context = ServerRequestContext[str, Any]
T = TypeVar("T")
LEVELS: Final[tuple[types.LoggingLevel, ...]] = get_args(types.LoggingLevel)
"""From the least to the most severe."""
_LOGGER: Final = "humanclaw"


@dataclass
class Subscription:
    """The notifications that a session asked for."""

    level: types.LoggingLevel | None = None
    """Least severity of log messages; None for no messages."""
    uris: set[str] = field(default_factory=set)


async def run_in_thread(ctx: Context, work: Callable[[], T], doing: Callable[[], str], every: float) -> T:
    """Run work on a thread, so that the event loop serves other clients meanwhile. Raises what the work raises.

    A client with a progress token gets a message at once and then at intervals: the seconds so far and `doing()`.
    """
    began = time.monotonic()

    async def report() -> None:
        while True:
            await ctx.session.report_progress(round(time.monotonic() - began, 3), message=doing())
            await anyio.sleep(every)

    async with anyio.create_task_group() as tasks:
        tasks.start_soon(report)
        outcome = await anyio.to_thread.run_sync(_caught(work))
        tasks.cancel_scope.cancel()
    if isinstance(outcome, Exception):
        raise outcome
    return outcome


def _caught(work: Callable[[], T]) -> Callable[[], T | Exception]:
    """Make the work return its error: raised inside a task group, it would become an exception group."""

    def run() -> T | Exception:
        try:
            return work()
        except Exception as error:
            return error

    return run


INSTRUCTIONS: Final = (
    "These tools move a human body in an indoor scene, half a second a call, and answer with what its eyes see. "
    f"Begin with `{LOOK}`. The prompt `{PROMPT}` explains the body, its skills and their rules."
)


def make_server(handlers: Handlers) -> Server[str]:
    """Return a server for any transport: one body over standard streams, one for each session over HTTP."""
    server: Server[str] = Server(
        "humanclaw",
        version=humanclaw_mcp.__version__,
        title="HumanCLAW",
        description="A human body for any tool-calling model.",
        instructions=INSTRUCTIONS,
        lifespan=handlers.lifespan,
        on_list_tools=handlers.list_tools,
        on_call_tool=handlers.call_tool,
        on_list_resources=handlers.list_resources,
        on_read_resource=handlers.read_resource,
        on_subscribe_resource=handlers.subscribe,
        on_unsubscribe_resource=handlers.unsubscribe,
        on_subscriptions_listen=ListenHandler(handlers.bus, max_subscriptions=SESSIONS),
        on_list_prompts=handlers.list_prompts,
        on_get_prompt=handlers.get_prompt,
        on_completion=handlers.complete,
    )
    # Added here because the constructor would warn: the newest protocol version lacks this request, older ones have it.
    server.add_request_handler("logging/setLevel", types.SetLevelRequestParams, handlers.set_level)
    server.middleware.append(handlers.in_session)
    return server
