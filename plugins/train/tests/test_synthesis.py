"""Tests of motion synthesis: exact commands, planted feet, no jumps, and no chunk that depends on the next command."""

from itertools import pairwise

import numpy as np
import pytest
from amass_tree import swinging, synthesize, trained_skills
from declared import STROLL

from humanclaw import HumanclawError
from humanclaw.body import (
    CHUNK,
    FUTURE,
    HISTORY,
    JOINT_INDEX,
    SOLE,
    STANDING_HEIGHT,
    TOE_SOLE,
    forward_kinematics,
    rest_pose,
    shoe_heights,
)
from humanclaw.skills import Draw, GaitParameters, Recipe, Skill, outcomes
from humanclaw_train.data.chunks import canonical
from humanclaw_train.eval.scenarios import depth
from humanclaw_train.mocap.clips import Clip
from humanclaw_train.synthesis.commands import Commands, Trained
from humanclaw_train.synthesis.profiles import Profiles, channel
from humanclaw_train.synthesis.synthesize import play
from humanclaw_train.synthesis.synthetic import sample_calls, synthetic_chunks

DEGREE = np.pi / 180
ANKLES = [JOINT_INDEX["left_ankle"], JOINT_INDEX["right_ankle"]]
TOES = [JOINT_INDEX["left_foot"], JOINT_INDEX["right_foot"]]


@pytest.fixture(scope="module")
def profiles():
    return swinging()


def compose(commands, seed):
    return synthesize([(trained_skills()[name], given) for name, given in commands], seed)


def _outcome(skill, chunk):
    return outcomes(skill.declaration.parameters, *canonical(chunk.root[None], chunk.rotations[None]))[0]


def _wanted(skill, given):
    return [given.get(param.name, 0.0) for param in trained_skills()[skill].declaration.parameters]


def _chunks(motion):
    return [motion[start : start + CHUNK] for start in range(0, len(motion) - CHUNK + 1, FUTURE)]


EXTREMES = [
    ("walk", {"x": 0.3, "z": 0.8, "yaw": -30 * DEGREE}),
    ("walk", {"x": -0.3, "z": 0.0, "yaw": 30 * DEGREE}),
    ("walk", {"x": 0.0, "z": 0.55, "yaw": 0.0}),
    ("side_step", {"x": 0.4}),
    ("side_step", {"x": -0.4}),
    ("step_back", {"z": 0.45}),
    ("step_back", {"z": 0.05}),
    ("turn_in_place", {"yaw": 75 * DEGREE}),
    ("turn_in_place", {"yaw": -75 * DEGREE}),
    ("climb_upstairs", {"h": 0.25, "d": 0.4}),
    ("climb_upstairs", {"h": 0.08, "d": 0.2}),
    ("walk_downstairs", {"h": 0.25, "d": 0.2}),
    ("walk_downstairs", {"h": 0.17, "d": 0.28}),
    ("sit_in_place", {"h": 0.2}),
    ("sit_in_place", {"h": 0.8}),
]


@pytest.mark.parametrize("before", [("stop", {}), ("walk", {"z": 0.6, "yaw": 0.2}), ("side_step", {"x": 0.3})])
@pytest.mark.parametrize("command", EXTREMES)
def test_a_command_moves_the_body_by_exactly_what_it_asks_for(before, command):
    skill, given = command
    last = _chunks(compose([before, before, command], 1))[-1]
    np.testing.assert_allclose(_outcome(trained_skills()[skill], last), _wanted(skill, given), atol=1e-3)


@pytest.mark.parametrize(
    "command",
    [
        ("walk", {"z": 0.2}),
        ("walk", {"z": 0.5, "yaw": 15 * DEGREE}),
        ("turn_in_place", {"yaw": 75 * DEGREE}),
        ("side_step", {"x": 0.3}),
    ],
)
def test_legs_keep_out_of_each_other(command):
    motion = compose([command] * 4, 1)
    assert depth(*forward_kinematics(motion.root, motion.rotations), "legs in each other").max() < 0.005


def test_an_unknown_skill_is_synthesised_from_its_declaration(profiles):
    recipe = Recipe(
        "stroll", gait=GaitParameters(exit=1.0), feet="stride", commands={"ahead": Draw(0.1, 0.5), "veer": Draw(0, 0)}
    )
    stroll = Trained(recipe, Skill.of_schema("stroll", STROLL))
    last = _chunks(synthesize([(stroll, {"ahead": 0.4, "veer": 0.2})] * 3, 1))[-1]
    np.testing.assert_allclose(_outcome(stroll, last), [0.2, 0.4], atol=1e-3)
    chunks = synthetic_chunks(profiles, [stroll], 4.0, 0)["stroll"]
    assert chunks.names.tolist() == ["veer", "ahead"]
    assert chunks.params[:, 1].min() > 0.09


@pytest.mark.parametrize("skill", ["walk", "side_step", "turn_in_place"])
def test_a_body_that_rises_from_a_seat_arrives_where_the_command_says(skill):
    given = {"walk": {"x": 0.05, "z": 0.5, "yaw": 0.1}, "side_step": {"x": 0.2}, "turn_in_place": {"yaw": 0.6}}[skill]
    motion = compose([("sit_in_place", {"h": 0.5}), (skill, given)], 0)
    np.testing.assert_allclose(_outcome(trained_skills()[skill], _chunks(motion)[-1]), _wanted(skill, given), atol=1e-3)
    assert motion.root[-1, 1] > 0.9


WANDERING = [
    ("walk", {"z": 0.5}), ("walk", {"z": 0.65, "yaw": 0.3}), ("walk", {"z": 0.6, "x": 0.1}), ("stop", {}),
    ("turn_in_place", {"yaw": 1.0}), ("side_step", {"x": -0.3}), ("step_back", {"z": 0.3}), ("step_back", {"z": 0.3}),
    ("sit_in_place", {"h": 0.5}), ("stop", {}), ("walk", {"z": 0.4}), ("stop", {}),
]  # fmt: skip


def test_a_foot_on_the_ground_does_not_slide():
    toes = compose(WANDERING, 2).joints()[:, TOES]
    down = np.abs(toes[..., 1] - TOE_SOLE) < 5e-4
    held = down[:-2] & down[1:-1] & down[2:]

    slid = np.linalg.norm(np.diff(toes[..., [0, 2]], axis=0)[1:], axis=-1)[held]

    assert held.mean() > 0.4
    assert slid.max() < 0.004


def test_one_foot_at_least_is_on_the_floor_and_none_is_below_it():
    motion = compose(WANDERING, 3)
    joints = motion.joints()
    soles = np.concatenate([joints[:, ANKLES, 1] - SOLE, joints[:, TOES, 1] - TOE_SOLE], 1)
    assert soles.min() > -0.004
    # A heel that lands is a shoe on the floor before its ankle is down.
    assert shoe_heights(*forward_kinematics(motion.root, motion.rotations)).min(1).max() < 0.004


def test_nothing_jumps_where_one_command_follows_another():
    skills = list(trained_skills().values())
    calls = sample_calls(skills, 1, 40, np.random.default_rng(4))
    series = [_command(skills[skill[0]], values[0]) for skill, values in calls]
    joints = compose(series, 5).joints()
    acceleration = np.linalg.norm(np.diff(joints, 2, axis=0), axis=-1).max(1) * 30**2  # At frames 1, 2, ...

    at = np.arange(HISTORY - 1, len(joints) - 1, FUTURE) - 1
    inside = np.delete(acceleration, np.concatenate([at, at + 1]).clip(0, len(acceleration) - 1))

    assert acceleration[at].max() < inside.max()
    assert np.linalg.norm(np.diff(joints, axis=0), axis=-1).max() < 0.4  # 12 m/s: a foot in a fast walk


def _command(skill, values):
    return skill.name, {param.name: float(x) for param, x in zip(skill.declaration.parameters, values, strict=False)}


def test_a_chunk_knows_nothing_of_the_command_after_it():
    start = [("walk", {"z": 0.5}), ("walk", {"z": 0.6})]
    motion = compose([*start, ("stop", {})], 6)
    other = compose([*start, ("turn_in_place", {"yaw": 1.0})], 6)
    same = HISTORY + 2 * FUTURE
    np.testing.assert_array_equal(motion.rotations[:same], other.rotations[:same])
    assert np.abs(motion.rotations[same:] - other.rotations[same:]).max() > 0.1


def _passings(motion):
    """Frames at which the ankles pass each other in a walk to +Z."""
    joints = motion.joints()
    lead = joints[:, ANKLES[0], 2] - joints[:, ANKLES[1], 2]
    return np.flatnonzero(lead[:-1] * lead[1:] < 0)


@pytest.mark.integration
@pytest.mark.parametrize(("z", "least", "most"), [(0.45, 1.3, 1.65), (0.6, 1.55, 1.85), (0.8, 1.75, 2.1)])
def test_steps_have_the_cadence_of_people_at_that_speed(z, least, most):
    # Real walks: 1.35 to 1.62 steps/s at 0.91 m/s, 1.68 to 1.81 at 1.2 to 1.3 m/s, 1.85 to 2.01 at 1.6 m/s.
    passings = [_passings(compose([("walk", {"z": z})] * 12, seed)[3 * FUTURE :]) for seed in range(8)]
    rates = [30 * (len(frames) - 1) / (frames[-1] - frames[0]) for frames in passings]
    assert least < np.median(rates) < most
    assert np.std(rates) > 0.02


@pytest.mark.integration
def test_a_walker_sways_and_bobs_as_people_do():
    walks = [compose([("walk", {"z": 0.5})] * 12, seed)[3 * FUTURE :].root for seed in range(8)]
    sway, bob = (np.median([np.ptp(walk[:, axis]) for walk in walks]) for axis in (0, 1))
    assert 0.035 < sway < 0.1
    assert 0.03 < bob < 0.065


def test_sitting_down_lowers_the_hips_behind_feet_that_stay():
    motion = compose([("sit_in_place", {"h": 0.5}), ("sit_in_place", {"h": 0.5}), ("stop", {})], 8)
    joints = motion.joints()
    feet = joints[:, ANKLES]
    assert np.abs(feet - feet[0])[HISTORY:].max() < 0.1
    assert 0.3 < motion.root[0, 2] - motion.root[-1, 2] < 0.5
    assert motion.root[HISTORY + FUTURE :, 1] == pytest.approx(0.5, abs=2e-3)
    hands = joints[-1, [JOINT_INDEX["left_wrist"], JOINT_INDEX["right_wrist"]]]
    knees = joints[-1, [JOINT_INDEX["left_knee"], JOINT_INDEX["right_knee"]]]
    assert np.linalg.norm(hands - knees, axis=-1).max() < 0.3


@pytest.mark.integration
@pytest.mark.parametrize("stops", [1, 2])
@pytest.mark.parametrize(("skill", "z"), [("walk", 0.5), ("walk", 0.1), ("step_back", 0.2)])
def test_of_two_standing_feet_the_one_with_further_to_go_sets_out(skill, z, stops):
    given = {"x": 0.0, "z": z, "yaw": 0.0} if skill == "walk" else {"z": z}
    before = [("walk", {"x": 0.0, "z": 0.1, "yaw": 0.0}), *[("stop", {})] * stops]
    start = HISTORY - 1 + len(before) * FUTURE
    toes = np.stack([compose([*before, (skill, given)], seed).joints()[:, TOES, 2] for seed in range(20)])
    left_ahead = (toes[:, start, 0] - toes[:, start, 1]) * (-1 if skill == "step_back" else 1)
    left_first = np.diff(np.abs(toes[:, start + 6] - toes[:, start]), axis=1)[:, 0] < 0
    apart = np.abs(left_ahead) > 0.01
    assert apart.sum() >= 10
    assert np.array_equal(left_first[apart], left_ahead[apart] < 0)


def test_stop_runs_a_walk_out_and_stands():
    motion = compose([("walk", {"z": 0.6})] * 3 + [("stop", {})] * 2, 10)
    end = motion.joints()[-FUTURE:]
    assert np.ptp(end[:, [0, *ANKLES]], axis=0).max() < 8e-3
    assert np.ptp(end[-1, ANKLES, 2]) < 0.1
    assert motion.root[-1, 1] == pytest.approx(STANDING_HEIGHT, abs=0.02)


@pytest.mark.parametrize(("skill", "sign"), [("climb_upstairs", 1), ("walk_downstairs", -1)])
def test_on_stairs_each_foot_stands_on_every_other_tread(skill, sign):
    motion = compose([(skill, {"h": 0.17, "d": 0.28})] * 4 + [("stop", {})], 11)
    toes = motion.joints()[:, TOES, 1] - TOE_SOLE
    still = np.abs(np.diff(toes, axis=0)) < 1e-4
    treads = [set(np.round(sign * foot[1:][now] / 0.17, 1)) for foot, now in zip(toes.T, still.T, strict=True)]
    assert treads[0] | treads[1] == {0.0, 1.0, 2.0, 3.0, 4.0}
    assert treads[0] & treads[1] == {0.0, 4.0}


def test_the_same_seed_gives_the_same_motion():
    motion, again, other = (compose(WANDERING, seed) for seed in (1, 1, 2))
    np.testing.assert_array_equal(motion.rotations, again.rotations)
    assert np.abs(motion.rotations - other.rotations).max() > 0.01


def test_knees_and_ankles_stay_within_what_a_body_can_do():
    rotations = compose(WANDERING, 12).rotations
    knees = rotations[:, [JOINT_INDEX["left_knee"], JOINT_INDEX["right_knee"]]]
    ankles = rotations[:, ANKLES]
    assert knees[..., 0].min() > 0.0
    assert knees[..., 0].max() < 145 * DEGREE
    assert np.abs(knees[..., 1:]).max() < 1e-6
    assert np.abs(ankles[..., 0]).max() < 50 * DEGREE


def test_every_change_of_skill_is_practised():
    series = sample_calls(list(trained_skills().values()), 200, 40, np.random.default_rng(0))
    pairs = {(a, b) for before, after in pairwise(series) for a, b in zip(before[0], after[0], strict=True)}
    assert len(pairs) == len(trained_skills()) ** 2


def test_short_steps_corners_and_long_runs_are_practised():
    names = [param.name for param in trained_skills()["walk"].declaration.parameters]
    ((_, first),) = sample_calls([trained_skills()["walk"]], 4000, 1, np.random.default_rng(0))
    straight = (np.delete(first, names.index("z"), 1) == 0).all(1)
    assert straight.mean() == pytest.approx(0.92 * (0.3 + 0.7 * (0.5 * 0.8) ** 2), abs=0.03)
    commands = trained_skills()["walk"].recipe.commands
    low, high = np.transpose([(commands[name].low, commands[name].high) for name in names])
    corner = ((first <= 0.75 * low) | (first >= 0.75 * high)).all(1)
    assert corner.mean() == pytest.approx(0.08, abs=0.015)
    series = sample_calls(list(trained_skills().values()), 1000, 16, np.random.default_rng(0))
    same = np.all([skill == series[0][0] for skill, _ in series], axis=0)
    assert same.mean() == pytest.approx(0.3, abs=3 * np.sqrt(0.3 * 0.7 / 1000))


def test_synthetic_chunks_fill_every_skill_and_say_what_they_are(profiles):
    chunks = synthetic_chunks(profiles, list(trained_skills().values()), 20.0, 3)
    assert {name: len(group) for name, group in chunks.items()} == dict.fromkeys(trained_skills(), 40) | {"base": 160}
    for name in ("walk", "side_step", "step_back", "turn_in_place", "sit_in_place"):
        group = chunks[name]
        assert not group.real.any()
        measured = [_outcome(trained_skills()[name], group.motion(i)) for i in range(len(group))]
        np.testing.assert_allclose(group.params, measured, atol=1e-3)
    half = len(chunks["side_step"]) // 2
    np.testing.assert_allclose(chunks["side_step"].params[half:], -chunks["side_step"].params[:half], atol=1e-6)


def test_profiles_are_read_off_real_walks(profiles):
    walk = compose([("walk", {"z": 0.575})] * 12, 0)[HISTORY + 3 * FUTURE :]
    idle = compose([("stop", {})] * 12, 0)

    estimate = Profiles.of([Clip("02_01", walk, None, "", ""), Clip("010_genuine", idle, None, "", "")])

    swing = estimate.gait[0][1, channel("left_shoulder", 1)]
    assert 0.2 < swing < 0.4  # 0.3, times the difference between bodies.
    np.testing.assert_allclose(estimate.stance, profiles.stance, atol=0.15)


def test_profiles_of_unknown_clips_are_read_off_their_walks(profiles):
    both = compose([("walk", {"z": 0.575})] * 12 + [("stop", {})] * 12, 0)

    estimate = Profiles.of([Clip("somebody", both, None, "", "")])

    np.testing.assert_allclose(estimate.stance, profiles.stance, atol=0.15)
    assert 60 < len(estimate.sway) < 12 * FUTURE


def test_profiles_without_a_walk_are_refused():
    with pytest.raises(HumanclawError, match="None of 1 clips shows a straight walk"):
        Profiles.of([Clip("somebody", rest_pose(80), None, "", "")])


def test_a_walker_brakes_where_no_travel_is_commanded():
    # From 1 m/s, a body that brakes evenly for half a second travels 25 cm.
    for command in (("stop", {}), ("turn_in_place", {"yaw": 0.8}), ("side_step", {"x": 0.3})):
        last = _chunks(compose([("walk", {"z": 0.5})] * 4 + [command], 3))[-1]
        moved = (last.root[-1] - last.root[HISTORY - 1])[2]
        assert 0.0 < moved < 0.15


@pytest.mark.parametrize(("skill", "share"), [("climb_upstairs", 0.92), ("walk_downstairs", 1.0)])
def test_swinging_feet_clear_the_edge_of_a_stair_by_a_centimetre(profiles, skill, share):
    random = np.random.default_rng(0)
    heights, depths = random.uniform(0.08, 0.25, 64), random.uniform(0.2, 0.4, 64)
    calls = Commands.of([trained_skills()[skill]], np.zeros(64, int), np.stack([heights, depths], 1))
    missing = play(profiles, [calls] * 4, random)[2]  # Shortfall from 2 cm.
    assert (missing < 0.01).mean() >= share
    assert (missing < 0.0025).mean() >= share - 0.07


@pytest.mark.integration
def test_chunks_whose_feet_cut_the_edge_of_a_stair_are_not_learnt(profiles):
    climbs = [trained_skills()["climb_upstairs"]]
    asked = synthetic_chunks(profiles, climbs, 40.0, 0)["climb_upstairs"]
    assert len(asked) == 80
    assert asked.params[:, 0].max() < 0.27


@pytest.mark.parametrize("share", [0.0, -1.0, 1e-9, float("nan"), float("inf")])
def test_a_recipe_that_is_never_drawn_is_refused(share):
    recipe = Recipe("stroll", gait=GaitParameters(), share=share)
    with pytest.raises(HumanclawError, match=r"recipe of stroll has share=.*, expected a share of \.01 or more"):
        Trained(recipe, Skill.of_schema("stroll", STROLL))


@pytest.mark.parametrize("repeats", [-3.0, 1.0, float("nan")])
def test_a_recipe_that_repeats_no_share_of_the_time_is_refused(repeats):
    recipe = Recipe("stroll", gait=GaitParameters(), repeats=repeats)
    with pytest.raises(HumanclawError, match=r"repeats from 0 to below 1"):
        Trained(recipe, Skill.of_schema("stroll", STROLL))
