"""What one call leaves undone of its turn, the next makes up for. Angles by hand, of a body that turns evenly."""

from dataclasses import replace
from typing import get_args

import numpy as np
import pytest
from declared import declaration

from humanclaw import Motion
from humanclaw.body import rest_pose
from humanclaw.skills import HeadingCorrection, Role

DEGREE = np.pi / 180
WALK, TURN, STEP, SIT = map(declaration, ("walk", "turn_in_place", "side_step", "sit_in_place"))
STANDING = rest_pose(5)


def turned(degrees: float) -> Motion:
    """Half a second in which the body turns on the spot."""
    motion = rest_pose(15)
    motion.rotations[:, 0, 1] = np.arange(1, 16) / 15 * degrees * DEGREE
    return motion


def after(course: HeadingCorrection, skill, commanded: float, achieved: float) -> HeadingCorrection:
    values = {param.name: commanded * DEGREE if param.measure == "heading.left" else 0.0 for param in skill.parameters}
    return course.after(skill, values, STANDING, turned(achieved))


def test_a_turn_that_fell_short_is_made_up_for_by_the_next_call():
    course = after(HeadingCorrection(), TURN, commanded=30, achieved=28)
    assert course.owed == pytest.approx(2 * DEGREE)
    assert course.steer(WALK, {"x": 0.0, "z": 0.4, "yaw": 0.0}) == {"x": 0.0, "z": 0.4, "yaw": course.owed}
    assert after(course, WALK, commanded=0, achieved=2).owed == pytest.approx(0)


def test_a_sidestep_that_veered_is_made_up_for_by_who_can_turn():
    course = after(HeadingCorrection(), STEP, commanded=0, achieved=-1.5)
    assert course.steer(STEP, {"x": 0.3}) == {"x": 0.3}
    assert course.steer(TURN, {"yaw": 0.0})["yaw"] == pytest.approx(1.5 * DEGREE)


@pytest.mark.parametrize("role", [role for role in get_args(Role) if role != "locomotion"])
def test_only_locomotion_veers(role):
    skill = replace(SIT, role=role)
    assert after(HeadingCorrection(0.01), skill, commanded=0, achieved=3) == HeadingCorrection(0.01)


def test_no_more_than_five_degrees_are_made_up_for_at_once():
    assert after(HeadingCorrection(), WALK, commanded=0, achieved=-20).owed == pytest.approx(5 * DEGREE)


def test_a_turn_across_the_back_is_measured_the_short_way():
    history = rest_pose(5)
    history.rotations[:, 0, 1] = 179 * DEGREE
    motion = rest_pose(15)
    motion.rotations[:, 0, 1] = -179 * DEGREE
    owed = HeadingCorrection().after(TURN, {"yaw": 3 * DEGREE}, history, motion).owed
    assert owed == pytest.approx(1 * DEGREE)
