"""What the package is held to; tests/test_hands.py plays it on both engines."""

import pytest

from humanclaw import Grip, Reach
from humanclaw.testing import check_skill
from humanclaw_skill_hands import grasp, reach, release


@pytest.mark.parametrize("skill", [reach, grasp, release], ids=lambda skill: skill.name)
def test_the_skill_keeps_the_contract(skill):
    check_skill(skill, engines=())


def test_each_skill_names_the_hand_and_nothing_of_the_scene():
    assert reach.plan({"side": "left", "x_cm": 20, "y_cm": 110, "z_cm": 45}) == Reach("left", (0.2, 1.1, 0.45), 0.5)
    assert grasp.plan({"side": "right"}) == Grip("right")
    assert release.plan({"side": "right"}) == Grip("right", closed=False)
