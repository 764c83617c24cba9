"""Tests of rate limits that workers share, and of streamed answers."""

from __future__ import annotations

import multiprocessing
import threading
import time

import pytest
from model_servers import (
    AnthropicServer,
    GeminiServer,
    OllamaServer,
    OpenAIServer,
    call,
    redirected,
    status,
)

from humanclaw import LimitError, Meter
from humanclaw_litellm.rates import RateLimiter
from humanclaw_litellm.settings import ModelError, Settings


class Clock:
    """A clock that tests set."""

    def __init__(self) -> None:
        self.now = 1000.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def clock():
    return Clock()


# -- the gate ----------------------------------------------------------------------------------------------------------
def test_requests_are_spread_evenly_over_the_minute(tmp_path, clock):
    gate = RateLimiter(tmp_path / "a", requests=30, clock=clock)
    assert [gate.enter(0) for _ in range(3)] == [0, 2, 4]
    clock.now += 60
    assert gate.enter(0) == 0


def test_tokens_are_counted_beforehand_and_settled_afterwards(tmp_path, clock):
    gate = RateLimiter(tmp_path / "a", tokens=6000, clock=clock)
    assert gate.enter(1000) == 0
    gate.settle(500)
    assert gate.enter(0) == pytest.approx(15)
    gate.settle(-1500)
    assert gate.enter(0) == pytest.approx(0)


def test_the_slower_rate_is_the_one_that_is_kept(tmp_path, clock):
    gate = RateLimiter(tmp_path / "a", requests=60, tokens=6000, clock=clock)
    gate.enter(50)
    assert gate.enter(1000) == pytest.approx(1)
    assert gate.enter(0) == pytest.approx(11)


def test_what_the_provider_asks_for_holds_for_everybody(tmp_path, clock):
    RateLimiter(tmp_path / "a", clock=clock).close(7)
    assert RateLimiter(tmp_path / "a", clock=clock).enter(1) == pytest.approx(7)


@pytest.mark.parametrize("content", ["", "nonsense", "nan", "1e9", "-1e9"])
def test_a_moment_that_cannot_be_is_not_waited_for(tmp_path, clock, content):
    (tmp_path / "a").write_text(content)
    assert RateLimiter(tmp_path / "a", requests=60, clock=clock).enter(0) == 0


def test_a_rate_that_cannot_be_shared_is_refused(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(ModelError, match="no rate can be kept"):
        RateLimiter(tmp_path / "file" / "a", requests=60).enter(0)
    assert RateLimiter(tmp_path / "file" / "a").enter(0) == 0


def passes(path, count):
    gate = RateLimiter(path, requests=6)
    for _ in range(count):
        gate.enter(0)


@pytest.mark.integration
def test_processes_share_one_gate_and_none_loses_the_turn_of_another(tmp_path):
    began = time.monotonic()
    context = multiprocessing.get_context("spawn")
    workers = [context.Process(target=passes, args=(tmp_path / "a", 30)) for _ in range(2)]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    assert [worker.exitcode for worker in workers] == [0, 0]
    assert RateLimiter(tmp_path / "a", requests=6).enter(0) > 60 * 10 - (time.monotonic() - began)


# -- the agent -----------------------------------------------------------------------------------------------------
@pytest.mark.integration
def test_two_agents_keep_to_one_rate_of_requests(begin, view):
    with OpenAIServer([call("stop")] * 4) as server:
        agents = [begin(server, requests_per_minute=120) for _ in range(2)]
        began = time.monotonic()
        threads = [threading.Thread(target=agent.decide, args=(view(), ())) for agent in agents for _ in range(2)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    assert time.monotonic() - began >= 1.5


@pytest.mark.integration
def test_tokens_that_an_answer_took_are_waited_for(begin, view):
    with OpenAIServer([call("stop")] * 2) as server:
        agent = begin(server, tokens_per_minute=66_000)
        began = time.monotonic()
        agent.decide(view(), ())
        agent.decide(view(), ())
    assert time.monotonic() - began >= 0.9, "1100 tokens at 1100 a second"


@pytest.mark.integration
def test_a_wait_that_one_agent_is_asked_for_holds_for_the_other(begin, view):
    with OpenAIServer([status(429, headers={"Retry-After": "1"}), call("stop"), call("stop")]) as server:
        first, second = begin(server), begin(server)
        began = time.monotonic()
        thread = threading.Thread(target=first.decide, args=(view(), ()))
        thread.start()
        while not server.requests:
            time.sleep(0.01)
        time.sleep(0.2)
        second.decide(view(), ())
        assert time.monotonic() - began >= 1
        thread.join()


@pytest.mark.integration
def test_a_limit_on_time_also_ends_the_waiting_for_a_turn(context, begin, view):
    import dataclasses

    meter = Meter({"call.seconds": 0.5})
    hurried = dataclasses.replace(context, meter=meter)
    with OpenAIServer([call("stop")] * 2) as server:
        agent = begin(server, about=hurried, requests_per_minute=1)
        agent.decide(view(), ())
        meter.begin("call")
        began = time.monotonic()
        with pytest.raises(LimitError):
            agent.decide(view(), ())
    assert time.monotonic() - began < 30, "its turn comes after 60 s"
    assert len(server.requests) == 1


# -- in pieces -----------------------------------------------------------------------------------------------------
# -- elsewhere -----------------------------------------------------------------------------------------------------
@pytest.mark.integration
@pytest.mark.parametrize(
    ("model", "kind"),
    [
        ("openai/x", OpenAIServer),
        ("hosted_vllm/x", OpenAIServer),
        ("anthropic/claude-x", AnthropicServer),
        ("gemini/gemini-2.5-pro", GeminiServer),
        ("ollama_chat/x", OllamaServer),
    ],
)
@pytest.mark.parametrize("code", [302, 307, 308])
def test_prompt_and_picture_follow_no_redirect(begin, view, monkeypatch, model, kind, code):
    for name in ("ANTHROPIC_API_KEY", "GEMINI_API_KEY"):
        monkeypatch.setenv(name, "planted-0123456789-key")
    with kind([call("stop")] * 2) as other:
        with kind(lambda request: redirected(f"{other.origin}{request.path}", code)) as server:
            with pytest.raises(ModelError, match=f"sends requests on to {other.origin}"):
                begin(server, model=model, num_retries=2).decide(view(), ())
            assert len(server.requests) == 1
        assert other.requests == []


def test_a_rate_is_a_positive_number():
    with pytest.raises(ModelError, match="requests_per_minute"):
        Settings.of({"model": "m", "requests_per_minute": 0})
