"""Tests of a house that two clients share, over HTTP, with bodies that no physics moves."""

from __future__ import annotations

import re
import subprocess
import time

import anyio
import pytest
from mcp import Client

from humanclaw import load_run

pytestmark = [pytest.mark.anyio, pytest.mark.integration]
TURN, WALK = ("turn_in_place", {"yaw_deg": 30}), ("walk", {"z_cm": 30})


@pytest.fixture
def house(fake):
    """The address of a server of one house with two bodies, who wait 4 s for each other."""
    command = [*fake, "--http", "--port", "0", "--company", "2", "--patience", "4"]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as server:
        yield next(match[0] for line in server.stderr if (match := re.search(r"http://\S+", line)))
        server.terminate()


def words(result):
    return result.content[0].text


async def test_two_clients_move_two_bodies_of_one_house_together(house, tmp_path):
    async with Client(house) as first, Client(house) as other:
        assert "reset" not in {tool.name for tool in (await first.list_tools()).tools}
        async with anyio.create_task_group() as both:
            both.start_soon(first.call_tool, *TURN)
            both.start_soon(other.call_tool, *WALK)
        for client in (first, other):
            assert not (await client.call_tool("stop", {})).is_error
    first, other = load_run(tmp_path / "out")
    assert first.record.company == other.record.company == (first.record.spec.id, other.record.spec.id)
    assert [len(first.motion()), len(other.motion())] == [20, 20]
    assert [step.waited for step in (*first.steps, *other.steps)] == [0, 0, 0, 0]


async def test_the_second_who_asks_for_a_body_is_told_what_is_free(house):
    async with Client(f"{house}?body=2") as first:
        assert not (await first.call_tool("look", {})).is_error
        async with Client(f"{house}?body=2") as other, Client(f"{house}?body=3") as third:
            for client, number in ((other, 2), (third, 3)):
                refused = await client.call_tool("look", {})
                assert refused.is_error
                assert words(refused).startswith(f"body '{number}' of 2 is not free in this house. Ask for 1, or once")
                assert "at the latest 900 s after its last call" in words(refused)
        assert "begins anew once all" in words(await first.call_tool("reset", {}))
    async with Client(f"{house}?body=2") as later:
        assert not (await later.call_tool("look", {})).is_error


async def test_who_comes_back_goes_on_with_the_body_that_was_left(house, tmp_path):
    async with Client(f"{house}?body=1") as client:
        async with Client(f"{house}?body=2") as two, anyio.create_task_group() as both:
            both.start_soon(client.call_tool, *TURN)
            both.start_soon(two.call_tool, *WALK)
        assert not (await client.call_tool(*TURN)).is_error
        async with Client(f"{house}?body=2") as back:
            assert "Step 1 of" in words(await back.call_tool("look", {}))
            async with anyio.create_task_group() as both:
                both.start_soon(client.call_tool, *TURN)
                both.start_soon(back.call_tool, *WALK)
    assert [len(record.steps) for record in load_run(tmp_path / "out")] == [3, 2]


async def test_who_is_alone_in_the_house_is_told_whom_it_waits_for(house):
    async with Client(f"{house}?body=2") as alone:
        for call in (("look", {}), TURN):
            sentence = "Nobody has body 1 yet: the first move waits 4 s for it."
            assert sentence in words(await alone.call_tool(*call))
        assert sentence not in words(await alone.call_tool(*TURN))


async def test_a_body_whose_client_has_gone_stands_while_the_other_goes_on(house):
    async with Client(house) as client:
        await client.call_tool("look", {})
        async with Client(house) as other:
            await other.call_tool("look", {})
        began = time.monotonic()
        assert not (await client.call_tool(*TURN)).is_error
        assert time.monotonic() - began < 4, "nobody waits for who has gone"


async def test_who_falls_silent_is_waited_for_once_and_told_of_it(house):
    async with Client(house) as client, Client(house) as silent:
        await silent.call_tool("look", {})
        for _ in range(3):
            assert not (await client.call_tool(*TURN)).is_error
        assert words(await silent.call_tool(*WALK)).startswith("1.5 s passed while you thought.")
