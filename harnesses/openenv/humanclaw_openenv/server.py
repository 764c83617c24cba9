"""The server that OpenEnv's clients connect to.

OpenEnv speaks WebSocket through FastAPI, which humanclaw.cli.Server cannot carry, so uvicorn listens here: on this
machine unless another host is named, for a bounded number of sessions that end when they are idle.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Final

import uvicorn
from fastapi import FastAPI
from openenv.core.env_server.http_server import HTTPEnvServer
from openenv.core.env_server.mcp_types import CallToolAction
from openenv.core.env_server.types import ConcurrencyConfig
from starlette.middleware.trustedhost import TrustedHostMiddleware

from humanclaw import Gym
from humanclaw.cli import BACKLOG, CONNECTIONS, HOST
from humanclaw_openenv.environment import BodyEnvironment, BodyObservation

IDLE: Final = 600.0
"""Seconds after which a session without a message ends."""
MESSAGE: Final = 1 << 20
"""Maximum bytes of a message: a call and no file."""


def app(gym: Callable[[], Gym], sessions: int, host: str = HOST) -> FastAPI:
    """Return the ASGI application. On this machine alone it answers only names of this machine (DNS rebinding)."""
    limits = ConcurrencyConfig(max_concurrent_envs=sessions, session_timeout=IDLE)
    server = HTTPEnvServer(partial(BodyEnvironment, gym), CallToolAction, BodyObservation, concurrency_config=limits)
    made = FastAPI(title="HumanCLAW")
    server.register_routes(made)
    if host == HOST:
        made.add_middleware(TrustedHostMiddleware, allowed_hosts=[HOST, "localhost"])
    return made


def serve(gym: Callable[[], Gym], sessions: int, host: str, port: int) -> None:
    """Serve until interrupted."""
    uvicorn.run(
        app(gym, sessions, host), host=host, port=port, log_level="warning", ws_max_size=MESSAGE, backlog=BACKLOG,
        limit_concurrency=CONNECTIONS,
    )  # fmt: skip
