"""Tests of tools, resources and prompt with one client, one body and one house."""

from __future__ import annotations

import base64
import io
import json
from typing import Literal

import numpy as np
import pytest
from mcp import Client
from mcp.shared.exceptions import MCPError
from PIL import Image

from humanclaw import CallError, Keyframes, load_run, skill
from humanclaw_mcp.content import LOG, STATE, task
from humanclaw_mcp.server import Handlers, make_server
from humanclaw_mcp.session import Settings

pytestmark = pytest.mark.anyio
FREE = ("stop", "turn_in_place", "walk")
"""Skills that these tests need."""


@pytest.fixture(scope="module")
async def client(bodies):
    async with Client(make_server(Handlers(bodies)), mode="legacy", client_info=None) as client:
        yield client


@pytest.fixture
async def begun(client):
    """A client whose episode has just begun, seed 0."""
    await client.call_tool("reset", {"seed": 0})
    return client


def picture(result):
    return np.asarray(Image.open(io.BytesIO(base64.b64decode(result.content[1].data))))


async def state(client):
    return json.loads((await client.read_resource(STATE)).contents[0].text)


async def test_the_trained_skills_are_the_tools_with_their_own_schemas(client, bodies):
    tools = {tool.name: tool for tool in (await client.list_tools()).tools}
    trained = {name for name, skill in bodies.plugins.skills.items() if skill.trained}
    assert set(FREE) <= trained
    assert set(tools) == trained | {"look", "reset"}
    assert tools["walk"].input_schema["required"] == ["z_cm"]
    assert tools["walk"].input_schema["properties"]["z_cm"]["maximum"] == 80
    assert tools["look"].annotations.read_only_hint
    assert not tools["walk"].annotations.read_only_hint


async def test_a_call_answers_with_text_then_the_view_then_values(begun):
    before = await begun.call_tool("look", {})
    after = await begun.call_tool("walk", {"z_cm": 50})
    assert not after.is_error
    assert [part.type for part in after.content] == ["text", "image"]
    assert after.content[0].text.startswith("Executed walk(x_cm=0, z_cm=50, yaw_deg=0). Step 1 of 5.")
    assert picture(after).shape == (512, 512, 3)
    assert np.abs(picture(after).astype(int) - picture(before)).mean() > 1, "the view has moved"
    assert after.structured_content["executed"]
    assert after.structured_content["parameters"] == {"x_cm": 0, "z_cm": 50, "yaw_deg": 0}


async def test_looking_moves_nothing_and_takes_no_step(begun):
    before = await state(begun)
    result = await begun.call_tool("look", {})
    assert result.structured_content["step"] == 0
    assert not result.structured_content["executed"]
    assert await state(begun) == before


async def test_the_state_of_the_body_tells_nothing_of_the_scene(begun):
    assert set(await state(begun)) == {
        "step", "max_steps", "outcome", "forward", "left", "heading", "pelvis_height", "joints", "touching", "seated",
    }  # fmt: skip
    known = await state(begun)
    place = known["forward"], known["left"], known["heading"]
    assert place == pytest.approx((0, 0, 0), abs=0.01), "it counts from its own beginning"
    assert known["joints"]["left_hip"][0] > 0 > known["joints"]["right_hip"][0]
    assert known["joints"]["head"][1] == pytest.approx(1.5, abs=0.15)


async def test_a_call_out_of_bounds_is_refused_in_the_words_of_the_core(begun, bodies):
    result = await begun.call_tool("walk", {"z_cm": 400})
    with pytest.raises(CallError) as refusal:
        bodies.plugins.skill("walk").check({"z_cm": 400})
    assert result.is_error
    assert result.content[0].text == f"{refusal.value} Step 0 of 5."
    assert not result.structured_content["executed"]


async def test_a_misspelt_tool_is_an_error_that_names_the_right_one(begun):
    result = await begun.call_tool("wlak", {"z_cm": 40})
    assert result.is_error
    assert "Did you mean walk?" in result.content[0].text


@pytest.mark.parametrize(
    ("name", "arguments", "fault"),
    [
        ("reset", {"scene": "file:/etc/passwd"}, "is not one of"),
        ("reset", {"seed": "seven"}, "seed: 'seven' is not of type 'integer'"),
        ("look", {"far": True}, "Additional properties are not allowed"),
    ],
)
async def test_wrong_arguments_of_the_other_tools_are_errors_too(begun, name, arguments, fault):
    result = await begun.call_tool(name, arguments)
    assert result.is_error
    assert fault in result.content[0].text


async def test_three_refused_calls_in_a_row_cost_a_step(begun):
    for _ in range(3):
        result = await begun.call_tool("walk", {})
    assert result.is_error
    assert result.structured_content["step"] == 1
    assert (await state(begun))["forward"] == pytest.approx(0, abs=0.01)


async def test_the_log_tells_calls_and_refusals(begun):
    await begun.call_tool("walk", {"z_cm": -5})
    await begun.call_tool("turn_in_place", {"yaw_deg": -30})
    lines = (await begun.read_resource(LOG)).contents[0].text.splitlines()
    assert len(lines) == 1
    step = json.loads(lines[0])
    assert (step["skill"], step["parameters"]) == ("turn_in_place", {"yaw_deg": -30})
    assert "less than the minimum" in step["refused"][0]


async def test_after_stop_nothing_moves_until_reset(begun):
    stopped = await begun.call_tool("stop", {})
    assert stopped.structured_content["outcome"] == "stopped"
    assert picture(stopped).shape == (512, 512, 3)
    late = await begun.call_tool("walk", {"z_cm": 40})
    assert late.is_error
    assert "Call reset" in late.content[0].text
    again = await begun.call_tool("reset", {})
    assert again.structured_content["outcome"] == "running"
    assert again.structured_content["step"] == 0


async def test_every_episode_is_recorded_like_any_other(client, records):
    await client.call_tool("reset", {"instruction": "find a couch and sit on it"})
    await client.call_tool("stop", {})
    episode = max(load_run(records), key=lambda episode: episode.folder.stat().st_mtime)
    assert episode.record.agent == "mcp:mcp"
    assert episode.record.outcome == "stopped"
    assert episode.record.spec.target_category == "couch"
    assert [step.call.skill for step in episode.steps] == ["stop"]
    await client.call_tool("reset", {"instruction": "Do as you are asked."})


async def test_the_prompt_explains_the_task(client, bodies):
    prompt = (await client.list_prompts()).prompts[0]
    words = (await client.get_prompt(prompt.name, {"instruction": "Find the toilet."})).messages[0].content.text
    assert "Goal: Find the toilet." in words
    assert "turn_in_place (yaw_deg -75 to 75)" in words
    assert bodies.plugins.skill("walk").checks[0].question in words


def test_the_prompt_names_the_choices_of_a_parameter():
    @skill()
    def wave(side: Literal["left", "right"] = "left") -> Keyframes:
        """Wave a hand."""
        return Keyframes.cycle(f"{side}_wrist", "x", 20, 0.5)

    assert "- wave (side left or right): Wave a hand." in task("Wave.", [wave], Settings())


async def test_an_unknown_resource_is_a_protocol_error_that_names_the_known(client):
    with pytest.raises(MCPError, match="humanclaw://body/state"):
        await client.read_resource("file:///etc/passwd")
    with pytest.raises(MCPError, match="task"):
        await client.get_prompt("poem")
