"""Tests of the live page: its content, and the files that it does not serve."""

from __future__ import annotations

import json
import shutil
import threading
from collections.abc import Iterator
from http.client import HTTPConnection
from pathlib import Path
from typing import Any

import pytest
from made import broken_off, picture, record_episode

from humanclaw import RecordError
from humanclaw_report.watch import Watcher, _content, server


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[int, Path]]:
    """Serve a run with one ended and one running episode."""
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


def get(port: int, path: str, method: str = "GET") -> tuple[int, bytes]:
    connection = HTTPConnection("127.0.0.1", port, timeout=10)
    connection.request(method, path)
    answer = connection.getresponse()
    return answer.status, answer.readline() if path == "/events" and answer.status == 200 else answer.read()


@pytest.mark.integration
def test_the_first_event_tells_of_every_episode(served: tuple[int, Path]) -> None:
    status, line = get(served[0], "/events")
    state = json.loads(line.removeprefix(b"data: "))
    assert status == 200
    assert (state["episodes"], state["ended"]) == (2, 1)
    rows = {row["id"]: row for row in state["rows"]}
    assert rows["couch-1"]["outcome"] == "running"
    assert (rows["couch-0"]["goal"], rows["couch-1"]["goal"]) == ("goal reached", "")
    assert rows["couch-1"]["call"] == "stop()"


@pytest.mark.parametrize("wrong", [{"target_distance": 0.21}, {"pelvis_contacts": []}])
def test_an_episode_that_stops_elsewhere_did_not_reach_its_goal(tmp_path: Path, wrong: Any) -> None:
    scene = record_episode(tmp_path / "couch-0")
    steps = tmp_path / "couch-0" / "steps.jsonl"
    *before, last = steps.read_text().splitlines()
    steps.write_text("\n".join([*before, json.dumps(json.loads(last) | wrong)]) + "\n")
    (row,) = Watcher(tmp_path, lambda name: scene).rows()
    assert (row["outcome"], row["goal"]) == ("stopped", "goal not reached")


@pytest.mark.integration
def test_the_view_of_an_episode_is_served(served: tuple[int, Path]) -> None:
    assert get(served[0], "/frame/couch-0/0002.jpg") == (200, picture(2))


@pytest.mark.integration
def test_the_replay_of_an_ended_episode_is_served_in_one_file(served: tuple[int, Path]) -> None:
    status, page = get(served[0], "/replay/couch-0")
    assert status == 200
    assert b'id="stage"' in page
    assert b"humanclawHouse" in page
    assert get(served[0], "/replay/couch-2")[0] == 404


def test_a_damaged_motion_of_an_unsealed_record_is_no_replay(tmp_path: Path) -> None:
    scene = record_episode(tmp_path / "couch-0")
    record = json.loads((tmp_path / "couch-0" / "episode.json").read_text("utf-8"))
    (tmp_path / "couch-0" / "episode.json").write_text(json.dumps(record | {"files": {}, "seal": ""}), "utf-8")
    (tmp_path / "couch-0" / "motion.npz").write_bytes(b"no archive")
    with pytest.raises(RecordError):
        Watcher(tmp_path, lambda name: scene).replay("couch-0")


@pytest.mark.integration
@pytest.mark.parametrize(
    "path",
    [
        "/frame/couch-0/../../secret.jpg",
        "/frame/couch-0/%2e%2e%2f%2e%2e%2fsecret.jpg",
        "/frame/no/0.jpg",
        "/replay/..",
        "/x",
    ],
)
def test_nothing_but_views_of_the_run_can_be_read(served: tuple[int, Path], path: str) -> None:
    assert get(served[0], path)[0] == 404


@pytest.mark.integration
def test_nothing_can_be_written(served: tuple[int, Path]) -> None:
    assert get(served[0], "/", "POST")[0] == 501


@pytest.fixture
def run(tmp_path: Path) -> tuple[Path, Watcher]:
    """Record a run of one episode; return its folder and a watcher."""
    scene = record_episode(tmp_path / "run" / "couch-0")
    return tmp_path / "run", Watcher(tmp_path / "run", lambda name: scene)


@pytest.mark.parametrize("text", ["", '{"epi', "[]", '{"episodes": null}', '{"episodes": "many"}'])
def test_what_the_run_is_of_may_be_damaged_or_half_written(run: tuple[Path, Watcher], text: str) -> None:
    (run[0] / "run.json").write_text(text)
    state = run[1].state()
    assert (state["asked"], state["episodes"]) == (0, 1)


def test_an_episode_that_is_damaged_is_left_out_until_it_can_be_read(run: tuple[Path, Watcher]) -> None:
    record_episode(run[0] / "couch-1", name="couch-1")
    whole = (run[0] / "couch-1" / "episode.json").read_bytes()
    for text in (whole[:50], whole):
        (run[0] / "couch-1" / "episode.json").write_bytes(text)
        names = {row["id"] for row in run[1].state()["rows"]}
        assert ("couch-1" in names) == (text == whole)


def test_a_run_that_is_deleted_is_watched_as_an_empty_one(run: tuple[Path, Watcher]) -> None:
    assert run[1].state()["episodes"] == 1
    shutil.rmtree(run[0])
    assert run[1].state()["rows"] == []
    assert _content(run[1], "/replay/couch-0")[0] == b""
    assert run[1].frame("couch-0", "0000.jpg") == b""


def test_the_view_is_the_one_that_is_decided_on_now(run: tuple[Path, Watcher]) -> None:
    (row,) = run[1].state()["rows"]
    assert row["frame"] == f"/frame/couch-0/{row['steps'] - 1:04d}.jpg", "of an episode that has ended the last"
    broken_off(run[0] / "couch-0")
    (run[0] / "couch-0" / "frames" / f"{row['steps']:04d}.jpg").write_bytes(picture(0))
    (row,) = run[1].state()["rows"]
    assert row["frame"] == f"/frame/couch-0/{row['steps']:04d}.jpg"


def test_of_a_run_that_is_one_episode_the_view_is_found_too(run: tuple[Path, Watcher]) -> None:
    watcher = Watcher(run[0] / "couch-0", run[1].scenes)
    (row,) = watcher.state()["rows"]
    assert watcher.frame(*row["frame"].split("/")[2:]) == picture(row["steps"] - 1)
