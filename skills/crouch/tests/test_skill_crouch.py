"""What the package is held to; tests/test_hands.py plays it on both engines."""

import numpy as np
import pytest

from humanclaw import ProprioceptiveState
from humanclaw.body import JOINT_INDEX, centre_of_mass, forward_kinematics, rest_pose
from humanclaw.testing import check_skill
from humanclaw_skill_crouch import crouch

SOLES = [JOINT_INDEX[f"{side}_{part}"] for side in ("left", "right") for part in ("ankle", "foot")]


def played(height, pose):
    (part,) = crouch.planned({"h_cm": height}, ProprioceptiveState.of(pose))
    return part.over(pose)


def test_the_skill_keeps_the_contract():
    check_skill(crouch, engines=())


@pytest.mark.parametrize("height", [55, 70, 90])
def test_hips_come_to_the_height_over_feet_that_stay(height):
    motion = played(height, rest_pose())
    joints, turns = forward_kinematics(motion.root[-1], motion.rotations[-1])
    assert motion.root[-1, 1] == pytest.approx(height / 100, abs=0.005)
    assert np.allclose(joints[SOLES], rest_pose().joints()[0, SOLES], atol=0.005)
    assert centre_of_mass(joints, turns)[2] == pytest.approx(joints[SOLES, 2].mean(), abs=0.05)


def test_a_body_that_crouches_twice_and_stands_up_is_where_it_was():
    motion = rest_pose()
    for height in (55, 55, 90):
        motion = played(height, motion)
    assert motion.root[-1] == pytest.approx(rest_pose().root[0] * [1, 0, 1] + [0, 0.9, 0], abs=0.025)
