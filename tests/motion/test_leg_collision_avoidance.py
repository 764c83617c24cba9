"""Shoes keep out of one another. A shoe is 9 cm wide and 28.5 cm long; feet keep 9.8 cm apart beside each other."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from humanclaw.body import JOINT_INDEX, rest_pose
from humanclaw.body.ik import Limb, solve
from humanclaw.motion import apart, widened
from humanclaw.motion.foot_locking import lock_feet
from humanclaw.motion.leg_collision_avoidance import knees_apart


def shift(x, z, yaw=0.0, side=1.0, over=0.0):
    """Of a foot at x to the left and z ahead of the other one, which faces ahead."""
    return apart(np.array([x, 0.0, z]), np.array(yaw), np.zeros(3), np.zeros(()), side, over)


@pytest.mark.parametrize(
    ("x", "z", "goes"), [(0.02, 0.0, 0.078), (0.1, 0.0, 0.0), (0.02, 0.4, 0.025), (0.05, 0.4, 0.0), (-0.05, 0.1, 0.148)]
)
def test_a_foot_goes_to_its_own_side_until_the_shoes_are_apart(x, z, goes):
    assert shift(x, z) == pytest.approx([goes, 0, 0])
    assert shift(-x, z, side=-1.0) == pytest.approx([-goes, 0, 0])


@pytest.mark.parametrize(("x", "goes"), [(0.02, 0.025), (0.05, 0.0)])
def test_a_shoe_over_the_other_one_keeps_its_lane_alone(x, goes):
    assert shift(x, 0.0, over=0.02) == pytest.approx([goes, 0, 0])


def test_feet_at_a_right_angle_need_room_for_the_length_of_a_shoe():
    """The left foot points left: its heel, 6 cm behind the ankle, would be in the right shoe 6 cm to the right."""
    moved = np.array([0.0, 0.0, 0.1]) + shift(0.0, 0.1, np.pi / 2)
    assert moved[0] - 0.06 > 0.045


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_feet_that_face_backwards_give_way_as_feet_that_face_ahead(side):
    """Both shoes turned by half a turn: one heading just below pi, the other just above -pi."""
    ahead = apart(np.array([0.02, 0.0, 0.05]), np.array(-0.03), np.zeros(3), np.array(0.03), side)
    behind = apart(np.array([-0.02, 0.0, -0.05]), np.array(np.pi - 0.03), np.zeros(3), np.array(0.03 - np.pi), side)
    assert behind == pytest.approx(-ahead, abs=1e-9)


def test_peaks_are_widened_and_not_lowered():
    sizes = np.zeros(15)
    sizes[7] = 0.03
    assert widened(sizes)[7] == pytest.approx(0.03)
    assert (np.diff(widened(sizes)[:8]) >= 0).all()


LEFT, RIGHT = JOINT_INDEX["left_ankle"], JOINT_INDEX["right_ankle"]


def test_a_foot_that_swings_into_the_other_one_gives_way():
    """Ankles are 18 cm apart at rest; the left one comes inwards by 13 cm, and 4.8 cm are lacking to 9.8."""
    swinging = rest_pose(20)
    swinging.rotations[5:, JOINT_INDEX["left_hip"], 2] = -np.arcsin(0.13 / 0.82) * np.sin(np.linspace(0, np.pi, 15))
    before, after = swinging[5:].joints(), lock_feet(swinging[:5], swinging[5:]).joints()
    assert (before[:, LEFT, 0] - before[:, RIGHT, 0]).min() == pytest.approx(0.05, abs=0.002)
    assert (after[:, LEFT, 0] - after[:, RIGHT, 0]).min() == pytest.approx(0.098, abs=0.002)
    assert after[:, RIGHT] == pytest.approx(before[:, RIGHT], abs=0.002)


def test_a_foot_in_the_other_one_gives_way_in_the_first_frame():
    swinging = rest_pose(20)
    swinging.rotations[5:, JOINT_INDEX["left_hip"], 2] = -np.arcsin(0.13 / 0.82) * np.linspace(1, 0, 15)
    after = lock_feet(swinging[:5], swinging[5:]).joints()
    assert (after[:, LEFT, 0] - after[:, RIGHT, 0]).min() == pytest.approx(0.098, abs=0.002)


def test_a_foot_lifted_over_the_other_one_goes_where_it_is_going():
    """A bent leg is .82 cos 0.7 = 0.63 m long and comes inwards by 13 cm, with its sole 13 cm over the other shoe."""
    lifted = rest_pose(20)
    lifts = np.sin(np.linspace(0, np.pi, 15))[:, None]
    inwards = Rotation.from_euler("z", -np.arcsin(0.13 / 0.63) * lifts)
    lifted.rotations[5:, JOINT_INDEX["left_hip"]] = (inwards * Rotation.from_euler("x", -0.7 * lifts)).as_rotvec()
    lifted.rotations[5:, [JOINT_INDEX["left_knee"], LEFT], 0] = lifts * [1.4, -0.7]
    after = lock_feet(lifted[:5], lifted[5:]).joints()
    assert (after[:, LEFT, 0] - after[:, RIGHT, 0]).min() == pytest.approx(0.05, abs=0.003)


def test_a_foot_gives_way_to_where_the_other_one_stands():
    """The right foot creeps outwards at 10 cm/s and is held; the left one comes to where it would have been."""
    swinging = rest_pose(20)
    swinging.rotations[5:, JOINT_INDEX["left_hip"], 2] = -np.arcsin(0.13 / 0.82) * np.sin(np.linspace(0, np.pi, 15))
    swinging.rotations[5:, JOINT_INDEX["right_hip"], 2] = -np.arcsin(0.05 / 0.82) * np.linspace(0, 1, 15)
    after = lock_feet(swinging[:5], swinging[5:]).joints()
    assert after[:, RIGHT] == pytest.approx(swinging[:5].joints()[-1:, RIGHT].repeat(15, 0), abs=0.002)
    assert (after[:, LEFT, 0] - after[:, RIGHT, 0]).min() == pytest.approx(0.098, abs=0.003)


def test_a_foot_gives_way_to_how_the_other_one_stands():
    """The right foot points inwards by 0.25 radians and is held so. The corner of its toes, .045 m to the left of and
    .225 m ahead of its ankle, is .045 cos 0.25 + .225 sin 0.25 = .099 m to the left; the left shoe begins .045 m right
    of its ankle."""
    swinging = rest_pose(20)
    swinging.rotations[:, JOINT_INDEX["right_hip"], 1] = 0.25
    swinging.rotations[5:, JOINT_INDEX["right_hip"], 1] -= np.linspace(0, 0.25, 15)
    swinging.rotations[5:, JOINT_INDEX["left_hip"], 2] = -np.arcsin(0.13 / 0.82) * np.sin(np.linspace(0, np.pi, 15))
    after = lock_feet(swinging[:5], swinging[5:]).joints()
    assert (after[:, LEFT, 0] - after[:, RIGHT, 0]).min() > 0.144


@pytest.mark.parametrize("outwards", [-0.1, 0.1])
def test_a_foot_with_toes_down_gives_way_to_no_foot_elsewhere(outwards):
    """The left shoe is tilted by 0.3 + 0.8 + 0.7 = 1.8 radians, and its ankle is .49 m behind and .18 m left of the
    right one. Its toes point backwards, but its left side is where it was. The body glides: no foot stands."""
    raised = rest_pose(20)
    raised.rotations[:, [JOINT_INDEX["left_hip"], JOINT_INDEX["left_knee"], LEFT], 0] = 0.3, 0.8, 0.7
    raised.rotations[:, LEFT, 1] = outwards
    raised.root[:, 2] += 0.05 * np.arange(20)
    before, after = raised[5:].joints(), lock_feet(raised[:5], raised[5:]).joints()
    assert after[:, [LEFT, RIGHT]] == pytest.approx(before[:, [LEFT, RIGHT]], abs=0.002)


HIPS = np.array([[[0.09, 0.9, 0.0]], [[-0.09, 0.9, 0.0]]])


def crossed(by):
    """Return thighs and shins (1, 3, 3) of both legs: knees bent by 50 degrees, ankles so far inwards."""
    legs = []
    for side in (1.0, -1.0):
        end = np.array([[side * (0.09 - by), 0.16, -0.05]])
        limb = Limb.leg("left" if side > 0 else "right")
        legs.append(solve(limb, np.array([[side * 0.09, 0.9, 0.0]]), end, np.array([[0.0, 0.0, 1.0]])))
    return legs


def gap(legs):
    """Return the least distance of the thighs' axes, from points, and both ankles (2, 1, 3)."""
    thighs = [
        hip[0] + np.linspace(0.02, 0.39, 200)[:, None] * -thigh[0, :, 1]
        for hip, (thigh, _) in zip(HIPS, legs, strict=True)
    ]
    ankles = [hip - 0.405 * thigh[..., 1] - 0.415 * shin[..., 1] for hip, (thigh, shin) in zip(HIPS, legs, strict=True)]
    return np.linalg.norm(thighs[0][:, None] - thighs[1], axis=-1).min(), np.array(ankles)


@pytest.mark.parametrize("by", [0.05, 0.07])
def test_knees_that_would_overlap_swivel_apart_while_feet_stay(by):
    legs = crossed(by)
    turned = [
        (swivel @ thigh, swivel @ shin) for swivel, (thigh, shin) in zip(knees_apart(HIPS, legs), legs, strict=True)
    ]
    before, after = gap(legs), gap(turned)
    assert before[0] < 0.14
    assert after[0] > 0.139
    assert after[1] == pytest.approx(before[1])


def test_legs_that_are_apart_do_not_swivel():
    assert knees_apart(HIPS, crossed(0.0)) == pytest.approx(np.broadcast_to(np.eye(3), (2, 1, 3, 3)))
