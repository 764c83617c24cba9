"""What every server of ours holds to: bounded connections, bounded waiting for a client, and who is answered."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any, Final

import click

from humanclaw.errors import HumanclawError

HOST: Final = "127.0.0.1"
CONNECTIONS: Final = 128
"""Maximum open connections, idle ones included: together with BACKLOG far below the usual 1,024 open files."""
REQUEST_SECONDS: Final = 10.0
"""Maximum seconds that a client is waited for."""
BACKLOG: Final = 64
"""Connections that the system keeps until they are accepted."""
_OWN: Final = re.compile(r"(127\.0\.0\.1|localhost|\[::1\])(:\d+)?")


@contextmanager
def listening(port: int) -> Iterator[None]:
    """Raise HumanclawError if the block cannot listen there."""
    try:
        yield
    except OSError as error:
        reason = f"cannot listen on port {port} of {HOST}: {error.strerror}."
        raise HumanclawError(reason, "Name another port; 0 picks a free one.") from error


class Handler(BaseHTTPRequestHandler):
    """Answers one request on each connection, and logs nothing: the terminal belongs to the command.

    Define do_GET() or do_POST(), which end with answer(). timeout: seconds for each read and write.
    """

    timeout = REQUEST_SECONDS
    server: Server

    def parse_request(self) -> bool:
        """Read the head. Refuse other host names (DNS rebinding) and the pages of other origins."""
        if not super().parse_request():
            return False
        if not self.server.knows(self.headers.get("Host", ""), self.headers.get("Origin")):
            self.answer(HTTPStatus.FORBIDDEN)
            return False
        return True

    def body(self, most: int) -> bytes:
        """Return the body of a POST; empty if it has none, more than `most` bytes or no length."""
        header = self.headers.get("Content-Length", "")
        length = int(header) if header.isdecimal() and len(header) < 12 else 0
        content = self.rfile.read(length) if length <= most else b""
        return content if len(content) == length else b""

    def answer(self, status: HTTPStatus, content: bytes = b"", kind: str = "text/plain; charset=utf-8") -> None:
        """Send the answer."""
        self.send_response(status)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(content)))
        self.send_header("X-Content-Type-Options", "nosniff")
        self.end_headers()
        self.wfile.write(content)

    def log_message(self, *args: Any) -> None: ...


class Server(ThreadingHTTPServer):
    """Listens to this machine alone. Each connection has a thread and a timeout."""

    request_queue_size = BACKLOG

    def __init__(self, handler: type[Handler], port: int = 0) -> None:
        """Listen; port 0 takes any free one. Raises HumanclawError if that is not possible."""
        with listening(port):
            super().__init__((HOST, port), handler)

    def knows(self, host: str, origin: str | None) -> bool:
        """Whether a request may come with this Host and Origin: a page in a browser may only ask where it came from."""
        return bool(_OWN.fullmatch(host)) and origin in (None, f"http://{host}")

    def until_interrupted(self) -> None:
        """Serve until Ctrl-C."""
        try:
            self.serve_forever()
        except KeyboardInterrupt:
            click.echo("ended")
        finally:
            self.server_close()

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Say nothing of a client that has gone."""
        if not isinstance(sys.exception(), OSError):
            super().handle_error(request, client_address)
