"""Serve an agent over HTTP, for `humanclaw bench run --agent-url`: each POST is one JSON-RPC request."""

from __future__ import annotations

import json
import threading
from collections import OrderedDict
from http import HTTPStatus
from typing import Final

from humanclaw import Plugins
from humanclaw.cli import Handler, Server
from humanclaw_bench.wall.links import LARGEST
from humanclaw_bench.wall.messages import Json
from humanclaw_bench.wall.session import Session

MOST: Final = 64
"""Sessions that are kept: one for each worker of the runs that ask. The one that asked longest ago gives way."""


class Sessions:
    """The sessions of a server, by the name that each worker gives itself. Each answers one request at a time."""

    def __init__(self, plugins: Plugins, agent: str, options: Json) -> None:
        self._plugins, self._agent, self._options = plugins, agent, options
        self._known: OrderedDict[str, tuple[Session, threading.Lock]] = OrderedDict()
        self._lock = threading.Lock()

    def answer(self, request: Json) -> Json:
        """Answer a request. The agent and its options are the server's, whatever a request asks for."""
        params = dict(request.get("params", {}))
        name = str(params.pop("session", ""))
        if request.get("method") == "initialize":
            params |= {"agents": self._agent, "options": self._options, "names": {}}
            params.pop("verifiers", None)
        session, lock = self._session(name)
        with lock:
            return session.answer(request | {"params": params})

    def _session(self, name: str) -> tuple[Session, threading.Lock]:
        with self._lock:
            found = self._known.pop(name, None) or (Session(self._plugins), threading.Lock())
            self._known[name] = found
            while len(self._known) > MOST:
                self._known.popitem(last=False)
        return found


def server(sessions: Sessions, host: str, port: int) -> Server:
    """Return a server of these sessions; port 0 chooses a free one. Raises HumanclawError."""

    class Asked(Handler):
        timeout = 60.0
        """Seconds for a request: it may hold megabytes of pictures, and come from another machine."""

        def post(self) -> None:
            try:
                request = json.loads(self.body(LARGEST))
            except (ValueError, RecursionError):
                request = None
            if isinstance(request, dict) and isinstance(request.get("params", {}), dict):
                self.answer(HTTPStatus.OK, json.dumps(sessions.answer(request)).encode(), "application/json")
            else:
                self.answer(HTTPStatus.BAD_REQUEST, b"expected one JSON-RPC request")

    return Server(Asked, port, host)
