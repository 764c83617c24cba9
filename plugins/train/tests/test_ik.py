"""Tests of inverse kinematics: limbs arrive, knees bend forwards, feet roll without sliding."""

import numpy as np
import pytest

from humanclaw.body import SOLE, TOE_SOLE
from humanclaw.motion import TOE_BASE, Limb, solve
from humanclaw_train.synthesis.ik import HEEL, ankle_over, foot_orientation

AHEAD = np.array([0.0, 0.0, 1.0])


def _ends(limb, start, upper, lower):
    hinge = start + upper @ limb.upper
    return hinge, hinge + lower @ limb.lower


@pytest.mark.parametrize("limb", [Limb.leg("left"), Limb.leg("right"), Limb.arm("left"), Limb.arm("right")])
def test_a_limb_arrives_at_every_target_within_its_reach(limb):
    rng = np.random.default_rng(0)
    direction = rng.normal(size=(200, 3))
    distance = rng.uniform(0.05, 0.99, (200, 1)) * limb.reach
    start = rng.normal(size=(200, 3))
    end = start + distance * direction / np.linalg.norm(direction, axis=1, keepdims=True)

    _, arrived = _ends(limb, start, *solve(limb, start, end, AHEAD))

    np.testing.assert_allclose(arrived, end, atol=1e-9)


def test_a_leg_straightens_towards_a_target_out_of_reach():
    limb = Limb.leg("left")

    _, arrived = _ends(limb, np.zeros(3), *solve(limb, np.zeros(3), np.array([0.0, -2.0, 0.0]), AHEAD))

    np.testing.assert_allclose(arrived, [0.0, -limb.reach, 0.0], atol=1e-3)


@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize("ankle", [(0.0, -0.7, 0.0), (0.0, -0.6, 0.3), (0.0, -0.6, -0.3), (0.1, -0.4, 0.45)])
def test_knees_bend_forwards(side, ankle):
    limb = Limb.leg(side)
    knee, _ = _ends(limb, np.zeros(3), *solve(limb, np.zeros(3), np.array(ankle), np.array([0.0, 0.35, 0.94])))

    on_the_line = np.array(ankle) * np.dot(knee, ankle) / np.dot(ankle, ankle)

    assert (knee - on_the_line)[2] > 0.0


def test_orientations_are_rotations():
    limb = Limb.leg("right")
    ends = np.random.default_rng(1).normal(size=(50, 3)) * 0.4
    for matrix in solve(limb, np.zeros((50, 3)), ends, AHEAD):
        np.testing.assert_allclose(
            matrix @ np.swapaxes(matrix, -1, -2), np.broadcast_to(np.eye(3), (50, 3, 3)), atol=1e-9
        )
        np.testing.assert_allclose(np.linalg.det(matrix), 1.0, atol=1e-9)


def test_a_flat_foot_has_its_ankle_over_its_sole():
    ankle = ankle_over(np.array([1.0, 0.2, 3.0]), np.array(0.7), np.array(0.0))
    np.testing.assert_allclose(ankle, [1.0, 0.2 + SOLE, 3.0], atol=1e-12)


@pytest.mark.parametrize("yaw", [0.0, 1.0])
def test_the_toes_stay_on_the_ground_as_the_heel_rises(yaw):
    pitch = np.linspace(0.2, 1.0, 9)
    sole = np.zeros((9, 3))
    turn = np.full(9, yaw)

    toes = ankle_over(sole, turn, pitch) + foot_orientation(turn, pitch) @ TOE_BASE

    reach = TOE_BASE[2]
    np.testing.assert_allclose(toes, np.tile([reach * np.sin(yaw), TOE_SOLE, reach * np.cos(yaw)], (9, 1)), atol=1e-9)


def test_the_heel_stays_on_the_ground_as_the_toes_rise():
    pitch = np.linspace(-0.8, -0.2, 7)
    heel = ankle_over(np.zeros((7, 3)), np.zeros(7), pitch) + foot_orientation(np.zeros(7), pitch) @ HEEL
    np.testing.assert_allclose(heel, np.tile([0.0, 0.0, HEEL[2]], (7, 1)), atol=1e-9)


def test_the_ankle_rolls_over_a_flat_foot_without_a_kink():
    pitch = np.linspace(-0.4, 0.4, 801)
    ankle = ankle_over(np.zeros((801, 3)), np.zeros(801), pitch)

    velocity = np.diff(ankle, axis=0) / 0.001
    bend = np.abs(np.diff(velocity, axis=0)).max()

    assert bend < 0.01  # With a single pivot the velocity would jump by 0.19.
