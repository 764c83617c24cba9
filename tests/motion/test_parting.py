"""Shoes keep out of one another. A shoe is 9 cm wide and 28.5 cm long; feet keep 9.8 cm apart beside each other."""

import numpy as np
import pytest

from humanclaw.body import JOINT_INDEX, rest_pose
from humanclaw.motion import apart, widened
from humanclaw.motion.foot_locking import lock_feet


def shift(x, z, yaw=0.0, side=1.0):
    """Of a foot at x to the left and z ahead of the other one, which faces ahead."""
    return apart(np.array([x, 0.0, z]), np.array(yaw), np.zeros(3), np.zeros(()), side)


@pytest.mark.parametrize(
    ("x", "z", "goes"), [(0.02, 0.0, 0.078), (0.1, 0.0, 0.0), (0.02, 0.4, 0.025), (0.05, 0.4, 0.0), (-0.05, 0.1, 0.148)]
)
def test_a_foot_goes_to_its_own_side_until_the_shoes_are_beside_each_other(x, z, goes):
    assert shift(x, z) == pytest.approx([goes, 0, 0])
    assert shift(-x, z, side=-1.0) == pytest.approx([-goes, 0, 0])


def test_feet_at_a_right_angle_need_room_for_the_length_of_a_shoe():
    """The left foot points left: its heel, 6 cm behind the ankle, would be in the right shoe 6 cm to the right."""
    moved = np.array([0.0, 0.0, 0.1]) + shift(0.0, 0.1, np.pi / 2)
    assert moved[0] - 0.06 > 0.045


def test_peaks_are_widened_and_not_lowered():
    sizes = np.zeros(15)
    sizes[7] = 0.03
    assert widened(sizes)[7] == pytest.approx(0.03)
    assert (np.diff(widened(sizes)[:8]) >= 0).all()


LEFT, RIGHT = JOINT_INDEX["left_ankle"], JOINT_INDEX["right_ankle"]


def test_a_foot_that_swings_into_the_other_one_gives_way_and_the_other_one_stands():
    """Ankles are 18 cm apart at rest; the left one comes inwards by 13 cm, and 4.8 cm are lacking to 9.8."""
    swinging = rest_pose(20)
    swinging.rotations[5:, JOINT_INDEX["left_hip"], 2] = -np.arcsin(0.13 / 0.82) * np.sin(np.linspace(0, np.pi, 15))
    before, after = swinging[5:].joints(), lock_feet(swinging[:5], swinging[5:]).joints()
    assert (before[:, LEFT, 0] - before[:, RIGHT, 0]).min() == pytest.approx(0.05, abs=0.002)
    assert (after[:, LEFT, 0] - after[:, RIGHT, 0]).min() == pytest.approx(0.09, abs=0.004)  # By 4 cm at most.
    assert after[:, RIGHT] == pytest.approx(before[:, RIGHT], abs=0.002)
