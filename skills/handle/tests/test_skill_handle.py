"""What the package is held to; tests/test_hands.py plays it on both engines."""

import pytest

from humanclaw import ProprioceptiveState, Reach
from humanclaw.body import rest_pose
from humanclaw.testing import check_skill
from humanclaw_skill_handle import pull, push


@pytest.mark.parametrize("skill", [pull, push], ids=lambda skill: skill.name)
def test_the_skill_keeps_the_contract(skill):
    check_skill(skill, engines=())


@pytest.mark.parametrize(("start", "cm", "end"), [(0.6, 20, 0.4), (0.4, 40, 0.22), (0.1, 10, 0.0)])
def test_a_pull_draws_the_hand_back_and_stops_it_before_the_chest(start, cm, end):
    body = ProprioceptiveState.of(Reach("left", (0.2, 1.1, start)).over(rest_pose()))
    assert pull.plan({"side": "left", "cm": cm}, body).at == pytest.approx((0.2, 1.1, end), abs=0.01)


def test_a_push_moves_it_away():
    body = ProprioceptiveState.of(Reach("left", (0.2, 1.1, 0.3)).over(rest_pose()))
    assert push.plan({"side": "left", "cm": 15}, body).at == pytest.approx((0.2, 1.1, 0.45), abs=0.01)
