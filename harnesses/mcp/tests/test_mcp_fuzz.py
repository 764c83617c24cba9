"""Tests of malformed requests: each gets an error of the protocol, and the server serves the next one."""

from __future__ import annotations

import json
import random

import httpx
import pytest
from fuzzing import thorough

from humanclaw_mcp.command import http_app
from humanclaw_mcp.server import Handlers
from humanclaw_mcp.session import Bodies, Settings

pytestmark = pytest.mark.anyio
HELLO = {
    "jsonrpc": "2.0",
    "id": 1,
    "method": "initialize",
    "params": {"protocolVersion": "2025-06-18", "capabilities": {}, "clientInfo": {"name": "test", "version": "1"}},
}
METHODS = ("tools/list", "tools/call", "resources/read", "prompts/get", "completion/complete", "logging/setLevel", "x")
ODD = (None, -1, 1e308, "", "a" * 1000, [], {}, [[[]]], {"name": None}, "\ud800", True, "../../etc/passwd")
HEADERS = {"Host": "localhost:80", "Accept": "application/json, text/event-stream", "Content-Type": "application/json"}


def malformed(rng: random.Random) -> bytes:
    """Return a malformed request. None reaches a body, because no name is that of a skill."""
    params = {rng.choice(["name", "uri", "arguments", "ref", "level", "_meta"]): rng.choice(ODD) for _ in range(3)}
    request = {"jsonrpc": "2.0", "id": rng.choice([1, "a", None, 1.5]), "method": rng.choice(METHODS), "params": params}
    for key in rng.sample(list(request), rng.randint(0, 2)):
        request[key] = rng.choice(ODD)
    text = json.dumps(rng.choice([request, [request], request]))
    return text[: rng.randint(0, len(text))].encode() if rng.random() < 0.2 else text.encode()


async def test_malformed_requests_are_answered_and_the_next_one_is_served():
    rng, app = random.Random(18), http_app(Handlers(Bodies(Settings())), 80)
    transport = httpx.ASGITransport(app)
    async with (
        app.router.lifespan_context(app),
        httpx.AsyncClient(transport=transport, base_url="http://localhost:80", headers=HEADERS, timeout=30) as client,
    ):
        key = (await client.post("/mcp", json=HELLO)).headers["mcp-session-id"]
        session = {"mcp-session-id": key}
        for _ in range(12_500 if thorough() else 60):
            content = malformed(rng)
            answer = await client.post("/mcp", content=content, headers=session)
            assert answer.status_code < 500, (content, answer.text)
        ping = {"jsonrpc": "2.0", "id": 9, "method": "tools/list"}
        assert "walk" in (await client.post("/mcp", json=ping, headers=session)).text
