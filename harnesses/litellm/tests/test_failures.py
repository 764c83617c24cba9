"""Tests of what a server may say: its reply, and what must happen. Whole providers are in test_dialects.py."""

import dataclasses
import datetime
import json
import logging

import pytest
from model_servers import (
    AnthropicServer,
    GeminiServer,
    OllamaServer,
    OpenAIServer,
    Reply,
    ResponsesServer,
    call,
    calls,
    status,
    text,
)

from humanclaw import Call, Decision, HistoryEntry, LimitError, Meter, ProviderClosedError, ProviderError
from humanclaw.records import Feedback
from humanclaw_litellm import litellm_setup
from humanclaw_litellm.failures import FailedRequest
from humanclaw_litellm.settings import ModelError, Settings
from humanclaw_litellm.usage import price_of

pytestmark = pytest.mark.integration

WALK = {"x_cm": 0, "z_cm": 40, "yaw_deg": 0}
FULL = "This model's maximum context length is 4096 tokens. However, you requested 5000 tokens."
TEMPERATURE = "Unsupported value: 'temperature' does not support 0 with this model."


def body(code, **fields):
    """Return a reply of this status with a body of these fields."""
    return Reply(fields, code)


def past(view, steps):
    walk = Call("walk", WALK)
    return [HistoryEntry(step, Decision((walk,)), Feedback(executed=walk), view(0).rgb) for step in range(steps)]


def verdict(skill):
    """Return a verdict that accepts a call."""
    return call("verdict", **{f"check_{number}_answer": "yes" for number, _ in enumerate(skill.checks, start=1)})


# -- parameters that a model refuses -----------------------------------------------------------------------------------
def without(*fields, then=("stop",)):
    """Return a script of a model that takes none of these parameters, and names the first that it was sent."""
    rest = iter(call(name) for name in then)

    def script(request):
        sent = [field for field in fields if field in request.body]
        return body(400, detail=[{"loc": ["body", sent[0]], "msg": "extra inputs"}]) if sent else next(rest)

    return script


@pytest.mark.parametrize(
    ("options", "left"),
    [
        ({"temperature": 0.0}, ["temperature"]),
        ({"temperature": 0.0, "max_tokens": 300}, ["temperature", "max_tokens"]),
        ({"temperature": 0.0, "params": {"seed": 7, "top_p": 0.5}}, ["temperature", "seed"]),
        ({}, []),
    ],
)
def test_a_refused_parameter_is_left_out_and_recorded(begin, view, options, left):
    with OpenAIServer(without("temperature", "max_tokens", "seed", then=("stop", "stop"))) as server:
        agent = begin(server, **options)
        for _ in range(2):
            decision = agent.decide(view(), ())
            assert (decision.calls, decision.left_out) == ((Call("stop"),), tuple(left))
    assert len(server.requests) == len(left) + 2
    assert server.requests[-1].body.get("top_p") == options.get("params", {}).get("top_p")


def test_the_verifier_does_not_send_what_the_agent_was_refused(begin, view, skills):
    refuse = without("temperature", then=("stop",))

    def script(request):
        return verdict(skills["walk"]) if "verdict" in request.tool_names else refuse(request)

    with OpenAIServer(script) as server:
        agent, verifier = begin(server, temperature=0.0), begin(server, "verifiers", temperature=0.0)
        agent.decide(view(), ())
        verifier.verify(view(), Call("walk", WALK), skills["walk"], "")
    assert ["temperature" in request.body for request in server.requests] == [True, False, False]


def test_what_litellm_refuses_itself_is_left_out_too(begin, view):
    with OpenAIServer([call("stop")]) as server:
        decision = begin(server, model="openai/gpt-5", profile="paper").decide(view(), ())
    assert (decision.calls, decision.left_out) == ((Call("stop"),), ("temperature",))
    assert "temperature" not in server.requests[0].body


@pytest.mark.parametrize(
    ("words", "refused"),
    [
        (TEMPERATURE, True),
        ("Unsupported parameter: 'temperature' is not supported with this model.", True),
        ("invalid temperature: only 1 is allowed for this model", True),
        ("temperature is deprecated", True),
        ("temperature: Extra inputs are not permitted", True),
        ("`temperature` may only be set to 1 when thinking is enabled.", True),
        ("The prompt speaks of temperature, and messages must alternate.", False),
        ("temperature is too large: at most 1", False),
        ("Unrecognized request argument supplied: temperature", True),
        ("`temperature` and `top_p` cannot both be specified for this model.", True),
        ("model-x does not support parameters: ['temperature'], for now", True),
        ("Invalid schema for tool walk (request: temperature=0, seed=none)", False),
        ("Unknown model 'x'. Sent: temperature 0", False),
        ("Invalid request: temperature=0, tools=[]", False),
        ("Image is invalid or unsupported (sampling: temperature=0)", False),
        ("Unsupported parameter(s): temperature", True),
        ("Additional properties are not allowed ('temperature' was unexpected)", True),
        ("This model only supports temperature=1", True),
        ("The temperature parameter isn't supported", True),
        ("temperature is not currently supported", True),
        ("temperature: 0 is not supported by this model", True),
        ("Your account was not found; the request held model, messages, temperature.", False),
    ],
)
def test_a_parameter_is_refused_by_words_near_its_name(words, refused):
    assert (FailedRequest(words, 400).refuses("temperature") is not None) == refused


@pytest.mark.parametrize(
    ("words", "option"),
    [
        ("max_tokens is too large: 100000. This model supports at most 16384 completion tokens", "max_tokens"),
        ("'max_tokens' is too large: 100000. This model's maximum context length is 4096 tokens", "max_tokens"),
        ("max_completion_tokens: 100000 > 64000, which is the maximum allowed number of tokens", "max_tokens"),
        ("Invalid max_tokens value, the valid range of max_tokens is [1, 8192]", "max_tokens"),
        ("a maxOutputTokens value of 100000, but the supported range is from 1 to 65537", "max_tokens"),
        ("Invalid 'temperature': decimal above maximum value. Expected a value <= 2, but got 3", "temperature"),
        ("temperature must be between 0 and 1", "temperature"),
        ("temperature: Input should be less than or equal to 1", "temperature"),
        ("top_p must be in (0.0, 1.0]", "top_p"),
    ],
)
def test_a_bound_is_told_with_its_option_and_not_passed_over(begin, view, words, option):
    with OpenAIServer([status(400, words)]) as server, pytest.raises(ModelError) as fault:
        begin(server, max_tokens=100000, temperature=3, params={"top_p": 0.0}).decide(view(), ())
    assert f"does not take {option}=" in str(fault.value)
    assert words in str(fault.value)


def test_a_sum_of_prompt_and_answer_is_no_bound_of_an_option():
    for words in (
        "input length and `max_tokens` exceed context limit",
        "`inputs` tokens + `max_new_tokens` must be <= 9",
    ):
        assert not FailedRequest(words, 400).bounds("max_tokens")


def test_max_tokens_is_sent_by_the_name_that_the_provider_asks_for(begin, view):
    words = "Unsupported parameter: 'max_tokens' is not supported with this model. Use 'max_completion_tokens' instead."

    def script(request):
        return status(400, words) if "max_tokens" in request.body else call("stop")

    with OpenAIServer(script) as server:
        decision = begin(server, max_tokens=300).decide(view(), ())
    assert server.requests[-1].body["max_completion_tokens"] == 300
    assert decision.left_out == ()


@pytest.mark.parametrize("word", ["none", "null", "", "None"])
def test_a_parameter_can_be_left_out_by_option(word):
    settings = Settings.of({"model": "m", "profile": "paper", "temperature": word, "max_tokens": word})
    assert (settings.temperature, settings.max_tokens) == (None, None)


def test_a_refusal_speaks_of_pictures_only_if_it_is_about_pictures(begin, view):
    with OpenAIServer(lambda _: status(400, "the moon is full")) as server, pytest.raises(ModelError) as fault:
        begin(server, temperature=0.0).decide(view(), ())
    assert "the moon is full" in str(fault.value)
    assert "picture" not in str(fault.value)


# -- pictures ----------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("code", "words"),
    [
        (400, "image input is not supported by this model"),
        (500, "image input is not supported - hint: you may need to provide the mmproj"),
        (400, "At most 0 image(s) may be provided in one request."),
        (400, "qwen3 is not a multimodal model"),
        (400, "Failed to deserialize the JSON body: messages[1]: unknown variant `image_url`, expected `text`"),
        (404, "No endpoints found that support image input"),
        (400, "Invalid content type. image_url is only supported by certain models."),
    ],
)
def test_a_model_without_pictures_ends_the_run_before_a_step(begin, view, code, words):
    with OpenAIServer([status(code, words)] * 9) as server, pytest.raises(ModelError) as fault:
        begin(server).decide(view(), ())
    assert "takes no pictures" in str(fault.value)
    assert "--images 0" in fault.value.remedy
    assert len(server.requests) == 1


def test_a_refusal_of_tools_is_none_of_pictures(begin, view):
    words = "Tool calling is not supported for vision models; image ok"
    whole = text(json.dumps({"skill": "walk", "parameters": WALK}))
    with OpenAIServer(lambda request: status(400, words) if "tools" in request.body else whole) as server:
        assert begin(server).decide(view(), ()).calls == (Call("walk", WALK),)


@pytest.mark.parametrize(
    ("model", "images", "warned"),
    [
        ("deepseek/deepseek-chat", 1, True),
        ("deepseek/deepseek-chat", 0, False),
        ("openai/gpt-4o-mini", 1, False),
        ("openai/unlisted", 1, False),
    ],
)
def test_a_model_listed_without_pictures_is_named_at_once(begin, caplog, model, images, warned):
    with OpenAIServer([]) as server:
        begin(server, model=model, images=images)
    assert ("without image input" in caplog.text) == warned


# -- a full context ----------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("code", "words"),
    [
        (400, FULL),
        (400, "Your input exceeds the context window of this model. Please adjust your input and try again."),
        (400, "The decoder prompt (length 5000) is longer than the maximum model length of 4096."),
        (400, "You passed 5001 input tokens. However, the model's context length is only 4096 tokens"),
        (400, "'max_tokens' is too large: 1000. This model's maximum context length is 4096 tokens"),
        (400, "too many tokens: the prompt must hold at most 4081 tokens"),
        (400, "the request exceeds the available context size (4096 tokens), try increasing it"),
        (500, "Context size has been exceeded."),
        (400, "The model is loaded with context length of only 4096 tokens, which is not enough"),
        (400, "The number of tokens to keep from the initial prompt is greater than the context length"),
        (400, "input length and `max_tokens` exceed context limit: 190000 + 20000 > 200000"),
        (413, "Request exceeds the maximum size"),
        (400, "Please reduce the length of the messages or completion."),
        (400, "tokens in request more than max tokens allowed"),
        (400, "Input is too long for requested model."),
        (400, "The input (5000 tokens) is longer than the model's context length (4096 tokens)."),
        (400, "`inputs` tokens + `max_new_tokens` must be <= 4096. Given: 5000"),
    ],
)
def test_a_full_context_is_known_by_the_words_of_every_server(code, words):
    """Those of providers with a row in replies.toml are tried there."""
    failure = FailedRequest(words, code)
    assert failure.too_long
    assert not failure.transient


@pytest.mark.parametrize(
    ("code", "words"),
    [
        (400, TEMPERATURE),
        (429, "Rate limit reached for gpt-5 on tokens per min (TPM): Limit 30000, Used 29000, Requested 4102."),
        (400, "max_tokens is too large: 100000. This model supports at most 16384 completion tokens"),
        (401, "maximum context length"),
        (503, "The engine is currently overloaded, please try again later"),
        (429, "Request too large for gpt-4.1 on tokens per min (TPM): Limit 30000, Requested 35000."),
        (413, "Request too large on tokens per minute: Limit 6000, Requested 7000, reduce your message size."),
        (400, "image exceeds 5 MB: request too large"),
        (429, "too many tokens, please wait"),
        (400, "Too many tokens, please wait before trying again."),
        (503, "Too many tokens in the queue."),
        (429, "Request too large for the tokens left in this minute. Please try again in 3s."),
        (504, "The request took too long to process."),
    ],
)
def test_other_failures_are_not_taken_for_a_full_context(code, words):
    assert not FailedRequest(words, code).too_long


def holding(steps):
    """Return a script of a model whose context holds this many past steps; a number below 0: not even the step."""
    return lambda request: call("stop") if request.text.count("<past step=") <= steps else status(400, FULL)


def test_older_steps_are_dropped_until_the_question_fits(begin, view):
    with OpenAIServer(holding(5)) as server:
        agent = begin(server, history=20)
        first = agent.decide(view(), past(view, 20))
        second = agent.decide(view(), past(view, 21))
    shown = [request.text.count("<past step=") for request in server.requests]
    assert shown == [20, 10, 5, 5]  # Halved until it fits, and not asked again with more.
    assert (first.dropped_steps, second.dropped_steps) == (15, 15)
    assert '<past step="20">' in server.requests[2].text, "the latest step stays"


def test_pictures_of_the_past_are_dropped_with_their_steps(begin, view):
    with OpenAIServer(lambda request: call("stop") if len(request.images) < 3 else status(400, FULL)) as server:
        begin(server, history=10, images=10).decide(view(), past(view, 10))
    assert [len(request.images) for request in server.requests] == [10, 6, 3, 2]


def test_a_step_that_does_not_fit_alone_is_a_limit_of_the_model(begin, view):
    with OpenAIServer(holding(-1)) as server, pytest.raises(LimitError) as fault:
        begin(server).decide(view(), past(view, 3))
    assert fault.value.scope == "episode"
    for word in ("4096", "--history", "larger window"):
        assert word in str(fault.value)
    assert [request.text.count("<past step=") for request in server.requests] == [3, 1, 0]


def test_a_verifier_whose_question_does_not_fit_fails_open(begin, view, skills):
    with OpenAIServer([status(400, FULL)]) as server:
        verdict = begin(server, "verifiers").verify(view(), Call("walk", WALK), skills["walk"], "")
    assert verdict.accepted
    assert "maximum context length" in verdict.failed_open


def test_a_rate_that_asks_to_wait_is_waited_for_whatever_its_status(begin, view):
    with OpenAIServer([status(400, "Too many tokens, please wait before trying again."), call("stop")]) as server:
        assert begin(server).decide(view(), ()).calls == (Call("stop"),)


def test_an_insufficient_quota_that_asks_to_wait_is_waited_for():
    failure = FailedRequest("Insufficient quota: please retry in 2s.", 429)
    assert failure.transient
    assert failure.wait == 2


@pytest.mark.parametrize("words", ["unsupported operand type(s) for +", "out of memory", "The request took too long."])
def test_a_crash_of_the_server_is_no_refusal(words):
    failure = FailedRequest(words, 500)
    assert failure.transient
    assert not failure.refused


# -- Ollama's window ---------------------------------------------------------------------------------------------------
def test_ollama_is_asked_for_a_window_that_holds_prompt_and_answer(begin, view):
    with OllamaServer([call("stop")] * 4) as server:
        agent = begin(server, model="ollama_chat/x", max_tokens=8000)
        agent.decide(view(), ())
        begin(server, model="ollama_chat/x", params={"num_ctx": 5000}).decide(view(), ())
    first, given = (request.raw["options"]["num_ctx"] for request in server.requests)
    prompt = len(server.requests[0].text) // 4
    assert 16384 > prompt + 8000 > 8192
    assert first == 16384
    assert given == 5000


def test_a_prompt_that_the_server_has_cut_is_told_once(begin, view, caplog):
    small = call("stop")
    small.body["usage"] = {"prompt_tokens": 40, "completion_tokens": 10, "total_tokens": 50}
    with OpenAIServer([small] * 2) as server:
        agent = begin(server)
        for _ in range(2):
            agent.decide(view(), ())
    assert caplog.text.count("it may have cut the prompt") == 1
    assert "counted 40 tokens" in caplog.text


@pytest.mark.parametrize("model", ["openai/x", "hosted_vllm/x"])
def test_a_reply_without_an_end_is_cut_off_and_told(begin, view, monkeypatch, model):
    monkeypatch.setattr(litellm_setup, "LONGEST_REPLY", 2**17)
    with (
        OpenAIServer([text("word " * 40_000)]) as server,
        pytest.raises(ProviderError, match=r"the reply has more than 0\.125 MiB"),
    ):
        begin(server, model=model, num_retries=0).decide(view(), ())


# -- how an answer ended -----------------------------------------------------------------------------------------------
class Verbatim:
    """Replies of a dialect with some fields written otherwise. change: gets the body as the server would send it."""

    @staticmethod
    def of(kind, change):
        class Changed(kind):
            def write(self, reply, request):
                written = super().write(reply, request)
                return change(written) or written

        return Changed([call("walk", **WALK)] * 2)


def gemini(reason, **part):
    def change(body):
        body["candidates"][0]["finishReason"] = reason
        body["candidates"][0]["content"]["parts"][0].update(part)

    return GeminiServer, "gemini/gemini-2.5-pro", change


def ollama(**fields):
    return OllamaServer, "ollama_chat/x", lambda body: body.update(fields)


def anthropic(reason):
    return AnthropicServer, "anthropic/claude-sonnet-4-5", lambda body: body.update(stop_reason=reason)


def changed(change):
    return OpenAIServer, "openai/x", lambda body: change(body) and None


def chat(reason, **beside):
    def change(body):
        body["choices"][0]["finish_reason"] = reason
        body["choices"][0]["message"].update(beside)

    return changed(change)


def responses(state, **item):
    def change(body):
        body["status"] = state
        body["output"][0].update(item)

    return ResponsesServer, "openai/responses/x", change


GOOD = ["stop", "tool_calls", "function_call", "eos", "STOP", "end_of_turn", "eosFound", "done", "", None]


@pytest.mark.parametrize(
    "dialect",
    [
        *map(chat, GOOD),
        gemini(None),
        gemini("FINISH_REASON_UNSPECIFIED"),
        ollama(done_reason=None),
        anthropic(None),
        responses("completed", status=None),
        changed(lambda body: body["choices"][0].pop("finish_reason")),
        changed(lambda body: body.update(error={"code": 0, "message": "success"})),
    ],
)
def test_a_whole_answer_is_executed_whatever_its_end_is_called(begin, view, dialect):
    kind, model, change = dialect
    with Verbatim.of(kind, change) as server:
        assert begin(server, model=model, num_retries=0).decide(view(), ()).calls == (Call("walk", WALK),)


@pytest.mark.parametrize(
    ("dialect", "words"),
    [
        (gemini("MAX_TOKENS"), "cut off"),
        (gemini("MALFORMED_FUNCTION_CALL"), "not executed"),
        (gemini("UNEXPECTED_TOOL_CALL"), "not executed"),
        (gemini("STOP", thought=True), "not executed"),
        (gemini("SAFETY"), "withheld"),
        (ollama(done_reason="length"), "cut off"),
        (chat("length"), "cut off"),
        (chat("model_length"), "cut off"),
        (chat("max_output_tokens"), "cut off"),
        (chat("token_limit"), "cut off"),
        (chat("MAX"), "cut off"),
        (chat("content-filter"), "withheld"),
        (chat("pause_turn"), "cut off"),
        (anthropic("pause_turn"), "cut off"),
        (responses("completed", status="incomplete"), "cut off"),
        (responses("completed", status="in_progress"), "cut off"),
        (responses("completed", type="custom_tool_call", input=json.dumps(WALK)), "not executed"),
        (chat("tool_calls", refusal="I will not."), "withheld"),
    ],
)
def test_a_call_of_an_answer_that_is_not_whole_is_never_executed(begin, view, dialect, words):
    kind, model, change = dialect
    with Verbatim.of(kind, change) as server:
        agent = begin(server, model=model)
        assert [call for call in agent.decide(view(), ()).calls if call.name == "walk"] == []
        agent.decide(view(1), ())
    assert words in server.requests[1].text


@pytest.mark.parametrize(
    "dialect",
    [
        gemini("OTHER"),
        ollama(done=False),
        ollama(done_reason="unload"),
        *map(chat, ("abort", "cancelled", "timeout", "failed", "Error", "engine_overloaded")),
        chat("tool_calls", error={"message": "the generation failed"}),
        responses("cancelled"),
        responses("in_progress"),
        chat(None, content="", tool_calls=[]),
    ],
)
def test_a_call_of_a_failed_answer_is_never_executed(begin, view, dialect):
    kind, model, change = dialect
    with Verbatim.of(kind, change) as server, pytest.raises(ProviderError, match="the generation failed"):
        begin(server, model=model, num_retries=1).decide(view(), ())
    assert len(server.requests) == 2


@pytest.mark.parametrize("role", ["user", "system", "tool"])
def test_a_message_of_another_role_is_not_the_models(begin, view, role):
    kind, model, change = chat("stop", role=role)
    with Verbatim.of(kind, change) as server, pytest.raises(ProviderError, match=f"one of role '{role}'"):
        begin(server, model=model, num_retries=1).decide(view(), ())


def test_of_several_answers_the_one_with_index_0_is_read(begin, view):
    def change(body):
        other = calls(("stop", {})).body["choices"][0]
        body["choices"] = [{**other, "index": 1}, *body["choices"]]

    with Verbatim.of(OpenAIServer, change) as server:
        assert begin(server).decide(view(), ()).calls == (Call("walk", WALK),)


def test_content_in_parts_is_read_and_its_thoughts_kept_apart(begin, view):
    whole = json.dumps({"skill": "walk", "parameters": WALK})
    thoughts = {"type": "thinking", "thinking": [{"type": "text", "text": '{"skill": "stop"}'}]}
    with OpenAIServer([text([thoughts, {"type": "text", "text": whole}])]) as server:
        decision = begin(server, mode="prompt").decide(view(), ())
    assert decision.calls == (Call("walk", WALK),)
    assert json.loads(decision.raw)["thoughts"] == '{"skill": "stop"}'


@pytest.mark.parametrize(
    "strange",
    [
        {"id": "a", "type": "custom", "custom": {"name": "walk", "input": "40"}},
        {"id": "a", "type": "function", "function": None},
    ],
)
def test_a_call_of_no_function_is_refused(begin, view, strange):
    def change(body):
        body["choices"][0]["message"]["tool_calls"] = [strange]

    with Verbatim.of(OpenAIServer, change) as server:
        agent = begin(server)
        assert agent.decide(view(), ()).calls == ()
        agent.decide(view(1), ())
    assert "not executed" in server.requests[1].text


def test_a_key_in_escapes_is_redacted_from_a_call(begin, view, monkeypatch):
    secret = "planted-0123456789-key"
    monkeypatch.setenv("OPENAI_API_KEY", secret)
    escaped = "".join(f"\\u{ord(letter):04x}" for letter in secret)
    arguments = '{"x_cm": 0, "z_cm": 40, "yaw_deg": 0, "reasoning": "a \\" KEY"}'.replace("KEY", escaped)
    with OpenAIServer([calls(("walk", arguments)), text(f'{{"a": "{escaped}"}}')]) as server:
        agent = begin(server)
        for _ in range(2):
            raw = agent.decide(view(), ()).raw
            assert "[redacted]" in raw
            assert escaped not in json.loads(raw)["content"] + json.dumps(json.loads(raw)["tool_calls"])
            assert secret not in raw


@pytest.mark.parametrize("joint", ["' '", "' + '", "'\n '", "\\\n"])
def test_a_key_that_is_joined_of_pieces_leaves_none(begin, view, monkeypatch, joint):
    monkeypatch.setenv("OPENAI_API_KEY", "planted-0123456789-key")
    for head, tail in (("planted-0123", "456789-key"), ("sk-0123456", "789abcdef")):
        with OpenAIServer([text(f"[walk(x_cm=0, z_cm=40, yaw_deg=0, reasoning='{head}{joint}{tail}')]")]) as server:
            decision = begin(server, mode="prompt").decide(view(), ())
        assert "[redacted]" in decision.raw
        assert tail not in decision.raw + decision.reasoning


def test_a_failed_generation_counts_for_limits(begin, view, context):
    failed = ended("error", call("stop"))
    meter = Meter()
    with OpenAIServer([failed] * 2 + [call("stop")]) as server:
        usage = begin(server, about=dataclasses.replace(context, meter=meter)).decide(view(), ()).usage
    assert (meter.episode.tokens_in, meter.episode.tokens_out) == (2000, 200)
    assert (usage.tokens_in, usage.tokens_out) == (1000, 100)


# -- failed generations and thoughts alone -----------------------------------------------------------------------------
def ended(reason, reply):
    reply.body["choices"][0]["finish_reason"] = reason
    return reply


@pytest.mark.parametrize(
    ("reply", "words"),
    [
        (ended("error", text("half an ans")), "half an ans"),
        (ended("error", call("stop")), "the generation failed"),
        (body(200, error={"message": "upstream is down", "code": 502}), "upstream is down"),
        (body(200, error="upstream is down"), "upstream is down"),
        (body(200, error={"message": "slow down", "code": 429}), "slow down"),
    ],
)
@pytest.mark.parametrize("kind", [(OpenAIServer, "openai/x"), (OpenAIServer, "openrouter/x/y")])
def test_a_failed_generation_is_the_providers_fault(begin, view, monkeypatch, kind, reply, words):
    monkeypatch.setenv("OPENROUTER_API_KEY", "planted-0123456789-key")
    server_of, model = kind
    with server_of([reply, call("stop")]) as server:
        assert begin(server, model=model).decide(view(), ()).calls == (Call("stop"),)
    with server_of([reply] * 2) as server, pytest.raises(ProviderError, match=words):
        begin(server, model=model, num_retries=1).decide(view(), ())


@pytest.mark.parametrize("kind", [AnthropicServer, GeminiServer, OllamaServer])
def test_an_error_in_a_success_keeps_the_servers_words(begin, view, kind):
    class Broken(kind):
        def write(self, reply, request):
            return {"error": {"message": "upstream is down"}}

    model = {AnthropicServer: "anthropic/claude-sonnet-4-5", GeminiServer: "gemini/gemini-2.5-pro"}
    with Broken([call("stop")] * 2) as server, pytest.raises(ProviderError, match="upstream is down"):
        begin(server, model=model.get(kind, "ollama_chat/x"), num_retries=1).decide(view(), ())


# -- tokens and money --------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("sent", "wrote", "thought", "total", "booked"),
    [
        (1000, 10, 5000, 6010, (1000, 5010, 5000)),
        (1000, 5010, 5000, 6010, (1000, 5010, 5000)),
        (1000, 10, None, 6010, (1000, 5010, 5000)),
        (1000, 10, None, 60_100_000, (1000, 10, 0)),
        (1000, 10, 20, 60_100_000, (1000, 30, 20)),
        (1000, 10, 5000, 1010, (1000, 5010, 5000)),
        (1000, 10, 5000, None, (1000, 5010, 5000)),
        (1000, 10, None, 1010, (1000, 10, 0)),
        (1000, 10, None, 1011, (1000, 11, 1)),
        (1000, 10, 4, 900, (1000, 10, 4)),
    ],
)
def test_reasoning_is_booked_and_billed_wherever_it_is_counted(begin, view, sent, wrote, thought, total, booked):
    counts = {"prompt_tokens": sent, "completion_tokens": wrote, "total_tokens": total}
    details = {} if thought is None else {"completion_tokens_details": {"reasoning_tokens": thought}}
    reply = call("stop")
    reply.body["usage"] = {key: value for key, value in counts.items() if value is not None} | details
    prices = {"input_cost_per_token": 1e-6, "output_cost_per_token": 1e-5}
    for options in ({"params": prices}, {"model": "openai/gpt-4o-mini"}):
        with OpenAIServer([reply]) as server:
            agent = begin(server, **options)
            usage = agent.decide(view(), ()).usage
        assert (usage.tokens_in, usage.tokens_out, usage.tokens_reasoning) == booked
        first, second = price_of(Settings.of({"model": "m"} | options))
        assert usage.cost == pytest.approx(booked[0] * first + booked[1] * second)


@pytest.mark.parametrize(
    ("beside", "thought", "total", "booked"),
    [
        ({"cached_tokens": 3000}, 0, 4010, (4000, 10, 0)),
        ({"cached_tokens": 2000, "cache_creation_tokens": 1000}, 0, 4010, (4000, 10, 0)),
        ({"cached_tokens": 2000, "image_tokens": 258}, 0, 1268, (1258, 10, 0)),
        ({"cached_tokens": 3000}, 50, 4060, (4000, 60, 50)),
    ],
)
def test_tokens_beside_the_prompt_are_no_reasoning(begin, view, beside, thought, total, booked):
    reply = call("stop")
    reply.body["usage"] = {"prompt_tokens": 1000, "completion_tokens": 10, "total_tokens": total}
    reply.body["usage"]["prompt_tokens_details"] = beside
    reply.body["usage"]["completion_tokens_details"] = {"reasoning_tokens": thought}
    with OpenAIServer([reply]) as server:
        usage = begin(server).decide(view(), ()).usage
    assert (usage.tokens_in, usage.tokens_out, usage.tokens_reasoning) == booked


@pytest.mark.parametrize(
    ("counts", "booked"),
    [
        ({"prompt_tokens": 1000.0, "completion_tokens": 10.0, "total_tokens": 1010.0}, 10),
        ({"prompt_tokens": "1000", "completion_tokens": "10"}, 10),
        ({"prompt_tokens": 1000, "completion_tokens": "many"}, 37 // 4),  # Of the letters of WALK as JSON.
        ([{"prompt_tokens": 1000}], 37 // 4),
    ],
)
def test_counts_that_are_no_whole_numbers_are_read_or_estimated(begin, view, counts, booked):
    reply = call("walk", **WALK)
    reply.body["usage"] = counts
    with OpenAIServer([reply]) as server:
        usage = begin(server).decide(view(), ()).usage
    assert usage.tokens_out == booked
    assert usage.estimated == (booked != 10)


@pytest.mark.parametrize("missing", ["prompt_tokens", "completion_tokens"])
def test_a_missing_half_of_the_counts_is_estimated_and_marked(begin, view, missing):
    reply = call("walk", **WALK)
    del reply.body["usage"][missing]
    reply.body["usage"]["total_tokens"] = reply.body["usage"].get("prompt_tokens", 100)
    with OpenAIServer([reply]) as server:
        usage = begin(server).decide(view(), ()).usage
    assert usage.estimated
    assert min(usage.tokens_in, usage.tokens_out) > 0


@pytest.mark.parametrize(
    ("cost", "prices", "booked"),
    [(0.5, {}, 0.5), (0.5, {"input_cost_per_token": 1e-6, "output_cost_per_token": 1e-5}, 0.002), (1e5, {}, 0.0)],
)
def test_the_users_prices_count_before_the_servers_cost(begin, view, cost, prices, booked):
    reply = call("stop")  # Of 1000 tokens in and 100 out.
    reply.body["usage"]["cost"] = cost
    # litellm remembers the prices of a model, so each row has a model of its own.
    with OpenAIServer([reply]) as server:
        agent = begin(server, model=f"openai/priced-{cost}-{len(prices)}", params=prices)
        assert agent.decide(view(), ()).usage.cost == pytest.approx(booked)


def test_a_model_without_a_price_is_named_at_once(context, plugins, monkeypatch, caplog):
    monkeypatch.setenv("OPENAI_API_KEY", "planted-0123456789-key")
    for model, known in (("openai/gpt-4o-mini", True), ("openai/gpt-unheard-of", False)):
        caplog.clear()
        agent = plugins.make("agents", "litellm", {"model": model})
        agent.begin(context)
        assert (agent.settings["priced"], "no price is known" in caplog.text) == (known, not known)


# -- words and waits ---------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("reply", "words"),
    [
        (body(503, error="the server is on fire"), "the server is on fire"),
        (body(503, detail="the server is on fire"), "the server is on fire"),
        (body(503, detail=[{"loc": ["body", "n"], "msg": "too many"}]), "body.n: too many"),
        (body(503, message="the server is on fire"), "the server is on fire"),
        (
            body(503, error={"message": "Provider returned error", "metadata": {"raw": "no GPU"}}),
            "returned error: no GPU",
        ),
        (Reply("the server is on fire", 503), "the server is on fire"),
        (Reply("<html>502 nginx</html>", 502), "502"),
    ],
)
@pytest.mark.parametrize("model", ["openai/x", "hosted_vllm/x"])
def test_the_servers_own_words_are_told(begin, view, model, reply, words):
    with OpenAIServer([reply]) as server, pytest.raises(ProviderError) as fault:
        begin(server, model=model, num_retries=0).decide(view(), ())
    assert words in str(fault.value)
    assert "{" not in str(fault.value)


@pytest.mark.parametrize("code", [200, 503])
def test_an_error_nested_deeply_is_the_providers_fault(begin, view, code):
    deep = Reply('{"error": ' * 900 + '"lost"' + "}" * 900, code)
    with OpenAIServer([deep]) as server, pytest.raises(ProviderError):
        begin(server, num_retries=0).decide(view(), ())


def test_an_address_that_nobody_answers_is_named(begin, view, monkeypatch):
    with OpenAIServer([]) as server:
        agent = begin(server, model="ollama_chat/x", num_retries=0)
    monkeypatch.setenv("OLLAMA_API_BASE", server.origin)
    for model, options in (("ollama_chat/x", {"api_base": ""}), ("openai/x", {})):
        agent = begin(server, model=model, num_retries=0, **options)
        with pytest.raises(ProviderError) as fault:
            agent.decide(view(), ())
        assert str(fault.value).count(server.origin) >= 1
        assert "refused" in str(fault.value)
        assert "start the server there, or name its address with --option api_base=URL" in str(fault.value)


def test_a_server_that_was_never_started_is_not_waited_for(begin, view, monkeypatch):
    now = [0.0]
    monkeypatch.setattr("time.monotonic", lambda: now[0])
    monkeypatch.setattr("time.sleep", lambda seconds: now.__setitem__(0, now[0] + seconds))
    with OpenAIServer([]) as server:
        agent = begin(server, backoff=1)
    with pytest.raises(ProviderError, match="nothing listens at"):
        agent.decide(view(), ())
    assert 5 < now[0] <= 10


@pytest.mark.parametrize(
    ("headers", "words", "seconds"),
    [
        ({"retry-after-ms": "1500", "retry-after": "9"}, "", 1.5),
        ({"retry-after": "9"}, "", 9),
        ({}, "Please try again in 1.2s. Contact us", 1.2),
        ({}, "Please try again in 20ms.", 0.02),
        ({}, "Please try again in 6m0s.", 360),
        ({}, "Please try again in 1h2m3.5s.", 3723.5),
        ({}, "Please retry after 30 seconds.", 30),
        ({}, "Please retry in 12.5s.", 12.5),
        ({}, '{"retryDelay": "7s"}', 7),
        ({}, "please try again later", 0),
        ({"retry-after": "soon"}, "", 0),
        *(({"retry-after": endless}, "", 0) for endless in ("inf", "-inf", "nan", "1e999", "Infinity")),
    ],
)
def test_a_wait_is_read_from_headers_and_from_words(headers, words, seconds):
    assert FailedRequest(words, 429, words, headers).wait == pytest.approx(seconds)


@pytest.mark.parametrize("zone", ["", " -0000", " GMT"])
def test_a_wait_may_also_last_until_a_date(zone):
    now = datetime.datetime.now(datetime.UTC)
    for moment, seconds in ((now + datetime.timedelta(seconds=60), 60), (now - datetime.timedelta(seconds=2), 0)):
        date = f"{moment:%a, %d %b %Y %H:%M:%S}{zone}"
        assert FailedRequest("", 429, headers={"retry-after": date}).wait == pytest.approx(seconds, abs=2)


# -- the end of a run --------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("code", "words", "error"),
    [
        (402, "Insufficient Balance", ProviderClosedError),
        (429, "You have insufficient quota for this minute.", ProviderClosedError),
        (400, "Your credit balance is too low to access the Anthropic API", ProviderClosedError),
        (403, "Your team has used all available credits", ProviderClosedError),
        (401, "the key was revoked", ProviderClosedError),
        (404, "The model does not exist", ProviderClosedError),
        (403, "your network is not allowed", ProviderError),
        (400, "the moon is full", ProviderError),
    ],
)
def test_what_no_later_request_betters_ends_the_run_in_its_middle(begin, view, code, words, error):
    with OpenAIServer([call("stop"), status(code, words), call("stop")]) as server:
        agent = begin(server)
        agent.decide(view(), ())
        with pytest.raises(error, match=words) as fault:
            agent.decide(view(), ())
    assert type(fault.value) is error
    assert len(server.requests) == 2


def test_an_empty_account_is_not_passed_over_by_the_verifier(begin, view, skills):
    with OpenAIServer([verdict(skills["walk"]), status(402, "Insufficient Balance")]) as server:
        verifier = begin(server, "verifiers")
        verifier.verify(view(), Call("walk", WALK), skills["walk"], "")
        with pytest.raises(ProviderClosedError):
            verifier.verify(view(), Call("walk", WALK), skills["walk"], "")


def test_a_refused_parameter_is_warned_of_once(begin, view, caplog):
    caplog.set_level(logging.WARNING)
    with OpenAIServer([status(400, TEMPERATURE), call("stop"), call("stop")]) as server:
        agent = begin(server, temperature=0.0)
        for _ in range(2):
            agent.decide(view(), ())
    assert caplog.text.count("does not take temperature, which is left out") == 1
