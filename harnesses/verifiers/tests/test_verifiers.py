"""`vf-eval` plays training tasks with a scripted model: tools, pictures, rewards and facts."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("verifiers.v1", reason="verifiers is not installed: pip install humanclaw-verifiers")

from model_servers import OpenAIServer, call, calls, message

from humanclaw import EpisodeSpec, HumanclawError
from humanclaw.records import write_episodes
from humanclaw_verifiers.taskset import BodyConfig, BodyTaskset

SEES = "visible_state: A chair is ahead."


def _evaluated(script, tmp_path, *words):
    """Run vf-eval on the first task of `approach`; return the trace of its rollout and the model's requests."""
    command = [Path(sys.executable).parent / "vf-eval", "humanclaw-verifiers", "-n", "1", "-r", "1"]
    options = {"tasks": "approach", "options": json.dumps({"houses": 1})}
    flags = [word for key, value in options.items() for word in (f"--env.taskset.{key}", value)]
    with OpenAIServer(script) as server:
        flags += ["--model", "scripted", "--client.base-url", server.url, "--client.api-key-var", "SCRIPTED_KEY"]
        flags += ["--output-dir", str(tmp_path), "--rich", "None", *words]
        done = subprocess.run(
            [*command, *flags], env={**os.environ, "SCRIPTED_KEY": "none"}, cwd=tmp_path, capture_output=True, text=True
        )
        assert done.returncode == 0, done.stderr[-3000:]
        (file,) = tmp_path.rglob("traces.jsonl")
        (trace,) = json.loads(file.read_text("utf-8").splitlines()[0])["traces"]
        return trace, server.requests


@pytest.mark.integration
def test_an_evaluation_scores_what_the_body_did(tmp_path):
    walk = call("walk", thoughts=SEES, z_cm=60)
    mute = message({"role": "assistant", "content": None})
    script = [walk, mute, calls(("walk", {"z_cm": 40}), ("stop", {})), call("stop", thoughts=SEES)]
    trace, requests = _evaluated(script, tmp_path)
    assert len(requests) == 4
    assert {"walk", "sit_in_place", "stop"} <= set(requests[0].tool_names)
    assert "Calling stop ends the episode" in requests[0].role("system")
    assert [len(request.images) for request in requests] == [1, 2, 3, 4]
    assert "no call" in requests[2].text
    assert all("content" in message for message in requests[2].messages), "a server may refuse a message of nothing"
    assert "2 calls" in requests[3].text
    metrics = trace["metrics"]
    assert (metrics["steps"], metrics["solved"], metrics["found"], metrics["arrived"]) == (4, 0, 1, 0)
    assert 0.03 < trace["rewards"]["earned"]["score"] < 0.3, "progress of one walk of 60 cm, times .3"


@pytest.mark.parametrize("wrong", [{"tasks": "nonsense"}, {"options": {"houses": 0}}, {"rewards": {"none": 1.0}}])
def test_wrong_names_and_options_are_refused_before_any_rollout(wrong):
    with pytest.raises(HumanclawError):
        next(BodyTaskset(BodyConfig(**wrong)).load())


def test_a_house_of_a_test_is_refused_before_any_rollout(tmp_path):
    write_episodes(tmp_path / "mine.jsonl", [EpisodeSpec(id="a", instruction="find a couch", scene="house:3")])
    options = {"file": str(tmp_path / "mine.jsonl")}
    with pytest.raises(HumanclawError, match="is a house of val"):
        next(BodyTaskset(BodyConfig(tasks="file", options=options)).load())
