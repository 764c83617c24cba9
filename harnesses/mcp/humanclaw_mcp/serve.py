"""The two transports: standard streams, and streamable HTTP for this machine only."""

from __future__ import annotations

import asyncio
import hmac
import os
import signal
import socket
import sys
from collections.abc import Callable
from contextlib import ExitStack
from typing import Final

import anyio
import h11
import uvicorn
from mcp.server.auth.middleware.bearer_auth import BearerAuthBackend, RequireAuthMiddleware
from mcp.server.auth.provider import AccessToken
from mcp.server.stdio import stdio_server
from mcp.server.streamable_http_manager import StreamableHTTPASGIApp
from mcp.server.transport_security import TransportSecuritySettings
from starlette.applications import Starlette
from starlette.middleware.authentication import AuthenticationMiddleware
from starlette.routing import Route
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from uvicorn.protocols.http.h11_impl import H11Protocol

from humanclaw.cli import BACKLOG, CONNECTIONS, HOST, REQUEST_SECONDS, leave, listening
from humanclaw_mcp.bodies import Bodies
from humanclaw_mcp.events import SessionManager
from humanclaw_mcp.handlers import Handlers
from humanclaw_mcp.server import make_server
from humanclaw_mcp.settings import SESSION_HEADER, SESSIONS

PATH: Final = "/mcp"
_BODY_BYTES: Final = 256 * 1024
"""Longest request, bytes: a request holds a call and no file."""
_RETRY: Final = 1000
"""Milliseconds after which a client should resume a stream that was cut."""


async def serve_stdio(handlers: Handlers) -> None:
    """Serve the client on the standard streams until it disconnects, or until a signal."""
    server = make_server(handlers)
    async with anyio.create_task_group() as tasks:
        if os.name != "nt":  # Windows has no such signals.
            tasks.start_soon(_end_by_signal, handlers.bodies)
        async with stdio_server() as (reading, writing):
            await server.run(reading, writing, server.create_initialization_options())
        tasks.cancel_scope.cancel()


async def _end_by_signal(bodies: Bodies) -> None:
    """Close the records at the first signal, and exit.

    At once, because Python would wait for the thread that reads the client's next line, and nothing can wake it.
    """
    with anyio.open_signal_receiver(signal.SIGTERM, signal.SIGINT) as signals:
        async for number in signals:
            await bodies.close()
            print("Stopped.", file=sys.stderr, flush=True)
            leave(128 + number)


async def serve_http(handlers: Handlers, port: int, announce: Callable[[str], None] = lambda url: None) -> None:
    """Serve until interrupted. announce: gets the URL. Raises HumanclawError if the port is taken."""
    with ExitStack() as opened:
        with listening(port):
            taken = opened.enter_context(socket.create_server((HOST, port), backlog=BACKLOG))
        number = taken.getsockname()[1]
        config = uvicorn.Config(
            http_app(handlers, number),
            log_level="warning",
            access_log=False,
            timeout_graceful_shutdown=2,
            http=_Bounded,
            backlog=BACKLOG,
        )
        announce(f"http://{HOST}:{number}{PATH}")
        try:
            await uvicorn.Server(config).serve(sockets=[taken])
        finally:
            with anyio.CancelScope(shield=True):
                await handlers.bodies.close()


def http_app(handlers: Handlers, port: int) -> Starlette:
    """Return the ASGI application. It answers only host names of this machine, against DNS rebinding."""
    names = [f"{name}:{port}" for name in (HOST, "localhost")]
    security = TransportSecuritySettings(
        enable_dns_rebinding_protection=True, allowed_hosts=names, allowed_origins=[f"http://{name}" for name in names]
    )
    manager = SessionManager(
        make_server(handlers),
        in_use=lambda key: handlers.bodies.find(key) is not None,
        security_settings=security,
        retry_interval=_RETRY,
        max_request_body_size=_BODY_BYTES,
        max_sessions=SESSIONS,
        session_idle_timeout=handlers.bodies.settings.idle,
    )
    endpoint, token = StreamableHTTPASGIApp(manager), handlers.bodies.settings.token
    guarded: ASGIApp = RequireAuthMiddleware(endpoint, []) if token else endpoint
    app = Starlette(routes=[Route(PATH, endpoint=guarded)], lifespan=lambda _: manager.run())
    app.add_middleware(_ReleasesBodies, bodies=handlers.bodies)
    if token:
        app.add_middleware(AuthenticationMiddleware, backend=BearerAuthBackend(_OneToken(token)))
    return app


class _Bounded(H11Protocol):
    """Closes connections beyond CONNECTIONS, and those that take longer than REQUEST_SECONDS to send a request."""

    _late: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        super().connection_made(transport)
        if len(self.connections) > CONNECTIONS:
            transport.abort()
        self._wait()

    def data_received(self, data: bytes) -> None:
        self._wait()
        super().data_received(data)
        if self._late and self.conn.their_state not in (h11.IDLE, h11.SEND_BODY):
            self._late.cancel()
            self._late = None

    def connection_lost(self, exc: Exception | None) -> None:
        if self._late:
            self._late.cancel()
        super().connection_lost(exc)

    def _wait(self) -> None:
        self._late = self._late or self.loop.call_later(REQUEST_SECONDS, self.transport.abort)


class _OneToken:
    """Accepts one token."""

    def __init__(self, token: str) -> None:
        self._token = token.encode()

    async def verify_token(self, token: str) -> AccessToken | None:
        # In constant time, so that its duration tells nothing about the token.
        right = hmac.compare_digest(token.encode(), self._token)
        return AccessToken(token=token, client_id="owner", scopes=[]) if right else None


class _ReleasesBodies:
    """Closes a body as soon as its session is deleted, and not only when it is idle."""

    def __init__(self, app: ASGIApp, bodies: Bodies) -> None:
        self._app, self._bodies = app, bodies

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        accepted = False

        async def watch(message: Message) -> None:
            nonlocal accepted
            if message["type"] == "http.response.start":
                accepted = message["status"] < 400
            await send(message)

        await self._app(scope, receive, watch)
        if accepted and scope.get("method") == "DELETE":
            headers = dict(scope["headers"])
            await self._bodies.release(headers.get(SESSION_HEADER.encode(), b"").decode("latin-1"))
