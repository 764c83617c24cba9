"""What nobody commands does not add up: joints that carry no weight come back to their usual pose, slowly."""

import numpy as np
import pytest

from humanclaw import Motion
from humanclaw.body import FUTURE, HISTORY, JOINT_INDEX
from humanclaw.motion import DiTGenerator
from humanclaw.motion.drift_correction import correct_drift

USUAL = np.zeros((24, 3))


def held(joint: str, axis: int, angle: float, frames: int) -> Motion:
    rotations = np.zeros((frames, 24, 3))
    rotations[:, JOINT_INDEX[joint], axis] = angle
    return Motion(np.tile([0.0, 0.9, 0.0], (frames, 1)), rotations)


def after(joint: str, axis: int, angle: float, calls: int = 1) -> float:
    """Where a joint is that a model leaves where its history has it, after some calls."""
    for _ in range(calls):
        future = correct_drift(held(joint, axis, angle, FUTURE), USUAL)
        angle = float(future.rotations[-1, JOINT_INDEX[joint], axis])
    return angle


def test_a_wrist_that_is_bent_by_error_comes_back_by_a_tenth_a_call():
    assert after("left_wrist", 0, 0.2) == pytest.approx(0.18)
    assert after("left_wrist", 0, 0.2, calls=20) == pytest.approx(0.2 * 0.9**20)


def test_it_comes_back_without_a_jump_before_the_next_history():
    future = correct_drift(held("head", 0, 0.2, FUTURE), USUAL)
    path = future.rotations[:, JOINT_INDEX["head"], 0]
    assert np.abs(np.diff(path, prepend=0.2)).max() < 0.004
    assert path[-HISTORY:] == pytest.approx(0.18)


def test_a_swing_of_the_trunk_never_grows():
    swing = held("spine1", 1, 1.0, FUTURE)
    swing.rotations[:, JOINT_INDEX["spine1"], 1] = 0.2 * np.cos(np.pi * np.arange(FUTURE) / 10)
    corrected = correct_drift(swing, USUAL).rotations[:, JOINT_INDEX["spine1"], 1]
    assert (np.abs(corrected) <= np.abs(swing.rotations[:, JOINT_INDEX["spine1"], 1])).all()
    assert corrected[10] == pytest.approx(-0.2 + 0.02)


def test_an_arm_that_is_held_up_sinks_by_two_degrees_at_most():
    assert np.degrees(2.0 - after("left_shoulder", 2, 2.0)) == pytest.approx(2.0, abs=0.01)


def test_a_foot_turned_in_the_air_comes_back_by_a_fifth_a_call():
    assert after("left_ankle", 1, 1.0) == pytest.approx(0.8)
    assert after("right_ankle", 1, -1.0, calls=20) == pytest.approx(-(0.8**20))


def test_an_ankle_turns_by_68_degrees_and_is_free_up_to_55():
    assert after("left_ankle", 0, np.radians(54)) == pytest.approx(np.radians(54))
    assert np.degrees(after("right_ankle", 0, np.radians(70))) == pytest.approx(55 + 13 * np.tanh(15 / 13))
    assert np.degrees(after("left_ankle", 0, -np.radians(100))) == pytest.approx(-67.97, abs=0.01)


def test_a_foot_that_begins_far_beyond_is_not_thrown():
    path = correct_drift(held("left_ankle", 0, np.radians(170), FUTURE), USUAL).rotations[
        :, JOINT_INDEX["left_ankle"], 0
    ]
    assert np.abs(np.diff(path, prepend=np.radians(170))).max() < np.radians(40)


def test_a_knee_is_a_hinge_that_loses_two_degrees_of_twist_a_call():
    assert after("left_knee", 2, 0.02) == pytest.approx(0.0)
    assert after("right_knee", 1, -0.2) == pytest.approx(-0.165)
    assert after("left_knee", 0, -0.05) == 0.0


def test_the_foot_of_a_knee_that_straightens_stays_where_it_is():
    """A leg of 0.82 m that was bent by 0.2 rad is 4 mm longer when straight. The knee alone would move it by 8 cm."""
    bent = held("left_knee", 0, -0.2, FUTURE)
    moved = (correct_drift(bent, USUAL).joints() - bent.joints())[
        :, [JOINT_INDEX["left_ankle"], JOINT_INDEX["left_foot"]]
    ]
    assert np.linalg.norm(moved, axis=-1).max() < 0.005


@pytest.mark.parametrize(("joint", "axis"), [("pelvis", 0), ("left_hip", 2), ("right_knee", 0), ("left_ankle", 0)])
def test_what_carries_weight_stays_where_the_model_has_it(joint, axis):
    assert after(joint, axis, 0.2) == 0.2


def test_the_usual_pose_is_that_of_the_data():
    usual = DiTGenerator.load().base.usual
    assert usual.shape == (24, 3)
    assert usual[0] == pytest.approx(0)
    assert 10 < np.degrees(usual[JOINT_INDEX["left_knee"], 0]) < 60  # people who mostly move
