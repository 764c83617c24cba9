"""How much of the own body the eyes see, with each gaze."""

import numpy as np
import pytest

from humanclaw import Backends, Body, HumanclawError
from humanclaw.body import JOINT_INDEX, rest_pose
from humanclaw.motion import DiTGenerator
from humanclaw.world import BODY_ID, GAZES, WorldState, ego_camera

STRIDES = 8


@pytest.fixture
def own_pixels(builder):
    """Return the pixels of a view that show the own body, on an empty floor."""
    builder.floor()

    def seen(body, gaze):
        return builder.look(ego_camera(body, gaze=GAZES[gaze]), WorldState(body, {})).ids == BODY_ID

    return seen


def seated():
    """Return a body with level thighs, upright shins and a straight back."""
    body = rest_pose()
    for side in ("left", "right"):
        body.rotations[0, JOINT_INDEX[f"{side}_hip"]] = (-np.pi / 2, 0, 0)
        body.rotations[0, JOINT_INDEX[f"{side}_knee"]] = (np.pi / 2, 0, 0)
    return body


def test_a_seated_body_sees_both_its_thighs(own_pixels):
    body = seated()
    eye, joints = ego_camera(body), body.joints()[-1]
    mine = own_pixels(body, "body")
    for side in ("left", "right"):
        hip, knee = (joints[JOINT_INDEX[f"{side}_{name}"]] for name in ("hip", "knee"))
        column, row = eye.pixels(hip + 0.9 * (knee - hip)).astype(int)
        assert mine[row, column]
    assert mine.mean() > 2 * own_pixels(body, "far").mean()


def test_a_walking_body_sees_its_swinging_limbs(own_pixels, plugins):
    generator = DiTGenerator.load()
    motion = generator.start()
    assert not own_pixels(motion[-1:], "body").any()
    for stride in range(STRIDES):
        control = plugins.skill("walk").plan({"x_cm": 0, "z_cm": 50, "yaw_deg": 0})
        motion = motion.then(generator.generate(motion[-5:], control.adapter, control.values, (0, stride)))
    frames = range(5, len(motion), 5)
    shown = {gaze: np.mean([own_pixels(motion[k : k + 1], gaze).any() for k in frames]) for gaze in GAZES}
    assert shown["body"] > 0.5
    assert shown["body"] > shown["far"]


def test_an_unknown_gaze_is_refused_with_the_known_ones():
    with pytest.raises(HumanclawError, match=r"no gaze 'up'\. Choose from: body, far"):
        Body(backends=Backends(gaze="up"))
