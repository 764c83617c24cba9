"""Rollouts: rows hold the prompt that a model was sent, its answer and its view; privileged words stay out."""

import json

import pytest
from click.testing import CliRunner
from model_servers import OpenAIServer, call
from rollouts import rollout, step

from humanclaw import Plugins, RecordError, load_run, run_episode
from humanclaw.cli import build
from humanclaw.records import Attempt, Decision, EpisodeSpec, RecordedEpisode
from humanclaw.skills import Call, read_call
from humanclaw_bench.attribution import CAUSES
from humanclaw_bench.rollouts import Conversations, Dataset, Wanted, require_honest
from humanclaw_bench.scores import score

SAYS = {"thoughts": "visible_state: A couch is ahead, 2 m away.\nprogress: I begin.\nreasoning: It is near."}
EYES = {"privileged": {"agent": True}, "agent": {"words": "eyes"}}


@pytest.fixture(scope="module")
def made(plugins):
    return Conversations(plugins)


def _texts(messages):
    content = [message["content"] for message in messages]
    parts = [[{"type": "text", "text": part}] if isinstance(part, str) else part for part in content]
    return [part.get("text", "picture") for group in parts for part in group]


@pytest.mark.integration
def test_a_row_is_the_request_that_a_model_was_sent_and_its_answer(body, house, plugins, made, tmp_path):
    spec = EpisodeSpec(id="one", instruction="find a couch", scene=house.name, target_category="couch", max_steps=3)
    script = [call("walk", **SAYS, z_cm=40), call("turn_in_place", **SAYS, yaw_deg=30), call("stop", **SAYS)]
    with OpenAIServer(script) as server:
        given = {"model": "openai/scripted", "api_base": server.url}
        run_episode(body, spec, plugins.make("agents", "litellm", given), folder=tmp_path / "one", options=given)
    (episode,) = load_run(tmp_path)
    rows = [row for row, _ in made.rows(episode, score(episode), None)]
    assert len(rows) == 3
    for row, request in zip(rows, server.requests, strict=True):
        assert _texts(row["messages"][:2]) == _texts(request.messages)
        assert [tool["function"] for tool in json.loads(row["tools"])] == request.tools
    said, asked = read_call("turn_in_place", rows[1]["messages"][2]["tool_calls"][0]["function"]["arguments"])
    assert (asked, said.reasoning) == (Call("turn_in_place", {"yaw_deg": 30}), "It is near.")


def test_the_words_of_an_agent_that_knows_the_map_are_refused(tmp_path):
    steps = [step(), step("stop")]
    with pytest.raises(RecordError, match="--option words=eyes"):
        require_honest(rollout(tmp_path, steps, name="a", settings={"privileged": {"agent": True}}))
    require_honest(rollout(tmp_path, steps, name="b", settings=EYES))
    require_honest(rollout(tmp_path, steps, name="c", settings={"privileged": {"agent": False}}))


def test_a_house_is_in_one_part_alone_and_about_a_tenth_are_in_test():
    parts = [Wanted().part(f"house:train-{number}") for number in range(1000)]
    assert 70 < parts.count("test") < 130
    assert parts == [Wanted(success=True).part(f"house:train-{number}") for number in range(1000)]
    assert parts == [Wanted().part(f"house:train-{number}?assets=/lib") for number in range(1000)], "other furniture"
    assert parts == [Wanted().part(f"humanclaw-houses:house:train-{number}") for number in range(1000)]


@pytest.mark.parametrize(
    ("wanted", "kept"),
    [
        (Wanted(), 2),
        (Wanted(success=True), 1),
        (Wanted(cause="nav: stop while far"), 1),
        (Wanted(difficulty="easy"), 0),
    ],
)
def test_filters_keep_what_they_name(tmp_path, wanted, kept):
    seen = {"says": "A couch is ahead.", "pixels": 500}
    good = rollout(tmp_path, [step(**seen, away=0.1), step("stop", **seen, away=0.1)], name="good", interact=False)
    far = rollout(tmp_path, [step(**seen), step("stop", **seen, away=3.0)], name="far", interact=False)
    cause = next(entry for entry in CAUSES if entry.label == "nav: stop while far")
    taken = [wanted.takes(good, score(good), None), wanted.takes(far, score(far), cause)]
    assert sum(taken) == kept


# -- the command -------------------------------------------------------------------------------------------------------
def _with_view(record, number):
    return record.model_copy(update={"frame_file": f"frames/{number:04d}.jpg"})


@pytest.fixture
def run(tmp_path):
    """run(name, calls, agent): a run of one episode with these calls; each has words and a view."""

    def make(name, calls, succeeds):
        near = {"away": 0.1 if succeeds else 3.0}
        steps = [
            step(skill, "A couch is ahead.", 500, params=params, attempts=(_said(skill, params),), **near)
            for skill, params in calls
        ]
        steps = [_with_view(record, number) for number, record in enumerate(steps)]
        folder = rollout(tmp_path / name, steps, interact=False, settings=EYES, agent="oracle").folder
        (folder / "frames").mkdir()
        for number in range(len(steps)):
            (folder / "frames" / f"{number:04d}.jpg").write_bytes(b"view %d" % number)
        return tmp_path / name

    return make


def _said(skill, params):
    return Attempt(Decision((Call(skill, params),), visible_state="A couch is ahead."))


def _command(*words):
    done = CliRunner().invoke(build(Plugins.discover), ["bench", "rollouts", *map(str, words)])
    assert done.exit_code == 0, done.output
    return done.stdout


def _rows(folder):
    files = sorted(folder.glob("t*/*.jsonl"))
    return [json.loads(line) for path in files for line in path.read_text("utf-8").splitlines()]


def test_an_interrupted_export_continues_and_its_card_names_the_parts(run, tmp_path):
    source = run("run", [("walk", {"z_cm": 40}), ("stop", {})], True)
    output = _command(source, "--out", tmp_path / "data")
    whole = {path.name: path.read_bytes() for path in (tmp_path / "data").rglob("*") if path.is_file()}
    (rows,) = (tmp_path / "data").glob("t*/*.jsonl")
    rows.unlink()
    (tmp_path / "data" / "README.md").unlink()
    assert _command(source, "--out", tmp_path / "data") == output
    assert {path.name: path.read_bytes() for path in (tmp_path / "data").rglob("*") if path.is_file()} == whole
    assert "  - split: train\n    path: train/*.jsonl\nlicense: " in whole["README.md"].decode()
    assert [tmp_path.joinpath("data", row["images"][0]).read_bytes() for row in _rows(tmp_path / "data")] == [
        b"view 0",
        b"view 1",
    ]


def test_two_runs_with_tasks_of_the_same_ids_both_become_data(run, tmp_path):
    """Two batches of training tasks begin with the same id, in other houses or by other agents."""
    calls = [("walk", {"z_cm": 40}), ("stop", {})], [("walk", {"z_cm": 30}), ("stop", {})]
    runs = [run(name, said, True) for name, said in zip(("one", "two"), calls, strict=True)]
    _command(runs[0], "--out", tmp_path / "data")
    _command(*runs, "--out", tmp_path / "data")
    said = [row["messages"][2]["tool_calls"][0]["function"]["arguments"] for row in _rows(tmp_path / "data")]
    assert sorted(json.loads(call).get("z_cm", 0) for call in said) == [0, 0, 30, 40]


def test_an_episode_that_had_not_ended_is_taken_when_it_has(run, tmp_path):
    source = run("run", [("walk", {"z_cm": 40}), ("stop", {})], True)
    record = source / "one" / "episode.json"
    ended = record.read_bytes()
    begun = RecordedEpisode(source / "one").record.model_copy(update={"outcome": "running", "steps": 0, "files": {}})
    record.write_text(begun.sealed.model_dump_json(), "utf-8")
    assert "0 rows in train" in _command(source, "--out", tmp_path / "data")
    record.write_bytes(ended)
    assert "2 rows in train" in _command(source, "--out", tmp_path / "data")


def test_a_folder_with_other_options_is_refused(run, tmp_path):
    source = run("run", [("walk", {"z_cm": 40}), ("stop", {})], True)
    _command(source, "--out", tmp_path / "data")
    with pytest.raises(RecordError, match="other options"):
        Dataset.at(tmp_path / "data", Wanted(success=True)).begin("Rollouts")


def test_a_preference_pair_is_the_first_step_that_differs(run, tmp_path):
    same = ("walk", {"z_cm": 40})
    bad = run("bad", [same, ("stop", {})], False)
    good = run("good", [same, ("walk", {"z_cm": 30}), ("stop", {})], True)
    _command(bad, "--repaired", good, "--out", tmp_path / "pairs")
    (row,) = _rows(tmp_path / "pairs")
    chosen, rejected = (row[key][0]["tool_calls"][0]["function"] for key in ("chosen", "rejected"))
    assert (row["step"], row["cause"]) == (1, "nav: stop while far")
    assert (chosen["name"], rejected["name"]) == ("walk", "stop")
    assert "result: Executed walk(z_cm=40)." in row["prompt"][1]["content"][0]["text"]


def test_two_plays_that_saw_something_else_make_no_pair(run, tmp_path):
    """The repaired run may be of other tasks with the same ids, or of another engine."""
    bad, good = run("bad", [("stop", {})], False), run("good", [("walk", {"z_cm": 30}), ("stop", {})], True)
    (good / "one" / "frames" / "0000.jpg").write_bytes(b"another view")
    assert "0 rows in train" in _command(bad, "--repaired", good, "--out", tmp_path / "pairs")


def test_runs_in_houses_of_val_are_refused(tmp_path):
    episode = rollout(tmp_path, [step(), step("stop")], settings=EYES)
    held = episode.record.model_copy(update={"spec": episode.record.spec.model_copy(update={"scene": "house:3"})})
    episode.record = held
    with pytest.raises(Exception, match="cannot be tested in it"):
        require_honest(episode)
