"""Tests of measures on motion whose values are computed by hand."""

import numpy as np
import pytest

from humanclaw.body import JOINT_INDEX, Motion, rest_pose
from humanclaw_train.eval.measures import (
    Features,
    acceleration,
    beyond_limits,
    frechet,
    gait,
    joint_jerk,
    penetration,
    skate,
    slide,
    slower_toe,
)


def _sliding(metres_a_second: float, frames: int = 20) -> Motion:
    rest = rest_pose(frames)
    ahead = np.arange(frames) / 30 * metres_a_second
    return Motion(rest.root + np.stack([0 * ahead, 0 * ahead, ahead], 1), rest.rotations)


def test_a_body_that_slides_skates_at_its_own_speed():
    assert skate(_sliding(0.6).joints()) == pytest.approx(60)
    assert skate(_sliding(0.0).joints()) == 0


def test_a_foot_in_the_air_does_not_skate():
    joints = _sliding(0.6).joints() + [0.0, 0.2, 0.0]
    assert np.isnan(skate(joints))


def test_penetration_is_the_depth_of_the_lowest_sole():
    joints = _sliding(0.0).joints()
    assert penetration(joints - [0.0, 0.03, 0.0]) == pytest.approx(3)
    assert penetration(joints + [0.0, 0.03, 0.0]) == 0


def test_a_body_that_slides_on_one_foot_and_stands_does_not_skate():
    joints = _sliding(0.0).joints()
    joints[:, JOINT_INDEX["left_foot"], 2] += np.arange(20) / 30
    assert slower_toe(joints) == pytest.approx(0)
    assert slower_toe(_sliding(0.6).joints()) == pytest.approx(60)


def test_a_jump_is_an_acceleration_in_the_two_frames_that_see_it():
    joints = np.repeat(rest_pose().joints(), 8, 0)
    joints[4:] += [0.01, 0.0, 0.0]
    assert acceleration(joints) == pytest.approx([0, 0, 9, 9, 0, 0])


def test_cubic_motion_of_all_joints_has_its_jerk():
    seconds = np.arange(20) / 30
    joints = np.repeat(rest_pose().joints(), 20, 0) + np.outer(seconds**3, [0, 0, 1.0])[:, None]
    assert joint_jerk(joints) == pytest.approx(6, rel=1e-6)


def test_poses_with_a_leg_beyond_its_limits_are_counted():
    rotations = rest_pose(4).rotations
    rotations[0, JOINT_INDEX["left_ankle"], 0] = np.radians(-75)  # An ankle turns by 70 degrees, a knee by 160.
    rotations[1, JOINT_INDEX["left_knee"], 0] = np.radians(120)
    assert beyond_limits(rotations) == pytest.approx(25)


def test_the_frechet_distance_of_normals_is_of_means_and_deviations():
    random = np.random.default_rng(0)
    a = random.normal(0, 1, (200_000, 2))
    b = random.normal([1, 0], [1, 3], (200_000, 2))
    # |(1, 0)|^2 + (1 - 1)^2 + (3 - 1)^2
    assert frechet(a, b) == pytest.approx(5, abs=0.1)
    assert frechet(a, a) == pytest.approx(0, abs=1e-9)
    assert np.isnan(frechet(a[:3], b))


def test_real_motion_has_features_of_mean_zero_and_deviation_one():
    random = np.random.default_rng(0)
    rest = rest_pose(20)
    root = rest.root + random.normal(0, 0.1, (100, 20, 3))
    rotations = rest.rotations + random.normal(0, 0.1, (100, 20, 24, 3))
    values = Features.of(root, rotations)(root, rotations)
    assert values.shape == (100, 16)
    assert values.mean(0) == pytest.approx(0, abs=1e-9)
    assert values.std(0) == pytest.approx(1, abs=1e-9)


def test_the_gait_of_a_walk_is_what_its_joints_do():
    # Six metres in six seconds, four passings of the ankles a second, a sway of 2 x 3 cm, a bob of 2 x 2 cm and stiff
    # knees.
    frames = 181
    time = np.arange(frames) / 30
    swing = 0.3 * np.sin(2 * np.pi * 2 * time + 0.3)
    root = np.stack([0.03 * np.sin(2 * np.pi * 2 * time), 0.9 + 0.02 * np.sin(2 * np.pi * 4 * time), time], -1)
    rotations = np.zeros((frames, 24, 3))
    rotations[:, JOINT_INDEX["left_hip"], 0], rotations[:, JOINT_INDEX["right_hip"], 0] = -swing, swing
    rotations[:, [JOINT_INDEX["left_knee"], JOINT_INDEX["right_knee"]], 0] = 0.5
    walk = gait(Motion(root, rotations))
    assert walk["steps/s"] == pytest.approx(4.0, rel=0.02)
    assert (walk["sway cm"], walk["bob cm"]) == pytest.approx((6.0, 4.0), abs=0.5)
    assert walk["swing knee"] == pytest.approx(np.degrees(0.5), abs=0.1)
    # Shins hang half a radian behind thighs that swing by 0.3: heels rise to 0.8. Nothing else turns.
    assert walk["toe-off"] == pytest.approx(np.degrees(0.8), abs=1.0)
    assert [walk[angle] for angle in ("pelvis yaw", "shoulder yaw", "trunk")] == pytest.approx([0] * 3, abs=1e-6)


def test_a_standing_body_has_no_gait():
    assert gait(rest_pose(40)) is None


def test_the_slide_is_the_path_of_whichever_toe_is_slower():
    # Both toes go at 0.3 m/s for 19 frame steps: 19 cm.
    assert slide(_sliding(0.3).joints()) == pytest.approx(19.0, rel=1e-6)
    assert slide(rest_pose(20).joints()) == 0
