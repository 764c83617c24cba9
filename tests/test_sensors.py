"""Proprioception and touch, in words."""

import numpy as np
import pytest
from engines import DEFAULT

from humanclaw import Backends, Body, Chunk, Decision, Episode
from humanclaw.body import JOINT_INDEX, STANDING_HEIGHT, Motion, rest_pose
from humanclaw.checks.fakes import ScriptedAgent
from humanclaw.episodes.backends import check_sensors
from humanclaw.episodes.falls import Descent
from humanclaw.episodes.sensors import proprioception, tactile
from humanclaw.errors import HumanclawError
from humanclaw.records import Answer, Feedback, StepRecord, Touch, free_episode
from humanclaw.skills import Call
from humanclaw.world import Contact, Execution, SceneBuilder, person_id

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
    return Contact((frame,), joint, group, 7, movable, 0.001, height)  # type: ignore[arg-type]


def _felt(motion: Motion) -> str:
    return str(proprioception(BEFORE, [(motion, _did(motion))]))


def test_a_standing_body_feels_its_height_above_its_soles():
    assert _felt(rest_pose(15)).startswith(
        f"You feel yourself standing upright: your hips are {100 * STANDING_HEIGHT:.0f} cm above your soles."
    )


def _falling(by: float, *touched: int, begun: float = 0.0) -> Chunk:
    """Half a second in which the pelvis sinks evenly by so much, with the ground underfoot in some frames."""
    sinking = Motion(_after(up=-by).root - [0, begun, 0], _after().rotations)
    return Chunk(sinking, _did(sinking, *(_contact("left_foot", "leg_foot", 0.0, frame) for frame in touched)))


def _standing() -> Descent:
    return Descent(float(BEFORE.root[0, 1]))


@pytest.mark.parametrize(("metres", "touched", "fell"), [(1.4, (2, 9), 0.7), (1.4, range(15), 0.0), (0.6, (2, 9), 0.0)])
def test_a_fall_is_a_drop_of_half_a_metre_between_two_contacts(metres, touched, fell):
    """1.4 m in 14 frames are 10 cm a frame: 70 cm from frame 2 to frame 9."""
    assert _standing().after([_falling(metres, *touched)]).fall == pytest.approx(fell)


def test_a_fall_that_goes_on_in_the_next_call_has_its_whole_depth():
    """It leaves the ground 40 cm above the end of the first call, and lands 30 cm below it."""
    first = _standing().after([_falling(1.4, *range(11))])
    second = first.after([_falling(1.4, *range(3, 15), begun=1.4)])
    assert (first.fall, first.falling) == (0.0, False)
    assert (second.fall, second.falling) == (pytest.approx(0.4 + 0.3), False)


def test_what_falls_with_the_body_in_its_hand_bears_nobody():
    motion = _after(up=-1.4)
    cup = [_contact("left_hand", "arm_hand", 0.0, frame, movable=True) for frame in range(15)]
    assert _standing().after([Chunk(motion, Execution(motion, tuple(cup), (), {}, {"left": 7}))]).fall == 1.4


@pytest.mark.parametrize("height", [0.6, 1.0, 3.0, 6.0])
def test_everybody_is_told_of_one_fall_however_many_calls_it_takes(height):
    builder = SceneBuilder.on_floor()
    builder.box("platform", (2, height, 1.6), (0, 0, 0))
    scene = builder.scene(floor=height)
    answers, calls = [], [Call("walk", {"x_cm": 0, "z_cm": 80, "yaw_deg": 0})] * 6
    with Body(scene, backends=Backends(DEFAULT, renderer="raster")) as body:
        for call in calls:
            answers.append(body.call(call.skill, **call.params).feedback)
        with Episode(body, free_episode("Walk.", scene), ScriptedAgent([])) as episode:
            steps = [episode.submit(Decision((call,))) for call in calls]
    landed = [feedback.fall for feedback in answers if feedback.fall and not feedback.falling]
    assert landed == pytest.approx([height], abs=0.1)
    assert f"You fell {landed[0]:.1f} m." in " ".join(map(str, answers))
    assert [(step.fall, step.falling) for step in steps] == [(feedback.fall, feedback.falling) for feedback in answers]
    assert [step.feedback.fall for step in steps] == [feedback.fall for feedback in answers]


def test_a_body_in_the_air_is_told_that_it_is_falling():
    done = StepRecord(step=0, status="executed", attempts=(), call=Call("walk", {}), fall=2.94, falling=True)
    assert "You are falling, so far 2.9 m." in str(done.feedback)


def test_height_is_felt_from_the_soles_and_not_from_the_scene():
    upstairs = Motion(rest_pose(15).root + [0, 3.0, 0], rest_pose(15).rotations)
    sensed = proprioception(upstairs[-1:], [(upstairs, _did(upstairs))])
    assert sensed.hip_height == pytest.approx(STANDING_HEIGHT)


def test_knees_bent_by_ninety_degrees_are_felt_as_sitting():
    pose = rest_pose(1)
    rotations = pose.rotations.copy()
    for side in ("left", "right"):
        rotations[:, JOINT_INDEX[f"{side}_hip"], 0] = -np.pi / 2
        rotations[:, JOINT_INDEX[f"{side}_knee"], 0] = np.pi / 2
    assert "seated" in _felt(Motion(pose.root, rotations))


def test_a_blocked_walk_is_felt_as_less_than_was_meant():
    sensed = proprioception(BEFORE, [(_after(forward=0.4), _did(_after(forward=0.12)))])
    assert (sensed.intended.forward, sensed.moved.forward) == (pytest.approx(0.4), pytest.approx(0.12))
    assert str(sensed).endswith("Intended movement: 40 cm forward. Actual movement: 12 cm forward.")


def test_displacements_are_in_the_frame_of_the_body():
    """Facing +X, a step along +Z is one to the right."""
    turned = Motion(BEFORE.root, BEFORE.rotations + np.eye(3)[1] * (np.arange(24) == 0)[:, None] * np.pi / 2)
    end = _after(forward=0.3)
    end = Motion(end.root, np.broadcast_to(turned.rotations, end.rotations.shape))
    moved = proprioception(turned, [(end, _did(end))]).moved
    assert (moved.left, moved.forward) == (pytest.approx(-0.3), pytest.approx(0, abs=1e-9))
    assert str(moved) == "30 cm to the right"


def test_a_turn_is_told_in_degrees_and_standing_still_as_nowhere():
    sensed = str(proprioception(BEFORE, [(_after(turn=30), _did(_after()))]))
    assert sensed.endswith("Intended movement: a turn of 30 degrees to the left. Actual movement: none.")


def test_touch_tells_part_side_time_and_whether_it_gave_way():
    hand = Contact(tuple(range(6)), "right_hand", "arm_hand", 7, True, 0.001, 0.9)
    sensed = tactile([_did(rest_pose(15), hand, _contact("pelvis", "torso", 0.5, 14))])
    assert sensed == (Touch("hips", 1, False), Touch("right arm or hand", 6, True))
    words = "Something touched your hips for 0.0 s, your right arm or hand for 0.2 s (it gives way)."
    assert Feedback(Call("walk"), tactile=sensed).sensor_readings == words


@pytest.mark.parametrize(
    ("failed", "words"), [((), "failed."), ((Answer("short", False, "40 cm at most"),), "failed (40 cm at most).")]
)
def test_a_call_that_a_verifier_replaces_says_why(failed, words):
    said = str(Feedback(Call("walk", {"z_cm": 40}), replaced=Call("walk", {"z_cm": 80}), failed=failed))
    assert said.startswith(f"walk(z_cm=80) was not executed: the check before execution {words} Executed")


def test_touch_tells_a_person_from_a_thing():
    hand = Contact(tuple(range(6)), "right_hand", "arm_hand", person_id(1), False, 0.001, 0.9)
    sensed = tactile([_did(rest_pose(15), hand, _contact("head", "head", 1.5))])
    assert [touch.person for touch in sensed] == [False, True]
    assert str(sensed[1]) == "your right arm or hand for 0.2 s (a person)"


def test_what_the_feet_stand_on_is_no_touch_and_what_the_toes_hit_is():
    floor = _contact("left_foot", "leg_foot", 0.0)
    riser = _contact("left_foot", "leg_foot", 0.05)
    assert tactile([_did(rest_pose(15), floor)]) == ()
    assert Feedback(Call("walk"), tactile=()).sensor_readings == "You touch nothing but what you stand on."
    assert [touch.part for touch in tactile([_did(rest_pose(15), riser)])] == ["left leg or foot"]


@pytest.mark.parametrize(
    ("sensors", "senses"), [((), (False, False)), (("body",), (True, False)), (("body", "touch"), (True, True))]
)
def test_only_the_senses_asked_for_speak(plugins, house, sensors, senses):
    with Body(house, plugins=plugins, backends=Backends(sensors=sensors)) as body:
        feedback = body.call("turn_in_place", yaw_deg=10).feedback
    assert (feedback.proprioception is not None, feedback.tactile is not None) == senses
    assert str(feedback).startswith("Executed turn_in_place(yaw_deg=10).")
    assert ("hips" in str(feedback), "touch" in str(feedback)) == senses


def test_a_record_keeps_what_was_felt_as_values():
    sensed = proprioception(BEFORE, [(_after(forward=0.4), _did(_after(forward=0.12)))])
    step = StepRecord(
        step=0, status="executed", attempts=(), call=Call("walk"), proprioception=sensed, tactile=(Touch("hips", 3,
        False),)
    )  # fmt: skip
    again = StepRecord.model_validate_json(step.model_dump_json())
    assert again == step
    assert str(again.feedback) == f"Executed walk(). {sensed} Something touched your hips for 0.1 s."


def test_vision_is_always_on_and_an_unknown_sense_is_refused():
    assert check_sensors(["touch"]) == ("vision", "touch")
    with pytest.raises(HumanclawError, match="there is no sensor 'smell'"):
        check_sensors(["smell"])
