"""Calls that play several parts: chunk by chunk, seen by observers, broken off by whoever wants, counted as what they
are."""

from functools import partial

import numpy as np
import pytest
from hosting import host_of

from humanclaw import Backends, Body, Call, Control, Decision, Episode, Keyframes, Plugins, hookimpl, skill
from humanclaw.checks.fakes import FAKE, Fakes
from humanclaw.errors import HumanclawError, ReplayError
from humanclaw.records import PlayedPart, RecordedEpisode, free_episode
from humanclaw.skills import MotionError, parts
from humanclaw.testing import fake_body, fake_scene

NOD = Keyframes.cycle("head", axis="x", degrees=20, seconds=1)


@pytest.fixture(scope="module")
def stroll(plugins):
    """Walk by somebody else's adapter, then nod for a second: n + 2 chunks."""
    adapter = plugins.skill("walk").adapter

    @skill(role="locomotion")
    def stroll(strides: int = 3) -> list[Control | Keyframes]:
        """Walk a few strides and nod."""
        return [*[Control(adapter, {"x": 0.0, "z": 0.4, "yaw": 0.0})] * strides, NOD]

    return stroll


def episode(body, folder=None, **more):
    return Episode(body, free_episode("stroll", body.scene, max_steps=3), "tester", folder=folder, **more)


def submit(played, strides=3):
    return played.submit(Decision((Call("stroll", {"strides": strides}),)))


class Watcher:
    """Notes every chunk, and may do something at one of them."""

    def __init__(self, at=-1, act=lambda: None):
        self.heard, self.at, self.act = [], at, act

    @hookimpl
    def humanclaw_chunk(self, episode, step, chunk):
        self.heard.append((step, float(chunk.execution.simulated.root[-1, 2])))
        if len(self.heard) == self.at:
            self.act()


def test_a_sequence_is_played_chunk_by_chunk(stroll):
    with fake_body(stroll) as body:
        done = body.execute(Call("stroll", {"strides": 3}))
    assert [round(float(c.execution.simulated.root[-1, 2]), 3) for c in done.chunks] == [0.4, 0.8, 1.2, 1.2, 1.2]
    assert done.parts[-1] == PlayedPart("keyframes", 2, "head")
    assert done.parts[0] == PlayedPart("control", 1, "walk", {"x": 0.0, "z": 0.4, "yaw": 0.0})


def test_every_chunk_of_a_sequence_is_observed_before_the_next(stroll):
    with fake_body(stroll) as body:
        body.plugins.add(watcher := Watcher(), "watcher")
        with episode(body) as played:
            submit(played)
            submit(played, strides=1)
    assert [step for step, _ in watcher.heard] == [0] * 5 + [1] * 3
    assert [round(z, 2) for _, z in watcher.heard[:3]] == [0.4, 0.8, 1.2]


def test_a_sequence_is_recorded_as_what_it_is(stroll, tmp_path):
    with fake_body(stroll) as body, episode(body, tmp_path / "one") as played:
        step = submit(played)
    (read,) = RecordedEpisode(tmp_path / "one").steps
    assert read == step
    assert (read.chunks, read.motion_frames, len(read.parts), read.cancelled) == (5, 75, 4, False)
    assert [round(z, 3) for _, _, z in read.path] == [0.0, 0.4, 0.8, 1.2, 1.2, 1.2]


@pytest.mark.parametrize("how", ["cancel", "stop"])
def test_a_sequence_that_is_broken_off_is_a_step_of_what_was_played(stroll, tmp_path, how):
    with fake_body(stroll) as body:
        played = episode(body, tmp_path / "one")
        body.plugins.add(Watcher(2, getattr(played, how)), "watcher")
        with played:
            step = submit(played)
            assert (step.chunks, step.cancelled) == (2, True)
            assert [part.chunks for part in step.parts] == [1, 1]
            assert "broke it off" in str(step.feedback)
            assert played.done == (how == "stop")
            if how == "cancel":
                assert submit(played, strides=1).cancelled is False


def test_a_step_that_was_broken_off_is_replayed_as_far_as_it_went(stroll):
    with fake_body(stroll) as body:
        played = episode(body)
        body.plugins.add(Watcher(2, played.cancel), "watcher")
        with played:
            step = submit(played)
    with fake_body(stroll) as body, episode(body, replay=[step]) as again:
        assert body.history.root[-1, 2] == pytest.approx(0.8)
        assert submit(again).step == 1


def test_a_call_that_is_over_has_nothing_to_break_off(stroll):
    with fake_body(stroll) as body:
        left = iter([True, False])
        done = body.execute(Call("stroll", {"strides": 0}), lambda chunk: next(left))
    assert (len(done.chunks), done.parts, done.feedback.cancelled) == (2, (), False)


def test_the_motion_model_continues_its_own_chunks_in_a_sequence(plugins, stroll):
    """With the real model: three strides of 40 cm, each with noise of its own."""
    with Body("fake:", plugins=plugins_with(stroll, plugins), backends=Backends("fake", "fake", "dit")) as body:
        done = body.execute(Call("stroll", {"strides": 3}))
    roots = [chunk.commanded.root for chunk in done.chunks]
    assert roots[2][-1, 2] == pytest.approx(1.2, abs=0.15)
    assert not np.allclose(roots[0] - roots[0][0], roots[1] - roots[1][0], atol=1e-4)


def plugins_with(made, plugins):
    host = host_of("model", motion_generators=[("dit", partial(plugins.make, "motion_generators", "dit"))])
    host.add(Fakes([made]), FAKE)
    return host


@pytest.mark.parametrize("plan", [None, [], ["walk"], 7, [NOD, None]])
def test_what_is_no_plan_is_refused_by_name(plan):
    with pytest.raises(MotionError, match="a plan is a Control, Keyframes, a Reach"):
        parts(plan)


def test_ten_seconds_is_the_longest_that_a_sequence_lasts():
    assert len(parts([NOD] * 10)) == 10
    with pytest.raises(MotionError, match="at most 10 s; got 11 s"):
        parts([NOD] * 11)


# -- the ends of an episode --------------------------------------------------------------------------------------------
def test_an_episode_without_attempts_is_refused(stroll):
    with fake_body(stroll) as body, pytest.raises(HumanclawError, match="at least one attempt a step; got 0"):
        episode(body, attempts=0)


def test_a_decision_after_a_stop_from_outside_is_told_of_the_end(stroll):
    with fake_body(stroll) as body, episode(body) as played:
        played.stop()
        with pytest.raises(HumanclawError, match=r"the episode has ended \(stopped from outside\)"):
            submit(played)


@pytest.mark.parametrize("last", ["stopped", "executed"])
def test_steps_that_follow_the_end_of_a_record_are_not_replayed(stroll, last):
    with fake_body(stroll) as body, episode(body) as played:
        step = submit(played, strides=0)
    steps = [step.model_copy(update={"step": k}) for k in range(4)]
    steps[1] = steps[1].model_copy(update={"status": last})
    with fake_body(stroll) as body, pytest.raises(ReplayError, match="has 4 steps, and the episode ends with step"):
        episode(body, replay=steps)


@skill(role="posture")
def squat() -> Keyframes:
    """Squat."""
    return Keyframes((0.0, 0.5), {}, root=((0.0, 0.0, 0.0), (0.0, -0.5, -0.3)))


@skill()
def nod() -> Keyframes:
    """Nod."""
    return NOD


def test_a_body_that_is_down_rises_for_a_second_before_it_steps(stroll):
    with fake_body(stroll, squat, nod) as body:
        body.execute(Call("squat", {}))
        feet = body.state().body.joints()[0, 7:9]
        done = body.execute(Call("stroll", {"strides": 1}))
        again = body.execute(Call("stroll", {"strides": 1}))
    ends = [chunk.execution.simulated[-1:] for chunk in done.chunks]
    assert (len(done.chunks), len(again.chunks)) == (2 + 1 + 2, 1 + 2)
    assert [part.chunks for part in done.parts] == [3, 2]
    assert (done.rise_frames, again.rise_frames) == (30, 0)
    assert ends[1].root[0, 1] == pytest.approx(0.96, abs=0.02)
    np.testing.assert_allclose(ends[1].joints()[0, 7:9], feet, atol=0.01)
    assert ends[2].root[0, 2] - ends[1].root[0, 2] == pytest.approx(0.4, abs=0.01)


def test_with_the_papers_profile_the_motion_model_steps_from_any_pose(stroll):
    plugins = Plugins()
    plugins.add(Fakes((stroll, squat)), FAKE)
    with Body(fake_scene(), plugins=plugins, backends=Backends(FAKE, FAKE, FAKE, "paper")) as body:
        body.execute(Call("squat", {}))
        done = body.execute(Call("stroll", {"strides": 1}))
    assert (len(done.chunks), done.rise_frames) == (1 + 2, 0)


def test_a_body_that_is_down_stays_down_for_gestures_and_postures(stroll):
    with fake_body(stroll, squat, nod) as body:
        body.execute(Call("squat", {}))
        assert len(body.execute(Call("nod", {})).chunks) == 2
        assert body.state().body.root[-1, 1] < 0.5
