"""The extension for hands: how tasks are drawn, that the oracle solves them, and what failures are put down to."""

import re
from collections import Counter
from dataclasses import replace
from types import SimpleNamespace

import pytest
from click.testing import CliRunner

import humanclaw_skill_answer
import humanclaw_skill_hands
from humanclaw import Backends, Body, Call, Episode, EpisodeSpec, Plugins, RecordedEpisode
from humanclaw.body import Pose2D
from humanclaw.records import Goal
from humanclaw.testing import SceneBuilder
from humanclaw.world import Slide
from humanclaw_bench.cli import bench
from humanclaw_bench.hands.drawing import EACH, FAMILIES, House, episodes, family_of
from humanclaw_bench.hands.scores import hand_scores, says_seen
from humanclaw_bench.splits import HOUSES, load_split

SHUT, WIDE = 0.0, 0.35


@pytest.fixture(scope="module")
def plugins():
    found = Plugins.discover()
    for module in (humanclaw_skill_answer, humanclaw_skill_hands):
        found.add(module, module.__name__)
    return found


# -- the splits --------------------------------------------------------------------------------------------------------
def test_the_small_splits_are_part_of_the_large_one_and_hold_each_family_as_often():
    hands, mini, smoke = ({spec.id: spec for spec in load_split(f"{name}hands")} for name in ("", "mini-", "smoke-"))
    assert hands.items() >= mini.items() >= smoke.items()
    for split, each in ((hands, EACH), (mini, 15), (smoke, 1)):
        assert Counter(map(family_of, split.values())) == dict.fromkeys(FAMILIES, each)
    assert {spec.scene for spec in hands.values()} <= set(HOUSES)


def test_a_house_gives_the_same_tasks_again_and_the_split_holds_them():
    scene = Plugins.discover().scene("house:0")
    drawn = {(spec.instruction, spec.start) for spec in episodes(scene, 0)}
    kept = [spec for spec in load_split("hands") if spec.scene == "house:0"]
    assert kept
    assert {(spec.instruction, spec.start) for spec in kept} <= drawn
    assert {spec.scene_digest for spec in kept} == {scene.digest}


def test_an_instruction_names_one_thing_alone():
    builder = SceneBuilder()
    builder.floor()
    cup, one, other = (builder.box(name, (0.1, 0.1, 0.1), (x, 0, 0)) for x, name in enumerate(("cup", "book", "book")))
    house = House(builder.scene())
    names = [house.phrase(house.scene.by_id[key]) for key in (cup, one, other)]
    assert names == ["the cup", "", ""]


@pytest.mark.parametrize("option", ["--secret", "--train", "--starts"])
def test_an_option_that_has_no_effect_on_splits_for_hands_is_refused(tmp_path, option):
    told = CliRunner().invoke(bench, ["make", "--hands", option, "3", "--out", str(tmp_path)])
    assert told.exit_code == 2
    assert f"{option} has no effect" in told.output


def test_who_names_a_thing_as_the_instruction_does_has_said_so():
    for spec in load_split("hands"):
        thing = re.search(r"\b(?:open|put|in) (the [^?.]+)", spec.instruction)[1]
        step = SimpleNamespace(decision=SimpleNamespace(visible_state=f"I see {thing}."))
        assert says_seen(step, spec.target_category), spec.instruction


def test_an_episode_that_a_plugin_broke_has_failed_without_a_root_cause():
    (spec,) = (spec for spec in load_split("smoke-hands") if family_of(spec) == "open")
    labels = []
    for outcome in ("max_steps", "plugin_error"):
        record = SimpleNamespace(spec=spec, outcome=outcome, targets={})
        scores = hand_scores(SimpleNamespace(record=record, steps=(), has_motion=False))
        labels.append(scores.cause.label if scores.cause else "")
        assert not scores.success
    assert labels == ["find: ineffective exploration", ""]


# -- the oracle, and agents that do one thing wrong --------------------------------------------------------------------
def kitchen():
    """A shelf with a cup, a table, and a cupboard with a drawer; with the ids of cup, table, cupboard and drawer."""
    builder = SceneBuilder()
    builder.floor()
    builder.box("shelf", (0.9, 0.8, 0.5), (0, 0, 1.2))
    cup = builder.box("cup", (0.07, 0.1, 0.07), (0, 0.8, 1.05), (200, 40, 40), movable=True, mass=0.3)
    table = builder.box("table", (0.9, 0.75, 0.6), (-1.5, 0, 0))
    body = builder.box("cupboard", (0.6, 0.7, 0.5), (1.2, 0, 1.2), (90, 60, 40))
    drawer = builder.box("cupboard", (0.6, 0.2, 0.5), (1.2, 0.75, 1.2), (150, 110, 70), rotation=(0.0, 1.0, 0.0, 0.0),
                         movable=True, mass=4.0, joint=Slide(SHUT, WIDE))  # fmt: skip
    return builder.scene(), cup, table, body, drawer


class Spoilt:
    """The oracle, with its calls changed."""

    name, privileged, settings = "spoilt", True, {}

    def __init__(self, oracle, change):
        self._oracle, self._change = oracle, change

    def begin(self, context):
        self._roles = {name: skill.role for name, skill in context.skills.items()}
        self._oracle.begin(context)

    def decide(self, observation, history):
        decision = self._oracle.decide(observation, history)
        return replace(decision, calls=tuple(self._change(call, self._roles[call.skill]) for call in decision.calls))


def play(plugins, folder, goal, change=lambda call, role: call, category="cup", targets=()):
    scene = kitchen()[0]
    spec = EpisodeSpec(id="one", instruction="do it", scene=scene.name, target_category=category, goal=goal,
                       start=Pose2D(0.0, 0.0, 0.0), target_ids=targets)  # fmt: skip
    with Body(scene, spec.start, plugins=plugins, backends=Backends("mujoco")) as body:
        agent = Spoilt(plugins.make("agents", "oracle", {}), change)
        with Episode(body, spec, agent=agent, folder=folder) as episode:
            while not episode.done:
                episode.ask()
            return episode.success, hand_scores(RecordedEpisode(folder))


def to_stop(*roles):
    return lambda call, role: Call("stop") if role in roles else call


def bring(plugins, folder, change=lambda call, role: call):
    _, cup, table, *_ = kitchen()
    return play(plugins, folder, Goal(things=(cup,), on=table), change, targets=(cup, table))


def look(plugins, folder, change=lambda call, role: call):
    *_, body, drawer = kitchen()
    goal = Goal(things=(drawer,), share=0.5, ways={drawer: (SHUT, WIDE)}, answer="no")
    return play(plugins, folder, goal, change, "cupboard", (drawer, body))


@pytest.mark.parametrize("task", [bring, look])
def test_the_oracle_solves_it_and_every_stage_is_passed(plugins, tmp_path, task):
    success, scores = task(plugins, tmp_path)
    assert success
    assert all(scores.passed.values())
    assert (scores.success, scores.cause, scores.dropped) == (True, None, 0)


@pytest.mark.parametrize(
    ("task", "change", "label"),
    [
        (bring, to_stop("gesture"), "reach: never reached out"),
        (bring, to_stop("grasp"), "hold: never closed"),
        (bring, to_stop("release"), "place: never let go"),
        (look, lambda call, role: Call("answer", {"text": "yes"}) if role == "stop" else call, "answer: wrong answer"),
        (look, to_stop("stop"), "answer: no answer"),
    ],
)
def test_an_agent_that_does_one_thing_wrong_fails_there(plugins, tmp_path, task, change, label):
    success, scores = task(plugins, tmp_path, change)
    assert not success
    assert scores.cause.label == label
