"""Skills that feel their own body: targets, absolute keys, joints that stop at their limits."""

import re
from typing import Annotated, Literal

import numpy as np
import pytest
from pydantic import Field

from humanclaw import (
    Backends,
    Body,
    Call,
    Decision,
    Episode,
    Gaze,
    Grip,
    Keyframes,
    Motion,
    Plugins,
    ProprioceptiveState,
    Reach,
    Skill,
    skill,
)
from humanclaw.body import JOINT_INDEX, JOINT_LIMITS, STANDING_HEIGHT, Pose2D, rest_pose
from humanclaw.checks.fakes import FAKE, Fakes
from humanclaw.records import RecordedEpisode, free_episode
from humanclaw.skills import MotionError, parts
from humanclaw.testing import fake_body, fake_scene

Cm = Annotated[int, Field(ge=-200, le=300)]


@skill()
def stretch(x_cm: Cm, y_cm: Cm, z_cm: Cm, hand: Literal["left", "right"] = "right") -> Reach:
    """Reach to a point in front of the body."""
    return Reach(hand, (x_cm / 100, y_cm / 100, z_cm / 100), seconds=1.5)


@skill()
def look_aside(left_deg: Annotated[int, Field(ge=-170, le=170)]) -> Gaze:
    """Look aside."""
    return Gaze.towards(left_deg)


@skill()
def turn_head(deg: int) -> Keyframes:
    """Turn the head further."""
    there = (0.0, float(np.radians(deg)), 0.0)
    return Keyframes((0.0, 0.5), {"neck": ((0, 0, 0), there), "head": ((0, 0, 0), there)})


def joint(body, name):
    """Position of a joint in the body's frame."""
    pose = body.state().body
    return Pose2D.of(pose).to_local(pose).joints()[-1, JOINT_INDEX[name]]


def on_engine(*skills):
    plugins = Plugins.discover()
    plugins.add(Fakes(skills), FAKE)
    return Body(fake_scene(), plugins=plugins, backends=Backends("mujoco", FAKE, "dit"))


TARGETS = [(-20, 120, 45), (-40, 150, 20), (0, 100, 60), (-25, 60, 45), (-20, 190, 15), (-70, 110, 10), (10, 110, 30)]


@pytest.mark.parametrize("target", TARGETS)
def test_a_hand_reaches_its_target_also_three_times_in_a_row(target):
    with on_engine(stretch) as body:
        for _ in range(3):
            seen = body.call("stretch", **dict(zip(("x_cm", "y_cm", "z_cm"), target, strict=True)))
            assert np.linalg.norm(joint(body, "right_hand") - np.divide(target, 100)) < 0.03
            assert "could not" not in str(seen.feedback)


def test_the_feet_stay_while_the_trunk_helps_the_hand():
    with fake_body(stretch) as body:
        before = body.state().body.joints()[-1]
        body.call("stretch", x_cm=-25, y_cm=60, z_cm=45)
        after = body.state().body.joints()[-1]
    feet = [JOINT_INDEX["left_ankle"], JOINT_INDEX["right_ankle"]]
    assert np.abs(after[feet] - before[feet]).max() < 0.01
    assert after[JOINT_INDEX["neck"], 1] < before[JOINT_INDEX["neck"], 1] - 0.05


def test_a_target_out_of_reach_is_approached_and_its_distance_told():
    with fake_body(stretch) as body:
        seen = body.call("stretch", x_cm=0, y_cm=130, z_cm=200)
        gap = 100 * np.linalg.norm(joint(body, "right_hand") - [0, 1.3, 2.0])
    (short,) = re.findall(r"your right hand stays (\d+) cm short", str(seen.feedback))
    assert float(short) == pytest.approx(gap, abs=2)
    assert 80 < gap < 140


@pytest.mark.parametrize("degrees", [30, -80])
def test_a_gaze_is_absolute(degrees):
    with fake_body(look_aside) as body:
        for _ in range(3):
            body.call("look_aside", left_deg=degrees)
            ahead = joint(body, "head")
            assert abs(ahead[0]) < 0.1
            turned = body.state().body.rotations[-1, [JOINT_INDEX["neck"], JOINT_INDEX["head"]], 1].sum()
            assert np.degrees(turned) == pytest.approx(degrees, abs=1)


def test_relative_turns_stop_at_the_limit_of_the_joint():
    with fake_body(turn_head) as body:
        sentences = [str(body.call("turn_head", deg=30).feedback) for _ in range(5)]
        angles = np.degrees(np.linalg.norm(body.state().body.rotations[-1], axis=-1))
    assert angles[JOINT_INDEX["neck"]] <= JOINT_LIMITS["neck"] + 0.01
    assert angles[JOINT_INDEX["head"]] <= JOINT_LIMITS["head"] + 0.01
    assert "could not" not in sentences[0]
    assert "your neck turns no further; your head turns no further" in sentences[-1]


def test_a_skill_feels_its_own_body_and_no_scene():
    felt = []

    @skill()
    def feel(body: ProprioceptiveState, degrees: int = 10) -> Keyframes:
        """Feel."""
        felt.append(body)
        return Keyframes.cycle("head", "x", degrees, 0.5)

    assert list(feel.schema["properties"]) == ["degrees"]
    with fake_body(feel) as body:
        body.call("feel")
    (own,) = felt
    assert own.posture == "standing upright"
    assert own.pelvis_height == pytest.approx(STANDING_HEIGHT)
    assert own.held == ()
    assert own.joint("left_wrist")[0] > 0.2  # Left is +X.
    assert {"pose", "pelvis_height", "posture", "held"} == set(vars(own))


def test_absolute_keys_end_in_the_same_pose_wherever_they_begin():
    up = Keyframes((0.5,), {"left_shoulder": ((0.0, 0.0, 1.0),)}, absolute=True)
    once = up.over(rest_pose())
    again = up.over(once)
    index = JOINT_INDEX["left_shoulder"]
    assert np.allclose(once.rotations[-1, index], [0, 0, 1])
    assert np.allclose(again.rotations[-1], once.rotations[-1])
    assert np.abs(np.diff(once.rotations[:, index], axis=0)).max() < 0.4


def test_absolute_keys_of_the_pelvis_keep_the_heading():
    turned = Pose2D(1.0, 2.0, 1.0).to_world(rest_pose())
    ended = Keyframes((0.5,), {"pelvis": ((0.2, 0.0, 0.0),)}, absolute=True).over(turned)[-1:]
    assert ended.yaw()[0] == pytest.approx(1.0)
    assert np.allclose(ended.root, turned.root)


def test_the_pelvis_sinks_over_feet_that_stay():
    low = Keyframes((0.0, 1.0), {}, root=((0, 0, 0), (0.0, -0.3, 0.0))).over(rest_pose())
    joints, before = low.joints(), rest_pose().joints()[0]
    assert low.root[-1, 1] == pytest.approx(STANDING_HEIGHT - 0.3)
    for foot in ("left_ankle", "right_ankle", "left_foot", "right_foot"):
        assert np.abs(joints[:, JOINT_INDEX[foot]] - before[JOINT_INDEX[foot]]).max() < 0.005
    back = Keyframes((1.0,), {}, absolute=True, root=((0.0, STANDING_HEIGHT - 0.01, 0.0),)).over(low)
    assert back.root[-1, 1] == pytest.approx(STANDING_HEIGHT - 0.01)


def test_the_pelvis_moves_as_far_as_its_keys_say():
    @skill()
    def shift() -> Keyframes:
        """Shift the weight ahead."""
        return Keyframes((0.0, 2.0), {}, root=((0, 0, 0), (0.05, 0.0, 0.1)))

    with fake_body(shift) as body:
        before = body.state().body.root[-1]
        body.call("shift")
        assert np.allclose(body.state().body.root[-1] - before, [0.05, 0, 0.1], atol=1e-6)


def test_a_ready_motion_is_a_part_that_begins_in_the_pose_of_the_body():
    clip = rest_pose(20)
    clip.rotations[:, JOINT_INDEX["left_elbow"], 1] = -1.0

    @skill()
    def play_clip() -> list[Motion | Keyframes]:
        """Play a clip."""
        return [Motion(clip.root + np.linspace(0, 0.3, 20)[:, None] * [0, 0, 1], clip.rotations), Keyframes.relax(0.5)]

    with fake_body(play_clip) as body:
        done = body.execute(Call("play_clip"))
    moved = np.concatenate([chunk.commanded.rotations[:, JOINT_INDEX["left_elbow"], 1] for chunk in done.chunks])
    assert [part.kind for part in done.parts] == ["motion", "keyframes"]
    assert len(moved) == 45
    assert np.abs(np.diff(moved)).max() < 0.2
    assert moved[29] == pytest.approx(-1.0)
    assert moved[-1] == pytest.approx(0.0)
    assert done.chunks[-1].commanded.root[-1, 2] - done.chunks[0].commanded.root[0, 2] == pytest.approx(0.3, abs=0.01)


def test_the_record_keeps_what_the_body_could_not_do(tmp_path):
    with (
        fake_body(stretch) as body,
        Episode(body, free_episode("reach", body.scene), "t", folder=tmp_path / "e") as episode,
    ):
        episode.submit(Decision((Call("stretch", {"x_cm": 0, "y_cm": 130, "z_cm": 200}),)))
    (step,) = RecordedEpisode(tmp_path / "e").steps
    assert "cm short" in step.limits[0]
    assert "cm short" in str(step.feedback)


@pytest.mark.parametrize("wrong", [
    lambda: Reach("both", (0, 1, 0)), lambda: Reach("left", (0, 1)), lambda: Reach("left", (0, np.nan, 0)),
    lambda: Grip("both"), lambda: Grip("left", seconds=0), lambda: Grip("left", seconds=11),
    lambda: Gaze((0, 1, 1), seconds=11), lambda: Gaze((0, 1, 1), seconds=0),
    lambda: Keyframes((0.0, 1.0), {}, absolute=True), lambda: Keyframes((), {}),
    lambda: Keyframes((0.0, 1.0), {}, root=((0, 0, 0),)), lambda: parts(Motion(np.zeros((0, 3)), np.zeros((0, 24, 3)))),
])  # fmt: skip
def test_what_cannot_be_played_is_refused(wrong):
    with pytest.raises(MotionError):
        wrong()


def test_a_plan_function_takes_the_body_as_its_second_argument():
    bend = Skill(
        "bend", "Bend.", {"type": "object", "properties": {}, "additionalProperties": False},
        lambda params, body: Keyframes.cycle("spine1", "x", 20 * (body.posture == "standing upright"), 0.5),
    )  # fmt: skip
    with fake_body(bend) as body:
        assert np.abs(np.ptp(body.execute(Call("bend")).chunks[0].commanded.rotations[:, 3], axis=0)).max() > 0.2
