"""Metrics, computed by hand for small records and compared with a second computation that shares no code."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rollouts import BOOK, COUCH, COUCH_BOX, LAMP, TABLE, VASE, rollout, step, touch

from humanclaw import Call, Chunk, Decision, Motion, RecordError, StepRecord, Verdict
from humanclaw.body import FPS, HISTORY, JOINTS, OFFSETS, PARENTS, Pose2D, pelvis_jerk, rest_pose, root_jerk
from humanclaw.records import Answer, Attempt, PlayedPart, Usage, acknowledges
from humanclaw.testing import contacts, touches
from humanclaw.world import Contact, Execution, person_id
from humanclaw_bench.disturbance import collisions, disturbed, disturbed_path
from humanclaw_bench.metrics import ALL, compare, estimate
from humanclaw_bench.scores import Scores, generated_trajectory, score

SEE = "A couch is 2 m ahead."
METRIC = {metric.name: metric for metric in ALL}


# -- find --------------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("text", "category", "said"),
    [
        ("A couch is 2.5 m ahead, slightly left.", "couch", True),
        ("Two sofas by the wall.", "couch", True),
        ("Table on the left; the TARGET is behind it", "couch", True),
        ("A potted_plant in the corner", "potted_plant", True),
        ("There are no chairs. A couch stands to the right.", "couch", True),
        ("No couch is in view.", "couch", False),
        ("I don't see a sofa", "couch", False),
        ("I don\u2019t see a sofa", "couch", False),
        ("There is a table, but neither a couch nor a bed.", "couch", False),
        ("The couch is out of view now", "couch", False),
        ("I am in the bedroom beside a bedside table.", "bed", False),
        ("A chair and a table.", "couch", False),
        ("", "couch", False),
        ("A couch is ahead and nothing blocks the way", "couch", True),
        ("A couch is ahead, no obstacle between us.", "couch", True),
        ("I see the couch but not the tv.", "couch", True),
        ("I see the couch but not the tv.", "tv", False),
        ("Looking for a couch", "couch", False),
        ("I am looking at a couch", "couch", True),
        ("I need to find the couch.", "couch", False),
        ("The couch might be behind the wall.", "couch", False),
        ("target_visible: false", "couch", False),
        ("target_visible: true", "couch", True),
        ("A grey sectional on the left", "couch", True),
        ("A large flat screen on the wall", "tv", True),
        ("A white commode", "toilet", True),
        ("No table, couch or bed.", "couch", False),
        ("A piano stands there", "piano", True),
        ("The sofa on my right looks empty.", "couch", True),
        ("It looks like a couch.", "couch", True),
        ("Looking left and right for the couch.", "couch", False),
        ("I look around: the couch.", "couch", False),
        ("I see the bed I was looking for.", "bed", True),
        ("I was looking for the bed.", "bed", False),
        ("The TV is on the wall, not far from the door.", "tv", True),
        ("The bed is no longer far away: it is right ahead.", "bed", True),
        ("The chair is partly hidden behind the table.", "chair", True),
        ("The chair is hidden behind the table.", "chair", False),
        ("I see the couch and will find a way to it.", "couch", True),
        ("A couch stands in the next room, through the door.", "couch", True),
        ("The couch must be in the next room.", "couch", False),
        ("No obstacle and no couch.", "couch", False),
        ("No obstacles on the way to the couch.", "couch", True),
        ("Is that a couch?", "couch", False),
        ("What is 2.5 m ahead, a couch? No, a bench.", "couch", False),
        ("I lost sight of the couch.", "couch", False),
        ("I remember a couch in the last room.", "couch", False),
        ("The couch is behind me.", "couch", False),
        ("I am unable to see the couch.", "couch", False),
        ("My goal is a couch.", "couch", False),
        ("target: couch; a bare corridor", "couch", False),
        ("target: couch, 2 m ahead", "couch", False),
        ("target: visible, 2 m ahead", "couch", True),
        ("A houseplant", "potted_plant", True),
        ("A flower bed before the house", "bed", False),
        ("A toilet paper holder on the wall.", "toilet", False),
        ("A plant was two steps ago on my left.", "potted_plant", False),
        ("The corner of what I think is a bed.", "bed", False),
        ("Facing the sofa, half a metre away, not yet touching it.", "couch", True),
    ],
)
def test_a_sentence_that_names_the_target_acknowledges_it(text: str, category: str, said: bool) -> None:
    assert acknowledges(text, category) is said


@pytest.mark.parametrize(
    ("steps", "find", "in_view"),
    [
        ([step(says=SEE, pixels=100)], True, True),
        ([step(says=SEE, pixels=99)], False, False),
        ([step(says="A table.", pixels=5000)], False, True),
        ([step(says="A table.", pixels=5000), step(says=SEE, pixels=0)], False, True),
        ([step(says=SEE, target_pixels={COUCH: 60, 21: 40})], True, True),
    ],
)
def test_found_is_seen_and_said_in_the_same_step(tmp_path: Path, steps: list, find: bool, in_view: bool) -> None:
    scores = score(rollout(tmp_path, steps))
    assert (scores.find, scores.geo_find) == (find, in_view)


def test_false_claims_are_the_share_of_views_without_a_target(tmp_path: Path) -> None:
    steps = [step(says=SEE), step(says="A wall."), step(says="A wall."), step(says=SEE), step(says=SEE, pixels=1)]
    assert score(rollout(tmp_path, steps)).false_claims == 0.5
    assert np.isnan(score(rollout(tmp_path, steps[4:], name="seen")).false_claims)


def test_what_counts_is_the_answer_that_was_used(tmp_path: Path) -> None:
    attempts = (Attempt(Decision(visible_state=SEE), "no call"), Attempt(Decision(visible_state="A wall.")))
    assert score(rollout(tmp_path, [step(pixels=900, attempts=attempts)])).find is False


# -- navigate ----------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("steps", "nav", "geo", "at_the_end", "one_metre"),
    [
        ([step(away=0.1), step("stop", away=0.2)], True, True, True, True),
        ([step(away=0.1), step("stop", away=0.21)], False, True, False, True),
        ([step("stop", away=1.0)], False, False, False, True),
        ([step("stop", away=1.01)], False, False, False, False),
        ([step(away=0.1)], False, True, True, False),
        ([step(away=0.1), step("", away=0.1)], False, True, True, False),
        ([step(away=0.1), step(away=3.0)], False, True, False, False),
        ([step("", away=None)], False, False, False, False),
    ],
)
def test_navigation_succeeds_with_an_active_stop_at_the_target(
    tmp_path: Path, steps: list, nav: bool, geo: bool, at_the_end: bool, one_metre: bool
) -> None:
    scores = score(rollout(tmp_path, steps))
    assert (scores.nav, scores.geo_nav, scores.ends_near, scores.nav_1m) == (nav, geo, at_the_end, one_metre)


# -- interact ----------------------------------------------------------------------------------------------------------
ON, OFF = {"pelvis_contacts": (COUCH,)}, {"pelvis_contacts": (TABLE,)}


@pytest.mark.parametrize(
    ("steps", "sat", "geo"),
    [
        ([step("sit_in_place", **ON), step("stop", **ON)], True, True),
        ([step("sit_in_place", **ON), step("", **ON), step("stop", **ON)], True, True),
        ([step("sit_in_place", **ON), step("turn_in_place"), step("stop")], False, True),
        ([step("sit_in_place"), step("turn_in_place", **ON), step("stop", **ON)], True, False),
        ([step("walk", **ON), step("stop", **ON)], False, False),
        ([step("sit_in_place", **OFF), step("stop", **OFF)], False, False),
        ([step("sit_in_place", **ON)], False, True),
        ([step("stop", **ON)], False, False),
    ],
)
def test_sitting_succeeds_with_the_pelvis_on_the_target_at_stop(
    tmp_path: Path, steps: list, sat: bool, geo: bool
) -> None:
    scores = score(rollout(tmp_path, steps))
    assert (scores.interact, scores.geo_interact) == (sat, geo)


def test_an_episode_without_sitting_is_not_scored_for_it(tmp_path: Path) -> None:
    scores = score(rollout(tmp_path, [step("sit_in_place", **ON), step("stop", away=0.1)], interact=False))
    assert (scores.interact, scores.geo_interact, scores.success) == (None, None, True)


def test_a_free_instruction_has_no_success_but_a_body(tmp_path: Path) -> None:
    scores = score(rollout(tmp_path, [step(away=None, contacts=(touch(TABLE),))], category="", interact=False))
    assert {scores.find, scores.geo_find, scores.nav, scores.geo_nav, scores.ends_near, scores.nav_1m} == {None}
    assert scores.success is None
    assert scores.collisions["any"] == 1.0


# -- collisions --------------------------------------------------------------------------------------------------------
def test_collisions_are_the_share_of_steps_with_a_hit_above_ground(tmp_path: Path) -> None:
    steps = [
        step(contacts=(touch(TABLE, height=2.0205), touch(TABLE, joint="right_foot", height=1.9))),
        step(contacts=(touch(TABLE, height=2.021),)),
        step(contacts=(touch(LAMP, height=3.0),)),
        step("", away=None),
        step(contacts=(touch(TABLE, height=3.0, group="head"), touch(TABLE, height=3.0, group="torso"))),
        step("stop"),
    ]
    shares = collisions(rollout(tmp_path, steps, start=Pose2D(x=0, z=0, yaw=0, floor=2.0)))
    assert np.isnan(shares.pop("person"))
    assert shares == {
        "any": 0.75, "leg_foot": 0.5, "head": 0.25, "torso": 0.25, "arm_hand": 0.0, "fixed": 0.5,
    }  # fmt: skip


def test_people_are_no_objects_and_have_a_column_of_their_own(tmp_path: Path) -> None:
    steps = [step(contacts=(touch(person_id(1), height=1.2),)), step(contacts=(touch(TABLE, height=1.0),)), step()]
    recorded = rollout(tmp_path, steps, company=("mine", "theirs"))
    shares = collisions(recorded)
    assert (shares["person"], shares["any"], shares["leg_foot"], shares["fixed"]) == pytest.approx((1 / 3,) * 4)
    assert disturbed(recorded, {}) == {}


def test_feet_on_stairs_stand_and_a_knee_against_them_collides(tmp_path: Path) -> None:
    stairs = 50
    climbing = [
        step(contacts=(touch(stairs, joint="left_foot", height=0.35), touch(stairs, joint="right_ankle", height=0.52))),
        step(contacts=(touch(stairs, joint="left_knee", height=0.6),)),
    ]
    assert collisions(rollout(tmp_path, climbing, ground=(stairs,)))["any"] == 0.5
    assert collisions(rollout(tmp_path, climbing, name="unknown"))["any"] == 1.0


def test_a_sequence_counts_by_the_half_second_that_it_lasts(tmp_path: Path) -> None:
    """Two seconds in one call: it hits something in the second half second, and goes 3 m ahead and 1 m back for 2 m of
    way."""
    parts = tuple(PlayedPart("control", 1, "walk", {"z": 0.4}) for _ in range(4))
    ways = {"start": (0.0, 1.0, 0.0), "waypoints": ((1.0, 1.0, 0.0), (2.0, 1.0, 0.0), (3.0, 1.0, 0.0))}
    long = step(motion_frames=60, parts=parts, contacts=(touch(TABLE, 20, 25),), end=(2.0, 1.0, 0.0), **ways)
    still = {"start": (2.0, 1.0, 0.0), "end": (2.0, 1.0, 0.0)}
    scores = score(rollout(tmp_path, [long, step("stop", away=0.1, **still)], geodesic=2.0))
    assert (scores.steps, scores.chunks, scores.sequences) == (2, 4, 1)
    assert (scores.collisions["any"], scores.spl) == (0.25, 0.5)


def test_a_fall_that_goes_on_in_the_next_step_counts_once(tmp_path: Path) -> None:
    falling, landed = step(fall=1.2, falling=True), step(fall=3.0)
    ends = {"lands": [landed, step("stop")], "stops": [step("stop")], "goes-on": [step(fall=9.0, falling=True)]}
    for name, rest in ends.items():
        assert score(rollout(tmp_path, [step(), falling, *rest], name=name)).falls == 1
    assert score(rollout(tmp_path, [landed, step(), landed], name="twice")).falls == 2


def test_no_motion_means_no_share_of_it(tmp_path: Path) -> None:
    scores = score(rollout(tmp_path, [step("", away=None)]))
    assert np.isnan(scores.collisions["any"])
    assert np.isnan(estimate(METRIC["Coll."], [scores]).value)


# -- disturbance -------------------------------------------------------------------------------------------------------
def test_a_chain_of_contacts_carries_a_disturbance_forward_in_time(tmp_path: Path) -> None:
    steps = [step(touches=((3, VASE, BOOK),)), step(contacts=(touch(LAMP, 4),), touches=((9, LAMP, VASE),))]
    frames = disturbed(rollout(tmp_path, steps), {})
    assert frames == {LAMP: HISTORY + 19, VASE: HISTORY + 24}


def test_the_recorder_counts_frames_from_the_beginning_of_the_step(tmp_path: Path) -> None:
    """A step of 15, 7 and 15 frames: the lamp is touched in frame 3 of the last piece and touches the vase in frame
    4."""
    hit = Contact((3,), "left_knee", "leg_foot", LAMP, True, 0.001, 0.5)
    pieces = [
        Chunk(rest_pose(count), Execution(rest_pose(count), contacts, touches, {}))
        for count, contacts, touches in ((15, (), ()), (7, (), ()), (15, (hit,), ((4, LAMP, VASE),)))
    ]
    fields = {"contacts": contacts(pieces), "touches": touches(pieces)}
    assert fields["contacts"][0].frames == (25,)
    assert fields["touches"] == ((26, LAMP, VASE),)
    frames = disturbed(rollout(tmp_path, [step("nod", **fields)]), {})
    assert frames == {LAMP: HISTORY + 25, VASE: HISTORY + 26}


@pytest.mark.parametrize(
    ("touches", "ids"),
    [
        (((4, VASE, LAMP), (4, VASE, BOOK)), {LAMP, VASE, BOOK}),
        (((4, LAMP, VASE), (4, BOOK, LAMP)), {LAMP, VASE, BOOK}),  # Two links in one frame.
        (((4, VASE, TABLE), (5, TABLE, LAMP)), {VASE}),  # What is fixed passes nothing on.
        (((3, VASE, LAMP), (5, LAMP, BOOK)), {VASE}),  # A frame too early.
    ],
)
def test_a_touched_vase_disturbs_what_it_touches_from_then_on(tmp_path: Path, touches: tuple, ids: set[int]) -> None:
    recorded = rollout(tmp_path, [step(contacts=(touch(VASE, 4),), touches=touches)])
    assert set(disturbed(recorded, {})) == ids


def test_the_path_of_an_object_counts_from_the_frame_it_was_disturbed(tmp_path: Path) -> None:
    path = np.zeros((HISTORY + 15, 7))
    path[:, 0] = np.concatenate([np.linspace(0, 1, HISTORY + 4), np.full(11, 1.5)])
    path[-1, 1] = -2.0
    recorded = rollout(tmp_path, [step(contacts=(touch(LAMP, 4),))], objects={LAMP: path})
    moved = recorded.objects()
    # Half a metre in the frame of the touch, two metres down in the last one; what it moved before is not the body's
    # doing.
    assert disturbed_path(disturbed(recorded, moved), moved) == pytest.approx(2.5)
    scores = score(recorded)
    assert (scores.disturbed, scores.disturbed_path) == (1, pytest.approx(2.5))
    assert (scores.displaced, scores.displacement) == (1, pytest.approx(np.hypot(0.5, 2.0)))


@pytest.mark.parametrize(("way", "displaced"), [(0.0099, 0), (0.01, 1)])
def test_a_touched_object_is_displaced_if_it_ends_a_centimetre_away(tmp_path: Path, way: float, displaced: int) -> None:
    there_and_back = np.zeros((HISTORY + 15, 7))
    there_and_back[HISTORY + 2 : -1, 0], there_and_back[-1, 2] = 3.0, way
    scores = score(rollout(tmp_path, [step(contacts=(touch(LAMP, 0),))], objects={LAMP: there_and_back}))
    assert (scores.disturbed, scores.displaced, scores.displacement) == (1, displaced, pytest.approx(displaced * way))


def test_the_displacement_is_pooled_over_objects(tmp_path: Path) -> None:
    scores = score(rollout(tmp_path, [step("stop")]))
    many = [replace(scores, displaced=1, displacement=4.0), replace(scores, displaced=3, displacement=0.0), scores]
    assert estimate(METRIC["dDtb (m)"], many).value == pytest.approx(1.0)
    assert estimate(METRIC["#Dtb"], many).value == pytest.approx(4 / 3)


def test_the_path_of_a_thing_counts_from_its_first_frame_of_motion(tmp_path: Path) -> None:
    path = np.zeros((HISTORY + 15, 7))
    path[:, 0] = np.concatenate([np.arange(HISTORY + 10) * 0.0005, np.full(5, 1.0 + 0.0005 * (HISTORY + 9))])
    recorded = rollout(tmp_path, [step(contacts=(touch(LAMP, 0),))], objects={LAMP: path})
    moved = recorded.objects()
    assert disturbed_path(disturbed(recorded, moved), moved) == pytest.approx(1.0)


# -- length of the path
# --------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("legs", "left", "away", "stops", "spl", "soft"),
    [
        (2, 0.0, 0.1, True, 1.0, 1.0),  # 4 m of way, straight there
        (4, 0.0, 0.1, True, 0.5, 0.5),  # twice as far as need be
        (4, 1.0, 2.0, True, 0.0, 0.375),  # stopped with a quarter of the way left, after 8 m
        (2, 0.0, 0.1, False, 0.0, 1.0),  # arrived, and did not notice
        (1, 6.0, 6.0, True, 0.0, 0.0),  # farther away than before
    ],
)
def test_success_is_weighted_by_the_length_of_the_path(
    tmp_path: Path, legs: int, left: float, away: float, stops: bool, spl: float, soft: float
) -> None:
    ways = [step(start=(2.0 * k, 1, 0), end=(2.0 * k + 2, 0.5, 0), away=away, geodesic=left) for k in range(legs)]
    end = [step("stop", start=(2.0 * legs, 1, 0), end=(2.0 * legs, 1, 0), away=away, geodesic=left)] if stops else []
    scores = score(rollout(tmp_path, [*ways, *end], geodesic=4.0))
    assert (scores.spl, scores.soft_spl) == (pytest.approx(spl), pytest.approx(soft))


def test_tokens_are_pooled_over_steps_with_reasoning_apart(tmp_path: Path) -> None:
    def spent(tokens: int, thought: int) -> tuple[Attempt, ...]:
        return (Attempt(Decision(usage=Usage(tokens, tokens, tokens_reasoning=thought))),)

    short = score(rollout(tmp_path, [step("stop", attempts=spent(1000, 600))], name="short"))
    long = score(rollout(tmp_path, [step(attempts=spent(100, 0))] * 9, name="long"))
    assert estimate(METRIC["out tok/step"], [short, long]).value == pytest.approx(1900 / 10)
    assert estimate(METRIC["reasoning tok/step"], [short, long]).value == pytest.approx(60)


# -- jerk --------------------------------------------------------------------------------------------------------------
def track(x: np.ndarray, z: np.ndarray | None = None, yaw: np.ndarray | None = None) -> Motion:
    still = rest_pose(len(x))
    root, rotations = still.root.copy(), still.rotations.copy()
    root[:, 0], root[:, 2] = x, 0.0 if z is None else z
    rotations[:, 0, 1] = 0.0 if yaw is None else yaw
    return Motion(root, rotations)


TIME = np.arange(90) / FPS


def test_the_jerk_of_a_cubic_is_six() -> None:
    assert root_jerk(track(TIME**3)) == pytest.approx(6.0)
    assert pelvis_jerk(track(TIME**3)) == pytest.approx(6.0)
    assert root_jerk(track(TIME**3, 2 * TIME**3)) == pytest.approx(6.0 * 5**0.5)


def test_constant_acceleration_has_no_jerk() -> None:
    assert root_jerk(track(3 * TIME + 2 * TIME**2)) == pytest.approx(0.0, abs=1e-9)


def test_turning_carries_the_joints_on_circles() -> None:
    speed, places = 1.3, []
    for joint in range(len(JOINTS)):
        parent = PARENTS[joint]
        places.append(OFFSETS[joint] + (places[parent] if parent >= 0 else 0))
    radius = np.mean([np.hypot(x, z) for x, _, z in places[:22]])
    # Of a sine of angular speed w: three differences of stride h give (2 sin(wh/2))^3, the average of 3 frames (1 + 2
    # cos w/30)/3.
    stride = 8 / 30
    gain = (2 * np.sin(speed * stride / 2) / stride) ** 3 * (1 + 2 * np.cos(speed / 30)) / 3
    assert root_jerk(track(0 * TIME, yaw=speed * TIME)) == pytest.approx(radius * gain)
    assert pelvis_jerk(track(0 * TIME, yaw=speed * TIME)) == pytest.approx(0.0, abs=1e-9)


def test_waving_is_no_jerk_and_neither_is_the_place(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    walk = track(np.cumsum(rng.normal(0, 0.02, 90)), np.cumsum(rng.normal(0, 0.02, 90)), 0.3 * TIME)
    waving = walk.rotations.copy()
    waving[:, 1:] += rng.normal(0, 0.5, waving[:, 1:].shape)
    assert root_jerk(Motion(walk.root + [5.0, 1.0, -3.0], waving)) == pytest.approx(root_jerk(walk))


def test_a_stop_is_no_part_of_the_jerk(tmp_path: Path) -> None:
    """It moves nothing, so that an agent that stops is neither smoother nor rougher than one that runs out of steps."""
    steps = [step(motion_frames=15) for _ in range(4)]
    without, stopped = rollout(tmp_path, steps, name="a"), rollout(tmp_path, [*steps, step("stop")], name="b")
    assert stopped.steps[-1].motion_frames == 0
    assert len(stopped.motion()) == len(without.motion())
    assert score(stopped).jerk == score(without).jerk


def test_a_motion_shorter_than_the_stencil_has_no_jerk() -> None:
    assert np.isnan(root_jerk(track(np.arange(26.0))))
    assert np.isfinite(root_jerk(track(np.arange(27.0))))


def test_being_stopped_by_a_wall_is_no_jerk_of_the_generated_motion(tmp_path: Path) -> None:
    """Four chunks of a steady walk along x, with a body that a wall at 0.4 m holds back and turns by 0.3 a chunk."""
    length, ahead = 4, np.arange(1, 16) * 0.4 / 15
    generated, simulated = [track(np.zeros(HISTORY))], [track(np.zeros(HISTORY))]
    x, z, yaw = 0.0, 0.0, np.pi / 2
    generated[0].rotations[:, 0, 1] = simulated[0].rotations[:, 0, 1] = yaw
    for _ in range(length):
        generated.append(track(x + ahead * np.sin(yaw), z + ahead * np.cos(yaw), np.full(15, yaw)))
        x, yaw = min(x + 0.4 * np.sin(yaw), 0.4), yaw - 0.3
        simulated.append(track(np.full(15, x), np.full(15, z), np.full(15, yaw)))
    whole = [generated[0], simulated[0]]
    for made, real in zip(generated[1:], simulated[1:], strict=True):
        whole = [whole[0].then(made), whole[1].then(real)]
    recorded = rollout(
        tmp_path, [step(motion_frames=15), step(motion_frames=30), step(), step("stop")], motion=tuple(whole)
    )
    line = generated_trajectory(recorded)
    assert len(line) == 60
    np.testing.assert_allclose(line.root[:, 0], np.arange(1, 61) * 0.4 / 15, atol=1e-9)
    np.testing.assert_allclose(line.root[:, 2], 0.0, atol=1e-9)
    assert score(recorded).jerk == pytest.approx(0.0, abs=1e-6)
    assert root_jerk(whole[0][HISTORY:]) > 1.0


# -- turning -----------------------------------------------------------------------------------------------------------
def test_a_reversal_is_a_turn_right_after_one_to_the_other_side(tmp_path: Path) -> None:
    """Left 20, right 20 (back), right 4 (too little), left 20 (after too little), left 20, right 5.1 (back) degrees."""
    turns = np.radians([20, -20, -4, 20, 20, -5.1])
    ways = np.interp(np.arange(1, 91), np.arange(0, 91, 15), [0, *np.cumsum(turns)])
    yaw = np.concatenate([np.zeros(HISTORY), ways])
    motion = track(0 * yaw, yaw=yaw)
    recorded = rollout(tmp_path, [step() for _ in turns], motion=(motion, motion))
    assert score(recorded).reversals == pytest.approx(2 / 6)


def test_the_landing_rate_is_the_ratio_of_two_rates(tmp_path: Path) -> None:
    scores = score(rollout(tmp_path, [step("stop")]))
    ends = ((True, True), (True, False), (True, False), (False, False))
    many = [replace(scores, find=find, nav=nav) for find, nav in ends]
    assert estimate(METRIC["landing"], many).value == pytest.approx(1 / 3)


# -- cost and what is left out -----------------------------------------------------------------------------------------
def test_requests_of_refused_answers_and_of_the_verifier_count(tmp_path: Path) -> None:
    attempts = tuple(Attempt(Decision(usage=Usage(100, 10, 0.5))) for _ in range(2))
    verdict = Verdict(True, usage=Usage(tokens_in=7, tokens_out=3, cost=0.25))
    scores = score(rollout(tmp_path, [step(verdict=verdict, attempts=attempts), step("", away=None), step("stop")]))
    assert (scores.tokens_in, scores.tokens_out, scores.cost) == (207, 23, 1.25)
    assert (scores.steps, scores.invalid) == (3, 1)
    assert estimate(METRIC["in tok/step"], [scores]).value == pytest.approx(69.0)


def test_a_call_of_which_nothing_is_asked_need_not_be_checked(tmp_path: Path) -> None:
    dead = Verdict(True, failed_open="the verifier does not answer")
    asked = Verdict(True, answers=(Answer("clear", True),))
    scores = score(rollout(tmp_path, [step(verdict=each) for each in (dead, asked, Verdict(True), Verdict(True))]))
    assert (scores.unasked, scores.verified) == (1, 2)


def test_an_episode_that_the_provider_broke_is_in_no_number(tmp_path: Path) -> None:
    good = score(rollout(tmp_path, [step(says=SEE, pixels=500), step("stop", away=0.1)], name="good"))
    bad = [
        score(rollout(tmp_path, [step(contacts=(touch(LAMP),))], name=f"bad{k}", outcome=outcome))
        for k, outcome in enumerate(("infra_error", "interrupted", "running"))
    ]
    for metric in ALL:
        np.testing.assert_equal(vars(estimate(metric, [good, *bad])), vars(estimate(metric, [good])))


@pytest.mark.parametrize(("scope", "finished"), [("episode", True), ("run", False)])
def test_an_episode_that_its_own_limit_ended_is_finished(tmp_path: Path, scope: str, finished: bool) -> None:
    assert score(rollout(tmp_path, [step()], outcome="limit_reached", limit=scope)).finished is finished


def test_an_episode_without_motion_is_scored_without_jerk(tmp_path: Path) -> None:
    recorded = rollout(tmp_path, [step("stop", away=0.1)])
    (recorded.folder / "motion.npz").unlink()
    scores = score(recorded)
    assert scores.nav
    assert np.isnan(scores.jerk)


# -- calibration -------------------------------------------------------------------------------------------------------
def stopping(expected: float | None, **more: object) -> StepRecord:
    return step("stop", attempts=(Attempt(Decision((Call("stop"),), expected_success=expected)),), **more)


def test_brier_is_the_squared_error_of_the_expected_success(tmp_path: Path) -> None:
    def scored(name: str, last: StepRecord, **more: object) -> Scores:
        return score(rollout(tmp_path, [last], name=name, interact=False, **more))

    spoken = [scored("a", stopping(0.8, away=0.1)), scored("b", stopping(0.9, away=4.0)), scored("c", stopping(0.2))]
    assert [scores.nav for scores in spoken] == [True, False, False]
    assert [scores.brier for scores in spoken] == pytest.approx([0.04, 0.81, 0.04])
    silent = [scored("d", stopping(None)), scored("e", stopping(0.9), outcome="out_of_steps")]
    assert estimate(METRIC["Brier"], [*spoken, *silent]).value == pytest.approx(0.89 / 3)
    assert np.isnan(estimate(METRIC["Brier"], silent).value)


# -- comparing ---------------------------------------------------------------------------------------------------------
@pytest.fixture
def base(tmp_path: Path) -> Scores:
    return score(rollout(tmp_path, [step("stop")]))


def run_of(base: Scores, navs: list[bool], **more: object) -> list[Scores]:
    return [replace(base, episode=f"e{k}", nav=nav, steps=10, **more) for k, nav in enumerate(navs)]


def test_runs_are_compared_episode_by_episode(base: Scores) -> None:
    a = run_of(base, [False] * 20)
    b = run_of(base, [True] * 12 + [False] * 8)[::-1]
    differences = compare(a, b)
    # Twelve gained and none lost: 2 / 2^12. In no episode does another success rate differ.
    assert differences["NavSR"].value == pytest.approx(0.6)
    assert differences["NavSR"].p == pytest.approx(2 / 2**12)
    assert differences["NavSR"].significant
    assert not differences["FindSR"].significant
    assert not differences["steps"].significant


def test_where_ways_are_measured_arrivals_are_in_the_headline(base: Scores) -> None:
    a = [replace(scores, find=False, arrive=False) for scores in run_of(base, [False] * 20)]
    b = [replace(scores, nav=k < 12, arrive=k < 12, find=k < 6) for k, scores in enumerate(a)]
    differences = compare(a, b)
    # Two headline rates differ, so the smaller p doubles: 2 / 2^12 and 2 / 2^6. NavSR is a side result beside them.
    assert [differences[name].p for name in ("ArriveSR", "FindSR")] == pytest.approx([4 / 2**12, 2 / 2**6])
    assert list(differences)[:3] == ["FindSR", "ArriveSR", "InteractSR"]


def test_only_episodes_that_both_finished_are_compared(base: Scores) -> None:
    a, b = run_of(base, [True] * 6), run_of(base, [True] * 4)
    b[3] = replace(b[3], outcome="infra_error")
    assert compare(a, b)["NavSR"].count == 3


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"episode": "other"}, "share no finished episode"),
        ({"scene_digest": "def"}, "not the same in both runs"),
        ({"category": "bed"}, "not the same in both runs"),
    ],
)
def test_runs_of_different_episodes_are_refused(base: Scores, change: dict, words: str) -> None:
    with pytest.raises(RecordError, match=words):
        compare([base], [replace(base, **change)])


@pytest.mark.parametrize(("name", "value"), [("start", Pose2D(x=1, z=1, yaw=0)), ("seed", 99), ("max_steps", 2)])
def test_an_episode_that_was_asked_otherwise_is_told_of(base: Scores, name: str, value: object) -> None:
    assert base.spec
    other = replace(base, spec=base.spec.model_copy(update={name: value}))
    with pytest.raises(RecordError, match=rf"episode one is not the same in both runs: {name} \("):
        compare([base], [other])


def test_an_episode_that_is_there_twice_cannot_be_paired(base: Scores) -> None:
    with pytest.raises(RecordError, match="twice"):
        compare([base, base], [base])


# -- arriving ----------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("pelvis", "left", "expected"),
    [
        (0.64, 0.99, True),  # Beside the couch.
        (0.64, 3.7, False),  # Behind a wall.
        (0.66, 0.5, False),  # With an outstretched arm.
    ],
)
def test_an_arrival_needs_the_pelvis_near_and_a_short_way_left(
    tmp_path: Path, pelvis: float, left: float, expected: bool
) -> None:
    place = (COUCH_BOX[0][0] - pelvis, 1.0, COUCH_BOX[0][2])
    steps = [step("walk", away=0.18, end=place, geodesic=left), step("stop", away=0.18, geodesic=left)]
    scores = score(rollout(tmp_path, steps, geodesic=5.0))
    assert (scores.nav, scores.arrive) == (True, expected)


def test_without_a_measured_way_nobody_knows_whether_a_body_arrived(tmp_path: Path) -> None:
    scores = score(rollout(tmp_path, [step("stop", away=0.1)]))
    assert (scores.nav, scores.arrive, np.isnan(scores.spl)) == (True, None, True)


def test_a_body_that_does_not_stop_has_not_arrived(tmp_path: Path) -> None:
    assert score(rollout(tmp_path, [step(away=0.1, geodesic=0.2)], geodesic=5.0)).arrive is False
