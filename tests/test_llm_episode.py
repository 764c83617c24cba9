"""A language model drives a body: the whole way over HTTP, from the picture to the motion, and from the command
line."""

import json

import pytest
from click.testing import CliRunner
from model_servers import OpenAIServer, call, calls, delayed, status, warm_up

from humanclaw import Plugins, run_episode
from humanclaw.cli import build
from humanclaw.errors import HumanclawError
from humanclaw.records import Meter, RecordedEpisode, free_episode

pytestmark = pytest.mark.integration

KEY = "sk-planted-0123456789-abcdef"
STEP = {"visible_state": "A hall, no couch.", "progress": "Nothing yet.", "reasoning": "The way is free.", "z_cm": 40}


@pytest.fixture
def play(body, house, plugins, tmp_path):
    warm_up()

    def run(*script, verify=False, max_steps=4, limits=None, **options):
        spec = free_episode("find a couch and sit on it", house, max_steps=max_steps)
        with OpenAIServer(script) as server:
            given = {"model": "openai/scripted", "api_base": server.url, "num_retries": 1, "backoff": 0.01} | options
            agent = plugins.make("agents", "litellm", given)
            verifier = plugins.make("verifiers", "litellm", given) if verify else None
            run_episode(
                body, spec, agent, verifier, folder=tmp_path / "episode", options=given, meter=Meter(limits)
            )  # fmt: skip
        return RecordedEpisode(tmp_path / "episode"), server.requests

    return run


def test_a_model_walks_and_stops(play):
    episode, requests = play(call("walk", **STEP), call("stop"))
    assert [step.call.skill for step in episode.steps] == ["walk", "stop"]
    assert episode.record.outcome == "stopped"
    decision = episode.steps[0].decision
    assert (decision.visible_state, decision.reasoning) == ("A hall, no couch.", "The way is free.")
    assert {"walk", "turn_in_place", "sit_in_place", "stop"} <= set(requests[0].tool_names)
    assert requests[0].images[-1].shape == (512, 512, 3)


def test_what_was_wrong_is_told_to_the_model_and_mended_by_it(play):
    episode, requests = play(
        call("walk", z_cm=400), calls(("walk", {"z_cm": 40}), ("stop", {})), call("walk", z_cm=40), call("stop")
    )
    assert "400 is greater than the maximum of 80" in requests[1].text
    assert "2 calls" in requests[2].text
    assert [step.call.skill for step in episode.steps] == ["walk", "stop"]
    assert len(episode.steps[0].attempts) == 3


def test_the_verifier_replaces_a_call_and_the_model_is_told(play):
    blocked = {"check_1_evidence": "a wall half a metre ahead", "check_1_answer": "no", "check_2_answer": "yes"}
    episode, requests = play(
        call("walk", **STEP),
        call("verdict", **blocked, skill="turn_in_place", parameters={"yaw_deg": 30}),
        call("stop"),
        status(500),
        status(500),
        verify=True,
    )
    first, last = episode.steps
    assert (first.call.skill, first.verdict.accepted) == ("turn_in_place", False)
    assert "a wall half a metre ahead" in requests[2].role("user")
    assert last.call.skill == "stop"
    assert "gave no answer" in last.verdict.failed_open  # It fails open, and says so.


def test_a_provider_that_keeps_failing_moves_nobody(play):
    episode, requests = play(call("walk", z_cm=40), *[status(503)] * 10)
    assert episode.record.outcome == "infra_error"
    assert len(episode.steps) == 1
    assert len(requests) == 1 + 2  # One retry was asked for.


# -- settings and limits -----------------------------------------------------------------------------------------------
def test_the_settings_in_force_are_in_the_record_with_their_defaults(play):
    episode, _ = play(call("stop"), status(500), verify=True, profile="paper", images=2)
    agent, verifier = episode.record.settings["agent"], episode.record.settings["verifier"]
    assert (agent["history"], agent["images"], agent["mid_level"], agent["mode"]) == (10, 2, True, "auto")
    assert (verifier["model"], verifier["timeout"]) == ("openai/scripted", 30.0)
    assert json.loads(episode.steps[0].decision.raw)["mode"] == "tools"


@pytest.mark.parametrize("waits", [[delayed(30, call("stop"))], [status(429, headers={"Retry-After": "30"})] * 9])
def test_a_limit_on_time_also_ends_the_waiting(play, waits):
    episode, _ = play(call("walk", **STEP), *waits, limits={"episode.seconds": 6}, num_retries=8)
    record = episode.record
    assert (record.outcome, record.limit, record.steps) == ("limit_reached", "episode", 1)


def test_a_limit_on_money_needs_a_price(play):
    with pytest.raises(HumanclawError, match="no price is known") as fault:
        play(call("stop"), limits={"episode.usd": 1})
    assert "input_cost_per_token" in fault.value.remedy
    prices = {"input_cost_per_token": 0.001, "output_cost_per_token": 0.0}
    episode, _ = play(*[call("walk", **STEP)] * 4, limits={"episode.usd": 1.5}, params=prices)
    assert (episode.record.outcome, episode.record.steps) == ("limit_reached", 1)  # 1,000 tokens make a dollar.


# -- from the command line ---------------------------------------------------------------------------------------------
@pytest.fixture
def shell(tmp_path, monkeypatch):
    """shell(*args): `humanclaw run` in tmp_path, with a key in the environment."""
    monkeypatch.setenv("OPENAI_API_KEY", KEY)
    monkeypatch.chdir(tmp_path)

    def run(*args):
        return CliRunner().invoke(build(Plugins.discover), ["run", "--out", "run", "--film", "none", *args])

    return run


def at(server):
    return ["--model", "openai/scripted", "--option", f"api_base={server.url}", "--option", "backoff=0.01"]


def test_every_switch_of_the_papers_ablation_reaches_the_model(shell, tmp_path):
    with OpenAIServer([call("walk", **STEP), call("walk", **STEP), call("stop")]) as server:
        done = shell(*at(server), "--profile=paper", "--history=1", "--images=2", "--no-verifier", "--no-mid-level",
                     "--limit=run.tokens=9000")  # fmt: skip
    assert done.exit_code == 0, done.output
    last = server.requests[2]
    assert (len(server.requests), len(last.images), last.text.count("<past step=")) == (3, 2, 1)
    assert "mid_level_goal" not in json.dumps(last.body)
    episode = RecordedEpisode(next((tmp_path / "run").glob("*/")))
    assert episode.record.settings["agent"]["history"] == 1
    assert episode.record.settings["limits"] == {"run.tokens": 9000}
    assert episode.record.verifier == ""


def test_a_model_without_eyes_gets_no_picture(shell):
    with OpenAIServer([call("stop")]) as server:
        assert shell(*at(server), "--images=0").exit_code == 0
    assert server.requests[0].images == []


def test_a_run_that_ends_by_a_limit_says_so(shell):
    with OpenAIServer([call("walk", **STEP)] * 3) as server:
        done = shell(*at(server), "--no-verifier", "--limit", "episode.tokens=1500")
    assert done.exit_code == 1
    assert "2200 tokens used; the limit episode.tokens is 1500" in done.stderr
    assert "limit reached after 1 step," in done.stdout


def test_a_planted_key_is_in_no_artefact_of_a_run(shell, tmp_path, caplog):
    """In what the model says, in errors that are retried, in the one that ends the run: and in no file and on no
    screen."""
    leaks = [
        status(429, f"slow down, {KEY}"),
        call("walk", **STEP | {"reasoning": f"I was told {KEY}", "visible_state": KEY}),
        call("verdict", check_1_evidence=KEY, check_1_answer="yes", check_2_answer="yes"),
        *[status(500, f"Incorrect key: {KEY}; Authorization: Bearer {KEY}")] * 9,
    ]
    with OpenAIServer(leaks) as server:
        done = shell(*at(server))
    assert done.exit_code == 1
    assert "Incorrect key: [redacted]" in done.stderr
    assert {request.headers["authorization"] for request in server.requests} == {f"Bearer {KEY}"}  # It was in play.
    files = [path for path in tmp_path.rglob("*") if path.is_file()]
    assert {"episode.json", "steps.jsonl", "report.html"} <= {path.name for path in files}
    seen = {path.name: path.read_bytes() for path in files} | {"screen": (done.output + caplog.text).encode()}
    assert not [name for name, content in seen.items() if KEY.encode() in content]
    assert b"[redacted]" in seen["steps.jsonl"]
