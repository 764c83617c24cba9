"""A run while it is under way: a page on this machine alone, told of every step by server-sent events. Reads only."""

from __future__ import annotations

import json
import re
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any, Final
from urllib.parse import unquote, urlsplit

from humanclaw import RecordedEpisode, RecordError, Scene
from humanclaw_report.episode_page import environment
from humanclaw_report.facts import in_words, milestones
from humanclaw_report.maps import path_maps
from humanclaw_report.report import Houses

SECONDS: Final = 1.0
"""Between two looks at the folder."""
LIVE: Final = 4
"""Episodes whose view and map are shown, those that moved last."""
_NAME: Final = r"[A-Za-z0-9_-][A-Za-z0-9._-]*"
_FRAME: Final = re.compile(rf"/frame/({_NAME})/({_NAME}\.jpg)")
_MAP: Final = re.compile(rf"/map/({_NAME})")
_OWN: Final = re.compile(r"(127\.0\.0\.1|localhost|\[::1\])(:\d+)?")


@dataclass
class Watcher:
    """Looks at the folder of a run. An episode is read again only when its steps have grown."""

    folder: Path
    scenes: Callable[[str], Scene]
    read: dict[Path, tuple[int, RecordedEpisode]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.houses = Houses(self.scenes)

    def episodes(self) -> list[tuple[float, RecordedEpisode]]:
        """Every episode with when it last changed, the latest first. One that is just being written is left out."""
        found = []
        for path in self.folder.rglob("episode.json"):
            try:
                changed = max(path.stat().st_mtime_ns, (path.parent / "steps.jsonl").stat().st_mtime_ns)
                if self.read.get(path, (0, None))[0] != changed:
                    self.read[path] = changed, RecordedEpisode(path.parent)
            except (OSError, RecordError):
                continue
            found.append((changed / 1e9, self.read[path][1]))
        return sorted(found, key=lambda pair: -pair[0])

    def state(self) -> dict[str, Any]:
        """Return what the page shows, as JSON."""
        rows = [self._row(episode) for _, episode in self.episodes()]
        ended = sum(row["outcome"] != "running" for row in rows)
        return {"ended": ended, "episodes": len(rows), "asked": self._asked(), "rows": rows, "live": LIVE}

    def _asked(self) -> int:
        path = self.folder / "run.json"
        return int(json.loads(path.read_bytes()).get("episodes", 0)) if path.exists() else 0

    def _row(self, episode: RecordedEpisode) -> dict[str, Any]:
        last = episode.steps[-1] if episode.steps else None
        frames = [step.frame_file for step in episode.steps if step.frame_file]
        return {
            "id": episode.folder.name,
            "instruction": episode.record.spec.instruction,
            "outcome": episode.record.outcome,
            "words": in_words(episode, milestones(episode)),
            "steps": len(episode.steps),
            "call": str(last.call or "no usable call") if last else "",
            "reasoning": last.decision.reasoning if last else "",
            "distance": last.target_distance if last else None,
            "frame": f"/frame/{episode.folder.name}/{Path(frames[-1]).name}" if frames else "",
            "map": f"/map/{episode.folder.name}?{len(episode.steps)}",
        }

    def named(self, name: str) -> RecordedEpisode | None:
        return next((episode for _, episode in self.episodes() if episode.folder.name == name), None)

    def drawn(self, name: str) -> str:
        """Return the maps of an episode so far, as HTML; empty if there is no such episode."""
        episode = self.named(name)
        if episode is None:
            return ""
        house = self.houses.of(episode)
        maps = path_maps(episode, house.maps, house.note)
        template = environment().get_template("live_map.html")
        return template.render(maps=maps, house=house.maps if house.scene else (), words=name, parts=())

    def frame(self, name: str, file: str) -> bytes:
        """Return a view of an episode; empty if there is none of that name."""
        episode = self.named(name)
        path = episode.folder / "frames" / file if episode else None
        return path.read_bytes() if path and path.is_file() else b""


def server(watcher: Watcher, port: int = 0) -> ThreadingHTTPServer:
    """Serve a run on the loopback interface; close it with shutdown(). port: 0 takes a free one."""
    made = ThreadingHTTPServer(("127.0.0.1", port), _handler(watcher))
    made.daemon_threads = True
    return made


def _handler(watcher: Watcher) -> type[BaseHTTPRequestHandler]:
    class Handler(BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"

        def do_GET(self) -> None:
            if not _OWN.fullmatch(self.headers.get("Host", "")):
                # A page from elsewhere that has its own name lead here reads nothing.
                self._send(b"", "text/plain", HTTPStatus.FORBIDDEN)
                return
            path = unquote(urlsplit(self.path).path)
            if path == "/":
                page = environment().get_template("watch.html").render(title=watcher.folder.resolve().name)
                self._send(page.encode(), "text/html; charset=utf-8")
            elif path == "/events":
                self._events()
            elif match := _FRAME.fullmatch(path):
                self._send(watcher.frame(*match.groups()), "image/jpeg")
            elif match := _MAP.fullmatch(path):
                self._send(watcher.drawn(match[1]).encode(), "text/html; charset=utf-8")
            else:
                self._send(b"", "text/plain")

        def _send(self, body: bytes, kind: str, status: HTTPStatus = HTTPStatus.OK) -> None:
            self.send_response(status if body or status != HTTPStatus.OK else HTTPStatus.NOT_FOUND)
            self.send_header("Content-Type", kind)
            self.send_header("Content-Length", str(len(body)))
            self.send_header("X-Content-Type-Options", "nosniff")
            self.end_headers()
            self.wfile.write(body)

        def _events(self) -> None:
            """Send the state whenever it differs from the one before, until the page is closed."""
            self.send_response(HTTPStatus.OK)
            self.send_header("Content-Type", "text/event-stream")
            self.send_header("Cache-Control", "no-store")
            self.send_header("Connection", "close")
            self.end_headers()
            self.close_connection = True
            told = ""
            try:
                while True:
                    state = json.dumps(watcher.state())
                    # A line that says nothing: it is how a closed page is noticed.
                    self.wfile.write(f"data: {state}\n\n".encode() if state != told else b": still here\n\n")
                    self.wfile.flush()
                    told = state
                    time.sleep(SECONDS)
            except OSError:
                return

        def log_message(self, *args: Any) -> None: ...

    return Handler
