"""The loop: what the agent does wrong comes back to it as words, and nothing illegal reaches the motion model."""

import json
import math
import random
import re

import numpy as np
import pytest
from hosting import plugin

from humanclaw import Body, Call, Episode, Plugins, run_episode
from humanclaw.errors import CheckpointError, HumanclawError, ProviderError, RecordError, SceneError
from humanclaw.records import (
    Answer,
    Decision,
    RecordedEpisode,
    Refusal,
    Verdict,
    free_episode,
    read_episodes,
    write_episodes,
    write_record,
)
from humanclaw.testing import ScriptedAgent

STOP = Call("stop")
STEP = Call("walk", {"z_cm": 40})


class RecordingVerifier:
    """Says what it is told of every call."""

    name = "verifier"

    def __init__(self, verdict):
        self.verdict = verdict
        self.asked = []

    def begin(self, context):
        self.context = context

    def verify(self, observation, call, skill, goal):
        self.asked.append((call, skill.name, goal))
        return self.verdict


@pytest.fixture
def play(body, house, tmp_path):
    """Run a script in house:0; returns the record read back from disk and the agent that was asked."""

    def run(*script, verifier=None, max_steps=5, seed=0):
        agent = ScriptedAgent(script)
        spec = free_episode("find a couch and sit on it", house, seed=seed, max_steps=max_steps)
        run_episode(body, spec, agent, verifier, folder=tmp_path / "episode")
        return RecordedEpisode(tmp_path / "episode"), agent

    return run


def test_a_legal_call_moves_the_body_by_half_a_second(play):
    episode, _ = play(STEP, STOP)
    first = episode.steps[0]
    assert first.status == "executed"
    assert first.motion_frames == 15
    assert 0.2 < math.dist(first.start, first.end) < 0.6


def test_a_folder_may_be_a_text(body, house, tmp_path):
    spec = free_episode("find a couch", house, max_steps=1)
    run_episode(body, spec, ScriptedAgent([STOP]), folder=str(tmp_path / "episode"))
    (tmp_path / "mine.py").write_text("")
    assert RecordedEpisode(str(tmp_path / "episode")).record.outcome == "stopped"
    assert Plugins.discover([str(tmp_path / "mine.py")]).info("mine").error == ""
    write_episodes(str(tmp_path / "mine.jsonl"), [spec])
    assert read_episodes(str(tmp_path / "mine.jsonl")) == (spec,)


def test_a_body_begins_in_the_stance_that_its_first_motion_continues(body, house):
    """Otherwise hands and hips would leap in the first frame, and a first stair would lack what the hips sink by."""
    body.reset(house)
    before = body.state().body
    body.call("walk", z_cm=40)
    commanded = body.last.chunks[0].commanded
    leap = commanded.joints()[0] - before.joints()[-1]
    assert np.linalg.norm(leap, axis=-1).max() < 0.05


@pytest.mark.parametrize(
    "before", [(), (STEP,), (Call("sit_in_place", {"h_cm": 50}),), (Call("walk", {"z_cm": 400}),) * 3]
)
def test_an_active_stop_ends_the_episode_where_the_body_is(play, body, before):
    """Whatever came before it, also in full stride: the body stays, and what is measured is measured there."""
    episode, _ = play(*before, STOP)
    *rest, stop = episode.steps
    assert (stop.status, stop.call.skill) == ("stopped", "stop")
    assert (stop.motion_frames, stop.contacts, stop.touches) == (0, (), ())
    assert (stop.start, stop.yaw_start) == (stop.end, stop.yaw_end)
    assert len(episode.motion()) == 5 + sum(step.motion_frames for step in rest)
    assert np.array_equal(episode.motion().root[-1], body.state().body.root[-1])
    assert stop.target_distance is not None
    if rest:
        assert (stop.start, stop.target_distance) == (rest[-1].end, rest[-1].target_distance)
        assert stop.pelvis_contacts == rest[-1].pelvis_contacts


def test_an_episode_without_a_stop_runs_out_of_steps(play):
    episode, _ = play(*[Call("turn_in_place", {"yaw_deg": 20})] * 3, max_steps=3)
    assert (episode.record.outcome, episode.record.steps) == ("out_of_steps", 3)


@pytest.mark.integration
@pytest.mark.parametrize(
    ("bad", "hint"),
    [
        (Call("wlak", {"z_cm": 40}), "there is no skill 'wlak'. Did you mean walk?"),
        (Call("walk", {"z_cm": 400}), "400 is greater than the maximum of 80"),
        (Decision((STEP, STOP)), "the answer held 2 calls; make exactly one"),
        (Decision(()), "the answer held no call; make exactly one"),
    ],
)
def test_an_unusable_answer_is_explained_and_the_episode_goes_on(play, bad, hint):
    episode, agent = play(bad, STEP, STOP)
    assert hint in str(agent.heard[1].feedback)
    assert [step.status for step in episode.steps] == ["executed", "stopped"]
    assert [hint in attempt.error for attempt in episode.steps[0].attempts] == [True, False]


def test_after_three_unusable_answers_the_step_is_lost(play):
    episode, _ = play(*[Call("walk", {"z_cm": 400})] * 3, STOP)
    lost = episode.steps[0]
    assert (lost.status, lost.call, lost.motion_frames) == ("invalid", None, 0)
    assert lost.start != (0.0, 0.0, 0.0)
    assert len(episode.motion()) == 5  # standing


def test_a_provider_that_fails_ends_the_episode_without_a_decision(play):
    episode, _ = play(STEP, ProviderError("503 for the fifth time"))
    assert (episode.record.outcome, episode.record.error) == ("infra_error", "503 for the fifth time")
    assert len(episode.steps) == 1


class Broken(RecordingVerifier):
    def verify(self, observation, call, skill, goal):
        raise ZeroDivisionError("a bug")


class NeverBegins(RecordingVerifier):
    def begin(self, context):
        raise ZeroDivisionError("a bug")


@pytest.mark.parametrize("judge", [Broken, NeverBegins])
def test_what_a_verifier_raises_fails_the_episode(play, judge):
    episode, _ = play(STEP, STOP, verifier=judge(None))
    assert (episode.record.outcome, len(episode.steps)) == ("plugin_error", 0)
    assert episode.record.error == f"{__name__.partition('.')[0]} raised ZeroDivisionError: a bug"


@pytest.mark.parametrize("raised", ["ZeroDivisionError: a bug", "SystemExit: a bug"])
def test_what_a_skill_raises_fails_the_episode_and_names_its_plugin(house, tmp_path, raised):
    breaking = tmp_path / "breaking.py"
    breaking.write_text(
        "from humanclaw import Keyframes, hookimpl, skill\n\n\n@skill()\ndef crack(times: int = 1) -> Keyframes:\n"
        "    'Crack.'\n    if times > 3:\n        raise " + raised.split(":")[0] + "('a bug')\n"
        "    return Keyframes.cycle('head', axis='x', degrees=20, seconds=0.5, times=1)\n\n\n"
        "@hookimpl\ndef humanclaw_skills(register):\n    register(crack)\n"
    )
    with Body(house, plugins=Plugins.discover([breaking])) as body:
        record = run_episode(body, free_episode("crack", house), ScriptedAgent([STEP, Call("crack", {"times": 9})]))
    assert (record.outcome, record.steps) == ("plugin_error", 1)
    assert "breaking" in record.error
    assert raised in record.error


def test_an_observer_that_raises_changes_no_outcome(house, tmp_path, caplog):
    for name, body in (("deaf", "raise ZeroDivisionError"), ("hears", "(FOLDER / episode.outcome).touch()")):
        (tmp_path / f"{name}.py").write_text(
            "from pathlib import Path\nfrom humanclaw import hookimpl\n\nFOLDER = Path(__file__).parent\n\n\n"
            f"@hookimpl\ndef humanclaw_step(episode, step):\n    {body}\n\n\n"
            f"@hookimpl\ndef humanclaw_episode_end(episode, folder):\n    {body}\n"
        )
    for order in (("deaf", "hears"), ("hears", "deaf")):
        plugins = Plugins.discover([tmp_path / f"{name}.py" for name in order])
        with Body(house, plugins=plugins) as body:
            assert run_episode(body, free_episode("stop", house), ScriptedAgent([STOP])).outcome == "stopped"
        for heard in ("running", "stopped"):
            (tmp_path / heard).unlink()
    assert "'deaf' failed at humanclaw_step" in caplog.text


def test_a_verifier_that_accepts_lets_the_call_through(play):
    verifier = RecordingVerifier(Verdict(True, None, (Answer("path_clear", True),)))
    episode, _ = play(STEP, STOP, verifier=verifier)
    assert verifier.asked[0] == (Call("walk", {"x_cm": 0, "z_cm": 40, "yaw_deg": 0}), "walk", "")
    assert episode.steps[0].call.skill == "walk"
    assert episode.steps[0].verdict.accepted


def test_a_verifier_puts_another_call_in_place(play):
    other = Call("turn_in_place", {"yaw_deg": 30})
    verifier = RecordingVerifier(Verdict(False, other, (Answer("path_clear", False, "a wall is near"),)))
    episode, agent = play(STEP, verifier=verifier, max_steps=2)
    assert episode.steps[0].call.skill == "turn_in_place"
    assert "a wall is near" in str(agent.heard[1].feedback)


def test_a_replacement_that_is_illegal_fails_open_and_says_so(play):
    verifier = RecordingVerifier(Verdict(False, Call("fly", {}), (Answer("path_clear", False),)))
    episode, _ = play(STEP, verifier=verifier, max_steps=1)
    assert episode.steps[0].call.skill == "walk"
    assert "there is no skill 'fly'" in episode.steps[0].verdict.failed_open


def test_an_episode_neither_reads_nor_moves_shared_randomness(body, house, tmp_path):
    spec = free_episode("walk", house, seed=3, max_steps=2)
    digests = set()
    for shared in (1, 2):
        random.seed(shared)
        np.random.seed(shared)
        before = random.getstate(), np.random.get_state()
        run_episode(body, spec, ScriptedAgent([STEP, STEP]), folder=tmp_path / str(shared))
        after = random.getstate(), np.random.get_state()
        assert after[0] == before[0]
        assert all(np.array_equal(old, new) for old, new in zip(before[1], after[1], strict=True))
        digests.add(RecordedEpisode(tmp_path / str(shared)).digest)
    assert len(digests) == 1


def test_another_seed_gives_another_motion(body, house, tmp_path):
    for seed in (1, 2):
        spec = free_episode("walk", house, seed=seed, max_steps=2)
        run_episode(body, spec, ScriptedAgent([STEP, STOP]), folder=tmp_path / str(seed))
    first, second = (RecordedEpisode(tmp_path / name).motion("generated") for name in ("1", "2"))
    assert not np.array_equal(first.root, second.root)


def test_a_scene_that_is_not_the_episodes_own_is_refused(body, house):
    spec = free_episode("walk", house).model_copy(update={"scene_digest": "0" * 64})
    with pytest.raises(SceneError, match="the episode was made for 000000000000"):
        run_episode(body, spec, ScriptedAgent([STOP]))


def test_the_record_holds_every_frame_and_every_view(play):
    episode, _ = play(STEP, Call("turn_in_place", {"yaw_deg": -45}), STOP)
    frames = sum(step.motion_frames for step in episode.steps)
    assert len(episode.motion("generated")) == len(episode.motion("simulated")) == 5 + frames
    assert all((episode.folder / step.frame_file).read_bytes()[:2] == b"\xff\xd8" for step in episode.steps)
    assert set(episode.steps[0].seconds) == {"observe", "decide", "generate", "simulate"}
    assert episode.record.targets.keys() == set(episode.record.spec.target_ids)


def unfinished(episode):
    """Leave the record as a crash would have."""
    write_record(episode.folder, episode.record.model_copy(update={"outcome": "running", "files": {}}))


def test_a_line_cut_off_by_a_crash_is_not_a_step(play):
    episode, _ = play(STEP, STEP, STOP)
    unfinished(episode)
    path = episode.folder / "steps.jsonl"
    path.write_text(path.read_text()[:-40])
    assert len(RecordedEpisode(episode.folder).steps) == 2


def test_a_line_that_is_no_step_is_refused(play):
    episode, _ = play(STOP)
    unfinished(episode)
    with (episode.folder / "steps.jsonl").open("a") as stream:
        stream.write(json.dumps({"step": 1}) + "\n")
    with pytest.raises(RecordError, match=r"steps\.jsonl:2 holds a line that is not a step"):
        RecordedEpisode(episode.folder)


def nested(levels):
    return {"in": nested(levels - 1)} if levels else 1


@pytest.mark.parametrize(
    "words", ["\x1b]52;c;aGk=\x07", "a couch\u2028and\u0085a\u2029bed\x0b\x0c\x1c", "half of a letter: \ud800"]
)
def test_what_a_model_writes_does_not_break_its_record(play, words):
    said = Decision((Call("turn_in_place", {"yaw_deg": 10}),), visible_state=words, raw=words)
    episode, _ = play(said, STOP)
    assert [step.status for step in episode.steps] == ["executed", "stopped"]
    printed = re.sub(r"[\x00-\x1f\x7f-\x9f\ud800]", "\ufffd", words)
    assert episode.steps[0].decision.visible_state == printed, "what a terminal would obey is not kept either"


@pytest.mark.parametrize(
    "bad", [{"z_cm": nested(400)}, {"z_cm": "\ud800"}, {"\ud800": 1}, {"z_cm": math.inf}, {"z_cm": 10**5000}]
)
def test_a_call_that_no_schema_asks_for_is_the_models_own_mistake(play, bad):
    episode, _ = play(Call("walk", bad), STOP)
    assert [bool(attempt.error) for attempt in episode.steps[0].attempts] == [True, False]


def test_what_a_model_wrote_at_length_is_not_said_back_to_it_whole(play):
    episode, _ = play(Call("w" * 90_000, {}), Call("walk", {"z_cm": "4" * 90_000}), STOP)
    assert all(len(attempt.error) < 1_000 for attempt in episode.steps[0].attempts)


def test_an_episode_is_stepped_by_hand_and_closed_by_its_block(body, house, tmp_path):
    with Episode(body, free_episode("walk", house, max_steps=9), "a test", folder=tmp_path / "episode") as episode:
        seen = episode.observe()
        refused = episode.submit(Decision((Call("walk", {"z_cm": 400}),)))
        assert isinstance(refused, Refusal)
        assert refused.attempts_left == 2
        assert episode.observe().feedback.refusal == refused.error
        step = episode.submit(Decision((Call("walk", {"z_cm": 40}),)))
        assert step.status == "executed"
        assert episode.observe().feedback.executed == step.call
        assert (seen.step, episode.observe().step, len(episode.history)) == (0, 1, 1)
    recorded = RecordedEpisode(tmp_path / "episode")
    assert (recorded.record.outcome, recorded.record.agent, recorded.steps) == ("interrupted", "a test", (step,))
    assert recorded.record.skills["stop"].role == "stop"
    with pytest.raises(HumanclawError, match=r"has ended \(interrupted\)"):
        episode.submit(Decision((STOP,)))


def test_stop_takes_no_further_decision(body, house, tmp_path):
    with Episode(body, free_episode("walk", house), folder=tmp_path / "stopped") as episode:
        episode.stop()
        assert episode.done
    with pytest.raises(KeyboardInterrupt), Episode(body, free_episode("walk", house), folder=tmp_path / "signal"):
        raise KeyboardInterrupt
    outcomes = [RecordedEpisode(tmp_path / name).record.outcome for name in ("stopped", "signal")]
    assert outcomes == ["interrupted", "interrupted"]


def test_an_unwritable_folder_is_refused_before_anything_is_written(body, house, tmp_path):
    (tmp_path / "file").write_text("in the way")
    spec = free_episode("walk", house, max_steps=1)
    with pytest.raises(RecordError, match="cannot write the record"):
        run_episode(body, spec, ScriptedAgent([STOP]), folder=tmp_path / "file" / "episode")


@pytest.fixture
def untrained(tmp_path):
    """Plugins with one skill whose adapter is still to be trained."""
    folder = tmp_path / "hop"
    folder.mkdir()
    schema = {"type": "object", "properties": {}, "description": "Hop once.", "additionalProperties": False}
    (folder / "schema.json").write_text(json.dumps(schema))
    plugins = Plugins.discover()
    plugins.add(plugin(skills=[folder]), "hopping")
    return plugins


def test_a_skill_without_adapter_says_how_to_train_it(untrained, house):
    with Body(house, plugins=untrained) as body:
        agent = ScriptedAgent([Call("hop"), STOP])
        run_episode(body, free_episode("hop", house, max_steps=1), agent)
        assert "hop is not available, its adapter is not trained" in str(agent.heard[1].feedback)
        with pytest.raises(CheckpointError, match=r"humanclaw train adapter --skill .*hop"):
            body.call("hop")


def test_a_corrupt_adapter_is_named_with_its_remedy(untrained, house, tmp_path):
    (tmp_path / "hop" / "adapter.safetensors").write_bytes(b"not a checkpoint")
    with Body(house, plugins=untrained) as body, pytest.raises(CheckpointError, match=r"hop.adapter\.safetensors"):
        body.call("hop")
