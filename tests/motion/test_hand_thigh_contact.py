"""Hands that rest on thighs lie on them, and not in them."""

import numpy as np
import pytest

from humanclaw.body import JOINT_INDEX, Motion, forward_kinematics, lay_hands, rest_pose, vector_from_matrix
from humanclaw.body.ik import Limb, solve
from humanclaw.motion.leg_ik import keep_feet
from humanclaw.motion.stand_up import rise

TIP = 0.085
"""From the joint of a hand to the tip of its fingers, metres."""


def seated(above: float, aside: float = 0.0, height: float = 0.52) -> Motion:
    """A seated body with wrists so many metres above the axes of its thighs, and so many to the outer side.

    Fingers go on as forearms do.
    """
    stance = rest_pose(3)
    motion = keep_feet(Motion(stance.root * 0 + [0.0, height, -0.4 * (0.95 - height) / 0.43], stance.rotations), stance)
    positions, turns = forward_kinematics(motion.root, motion.rotations)
    rotations = motion.rotations.copy()
    for side in ("left", "right"):
        hip, collar, shoulder, elbow = (
            JOINT_INDEX[f"{side}_{name}"] for name in ("hip", "collar", "shoulder", "elbow")
        )
        wrist = positions[:, hip] + turns[:, hip] @ np.array([aside if side == "left" else -aside, -0.25, above])
        upper, fore = solve(Limb.arm(side), positions[:, shoulder], wrist, np.array([0.0, -0.4, -1.0]))
        rotations[:, shoulder] = vector_from_matrix(np.swapaxes(turns[:, collar], -1, -2) @ upper)
        rotations[:, elbow] = vector_from_matrix(np.swapaxes(upper, -1, -2) @ fore)
    return Motion(motion.root, rotations)


def above_thigh(motion: Motion, side: str, joint: str, along: float = 0.0) -> np.ndarray:
    """How far a point of a limb is in front of the axis of its thigh, metres."""
    positions, turns = forward_kinematics(motion.root, motion.rotations)
    hip, index = JOINT_INDEX[f"{side}_hip"], JOINT_INDEX[f"{side}_{joint}"]
    point = positions[:, index] + turns[:, index] @ np.array([along if side == "left" else -along, 0.0, 0.0])
    return np.einsum("tji,tj->ti", turns[:, hip], point - positions[:, hip])[:, 2]


@pytest.mark.parametrize("side", ["left", "right"])
def test_fingers_that_point_into_a_thigh_are_laid_flat_on_it(side):
    before = seated(0.1)
    assert above_thigh(before, side, "hand", TIP).max() < 0.07
    after = lay_hands(before)
    # 7 cm of thigh, a margin of 1.2 and 3.6 of forearm under the wrist; the fingers lie level with it.
    assert above_thigh(after, side, "wrist") == pytest.approx(0.118, abs=0.003)
    assert above_thigh(after, side, "hand", TIP) == pytest.approx(0.118, abs=0.003)


def test_a_hand_that_lies_flat_stays_so():
    once = lay_hands(seated(0.1))
    np.testing.assert_allclose(lay_hands(once).joints(), once.joints(), atol=1e-3)


def test_hands_away_from_thighs_stay_as_they_are():
    for motion in (seated(0.35), rest_pose(15)):
        np.testing.assert_allclose(lay_hands(motion).joints(), motion.joints(), atol=1e-9)


@pytest.mark.parametrize("side", ["left", "right"])
def test_a_palm_beside_a_thigh_keeps_its_inner_edge_out_of_it(side):
    """Palms are 8 cm wide: at a wrist 9 cm to the side the inner edge is within the 7 cm of the thigh."""
    motion = lay_hands(seated(0.045, aside=0.09))
    positions, turns = forward_kinematics(motion.root, motion.rotations)
    hip, wrist = (JOINT_INDEX[f"{side}_{joint}"] for joint in ("hip", "wrist"))
    edges = np.array([[0.045, 0.0, z] for z in (-0.04, 0.04)]) * (1 if side == "left" else -1)
    world = positions[:, wrist, None] + np.einsum("tij,pj->tpi", turns[:, wrist], edges)
    local = np.einsum("tji,tpj->tpi", turns[:, hip], world - positions[:, None, hip])
    assert np.linalg.norm(local[..., [0, 2]], axis=-1).min() > 0.07


def test_hands_come_to_rest_gradually_as_a_body_sits_down():
    """Three millimetres a frame: no hand jumps where the correction begins."""
    bodies = [seated(0.05, height=height) for height in np.linspace(0.94, 0.6, 120)]
    moved = np.array([(lay_hands(body).joints() - body.joints())[0] for body in bodies])
    assert np.abs(moved[0]).max() < 1e-6
    assert np.abs(moved[-1]).max() > 0.02
    assert np.abs(np.diff(moved, axis=0)).max() < 0.01


@pytest.mark.parametrize("height", [0.33, 0.45, 0.52])
def test_hands_pass_beside_thighs_as_a_body_rises(height):
    """Forearms are 3.6 cm thick and thighs 7; hips are at 33 cm after sitting down on nothing."""
    risen = lay_hands(rise(lay_hands(seated(0.1, height=height)), rest_pose(5)))
    positions, turns = forward_kinematics(risen.root, risen.rotations)
    for side, sign in (("left", 1.0), ("right", -1.0)):
        hip, elbow = JOINT_INDEX[f"{side}_hip"], JOINT_INDEX[f"{side}_elbow"]
        thigh = positions[:, hip, None] + np.linspace(0.02, 0.39, 60)[:, None] * -turns[:, hip, None, :, 1]
        arm = positions[:, elbow, None] + np.linspace(0.01, 0.23, 40)[:, None] * sign * turns[:, elbow, None, :, 0]
        assert np.linalg.norm(thigh[:, :, None] - arm[:, None], axis=-1).min() > 0.105
