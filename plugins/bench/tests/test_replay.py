"""`bench verify --replay` plays recorded calls again: whatever a record tells, it must come out the same."""

import json
from dataclasses import replace

import pytest
import toy_world
from click.testing import CliRunner
from test_isolation import PLAIN, board, play  # noqa: F401

from humanclaw import RecordedEpisode
from humanclaw.records import close_record, write_episodes
from humanclaw_bench.cli import bench
from humanclaw_bench.replay import sample

pytestmark = pytest.mark.integration

VERIFIED = """
class Mine(Agent):
    def decide(self, observation, history):
        bad = observation.step == 1 and not observation.feedback.refusal
        call = Call("fly") if bad else Call("stop") if observation.step == 3 else Call("walk", {"z_cm": 30})
        return Decision((call,))
"""


def verify(folder, *more):
    return CliRunner().invoke(bench, ["verify", str(folder), "--replay", *more, "--plugin", toy_world.FILE])


def test_an_honest_run_comes_out_the_same(play):  # noqa: F811
    _, folder = play(VERIFIED, 3)
    answer = verify(folder)
    assert (answer.exit_code, "3 of 3 episodes came out the same" in answer.output) == (0, True), answer.output
    assert len(RecordedEpisode(folder / "toy-0").steps[1].attempts) == 2


def test_a_sample_is_played_if_it_is_asked_for(play):  # noqa: F811
    _, folder = play(PLAIN, 3)
    assert "2 of 2 episodes came out the same" in verify(folder, "2").output


def test_two_millimetres_that_an_agent_added_by_hand_are_found(play):  # noqa: F811
    cheats = """
from dataclasses import replace
class Mine(Agent):
    def decide(self, observation, history):
        frame = sys._getframe()
        while not isinstance(frame.f_locals.get("self"), Episode):
            frame = frame.f_back
        simulator, closer = frame.f_locals["self"].body._simulator, [0.002, 0.0, 0.0]
        real = type(simulator).state
        def state():
            state = real(simulator)
            return replace(state, body=replace(state.body, root=state.body.root + closer))
        simulator.state = state
        return super().decide(observation, history)
"""
    _, folder = play(cheats, in_process=True)
    answer = verify(folder)
    assert answer.exit_code == 1
    assert "toy-0: step 0: its" in answer.output


@pytest.mark.parametrize(("field", "value"), [("geodesic", 0.1), ("target_pixels", {"20": 9}), ("yaw_end", 1.0)])
def test_a_step_that_tells_more_than_happened_is_found(play, field, value):  # noqa: F811
    _, folder = play(PLAIN)
    episode = RecordedEpisode(folder / "toy-0")
    lines = (folder / "toy-0" / "steps.jsonl").read_text().splitlines()
    lines[3] = json.dumps(json.loads(lines[3]) | {field: value})
    (folder / "toy-0" / "steps.jsonl").write_text("\n".join(lines) + "\n")
    close_record(folder / "toy-0", episode.record)
    answer = verify(folder)
    assert f"step 3: its {field} differs" in answer.output


def test_a_skill_of_another_role_than_it_has_is_found(play):  # noqa: F811
    _, folder = play(PLAIN)
    record = RecordedEpisode(folder / "toy-0").record
    sits = {name: replace(info, role="sit") if name == "walk" else info for name, info in record.skills.items()}
    close_record(folder / "toy-0", record.model_copy(update={"skills": sits}))
    assert "toy-0: its skill walk differs." in verify(folder).output


def test_nobody_knows_beforehand_which_episodes_are_played_again(play):  # noqa: F811
    _, folder = play(PLAIN, 9, in_process=True)
    drawn = [tuple(episode.record.spec.id for episode in sample(folder, 4)) for _ in range(20)]
    assert len({*drawn}) > 1


def test_other_weights_are_named_and_not_called_a_lie(play):  # noqa: F811
    _, folder = play(PLAIN)
    record = RecordedEpisode(folder / "toy-0").record
    close_record(folder / "toy-0", record.model_copy(update={"weights": {"base": "another"}}))
    answer = verify(folder)
    assert "toy-0: other versions are installed: base was another, here toy." in answer.output
    assert "0 of 1 episode came out the same" in answer.output


def test_the_leaderboard_marks_records_that_cannot_be_played_again(play):  # noqa: F811
    _, folder = play(PLAIN, 2)
    other = {"base": "another"}
    for name in ("toy-0", "toy-1"):
        record = RecordedEpisode(folder / name).record
        close_record(folder / name, record.model_copy(update={"weights": record.weights | other}))
    why = "whole, but only 0 of 2 episodes played again the same: toy-0: other versions are installed"
    assert f"<span class='told'>{why}" in board(folder, "--replay", "--plugin", toy_world.FILE)


def test_the_leaderboard_plays_submitted_records_again(play):  # noqa: F811
    _, folder = play(PLAIN, 2)
    same = "whole; 2 of 2 episodes played again the same by the organisers"
    page = board(folder, "--replay", "--by", "the organisers", "--plugin", toy_world.FILE)
    assert f"<span class='good'>{same}" in page


def test_the_leaderboard_marks_the_table_of_the_hidden_test(play):  # noqa: F811
    _, folder = play(PLAIN, 2)
    test = folder.parent / "test.jsonl"
    write_episodes(test, [RecordedEpisode(folder / name).record.spec for name in ("toy-0", "toy-1")])
    assert "<caption>not one of the benchmark&#39;s:" in board(folder)
    assert "<caption>hidden test:" in board(folder, "--hidden", test)
