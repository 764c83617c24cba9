"""Tests of a body's skills as tools of agent frameworks: common behaviour, and the installed frameworks.

`make clients` tests every framework with its real package, each in its own environment.
"""

import io
import sys

import pytest
from anthropic.lib.tools import ToolError
from google.genai import types as google
from hosting import host_of
from openai.types.chat import ChatCompletionMessage
from PIL import Image

from humanclaw import Call, PluginError, Verdict
from humanclaw.episodes.tools import body_tools
from humanclaw.records import Answer


@pytest.fixture(scope="module")
def home(body, house):
    body.reset(house)
    return body


def _asks(*calls):
    listed = [
        {"id": f"call_{number}", "type": "function", "function": {"name": name, "arguments": arguments}}
        for number, (name, arguments) in enumerate(calls)
    ]
    return ChatCompletionMessage.model_validate({"role": "assistant", "content": None, "tool_calls": listed})


def test_every_skill_and_a_look_are_offered(home):
    names = [tool.name for tool in body_tools(home)]
    assert sorted(names) == sorted([*home.skills, "look"])
    assert [tool["function"]["name"] for tool in home.tools("openai")] == names


def test_a_call_moves_the_body_and_gives_words_and_the_view(home):
    tools = {tool.name: tool for tool in body_tools(home)}
    before, result = home.step, tools["walk"](z_cm=40)
    assert result.text == "Executed walk(x_cm=0, z_cm=40, yaw_deg=0). The picture is what you see now."
    assert Image.open(io.BytesIO(result.picture)).size == (512, 512)
    assert home.step == before + 1


def test_what_a_model_can_mend_is_told_in_words_and_moves_nothing(home):
    walk, before = next(tool for tool in body_tools(home) if tool.name == "walk"), home.step
    for arguments in ({"z_cm": 500}, {"speed": 3}, '{"z_cm": 40', "[]", '{"z_cm": 1, "z_cm": 2}'):
        refused = walk.run(arguments)
        assert " was not executed: " in refused.text or "Nothing was executed: " in refused.text
        assert refused.picture == b""
    assert home.step == before


class Judge:
    """Answers every question with one verdict."""

    name = "judge"

    def __init__(self, verdict):
        self.verdict, self.asked = verdict, []

    def begin(self, context):
        self.task, self.scene = context.spec.instruction, context.scene

    def verify(self, observation, call, skill, goal):
        self.asked.append((str(call), skill.name, observation.rgb.shape))
        return self.verdict


def test_a_verifier_replaces_a_call_before_it_moves_the_body(home):
    failed = (Answer("Is the way free?", False, "a wall"),)
    judge = Judge(Verdict(False, Call("turn_in_place", {"yaw_deg": 10}), failed))
    tools = home.tools("openai", verifier=judge, instruction="walk")
    assert tools.answer(_asks(("walk", '{"z_cm": 40}')))[0]["content"].startswith(
        "walk(x_cm=0, z_cm=40, yaw_deg=0) was not executed: the check before execution failed (a wall). "
        "Executed turn_in_place(yaw_deg=10) in its place."
    )
    assert judge.asked == [("walk(x_cm=0, z_cm=40, yaw_deg=0)", "walk", (512, 512, 3))]
    assert (judge.task, judge.scene) == ("walk", None)


def test_a_verifier_is_not_asked_about_a_call_that_cannot_be_executed(home):
    judge = Judge(Verdict(True))
    tools = home.tools("openai", verifier=judge)
    assert "was not executed" in tools.answer(_asks(("walk", '{"z_cm": 500}')))[0]["content"]
    assert judge.asked == []
    done = tools.answer(_asks(("walk", '{"z_cm": 40}')))[0]["content"]
    assert done.startswith("Executed walk(x_cm=0, z_cm=40, yaw_deg=0).")


def test_to_look_takes_no_step(home):
    look, before = next(tool for tool in body_tools(home) if tool.name == "look"), home.step
    assert look().picture
    assert home.step == before


def test_openais_calls_are_answered_in_order_with_the_pictures_after(home):
    tools = home.tools("openai")
    answers = tools.answer(_asks(("look", "{}"), ("walk", '{"z_cm": 999}'), ("fly", "{}")))
    assert [(answer["role"], answer.get("tool_call_id")) for answer in answers] == [
        ("tool", "call_0"), ("tool", "call_1"), ("tool", "call_2"), ("user", None),
    ]  # fmt: skip
    assert "999 is greater than the maximum of 80" in answers[1]["content"]
    assert answers[2]["content"].startswith("There is no tool 'fly'; there are ")
    assert [part["image_url"]["url"][:23] for part in answers[3]["content"]] == ["data:image/jpeg;base64,"]
    assert tools.answer(ChatCompletionMessage(role="assistant", content="Done.")) == []


def test_anthropics_tools_give_text_and_picture_and_fail_in_words(home):
    tools = {tool.name: tool for tool in home.tools("anthropic")}
    assert tools["walk"].to_dict()["input_schema"]["properties"]["z_cm"]["maximum"] == 80
    words, picture = tools["look"].call({})
    assert (words["type"], picture["source"]["media_type"]) == ("text", "image/jpeg")
    with pytest.raises(ToolError, match="walk was not executed"):
        tools["walk"].call({"z_cm": -1})


def test_googles_calls_are_answered_by_responses_and_a_picture(home):
    tools = home.tools("google")
    asked = [google.Part(function_call=google.FunctionCall(name=name, args={})) for name in ("look", "turn_in_place")]
    content = google.Content(role="model", parts=asked)
    response = google.GenerateContentResponse(candidates=[google.Candidate(content=content)])
    said, shown = tools.answer(response)
    assert [next(iter(part.function_response.response)) for part in said.parts] == ["output", "error"]
    assert [part.inline_data.mime_type for part in shown.parts] == ["image/jpeg"]


def test_a_framework_that_is_missing_is_told_with_its_install_line(home, monkeypatch):
    monkeypatch.setitem(sys.modules, "smolagents", None)
    with pytest.raises(PluginError) as refused:
        home.tools("smolagents")
    assert refused.value.message == 'tools("smolagents") needs smolagents, which is not installed.'
    assert refused.value.remedy == "Run `pip install smolagents`."


def test_an_unknown_framework_is_answered_with_the_nearest(home):
    with pytest.raises(PluginError) as refused:
        home.tools("langchian")
    assert refused.value.remedy == "Did you mean langchain?"


def test_an_eighth_framework_is_a_plugin(home):

    def factory(tools):
        return {tool.name: tool.parameters for tool in tools}

    plugins = host_of("plain", frameworks=[("plain", factory)])
    made = plugins.make("frameworks", "plain", body_tools(home))
    assert made["walk"]["properties"]["z_cm"]["maximum"] == 80


def test_openai_answers_a_message_that_is_a_dictionary(home):
    called = {"id": "1", "type": "function", "function": {"name": "look", "arguments": "{}"}}
    said, shown = home.tools("openai").answer({"role": "assistant", "tool_calls": [called]})
    assert said["tool_call_id"] == "1"
    assert shown["content"][0]["type"] == "image_url"
    assert home.tools("openai").answer({"role": "assistant", "content": "Done."}) == []


@pytest.mark.parametrize(("arguments", "status"), [({"z_cm": 900}, "error"), ({"z_cm": 10}, "success")])
def test_langchain_is_told_whether_a_call_was_refused(home, arguments, status):
    pytest.importorskip("langchain_core")
    walk = next(tool for tool in home.tools("langchain") if tool.name == "walk")
    result = walk.invoke({"type": "tool_call", "id": "1", "name": "walk", "args": arguments})
    assert result.status == status
    assert str(result.content)
