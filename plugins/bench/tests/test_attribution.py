"""Root causes: a rollout for each of the 18 labels, their order and bounds, and the funnel."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from rollouts import COUCH, TABLE, pacing, roaming, rollout, step, stuck, touch
from rooms import two_rooms

from humanclaw import Call, RecordedEpisode, StepRecord, run_episode
from humanclaw.records import free_episode
from humanclaw.testing import ScriptedAgent
from humanclaw.world import geodesics
from humanclaw_bench.attribution import CAUSES, FURTHER, also, attribute, funnel
from humanclaw_bench.scores import score

SEE, BLIND = "A couch is 2 m ahead.", "A wall."
ON = {"pelvis_contacts": (COUCH,)}
MOVED = {"end": (0.4, 1.0, 0.0), "geodesic": 4.0}
FOUND = step(says=SEE, pixels=500, **MOVED)
AT_SEAT = [FOUND, step(says=SEE, pixels=500, away=0.1, geodesic=0.1)]
ROLLOUTS: dict[str, list[StepRecord]] = {
    "find: target in view but not seen": [step(says=BLIND, pixels=100, geodesic=1.0), *roaming(3)],
    "find: near but not in view": [*roaming(3), step(geodesic=1.4), *roaming(3)],
    "find: too far": [*stuck(8)],
    "find: unaware jammed": [*roaming(3), *stuck(8), *roaming(30)],
    "find: ineffective actions": pacing(25, 2.0),
    "find: midpoint give up": [*roaming(3), step(geodesic=2.9), *roaming(3, geodesic=3.7)],
    "find: ineffective exploration": [*pacing(25, 2.1), *stuck(7), *roaming(1, geodesic=3.0), *roaming(3,
    geodesic=3.6)],
    "nav: unaware arrived/touch": [*AT_SEAT, *roaming(3)],
    "nav: stop while far": [FOUND, step("stop", away=0.3)],
    "nav: find too late": [*roaming(70), *[FOUND] * 3],
    "nav: unaware jammed": [*roaming(69), FOUND, *stuck(8, pixels=500), step(pixels=100)],
    "nav: ineffective actions": [FOUND, *stuck(7), step(pixels=100, **MOVED)],
    "nav: target hallucination": [FOUND, *stuck(8), step(says=SEE, pixels=99)],
    "nav: lost target": [FOUND, *stuck(8), step(says=BLIND, pixels=99)],
    "interact: stand after sit": [*AT_SEAT, step("sit_in_place", **ON), step("turn_in_place", away=0.1), step("stop",
    away=0.1)],
    "interact: sit on air": [*AT_SEAT, step("sit_in_place", away=0.1), step("stop", away=0.1)],
    "interact: sit wrong": [*AT_SEAT, step("sit_in_place", pelvis_contacts=(TABLE,)), step("stop", away=0.1)],
    "interact: stop but never sit": [*AT_SEAT, step("stop", away=0.1)],
}  # fmt: skip
DECIDED = dict(zip(ROLLOUTS, (0, 3, None, 3, 0, 3, 35, 1, 1, 70, 70, 8, 9, 9, 4, 2, 2, 2), strict=True))
"""Index of the step at which each was decided."""
START = {"find: too far": 20.1, "find: midpoint give up": 6.0, "find: ineffective exploration": 6.0}


@pytest.mark.parametrize("label", ROLLOUTS)
def test_each_root_cause_has_its_rollout(tmp_path: Path, label: str) -> None:
    recorded = rollout(tmp_path, ROLLOUTS[label], geodesic=START.get(label, 4.0))
    cause = attribute(recorded)
    assert cause
    assert (cause.label, cause.step(recorded)) == (label, DECIDED[label])


def test_there_are_the_papers_eighteen_labels() -> None:
    assert [cause.label for cause in CAUSES] == list(ROLLOUTS)
    assert [sum(cause.stage == stage for cause in CAUSES) for stage in ("find", "nav", "interact")] == [7, 7, 4]


@pytest.mark.parametrize(
    ("steps", "start", "label"),
    [
        # Too far and jammed: too far is asked first.
        ([*roaming(3), *stuck(8)], 20.1, "find: too far"),
        ([step(pixels=100), *stuck(8)], 20.1, "find: target in view but not seen"),
        ([step(geodesic=1.0), *stuck(8)], 20.1, "find: near but not in view"),
        ([*roaming(3), step(geodesic=2.9), *roaming(3, geodesic=3.6)], 6.0, "find: ineffective exploration"),
        ([*pacing(25, 1.0), *stuck(8)], 4.0, "find: unaware jammed"),
        (pacing(24, 2.0), 4.0, "find: ineffective exploration"),
        # It came near, stopped and had gone away again: neither of the first two rules.
        ([FOUND, step(away=0.1), step("stop", pixels=100)], 4.0, "nav: ineffective actions"),
        ([*roaming(70), step(says=SEE, pixels=500), *stuck(8, pixels=500)], 4.0, "nav: find too late"),
        ([*roaming(69), step(pixels=100), FOUND], 4.0, "nav: ineffective actions"),
        # It sits on the arm of the couch: a thigh rests there, the pelvis hangs beside the seat.
        ([*AT_SEAT, step("sit_in_place", contacts=(touch(COUCH, joint="left_hip"),)), step("stop", away=0.1)], 4.0,
         "interact: sit wrong"),
        # A thigh that brushed a table on the way there is no sit on anything.
        ([*AT_SEAT, step(contacts=(touch(TABLE, joint="left_hip"),)), step("sit_in_place"), step("stop", away=0.1)],
         4.0, "interact: sit on air"),
        # The seat was brushed on the way: the pelvis did touch something.
        ([*AT_SEAT, step(contacts=(touch(TABLE, joint="pelvis"),)), step("sit_in_place"), step("stop", away=0.1)], 4.0,
         "interact: sit wrong"),
        # Exactly at a bound.
        ([*roaming(3), step(geodesic=1.5), *roaming(3)], 4.0, "find: midpoint give up"),
        (stuck(8), 20.0, "find: unaware jammed"),
        ([step(params={"z_cm": 10}, geodesic=4.0)] * 8, 4.0, "find: unaware jammed"),
        ([step(params={"z_cm": 9}, geodesic=4.0)] * 8, 4.0, "find: ineffective exploration"),
        (pacing(8, 0.1), 4.0, "find: ineffective exploration"),
        (pacing(8, 0.5, contacts=(touch(TABLE),)), 4.0, "find: unaware jammed"),
        ([step(geodesic=3.0), *roaming(3)], 6.0, "find: ineffective exploration"),
        ([FOUND, step(away=0.2), step()], 4.0, "nav: unaware arrived/touch"),
        ([step(""), step("", geodesic=4.0), *roaming(2)], 4.0, "call: no usable call"),
        ([step(""), step("", geodesic=4.0), *roaming(3)], 4.0, "find: ineffective exploration"),
        # Ahead, too, 2.1 m are more than the box.
        ([step(start=(0, 1, 2.1 * (k % 2)), end=(0, 1, 2.1 * (1 - k % 2)), geodesic=4.0) for k in range(25)], 4.0,
         "find: ineffective exploration"),
        # A pause, a turn and tiny steps are no jam.
        ([*stuck(7), step("", away=None), *stuck(7)], 4.0, "find: ineffective exploration"),
        ([*stuck(7), step("turn_in_place", geodesic=4.0), *stuck(7)], 4.0, "find: ineffective exploration"),
        ([step(params={"x_cm": 3, "z_cm": 5}, geodesic=4.0)] * 12, 4.0, "find: ineffective exploration"),
        # Turns are acts that keep a body in place.
        ([step("turn_in_place", geodesic=4.0)] * 25, 4.0, "find: ineffective actions"),
        # The target was in view at the start, and the last answer said so; it is out of view at the end.
        ([FOUND, step(says=SEE, pixels=99, **MOVED)], 4.0, "nav: target hallucination"),
        # Each is said or seen, and never both in one step.
        ([step(says=SEE, geodesic=1.0), step(pixels=500, geodesic=1.0)], 4.0, "find: target in view but not seen"),
    ],
)  # fmt: skip
def test_the_first_rule_that_matches_gives_the_label(tmp_path: Path, steps: list, start: float, label: str) -> None:
    cause = attribute(rollout(tmp_path, steps, geodesic=start))
    assert cause
    assert cause.label == label


AGAINST, FLOOR = {"contacts": (touch(TABLE),)}, 1


TURN = step("turn_in_place", geodesic=4.0, **AGAINST)


@pytest.mark.parametrize(
    ("steps", "jammed"),
    [
        # It moves by 0.45 m a call, three calls of the eight by less than 0.1 m, and gets nowhere.
        ([*pacing(5, 0.45, **AGAINST), *stuck(3, **AGAINST)], True),
        (pacing(8, 0.45), False),  # Nothing is in its way.
        (pacing(8, 0.45, contacts=(touch(FLOOR),)), False),
        (pacing(8, 0.55, **AGAINST), False),  # It has half a metre and more.
        ([*pacing(7, 0.45, **AGAINST), *pacing(1, 0.45)], False),  # Seven times in a row.
        ([*pacing(4, 0.45, **AGAINST), TURN, *pacing(4, 0.45, **AGAINST)], False),
    ],
)
def test_a_body_that_rocks_against_something_is_jammed(tmp_path: Path, steps: list, jammed: bool) -> None:
    cause = attribute(rollout(tmp_path, [*roaming(3), *steps, *roaming(10)], geodesic=4.0, ground=(FLOOR,)))
    assert cause
    assert cause.label == ("find: unaware jammed" if jammed else "find: ineffective exploration")


def test_without_recorded_ways_the_straight_line_stands_in(tmp_path: Path) -> None:
    near = [step(end=(3.6, 1.0, 0.0))]
    far = [step(end=(3.4, 1.0, 0.0))]
    labels = [attribute(rollout(tmp_path, steps, name=f"{k}")) for k, steps in enumerate((near, far))]
    assert [cause.name for cause in labels if cause] == ["near but not in view", "ineffective exploration"]


def test_success_and_unfinished_episodes_have_no_root_cause(tmp_path: Path) -> None:
    sat = [*AT_SEAT, step("sit_in_place", away=0.1, **ON), step("stop", away=0.1, **ON)]
    assert attribute(rollout(tmp_path, sat, name="sat")) is None
    assert attribute(rollout(tmp_path, ROLLOUTS["interact: stop but never sit"], name="nav", interact=False)) is None
    assert attribute(rollout(tmp_path, [step()], name="free", category="", interact=False)) is None
    for outcome in ("infra_error", "interrupted", "running"):
        assert attribute(rollout(tmp_path, [step()], name=outcome, outcome=outcome)) is None


# -- second labels -----------------------------------------------------------------------------------------------------
ASIDE = {"end": (4.0, 1.0, 0.0)}
"""A metre in front of the couch."""


@pytest.mark.parametrize(
    ("steps", "first", "further"),
    [
        # It searched on for 25 steps after the first 25, which it spent on one spot.
        ([*pacing(25, 1.0), *roaming(25)], "find: ineffective actions", ["find: ineffective exploration"]),
        ([*roaming(25), *pacing(25, 1.0)], "find: ineffective actions", []),
        ([*pacing(25, 1.0), *stuck(8)], "find: unaware jammed", ["find: ineffective actions"]),
        # It turned its back to the couch, sat down too far in front of it, and stopped.
        ([FOUND, step("sit_in_place", says=BLIND, away=0.4, **ASIDE), step("stop", away=0.4)], "nav: stop while far",
         ["nav: turned to sit"]),
        ([FOUND, step("turn_in_place", says=BLIND, yaw_end=-1.6, **ASIDE)], "nav: lost target", ["nav: turned to sit"]),
        # It faces the couch.
        ([FOUND, step("turn_in_place", says=BLIND, yaw_end=1.6, **ASIDE)], "nav: lost target", []),
        ([FOUND, step("stop", away=0.3, says=SEE)], "nav: stop while far", ["nav: target hallucination"]),
        ([FOUND, step("stop", away=0.3, says=SEE, pixels=500)], "nav: stop while far", []),
        ([*roaming(70), step(says=SEE, pixels=500)], "nav: find too late", ["nav: ineffective actions"]),
        # 50 m away with two steps left.
        ([*roaming(97), step(geodesic=50.0), step(says=SEE, pixels=500)], "nav: find too late",
         ["nav: ineffective actions", "nav: too late to reach"]),
        (ROLLOUTS["interact: stand after sit"], "interact: stand after sit", []),
    ],
)  # fmt: skip
def test_second_labels_tell_what_the_order_hides(tmp_path: Path, steps: list, first: str, further: list[str]) -> None:
    recorded = rollout(tmp_path, steps, geodesic=4.0)
    cause = attribute(recorded)
    assert cause
    assert (cause.label, [other.label for other in also(recorded, cause)]) == (first, further)


def test_a_success_has_no_second_label(tmp_path: Path) -> None:
    assert also(rollout(tmp_path, [step()]), None) == ()
    assert [cause.label for cause in FURTHER] == ["nav: too late to reach", "nav: turned to sit"]


# -- the funnel --------------------------------------------------------------------------------------------------------
def test_the_funnel_counts_a_stage_only_after_the_stages_before_it(tmp_path: Path) -> None:
    sat = [*AT_SEAT, step("sit_in_place", away=0.1, **ON), step("stop", away=0.1, **ON)]
    unseen = [step(away=0.1), step("stop", away=0.1)]
    plans = {
        "sat": (sat, True, ""), "stood": ([*AT_SEAT, step("stop", away=0.1)], True, ""), "far": ([FOUND], True, ""),
        "reached": ([*AT_SEAT, step("stop", away=0.1)], False, ""), "unsaid": ([step(pixels=500)], False, ""),
        "unseen": (unseen, False, ""), "broken": (sat, True, "infra_error"),
    }  # fmt: skip
    scores = [
        score(rollout(tmp_path, steps, name=name, interact=interact, outcome=outcome))
        for name, (steps, interact, outcome) in plans.items()
    ]
    assert [(sum(met), len(met)) for met, _ in funnel(scores)] == [(5, 6), (4, 6), (3, 6), (1, 2)]


# -- the way that is left ----------------------------------------------------------------------------------------------
def test_the_way_to_a_target_leads_through_the_door() -> None:
    scene = two_rooms()
    way = geodesics(scene, (20,))
    low, high = scene.aabb(20)
    start = np.array([scene.start.x, 0.96, scene.start.z])
    straight = float(np.linalg.norm(np.maximum(0, np.maximum(low - start, start - high))[[0, 2]]))
    assert straight < way(start) < 3 * straight
    assert way((low + high) / 2) < 1.2
    assert way(start) > way(start + [1.0, 0.0, 0.0]) - 1.1


@pytest.mark.integration
def test_a_run_records_the_way_left_before_and_after_each_step(body, house, tmp_path: Path) -> None:
    spec = free_episode("find a couch", house, max_steps=2)
    agent = ScriptedAgent([Call("walk", {"z_cm": 40}), Call("stop")])
    run_episode(body, spec, agent, folder=tmp_path / "one", distance=geodesics)
    recorded, way = RecordedEpisode(tmp_path / "one"), geodesics(house, spec.target_ids)
    assert recorded.record.geodesic == pytest.approx(way([house.start.x, 0.96, house.start.z]), abs=0.1)
    assert [row.geodesic for row in recorded.steps] == pytest.approx([way(row.end) for row in recorded.steps], abs=0.01)
    assert set(recorded.record.movable) == {obj.id for obj in house.objects if obj.movable}


def test_no_target_has_no_way() -> None:
    assert geodesics(two_rooms(), ())(np.zeros(3)) == np.inf


@pytest.mark.filterwarnings("error")
def test_a_scene_without_a_target_is_attributed_in_silence(tmp_path: Path) -> None:
    lost = [step(away=None, yaw_end=2.0), step(away=None, yaw_end=2.0)]  # Its back to everything.
    recorded = rollout(tmp_path, lost, targets={}, outcome="out_of_steps")
    cause = attribute(recorded)
    assert cause
    assert cause.stage == "find"
    assert not [other for other in also(recorded, cause) if other.stage == "nav"]
