"""Tests of limits that need no motion."""

from __future__ import annotations

import anyio
import pytest
from mcp import Client

from humanclaw import Call, HumanclawError, Keyframes, Plugins, Verdict, hookimpl, skill
from humanclaw.checks.fakes import Fakes
from humanclaw.records import Answer
from humanclaw_mcp import content
from humanclaw_mcp.bodies import Bodies
from humanclaw_mcp.server import Handlers, make_server
from humanclaw_mcp.session import Settings

pytestmark = pytest.mark.anyio


async def test_a_body_that_nobody_calls_is_put_away():
    bodies = Bodies(Settings(idle=0.2))
    bodies.of("a", "")
    await bodies.evict_idle()
    assert len(bodies) == 1
    await anyio.sleep(0.25)
    bodies.of("b", "")
    await bodies.evict_idle()
    assert bodies.find("a") is None
    assert bodies.find("b") is not None
    with pytest.raises(HumanclawError, match=r"put away after 0.2 seconds without a call. Call look"):
        bodies.of("a", "")
    assert bodies.of("a", "") is bodies.find("a"), "told once, the client may begin anew"
    await bodies.close()


async def test_there_are_no_more_bodies_than_allowed():
    bodies = Bodies(Settings(bodies=1))
    first = bodies.of("a", "")
    assert bodies.of("a", "") is first
    with pytest.raises(HumanclawError, match="all 1 bodies of this server are in use"):
        bodies.of("b", "")
    await bodies.release("a")
    bodies.of("b", "")
    await bodies.close()


async def test_a_scene_that_does_not_exist_is_told_and_can_be_left():
    bodies = Bodies(Settings(scenes=("hause:0",)))
    async with Client(make_server(Handlers(bodies))) as client:
        for _ in range(2):
            result = await client.call_tool("look", {})
            assert result.is_error
            assert "Did you mean house?" in result.content[0].text


def test_a_skill_cannot_take_the_name_of_a_tool_of_the_server():
    tools = {tool.name for tool in content.tools([], Settings())}
    assert tools
    for name in tools:
        made, plugins = skill(name=name)(lambda: Keyframes.cycle("neck", axis="x", degrees=-20, seconds=0.5)), Plugins()
        plugins.add(Fakes([made]), "odd")
        assert f"'{name}' is taken: a harness has a tool of that name" in plugins.disabled[name]


async def test_with_the_reasoning_a_call_says_what_is_seen_first():
    bodies = Bodies(Settings(reasoning=True))
    async with Client(make_server(Handlers(bodies))) as client:
        walk = next(tool for tool in (await client.list_tools()).tools if tool.name == "walk")
        assert list(walk.input_schema["properties"])[:2] == ["visible_state", "progress"]
        assert list(walk.input_schema["properties"])[-1] == "yaw_deg"


def test_an_empty_instruction_is_refused():
    with pytest.raises(HumanclawError, match="the instruction is empty"):
        Settings(instruction=" ")


class Turned:
    """A plugin whose verifier replaces every walk by a turn."""

    name, settings = "turned", {"strict": True}

    @hookimpl
    def humanclaw_verifiers(self, register):
        register("turned", lambda options: self, "Turns instead of walking.")

    def begin(self, context):
        self.task = context.spec.instruction

    def verify(self, observation, call, skill, goal):
        replacement = None if call.skill != "walk" else Call("turn_in_place", {"yaw_deg": 10})
        return Verdict(replacement is None, replacement, (Answer("Is the way free?", replacement is None),))


async def test_a_verifier_checks_a_clients_calls_before_the_body_moves():
    plugins, judge = Plugins.discover(), Turned()
    plugins.add(judge, "turned")
    bodies = Bodies(Settings(verifier="turned", max_steps=3), plugins)
    async with Client(make_server(Handlers(bodies))) as client:
        result = await client.call_tool("walk", {"z_cm": 50})
    assert "walk(z_cm=50) was not executed" in result.content[0].text
    assert "Executed turn_in_place(yaw_deg=10) in its place." in result.content[0].text
    assert judge.task == "Do as you are asked."
    await bodies.close()


def test_an_option_without_a_verifier_is_refused():
    with pytest.raises(HumanclawError, match=r"--option belongs to a verifier, and none is named. Add --verifier NAME"):
        Settings(options={"model": "x"})
