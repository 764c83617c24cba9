"""Tests of progress, log messages, changed resources and completions."""

from __future__ import annotations

import base64
import io

import anyio
import mcp_types as types
import pytest
from mcp import Client
from mcp.shared.exceptions import MCPError
from PIL import Image

from humanclaw_mcp.bodies import Bodies
from humanclaw_mcp.content import LOG, STATE, VIEW
from humanclaw_mcp.server import Handlers, make_server
from humanclaw_mcp.session import Settings

pytestmark = [
    pytest.mark.anyio,
    # Most clients still speak the protocol versions that have these requests.
    pytest.mark.filterwarnings("ignore::mcp.shared.exceptions.MCPDeprecationWarning"),
]


@pytest.fixture(scope="module")
def heard():
    """The notifications that the client got."""
    return []


@pytest.fixture(scope="module")
async def client(heard):
    async def logged(message):
        heard.append((message.level, message.data))

    async def received(message):
        if isinstance(message, types.ResourceUpdatedNotification):
            heard.append(str(message.params.uri))

    server = make_server(Handlers(Bodies(Settings(max_steps=5, progress_every=0.005))))
    async with Client(server, mode="legacy", logging_callback=logged, message_handler=received) as client:
        yield client


@pytest.fixture
async def begun(client, heard):
    """A client at the start of an episode, without any subscription."""
    await client.call_tool("reset", {"seed": 0})
    heard.clear()
    return client


async def test_a_call_tells_its_progress_to_those_who_ask(begun):
    updates = []

    async def note(progress, total, message):
        updates.append((progress, message))

    await begun.call_tool("walk", {"z_cm": 30}, progress_callback=note)
    seconds = [progress for progress, _ in updates]
    assert len(updates) >= 3, "a step of the body takes longer than three times 5 ms"
    assert seconds == sorted(set(seconds)), "progress only ever grows"
    assert updates[-1][1] == "The body is moving."


async def test_log_messages_come_at_the_level_that_was_asked_for(begun, heard):
    await begun.call_tool("walk", {"z_cm": 400})
    assert heard == [], "without being asked, the server says nothing"
    await begun.set_logging_level("warning")
    await begun.call_tool("turn_in_place", {"yaw_deg": 10})
    refused = await begun.call_tool("walk", {"z_cm": 400})
    assert heard == [("warning", refused.content[0].text)]
    await begun.set_logging_level("info")
    await begun.call_tool("turn_in_place", {"yaw_deg": 10})
    assert heard[-1][0] == "info"
    assert heard[-1][1].startswith("Executed turn_in_place(yaw_deg=10).")
    await begun.set_logging_level("emergency")


async def test_a_subscriber_is_told_when_the_body_has_moved(begun, heard):
    await begun.subscribe_resource(STATE)
    await begun.call_tool("look", {})
    assert heard == []
    await begun.call_tool("turn_in_place", {"yaw_deg": 10})
    assert heard == [STATE], "and not of the resources that it did not subscribe to"
    await begun.unsubscribe_resource(STATE)
    await begun.call_tool("turn_in_place", {"yaw_deg": 10})
    assert heard == [STATE]


async def test_the_newest_protocol_listens_for_the_same_changes():
    server = make_server(Handlers(Bodies(Settings(max_steps=5))))
    async with Client(server, mode="2026-07-28") as client, client.listen(resource_subscriptions=[STATE]) as changes:
        await client.call_tool("turn_in_place", {"yaw_deg": 10})
        with anyio.fail_after(30):
            assert (await anext(aiter(changes))).uri == STATE


async def test_what_is_not_there_cannot_be_subscribed_to(begun):
    with pytest.raises(MCPError, match=LOG):
        await begun.subscribe_resource("file:///etc/passwd")


async def test_the_view_can_be_read_as_a_picture(begun):
    content = (await begun.read_resource(VIEW)).contents[0]
    assert content.mime_type == "image/jpeg"
    assert Image.open(io.BytesIO(base64.b64decode(content.blob))).size == (512, 512)
    listed = {resource.uri for resource in (await begun.list_resources()).resources}
    assert listed == {STATE, VIEW, LOG}


async def test_arguments_are_completed(begun):
    task = types.PromptReference(name="task")
    answer = await begun.complete(task, {"name": "instruction", "value": "find a c"})
    assert answer.completion.values == ["Find a chair.", "Find a couch and sit on it."]
