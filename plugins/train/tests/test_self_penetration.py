"""Tests of the depth of links in one another, worked out by hand."""

import numpy as np
import pytest

from humanclaw.body import JOINT_INDEX, Motion, forward_kinematics, rest_pose
from humanclaw_train.eval.scenarios import ARMS, PAIRS, depth, overlaps

LEGS = next(group for group in PAIRS if group != ARMS)


def in_each_other(motion: Motion, group: str) -> np.ndarray:
    return depth(*forward_kinematics(motion.root, motion.rotations), group)


def test_nothing_of_a_standing_body_is_inside_anything():
    assert max(in_each_other(rest_pose(), group).max() for group in PAIRS) < 0


def test_thighs_that_meet_at_the_knees_overlap_by_their_radii():
    """Thighs have a radius of 7 cm, and axes that end 1.5 cm above the knees, 0.33 cm from the middle each."""
    motion = rest_pose()
    turn = np.arcsin(0.09 / 0.405)  # Hips are 9 cm from the middle, thighs 40.5 cm long.
    for side, sign in (("left", -1.0), ("right", 1.0)):
        motion.rotations[:, JOINT_INDEX[f"{side}_hip"], 2] = sign * turn
        motion.rotations[:, JOINT_INDEX[f"{side}_knee"], 2] = -sign * turn
    assert in_each_other(motion, LEGS)[0] == pytest.approx(0.14 - 0.0067, abs=1e-4)


def test_the_share_counts_frames_and_the_depth_is_the_greatest():
    motion = rest_pose(15)
    motion.rotations[:3, JOINT_INDEX["left_hip"], 2] = -0.5
    row = overlaps(motion.root, motion.rotations)
    assert row[f"{LEGS}, % of frames"] == pytest.approx(100 * 3 / 15)
    assert row[f"{LEGS}, deepest cm"] > 1.0
