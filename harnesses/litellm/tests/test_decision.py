"""Tests of the agent against a scripted model behind a real HTTP server."""

import contextlib
import json
from dataclasses import replace

import pytest
from model_servers import OpenAIServer, call, calls, message, refusing, text

import humanclaw_litellm
from humanclaw import Call, CallError, EpisodeContext, HistoryEntry, Keyframes, Plugins, ProviderError, skill
from humanclaw.records import Feedback
from humanclaw.skills import REASONING_FIELDS
from humanclaw.testing import check

pytestmark = pytest.mark.integration

SAID = {
    "visible_state": "a couch 3 m ahead",
    "progress": "approach",
    "mid_level_change": "revise",
    "mid_level_goal": "reach the couch",
    "reasoning": "the way is free",
}
WALK = {"x_cm": 0, "z_cm": 40, "yaw_deg": 0}


def answer(name="walk", **params):
    """Return a decision as JSON text."""
    return json.dumps({**SAID, "skill": name, "parameters": params})


def after(decision, observation, words="It went as it went."):
    return HistoryEntry(observation.step, decision, Feedback(refusal=words), observation.rgb)


# -- requests ----------------------------------------------------------------------------------------------------------
def test_the_prompt_speaks_of_the_skills_that_there_are(begin, view, context):
    @skill(checks=["Is anybody in view?"])
    def nod(times: int = 1) -> Keyframes:
        """Nod the head to agree."""
        return Keyframes.cycle("head", "x", 20, 0.5, times)

    alone = EpisodeContext(context.spec, {"nod": nod}, 0)
    with OpenAIServer([call("nod", times=2)]) as server:
        decision = begin(server, about=alone).decide(view(), ())
    prompt, (tool,) = server.requests[0].text, server.requests[0].tools
    assert "nod: the tools that you are given." in prompt
    assert (tool["name"], tool["description"]) == ("nod", "Nod the head to agree.")
    assert tool["parameters"]["properties"]["times"]["type"] == "integer"
    assert not any(name in prompt for name in ("turn_in_place", "sit_in_place", "walk,", "stop,", "Calling stop"))
    assert decision.calls == (Call("nod", {"times": 2}),)


def test_a_skill_without_its_trained_adapter_is_not_offered(begin, view, plugins, skills, context, tmp_path):
    mixed = skills | {"walk": replace(skills["walk"], adapter=tmp_path / "missing.safetensors")}
    with OpenAIServer([call("stop")]) as server:
        begin(server, about=EpisodeContext(context.spec, mixed, 0)).decide(view(), ())
    assert "walk" not in server.requests[0].tool_names
    assert "## walk\n" not in server.requests[0].text


def test_earlier_views_come_first_if_more_pictures_are_asked_for(begin, view):
    with OpenAIServer([call("walk", **WALK), call("stop")]) as server:
        agent = begin(server, images=3)
        first = agent.decide(view(0), ())
        agent.decide(view(4), [after(first, view(step)) for step in range(4)])
    blue = [picture[..., 2].mean() for picture in server.requests[1].images]
    assert blue == pytest.approx([40, 60, 80], abs=3)


def test_the_sampling_options_are_sent_as_given(begin, view):
    with OpenAIServer([call("stop")]) as server:
        begin(server, temperature=0.0, max_tokens=300, params={"seed": 7}).decide(view(), ())
    body = server.requests[0].body
    assert (body["temperature"], body["max_tokens"], body["seed"]) == (0.0, 300, 7)


# -- answers without exactly one call ----------------------------------------------------------------------------------
def handed_back(begin, view, skills, reply):
    """Return the decision for a reply, and the loop's error for it."""
    with OpenAIServer([reply]) as server:
        decision = begin(server, mode="tools").decide(view(), ())
    with pytest.raises(CallError) as fault:
        check(decision, skills)
    return decision, str(fault.value)


@pytest.mark.parametrize(
    ("reply", "words"),
    [
        (calls(("walk", WALK), ("stop", {})), "2 calls"),
        (calls(("walk", WALK), ("stop", '{"reaso')), "2 calls"),
        (calls(("stop", '{"reasoning": "the goal is')), "no call"),
        (calls(("walk", "[1, 2]")), "no call"),
        (text("I would walk to the couch."), "no call"),
        (text(answer("stop")[:-1]), "no call"),
        (text(answer("stop"), finish_reason="length"), "no call"),
        (message({"role": "assistant", "content": None}), "no call"),
        (text(f"I could answer {answer('stop')} but the couch is still far."), "no call"),
        (text(f"Not this:\n```json\n{answer('stop')}\n```"), "no call"),
        (text(answer("stop"), finish_reason="content_filter"), "no call"),
        (text(answer("stop")[:-1] + ', "skill": "walk"}'), "no call"),
        (calls(("walk", '{"z_cm": 30, "z_cm": 80}')), "no call"),
        (call("wlak", **WALK), "Did you mean walk"),
        (call("walk", **{**WALK, "z_cm": 9000}), "9000"),
        (call("walk", **{**WALK, "z_cm": "40"}), "z_cm"),
        (call("walk", **{**WALK, "z_cm": None}), "z_cm"),
        (calls(("walk", '{"x_cm": 0, "z_cm": NaN, "yaw_deg": 0}')), "no call"),
    ],
)
def test_what_is_not_one_legal_call_is_handed_back_and_never_executed(begin, view, skills, reply, words):
    decision, message = handed_back(begin, view, skills, reply)
    assert words in message
    assert json.loads(decision.raw)["mode"] == "tools"


def test_a_call_that_was_cut_off_is_explained_with_the_next_question(begin, view):
    with OpenAIServer([calls(("walk", '{"x_cm": 0, "z_')), call("walk", **WALK), call("stop")]) as server:
        agent = begin(server)
        for feedback in ("", "Nothing was executed.", "Executed it."):
            agent.decide(view(0, feedback), ())
    assert "not valid JSON" in server.requests[1].role("user")
    assert "Nothing was executed." in server.requests[1].role("user")
    assert "not valid JSON" not in server.requests[2].role("user")


def test_words_before_a_call_do_no_harm(begin, view, skills):
    with OpenAIServer([calls(("walk", {**SAID, **WALK}), text="Let me walk.")]) as server:
        decision = begin(server).decide(view(), ())
    assert check(decision, skills) == Call("walk", WALK)
    assert "Let me walk." in decision.raw


@pytest.mark.parametrize("mode", ["tools", "tools_auto", "schema", "prompt"])
def test_a_call_that_is_written_as_text_counts(begin, view, skills, mode):
    with OpenAIServer([text(f"<think>{{}}</think>\n```json\n{answer(**WALK)}\n```")]) as server:
        decision = begin(server, mode=mode).decide(view(), ())
    assert check(decision, skills) == Call("walk", WALK)
    assert decision.mid_level_goal == "reach the couch"


def test_words_around_a_call_are_no_call_of_a_model_that_has_tools(begin, view):
    with OpenAIServer([text(f"Sure: {answer(**WALK)}")] * 2) as server:
        assert begin(server, mode="tools").decide(view(), ()).calls == ()
        assert len(begin(server, mode="prompt").decide(view(), ()).calls) == 1


# -- models without tools ----------------------------------------------------------------------------------------------
def test_a_model_without_tools_is_asked_with_a_schema_and_remembered(begin, view, skills):
    with OpenAIServer(refusing("tools", [text(answer(**WALK))] * 2)) as server:
        agent = begin(server)
        decisions = [agent.decide(view(), ()) for _ in range(2)]
    assert [check(decision, skills) for decision in decisions] == [Call("walk", WALK)] * 2
    assert json.loads(decisions[0].raw)["mode"] == "schema"
    asked = server.requests[-1].body["response_format"]["json_schema"]["schema"]["properties"]
    assert list(asked) == [*REASONING_FIELDS, "skill", "parameters"]
    assert len(server.requests) == 4  # Tools twice, required and then optional; the schema; and the schema at once.


def test_the_next_decision_maker_for_this_model_knows_how_to_ask(view, context):
    host = Plugins()
    host.add(humanclaw_litellm, "litellm")
    with OpenAIServer(refusing("tools", [text(answer(**WALK))] * 2)) as server:
        for model in ("openai/one", "openai/one", "openai/other"):
            agent = host.make("agents", "litellm", {"model": model, "api_base": server.url, "num_retries": 0})
            agent.begin(context)
            with contextlib.suppress(ProviderError):  # The script holds two answers.
                agent.decide(view(), ())
    asked = [(request.body["model"], "tools" in request.body) for request in server.requests]
    assert asked == [("one", True), ("one", True), ("one", False), ("one", False), ("other", True), ("other", True),
                     ("other", False)]  # fmt: skip


def test_a_model_without_tools_and_schemas_is_asked_in_words(begin, view, skills):
    with OpenAIServer(refusing("tools", refusing("response_format", [text(answer(**WALK))]))) as server:
        agent = begin(server)
        decision = agent.decide(view(), ())
    assert check(decision, skills) == Call("walk", WALK)
    assert json.loads(decision.raw)["mode"] == "prompt"
    assert '"z_cm"' in server.requests[-1].role("system")
    assert len(server.requests[-1].images) == 1


def test_a_server_that_knows_only_words_is_asked_otherwise_next(begin, view):
    with OpenAIServer([text("I see a couch."), text("Still a couch."), text(answer(**WALK)), text("Oh.")]) as server:
        agent = begin(server)
        modes = []
        for _ in range(4):
            decision = agent.decide(view(), ())
            modes.append((json.loads(decision.raw)["mode"], len(decision.calls)))
    assert modes == [("tools", 0), ("schema", 0), ("prompt", 1), ("prompt", 0)]


def test_a_model_that_once_called_a_tool_is_not_asked_otherwise(begin, view):
    with OpenAIServer([call("walk", **WALK), text("Hm."), call("stop")]) as server:
        agent = begin(server)
        for _ in range(3):
            agent.decide(view(), ())
    assert all("tools" in request.body for request in server.requests)


# -- records -----------------------------------------------------------------------------------------------------------
def test_the_prompt_digest_names_what_was_sent(begin, view):
    with OpenAIServer([call("stop")] * 3) as server:
        agent = begin(server)
        first, same, other = (agent.decide(view(step), ()).prompt_digest for step in (0, 0, 1))
    assert first == same != other
    assert len(first) == 64


@pytest.mark.parametrize("value", ["[" * 50_000 + "]" * 50_000, "9" * 5000])
def test_arguments_that_are_no_json_are_the_models_to_mend(begin, view, skills, value):
    with OpenAIServer([calls(("walk", f'{{"z_cm": {value}}}')), call("stop")]) as server:
        agent = begin(server)
        decision = agent.decide(view(), ())
        with pytest.raises(CallError):
            check(decision, skills)
        assert agent.decide(view(), ()).calls[0].skill == "stop"
    assert len(server.requests) == 2
