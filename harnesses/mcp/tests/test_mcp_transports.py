"""Tests of the command over both transports, with the official client."""

from __future__ import annotations

import contextlib
import json
import re
import signal
import subprocess
import sys
from functools import partial

import anyio
import anyio.to_thread
import httpx
import pytest
from mcp import Client
from mcp.client.stdio import StdioServerParameters
from mcp.shared.exceptions import MCPError

from humanclaw import HumanclawError, load_run
from humanclaw_mcp.bodies import Bodies
from humanclaw_mcp.command import http_app
from humanclaw_mcp.content import LOG
from humanclaw_mcp.server import Handlers
from humanclaw_mcp.session import Settings

pytestmark = [pytest.mark.anyio, pytest.mark.integration]
COMMAND = ("-m", "humanclaw", "mcp")
HELLO = {
    "jsonrpc": "2.0",
    "id": 1,
    "method": "initialize",
    "params": {"protocolVersion": "2025-06-18", "capabilities": {}, "clientInfo": {"name": "test", "version": "1"}},
}
ACCEPT = {"Accept": "application/json, text/event-stream"}


@pytest.fixture(scope="module")
def url():
    """A server on a free port, with room for two bodies."""
    command = [sys.executable, *COMMAND, "--http", "--port", "0", "--bodies", "2"]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as server:
        yield next(match[0] for line in server.stderr if (match := re.search(r"http://\S+", line)))
        server.terminate()


async def steps(client):
    text = (await client.read_resource(LOG)).contents[0].text
    return [json.loads(line)["skill"] for line in text.splitlines()]


async def test_over_http_every_session_has_its_own_body_up_to_a_limit(url):
    async with Client(url) as first, Client(url) as second, Client(url) as third:
        async with anyio.create_task_group() as both:
            both.start_soon(first.call_tool, "turn_in_place", {"yaw_deg": 20})
            both.start_soon(second.call_tool, "walk", {"z_cm": 30})
        assert (await steps(first), await steps(second)) == (["turn_in_place"], ["walk"])
        refused = await third.call_tool("look", {})
        assert refused.is_error
        assert "all 2 bodies of this server are in use" in refused.content[0].text
    async with Client(url) as later:
        assert not (await later.call_tool("look", {})).is_error, "sessions that end give their bodies back"


async def test_over_standard_streams_nothing_but_the_protocol_is_written():
    async with Client(StdioServerParameters(command=sys.executable, args=[*COMMAND])) as client:
        result = await client.call_tool("walk", {"z_cm": 30})
        assert [part.type for part in result.content] == ["text", "image"]
        assert await steps(client) == ["walk"]


async def test_over_http_the_sessionless_protocol_falls_back_to_a_session(url):
    async with Client(url, mode="auto") as client:
        assert client.protocol_version == "2025-11-25"
    async with Client(url, mode="2026-07-28") as client:
        with pytest.raises(MCPError, match="needs a session"):
            await client.call_tool("look", {})


@pytest.mark.parametrize(
    ("headers", "status"),
    [
        ({}, 200),
        ({"Host": "evil.example.com"}, 421),
        ({"Host": "127.0.0.1.evil.example.com:80"}, 421),
        ({"Origin": "http://evil.example.com"}, 403),
    ],
)
def test_only_names_of_this_machine_are_answered(url, headers, status):
    assert httpx.post(url, json=HELLO, headers=ACCEPT | headers).status_code == status


@pytest.fixture
async def served(anyio_backend):
    """served(settings): return an HTTP client of a server in this process, whose bodies do not move."""
    async with contextlib.AsyncExitStack() as stack:

        async def serve(settings):
            app = http_app(Handlers(Bodies(settings)), 80)
            await stack.enter_async_context(app.router.lifespan_context(app))
            transport = httpx.ASGITransport(app)
            return await stack.enter_async_context(
                httpx.AsyncClient(transport=transport, base_url="http://localhost:80")
            )

        yield serve


async def hello(client, **headers):
    return await client.post("/mcp", json=HELLO, headers=ACCEPT | {"Host": "localhost:80"} | headers)


@pytest.mark.parametrize(
    ("header", "status"),
    [
        ({"Authorization": "Bearer open-sesame-0123456789"}, 200),
        ({"Authorization": "Bearer open-sesame-012345678"}, 401),
        ({"Authorization": "Bearer "}, 401),
        ({"Authorization": "Basic b3BlbjpzZXNhbWU="}, 401),
        ({}, 401),
    ],
)
async def test_with_a_token_only_who_bears_it_is_let_in(served, monkeypatch, header, status):
    monkeypatch.setenv("BODY_TOKEN", "open-sesame-0123456789")
    client = await served(Settings(auth_env="BODY_TOKEN"))
    assert (await hello(client, **header)).status_code == status


@pytest.mark.parametrize("value", ["", "short"])
def test_a_token_that_can_be_guessed_is_refused(monkeypatch, value):
    monkeypatch.setenv("BODY_TOKEN", value)
    with pytest.raises(HumanclawError, match="BODY_TOKEN holds no token"):
        Settings(auth_env="BODY_TOKEN")


def test_a_request_that_is_too_large_is_refused(url):
    assert httpx.post(url, content=b" " * 300_000, headers=ACCEPT).status_code == 413


def test_a_port_that_is_taken_is_told_in_a_sentence(url):
    port = url.split(":")[-1].split("/")[0]
    command = [sys.executable, *COMMAND, "--http", "--port", port]
    result = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert result.returncode == 2
    assert f"cannot listen on port {port}" in result.stderr
    assert "Traceback" not in result.stderr


signals = pytest.mark.skipif(sys.platform == "win32", reason="Windows has no signal that asks for the end")


@signals
def test_a_server_on_streams_that_is_terminated_closes_its_record(fake, tmp_path):
    step = {"name": "turn_in_place", "arguments": {"yaw_deg": 30}}
    requests = [
        HELLO,
        {"jsonrpc": "2.0", "method": "notifications/initialized"},
        {"jsonrpc": "2.0", "id": 2, "method": "tools/call", "params": step},
    ]
    with subprocess.Popen(fake, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as server:
        for request in requests:
            server.stdin.write(json.dumps(request) + "\n")
        server.stdin.flush()
        next(line for line in server.stdout if json.loads(line).get("id") == 2)
        server.terminate()  # Its standard input stays open, as with a silent client.
        assert server.wait(60) == 128 + signal.SIGTERM
    (episode,) = load_run(tmp_path / "out")
    assert (episode.record.outcome, len(episode.steps)) == ("interrupted", 1)


@signals
@pytest.mark.parametrize("number", [signal.SIGTERM, getattr(signal, "SIGHUP", None)], ids=["ended", "hung up"])
async def test_a_server_on_http_that_is_terminated_closes_its_record(fake, tmp_path, number):
    command = [*fake, "--http", "--port", "0"]
    heard = partial(signal.signal, number, signal.SIG_DFL)  # Tests started by nohup pass on that SIGHUP is ignored.
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True, preexec_fn=heard) as server:
        address = next(match[0] for line in server.stderr if (match := re.search(r"http://\S+", line)))
        async with Client(address) as client:
            await client.call_tool("turn_in_place", {"yaw_deg": 30})
            server.send_signal(number)  # While the client is connected.
            await anyio.to_thread.run_sync(server.wait, 60)
    (episode,) = load_run(tmp_path / "out")
    assert (episode.record.outcome, len(episode.steps)) == ("interrupted", 1)
