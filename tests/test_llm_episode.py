"""A language model drives a body: the whole way over HTTP, from the picture to the motion."""

import json

import pytest

from humanclaw.bench.tasks import free_episode
from humanclaw.loop import run_episode
from humanclaw.records import RecordedEpisode
from humanclaw.testing.openai_server import OpenAIServer, call, calls, status


@pytest.fixture
def play(body, house, plugins, tmp_path):
    def run(*script, verify=None, max_steps=4):
        spec = free_episode("find a couch and sit on it", house, max_steps=max_steps)
        with OpenAIServer(script) as server:
            options = {"model": "openai/scripted", "api_base": server.url, "num_retries": 1, "backoff": 0.01}
            agent = plugins.make("decision_makers", "litellm", options)
            verifier = plugins.make("verifiers", "litellm", options) if verify else None
            run_episode(body, spec, agent, verifier, folder=tmp_path / "episode")
        return RecordedEpisode(tmp_path / "episode"), server.requests

    return run


def test_a_model_walks_and_stops(play):
    thought = {"visible_state": "A hall.", "progress": "Nothing yet.", "reasoning": "The way is free."}
    episode, requests = play(call("walk", **thought, z_cm=40, x_cm=0, yaw_deg=0), call("stop", **thought))
    assert [step.call.skill for step in episode.steps] == ["walk", "stop"]
    assert episode.record.outcome == "stopped"
    attempt = episode.steps[0].attempts[0]
    assert (attempt.visible_state, attempt.reasoning) == ("A hall.", "The way is free.")
    assert {"walk", "turn_in_place", "sit_in_place", "stop"} <= set(requests[0].tool_names)
    assert requests[0].images[-1].shape == (512, 512, 3)


def test_what_was_wrong_is_told_to_the_model_and_mended_by_it(play):
    episode, requests = play(
        call("walk", z_cm=400),
        calls(("walk", {"z_cm": 40}), ("stop", {})),
        call("walk", z_cm=40),
        call("stop"),
    )
    assert "400 is greater than the maximum of 80" in requests[1].text
    assert "2 calls" in requests[2].text
    assert [step.call.skill for step in episode.steps] == ["walk", "stop"]
    assert len(episode.steps[0].attempts) == 3


def test_a_provider_that_keeps_failing_moves_nobody(play):
    episode, _ = play(call("walk", z_cm=40), *[status(503)] * 10)
    assert episode.record.outcome == "infra_error"
    assert len(episode.steps) == 1


def test_no_key_reaches_a_record(play, monkeypatch):
    monkeypatch.setenv("OPENAI_API_KEY", "sk-planted-0123456789")
    episode, requests = play(call("walk", z_cm=40), status(401, "bad key sk-planted-0123456789"))
    assert "sk-planted" in json.dumps(dict(requests[0].headers))
    for path in episode.folder.rglob("*"):
        if path.is_file():
            assert b"sk-planted" not in path.read_bytes(), path
