"""A live page of a run, for this machine only: server-sent events update it after every step. It changes no file."""

from __future__ import annotations

import json
import re
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from http import HTTPStatus
from pathlib import Path
from typing import Any, Final
from urllib.parse import unquote, urlsplit

from humanclaw import EpisodeRecord, HumanclawError, RecordedEpisode, Scene, StepRecord
from humanclaw.cli import Handler, Server
from humanclaw.records import FRAME_BYTES, RECORD_BYTES, STEPS_BYTES, stopped_within_reach
from humanclaw.storage import Folder
from humanclaw_report.episode_page import environment, episode_page
from humanclaw_report.episode_summary import episodes_asked
from humanclaw_report.scene_cache import Houses

SECONDS: Final = 1.0
"""Seconds between two reads of the folder."""
LIVE: Final = 4
"""The page shows the views of this many episodes: those that changed last."""
_NAME: Final = r"[A-Za-z0-9_-][A-Za-z0-9._-]*"
_FRAME: Final = re.compile(rf"/frame/({_NAME})/({_NAME}\.jpg)")
_REPLAY: Final = re.compile(rf"/replay/({_NAME})")


@dataclass
class Watcher:
    """Reads the folder of a run. An episode is read again only when its files have changed."""

    folder: Path
    scenes: Callable[[str], Scene]
    read: dict[Path, tuple[int, dict[str, Any] | None]] = field(default_factory=dict)
    """For each episode: time of its last change (ns) and its table row, None if it cannot be read."""

    def __post_init__(self) -> None:
        self.houses, self.files = Houses(self.scenes), Folder(self.folder)

    def rows(self) -> list[dict[str, Any]]:
        """Return the rows of all episodes, last changed first, without those that cannot be read yet."""
        changes = []
        for episode in (self.files, *(self.files / name for name in self.files.names())):
            times = [status.st_mtime_ns for status in map(episode.status, ("episode.json", "steps.jsonl")) if status]
            if len(times) < 2:
                continue
            # Thousands of ended episodes do not change, and parsing them each second would be slow.
            path, changed = episode.path, max(times)
            if self.read.get(path, (0, None))[0] != changed:
                self.read[path] = changed, _row(episode)
            changes.append(self.read[path])
        return [row for _, row in sorted(changes, key=lambda pair: -pair[0]) if row]

    def state(self) -> dict[str, Any]:
        """Return the content of the page, for JSON."""
        rows = self.rows()
        ended = sum(row["outcome"] != "running" for row in rows)
        return {"ended": ended, "episodes": len(rows), "asked": episodes_asked(self.folder), "rows": rows, "live": LIVE}

    def place(self, name: str) -> Folder:
        """Return the folder of an episode: below the watched folder, or the watched folder itself."""
        return self.files if name == self.folder.resolve().name else self.files / name

    def replay(self, name: str) -> str:
        """Return the page of an episode that has ended, complete in one file."""
        episode = RecordedEpisode(self.place(name))
        page = episode.folder / "page.html"  # Not written: small enough views and films are in the page.
        return episode_page(episode, self.houses.of(episode), page) if episode.has_motion else ""

    def frame(self, name: str, file: str) -> bytes:
        """Return a view of an episode as JPEG; empty if there is no such file."""
        try:
            return (self.place(name) / "frames").read(file, FRAME_BYTES)
        except OSError:
            return b""


def _row(folder: Folder) -> dict[str, Any] | None:
    """Return the table row of an episode; None if it cannot be read.

    Only the record and the last complete step are parsed, since this runs thousands of times during a run.
    """
    try:
        record = EpisodeRecord.model_validate_json(folder.read("episode.json", RECORD_BYTES))
        # The last piece is empty, or a line that is still being written.
        lines = folder.read("steps.jsonl", STEPS_BYTES).split(b"\n")[:-1]
        last = StepRecord.model_validate_json(lines[-1]) if lines else None
    except (OSError, ValueError):
        return None
    name, now = folder.path.resolve().name, f"{len(lines):04d}.jpg"
    frame = now if folder.has(f"frames/{now}") else Path(last.frame_file).name if last else ""
    return {
        "id": name,
        "instruction": record.spec.instruction,
        "outcome": record.outcome,
        "goal": _goal(record, last),
        "steps": len(lines),
        "call": str(last.call or "no usable call") if last else "",
        "words": (last.decision.reasoning or last.decision.visible_state) if last else "",
        "distance": last.target_distance if last else None,
        "frame": f"/frame/{name}/{frame}" if frame else "",
        "replay": f"/replay/{name}" if folder.has("motion.npz") else "",
    }


def _goal(record: EpisodeRecord, last: StepRecord | None) -> str:
    """Return whether an episode that ended of its own accord met the goal of its target; empty if it has none."""
    spec = record.spec
    if record.outcome not in ("stopped", "out_of_steps") or not spec.target_ids or spec.goal is not None or not last:
        return ""
    sat = not spec.interact or set(last.pelvis_contacts) & set(spec.target_ids)
    return "goal reached" if sat and stopped_within_reach((last,)) else "goal not reached"


def server(watcher: Watcher, port: int = 0) -> Server:
    """Return a server of a run on the loopback interface; shutdown() ends it. port: 0 picks a free one.

    Raises HumanclawError.
    """

    class Asked(Handler):
        def do_GET(self) -> None:
            path = unquote(urlsplit(self.path).path)
            if path == "/events":
                self._events()
                return
            content, kind = _content(watcher, path)
            self.answer(HTTPStatus.OK if content else HTTPStatus.NOT_FOUND, content, kind)

        def _events(self) -> None:
            """Send the state each time it changes, until the page is closed."""
            self.send_response(HTTPStatus.OK)
            self.send_header("Content-Type", "text/event-stream")
            self.send_header("Cache-Control", "no-store")
            self.end_headers()
            state: dict[str, Any] = {}
            while True:
                before, state = state, watcher.state()
                # A comment line is sent if nothing changed: only a failed write reveals a closed page.
                event = f"data: {json.dumps(state)}" if state != before else ": still here"
                self.wfile.write(f"{event}\n\n".encode())
                time.sleep(SECONDS)

    return Server(Asked, port)


def _content(watcher: Watcher, path: str) -> tuple[bytes, str]:
    """Return what lies at a path, and its media type; nothing if there is nothing."""
    if path == "/":
        page = environment().get_template("watch.html").render(title=watcher.folder.resolve().name)
        return page.encode(), "text/html; charset=utf-8"
    if match := _FRAME.fullmatch(path):
        return watcher.frame(*match.groups()), "image/jpeg"
    with suppress(HumanclawError):
        if match := _REPLAY.fullmatch(path):
            return watcher.replay(match[1]).encode(), "text/html; charset=utf-8"
    return b"", "text/plain"
