"""The split of questions about oneself: balanced, true, drawn again from its seed, and scored."""

import re
from collections import Counter, defaultdict
from contextlib import suppress

import numpy as np
import pytest
import toy_world
from hosting import plugin
from pydantic import ValidationError

import humanclaw_skill_answer
import humanclaw_skill_hands
from humanclaw import Body, Call, Decision, Episode, PluginError, Plugins, RecordedEpisode, SceneError
from humanclaw.records import Goal
from humanclaw.world import BODY_ID, pack_scene, unpack_scene
from humanclaw_bench.attribution import attribute
from humanclaw_bench.oneself import KNOWLEDGE
from humanclaw_bench.oneself.generate import questions
from humanclaw_bench.results import named
from humanclaw_bench.scores import score
from humanclaw_bench.splits import HOUSES, load_split
from humanclaw_bench.tables import result_table

SPLIT = load_split("self")
HAND = next(spec for spec in SPLIT if spec.id.startswith("house-0-hand-"))


def options(spec):
    return re.fullmatch(r".+ Answer with one of: (.+)\.", spec.instruction)[1].split("; ")


def numbers(spec):
    """The setup of a question, and the numbers after those of its place."""
    setup, *values = spec.scene.partition("?")[2].split(",")
    return setup, list(map(float, values[4:]))


# -- the split ---------------------------------------------------------------------------------------------------------
def test_every_answer_of_a_kind_is_right_equally_often():
    kinds = defaultdict(Counter)
    for spec in SPLIT:
        kinds[spec.goal.asks][spec.goal.answer] += 1
        assert spec.goal.answer in options(spec)
    assert kinds.keys() == KNOWLEDGE.keys()
    assert all(len(set(counts.values())) == 1 for counts in kinds.values())
    assert sum(map(Counter.total, kinds.values())) == 200


def test_questions_are_asked_in_the_houses_of_val():
    houses = Counter(spec.scene.removeprefix("self:").partition("?")[0] for spec in SPLIT)
    assert set(houses) <= set(HOUSES)
    assert len(houses) > 35
    assert {spec.max_steps for spec in SPLIT} == {10}


def test_neither_words_nor_scene_alone_tell_whose_hand_is_meant():
    hands = [spec for spec in SPLIT if spec.goal.asks == "hand"]
    words = Counter(("side left" in spec.instruction, spec.goal.answer) for spec in hands)
    cubes = Counter((numbers(spec)[1][0] == numbers(spec)[1][6], spec.goal.answer) for spec in hands)
    assert set(words.values()) == set(cubes.values()) == {8, 9}


def test_the_order_of_the_questions_does_not_tell_their_answers():
    assert [spec.seed for spec in SPLIT] == list(range(200))
    even = Counter(spec.goal.answer for spec in SPLIT[::2] if spec.goal.asks != "turned")
    assert abs(even["yes"] - even["no"]) < 12


@pytest.mark.parametrize("lacking", [{}, {"asks": "hand"}, {"answer": "yes"}])
def test_a_goal_without_things_needs_a_kind_and_an_answer(lacking):
    with pytest.raises(ValidationError, match="names things to act on, or the kind of a question and its answer"):
        Goal(**lacking)


# -- truth, by arithmetic of its own -----------------------------------------------------------------------------------
def by_arithmetic(spec):
    """The answer from the numbers of a scene: a grown body is 50 cm wide, reaches less than 70 cm over an edge, sits
    with feet on the floor up to 50 cm, and touches what is less than 40 cm to its side."""
    setup, values = numbers(spec)
    if setup == "hands":
        *others, cube = np.reshape(values, (3, 3))
        own = [int(re.search(rf"{axis}_cm (-?\d+)", spec.instruction)[1]) / 100 for axis in "xyz"]
        nearest = np.argmin(np.linalg.norm([own, *others] - cube, axis=1))
        return "another's" if nearest else "yours"
    if setup == "posts":
        at, colour = min((abs(at), colour) for at, colour in zip(values, ("red", "blue"), strict=True))
        assert at < 0.4 < max(map(abs, values))
        return f"{colour} on your {'left' if values[colour == 'blue'] > 0 else 'right'}"
    if setup == "post":
        return str(45 * round(values[0] / 45))
    limits = {"gap": values and values[0] > 0.5, "shelf": values and values[-1] < 0.7,
              "stool": values and values[0] < 0.5, "cabinet": values and values[0] > 0, "glass": True}  # fmt: skip
    return "yes" if limits.get(setup) else "no"


def test_the_answers_are_those_of_plain_arithmetic():
    assert [spec.id for spec in SPLIT if by_arithmetic(spec) != spec.goal.answer] == []


# -- scenes ------------------------------------------------------------------------------------------------------------
@pytest.fixture(scope="module")
def plugins():
    found = Plugins.discover()
    for module in (humanclaw_skill_answer, humanclaw_skill_hands):
        with suppress(PluginError):  # Installed already.
            found.add(module, module.__name__)
    return found


@pytest.fixture(scope="module")
def first(plugins):
    """The first question, which is about a hand in house:0, and its body."""
    with Body("house:0", plugins=plugins) as body:
        yield HAND, body


def test_a_reference_alone_makes_the_scene_again(plugins):
    scene = plugins.scene(HAND.scene)
    assert scene.digest == HAND.scene_digest
    assert [len(scene.of_category(category)) for category in ("person", "cube")] == [2, 1]
    assert unpack_scene(pack_scene(scene)).digest == scene.digest


@pytest.mark.parametrize("rest", ["", "moat,0,0,0,0", "post,0,0,0", "post,0,0,0,0", "post,0,0,0,0,x"])
def test_a_reference_to_no_setup_is_refused(plugins, rest):
    with pytest.raises(SceneError, match=r"expected self:HOUSE\?SETUP,X,Z,FLOOR,YAW"):
        plugins.scene(f"self:house:0?{rest}")


def test_a_setup_stands_in_a_house_of_any_plugin_of_the_host():
    host = Plugins.discover()
    host.add(plugin(scenes=[("toy", toy_world.scene)]), "toy")
    assert len(host.scene("self:toy:0?post,0,0,0,0,90").of_category("post")) == 1


@pytest.mark.integration
def test_the_split_is_drawn_again_from_its_seed(plugins):
    assert next(questions(plugins)) == HAND


def test_hands_are_out_of_view_at_first_and_then_all_in_view(first):
    spec, body = first
    body.reset(spec.scene, spec.start)
    things = [obj.id for category in ("person", "cube") for obj in body.scene.of_category(category)]
    assert not np.isin(body.view().ids, [BODY_ID, *things]).any()
    for _ in range(3):
        body.call("turn_in_place", yaw_deg=int(re.search(r"yaw_deg (\S+)", spec.instruction)[1]))
    side, *at = re.search(r"side (\w+), x_cm (\S+), y_cm (\S+), z_cm (\S+),", spec.instruction).groups()
    body.call("reach", side=side, **dict(zip(("x_cm", "y_cm", "z_cm"), map(int, at), strict=True)))
    ids = body.view().ids
    assert min((ids == one).sum() for one in (BODY_ID, *things)) > 200


# -- scores ------------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(("words", "met"), [("Yours.", True), ("another's", False)])
def test_an_answer_is_a_number_of_the_agents_profile(first, tmp_path, words, met):
    spec, body = first
    assert spec.goal.answer == "yours"
    with Episode(body, spec, folder=tmp_path) as episode:
        episode.submit(Decision((Call("answer", {"text": words}),)))
    recorded = RecordedEpisode(tmp_path)
    scores, cause = score(recorded), attribute(recorded)
    assert (scores.success, cause and cause.label) == (met, None if met else "answer: wrong answer")
    (row,) = result_table("self", named({"run": [(scores, cause)]})).rows
    assert [cell.value for cell in row.cells][:1] == [met]
    assert np.isnan([cell.value for cell in row.cells][1:6]).all()
