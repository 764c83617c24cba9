"""Tests of scripted agents on a body that executes calls within ten per cent."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rooms import STEPS, UPSTAIRS, asset, block, scene_object, two_rooms, two_storeys
from walker import PICTURE, SKILLS, Walker, play

import humanclaw_skill_answer
from humanclaw import (
    Agent,
    Call,
    Decision,
    EpisodeContext,
    EpisodeSpec,
    HistoryEntry,
    HumanclawError,
    Observation,
    PluginError,
    Plugins,
    Scene,
)
from humanclaw.records import Feedback, Goal
from humanclaw.world import GAZES, OccupancyGrid, distance_to_box
from humanclaw_scripted.baselines import GuessingAgent, RandomAgent, StillAgent
from humanclaw_scripted.ground_truth import in_view
from humanclaw_scripted.opening import HandyOracle
from humanclaw_scripted.oracle import OracleAgent


def episode(scene: Scene, category: str, *targets: int, sit: bool = False) -> EpisodeSpec:
    return EpisodeSpec(
        id="test", instruction=f"Find a {category}.", scene=scene.name, target_category=category, target_ids=targets,
        interact=sit,
    )  # fmt: skip


def begun(walker: Walker, category: str, target: int) -> OracleAgent:
    agent = OracleAgent()
    agent.begin(EpisodeContext(episode(walker.scene, category, target), SKILLS, 0, walker.scene, walker.state))
    return agent


def reach(walker: Walker, target: int) -> float:
    return float(distance_to_box(walker.state().body.joints()[-1], *walker.scene.aabb(target)).min())


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize(("category", "target"), [("couch", 20), ("bed", 22)])
def test_the_oracle_sits_down_on_the_target_and_stops(category: str, target: int, seed: int) -> None:
    walker = Walker(two_rooms(), (target,), seed)
    log = play(OracleAgent(), walker, episode(walker.scene, category, target, sit=True))
    low, high = walker.scene.aabb(target)
    assert log[-1][1].skill == "stop"
    assert walker.sat
    assert low[0] < walker.x < high[0]
    assert low[2] < walker.z < high[2]
    assert len(log) < 40


@pytest.mark.parametrize(("beside", "stops"), [(-0.05, True), (0.05, True), (0.08, False)])
def test_the_oracle_takes_hips_on_the_side_of_a_seat_for_seated(beside: float, stops: bool) -> None:
    """The axis of the pelvis is 13 cm long, so half of that may be beside the seat."""
    walker = Walker(two_rooms(), (20,))
    agent = OracleAgent()
    agent.begin(EpisodeContext(episode(walker.scene, "couch", 20, sit=True), SKILLS, 0, walker.scene, walker.state))
    low, high = walker.scene.aabb(20)
    walker.x, walker.z, walker.yaw = float(low[0] + high[0]) / 2, float(high[2]) + beside, np.pi / 2
    walker.height = 0.54
    call = Call("sit_in_place", {"h_cm": 50})
    sat = HistoryEntry(0, Decision((call,)), Feedback(call), PICTURE)
    decision = agent.decide(Observation(1, "Find a couch.", PICTURE), (sat,))
    assert (decision.calls[0].skill == "stop") is stops


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize(("category", "target"), [("tv", 21), ("couch", 20)])
def test_the_oracle_stops_within_twenty_centimetres(category: str, target: int, seed: int) -> None:
    walker = Walker(two_rooms(), (target,), seed)
    log = play(OracleAgent(), walker, episode(walker.scene, category, target))
    assert log[-1][1].skill == "stop"
    assert reach(walker, target) <= 0.2


def test_the_oracle_stops_in_passing() -> None:
    """Beside the corner of the couch, in full stride along its short side."""
    walker = Walker(two_rooms(), (20,))
    agent = begun(walker, "couch", 20)
    for walker.x, walker.z in ((6.8, 2.9), (6.8, 3.5)):
        decision = agent.decide(Observation(0, "Find a couch.", PICTURE), ())
    assert reach(walker, 20) < 0.14
    assert decision.calls[0].skill == "stop"


@pytest.mark.parametrize(("gap", "stops"), [(0.185, True), (0.195, False)])
def test_the_oracle_stops_as_soon_as_it_is_within_reach(gap: float, stops: bool) -> None:
    walker = Walker(two_rooms(), (20,))
    walker.x, walker.z = 6.5, 2.5
    walker.x += reach(walker, 20) - gap
    assert reach(walker, 20) == pytest.approx(gap, abs=1e-6)
    decision = begun(walker, "couch", 20).decide(Observation(0, "Find a couch.", PICTURE), ())
    assert (decision.calls[0].skill == "stop") == stops


@pytest.mark.parametrize("seed", range(4))
def test_the_oracle_turns_its_side_to_a_tv_that_stops_its_toes(seed: int) -> None:
    board, screen = asset("board", "tv_stand", block(1.4, 0.45, 0.5)), asset("screen", "tv", block(1.0, 0.6, 0.06))
    scene = two_rooms(
        0.9, (board, scene_object(30, board, 2.0, 0.25)), (screen, scene_object(31, screen, 2.0, 0.25, y=0.45))
    )
    walker = Walker(scene, (31,), seed)
    log = play(OracleAgent(), walker, episode(scene, "tv", 31))
    assert log[-1][1].skill == "stop"
    assert reach(walker, 31) <= 0.2


def test_the_oracle_takes_the_nearest_of_several_targets() -> None:
    chair = asset("chair", "chair", block(0.5, 0.45, 0.5))
    scene = two_rooms(0.9, (chair, scene_object(30, chair, 2.5, 2.0)), (chair, scene_object(31, chair, 7.0, 5.5)))
    walker = Walker(scene, (30, 31))
    play(OracleAgent(), walker, episode(scene, "chair", 30, 31))
    assert reach(walker, 30) <= 0.2


def test_the_oracle_finds_another_way_around_the_unexpected() -> None:
    # A glass pane that is not in the scene blocks the direct way to the bed.
    pane = asset("pane", "wall", block(1.2, 1.0, 0.1))
    known, real = two_rooms(), two_rooms(0.9, (pane, scene_object(30, pane, 1.2, 2.2)))
    walker = Walker(known, (22,), solid=OccupancyGrid.of(real))
    log = play(OracleAgent(), walker, episode(known, "bed", 22, sit=True))
    assert walker.sat
    assert any("in my way" in decision.reasoning for decision, _ in log)


def test_the_oracle_says_that_it_sees_the_target_only_in_view() -> None:
    walker = Walker(two_rooms(), (20,))
    log = play(OracleAgent(), walker, episode(walker.scene, "couch", 20, sit=True))
    states = [decision.visible_state for decision, _ in log]
    assert states[0].startswith("I am in the bedroom. No couch is in view")
    assert any(re.search(r"A couch is ahead", words) for words in states)
    assert "No couch is in view" in states[-1], "it sits with its back to the couch"


def test_the_oracle_looks_at_a_target_behind_it_before_it_sits_down() -> None:
    scene = two_rooms()
    walker = Walker(scene, (20,))
    walker.x, walker.z, walker.yaw = 6.6, 2.5, -np.pi / 2
    log = play(OracleAgent(), walker, episode(scene, "couch", 20, sit=True))
    assert any("A couch is" in decision.visible_state for decision, _ in log)
    assert walker.sat


def test_an_instruction_without_a_target_in_the_scene_is_refused() -> None:
    walker = Walker(two_rooms())
    with pytest.raises(PluginError, match=r"one of chair, couch, .* got 'Dance!'"):
        play(OracleAgent(), walker, EpisodeSpec(id="free", instruction="Dance!", scene="test:rooms"))
    (only,) = play(OracleAgent(), walker, episode(walker.scene, "giraffe"))
    assert only[1].skill == "stop"
    assert "no giraffe here" in only[0].reasoning


def test_the_oracle_stops_and_says_why_when_there_is_no_way() -> None:
    walker = Walker(two_rooms(door=0.1), (20,))
    (only,) = play(OracleAgent(), walker, episode(walker.scene, "couch", 20, sit=True))
    assert only[1].skill == "stop"
    assert "no way" in only[0].reasoning


@pytest.mark.parametrize("seed", range(4))
def test_the_oracle_climbs_to_a_bed_above_and_sits_on_it(seed: int) -> None:
    walker = Walker(two_storeys(), (31,), seed)
    log = play(OracleAgent(), walker, episode(walker.scene, "bed", 31, sit=True))
    skills = [call.skill for _, call in log]
    assert skills[-1] == "stop"
    assert walker.sat
    assert walker.ground == pytest.approx(UPSTAIRS)
    assert STEPS <= skills.count("climb_upstairs") < STEPS + 4
    assert "walk_downstairs" not in skills


@pytest.mark.parametrize("seed", range(4))
def test_the_oracle_walks_down_the_stairs_to_a_plant_below(seed: int) -> None:
    scene = two_storeys()
    walker = Walker(scene, (30,), seed)
    walker.x, walker.z, walker.yaw, walker.ground = 7.2, 1.5, 0.0, UPSTAIRS
    log = play(OracleAgent(), walker, episode(scene, "potted_plant", 30))
    skills = [call.skill for _, call in log]
    assert skills[-1] == "stop"
    assert reach(walker, 30) <= 0.2
    assert STEPS <= skills.count("walk_downstairs") < STEPS + 4
    heights = {call.params["h_cm"] for _, call in log if call.skill == "walk_downstairs"}
    assert heights == {17}


def test_the_oracle_stays_on_its_storey_where_a_target_is_there_too() -> None:
    walker = Walker(two_storeys(), (30, 32))
    log = play(OracleAgent(), walker, episode(walker.scene, "potted_plant", 30, 32))
    assert reach(walker, 30) <= 0.2
    assert not any("stairs" in call.skill for _, call in log)


def test_the_oracle_says_that_it_is_on_the_stairs() -> None:
    walker = Walker(two_storeys(), (31,))
    log = play(OracleAgent(), walker, episode(walker.scene, "bed", 31, sit=True))
    reasons = [decision.reasoning for decision, call in log if call.skill == "climb_upstairs"]
    assert reasons[0] == f"I take step 1 of {STEPS} up the stairs."
    left = [float(match[1]) for decision, _ in log if (match := re.search(r"([0-9.]+) m left", decision.progress))]
    assert left[0] > 9.0
    assert max(np.diff(left)) < 0.5


@pytest.mark.parametrize("z", [0.15, 0.5, 0.85])
@pytest.mark.parametrize("x", [2.1, 2.2, 3.9])
def test_the_oracle_knows_a_way_up_from_anywhere_on_the_stairs(x: float, z: float) -> None:
    walker = Walker(two_storeys(), (31,))
    walker.x, walker.z, walker.ground = x, z, 0.17 * np.ceil((x - 2.0) / 0.25)
    decision = begun(walker, "bed", 31).decide(Observation(0, "Find a bed.", PICTURE), ())
    assert decision.calls[0].skill != "stop"
    assert "no way" not in decision.reasoning


def test_the_oracle_says_what_the_missing_skill_would_command() -> None:
    walker = Walker(two_storeys(), (31,))
    few = {name: skill for name, skill in SKILLS.items() if name != "climb_upstairs"}
    with pytest.raises(HumanclawError, match=r"needs a skill of role locomotion that commands hips\.rise"):
        play(OracleAgent(), walker, episode(walker.scene, "bed", 31, sit=True), few)


def test_the_oracle_wants_a_scene() -> None:
    spec = EpisodeSpec(id="x", instruction="x", scene="x")
    with pytest.raises(HumanclawError, match="needs the scene"):
        OracleAgent().begin(EpisodeContext(spec, SKILLS, 0))


def test_the_still_agent_stops_at_once() -> None:
    walker = Walker(two_rooms(), (20,))
    assert [call.skill for _, call in play(StillAgent(), walker, episode(walker.scene, "couch", 20))] == ["stop"]


def test_the_oracle_names_a_skill_that_is_missing_or_not_trained(tmp_path: Path) -> None:
    walker = Walker(two_rooms(), (20,))
    spec = episode(walker.scene, "couch", 20, sit=True)
    untrained = SKILLS | {"sit_in_place": replace(SKILLS["sit_in_place"], adapter=tmp_path / "adapter.safetensors")}
    with pytest.raises(HumanclawError, match="sit_in_place' has no trained adapter"):
        play(OracleAgent(), walker, spec, untrained)
    with pytest.raises(
        HumanclawError, match=r"a skill of role locomotion that commands hips\.left, hips\.forward, heading\.left"
    ):
        play(OracleAgent(), walker, spec, {"stop": SKILLS["stop"]})


@pytest.mark.parametrize("first", [True, False])
def test_a_guess_is_an_option_of_the_question(first: bool) -> None:
    question = EpisodeSpec(id="test", scene="", instruction="Is it you? Answer with one of: yes, quite; no.")
    agent, skills = GuessingAgent(first), Plugins.discover().skills | {"answer": humanclaw_skill_answer.answer}
    said = set()
    for seed in range(20):
        agent.begin(EpisodeContext(question, skills, seed=seed))
        said.add(str(agent.decide(Observation(0, question.instruction, PICTURE), ()).calls[0].params["text"]))
    assert said == ({"yes, quite"} if first else {"yes, quite", "no"})


def test_the_oracle_answers_a_question_about_oneself_at_once() -> None:
    walker, agent = Walker(two_rooms()), HandyOracle()
    question = EpisodeSpec(id="x", instruction="x", scene="x", goal=Goal(asks="mirror", answer="no"))
    skills = SKILLS | {"answer": humanclaw_skill_answer.answer}
    agent.begin(EpisodeContext(question, skills, 0, walker.scene, walker.state))
    assert agent.decide(Observation(0, "x", PICTURE), ()).calls == (Call("answer", {"text": "no"}),)


def test_the_random_agent_draws_legal_calls_that_its_seed_determines() -> None:
    spec = EpisodeSpec(id="x", instruction="x", scene="x")

    def draws(seed: int) -> list[str]:
        agent: Agent = RandomAgent()
        agent.begin(EpisodeContext(spec, SKILLS, seed))
        calls = [agent.decide(Observation(step, "x", PICTURE), ()).calls[0] for step in range(60)]
        for call in calls:
            SKILLS[call.skill].check(call.params)
        return [str(call) for call in calls]

    assert draws(1) == draws(1)
    assert draws(1) != draws(2)
    assert {text.split("(")[0] for text in draws(1)} == set(SKILLS)


def test_a_target_is_in_view_only_in_front_of_the_eyes() -> None:
    scene = two_rooms()
    plan, walker = OccupancyGrid.of(scene), Walker(scene)
    walker.x, walker.z, walker.yaw = 5.5, 2.5, np.pi / 2
    seen = in_view(plan, scene, walker.state(), 20, GAZES["body"])
    assert seen is not None
    assert abs(seen[0]) < 0.1
    assert in_view(plan, scene, walker.state(), 22, GAZES["body"]) is None
    walker.yaw = -np.pi / 2
    assert in_view(plan, scene, walker.state(), 20, GAZES["body"]) is None
    assert in_view(plan, scene, walker.state(), 22, GAZES["body"]) is None, "the bed is behind the wall"
