"""Tests of five dialects over HTTP, through litellm: the same answer has the same result in each."""

import json
import time
from dataclasses import dataclass

import pytest
from model_servers import (
    AnthropicServer,
    GeminiServer,
    OllamaServer,
    OpenAIServer,
    VLLMServer,
    call,
    calls,
    delayed,
    dropped,
    message,
    no_choices,
    refusing,
    refusing_images,
    status,
    text,
    thinking,
    truncated,
    without_usage,
)

from humanclaw import Call, CallError, EpisodeContext, Keyframes, ProviderError, skill
from humanclaw.testing import check
from humanclaw_litellm.settings import ModelError

WALK = {"x_cm": 0, "z_cm": 40, "yaw_deg": 0}
SAID = {"visible_state": "Ein Sofa, 3 m – “grün” 沙发 🛋", "reasoning": "Frei.\nWeg frei."}  # noqa: RUF001


@dataclass(frozen=True)
class Dialect:
    server: type[OpenAIServer]
    model: str


DIALECTS = {
    "openai": Dialect(OpenAIServer, "openai/scripted"),
    "anthropic": Dialect(AnthropicServer, "anthropic/claude-sonnet-4-5"),
    "gemini": Dialect(GeminiServer, "gemini/gemini-2.5-pro"),
    "ollama": Dialect(OllamaServer, "ollama_chat/scripted"),
    "vllm": Dialect(VLLMServer, "hosted_vllm/scripted"),
}


@pytest.fixture(params=DIALECTS)
def dialect(request):
    return request.param


@pytest.fixture
def talk(begin, view, dialect):
    """talk(reply, ...): take a decision for each reply; return the last one, the server and the agent."""

    def run(script, decisions=1, **options):
        spoken = DIALECTS[dialect]
        with spoken.server(script) as server:
            agent = begin(server, model=spoken.model, num_retries=1, **options)
            decision = [agent.decide(view(step), ()) for step in range(decisions)][-1]
        return decision, server, agent

    return run


# -- requests ----------------------------------------------------------------------------------------------------------
def test_tools_picture_and_prompt_arrive_whole(talk, skills):
    _, server, _ = talk([call("stop")])
    (request,) = server.requests
    assert request.tool_names == list(skills)
    (picture,) = request.images
    assert picture.shape == (512, 512, 3)
    assert "Find the couch and sit on it." in request.role("system")
    assert "Step 1 of 100" in request.text


def test_every_parameter_keeps_its_type_and_bounds(talk, skills):
    _, server, _ = talk([call("stop")])
    for tool in server.requests[0].tools:
        for name, part in skills[tool["name"]].schema["properties"].items():
            sent = tool["parameters"]["properties"][name]
            assert (sent["type"].lower(), sent["minimum"], sent["maximum"]) == (
                "integer",
                part["minimum"],
                part["maximum"],
            )


def test_alternatives_that_a_provider_would_drop_are_not_sent(begin, view, context, dialect):
    """litellm turns oneOf into {} for Gemini, so schemas of optional parameters avoid it."""

    @skill()
    def hop(times: int | None = None) -> Keyframes:
        """Hop."""
        return Keyframes.cycle("head", "x", 20, 0.5, times or 1)

    spoken = DIALECTS[dialect]
    with spoken.server([call("hop", times=2)]) as server:
        about = EpisodeContext(context.spec, {"hop": hop}, 0)
        decision = begin(server, model=spoken.model, about=about).decide(view(), ())
    (tool,) = server.requests[0].tools
    assert tool["parameters"]["properties"]["times"]["type"].lower() == "integer"
    assert not {"oneOf", "anyOf", "allOf", "$ref"} & set(json.dumps(server.requests[0].raw).replace('"', " ").split())
    assert decision.calls == (Call("hop", {"times": 2}),)


def test_a_call_is_demanded_where_the_dialect_can_say_so(talk, dialect):
    _, server, _ = talk([call("stop")])
    raw = server.requests[0].raw
    demanded = {
        "openai": lambda: raw["tool_choice"] == "required" and raw["parallel_tool_calls"] is False,
        "anthropic": lambda: raw["tool_choice"] == {"type": "any", "disable_parallel_tool_use": True},
        "gemini": lambda: raw["toolConfig"]["functionCallingConfig"]["mode"] == "ANY",
        "ollama": lambda: "tool_choice" not in raw,
        "vllm": lambda: raw["tool_choice"] == "required",
    }
    assert demanded[dialect]()


# -- answers -----------------------------------------------------------------------------------------------------------
def test_a_call_is_read_with_all_that_was_said_around_it(talk, skills):
    decision, _, agent = talk([call("walk", **SAID, **WALK)])
    assert check(decision, skills) == Call("walk", WALK)
    assert (decision.visible_state, decision.reasoning) == (SAID["visible_state"], SAID["reasoning"])
    assert SAID["visible_state"] in json.loads(json.loads(decision.raw)["tool_calls"][0]["arguments"]).values()
    assert agent.mode == "tools"


def test_words_before_the_call_do_no_harm(talk, skills):
    decision, _, _ = talk([calls(("walk", {**SAID, **WALK}), text="Let me walk.")])
    assert check(decision, skills) == Call("walk", WALK)
    assert json.loads(decision.raw)["content"] == "Let me walk."


def test_thoughts_are_kept_and_are_no_answer(talk, skills):
    decision, _, _ = talk([thinking('{"skill": "stop", "parameters": {}}', call("walk", **WALK))])
    assert check(decision, skills) == Call("walk", WALK)
    assert json.loads(decision.raw)["thoughts"] == '{"skill": "stop", "parameters": {}}'


def test_several_calls_at_once_are_all_handed_back(talk, skills):
    decision, _, _ = talk([calls(("walk", WALK), ("stop", {}))])
    with pytest.raises(CallError, match="2 calls"):
        check(decision, skills)


def test_numbers_in_quotes_are_handed_back(talk, skills):
    decision, _, _ = talk([call("walk", **{**WALK, "z_cm": "40"})])
    with pytest.raises(CallError, match="z_cm"):
        check(decision, skills)


@pytest.mark.parametrize("tool", ["walk", "stop"])
def test_a_call_that_was_cut_off_is_handed_back(talk, skills, tool):
    """`stop` needs no parameter, so a call that was cut off must not count as a whole one."""
    decision, _, _ = talk([calls((tool, '{"visible_state": "A sof'))])
    with pytest.raises(CallError, match="no call"):
        check(decision, skills)


def test_an_answer_of_nothing_is_handed_back(talk, skills):
    decision, _, _ = talk([message({"role": "assistant", "content": None})])
    with pytest.raises(CallError, match="no call"):
        check(decision, skills)


def test_a_model_that_may_call_but_only_talks_is_asked_for_json_next(talk, skills, dialect):
    """Ollama has no tool_choice, and other servers may ignore it."""
    whole = json.dumps({**SAID, "skill": "walk", "parameters": WALK}, ensure_ascii=False)
    decision, server, agent = talk([text("I see a sofa."), text(whole), text(whole)], decisions=3)
    assert check(decision, skills) == Call("walk", WALK)
    assert decision.visible_state == SAID["visible_state"]
    assert json.loads(decision.raw)["mode"] == agent.mode == "schema"
    assert len(server.requests) == 3


def test_a_model_that_takes_no_tools_is_asked_in_another_way_and_this_is_remembered(talk, skills, dialect):
    whole = text(json.dumps({**SAID, "skill": "walk", "parameters": WALK}))
    decision, server, agent = talk(refusing("tools", [whole] * 3), decisions=3)
    assert check(decision, skills) == Call("walk", WALK)
    assert json.loads(decision.raw)["mode"] == agent.mode != "tools"
    assert ["tools" in request.body for request in server.requests][-2:] == [False, False]


# -- tokens ------------------------------------------------------------------------------------------------------------
def test_tokens_are_the_providers_count(talk):
    usage = talk([call("stop")])[0].usage
    assert (usage.tokens_in, usage.tokens_out, usage.estimated) == (1000, 100, False)


@pytest.mark.parametrize("dialect", ["openai", "ollama", "vllm"], indirect=True)
def test_a_count_that_is_missing_is_estimated_and_says_so(talk):
    usage = talk([without_usage(call("stop", reasoning="x" * 400))])[0].usage
    assert usage.estimated
    assert 1000 < usage.tokens_in < 4000
    assert 90 < usage.tokens_out < 130


@pytest.mark.parametrize("dialect", ["anthropic", "gemini"], indirect=True)
def test_where_a_count_always_comes_an_answer_without_one_is_a_broken_answer(talk):
    with pytest.raises(ProviderError):
        talk([without_usage(call("stop"))] * 2)


# -- faults ------------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    "fault",
    [status(429, headers={"Retry-After": "0.05"}), status(500), status(503), dropped(), truncated(call("stop"))],
    ids=["429", "500", "503", "reset", "partial"],
)
def test_a_fault_passes_or_is_a_provider_error_and_never_a_decision(talk, fault):
    decision, server, _ = talk([fault, call("walk", **WALK)])
    assert decision.calls == (Call("walk", WALK),)
    assert len(server.requests) == 2
    with pytest.raises(ProviderError):
        talk([fault] * 2)


def test_the_provider_says_how_long_to_wait(talk):
    began = time.monotonic()
    talk([status(429, headers={"Retry-After": "0.7"}), call("stop")])
    assert time.monotonic() - began > 0.7


def test_a_late_answer_is_a_provider_error(talk):
    with pytest.raises(ProviderError, match=r"(?i)time"):
        talk([delayed(20, call("stop"))] * 2, timeout=0.3)


def test_what_the_provider_said_is_told_in_its_words(talk):
    with pytest.raises(ProviderError, match=r"gave no answer: the servers are on fire$"):
        talk([status(503, "the servers are on fire")] * 2)


@pytest.mark.parametrize("dialect", ["openai", "gemini", "vllm"], indirect=True)
def test_a_reply_without_an_answer_is_a_fault_of_the_provider(talk):
    """Anthropic and Ollama have no list of choices that could be empty."""
    with pytest.raises(ProviderError, match="no choices"):
        talk([no_choices()] * 2)


def test_a_model_that_refuses_pictures_is_for_the_user_to_mend(talk):
    with pytest.raises(ModelError, match="image input is not supported") as fault:
        talk(refusing_images([], "image input is not supported by this model"))
    assert "takes pictures" in fault.value.remedy


@pytest.mark.parametrize("dialect", ["ollama"], indirect=True)
def test_ollama_reports_a_missing_eye_as_an_error_of_its_own(talk):
    with pytest.raises(ProviderError, match="missing data required for image input"):
        talk(refusing_images([], "this model is missing data required for image input", 500))


def test_a_wrong_key_is_for_the_user_to_mend(talk):
    with pytest.raises(ModelError, match="does not accept the key"):
        talk([status(401, "invalid key")])
