"""An HTTP server on 127.0.0.1 that speaks OpenAI's chat-completions protocol and answers from a script.

For tests of anything that talks to a language model, without key and network:

    with OpenAIServer([call("turn", yaw_deg=30), call("stop")]) as server:
        client = openai.OpenAI(base_url=server.url, api_key="unused")
        ...
    assert server.requests[0].tool_names == ["turn", "stop"]

A script is a list of replies, one for each request, or a function from Request to Reply. Faults are replies too:
status(429), dropped(), truncated(reply), delayed(5, reply), no_choices(). An exhausted list answers 500.
"""

from __future__ import annotations

import base64
import binascii
import io
import json
import socket
import struct
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from types import TracebackType
from typing import Any, Final, Self

import numpy as np
from numpy.typing import NDArray
from PIL import Image

Json = dict[str, Any]
USAGE: Final = {"prompt_tokens": 1000, "completion_tokens": 100, "total_tokens": 1100}
"""Default usage of replies."""


# -- requests ----------------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Request:
    """A request as the server received it."""

    path: str
    headers: Mapping[str, str]
    """Names in lower case."""
    body: Json
    """In OpenAI's form, in every dialect."""
    raw: Json = field(default_factory=dict)
    """As received."""

    @property
    def messages(self) -> list[Json]:
        return list(self.body.get("messages", ()))

    @property
    def tools(self) -> list[Json]:
        """The functions of the tool list: name, description, parameters."""
        return [tool["function"] for tool in self.body.get("tools") or ()]

    @property
    def tool_names(self) -> list[str]:
        return [tool["name"] for tool in self.tools]

    @property
    def text(self) -> str:
        """All text of all messages."""
        return "\n".join(part["text"] for part in self._parts() if part.get("type") == "text")

    @property
    def images(self) -> list[NDArray[np.uint8]]:
        """Every picture of every message, decoded to (H, W, 3). Raises ValueError for other than base64 data URLs."""
        return [_decode(part["image_url"]["url"]) for part in self._parts() if part.get("type") == "image_url"]

    def role(self, role: str) -> str:
        """Return the text of the messages of one role."""
        return replace(self, body={"messages": [m for m in self.messages if m["role"] == role]}).text

    def _parts(self) -> list[Json]:
        contents = [message.get("content") or "" for message in self.messages]
        lists = [[{"type": "text", "text": c}] if isinstance(c, str) else c for c in contents]
        return [part for parts in lists for part in parts]


def _decode(url: str) -> NDArray[np.uint8]:
    head, _, data = url.partition(",")
    if not head.startswith("data:image/") or not head.endswith(";base64"):
        raise ValueError(f"expected a data URL of an image in base64; got {url[:40]!r}")
    try:
        picture = base64.b64decode(data, validate=True)
    except binascii.Error as error:
        raise ValueError(f"the data URL is not base64: {error}") from error
    with Image.open(io.BytesIO(picture)) as image:
        return np.asarray(image.convert("RGB"))


# -- replies -----------------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Reply:
    """A reply. Build it with the functions below."""

    body: Any
    """In OpenAI's form, which each server writes in its dialect; a string is sent as it is."""
    code: int = 200
    headers: Mapping[str, str] = field(default_factory=dict)
    delay: float = 0.0
    """Seconds before the answer."""
    cut: float = 1.0
    """Share of the body sent before the connection closes; below 0 the connection is reset before sending."""


Script = Sequence[Reply] | Callable[[Request], Reply]


def call(name: str, /, **arguments: Any) -> Reply:
    """Return a message with one tool call."""
    return calls((name, arguments))


def calls(*named: tuple[str, Mapping[str, Any] | str], text: str | None = None) -> Reply:
    """Return a message with several tool calls and optional text. Arguments given as a string are sent unchanged."""
    listed = [
        {"id": f"call_{number}", "type": "function", "function": {"name": name, "arguments": _dump(arguments)}}
        for number, (name, arguments) in enumerate(named)
    ]
    return message({"role": "assistant", "content": text, "tool_calls": listed}, "tool_calls")


def text(content: str, finish_reason: str = "stop") -> Reply:
    """Return a message of plain text, or of JSON in a text."""
    return message({"role": "assistant", "content": content}, finish_reason)


def answer(**fields: Any) -> Reply:
    """Return a message whose content is a JSON object, as response_format asks for."""
    return text(json.dumps(fields))


def message(content: Mapping[str, Any], finish_reason: str = "stop") -> Reply:
    """Return any message."""
    choice = {"index": 0, "message": dict(content), "finish_reason": finish_reason}
    return Reply({"object": "chat.completion", "choices": [choice], "usage": dict(USAGE)})


def status(code: int, explanation: str = "", headers: Mapping[str, str] | None = None, kind: str = "error") -> Reply:
    """Return an HTTP error in OpenAI's form, such as status(429, headers={"Retry-After": "1"})."""
    error = {"message": explanation or f"scripted error {code}", "type": kind, "param": None, "code": None}
    return Reply({"error": error}, code, dict(headers or {}))


def thinking(thoughts: str, reply: Reply) -> Reply:
    """Return the reply with the model's thoughts, as `reasoning_content`."""
    (choice,) = reply.body["choices"]
    changed = {**choice, "message": {**choice["message"], "reasoning_content": thoughts}}
    return replace(reply, body={**reply.body, "choices": [changed]})


def no_choices() -> Reply:
    """Return a completion with an empty list of choices."""
    return Reply({"object": "chat.completion", "choices": [], "usage": dict(USAGE)})


def without_usage(reply: Reply) -> Reply:
    """Return the reply without its token counts."""
    return replace(reply, body={key: value for key, value in reply.body.items() if key != "usage"})


def delayed(seconds: float, reply: Reply) -> Reply:
    """Return the reply with a delay in seconds."""
    return replace(reply, delay=seconds)


def truncated(reply: Reply, share: float = 0.5) -> Reply:
    """Return the reply with its body cut short; Content-Length still has the full length."""
    return replace(reply, cut=share)


def dropped() -> Reply:
    """Return no answer: the connection is reset."""
    return Reply({}, cut=-1.0)


def refusing(field_name: str, otherwise: Script) -> Callable[[Request], Reply]:
    """Return a script that answers 400 to requests with a field such as "tools", and follows another otherwise."""
    rest = _player(otherwise)

    def script(request: Request) -> Reply:
        refused = field_name in request.body
        return (
            status(400, f"this model does not support {field_name}", kind="invalid_request_error")
            if refused
            else rest(request)
        )

    return script


def redirected(address: str, code: int = 307) -> Reply:
    """Return a redirect to another address."""
    return status(code, "moved", headers={"Location": address})


def _dump(arguments: Mapping[str, Any] | str) -> str:
    return arguments if isinstance(arguments, str) else json.dumps(arguments)


def _player(script: Script) -> Callable[[Request], Reply]:
    if callable(script):
        return script
    queue = iter(script)
    return lambda request: next(queue, status(500, "the script of the test server has no reply left"))


# -- the server --------------------------------------------------------------------------------------------------------
class OpenAIServer:
    """Serves a script on a free port of 127.0.0.1 during its `with` block, and keeps every request.

    A server of another dialect overrides url, accepts, read and write (dialects.py); scripts and requests are the same.
    """

    def __init__(self, script: Script) -> None:
        self.requests: list[Request] = []
        self._play = _player(script)
        self._lock = threading.Lock()
        self._closing = threading.Event()
        self._server = ThreadingHTTPServer(("127.0.0.1", 0), _handler(self))
        self._server.daemon_threads = True
        self._thread = threading.Thread(target=self._server.serve_forever, kwargs={"poll_interval": 0.02}, daemon=True)

    @property
    def url(self) -> str:
        """The base_url or api_base of clients."""
        return f"{self.origin}/v1"

    @property
    def origin(self) -> str:
        return f"http://127.0.0.1:{self._server.server_address[1]}"

    def accepts(self, path: str) -> bool:
        """Tell whether requests for an answer go to this path."""
        return path.endswith("/chat/completions")

    def read(self, path: str, headers: Mapping[str, str], raw: Json) -> Request:
        """Return a request of this dialect, with its body in OpenAI's form."""
        return Request(path, headers, raw, raw)

    def write(self, reply: Reply, request: Request) -> Json:
        """Return the body of an answer, which is in OpenAI's form, in this dialect."""
        return {
            "id": "chatcmpl-test",
            "created": int(time.time()),
            "model": request.body.get("model", "test"),
            **reply.body,
        }

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._closing.set()
        self._server.shutdown()
        self._server.server_close()
        self._thread.join()

    def respond(self, request: Request) -> Reply:
        """Keep a request and return the script's reply. A lock keeps the order of lists."""
        with self._lock:
            self.requests.append(request)
            return self._play(request)

    def wait(self, seconds: float) -> None:
        """Wait, at most until the server closes."""
        self._closing.wait(seconds)


def _handler(owner: OpenAIServer) -> type[BaseHTTPRequestHandler]:
    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            listing = self.path.rstrip("/").endswith("/models")
            models = Reply({"object": "list", "data": [{"id": "test", "object": "model"}]})
            reply = models if listing else status(404, f"no such path: {self.path}")
            self._send(reply, reply.body)

        def do_POST(self) -> None:
            raw = self.rfile.read(int(self.headers.get("Content-Length", 0)))
            headers = {key.lower(): value for key, value in self.headers.items()}
            reply, request = self._reply(raw, headers)
            owner.wait(reply.delay)
            own = isinstance(reply.body, str) or reply.code != 200
            self._send(reply, reply.body if own else owner.write(reply, request))

        def _reply(self, raw: bytes, headers: Mapping[str, str]) -> tuple[Reply, Request]:
            nothing = Request(self.path, headers, {})
            if not owner.accepts(self.path):
                return status(404, f"no such path: {self.path}"), nothing
            try:
                body = json.loads(raw)
            except ValueError as error:
                return status(400, f"the request is not JSON: {error}"), nothing
            request = owner.read(self.path, headers, body)
            return owner.respond(request), request

        def _send(self, reply: Reply, body: Json | str) -> None:
            if reply.cut < 0:
                self._reset()
                return
            data = (body if isinstance(body, str) else json.dumps(body)).encode()
            headers = {"Content-Type": "application/json", "Content-Length": str(len(data)), **reply.headers}
            try:
                self.send_response(reply.code)
                for key, value in headers.items():
                    self.send_header(key, value)
                self.end_headers()
                self.wfile.write(data[: int(len(data) * reply.cut)])
            except OSError:
                self.close_connection = True  # The client gave up, as clients with a timeout do.

        def _reset(self) -> None:
            """Close with a TCP reset rather than an orderly end."""
            self.connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
            self.close_connection = True
            self.connection.close()

        def log_message(self, format: str, *args: Any) -> None:  # noqa: A002
            """Log nothing: tests are quiet."""

    return Handler
