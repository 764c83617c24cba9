"""A body rises from a seat, a squat, the knees or the floor: over its feet, which stay, and into a stance."""

import numpy as np
import pytest

from humanclaw.body import (
    JOINT_INDEX,
    Motion,
    centre_of_mass,
    forward_kinematics,
    matrix_from_vector,
    rest_pose,
    shoe_heights,
    vector_from_matrix,
)
from humanclaw.motion.leg_ik import keep_feet
from humanclaw.motion.stand_up import is_down, rise

STANCE = rest_pose()
ANKLES = [JOINT_INDEX["left_ankle"], JOINT_INDEX["right_ankle"]]


def seated(height: float, back: float) -> Motion:
    """Hips lowered and moved back over standing feet."""
    return keep_feet(Motion(STANCE.root * 0 + [0.0, height, -back], STANCE.rotations), STANCE)


def bent(height: float, pitch: float = 0.0, **joints: float) -> Motion:
    """The rest pose with joints turned about X by degrees, both sides alike."""
    rotations = STANCE.rotations.copy()
    rotations[0, 0] = np.radians([pitch, 0.0, 0.0])
    for name, angle in joints.items():
        for side in ("left", "right"):
            rotations[0, JOINT_INDEX[f"{side}_{name}"]] = np.radians([angle, 0.0, 0.0])
    return Motion(STANCE.root * 0 + [0.0, height, 0.0], rotations)


KNEELING = bent(0.5, hip=0, knee=90)
ON_THE_FLOOR = bent(0.15, hip=-85, ankle=-10)
LYING = bent(0.15, pitch=-90)
LOW = {"seat": seated(0.5, 0.4), "squat": seated(0.25, 0.2), "knees": KNEELING, "floor": ON_THE_FLOOR, "back": LYING}


@pytest.mark.parametrize("pose", LOW.values(), ids=LOW)
def test_a_body_that_is_down_ends_upright_after_whole_half_seconds(pose):
    assert is_down(pose)
    risen = rise(pose, STANCE)
    assert len(risen) % 15 == 0
    assert len(risen) <= 60
    (joints,), (turns,) = forward_kinematics(risen.root[-1:], risen.rotations[-1:])
    assert risen.root[-1, 1] - shoe_heights(joints, turns).max() == pytest.approx(0.965, abs=0.01)
    assert turns[0, 1, 1] == pytest.approx(1.0, abs=1e-3)
    assert turns[ANKLES, 1, 1] == pytest.approx(1.0, abs=1e-3)
    assert not is_down(risen)


@pytest.mark.parametrize("pose", LOW.values(), ids=LOW)
def test_it_moves_without_a_jump_and_comes_to_rest(pose):
    steps = np.linalg.norm(np.diff(pose.then(rise(pose, STANCE)).joints(), axis=0), axis=-1)
    assert steps.max() < 0.2
    assert steps[-1].max() < 0.03


def test_feet_that_stand_stay_where_they_are():
    pose = seated(0.5, 0.4)
    ankles = pose.then(rise(pose, STANCE)).joints()[:, ANKLES]
    np.testing.assert_allclose(ankles, np.broadcast_to(ankles[0], ankles.shape), atol=0.003)


def test_a_raised_heel_comes_down_while_the_toes_stay():
    pose = seated(0.6, 0.4)
    toes_down = matrix_from_vector(np.array([0.5, 0.0, 0.0]))
    rotations = pose.rotations.copy()
    for ankle in ANKLES:
        rotations[0, ankle] = vector_from_matrix(matrix_from_vector(pose.rotations[0, ankle]) @ toes_down)
    tilted = Motion(pose.root, rotations)
    toes = tilted.then(rise(tilted, STANCE)).joints()[:, [JOINT_INDEX["left_foot"], JOINT_INDEX["right_foot"]]]
    assert np.ptp(toes[..., [0, 2]], axis=0).max() < 0.01


@pytest.mark.parametrize("height", [0.35, 0.5, 0.65])
def test_the_hips_leave_a_seat_only_when_the_weight_is_over_the_feet(height):
    risen = rise(seated(height, 0.4), STANCE)
    joints, turns = forward_kinematics(risen.root, risen.rotations)
    ahead_of_heels = centre_of_mass(joints, turns)[:, 2] - (joints[:, ANKLES, 2].mean(1) - 0.06)
    up = risen.root[:, 1] > height + 0.01
    assert ahead_of_heels[up].min() > 0.03
    assert ahead_of_heels[up].max() < 0.2


def test_it_rises_where_the_body_is_and_faces():
    pose = seated(0.5, 0.4)
    turn = np.array([0.0, 1.0, 0.0])
    rotations = pose.rotations.copy()
    rotations[:, 0] = turn
    moved = Motion(pose.root @ matrix_from_vector(turn).T + [3.0, 2.0, 1.0], rotations)
    here, there = rise(pose, STANCE), rise(moved, STANCE)
    np.testing.assert_allclose(there.joints(), here.joints() @ matrix_from_vector(turn).T + [3.0, 2.0, 1.0], atol=1e-6)


def test_one_who_stands_or_bends_the_knees_is_not_down():
    assert not is_down(STANCE)
    assert not is_down(seated(0.8, 0.1))


def test_the_height_of_a_shoe_is_that_of_its_lowest_corner():
    """Toes that point down by 30 degrees: the tip is 22.5 cm ahead of the ankle and 7.5 below it when level."""
    motion = rest_pose(3)
    rotations = motion.rotations.copy()
    rotations[1, ANKLES[0], 0] = np.radians(30)
    heights = shoe_heights(*forward_kinematics(motion.root, rotations))
    assert heights[[0, 2]] == pytest.approx(0, abs=1e-9)
    assert heights[1] == pytest.approx([0.075 - 0.225 * 0.5 - 0.075 * np.sqrt(0.75), 0.0], abs=1e-9)
