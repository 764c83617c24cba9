"""A page on 127.0.0.1 with the view and text that a model gets, and keys and buttons that move the body."""

from __future__ import annotations

import hmac
import json
import secrets
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from http import HTTPStatus
from importlib import resources
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from humanclaw import CallError, Decision
from humanclaw.cli import Handler, Server
from humanclaw.storage import jpeg
from humanclaw_human.commands import Key

_LONGEST: Final = 4000
"""Longest call with its report of what is seen, bytes."""
_SECRET: Final = secrets.token_urlsafe(16)
"""First part of every path, so that only this user can see the page and press its keys: not other users of this
machine, nor other pages of the browser. One for all episodes of a process, so that the page can go on with the next."""
_POSTED: Final = frozenset({"call", "leave"})
"""Places that the page posts to."""
_TAKING: Final = 3.0
"""Seconds for an open page to fetch the replay before the process ends."""


@dataclass(frozen=True)
class PageState:
    """Content of the page before a decision: what a model gets, and nothing that only the scene knows."""

    step: int
    of: int
    """Most steps of the episode."""
    instruction: str
    feedback: str = ""
    past: tuple[tuple[str, str], ...] = ()
    """Calls so far, each with its result."""
    between: tuple[bytes, ...] = ()
    """JPEGs of the motion that led here, oldest first."""


@dataclass(frozen=True)
class Controls:
    """The calls of the page.

    keys: name of a key (KeyboardEvent.key) to its call. skills: names, descriptions and parameters, for a form.
    """

    keys: Mapping[str, Key] = field(default_factory=dict)
    skills: Sequence[Mapping[str, Any]] = ()


NO_CONTROLS: Final = Controls()


class PageServer:
    """Serves the page until closed, to browsers of this machine only."""

    def __init__(
        self,
        port: int = 0,
        submit: Callable[[Decision | None], None] = lambda decision: None,
        read: Callable[[bytes], Decision] = lambda sent: Decision(),
        controls: Controls = NO_CONTROLS,
    ) -> None:
        """Start the server; port 0 takes any free port. Raises HumanclawError if it is taken.

        submit: gets each decision, or None if the person leaves. read: makes one of what the page sends, or raises
        CallError.
        """
        self._picture = b""
        self._between: Sequence[bytes] = ()
        self._state: dict[str, Any] = {"step": -1}
        self._submit, self._read, self._controls = submit, read, controls
        self.visited = False
        """Whether a page has connected."""
        self._asking = threading.Lock()
        """Free while the page may submit a call. It is held while the body moves, so that keys have no effect then."""
        self._asking.acquire()  # No episode has begun yet.
        self._replay, self._taken = Path(), threading.Event()
        self._server = Server(self._handler(), port)
        threading.Thread(target=self._server.serve_forever, daemon=True).start()

    @property
    def address(self) -> str:
        """The page's address. It is as secret as the page: print it nowhere, and give it to no other program."""
        return f"http://127.0.0.1:{self._server.server_port}/{_SECRET}/"

    @contextmanager
    def link(self) -> Iterator[Path]:
        """Write a file that leads a browser to the page, for this user's eyes only; it is removed at the end.

        Other users of this machine can read a browser's arguments and the output of a run, but not this file.
        """
        with TemporaryDirectory(prefix="humanclaw-") as folder:
            path = Path(folder) / "page.html"
            path.write_text(f'<meta http-equiv="refresh" content="0; url={self.address}">', "utf-8")
            yield path

    def show(self, rgb: NDArray[np.uint8], moment: PageState) -> None:
        """Show text and an (H, W, 3) picture, as the JPEG that a model gets; then accept one call."""
        self._picture = jpeg(rgb)
        self._between = moment.between
        self._state = asdict(moment) | {"between": len(moment.between)}
        self._asking.acquire(blocking=False)  # Free if the last picture brought no call.
        self._asking.release()

    def end(self, result: str, replay: Path) -> None:
        """Show how the episode ended. replay: the HTML file of its replay, which may be written later."""
        self._replay = replay
        self._state = {"step": 0, "result": result}

    def close(self) -> None:
        """End the server, once an open page has the replay."""
        if self.visited and self._replay.is_file():
            self._taken.wait(_TAKING)
        self._server.shutdown()
        self._server.server_close()

    def _handler(self) -> type[Handler]:
        window = self

        class Asked(Handler):
            def do_GET(self) -> None:
                if (place := self._place()) is not None:
                    window.visited = True
                    content, kind = window._content(place)
                    self.answer(HTTPStatus.OK if content else HTTPStatus.NOT_FOUND, content, kind)
                    if place == "replay" and content:
                        window._taken.set()

            def do_POST(self) -> None:
                sent = self.body(_LONGEST)
                if (place := self._place()) is not None:
                    code, words = window._press(place, sent) if place in _POSTED else (HTTPStatus.NOT_FOUND, "")
                    self.answer(code, words.encode())

            def _place(self) -> str | None:
                """Return the path behind the secret; refuse who does not know it."""
                secret, place = (*self.path.split("?")[0].split("/", 2), "", "")[1:3]
                # Takes the same time for every wrong secret, so that nothing can be learned from it.
                if hmac.compare_digest(secret.encode(), _SECRET.encode()):
                    return place
                self.answer(HTTPStatus.FORBIDDEN)
                return None

        return Asked

    def _press(self, place: str, sent: bytes) -> tuple[HTTPStatus, str]:
        """Submit a call, or that the person leaves; return HTTP status and message."""
        try:
            decision = self._read(sent) if place == "call" else None
        except CallError as error:
            return HTTPStatus.BAD_REQUEST, str(error)
        if not self._asking.acquire(blocking=False):
            return HTTPStatus.CONFLICT, "The body still moves."
        self._submit(decision)
        return HTTPStatus.NO_CONTENT, ""

    def _content(self, path: str) -> tuple[bytes, str]:
        if not path:
            return self._page(), "text/html; charset=utf-8"
        if path == "state":
            return json.dumps(self._state).encode(), "application/json"
        if path == "replay" and self._replay.is_file():
            return self._replay.read_bytes(), "text/html; charset=utf-8"
        pictures = {"view.jpg": self._picture} | {f"between-{k}.jpg": view for k, view in enumerate(self._between)}
        return (pictures[path], "image/jpeg") if path in pictures else (b"", "text/plain")

    def _page(self) -> bytes:
        """Return page, style, script and controls as one document."""
        page = _source("page.html").replace("STYLE", _source("page.css"), 1).replace("SCRIPT", _source("page.js"), 1)
        # "<" is escaped, since a description of a skill may hold "</script>".
        return page.replace("CONTROLS", json.dumps(asdict(self._controls)).replace("<", "\\u003c"), 1).encode()


def _source(name: str) -> str:
    return resources.files(__package__).joinpath(name).read_text("utf-8")
