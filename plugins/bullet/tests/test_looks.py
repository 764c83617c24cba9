"""How often half-physics looks for contacts, and what it reports of them.

In free air it looks once a physics step, and more often towards something.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain
from typing import ClassVar

import numpy as np
import pytest

pytest.importorskip("pybullet", reason="PyBullet has no wheel for this Python")

from humanclaw import Motion, Scene
from humanclaw.body import JOINT_INDEX, JOINTS, Pose2D, rest_pose
from humanclaw.world import HalfPhysics, SceneBuilder, Touch
from humanclaw_bullet.world import BulletWorld

STEPS = 15 * 4
"""Physics steps of half a second at 120 Hz."""


class CountingWorld(BulletWorld):
    """Bullet, with a count of its steps."""

    steps = 0

    def step(self, seconds: float) -> Sequence[Touch]:
        type(self).steps += 1
        return super().step(seconds)


def leaf(degrees: float) -> Motion:
    """Return half a second in which the hanging left arm rises sideways, away from the body."""
    motion = rest_pose(15)
    motion.rotations[:, JOINT_INDEX["left_shoulder"], 2] += np.radians(np.linspace(0, degrees, 15))
    return motion


def looks(scene: Scene, motion: Motion) -> tuple[int, float]:
    """Return the engine's steps for a motion, and the deepest contact with anything but the floor, metres."""
    simulator = HalfPhysics(CountingWorld)
    simulator.reset(scene, scene.start)
    CountingWorld.steps = 0
    done = simulator.execute(motion)
    simulator.close()
    return CountingWorld.steps, max((contact.depth for contact in done.contacts if contact.height > 0.1), default=0.0)


def beside(distance: float) -> Scene:
    """Return a floor with a thin wall on the left of the body, at a distance from its middle, metres."""
    builder = SceneBuilder()
    builder.floor()
    builder.box("wall", (0.04, 2.5, 4.0), (distance, 0, 0))
    return builder.scene()


def test_a_fast_arm_in_free_air_takes_one_engine_step_a_physics_step():
    # The hand is 0.7 m from the shoulder: 80 degrees in 14 / 30 s are 2.1 m/s, 1.7 cm a physics step.
    assert looks(beside(3.0), leaf(80)) == (STEPS, 0.0)


@pytest.mark.parametrize("degrees", [80, 120])
def test_the_same_arm_before_a_thin_wall_does_not_enter_it(degrees):
    steps, depth = looks(beside(0.6), leaf(degrees))
    assert steps > 1.2 * STEPS
    assert 0.0 < depth < 0.01


def above(height: float) -> Scene:
    """Return a pillar that ends at a height, with a block of 20 cm all round, metres."""
    builder = SceneBuilder()
    builder.box("floor", (0.8, height, 0.8), (0, 0, 0))
    builder.box("couch", (8.0, 0.2, 8.0), (0, 0, 0))
    return builder.scene(height)


@pytest.mark.parametrize("drop", [0.6, 0.8, 1.0, 1.2])
def test_a_body_that_falls_does_not_enter_what_it_falls_on(drop):
    # No command says so: after 1 m it falls at 4.4 m/s, 3.7 cm a physics step.
    path = np.minimum(np.arange(1, 31), 10)[:, None] / 30 * [0.0, 0.0, 4.0]
    off = Motion(rest_pose().root + path, rest_pose(30).rotations)
    _, depth = looks(above(0.2 + drop), off)
    assert 0.0 < depth < 0.01


def test_no_joint_of_a_sitting_body_turns_over_30_degrees_a_frame():
    builder, motion, knee = SceneBuilder(), rest_pose(30), JOINT_INDEX["left_knee"]
    builder.floor()
    hips = [JOINT_INDEX["left_hip"], JOINT_INDEX["right_hip"]]
    motion.rotations[:, hips, 0] -= np.radians(np.linspace(9, 270, 30).clip(max=90))[:, None]
    motion.rotations[25:, knee, 0] -= 2.0
    simulator = HalfPhysics(BulletWorld)
    simulator.reset(builder.scene(), Pose2D())
    turns = -np.diff(simulator.execute(motion).simulated.rotations[:, knee, 0])
    simulator.close()
    assert np.radians(25) < turns.max() < np.radians(31)


class RecordingWorld(BulletWorld):
    """Bullet, with the body's contacts of every step."""

    touches: ClassVar[list[Sequence[Touch]]] = []

    def step(self, seconds: float) -> Sequence[Touch]:
        self.touches.append(super().step(seconds))
        return self.touches[-1]


def test_a_contact_is_the_deepest_of_its_frame():
    simulator, scene = HalfPhysics(RecordingWorld), beside(3.0)
    simulator.reset(scene, scene.start)
    RecordingWorld.touches.clear()
    contacts = simulator.execute(rest_pose()).contacts
    simulator.close()
    assert len(RecordingWorld.touches) == 4  # One look a physics step: all contacts count.
    depths: dict[str, list[float]] = {}
    for touch in chain.from_iterable(RecordingWorld.touches):
        depths.setdefault(JOINTS[touch.joint], []).append(-touch.distance)
    assert {contact.joint: contact.depth for contact in contacts} == {joint: max(own) for joint, own in depths.items()}
    assert all(max(own) > min(own) for own in depths.values())


def test_an_object_that_is_pushed_by_some_centimetres_has_a_path():
    builder = SceneBuilder.on_floor()
    box = builder.box("box", (0.3, 0.6, 0.3), (0, 0, 0.4), movable=True, mass=2.0)
    simulator, scene = HalfPhysics(BulletWorld), builder.scene()
    simulator.reset(scene, scene.start)
    ahead = np.arange(1, 16)[:, None] / 15 * [0.0, 0.0, 0.06]
    path = simulator.execute(Motion(rest_pose().root + ahead, rest_pose(15).rotations)).objects[box]
    simulator.close()
    # The toes are 2 to 4 cm from the box, and the body goes 6 cm.
    assert 0.02 <= path[-1, 2] - 0.4 <= 0.04
