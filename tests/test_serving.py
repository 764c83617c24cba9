"""Every server of ours: who is answered, and what is read."""

import http.client
import re
import threading
from http import HTTPStatus
from pathlib import Path

import pytest

from humanclaw import HumanclawError
from humanclaw.cli import Handler, Server

ROOT = Path(__file__).parents[1]


class Echo(Handler):
    def do_GET(self):
        self.answer(HTTPStatus.OK, b"got")

    def do_POST(self):
        self.answer(HTTPStatus.OK, self.body(9))


@pytest.fixture
def serving():
    made = Server(Echo)
    threading.Thread(target=made.serve_forever, args=(0.05,), daemon=True).start()
    yield made
    made.shutdown()
    made.server_close()


def asked(serving, method="GET", body=None, **headers):
    connection = http.client.HTTPConnection(*serving.server_address, timeout=10)
    connection.request(method, "/", body, headers)
    answer = connection.getresponse()
    return answer.status, answer.read()


@pytest.mark.integration
@pytest.mark.parametrize(
    ("headers", "status"),
    [
        ({}, 200),
        ({"Host": "localhost:9"}, 200),
        ({"Host": "evil.example"}, 403),
        ({"Host": "127.0.0.1.evil.example:80"}, 403),
        ({"Host": ""}, 403),
        ({"Origin": "http://evil.example"}, 403),
        ({"Host": "localhost:9", "Origin": "http://localhost:9"}, 200),
        ({"Host": "localhost:9", "Origin": "http://localhost:10"}, 403),
    ],
)
def test_only_names_of_this_machine_and_pages_of_its_own_are_answered(serving, headers, status):
    assert asked(serving, "POST", b"got", **headers)[0] == status


@pytest.mark.integration
@pytest.mark.parametrize("length", ["10", "-1", "9" * 5000, "1e3", "", "3, 3"])
def test_a_body_of_no_length_or_too_many_bytes_is_none(serving, length):
    assert asked(serving, "POST", b"abc", **{"Content-Length": length}) == (200, b"")


@pytest.mark.integration
def test_a_port_that_is_taken_is_said_in_words(serving):
    with pytest.raises(HumanclawError, match=rf"cannot listen on port {serving.server_port} of 127\.0\.0\.1: "):
        Server(Echo, serving.server_port)


def test_nothing_else_of_ours_listens():
    listens = re.compile(r"^(from|import) (http\.server|socketserver|uvicorn)", re.MULTILINE)
    files = (path for part in ("core", "plugins", "harnesses") for path in (ROOT / part).rglob("humanclaw*/**/*.py"))
    servers = {f"{path.parent.name}/{path.name}" for path in files if listens.search(path.read_text("utf-8"))}
    # MCP and OpenEnv speak through libraries that listen themselves, for a bounded number of sessions.
    apart = {"humanclaw_mcp/command.py", "humanclaw_openenv/server.py"}
    assert servers == {"cli/serving.py", *apart}, "derive from humanclaw.cli.Server"
