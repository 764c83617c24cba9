"""What the package is held to; tests/test_hands.py plays it on both engines."""

import numpy as np
import pytest

from humanclaw.body import JOINT_INDEX, rest_pose
from humanclaw.testing import check_skill
from humanclaw_skill_gaze import gaze


@pytest.mark.parametrize("skill", [gaze], ids=lambda skill: skill.name)
def test_the_skill_keeps_the_contract(skill):
    check_skill(skill, engines=())


@pytest.mark.parametrize(("yaw", "pitch"), [(60, -30), (-40, 20)])
def test_the_head_turns_and_the_eyes_rise_as_far_as_asked(yaw, pitch):
    aim = gaze.plan({"yaw_deg": yaw, "pitch_deg": pitch})
    motion = aim.over(rest_pose())
    assert np.degrees(motion.rotations[-1, [JOINT_INDEX["neck"], JOINT_INDEX["head"]], 1].sum()) == pytest.approx(
        yaw, abs=3
    )
    assert np.degrees(aim.pitch(motion)) == pytest.approx(pitch, abs=2)
