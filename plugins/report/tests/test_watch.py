"""A run that is watched: what the page is told, and what nobody else can read."""

from __future__ import annotations

import json
import threading
from collections.abc import Iterator
from http.client import HTTPConnection
from pathlib import Path

import pytest
from made import broken_off, picture, record_episode

from humanclaw_report.watch import Watcher, server


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[int, Path]]:
    """A run of which one episode has ended and one has not."""
    folder = tmp_path_factory.mktemp("run")
    scene = record_episode(folder / "couch-0")
    record_episode(folder / "couch-1", name="couch-1")
    broken_off(folder / "couch-1")
    (folder / "secret.jpg").write_bytes(b"secret")
    serving = server(Watcher(folder, lambda name: scene))
    threading.Thread(target=serving.serve_forever, daemon=True).start()
    yield serving.server_address[1], folder
    serving.shutdown()
    serving.server_close()


def get(port: int, path: str, method: str = "GET", host: str = "127.0.0.1") -> tuple[int, bytes]:
    connection = HTTPConnection("127.0.0.1", port, timeout=10)
    connection.request(method, path, headers={"Host": host})
    answer = connection.getresponse()
    return answer.status, answer.readline() if path == "/events" and answer.status == 200 else answer.read()


def test_the_first_event_tells_of_every_episode(served: tuple[int, Path]) -> None:
    status, line = get(served[0], "/events")
    state = json.loads(line.removeprefix(b"data: "))
    assert status == 200
    assert (state["episodes"], state["ended"]) == (2, 1)
    rows = {row["id"]: row for row in state["rows"]}
    assert rows["couch-1"]["outcome"] == "running"
    assert rows["couch-1"]["call"] == "stop()"


def test_the_view_and_the_map_of_an_episode_are_served(served: tuple[int, Path]) -> None:
    assert get(served[0], "/frame/couch-0/0002.jpg") == (200, picture(2))
    status, drawn = get(served[0], "/map/couch-1?3")
    assert status == 200
    assert b'class="path"' in drawn
    assert b'class="wall"' in drawn


@pytest.mark.parametrize(
    "path", ["/frame/couch-0/../../secret.jpg", "/frame/couch-0/%2e%2e%2f%2e%2e%2fsecret.jpg", "/frame/no/0.jpg", "/x"]
)
def test_nothing_but_views_of_the_run_can_be_read(served: tuple[int, Path], path: str) -> None:
    assert get(served[0], path)[0] == 404


def test_nothing_can_be_written_and_no_other_host_is_answered(served: tuple[int, Path]) -> None:
    assert get(served[0], "/", "POST")[0] == 501
    assert get(served[0], "/events", host="evil.example")[0] == 403
