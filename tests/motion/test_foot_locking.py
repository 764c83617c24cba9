"""Standing feet are held, and nothing else is touched."""

import numpy as np
import pytest

from humanclaw.body import JOINT_INDEX, SOLE, TOE_SOLE, Motion, forward_kinematics, rest_pose, shoe_heights, smoothstep
from humanclaw.motion.foot_locking import lock_feet
from humanclaw.motion.leg_ik import ANKLES, solve_legs

LEFT_TOE, LEFT_ANKLE = JOINT_INDEX["left_foot"], JOINT_INDEX["left_ankle"]
LEGS = [JOINT_INDEX[f"{side}_{part}"] for side in ("left", "right") for part in ("hip", "knee", "ankle")]


def _standing(frames: int) -> Motion:
    """Knees a little bent, soles level on the floor."""
    pose = rest_pose(frames)
    rotations = pose.rotations.copy()
    for side in ("left", "right"):
        for part, angle in (("hip", -0.2), ("knee", 0.4), ("ankle", -0.2)):
            rotations[:, JOINT_INDEX[f"{side}_{part}"], 0] = angle
    sunk = Motion(pose.root, rotations)
    return Motion(pose.root - [0, sunk.joints()[0, LEFT_TOE, 1] - TOE_SOLE, 0], rotations)


def _lowest(motion: Motion) -> float:
    """The lowest corner of both shoes."""
    return float(shoe_heights(*forward_kinematics(motion.root, motion.rotations)).min())


def _moved(motion: Motion, per_frame: tuple[float, float, float]) -> Motion:
    return Motion(motion.root + np.arange(1, len(motion) + 1)[:, None] * np.array(per_frame), motion.rotations)


def test_a_body_that_creeps_over_its_feet_keeps_them_where_they_stand():
    history, creeping = _standing(5), _moved(_standing(15), (0.0, 0.0, 0.005))  # 15 cm/s
    feet = lock_feet(history, creeping).joints()[:, [LEFT_ANKLE, LEFT_TOE]]
    assert np.abs(feet - history.joints()[-1, [LEFT_ANKLE, LEFT_TOE]]).max() < 1e-3


def test_the_pelvis_and_all_above_it_stay_as_the_model_wrote_them():
    creeping = _moved(_standing(15), (0.003, 0.0, 0.003))
    result = lock_feet(_standing(5), creeping)
    others = [joint for joint in range(24) if joint not in LEGS]
    assert np.array_equal(result.root, creeping.root)
    assert np.array_equal(result.rotations[:, others], creeping.rotations[:, others])


def test_a_body_that_stands_still_is_left_alone():
    standing = _standing(15)
    assert lock_feet(_standing(5), standing).rotations == pytest.approx(standing.rotations, abs=1e-6)


def test_a_foot_in_flight_is_left_alone():
    """The whole body glides at 1.5 m/s: no foot stands."""
    gliding = _moved(_standing(15), (0.0, 0.0, 0.05))
    history = _moved(Motion(_standing(5).root - [0, 0, 0.25], _standing(5).rotations), (0.0, 0.0, 0.05))
    assert lock_feet(history, gliding).rotations == pytest.approx(gliding.rotations, abs=1e-6)


def test_a_foot_that_stands_with_raised_toes_is_laid_level():
    def askew(motion: Motion) -> Motion:
        rotations = motion.rotations.copy()
        rotations[:, LEFT_ANKLE, 0] -= 0.15
        return Motion(motion.root, rotations)

    result = lock_feet(askew(_standing(5)), askew(_standing(15)))
    positions, turns = forward_kinematics(result.root, result.rotations)
    assert turns[-1, LEFT_ANKLE, 1, 1] == pytest.approx(1.0, abs=1e-4)
    heel = _lowest(askew(_standing(1)))  # The floor is where the lowest corner of the history stands.
    assert positions[-1, LEFT_ANKLE, 1] == pytest.approx(SOLE + heel, abs=1e-3)
    first = np.abs(result.rotations[0] - askew(_standing(1)).rotations[0]).max()
    assert first < 0.02  # laid down, not thrown


def test_a_heel_below_the_floor_is_lifted():
    """Toes rise by 0.5 radians: the heel, 6 cm behind the ankle, sinks by 2 cm."""
    tilted = _standing(15)
    tilted.rotations[:, LEFT_ANKLE, 0] -= 0.5 * smoothstep(np.arange(15) / 10)
    result = lock_feet(_standing(5), tilted)
    assert shoe_heights(*forward_kinematics(tilted.root, tilted.rotations))[:, 0].min() < -0.01
    assert shoe_heights(*forward_kinematics(result.root, result.rotations)).min() > -0.002


def test_a_shoe_that_would_drag_over_the_floor_swings_over_it():
    """The left foot glides ahead at 1.2 m/s, its sole on the floor."""
    pose = _standing(20)
    feet = pose.joints()[:, list(ANKLES)]
    feet[:, 0, 2] += np.clip(np.arange(20) - 7, 0, 10) * 0.04 - 0.2
    dragging = solve_legs(pose, feet, np.broadcast_to(np.eye(3), (20, 2, 3, 3)))
    result = lock_feet(dragging[:5], dragging[5:])
    left, right = shoe_heights(*forward_kinematics(result.root, result.rotations)).T
    assert left[4:9] == pytest.approx(0.006, abs=1e-3)
    assert right == pytest.approx(0.0, abs=1e-3)


@pytest.mark.parametrize("high", [0.005, 0.01])
def test_shoes_that_hover_come_down_and_the_pelvis_stays(high):
    """In half-physics the body would fall by the gap instead."""
    rising = Motion(
        _standing(15).root + np.minimum(np.arange(1, 16) / 6, 1)[:, None] * [0, high, 0.5], _standing(15).rotations
    )
    result = lock_feet(_standing(5), rising)
    assert _lowest(rising[-1:]) == pytest.approx(high, abs=1e-3)
    assert _lowest(result[-1:]) == pytest.approx(0.0, abs=1e-3)
    assert result.root == pytest.approx(rising.root)


def test_two_shoes_that_go_up_a_stair_stay_up():
    climbing = Motion(_standing(15).root + np.arange(1, 16)[:, None] / 15 * [0, 0.15, 0.5], _standing(15).rotations)
    assert _lowest(lock_feet(_standing(5), climbing)[-1:]) == pytest.approx(0.15, abs=1e-3)


def test_a_foot_on_a_stair_stays_on_its_stair():
    """Thirty centimetres above the floor of the history is no mistake to be put right."""
    history = _standing(5)
    above = Motion(_standing(15).root + [0, 0.3, 0], _standing(15).rotations)
    assert lock_feet(history, above).joints()[5:, LEFT_TOE, 1] == pytest.approx(0.3 + TOE_SOLE, abs=1e-3)


def test_a_leg_too_short_for_its_stance_lets_the_foot_follow():
    """At 21 cm/s the body outruns its feet: the knee must not lock, nor the foot be torn off."""
    fleeing = _moved(_standing(15), (0.0, 0.012, 0.007))
    joints = lock_feet(_standing(5), fleeing).joints()
    hip = joints[:, JOINT_INDEX["left_hip"]]
    assert np.linalg.norm(joints[:, LEFT_ANKLE] - hip, axis=-1).max() < 0.82
    assert np.isfinite(joints).all()
