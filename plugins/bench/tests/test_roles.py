"""Metrics and root causes use the declarations of a skill: a third-party skill counts by its role, not by its name."""

from __future__ import annotations

from declared import INFOS, STROLL, info
from rollouts import COUCH, roaming, rollout, step

from humanclaw import Call
from humanclaw.records import SkillInfo
from humanclaw.skills import Skill
from humanclaw_bench.attribution import attribute
from humanclaw_bench.scores import score

SKILLS = INFOS | {
    "stroll": info(Skill.of_schema("stroll", STROLL)),
    "march": SkillInfo(role="locomotion"),
    "perch": SkillInfo(role="sit"),
    "sit_up": SkillInfo(role="gesture"),
}


def _calls(skill: str, count: int = 1, stays: bool = False, **params: int):
    """Steps that call a skill; with `stays` the body goes nowhere."""
    begun = step(start=(0.0, 1.0, 0.0), end=(0.0 if stays else 0.4, 1.0, 0.0))
    return [begun.model_copy(update={"call": Call(skill, params)}) for _ in range(count)]


def _cause(tmp_path, calls) -> str:
    """The root cause of an episode that never finds its target, with calls of 40 cm a step around these."""
    recorded = rollout(tmp_path, [*roaming(3), *calls, *roaming(30)], skills=SKILLS)
    return attribute(recorded).label


def test_a_third_partys_stroll_counts_as_a_jam(tmp_path):
    assert _cause(tmp_path, _calls("stroll", 8, stays=True, ahead_cm=20)) == "find: unaware jammed"


def test_a_locomotion_that_declares_no_parameter_counts_as_a_jam_too(tmp_path):
    assert _cause(tmp_path, _calls("march", 8, stays=True)) == "find: unaware jammed"


def test_a_turn_of_the_stroll_a_pause_of_it_and_a_gesture_are_no_jam(tmp_path):
    for number, calls in enumerate(
        (
            _calls("stroll", 8, stays=True, ahead_cm=0, veer_deg=20),
            _calls("stroll", 8, stays=True, ahead_cm=9),
            _calls("sit_up", 8, stays=True, ahead_cm=40),
        )
    ):
        assert _cause(tmp_path / str(number), calls) == "find: ineffective exploration"


def _seated(tmp_path, skill: str):
    """The hips on the couch at the end of a call of the skill, and then an active stop."""
    on = {"pelvis_contacts": (COUCH,)}
    sat = _calls(skill)[0].model_copy(update=on)
    return score(
        rollout(tmp_path, [step(says="A couch.", pixels=500), sat, step("stop", away=0.1, **on)], skills=SKILLS)
    )


def test_a_perch_is_a_sit(tmp_path):
    scores = _seated(tmp_path, "perch")
    assert (scores.interact, scores.geo_interact) == (True, True)


def test_a_sit_up_is_none(tmp_path):
    scores = _seated(tmp_path, "sit_up")
    assert (scores.interact, scores.geo_interact) == (False, False)
