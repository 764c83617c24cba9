"""The split with a partner: how it is drawn, what counts as met and followed, and how it is played and recorded."""

import shutil
from collections import Counter
from functools import partial
from importlib.metadata import entry_points
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import MagicMock

import numpy as np
import pytest
from click.testing import CliRunner
from pydantic import ValidationError

import humanclaw_skill_crouch
import humanclaw_skill_hands
import humanclaw_skill_say
from humanclaw import Call, Company, EpisodeSpec, Plugins, RecordedEpisode, StepRecord, load_run
from humanclaw.body import FPS, HISTORY, Motion, Pose2D, rest_pose
from humanclaw.records import Goal, Partner, close_record, write_episodes
from humanclaw.storage import Folder
from humanclaw.world import Contact, Heard, MultiFloorMap, SceneBuilder
from humanclaw_bench.cli import bench
from humanclaw_bench.failure_modes import first_cause
from humanclaw_bench.overview import overview
from humanclaw_bench.replay import replay
from humanclaw_bench.splits import HOUSES, load_split
from humanclaw_bench.two.generate import EACH, episodes
from humanclaw_bench.two.partners import Ending, accompany
from humanclaw_bench.two.scores import CAUSES, Together, first_failed

MEET = Partner(task="meet", start=Pose2D(0.0, 0.0))
GIVE = Partner(task="give", start=Pose2D(0.0, 0.0))
FOLLOW = Partner(task="follow", start=Pose2D(0.0, 1.0), way=((0.0, 4.0),))


# -- the split ---------------------------------------------------------------------------------------------------------
def test_a_third_of_the_split_is_to_meet_to_follow_and_to_give():
    split = load_split("two")
    assert Counter(spec.partner.task for spec in split) == EACH
    assert {spec.scene for spec in split} <= set(HOUSES)
    assert len({spec.id for spec in split}) == 100


@pytest.mark.integration
def test_a_house_gives_the_episodes_again_that_the_split_holds():
    scene = Plugins.discover().scene("house:0")
    drawn = {(spec.start, spec.partner) for spec in episodes(scene, 0)}
    kept = [spec for spec in load_split("two") if spec.scene == "house:0"]
    assert kept
    assert {(spec.start, spec.partner) for spec in kept} <= drawn
    floors = MultiFloorMap.of(scene)
    for spec in kept:
        for place in (spec.start, spec.partner.start):
            assert np.isfinite(floors.distances(np.array([[place.x, place.floor, place.z]]))).any()


@pytest.mark.parametrize(("task", "way"), [("meet", ((0.0, 1.0),)), ("give", ((0.0, 1.0),)), ("follow", ())])
def test_only_who_is_followed_walks(task, way):
    with pytest.raises(ValidationError, match="walks a way to be followed"):
        Partner(task=task, start=Pose2D(0.0, 0.0), way=way)


def test_a_partner_is_written_only_where_there_is_one():
    (spec, *_) = load_split("two")
    assert "partner" in spec.model_dump()
    assert "partner" not in spec.model_copy(update={"partner": None}).model_dump()
    assert spec.for_agent.partner is None


# -- what counts -------------------------------------------------------------------------------------------------------
def walked(*places):
    """Standing at the first of some places, and one frame at each: (x, z) or (x, z, yaw)."""
    poses = [Pose2D(*place).to_world(rest_pose()) for place in (*[places[0]] * HISTORY, *places)]
    return Motion(*(np.concatenate([getattr(pose, part) for pose in poses]) for part in ("root", "rotations")))


class Told(SimpleNamespace):
    __hash__ = object.__hash__


def together(partner, own, other, outcome="stopped", seen=(9000,), contacts=(), **task):
    """An episode of a step for each number of seen pixels; all of its motion is in the first."""
    spec = EpisodeSpec(id="one", instruction="do it", scene="s", partner=partner, **task)
    steps = [StepRecord(step=k, status="executed", attempts=(), target_pixels={-3: pixels}, contacts=contacts)
             for k, pixels in enumerate(seen)]  # fmt: skip
    record = Told(spec=spec, outcome=outcome, skills={})
    recorded = Told(record=record, steps=steps, spans=((HISTORY, HISTORY + len(own)),), has_motion=True,
                    motion=lambda kind="simulated": walked(*own))  # fmt: skip
    return Together(recorded, walked(*other))


def verdict(facts):
    if all(facts.stages.values()):
        return "success"
    stage = first_failed(facts.stages)
    return first_cause(CAUSES, stage, facts).label


@pytest.mark.parametrize(
    ("ends", "outcome", "seen", "label"),
    [
        ((0.0, -0.99, 0.0), "stopped", (0, 9000), "success"),
        ((0.0, -1.01, 0.0), "stopped", (0, 9000), "meet: stopped while far"),
        ((0.0, -0.99, 0.77), "stopped", (0, 9000), "success"),  # 44.1 degrees.
        ((0.0, -0.99, 0.80), "stopped", (0, 9000), "meet: stopped turned away"),  # 45.8 degrees.
        ((0.0, -0.99, 0.0), "stopped", (9000, 0), "meet: stopped turned away"),  # Through a wall.
        ((0.0, -0.99, 0.0), "out_of_steps", (9000,), "meet: never stopped"),
        ((0.0, -1.50, 0.0), "out_of_steps", (9000,), "meet: never came near"),
        ((0.0, -1.50, 0.0), "stopped", (0,), "find: near but not in view"),
        ((0.0, -2.10, 0.0), "stopped", (0,), "find: ineffective exploration"),
    ],
)
def test_two_have_met_within_a_metre_and_45_degrees(ends, outcome, seen, label):
    assert verdict(together(MEET, [(0.0, -3.0, 0.0), ends], [(0.0, 0.0)], outcome, seen)) == label


TOUCH = Contact((0,), "left_hand", "arm_hand", -3, False, 0.01, 1.0)
WAY = [(0.0, 1.0), (0.0, 2.0), (0.0, 3.0), (0.0, 3.75)]


@pytest.mark.parametrize(
    ("own", "outcome", "contacts", "label"),
    [
        ([(0.0, 0.0), (0.0, 0.0), (0.0, 1.0), (0.0, 2.0)], "stopped", (), "success"),
        ([(0.0, 0.0), (0.0, 0.0), (0.0, 1.0), (0.0, 2.0)], "stopped", (TOUCH,), "keep: touched the other"),
        ([(0.0, 0.0), (0.0, 0.0), (0.0, 0.9), (0.0, 2.0)], "stopped", (), "keep: fell behind"),  # 2.1 m.
        ([(0.0, 0.0), (0.0, 0.0), (0.0, 0.0), (0.0, 0.0)], "stopped", (), "keep: stayed behind"),
        ([(0.0, 0.0)], "stopped", (), "end: stopped too early"),
        ([(0.0, 0.0), (0.0, 0.0), (0.0, 1.0), (0.0, 2.0)], "out_of_steps", (), "end: never stopped"),
        ([(0.0, 0.0), (0.0, 0.0), (0.0, 1.0)], "out_of_steps", (), "end: out of steps"),
    ],
)
def test_who_follows_stays_within_two_metres_to_the_end(own, outcome, contacts, label):
    assert verdict(together(FOLLOW, own, WAY, outcome, contacts=contacts)) == label


def passing(at, **fields):
    """A step that ends at a place (x, z), beside a thing of 10 cm at the origin."""
    fields = {"status": "executed", "target_pixels": {7: 900}, "end": (at[0], 0.9, at[1]), "heard": (WISH,)} | fields
    return StepRecord(step=0, attempts=(), targets={7: ((-0.05, 0.8, -0.05), (0.05, 0.9, 0.05))}, **fields)


WISH, HELD, OPEN = Heard("Please bring me the cup.", (0.0, 0.0, 1.0)), {"held": {"left": 7}}, Call("release")


@pytest.mark.parametrize(
    ("steps", "outcome", "taken", "label"),
    [
        ([passing((0, 0.5), **HELD), passing((0, 2), call=OPEN)], "stopped", {7}, "success"),
        ([passing((0, 0.5), **HELD), passing((0, 2), call=OPEN)], "out_of_steps", {7}, "give: never stopped"),
        ([passing((0, 0.5), **HELD), passing((0, 2))], "stopped", (), "give: dropped"),
        ([passing((0, 0.5), **HELD), passing((0, 2), call=OPEN)], "stopped", (), "give: let go untaken"),
        ([passing((0, 0.5), **HELD), passing((0, 2), **HELD)], "stopped", {7}, "give: not held out"),
        ([passing((0, 0.5))], "stopped", (), "reach: never reached out"),
        ([passing((0, 2))], "stopped", (), "nav: stop while far"),
        ([passing((0, 2), target_pixels={7: 0})], "stopped", (), "nav: never saw the thing"),
        ([passing((0, 2), heard=())], "stopped", (), "nav: never heard the wish"),
    ],
)
def test_a_thing_is_given_once_the_other_alone_holds_it(steps, outcome, taken, label):
    facts = together(GIVE, [(0.0, -1.0)], [(0.0, 0.0)], outcome, goal=Goal(things=(7,)), target_ids=(7,))
    facts.recorded.steps, facts.recorded.record.skills = steps, {"release": SimpleNamespace(role="release")}
    assert verdict(Together(facts.recorded, facts.other, frozenset(taken))) == label


def test_the_mean_distance_is_that_of_all_frames():
    """Seven frames a metre apart, and one at three metres, while the other stands where its record ends."""
    facts = together(MEET, [(0.0, -1.0), (0.0, -1.0), (0.0, -3.0)], [(0.0, 0.0)])
    assert facts.mean_distance == pytest.approx((7 * 1.0 + 3.0) / 8)


def test_only_words_that_are_spoken_count():
    facts = together(MEET, [(0.0, -1.0)], [(0.0, 0.0)])
    calls = [(Call("say", {"text": "where are you"}), 0, "executed"), (Call("grasp", {"side": "left"}), 15, "executed"),
             (Call("answer", {"text": "yes"}), 0, "stopped")]  # fmt: skip
    facts.recorded.steps = [StepRecord(step=k, status=status, attempts=(), call=call, motion_frames=frames)
                            for k, (call, frames, status) in enumerate(calls)]  # fmt: skip
    assert facts.words == 3


def test_an_episode_that_broke_off_without_motion_is_scored():
    facts = together(MEET, [(0.0, -1.0)], [(0.0, 0.0)], "running")
    facts.recorded.has_motion = False
    facts = Together.of(facts.recorded)
    assert (verdict(facts), np.isnan(facts.mean_distance)) == ("meet: never came near", True)


# -- played ------------------------------------------------------------------------------------------------------------
INSTALLED = {entry.value for entry in entry_points(group="humanclaw")}
EXTRA = (humanclaw_skill_crouch, humanclaw_skill_hands, humanclaw_skill_say)
HANDS = [Path(module.__file__) for module in EXTRA if module.__name__ not in INSTALLED]


@pytest.mark.integration
def test_who_asks_for_a_thing_says_where_it_is_when_spoken_to(tmp_path):
    builder = SceneBuilder.on_floor()
    builder.box("shelf", (0.5, 0.8, 0.5), (0, 0, 3))
    cup = builder.box("cup", (0.07, 0.1, 0.07), (0, 0.8, 2.9), movable=True, mass=0.3)
    scene, partner = builder.scene(), GIVE.model_copy(update={"start": Pose2D(3.0, 0.0)})
    spec = EpisodeSpec(id="one", instruction="do it", scene=scene.name, target_ids=(cup,), partner=partner)
    ending, heard = Ending(), []

    def asks(body):
        with ending:
            for call in ({}, {"text": "Where?"}, {}, {}):
                body.call("say" if call else "turn_in_place", **(call or {"yaw_deg": 0}))
                heard.extend(speech.text for speech in body.last.feedback.heard)

    with Company(scene, [Pose2D(0.0, 0.0), partner.start], plugins=Plugins.discover(HANDS)) as company:
        company.play([asks, partial(accompany, spec, Folder(tmp_path), ending)])
    wish, answer = "Please bring me the cup.", "I want the cup. It was in this house, 80 cm above the floor."
    assert heard == [wish, answer]


def solved(folder, task, files=()):
    """The run of an episode that the oracle played."""
    spec = next(spec for spec in load_split("two") if spec.partner.task == task)
    write_episodes(folder / "one.jsonl", [spec])
    run = folder / "run"
    asked = ["--split", str(folder / "one.jsonl"), "--out", str(run), *(f"--plugin={file}" for file in files)]
    result = CliRunner().invoke(bench, ["run", "--agent", "oracle", *asked], catch_exceptions=False)
    assert result.exit_code == 0, result.output
    return run


@pytest.mark.integration
@pytest.mark.parametrize("task", ["meet", "follow", "give"])
def test_the_oracle_solves_a_task_and_its_record_holds_the_partner(tmp_path, task):
    files = HANDS if task == "give" else []
    run = solved(tmp_path, task, files)
    (episode,) = load_run(run)  # The partner's record is not an episode of the run.
    partner = RecordedEpisode(episode.folder / "partner")
    assert verdict(Together.of(episode)) == "success"
    assert (partner.record.outcome, partner.record.company) == ("stopped", episode.record.company)
    assert [other.record.spec.id for other in partner.company().values()] == [episode.record.spec.id]
    assert len(partner.motion()) == len(episode.motion()) + FPS // 2
    assert replay(episode, files).same()
    shown = CliRunner().invoke(bench, ["table", str(run), "--format", "markdown"], catch_exceptions=False).output
    assert "MeetSR" in shown
    assert CliRunner().invoke(bench, ["verify", str(run)]).exit_code == 0
    page = MagicMock()
    overview({run: [episode]}, page, Plugins.discover(files))
    (head, (row,)), *_ = [call.args[1:] for call in page.table.call_args_list if call.args[0] == "Tasks with a partner"]
    cells = dict(zip(head, row, strict=True))
    (touched,) = [cell for name, cell in cells.items() if name.startswith("touched")]
    (solved_cell,) = [cell for name, cell in cells.items() if name.startswith("solved")]
    assert "100.0%" in solved_cell
    assert any(map(str.isdigit, touched)) == (task != "give")


@pytest.mark.integration
def test_a_partners_record_that_was_changed_is_named(tmp_path):
    run = solved(tmp_path, "meet")
    (episode,) = load_run(run)
    partner = RecordedEpisode(episode.folder / "partner")
    first, *rest = partner.steps
    lines = [step.model_dump_json() for step in (first.model_copy(update={"yaw_end": first.yaw_end + 0.1}), *rest)]
    (partner.folder / "steps.jsonl").write_text("\n".join(lines) + "\n", "utf-8")
    assert str(partner.folder) in verified(run)  # Its digest is another.
    close_record(partner.folder, partner.record)
    assert "partner: step 0: its yaw_end differs." in verified(run, "--replay")
    (partner.folder / "motion.npz").unlink()
    assert str(partner.folder) in verified(run)
    shutil.rmtree(partner.folder)
    assert str(partner.folder) in verified(run)


def verified(run, *options):
    """What verify says of a run that is not whole."""
    result = CliRunner().invoke(bench, ["verify", str(run), *options], catch_exceptions=False)
    assert result.exit_code == 1, result.output
    return result.output
