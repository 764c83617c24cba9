"""Tests of provider failures, the cost of requests, and places where a key must not appear."""

import contextlib
import logging
import os
import socket
import subprocess
import sys
import threading
import traceback

import pytest
from model_servers import (
    OpenAIServer,
    Reply,
    call,
    dropped,
    no_choices,
    refusing,
    status,
    truncated,
    without_usage,
)

from humanclaw import HumanclawError, Meter, ProviderError
from humanclaw_litellm.client import Client
from humanclaw_litellm.settings import ModelError, Settings
from humanclaw_litellm.usage import price_of

pytestmark = pytest.mark.integration

KEY = "planted-0123456789-key"
PRICES = {"input_cost_per_token": 1e-6, "output_cost_per_token": 0.0}


@pytest.mark.parametrize(
    "fault",
    [
        status(500),
        status(529),
        dropped(),
        truncated(call("stop")),
        no_choices(),
        Reply({"choices": None}),
        Reply({"nothing": 1}),
    ],
    ids=["500", "529", "dropped", "truncated", "no choices", "null", "empty"],
)
def test_a_fault_that_lasts_is_a_provider_error_after_its_retries(begin, view, fault):
    with OpenAIServer([fault] * 9) as server:
        with pytest.raises(ProviderError, match="openai/anything at http://127"):
            begin(server, num_retries=2).decide(view(), ())
        assert len(server.requests) == 3


def test_a_wrong_key_or_model_at_first_is_for_the_user_to_mend(begin, view):
    for code, words in ((401, "key"), (403, "key"), (404, "name")):
        with OpenAIServer([status(code)] * 2) as server:
            with pytest.raises(ModelError, match=words) as fault:
                begin(server).decide(view(), ())
            assert fault.value.remedy
            assert len(server.requests) == 1


def test_a_web_page_is_called_one_and_asked_for_once():
    page = Reply({}, headers={"Content-Type": "text/html; charset=utf-8"})
    with OpenAIServer([page] * 9) as server:
        client = Client(Settings.of({"model": "openai/x", "api_base": server.url}))
        client.begin(Meter())
        with pytest.raises(ModelError, match=r"a web page; an api_base often ends in /v1"):
            client.complete([{"role": "user", "content": "hello"}], {})
        assert len(server.requests) == 1


def test_a_provider_that_refuses_every_way_is_for_the_user_to_mend(begin, view):
    with OpenAIServer(refusing("messages", [])) as server, pytest.raises(ModelError, match="does not support messages"):
        begin(server).decide(view(), ())


def test_a_refusal_once_a_way_of_asking_is_settled_is_the_providers(begin, view):
    with OpenAIServer([call("stop"), status(400, "no")]) as server:
        agent = begin(server)
        agent.decide(view(), ())
        with pytest.raises(ProviderError, match="refused"):
            agent.decide(view(), ())


# -- keys --------------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"model": "openai/gpt-4o-mini"}, r"OPENAI_API_KEY is not set\. Set OPENAI_API_KEY"),
        ({"model": "zai/glm-4.6v"}, "ZAI_API_KEY is not set"),
        ({"model": "openai/gpt-4o-mini", "auth_env": "MY_SERVER"}, "MY_SERVER, which is not set"),
        ({"model": "nonsense"}, r"no provider is known for model 'nonsense'\. Write provider/name"),
    ],
)
def test_a_missing_key_is_told_before_the_first_request(plugins, context, monkeypatch, options, message):
    monkeypatch.setenv("MY_SERVER", "")
    with pytest.raises(ModelError, match=message):
        plugins.make("agents", "litellm", options).begin(context)


@pytest.mark.parametrize("model", ["openai/gpt-4o-mini", "anthropic/claude-sonnet-4-5", "gemini/gemini-2.5-pro"])
def test_an_empty_key_is_a_missing_key(plugins, context, monkeypatch, model):
    names = {"openai": "OPENAI_API_KEY", "anthropic": "ANTHROPIC_API_KEY", "gemini": "GOOGLE_API_KEY"}
    variable = names[model.split("/")[0]]
    monkeypatch.setenv(variable, "  ")
    agent = plugins.make("agents", "litellm", {"model": model})
    with pytest.raises(ModelError, match=f"{variable} is not set"):
        agent.begin(context)


def test_a_key_is_taken_from_the_variable_that_is_named(begin, view, monkeypatch):
    monkeypatch.setenv("MY_SERVER", KEY)
    with OpenAIServer([call("stop")]) as server:
        begin(server, auth_env="MY_SERVER").decide(view(), ())
        with pytest.raises(ModelError, match="OTHER, which is not set"):
            begin(server, auth_env="OTHER")
    assert server.requests[0].headers["authorization"] == f"Bearer {KEY}"


@pytest.mark.parametrize("variable", ["OPENAI_API_KEY", "MY_SERVER"])
def test_a_key_appears_in_no_answer_error_or_log(begin, view, monkeypatch, caplog, variable):
    monkeypatch.setenv(variable, KEY)
    caplog.set_level(logging.INFO)
    chatty = [call("walk", reasoning=f"the key is {KEY}"), status(500, f"bad key {KEY}"), status(400, f"bad key {KEY}")]
    named = {} if variable == "OPENAI_API_KEY" else {"auth_env": variable}
    with OpenAIServer(chatty) as server:
        agent = begin(server, **named)
        decision = agent.decide(view(), ())
        with pytest.raises(ProviderError, match=r"bad key \[redacted\]") as fault:
            agent.decide(view(), ())
    assert server.requests[0].headers["authorization"] == f"Bearer {KEY}"  # The key was in use.
    trace = "".join(traceback.format_exception(fault.value))
    seen = [repr(decision), trace, caplog.text, server.requests[0].text]
    assert not [text for text in seen if KEY in text]


# -- costs -------------------------------------------------------------------------------------------------------------
@pytest.fixture
def usage_of(begin, view):
    """What an answer of one reply is said to take."""

    def asked(reply, **options):
        with OpenAIServer([reply]) as server:
            return begin(server, **options).decide(view(), ()).usage

    return asked


def reporting(**usage):
    """A reply whose provider tells other tokens or costs."""
    reply = call("stop")
    return Reply({**reply.body, "usage": {**reply.body["usage"], **usage}})


def test_tokens_are_the_providers_count(usage_of):
    # litellm remembers prices that a request gave for a model, so this model is no other test's.
    usage = usage_of(call("stop"), model="openai/without-a-price")
    assert (usage.tokens_in, usage.tokens_out, usage.estimated, usage.cost) == (1000, 100, False, 0.0)
    assert usage.cost_estimated  # This model has no known price.


def test_a_missing_count_is_estimated_and_says_so(begin, view):
    with OpenAIServer([without_usage(call("stop", reasoning="x" * 400))]) as server:
        usage = begin(server).decide(view(), ()).usage
    assert usage.estimated
    assert len(server.requests[0].text) / 6 < usage.tokens_in < len(str(server.requests[0].body))
    assert 90 < usage.tokens_out < 130


def test_the_cost_is_tokens_times_the_listed_price(usage_of):
    import litellm

    price = litellm.model_cost["gpt-4o-mini"]
    usage = usage_of(call("stop"), model="openai/gpt-4o-mini")
    expected = 1000 * price["input_cost_per_token"] + 100 * price["output_cost_per_token"]
    assert usage.cost == pytest.approx(expected) != 0
    assert usage.cost_estimated


@pytest.mark.parametrize(
    "cost",
    [
        {"cost": "0.25"},
        {"cost": 0.01, "is_byok": True, "cost_details": {"upstream_inference_cost": 0.24}},
        {"cost": 0, "is_byok": True, "cost_details": {"upstream_inference_cost": 0.25}},
        {"cost": 0.25, "is_byok": False, "cost_details": {"upstream_inference_cost": 0.24}},
    ],
)
def test_a_cost_may_be_text_and_have_the_users_key_beside_it(usage_of, cost):
    assert usage_of(reporting(**cost)).cost == pytest.approx(0.25)


def test_tokens_may_have_the_names_of_the_responses_api(usage_of):
    reply = call("stop")
    other = {"input_tokens": 1000, "output_tokens": 100, "total_tokens": 1100}
    usage = usage_of(Reply({**reply.body, "usage": other}))
    assert (usage.tokens_in, usage.tokens_out, usage.estimated) == (1000, 100, False)


def test_cached_tokens_beside_the_counts_have_their_discount(usage_of):
    import litellm

    price = litellm.model_cost["gpt-4o-mini"]
    usage = usage_of(reporting(cached_tokens=800), model="openai/gpt-4o-mini")
    expected = 200 * price["input_cost_per_token"] + 800 * price["cache_read_input_token_cost"]
    assert usage.cost == pytest.approx(expected + 100 * price["output_cost_per_token"])


def test_a_model_of_the_responses_api_has_the_price_of_its_name():
    listed, named = (price_of(Settings(model=name)) for name in ("openai/gpt-5", "openai/responses/gpt-5"))
    assert listed == named != (0.0, 0.0)


@pytest.mark.parametrize("cost", [float("nan"), float("inf"), -0.25, True])
def test_a_cost_that_nothing_can_have_is_not_believed(usage_of, cost):
    usage = usage_of(reporting(cost=cost), params=PRICES)
    assert (usage.cost, usage.cost_estimated) == (pytest.approx(1000 * 1e-6), True)


@pytest.mark.parametrize("count", [-1000, 10**15])
def test_a_count_that_no_answer_has_is_not_believed(usage_of, count):
    usage = usage_of(reporting(prompt_tokens=count, completion_tokens=count, total_tokens=0))
    assert usage.estimated
    assert 0 < usage.tokens_in < 10_000


def test_the_name_that_a_provider_answers_by_holds_no_key_and_no_book(begin, view, monkeypatch):
    monkeypatch.setenv("SOME_API_KEY", KEY)
    named = [Reply({**call("stop").body, "model": name}) for name in (f"model of {KEY}", "m" * 5000)]
    with OpenAIServer(named) as server:
        agent = begin(server)
        first, second = (agent.decide(view(), ()).raw for _ in named)
    assert "model of [redacted]" in first
    assert "m" * 200 in second
    assert "m" * 201 not in second


def test_what_a_provider_says_is_printed_and_not_obeyed(begin, view):
    said = status(500, "over\x1b]52;c;aGk=\x07loaded\x9b2J")
    with (
        OpenAIServer([said]) as server,
        pytest.raises(ProviderError, match=r"over\ufffd]52;c;aGk=\ufffdloaded\ufffd2J$"),
    ):
        begin(server, num_retries=0).decide(view(), ())


# -- options -----------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({}, "Name one with --model"),
        ({"model": "m", "history": -1}, "option history is not valid"),
        ({"model": "m", "mode": "magic"}, "option mode is not valid"),
        ({"model": "m", "params": {"timeout": 3}}, "timeout cannot be set here"),
        ({"model": "m", "params": {"tool_choice": "auto"}}, "tool_choice cannot be set here"),
        ({"model": "m", "api_key": KEY}, "options are recorded"),
        ({"model": "m", "api_base": f"http://me:{KEY}@host/v1"}, "options are recorded"),
        ({"model": "m", "api_base": "host:8000/v1"}, "such as http://localhost:8000/v1"),
        ({"model": "m", "api_base": "http://host/v1 http://elsewhere"}, "such as http://localhost:8000/v1"),
        ({"model": "m", "api_base": "http://host/v1;aB3dE5gH7jK9mN1pQ3sT"}, "options are recorded"),
        ({"model": "m", "api_base": "http://host/v1@aB3dE5gH7jK9mN1pQ3sT"}, "options are recorded"),
        ({"model": "m", "verifier_params": {"a": [{"password": "hunter22"}]}}, "options are recorded"),
        ({"model": "m", "verifier_params": '{"a": [{"password": "hunter22"}]}'}, "options are recorded"),
        ({"model": "m", "params": {"api_key": KEY}}, "options are recorded"),
        (
            {"model": "m", "params": {"extra_body": [{"Authorization": KEY}]}},
            "params.extra_body.0.Authorization holds a key",
        ),
        ({"model": "m", "params": {"extra_body": {"client_secret": KEY}}}, "options are recorded"),
        ({"model": "m", "params": {"metadata": {"note": f"sk-{KEY}"}}}, "params.metadata.note holds a key"),
        ({"model": "m", "params": f'{{"extra_headers": {{"x": "{KEY}"}}}}'}, "options are recorded"),
        ({"model": "m", "api_base": f"http://:{KEY}@host/v1"}, "options are recorded"),
        ({"model": "m", "api_base": f"http://host/v1?key={KEY}"}, "options are recorded"),
        ({"model": "m", "api_base": f"http://host/v1#{KEY}"}, "options are recorded"),
        ({"model": "m", "api_base": f"http://host/sk-{KEY}/v1"}, "options are recorded"),
        ({"model": "m", "api_base": "http://host/aB3dE6gH9jK2mN5pQ8sT/v1"}, "options are recorded"),
        ({"model": "m", "verifier_api_base": f"http://me:{KEY}@host/v1"}, "options are recorded"),
        ({"model": "m", "profile": f"sk-{KEY}"}, "options are recorded"),
    ],
)
def test_an_option_that_cannot_be_meant_is_refused_in_one_sentence(options, words):
    with pytest.raises(HumanclawError, match=words) as fault:
        Settings.of(options)
    assert KEY not in str(fault.value)


def test_a_key_of_the_environment_is_refused_wherever_it_is_given(monkeypatch):
    monkeypatch.setenv("SOME_API_KEY", "open-sesame-42")
    for options in ({"api_base": "http://host/open-sesame-42/v1"}, {"params": {"user": "open-sesame-42"}}):
        with pytest.raises(HumanclawError, match="options are recorded") as fault:
            Settings.of({"model": "m", **options})
        assert "open-sesame-42" not in str(fault.value)


@pytest.mark.parametrize(
    "options",
    [
        {"api_base": "https://gateway.ai.cloudflare.com/v1/0123456789abcdef0123456789abcdef/gateway-1/openai"},
        {"api_base": "https://name.openai.azure.com/openai/deployments/gpt-4o-2024-08-06"},
        {"params": {"max_completion_tokens": 9, "input_cost_per_token": 1e-6, "thinking": {"budget_tokens": 1024}}},
    ],
)
def test_an_address_and_params_without_a_key_are_taken(options):
    assert Settings.of({"model": "m", **options})


def test_options_may_come_as_text_and_others_are_passed_over():
    settings = Settings.of({"model": "m", "history": "3", "mid_level": "false", "profile": "paper", "timeout": None})
    assert (settings.history, settings.mid_level, settings.timeout) == (3, False, 120.0)


def test_the_verifier_has_a_small_budget_of_its_own():
    own = Settings.of_verifier({"model": "m"})
    assert (own.num_retries, own.timeout) == (2, 30.0)
    assert Settings.of_verifier({"model": "m", "num_retries": 4}).num_retries == 4
    assert Settings.of_verifier({"model": "m", "num_retries": 4, "verifier_num_retries": 1}).num_retries == 1
    assert Settings.of({"model": "m"}).num_retries == 5


def test_the_verifier_can_have_a_model_of_its_own():
    shared = {"model": "big", "api_base": "http://127.0.0.1:1/v1", "temperature": 0.5}
    assert Settings.of_verifier(shared).model_dump(exclude={"num_retries", "timeout"}) == Settings.of(
        shared
    ).model_dump(exclude={"num_retries", "timeout"})
    own = Settings.of_verifier(shared | {"verifier_model": "small"})
    assert (own.model, own.api_base, own.temperature) == ("small", "", 0.5)


# -- privacy and limits ------------------------------------------------------------------------------------------------
def test_the_plugin_loads_without_litellm_and_prints_nothing():
    script = """
import sys, humanclaw_litellm
places = set()
sys.addaudithook(lambda event, args: places.add(args[0]) if event == "socket.getaddrinfo" else None)
assert "litellm" not in sys.modules
from model_servers import OpenAIServer, status
from humanclaw import Meter
from humanclaw_litellm import litellm_setup
from humanclaw_litellm.client import Client
from humanclaw_litellm.settings import Settings
with OpenAIServer([status(500)]) as server:
    client = Client(Settings(model="openai/anything", api_base=server.url, num_retries=0))
    client.begin(Meter())
    try:
        client.complete([{"role": "user", "content": "Hello"}], {})
    except Exception as error:
        print(type(error).__name__, places)
"""
    env = os.environ | {"PYTHONPATH": os.pathsep.join(map(os.path.abspath, sys.path))}
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, timeout=600, env=env, check=False
    )
    assert (done.stdout, done.stderr) == ("ProviderError {'127.0.0.1'}\n", "")


def drip(listener, stop):
    """Answer every request with an endless reply of one byte each 0.1 s."""
    while not stop.is_set():
        try:
            connection, _ = listener.accept()
        except OSError:
            return
        connection.recv(65536)
        connection.sendall(b"HTTP/1.1 200 OK\r\nContent-Type: application/json\r\nContent-Length: 100000\r\n\r\n")
        with contextlib.suppress(OSError):
            while not stop.wait(0.1):
                connection.sendall(b" ")
        connection.close()


def test_a_server_that_answers_byte_by_byte_meets_the_deadline():
    Client(Settings(model="openai/x", api_base="http://127.0.0.1:9/v1")).begin(
        Meter()
    )  # Importing litellm takes seconds.
    stop = threading.Event()
    with socket.create_server(("127.0.0.1", 0)) as listener:
        threading.Thread(target=drip, args=(listener, stop), daemon=True).start()
        address = f"http://127.0.0.1:{listener.getsockname()[1]}/v1"
        client = Client(Settings(model="openai/x", api_base=address, timeout=1.0, num_retries=0))
        client.begin(Meter())
        with pytest.raises(ProviderError, match="no answer within 1 s"):
            client.complete([{"role": "user", "content": "?"}], {})
        stop.set()


def test_the_papers_profile_decides_greedily_unless_told_otherwise():
    paper = {"model": "m", "profile": "paper"}
    assert Settings.of(paper).temperature == 0.0
    assert Settings.of({**paper, "temperature": 0.7}).temperature == 0.7
    assert Settings.of({"model": "m"}).temperature is None
