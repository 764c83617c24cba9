"""Proprioception and touch, in words."""

import numpy as np
import pytest

from humanclaw.body import JOINT_INDEX, STANDING_HEIGHT
from humanclaw.errors import HumanclawError
from humanclaw.interfaces import Contact, Execution
from humanclaw.pose import Motion, rest_pose
from humanclaw.senses import check_senses, displacement, feeling, posture, touch

BEFORE = rest_pose(1)


def _after(forward: float = 0.0, left: float = 0.0, up: float = 0.0, turn: float = 0.0) -> Motion:
    """15 frames that end so far from the rest pose."""
    pose = rest_pose(15)
    share = np.linspace(0, 1, 15)[:, None]
    rotations = pose.rotations.copy()
    rotations[:, 0, 1] = np.radians(turn) * share[:, 0]
    return Motion(pose.root + share * [left, up, forward], rotations)


def _did(motion: Motion, *contacts: Contact) -> Execution:
    return Execution(motion, contacts, (), {})


def _contact(joint: str, group: str, height: float, frame: int = 0, movable: bool = False) -> Contact:
    return Contact(frame, joint, group, 7, movable, 0.001, height)  # type: ignore[arg-type]


def test_a_standing_body_feels_its_height_above_its_soles():
    assert posture(rest_pose(15)) == (
        f"You feel yourself standing upright: your hips are {100 * STANDING_HEIGHT:.0f} cm above your soles."
    )


def test_height_is_felt_from_the_soles_and_not_from_the_scene():
    upstairs = Motion(rest_pose(15).root + [0, 3.0, 0], rest_pose(15).rotations)
    assert posture(upstairs) == posture(rest_pose(15))


def test_knees_bent_by_ninety_degrees_are_felt_as_sitting():
    pose = rest_pose(1)
    rotations = pose.rotations.copy()
    for side in ("left", "right"):
        rotations[:, JOINT_INDEX[f"{side}_hip"], 0] = -np.pi / 2
        rotations[:, JOINT_INDEX[f"{side}_knee"], 0] = np.pi / 2
    assert "seated" in posture(Motion(pose.root, rotations))


def test_a_blocked_walk_is_felt_as_less_than_was_meant():
    text = displacement(BEFORE, [(_after(forward=0.4), _did(_after(forward=0.12)))])
    assert text == "Your limbs meant 40 cm forward; your body went 12 cm forward."


def test_displacements_are_in_the_frame_of_the_body():
    """Facing +X, a step along +Z is one to the right."""
    turned = Motion(BEFORE.root, BEFORE.rotations + np.eye(3)[1] * (np.arange(24) == 0)[:, None] * np.pi / 2)
    end = _after(forward=0.3)
    end = Motion(end.root, np.broadcast_to(turned.rotations, end.rotations.shape))
    assert "went 30 cm to the right." in displacement(turned, [(end, _did(end))])


def test_a_turn_is_told_in_degrees_and_standing_still_as_nowhere():
    still = displacement(BEFORE, [(_after(turn=30), _did(_after()))])
    assert still == "Your limbs meant a turn of 30 degrees to the left; your body went nowhere."


def test_touch_tells_part_side_time_and_whether_it_gave_way():
    contacts = [_contact("right_hand", "arm_hand", 0.9, frame, movable=True) for frame in range(6)]
    text = touch([_did(rest_pose(15), *contacts, _contact("pelvis", "torso", 0.5, 14))])
    assert text == "Something touched your hips for 0.0 s, your right arm or hand for 0.2 s (it gives way)."


def test_what_the_feet_stand_on_is_no_touch_and_what_the_toes_hit_is():
    floor = _contact("left_foot", "leg_foot", 0.0)
    riser = _contact("left_foot", "leg_foot", 0.05)
    assert touch([_did(rest_pose(15), floor)]) == "You touch nothing but what you stand on."
    assert "left leg or foot" in touch([_did(rest_pose(15), riser)])


@pytest.mark.parametrize(
    ("senses", "words"), [((), ()), (("body",), ("hips",)), (("body", "touch"), ("hips", "touch"))]
)
def test_only_the_senses_asked_for_speak(senses, words):
    text = feeling(check_senses(senses), BEFORE, [(_after(), _did(_after()))])
    assert bool(text) == bool(words)
    assert all(word in text for word in words)


def test_vision_is_always_on_and_an_unknown_sense_is_refused():
    assert check_senses(["touch"]) == ("vision", "touch")
    with pytest.raises(HumanclawError, match="smell"):
        check_senses(["smell"])
