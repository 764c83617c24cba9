"""A company: bodies in one scene that decide at the same time, hear one another, and are recorded side by side."""

import shutil
import threading
import time
from functools import partial

import numpy as np
import pytest

from humanclaw import (
    Backends,
    Call,
    Chunk,
    Company,
    Episode,
    Grip,
    HumanclawError,
    Keyframes,
    Plugins,
    Speech,
    run_episode,
    skill,
)
from humanclaw.body import FUTURE, Pose2D, rest_pose
from humanclaw.checks.fakes import FAKE, FakeRenderer, Fakes, FakeWorld, ScriptedAgent, fake_scene
from humanclaw.records import RecordedEpisode, free_episode
from humanclaw.world import Execution, SceneBuilder, View, person_id, voice_distance

NEAR, FAR = Pose2D(0.0, 0.0), Pose2D(0.0, 2.0, np.pi)


@skill()
def bow() -> Keyframes:
    """Bow for half a second."""
    return Keyframes.cycle("spine1", "x", 20, 0.5)


@skill()
def long_bow() -> Keyframes:
    """Bow for a second and a half."""
    return Keyframes.cycle("spine1", "x", 20, 1.5)


@skill()
def greet() -> Speech:
    """Say hello."""
    return Speech("hello")


@skill()
def grasp() -> Grip:
    """Close a hand."""
    return Grip("right")


@skill(role="stop")
def finish() -> Keyframes:
    """End the episode."""
    return Keyframes.relax(0.5)


def company(starts=(NEAR, FAR), scene=None, **given):
    host = Plugins()
    host.add(Fakes([bow, long_bow, greet, grasp, finish]), FAKE)
    return Company(scene or fake_scene(), list(starts), plugins=host, backends=Backends(FAKE, FAKE, FAKE), **given)


def feedbacks(*names, slow=0.0):
    """Return a part that makes calls, and their feedback in words."""

    def part(body):
        said = []
        for name in names:
            time.sleep(slow)
            body.call(name)
            said.append(str(body.last.feedback))
        return said

    return part


@pytest.mark.parametrize("slow", [(0.0, 0.02), (0.02, 0.0)], ids=["the second thinks longer", "the first does"])
def test_a_speech_is_heard_in_the_next_half_second_whoever_thinks(slow):
    speaker, listener = (feedbacks("bow", "greet", "bow", slow=slow[0]), feedbacks("bow", "bow", "bow", slow=slow[1]))
    with company() as two:
        _, heard = two.play([speaker, listener])
    assert ["hello" in words for words in heard] == [False, True, False]
    assert heard[1].endswith('The other person, 2 m ahead of you, says: "hello".')


@pytest.mark.parametrize("slow", [(0.0, 0.02), (0.02, 0.0)], ids=["the second thinks longer", "the first does"])
def test_hands_close_in_the_order_of_the_starts_whoever_thinks(slow, monkeypatch):
    gripped = []
    monkeypatch.setattr(FakeWorld, "grip", lambda world, side, closed, body: gripped.append(body))
    with company() as two:
        two.play([feedbacks("grasp", slow=slow[0]), feedbacks("grasp", slow=slow[1])])
    assert gripped == [0, 1]


def test_a_long_call_goes_on_while_the_other_decides_three_times():
    with company() as two:
        parts = [feedbacks("long_bow", "bow"), feedbacks("bow", "bow", "bow", "greet", "bow")]
        long, _ = two.play(parts)
    assert ["hello" in words for words in long] == [False, True]


def test_who_thinks_longer_than_the_others_wait_stands_meanwhile():
    decided = threading.Event()

    def thinks(body):
        assert decided.wait(20)
        return feedbacks("bow")(body), body.last.chunks, body.state()

    def acts(body):
        began = time.monotonic()
        feedbacks("greet", "bow", "bow")(body)
        decided.set()
        return time.monotonic() - began

    with company(patience=2.0) as two:
        ((words,), chunks, state), took = two.play([thinks, acts])
    assert 2.0 <= took < 4.0, "who is late is waited for once, and again from its next call on"
    assert words.startswith("1 s passed while you thought.")
    assert "hello" in words
    with company() as two:  # The record of who was late leads to the same places again.
        again = two.play([lambda body: body.execute(Call("bow"), waited=2).chunks, feedbacks("greet", "bow", "bow")])[0]
    assert all(
        np.array_equal(*(getattr(chunk.commanded, part) for chunk in pair))
        for pair in zip(chunks, again, strict=True)
        for part in ("root", "rotations")
    )
    assert np.array_equal(state.body.root, again[-1].execution.simulated.root[-1:])


def test_who_has_ended_stands_while_the_others_go_on():
    with company() as two:
        two.play([feedbacks("bow"), feedbacks("bow", "bow", "bow")])
        assert np.allclose(two.bodies[0].state().body.root, NEAR.to_world(two.bodies[0].history).root[-1:], atol=0.2)
        assert two.play([feedbacks("bow"), feedbacks("bow")])  # And plays again with the others.


def test_an_error_of_one_is_raised_and_the_others_still_end():
    ended = threading.Event()

    def breaks(body):
        body.call("bow")
        raise ZeroDivisionError("of one")

    def plays(body):
        feedbacks("bow", "bow", "bow")(body)
        ended.set()

    with company() as two, pytest.raises(ZeroDivisionError, match="of one"):
        two.play([breaks, plays])
    assert ended.is_set()


def test_who_interrupts_one_interrupts_all():
    began, interrupted = threading.Event(), threading.Event()

    def leaves(body):
        began.wait()
        raise KeyboardInterrupt

    def waits(body):
        began.set()
        try:
            while True:
                time.sleep(0.01)
        except KeyboardInterrupt:
            interrupted.set()
            raise

    with company() as two, pytest.raises(KeyboardInterrupt):
        two.play([leaves, waits])
    assert interrupted.is_set()


def test_a_body_without_a_part_is_told_to_wait_for_one():
    with company() as two, pytest.raises(HumanclawError, match="plays no part now"):
        two.bodies[0].call("bow")


def test_one_of_two_cannot_begin_elsewhere_alone():
    with company() as two, pytest.raises(HumanclawError, match="1 of 2 bodies"):
        two.play([lambda body: body.reset(fake_scene()), feedbacks("bow")])


def test_one_start_given_to_both_episodes_is_told_from_the_bodys_own():
    spec = free_episode("bow", fake_scene()).model_copy(update={"start": NEAR})
    with company() as two, pytest.raises(HumanclawError, match=r"\(x 0.00, z 0.00\).*spec.start=body.start"):
        two.play([lambda body: run_episode(body, spec, ScriptedAgent([Call("finish")]))] * 2)


def test_one_speech_is_heard_in_half_a_second_and_the_speaker_told():
    with company() as two:
        replies, heard = two.play([feedbacks("greet", "greet", "bow", "greet"), feedbacks("bow", "bow")])
    assert [words.count("hello") for words in heard] == [1, 1]
    assert ["nobody hears more" in words for words in replies] == [False, True, False, False]


@pytest.mark.parametrize(("metres", "hears"), [(7.9, True), (8.1, False)])
def test_a_voice_carries_eight_metres(metres, hears):
    with company([NEAR, Pose2D(0.0, metres, np.pi)], fake_scene()) as two:
        _, heard = two.play([feedbacks("greet", "bow"), feedbacks("bow")])
    assert ("hello" in heard[0]) == hears


def test_a_voice_goes_through_an_open_door_and_round_a_shut_one():
    builder = SceneBuilder.on_floor()
    leaf = builder.door()
    scene = builder.scene()
    mouth, ear = np.array([0, 1.0, -0.4]), np.array([0, 1.0, 2.0])
    shut, wide = ({leaf: scene.by_id[leaf].at(state)} for state in (0.0, -np.radians(95)))
    # The wall ends 2.45 m to each side: there and back is 2 * hypot(2.45, 1.2) m at least.
    assert voice_distance(scene, wide, mouth, ear) == pytest.approx(2.4, abs=0.3)
    assert 5.4 < voice_distance(scene, shut, mouth, ear) < 6.2


def test_two_episodes_are_recorded_side_by_side_and_name_one_another(tmp_path):
    def episode(name, script, body):
        spec = free_episode("greet", body.scene, name=name).model_copy(update={"start": body.start})
        agent = ScriptedAgent([Call(word) for word in script])
        return run_episode(body, spec, agent, folder=tmp_path / name, company="ab")

    with company() as two:
        parts = [("a", ["greet", "bow", "finish"]), ("b", ["bow", "bow", "finish"])]
        outcomes = [record.outcome for record in two.play([partial(episode, *part) for part in parts])]
    assert outcomes == ["stopped", "stopped"]
    a, b = (RecordedEpisode(tmp_path / name) for name in "ab")
    assert a.record.company == b.record.company == ("a", "b")
    assert [heard.text for heard in b.steps[0].heard] == ["hello"]
    assert a.record.start != b.record.start
    assert a.people().keys() == {person_id(1)}
    assert np.array_equal(b.people()[person_id(0)].root[:10], a.motion().root[:10])
    shutil.move(tmp_path / "b", tmp_path / "elsewhere")
    assert a.people() == {}


def test_by_the_real_clock_the_others_go_on_while_one_thinks():
    spec = free_episode("greet", fake_scene(), max_steps=12)

    def episode(script, seconds, body):
        class Mind(ScriptedAgent):
            def decide(self, observation, history):
                decided.append((seconds, time.monotonic()))
                time.sleep(seconds)
                return super().decide(observation, history)

        agent = Mind(map(Call, script))
        begun = Episode(body, spec.model_copy(update={"start": body.start}), agent, clock="real")
        barrier.wait(20)
        with begun:
            while not begun.done:
                begun.ask()
        return begun.steps

    decided, barrier = [], threading.Barrier(2)
    with company() as two:
        parts = [partial(episode, ["bow", "finish"], 1.7), partial(episode, ["bow"] * 9 + ["finish"], 0.01)]
        slow, quick = two.play(parts)
    began, ended = [moment for seconds, moment in decided if seconds == 1.7]
    meanwhile = [moment for seconds, moment in decided if seconds == 0.01 and began <= moment < began + 1.65]
    # It acts in the half seconds from 0.5, 1.0 and 1.5 s on, and has decided on the next one by then.
    assert 3 <= len(meanwhile) <= 5
    assert slow[0].waited == 3
    assert slow[0].motion_frames == 4 * FUTURE
    assert [step.waited for step in quick] == [0] * 10
    assert ended - began < 3


def test_who_ended_stands_while_the_others_go_on_in_their_records(tmp_path):
    def episode(name, script, body):
        spec = free_episode("greet", body.scene, name=name).model_copy(update={"start": body.start})
        return run_episode(body, spec, ScriptedAgent(map(Call, script)), folder=tmp_path / name, company="ab")

    with company() as two:
        two.play([partial(episode, "a", ["bow", "finish"]), partial(episode, "b", ["long_bow", "finish"])])
    a, b = (RecordedEpisode(tmp_path / name) for name in "ab")
    seen = b.people()[person_id(0)]
    assert (len(a.motion()), len(seen)) == (20, 50)
    assert np.array_equal(seen.root[19:], np.repeat(a.motion().root[-1:], 31, 0))


def test_the_others_are_in_the_views_between_two_decisions_too(monkeypatch):
    def look(self, state, camera):
        seen.append(state.people)
        return View(*np.zeros((3, 1, 1)))

    seen, way = [], NEAR.to_world(rest_pose(FUTURE))
    monkeypatch.setattr(FakeRenderer, "render", look)
    with company() as two:
        execution = Execution(way, (), (), {}, people={person_id(1): FAR.to_world(rest_pose(FUTURE))})
        list(two.bodies[0].views_during(Chunk(way, execution), 2))
    assert [list(people) for people in seen] == [[person_id(1)]] * 2


def test_a_company_without_bodies_or_with_a_part_too_few_is_refused():
    with pytest.raises(HumanclawError, match="got no start"):
        company([])
    with company() as two, pytest.raises(HumanclawError, match="2 bodies play together; got 1 parts"):
        two.play([feedbacks("bow")])
