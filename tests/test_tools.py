"""Skills as the tools of a model: what is published in each format, and how an answer is read back."""

import json

import jsonschema
import pytest
from growing import growth

from humanclaw import Keyframes, Skill
from humanclaw.errors import CallError
from humanclaw.skills import (
    REASONING_FIELDS,
    Call,
    answer_schema,
    read_answer,
    read_call,
    read_text,
    tool_list,
)

SAID = {
    "visible_state": "a door",
    "progress": "search",
    "mid_level_change": "keep",
    "mid_level_goal": "pass the door",
    "reasoning": "it is open",
}


def made(name, description="Do it.", required=(), **properties):
    """A skill with a given schema; what it would play does not matter here."""
    schema = {"type": "object", "properties": properties, "required": list(required), "additionalProperties": False}
    return Skill(name, description, schema, lambda params: Keyframes.cycle("head", "x", 10, 1.0))


STEP = made(
    "step", "Take a step.", ["z_cm"], z_cm={"type": "integer", "minimum": 0, "maximum": 80, "description": "Far."}
)
TURN = made("turn", "Turn.", ["yaw_deg"], yaw_deg={"type": "integer", "minimum": -75, "maximum": 75})
BACK = made("back", "Go back.", ["z_cm"], z_cm={"type": "integer", "minimum": 5, "maximum": 100})


def nested(levels):
    """A dictionary in a dictionary in a dictionary..."""
    inner = 1
    for _ in range(levels):
        inner = {"in": inner}
    return inner


# -- tool lists --------------------------------------------------------------------------------------------------------
def test_the_reasoning_comes_first_and_is_required():
    (tool,) = tool_list([STEP], "openai")
    parameters = tool["function"]["parameters"]
    assert list(parameters["properties"]) == [*REASONING_FIELDS, "z_cm"] == parameters["required"]
    assert parameters["properties"]["mid_level_change"]["enum"] == ["keep", "revise"]
    assert parameters["properties"]["z_cm"] == STEP.schema["properties"]["z_cm"]


def test_without_the_reasoning_a_tool_is_the_skills_own_schema():
    (tool,) = tool_list([STEP], "openai", reasoning=False)
    assert tool == {
        "type": "function",
        "function": {"name": "step", "description": "Take a step.", "parameters": dict(STEP.schema)},
    }


def test_without_the_mid_level_its_fields_are_not_asked_for():
    (tool,) = tool_list([STEP], "openai", mid_level=False)
    assert list(tool["function"]["parameters"]["properties"]) == ["visible_state", "progress", "reasoning", "z_cm"]


@pytest.mark.parametrize(
    ("form", "read"),
    [
        ("openai", lambda tools: [(t["function"]["name"], t["function"]["parameters"]) for t in tools]),
        ("anthropic", lambda tools: [(t["name"], t["input_schema"]) for t in tools]),
        ("mcp", lambda tools: [(t["name"], t["inputSchema"]) for t in tools]),
        ("gemini", lambda tools: [(t["name"], t["parameters"]) for t in tools[0]["functionDeclarations"]]),
    ],
)
def test_every_format_holds_every_skill_with_its_bounds(form, read):
    tools = read(tool_list([STEP, TURN], form, reasoning=False))
    assert [name for name, _ in tools] == ["step", "turn"]
    assert tools[1][1]["properties"]["yaw_deg"] == TURN.schema["properties"]["yaw_deg"]
    json.dumps(tools, allow_nan=False)


def test_gemini_gets_no_word_that_it_does_not_know():
    odd = made("odd", n={"type": "integer", "enum": [1, 2], "default": 1, "$comment": "x", "title": "N"})
    (tools,) = tool_list([odd], "gemini", reasoning=False)
    parameters = tools["functionDeclarations"][0]["parameters"]
    assert "additionalProperties" not in parameters
    assert parameters["properties"]["n"] == {"type": "integer", "description": "One of 1, 2."}


def test_an_unknown_format_names_the_known_ones():
    with pytest.raises(ValueError, match="openai, anthropic, gemini, mcp; got 'xml'"):
        tool_list([STEP], "xml")


def test_one_schema_for_all_skills_holds_the_widest_bounds():
    schema = answer_schema([STEP, BACK, TURN])
    assert list(schema["properties"]) == [*REASONING_FIELDS, "skill", "parameters"]
    assert schema["properties"]["skill"]["enum"] == ["step", "back", "turn"]
    shared = schema["properties"]["parameters"]["properties"]
    assert (shared["z_cm"]["minimum"], shared["z_cm"]["maximum"]) == (0, 100)
    jsonschema.validate({**SAID, "skill": "back", "parameters": {"z_cm": 100}}, schema)


# -- reading -----------------------------------------------------------------------------------------------------------
def test_a_call_is_parted_from_its_reasoning():
    reasoning, call = read_call("step", json.dumps({**SAID, "z_cm": 40}))
    assert vars(reasoning) == SAID | {"note_to_self": "", "expected_success": None}
    assert call == Call("step", {"z_cm": 40})


def test_nothing_is_converted():
    assert read_call("step", {"z_cm": "40"})[1].params == {"z_cm": "40"}
    assert read_call("step", {"z_cm": 4000})[1].params == {"z_cm": 4000}


def test_a_change_that_is_neither_keep_nor_revise_is_nothing():
    assert read_call("step", {"mid_level_change": "REVISE "})[0].mid_level_change == "revise"
    assert read_call("step", {"mid_level_change": "perhaps"})[0].mid_level_change == ""


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ('{"z_cm": 4', "cut off"),
        ("[]", "got list"),
        ('{"z_cm": NaN}', "plain numbers"),
        ("[" * 100_000, "not valid JSON"),
        ('{"z_cm": ' + "9" * 100_000 + "}", "longer than 100000 letters"),
        ('{"z_cm": 1' + "0" * 400 + "}", "plain numbers"),
        ('{"z_cm": ' + '{"a":' * 400 + "1" + "}" * 401, "nested more than 16 levels"),
        ({"z_cm": nested(5_000)}, "nested more than 16 levels"),
        ('{"z_cm": 4, "z_cm": 40}', "'z_cm' is there twice"),
        ('{"z_cm": {"a": 1, "a": 2}}', "'a' is there twice"),
    ],
)
def test_arguments_that_cannot_be_read_are_explained(arguments, words):
    with pytest.raises(CallError, match=words):
        read_call("step", arguments)


@pytest.mark.parametrize(
    "text",
    [
        '{"skill": "step", "parameters": {"z_cm": 40}}',
        'Well.\n```json\n{"skill": "step", "parameters": {"z_cm": 40}}\n```',
        '<think>{"skill": "turn", "parameters": {}}</think>{"name": "step", "arguments": "{\\"z_cm\\": 40}"}',
        '{"skill": "step", "parameters": {"z_cm": 40, "yaw_deg": null}}',
        '{"skill": "step", "z_cm": 40}',
        '{"note": {"a": 1}} {"skill": "step", "parameters": {"z_cm": 40}}',
    ],
)
def test_a_call_is_found_in_a_text(text):
    assert [call for _, call in read_text(text)] == [Call("step", {"z_cm": 40})]


def test_every_call_of_a_text_is_found_equal_ones_too():
    first, second = '{"skill": "step", "parameters": {"z_cm": 40}}', '{"skill": "turn", "parameters": {"yaw_deg": 9}}'
    assert [call.skill for _, call in read_text(first + second + first)] == ["step", "turn", "step"]


@pytest.mark.parametrize("text", ["", "I walk.", '{"skill": "step", "parameters": {"z_cm": 4', '{"thought": "none"}'])
def test_a_text_without_a_whole_call_holds_none(text):
    with pytest.raises(CallError, match="no complete JSON object"):
        read_text(text)


@pytest.mark.parametrize(
    "opening", ["{", '{"a":', '{"a":[', "{ ", '{"skill": "step", "parameters": ', "<think>", "```{"]
)
def test_a_text_that_closes_nothing_takes_time_by_its_length(opening):
    def read(text):
        with pytest.raises(CallError, match="no complete JSON object"):
            read_text(text)

    assert growth(read, opening, 6_250) < 64


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('{"skill": "step", "skill": "turn", "parameters": {"skill": "step", "z_cm": 40}}', "'skill' is there twice"),
        ('{"skill": "step", "parameters": {"z_cm": 4, "z_cm": 40}}', "'z_cm' is there twice"),
        ('{"skill": "step", "z_cm": 4, "parameters": {"z_cm": 40}}', "'z_cm' is given twice"),
        ("Well. " * 20_000 + '{"skill": "step", "parameters": {"z_cm": 40}}', "longer than 100000 letters"),
    ],
)
def test_of_two_meanings_of_a_text_none_is_executed(text, words):
    with pytest.raises(CallError, match=words):
        read_text(text)


def test_an_answer_needs_a_name_and_an_object():
    with pytest.raises(CallError, match="must be the name of a skill"):
        read_answer({"parameters": {}})
    with pytest.raises(CallError, match="must be an object"):
        read_answer({"skill": "step", "parameters": [40]})


@pytest.mark.parametrize(
    ("thoughts", "said"),
    [
        ("visible_state: a couch: red\nprogress: near", {"visible_state": "a couch: red", "progress": "near"}),
        ("1. **Visible_State**: a couch\n   and a lamp", {"visible_state": "a couch and a lamp"}),
        ("The way is free.", {"reasoning": "The way is free."}),
        ("Well.\nmid_level_goal - reach it\nmid_level_change: KEEP", {"reasoning": "Well. mid_level_goal - reach it",
                                                                    "mid_level_change": "keep"}),
        ("", {}),
    ],
)  # fmt: skip
def test_thoughts_in_one_text_are_read_by_the_names_of_lines(thoughts, said):
    reasoning, call = read_call("step", {"thoughts": thoughts, "z_cm": 40})
    assert {key: text for key, text in vars(reasoning).items() if text} == said
    assert call == Call("step", {"z_cm": 40})
