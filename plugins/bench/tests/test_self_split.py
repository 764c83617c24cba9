"""The split of questions about oneself: balanced, true, drawn again from its seed, and scored."""

import re
from collections import Counter, defaultdict
from contextlib import suppress
from dataclasses import replace

import numpy as np
import pytest
import toy_world
from hosting import plugin
from pydantic import ValidationError

import humanclaw_skill_answer
import humanclaw_skill_hands
from humanclaw import Body, Call, Decision, Episode, PluginError, Plugins, RecordedEpisode, SceneError
from humanclaw.records import Goal
from humanclaw.world import pack_scene, unpack_scene
from humanclaw_bench.attribution import attribute
from humanclaw_bench.oneself import KNOWLEDGE
from humanclaw_bench.oneself.generate import questions
from humanclaw_bench.oneself.scene_setups import AHEAD
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


def test_neither_words_nor_the_turn_of_a_mirror_tell_the_answer():
    hands = [spec for spec in SPLIT if spec.goal.asks == "hand"]
    words = Counter(("on the left" in spec.instruction, spec.goal.answer) for spec in hands)
    turns = Counter((numbers(spec)[1][1], spec.goal.answer) for spec in hands)
    assert set(words.values()) == set(turns.values()) == {8, 9}


FEATURES = {
    "house": lambda spec: int(re.search(r"house:(\d+)", spec.scene)[1]) % 2,
    "place in the file": lambda spec: spec.seed % 2,
    "first half": lambda spec: spec.seed < 100,
    "side": lambda spec: "on the left" in spec.instruction,
    "floor": lambda spec: spec.start.floor > 0,
    "yaw": lambda spec: spec.start.yaw > 0,
    "x": lambda spec: round(spec.start.x * 100) % 2,
    "z": lambda spec: round(spec.start.z * 100) % 2,
}


MOST = {"hand": 22, "mirror": 24, "moved": 24, "turned": 11, "touch": 14, "fit": 26}
"""Answers that a feature may tell: a random order tells more at most 4 times in 100."""


@pytest.mark.parametrize(("kind", "most"), MOST.items())
def test_neither_house_nor_place_nor_order_tells_an_answer(kind, most):
    assert [spec.seed for spec in SPLIT] == list(range(200))
    asked = [spec for spec in SPLIT if spec.goal.asks == kind]
    for name, feature in FEATURES.items():
        answers = defaultdict(Counter)
        for spec in asked:
            answers[feature(spec)][spec.goal.answer] += 1
        right = sum(max(counts.values()) for counts in answers.values())
        assert right <= most, name


@pytest.mark.parametrize("lacking", [{}, {"asks": "hand"}, {"answer": "yes"}])
def test_a_goal_without_things_needs_a_kind_and_an_answer(lacking):
    with pytest.raises(ValidationError, match="names things to act on, or the kind of a question and its answer"):
        Goal(**lacking)


# -- truth, by arithmetic of its own -----------------------------------------------------------------------------------
def by_arithmetic(spec):
    """The answer from the numbers of a scene: a grown body is 50 cm wide, reaches less than 70 cm over an edge, sits
    with feet on the floor up to 90 cm (measured below), and touches what is less than 40 cm to its side."""
    setup, values = numbers(spec)
    if setup == "hands":
        return "yours" if ("on the left" in spec.instruction) == (values[1] > 0) else "another's"
    if setup == "posts":
        at, colour = min((abs(at), colour) for at, colour in zip(values, ("red", "blue"), strict=True))
        assert at < 0.4 < max(map(abs, values))
        return f"{colour} on your {'left' if values[colour == 'blue'] > 0 else 'right'}"
    if setup == "post":
        return str(45 * round(values[0] / 45))
    limits = {"gap": values and values[0] > 0.5, "shelf": values and values[-1] < 0.7,
              "stool": values and values[0] < 0.9, "cabinet": values and values[0] > 0, "glass": True}  # fmt: skip
    return "yes" if limits.get(setup) else "no"


def test_the_answers_are_those_of_plain_arithmetic():
    assert [spec.id for spec in SPLIT if by_arithmetic(spec) != spec.goal.answer] == []


# -- scenes ------------------------------------------------------------------------------------------------------------
@pytest.fixture(scope="module")
def plugins():
    host = Plugins.discover()
    for module in (humanclaw_skill_answer, humanclaw_skill_hands):
        with suppress(PluginError):  # Installed already.
            host.add(module, module.__name__)
    return host


@pytest.fixture(scope="module")
def first(plugins):
    """The first question, which is about a hand in house:0, and its body."""
    with Body("house:0", plugins=plugins) as body:
        yield HAND, body


def test_a_reference_alone_makes_the_scene_again(plugins):
    scene = plugins.scene(HAND.scene)
    assert scene.digest == HAND.scene_digest
    assert len(scene.of_category("person")) == 2
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


def in_the_mirror(body, view):
    """Where a view shows the mirror that was put up last, and where its left half."""
    shown = view.ids == body.scene.of_category("mirror")[-1].id
    columns = np.flatnonzero(shown.any(0))
    return shown, shown & (np.arange(shown.shape[1]) < columns.mean())


def test_a_first_view_is_alike_whosever_hands_are_on_the_left(first, plugins):
    spec, body = first
    place, _, own = spec.scene.rpartition(",")
    others = plugins.scene(f"{place},{-int(own)}")
    body.reset(spec.scene, spec.start)
    image, (shown, left) = body.view(), in_the_mirror(body, body.view())
    body.reset(others, spec.start)
    other = body.view()
    assert (image.ids != other.ids).mean() < 0.002
    shirts = [shown & (view.rgb[..., 2] > 1.5 * view.rgb[..., 0]) for view in (image, other)]
    for half in (left, ~left):
        assert (shirts[0] & shirts[1] & half).sum() > 0.95 * ((shirts[0] | shirts[1]) & half).sum() > 1000


@pytest.mark.parametrize("side", ["left", "right"])
def test_what_moves_in_the_mirror_as_a_hand_does_is_ones_own(first, side):
    spec, body = first
    body.reset(spec.scene, spec.start)
    views = []
    for x, y in ((20, 120), (45, 110)):  # The first reach moves the head as well.
        body.call("reach", side=side, x_cm=x if side == "left" else -x, y_cm=y, z_cm=30)
        views.append(body.view())
    shown, left = in_the_mirror(body, views[0])
    moved = np.abs(views[0].rgb.astype(int) - views[1].rgb).max(-1) > 40
    own, another = left, shown & ~left
    if spec.goal.answer == "another's":  # So are the hands on the left.
        own, another = another, own
    assert "on the left" in spec.instruction
    assert (moved & own).sum() > 3 * (moved & another).sum()


def sits(body, spec, away, up):
    """Whether the hips touch a stool and both feet something else, when a body sat twice with its back to it."""
    start, ahead = spec.start, AHEAD - away
    x, z = start.x + ahead * np.sin(start.yaw), start.z + ahead * np.cos(start.yaw)
    body.place(spec.scene, replace(start, x=float(x), z=float(z), yaw=start.yaw + np.pi))
    for _ in range(2):
        body.call("sit_in_place", h_cm=up)
    played = body.last.chunks[-1].execution
    stool = body.scene.of_category("stool")[-1].id
    last = [contact for contact in played.contacts if len(played.simulated) - 1 in contact.frames]
    feet = {c.joint.split("_")[0] for c in last if c.object_id != stool and c.joint.endswith(("_ankle", "_foot"))}
    return len(feet) == 2 and any(c.joint.endswith("pelvis") and c.object_id == stool for c in last)


@pytest.mark.integration
def test_feet_stay_down_on_stools_of_yes_and_on_none_of_no(first):
    """The highest of yes and the lowest of no, with the back to it from near to far."""
    _, body = first
    stools = {
        answer: [s for s in SPLIT if numbers(s)[0] == "stool" and s.goal.answer == answer] for answer in ("yes", "no")
    }
    highest = max(stools["yes"], key=lambda spec: numbers(spec)[1])
    lowest = min(stools["no"], key=lambda spec: numbers(spec)[1])
    assert sits(body, highest, 0.32, 64)
    assert not any(sits(body, lowest, away, up) for away in (0.36, 0.44, 0.52) for up in (74, 80))


# -- scores ------------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(("words", "met"), [("Another's.", True), ("yours", False)])
def test_an_answer_is_a_number_of_the_agents_profile(first, tmp_path, words, met):
    spec, body = first
    assert spec.goal.answer == "another's"
    with Episode(body, spec, folder=tmp_path) as episode:
        episode.submit(Decision((Call("answer", {"text": words}),)))
    recorded = RecordedEpisode(tmp_path)
    scores, cause = score(recorded), attribute(recorded)
    assert (scores.success, cause and cause.label) == (met, None if met else "answer: wrong answer")
    (row,) = result_table("self", named({"run": [(scores, cause)]})).rows
    assert [cell.value for cell in row.cells][:1] == [met]
    assert np.isnan([cell.value for cell in row.cells][1:6]).all()
