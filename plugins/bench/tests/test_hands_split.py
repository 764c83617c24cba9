"""The extension for hands: how tasks are drawn, that the oracle solves them, and what failures are put down to."""

import re
from collections import Counter
from contextlib import suppress
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from click.testing import CliRunner
from rooms import two_storeys

import humanclaw_skill_answer
import humanclaw_skill_crouch
import humanclaw_skill_hands
from humanclaw import Backends, Body, Call, Episode, EpisodeSpec, PluginError, Plugins, RecordedEpisode, StepRecord
from humanclaw.body import Pose2D
from humanclaw.records import Goal, is_met
from humanclaw.world import SceneBuilder, Slide, block
from humanclaw_bench.attribution import attribute
from humanclaw_bench.cli import bench
from humanclaw_bench.hands import FAMILIES, family_of
from humanclaw_bench.hands.generate import EACH, House, asked, episodes, tasks
from humanclaw_bench.hands.scores import says_seen
from humanclaw_bench.scores import score
from humanclaw_bench.splits import HOUSES, load_split

SHUT, WIDE = 0.0, 0.35


@pytest.fixture(scope="module")
def plugins():
    host = Plugins.discover()
    for module in (humanclaw_skill_answer, humanclaw_skill_crouch, humanclaw_skill_hands):
        with suppress(PluginError):  # Installed already.
            host.add(module, module.__name__)
    return host


# -- the splits --------------------------------------------------------------------------------------------------------
def test_small_splits_are_parts_of_the_large_one_in_equal_shares():
    hands, mini, smoke = ({spec.id: spec for spec in load_split(f"{name}hands")} for name in ("", "mini-", "smoke-"))
    assert hands.items() >= mini.items() >= smoke.items()
    for split, each in ((hands, EACH), (mini, 15), (smoke, 1)):
        assert Counter(map(family_of, split.values())) == dict.fromkeys(FAMILIES, each)
    assert {spec.scene for spec in hands.values()} <= set(HOUSES)


@pytest.mark.integration
def test_a_house_gives_the_tasks_again_that_the_split_holds():
    scene = Plugins.discover().scene("house:0")
    drawn = {(spec.instruction, spec.start) for spec in episodes(scene, 0)}
    kept = [spec for spec in load_split("hands") if spec.scene == "house:0"]
    assert kept
    assert {(spec.instruction, spec.start) for spec in kept} <= drawn
    assert {spec.scene_digest for spec in kept} == {scene.digest}


def test_heights_are_those_over_the_floor_that_a_thing_is_on():
    """A bed of 50 cm and a plant of a metre on the floor 2.72 m up, and a plant on the one below."""
    house = House(two_storeys())
    assert [house.height(key) for key in (31, 32, 30)] == [pytest.approx(pair) for pair in ((0, 0.5), (0, 1), (0, 1))]


def test_nothing_is_to_be_put_where_it_stands_already():
    """A cup on each of two tables: only the other one is asked for."""
    builder = SceneBuilder.on_floor()
    tables = [builder.box(name, (1, 0.7, 1), (0, 0, z)) for name, z in (("table", 2.0), ("desk", -2.0))]
    cup = builder.box("cup", (0.1, 0.1, 0.1), (0, 0.7, 1.6), movable=True, mass=0.3)
    drawn = [spec for seed in range(20) for spec in tasks(House(builder.scene()), np.random.default_rng(seed))]
    assert {(spec.goal.things, spec.goal.on) for spec in drawn} == {((cup,), tables[1])}


def test_a_goal_stands_in_the_schema_and_none_is_not_written():
    assert "goal" in EpisodeSpec.model_json_schema(mode="serialization")["properties"]
    (spec, *_) = load_split("smoke-hands")
    assert "goal" in spec.model_dump()
    assert "goal" not in spec.model_copy(update={"goal": None}).model_dump()


def test_an_instruction_names_one_thing_alone():
    builder = SceneBuilder()
    builder.floor()
    cup, book, other = (builder.box(name, (0.1, 0.1, 0.1), (x, 0, 0)) for x, name in enumerate(("cup", "book", "book")))
    house = House(builder.scene())
    names = [house.phrase(house.scene.by_id[key]) for key in (cup, book, other)]
    assert names == ["the cup", "", ""]


@pytest.mark.parametrize("kind", ["--hands", "--two"])
@pytest.mark.parametrize("option", ["--secret", "--train", "--starts"])
def test_an_option_that_has_no_effect_on_a_split_is_refused(tmp_path, kind, option):
    result = CliRunner().invoke(bench, ["generate", kind, option, "3", "--out", str(tmp_path)])
    assert result.exit_code == 2
    assert f"{option} has no effect" in result.output


def test_who_names_a_thing_as_the_instruction_does_has_said_so():
    for spec in load_split("hands"):
        thing = re.search(r"\b(?:open|put|in) (the [^?.]+)", spec.instruction)[1]
        step = SimpleNamespace(decision=SimpleNamespace(visible_state=f"I see {thing}."))
        assert says_seen(step, spec.target_category), spec.instruction


# -- the oracle, and agents that do one thing wrong --------------------------------------------------------------------
def kitchen():
    """A shelf with a cup, a table, and a cupboard with a drawer; with the ids of cup, table, cupboard and drawer."""
    builder = SceneBuilder()
    builder.floor()
    builder.box("shelf", (0.9, 0.8, 0.5), (0, 0, 1.2))
    cup = builder.box("cup", (0.07, 0.1, 0.07), (0, 0.8, 1.05), (200, 40, 40), movable=True, mass=0.3)
    table = builder.box("table", (0.9, 0.75, 0.6), (-1.5, 0, 0))
    body = builder.box("cupboard", (0.6, 0.7, 0.5), (1.2, 0, 1.2), (90, 60, 40))
    drawer = builder.box("cupboard", (0.6, 0.2, 0.04), (1.2, 0.75, 0.93), (150, 110, 70), rotation=(0.0, 1.0, 0.0, 0.0),
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


def corner():
    """A box in the corner of two walls, and a table; with the ids of box and table."""
    builder = SceneBuilder()
    builder.floor()
    for size, x, z in (((3, 2.5, 0.2), 0, 2.1), ((0.2, 2.5, 3), 1.1, 0.5)):
        builder.box("wall", size, (x, 0, z))
    box = builder.box("box", (0.28, 0.26, 0.27), (0.85, 0, 1.86), movable=True, mass=3.0)
    table = builder.box("table", (0.9, 0.6, 0.6), (-1.5, 0, 0))
    return builder.scene(), box, table


def shelf():
    """A cup on the third of four boards of a shelf, over the elbows, and a table; with the ids of cup and table."""
    builder = SceneBuilder()
    builder.floor()
    boards = [block((-0.45, y, -0.18), (0.45, y + 0.03, 0.18)) for y in (0.12, 0.6, 1.08, 1.56)]
    builder.solid("shelf", boards, (0, 0, 1.3))
    cup = builder.box("cup", (0.08, 0.16, 0.08), (0.1, 1.11, 1.3), (200, 40, 40), movable=True, mass=0.3)
    table = builder.box("table", (0.9, 0.6, 0.6), (-1.5, 0, 0))
    return builder.scene(), cup, table


def play(plugins, folder, goal, change=lambda call, role: call, category="cup", targets=(), scene=None):
    scene = scene or kitchen()[0]
    spec = EpisodeSpec(id="one", instruction="do it", scene=scene.name, target_category=category, goal=goal,
                       start=Pose2D(0.0, 0.0, 0.0), target_ids=targets)  # fmt: skip
    folder = folder / "one"
    with Body(scene, spec.start, plugins=plugins, backends=Backends("mujoco")) as body:
        agent = Spoilt(plugins.make("agents", "oracle", {}), change)
        with Episode(body, spec, agent=agent, folder=folder) as episode:
            while not episode.done:
                episode.ask()
            return episode.success, score(RecordedEpisode(folder)), attribute(RecordedEpisode(folder))


def to_stop(*roles):
    return lambda call, role: Call("stop") if role in roles else call


def bring(plugins, folder, change=lambda call, role: call):
    _, cup, table, *_ = kitchen()
    return play(plugins, folder, Goal(things=(cup,), on=table), change, targets=(cup, table))


def look(plugins, folder, change=lambda call, role: call):
    *_, body, drawer = kitchen()
    goal = Goal(things=(drawer,), share=0.5, ways={drawer: (SHUT, WIDE)}, answer="no")
    return play(plugins, folder, goal, change, "cupboard", (drawer, body))


@pytest.mark.integration
@pytest.mark.parametrize("task", [bring, look])
def test_the_oracle_solves_it_and_every_stage_is_passed(plugins, tmp_path, task):
    success, scores, cause = task(plugins, tmp_path)
    assert success
    assert all(scores.hands.values())
    assert (scores.success, cause, scores.dropped) == (True, None, 0)
    table = CliRunner().invoke(bench, ["table", str(tmp_path), "--format", "markdown"], catch_exceptions=False).output
    assert "HoldSR" in table
    assert "Privileged (may read scene, true state, target ids, and depth and ids of its view): agent" in table
    assert "of an unknown total" in table


@pytest.mark.integration
def test_the_oracle_uses_the_hand_that_has_room_in_a_corner(plugins, tmp_path):
    scene, box, table = corner()
    goal = Goal(things=(box,), on=table)
    success, scores, _ = play(plugins, tmp_path, goal, category="box", targets=(box, table), scene=scene)
    assert (success, scores.dropped) == (True, 0)
    carrying = "".join(step.model_dump_json() for step in RecordedEpisode(tmp_path / "one").steps if step.held)
    assert ("way to the table" in carrying, "way to the box" in carrying) == (True, False)


@pytest.mark.integration
def test_the_oracle_takes_a_cup_from_a_shelf_over_its_elbows(plugins, tmp_path):
    """From below or from near by, the board stopped its arm; and the map has a column where the shelf is."""
    scene, cup, table = shelf()
    success, scores, _ = play(plugins, tmp_path, Goal(things=(cup,), on=table), targets=(cup, table), scene=scene)
    assert success
    assert all(scores.hands.values())


@pytest.mark.integration
@pytest.mark.parametrize(
    ("task", "change", "label"),
    [
        (bring, to_stop("gesture"), "reach: never reached out"),
        (bring, to_stop("grasp"), "hold: never closed"),
        (bring, to_stop("release"), "place: never let go"),
        (look, lambda call, role: Call("answer", {"text": "yes"}) if role == "stop" else call, "answer: wrong answer"),
        (look, to_stop("stop"), "answer: no answer"),
        (look, to_stop("gesture"), "reach: never reached out"),
    ],
)
def test_an_agent_that_does_one_thing_wrong_fails_there(plugins, tmp_path, task, change, label):
    success, scores, cause = task(plugins, tmp_path, change)
    assert not success
    assert (scores.success, cause.label) == (False, label)


# -- questions ---------------------------------------------------------------------------------------------------------
def questions(split):
    return [spec for spec in load_split(split) if family_of(spec) == "look"]


@pytest.mark.parametrize(("split", "most"), [("hands", 1), ("mini-hands", 2)])
def test_no_answer_can_be_guessed_from_the_words(split, most):
    counts = Counter((asked(spec), spec.goal.answer) for spec in questions(split))
    for words in {asked(spec) for spec in questions(split)}:
        assert abs(counts[words, "yes"] - counts[words, "no"]) <= most, words


THING = {"a jar": "jar", "a plate": "plate", "a glass": "glass", "a pile of towels": "towels", "a handbag": "handbag",
         "a pair of shoes": "shoes", "a box": "storage_box", "a cup": "cup", "a pan": "pan"}  # fmt: skip
DOUBTFUL = {"toiletries": {"bottle", "cup", "jar"}, "glass": {"cup", "jar"}, "cup": {"glass"}, "jar": {"glass"}}


@pytest.mark.integration
@pytest.mark.parametrize("house", sorted({spec.scene for spec in questions("mini-hands")})[:3])
def test_an_answer_is_right_of_what_lies_within_the_furniture(house):
    scene = Plugins.discover().scene(house)
    for spec in (spec for spec in questions("hands") if spec.scene == house):
        thing = THING[re.match("is there (.*?) in the", spec.instruction)[1]]
        (body,) = set(spec.target_ids) - set(spec.goal.things)
        low, high = scene.vertices(body).min(0), scene.vertices(body).max(0)
        inside = {obj.category for obj in scene.objects if obj.id != body
                  and (scene.vertices(obj.id) > low).all() and (scene.vertices(obj.id) < high).all()}  # fmt: skip
        assert spec.goal.answer == ("yes" if thing in inside else "no")
        assert thing in inside or not any(thing in DOUBTFUL.get(other, ()) for other in inside)


@pytest.mark.parametrize(
    ("open_by", "pixels", "z", "met"),
    [(0.8, 9000, 1.0, True), (0.8, 900, 1.0, False), (0.8, 9000, -1.0, False), (0.2, 9000, 1.0, False)],
    ids=["looked", "turned away", "from behind", "hardly open"],
)
def test_an_answer_counts_after_a_look_inside_alone(open_by, pixels, z, met):
    door, body = 6, 5
    goal = Goal(things=(door,), share=0.5, ways={door: (0.0, 1.0)}, answer="no")
    boxes = {door: ((0.0, 0.0, 0.3), (0.6, 1.0, 0.33)), body: ((0.0, 0.0, -0.3), (0.6, 1.0, 0.3))}
    opens = StepRecord(step=0, status="executed", attempts=(), targets=boxes)
    wide = StepRecord(step=1, status="executed", attempts=(), targets=boxes, joints={door: open_by})
    says = StepRecord(step=2, status="stopped", attempts=(), call=Call("answer", {"text": "No."}), start=(0.3, 1.0, z),
                      target_pixels={door: 20_000, body: pixels})  # fmt: skip
    assert is_met(goal, (opens, wide, says)) is met


@pytest.mark.integration
def test_the_program_makes_the_smoke_split_that_is_shipped():
    """Byte for byte, but for the ids and seeds, which count the episodes of the whole split."""

    def line(spec):
        return spec.model_copy(update={"id": "x", "seed": 0}).model_dump_json()

    kept = load_split("smoke-hands")
    scenes = {spec.scene: Plugins.discover().scene(spec.scene) for spec in kept}
    drawn = {line(spec) for name, scene in scenes.items() for spec in episodes(scene, HOUSES.index(name))}
    assert {line(spec) for spec in kept} <= drawn
