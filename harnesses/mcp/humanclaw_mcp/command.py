"""`humanclaw mcp`, and its two transports: standard streams, and streamable HTTP for this machine only."""

from __future__ import annotations

import hmac
import logging
import os
import signal
import socket
import sys
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Any, Final

import anyio
import click
import uvicorn
from mcp.server.auth.provider import AccessToken
from mcp.server.auth.settings import AuthSettings
from mcp.server.stdio import stdio_server
from mcp.server.transport_security import TransportSecuritySettings
from starlette.applications import Starlette

from humanclaw import Choice, HumanclawError, Plugins
from humanclaw.cli import (
    BACKLOG,
    CONNECTIONS,
    HOST,
    check_options,
    engine_options,
    listening,
    parse_pairs,
    plugin_options,
    scene_option,
    seed_option,
)  # fmt: skip
from humanclaw_mcp.bodies import Bodies
from humanclaw_mcp.server import Handlers, make_server
from humanclaw_mcp.session import SESSIONS, Settings


@click.command("mcp")
@click.option("--http", is_flag=True, help="Serve streamable HTTP on 127.0.0.1 instead of the standard streams.")
@click.option("--port", type=click.IntRange(0, 65535), default=8000, show_default=True, help="Port for --http.")
@click.option("--auth-env", default="", metavar="NAME", help="Variable with a token that HTTP requests must carry.")
@scene_option("scenes", multiple=True, default=("house:0",), about="Scene that clients may choose. Repeatable.")
@click.option("--instruction", help="The task, if the client gives none.")
@seed_option(help="Seed of all random draws.")
@click.option(
    "--max-steps", type=click.IntRange(1, 10_000), default=100, show_default=True, help="Most steps of an episode."
)
@click.option("--bodies", type=click.IntRange(1), default=4, show_default=True, help="Most bodies at one time.")
@click.option("--company", type=click.IntRange(2, 4), help="Bodies of one house that all clients share, with --http.")
@click.option(
    "--patience",
    type=click.FloatRange(1),
    default=30,
    show_default=True,
    help="Seconds that one of them is waited for.",
)
@click.option("--idle", type=click.FloatRange(1), default=900, show_default=True, help="Seconds to keep an idle body.")
@click.option("--reasoning/--no-reasoning", default=False, help="Also ask what is seen and why, as in the benchmark.")
@click.option("--verifier", default="", help="Verifier by name: it checks each call before the body moves.")
@click.option("--option", "pairs", multiple=True, metavar="KEY=VALUE", help="Option of the verifier. Repeatable.")
@click.option("--profile", type=click.Choice(["default", "paper"]), default="default", show_default=True)
@engine_options
@click.option("--sensor", "sensors", metavar="NAME", multiple=True, help="Sensor besides the view. Repeatable.")
@click.option("--out", type=click.Path(path_type=Path), help="Folder for records; without it none are kept.")
@plugin_options
def command(
    http: bool, port: int, files: tuple[Path, ...], choice: Choice, pairs: tuple[str, ...], **options: Any
) -> None:
    """Serve the skills to agents over the Model Context Protocol."""
    # The name of a session gives access to its body, and the protocol library logs names below this level.
    logging.basicConfig(level=logging.WARNING, format="%(levelname)s %(name)s: %(message)s")
    if options["auth_env"] and not http:
        raise HumanclawError("--auth-env protects HTTP only; over standard streams there is one client.", "Add --http.")
    if options["company"] and not http:
        raise HumanclawError("--company is for several clients, and over standard streams there is one.", "Add --http.")
    given = {key: value for key, value in options.items() if value is not None}
    settings, plugins = Settings(**given, options=parse_pairs(pairs)), Plugins.discover(files, choice)
    # A wrong name or option is told now, not to the first client.
    plugins.require(*(("scenes", reference.partition(":")[0]) for reference in settings.scenes))
    if settings.verifier:
        verifier = plugins.make("verifiers", settings.verifier, settings.options)
        check_options(settings.options, settings.verifier, None, verifier)
    handlers = Handlers(Bodies(settings, plugins))
    try:
        if http:
            anyio.run(serve_http, handlers, port, lambda url: click.echo(f"Listening on {url}", err=True))
        else:
            anyio.run(serve_stdio, handlers)
    except KeyboardInterrupt:
        click.echo("Stopped.", err=True)


# -- transports --------------------------------------------------------------------------------------------------------
PATH: Final = "/mcp"
_BODY_BYTES: Final = 256 * 1024
"""Longest request, bytes: a request holds a call and no file."""


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
    with anyio.open_signal_receiver(signal.SIGTERM, signal.SIGINT, *_hang_ups()) as signals:
        async for number in signals:
            await bodies.close()
            print("Stopped.", file=sys.stderr, flush=True)
            os._exit(128 + number)


def _hang_ups() -> list[signal.Signals]:
    """Return the signal of a closed terminal, but under nohup, which has it ignored, and on Windows, which has none."""
    return [signal.SIGHUP] if os.name != "nt" and signal.getsignal(signal.SIGHUP) != signal.SIG_IGN else []


async def serve_http(handlers: Handlers, port: int, announce: Callable[[str], None]) -> None:
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
            limit_concurrency=CONNECTIONS,
            backlog=BACKLOG,
        )
        announce(f"http://{HOST}:{number}{PATH}")
        server = uvicorn.Server(config)
        for hang_up in _hang_ups():  # Of which uvicorn knows nothing.
            signal.signal(hang_up, server.handle_exit)
        await server.serve(sockets=[taken])


def http_app(handlers: Handlers, port: int) -> Starlette:
    """Return the ASGI application. It answers only host names of this machine, against DNS rebinding."""
    names = [f"{name}:{port}" for name in (HOST, "localhost")]
    security = TransportSecuritySettings(
        enable_dns_rebinding_protection=True, allowed_hosts=names, allowed_origins=[f"http://{name}" for name in names]
    )
    settings = handlers.bodies.settings
    # The SDK demands an issuer, which only clients without a token would ask.
    # pydantic reads a URL from text.
    auth = AuthSettings(issuer_url=f"http://{names[0]}", resource_server_url=None) if settings.token else None  # type: ignore[arg-type]
    return make_server(handlers).streamable_http_app(
        streamable_http_path=PATH,
        max_request_body_size=_BODY_BYTES,
        session_idle_timeout=settings.idle,
        max_sessions=SESSIONS,
        transport_security=security,
        auth=auth,
        token_verifier=_OneToken(settings.token) if settings.token else None,
    )


class _OneToken:
    """Accepts one token."""

    def __init__(self, token: str) -> None:
        self._token = token.encode()

    async def verify_token(self, token: str) -> AccessToken | None:
        # In constant time, so that its duration tells nothing about the token.
        right = hmac.compare_digest(token.encode(), self._token)
        return AccessToken(token=token, client_id="owner", scopes=[]) if right else None
