"""The clock: the world waits for thought, or goes on meanwhile, and a replay waits as long as the episode did."""

import time

import pytest

from humanclaw import Call, Decision, Episode, Keyframes, run_episode, skill
from humanclaw.body import FUTURE
from humanclaw.checks.fakes import ScriptedAgent
from humanclaw.records import RecordedEpisode, free_episode
from humanclaw.testing import fake_body


@skill()
def bow() -> Keyframes:
    """Bow for half a second."""
    return Keyframes.cycle("spine1", "x", 20, 0.5)


class Slow(ScriptedAgent):
    """Thinks for a little more than a second."""

    def decide(self, observation, history):
        time.sleep(1.05)
        return super().decide(observation, history)


def episode(body, agent, folder=None, **given):
    return Episode(body, free_episode("bow", body.scene, max_steps=10), agent, folder=folder, **given)


@pytest.mark.parametrize(("clock", "goes_on"), [("paused", False), ("real", True)])
def test_half_a_second_of_thought_costs_a_step_by_the_real_clock(clock, goes_on):
    with fake_body(bow) as body, episode(body, Slow([Call("bow")]), clock=clock) as begun:
        step = begun.ask()
    assert step.waited == (int(2 * step.seconds["decide"]) if goes_on else 0)
    assert step.motion_frames == FUTURE * (step.waited + 1)
    assert ("passed while you thought" in str(step.feedback)) == goes_on


def test_an_episode_that_is_run_has_the_clock_that_it_is_given(tmp_path):
    with fake_body(bow) as body:
        spec = free_episode("bow", body.scene, max_steps=4)
        run_episode(body, spec, Slow([Call("bow")]), folder=tmp_path, clock="real")
    assert RecordedEpisode(tmp_path).steps[0].waited >= 2


def test_thought_uses_up_the_steps_of_an_episode():
    with fake_body(bow) as body, episode(body, "me") as begun:
        begun.submit(Decision((Call("bow"),)), waited=8)
        assert not begun.done
        begun.submit(Decision((Call("bow"),)))
        assert begun.outcome == "out_of_steps"


def test_a_replay_waits_as_long_as_its_record_says(tmp_path):
    with fake_body(bow) as body, episode(body, "me", tmp_path / "first") as begun:
        begun.submit(Decision((Call("bow"),)), waited=3)
    steps = RecordedEpisode(tmp_path / "first").steps
    with fake_body(bow) as body, episode(body, "me", tmp_path / "again", replay=steps):
        pass
    first, again = (RecordedEpisode(tmp_path / name).motion("simulated") for name in ("first", "again"))
    assert len(first) == len(again) == 5 + 4 * FUTURE
    assert (first.rotations == again.rotations).all()
