"""`humanclaw tools --format` prints what each provider's interface takes, by the provider's own types."""

from __future__ import annotations

import functools
import json

import pytest
from click.testing import CliRunner
from pydantic import TypeAdapter

from humanclaw.cli import build

SAID = ("visible_state", "progress", "mid_level_change", "mid_level_goal", "reasoning")
"""The reasoning, in the order in which a model shall think."""


@pytest.fixture
def printed(plugins):
    return functools.partial(run, build(lambda: plugins))


def run(command, form, *options):
    done = CliRunner().invoke(command, ["tools", "--format", form, *options])
    assert done.exit_code == 0, done.output
    return json.loads(done.output)


def named(tools, name):
    return next(tool for tool in tools if tool["name"] == name)


def valid(kind, tools):
    """Raises ValidationError if a tool lacks what the provider's type requires, or holds it in another form."""
    return len(list(TypeAdapter(list[kind]).validate_python(tools))) == len(tools)


def test_openai_takes_the_list(printed):
    chat = pytest.importorskip("openai.types.chat", reason="the package openai is not installed")
    tools = printed("openai")
    assert valid(chat.ChatCompletionFunctionToolParam, tools)
    assert all(set(tool) == {"type", "function"} and tool["type"] == "function" for tool in tools)
    walk = named([tool["function"] for tool in tools], "walk")
    assert set(walk) == {"name", "description", "parameters"}
    assert tuple(walk["parameters"]["properties"])[:5] == SAID
    assert walk["parameters"]["properties"]["z_cm"]["type"] == "integer"


def test_anthropic_takes_the_list(printed):
    tools = printed("anthropic")
    walk = named(tools, "walk")
    assert set(walk) == {"name", "description", "input_schema"}
    assert walk["input_schema"]["type"] == "object"
    assert walk["input_schema"]["required"] == [*SAID, "z_cm"]
    types = pytest.importorskip("anthropic.types", reason="the package anthropic is not installed")
    assert valid(types.ToolParam, tools)


def test_gemini_takes_the_list(printed):
    (tool,) = tools = printed("gemini")
    walk = named(tool["functionDeclarations"], "walk")
    assert walk["parameters"]["propertyOrdering"][:5] == list(SAID)
    assert "additionalProperties" not in walk["parameters"]
    types = pytest.importorskip("google.genai.types", reason="the package google-genai is not installed")
    declared = (
        TypeAdapter(list[types.Tool]).validate_python(tools)[0].function_declarations
    )  # It forbids unknown fields.
    read = next(each for each in declared if each.name == "walk").parameters
    assert (read.type, read.properties["z_cm"].type, read.properties["z_cm"].maximum) == ("OBJECT", "INTEGER", 80)


def test_gemini_is_sent_no_object_without_properties(printed):
    (tool,) = printed("gemini", "--no-reasoning")
    assert "parameters" not in named(tool["functionDeclarations"], "stop")


def test_mcp_gets_the_result_of_a_listing(printed):
    listing = printed("mcp")
    assert set(named(listing["tools"], "walk")["inputSchema"]["properties"]) == {"x_cm", "z_cm", "yaw_deg"}
    types = pytest.importorskip("mcp_types", reason="the package mcp is not installed")
    assert {"walk", "stop"} <= {tool.name for tool in types.ListToolsResult.model_validate(listing).tools}


@pytest.mark.parametrize("form", ["openai", "anthropic", "gemini", "mcp"])
def test_the_reasoning_can_be_had_or_left_out_in_every_format(printed, form):
    assert '"visible_state"' in json.dumps(printed(form, "--reasoning"))
    assert '"visible_state"' not in json.dumps(printed(form, "--no-reasoning"))
