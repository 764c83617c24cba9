"""The MCP server for any transport, and the requests that it refuses."""

from __future__ import annotations

import uuid
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Final

import anyio
import mcp_types as types
from mcp.server import Server
from mcp.server.context import CallNext, HandlerResult
from mcp.server.subscriptions import ListenHandler
from mcp.shared.exceptions import MCPError
from mcp_types.version import HANDSHAKE_PROTOCOL_VERSIONS

import humanclaw_mcp
from humanclaw_mcp.content import LOOK
from humanclaw_mcp.handlers import PROMPT, Handlers
from humanclaw_mcp.settings import SESSIONS
from humanclaw_mcp.telling import Context

INSTRUCTIONS: Final = (
    "These tools move a human body in an indoor scene, half a second a call, and answer with what its eyes see. "
    f"Begin with `{LOOK}`. The prompt `{PROMPT}` explains the body, its skills and their rules."
)


def make_server(handlers: Handlers) -> Server[str]:
    """Return a server for any transport: one body over standard streams, one for each session over HTTP."""
    bodies = handlers.bodies

    @asynccontextmanager
    async def lifespan(_: Server[str]) -> AsyncIterator[str]:
        """Yield the name of the only client of a transport without sessions."""
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
        on_list_resource_templates=handlers.list_resource_templates,
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
    server.middleware.append(_needs_a_session)
    return server


async def _needs_a_session(ctx: Context, call_next: CallNext) -> HandlerResult:
    """Refuse HTTP requests of the sessionless protocol: each body belongs to a session.

    Clients that speak both protocols fall back to the handshake. A standard stream has one client and needs no session.
    """
    if ctx.request is not None and ctx.protocol_version not in HANDSHAKE_PROTOCOL_VERSIONS:
        data = {"supported": list(HANDSHAKE_PROTOCOL_VERSIONS), "requested": ctx.protocol_version}
        text = "over HTTP this server needs a session, since every session has a body of its own; begin with initialize"
        raise MCPError(types.UNSUPPORTED_PROTOCOL_VERSION, text, data)
    return await call_next(ctx)
