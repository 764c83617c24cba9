"""Handlers of MCP requests. They translate between the protocol and sessions; session.py moves the bodies."""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Any, Final

import jsonschema
import mcp_types as types
from mcp.server.subscriptions import InMemorySubscriptionBus
from mcp.shared.exceptions import MCPError

from humanclaw import CallError, Decision, HumanclawError
from humanclaw.skills import read_call
from humanclaw_mcp import content, telling
from humanclaw_mcp.bodies import Bodies
from humanclaw_mcp.session import Session, Snapshot, Task
from humanclaw_mcp.settings import SESSION_HEADER, SESSIONS
from humanclaw_mcp.telling import Context, Subscription

logger = logging.getLogger(__name__)

PROMPT: Final = "task"


class Handlers:
    """Answers the requests of every session. Tools, resources and prompts are lists that a subclass may extend."""

    def __init__(self, bodies: Bodies) -> None:
        self.bodies = bodies
        self.skills = {name: skill for name, skill in bodies.plugins.skills.items() if skill.trained}
        # Made at the start, so that a skill that cannot be published stops the server and not a client.
        self.tools = content.tools(self.skills.values(), bodies.settings)
        self.resources = content.resources()
        self.templates = [content.skill_template()]
        self.prompts = [content.task_prompt(PROMPT)]
        self.bus = InMemorySubscriptionBus()
        self._subscriptions = telling.Subscriptions(SESSIONS)

    # -- lists ---------------------------------------------------------------------------------------------------------
    async def list_tools(self, ctx: Context, params: types.PaginatedRequestParams | None) -> types.ListToolsResult:
        return types.ListToolsResult(tools=self.tools)

    async def list_resources(
        self, ctx: Context, params: types.PaginatedRequestParams | None
    ) -> types.ListResourcesResult:
        return types.ListResourcesResult(resources=self.resources)

    async def list_resource_templates(
        self, ctx: Context, params: types.PaginatedRequestParams | None
    ) -> types.ListResourceTemplatesResult:
        return types.ListResourceTemplatesResult(resource_templates=self.templates)

    async def list_prompts(self, ctx: Context, params: types.PaginatedRequestParams | None) -> types.ListPromptsResult:
        return types.ListPromptsResult(prompts=self.prompts)

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
        if name == content.LOOK:
            _hold_to(name, arguments, {"type": "object", "additionalProperties": False})
            session = self._session(ctx)
            return content.result(await self._act(ctx, session, session.look), executed=False)
        if name == content.RESET:
            task = self._new_task(key_of(ctx), arguments)
            session = self._session(ctx)
            return content.result(await self._act(ctx, session, lambda: session.restart(task)), executed=False)
        said, call = read_call(name, arguments)
        decision = Decision((call,), **vars(said))
        session = self._session(ctx)
        return content.result(await self._act(ctx, session, lambda: session.call(decision)))

    def _session(self, ctx: Context) -> Session:
        who = ctx.session.client_params
        return self.bodies.of(key_of(ctx), who.client_info.name[:60] if who else "")

    def _new_task(self, key: str, arguments: dict[str, Any]) -> Task:
        settings = self.bodies.settings
        _hold_to(content.RESET, arguments, content.reset_schema(settings))
        session = self.bodies.find(key)
        before = session.task if session else Task(settings.instruction, settings.scenes[0], settings.seed)
        return Task(**(vars(before) | arguments))

    async def _act(self, ctx: Context, session: Session, command: Callable[[], Snapshot]) -> Snapshot:
        """Run a command; then log it and announce changed resources to clients that asked for this."""
        before = (session.title, len(session.steps))
        snapshot = await self._apart(ctx, session, command)
        if (session.title, len(snapshot.steps)) != before:
            await telling.changed(ctx, self.subscription(ctx), self.bus, content.BODY_RESOURCES)
        await self.log(ctx, *content.note(snapshot))
        return snapshot

    async def _apart(self, ctx: Context, session: Session, command: Callable[[], Snapshot]) -> Snapshot:
        return await telling.apart(ctx, command, lambda: session.doing, self.bodies.settings.tell_every)

    # -- resources -----------------------------------------------------------------------------------------------------
    async def read_resource(self, ctx: Context, params: types.ReadResourceRequestParams) -> types.ReadResourceResult:
        """Read a resource. Raises MCPError if there is no such resource, or if no body is available."""
        try:
            return types.ReadResourceResult(contents=[await self.read(ctx, params.uri)])
        except HumanclawError as error:
            raise MCPError(types.INTERNAL_ERROR, str(error)) from error

    async def read(self, ctx: Context, uri: str) -> types.TextResourceContents | types.BlobResourceContents:
        if uri == content.LOG:
            session = self.bodies.find(key_of(ctx))
            return content.log(session.steps if session else ())
        if uri in (content.STATE, content.VIEW):
            session = self._session(ctx)
            snapshot = await self._apart(ctx, session, session.look)
            return content.state(snapshot) if uri == content.STATE else content.view(snapshot)
        skill = self.skills.get(uri.removeprefix(content.SKILL))
        if not uri.startswith(content.SKILL) or skill is None:
            raise self._no_resource(uri)
        return content.skill_sheet(skill)

    def _no_resource(self, uri: str) -> MCPError:
        known = [*(resource.uri for resource in self.resources), *(each.uri_template for each in self.templates)]
        return MCPError(types.INVALID_PARAMS, f"there is no resource {uri!r}; there are {', '.join(known)}")

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
        messages = self.prompt(params.name, params.arguments or {})
        if messages is None:
            known = ", ".join(prompt.name for prompt in self.prompts)
            raise MCPError(types.INVALID_PARAMS, f"there is no prompt {params.name!r}; there is {known}")
        return types.GetPromptResult(messages=messages)

    def prompt(self, name: str, arguments: dict[str, str]) -> list[types.PromptMessage] | None:
        """Return the messages of a prompt; None for an unknown name."""
        if name != PROMPT:
            return None
        settings = self.bodies.settings
        words = content.task(arguments.get("instruction") or settings.instruction, self.skills.values(), settings)
        return [types.PromptMessage(role="user", content=types.TextContent(text=words))]

    async def complete(self, ctx: Context, params: types.CompleteRequestParams) -> types.CompleteResult:
        """Complete an argument: instructions for the prompt, skill names for resources."""
        choices = content.INSTRUCTIONS if isinstance(params.ref, types.PromptReference) else tuple(self.skills)
        typed = params.argument.value.lower()
        values = sorted((c for c in choices if typed in c.lower()), key=lambda c: not c.lower().startswith(typed))
        return types.CompleteResult(completion=types.Completion(values=values, total=len(values), has_more=False))

    # -- notifications -------------------------------------------------------------------------------------------------
    def subscription(self, ctx: Context) -> Subscription:
        return self._subscriptions.of(key_of(ctx))

    async def set_level(self, ctx: Context, params: types.SetLevelRequestParams) -> types.EmptyResult:
        self.subscription(ctx).level = params.level
        return types.EmptyResult()

    async def log(self, ctx: Context, level: types.LoggingLevel, words: str) -> None:
        """Send a log message to a client that asked for this level."""
        await telling.log(ctx, self.subscription(ctx), level, words)


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
