"""Pure kinematics plays commands back whatever stands in the way; half-physics does not."""

import numpy as np
import pytest

from humanclaw.body import Motion, rest_pose
from humanclaw.world import SceneBuilder
from humanclaw_mujoco.world import kinematic, mujoco


def glide(y, z):
    """A standing body that glides so many metres up and ahead in half a second."""
    motion, share = rest_pose(15), np.arange(1, 16)[:, None] / 15
    return Motion(motion.root + share * [0.0, y, z], motion.rotations)


def outcome(simulator, scene, *motions):
    simulator.reset(scene, scene.start)
    return [simulator.execute(motion) for motion in motions]


def test_kinematics_walks_through_a_wall_that_blocks_half_physics():
    builder = SceneBuilder.on_floor()
    wall = builder.box("wall", (6, 2.5, 0.2), (0, 0, 0.6))
    scene, motion = builder.scene(), glide(0.0, 0.75)
    (through,), (blocked,) = outcome(kinematic(), scene, motion), outcome(mujoco(), scene, motion)
    assert np.array_equal(through.simulated.root, motion.root)
    assert blocked.simulated.root[-1, 2] < 0.5
    # The wall is from z = .5 to .7 m, and the pelvis ends at .75 m: links in the middle are .1 m deep.
    assert max(contact.depth for contact in through.contacts if contact.object_id == wall) > 0.05


def test_kinematics_climbs_in_the_air_and_half_physics_does_not():
    scene, motion = SceneBuilder.on_floor().scene(), glide(0.3, 0.0)
    (aloft,), (down,) = outcome(kinematic(), scene, motion), outcome(mujoco(), scene, motion)
    assert aloft.simulated.root[-1, 1] - down.simulated.root[-1, 1] == pytest.approx(0.3, abs=0.03)


def test_kinematics_moves_no_box_that_half_physics_pushes():
    builder = SceneBuilder.on_floor()
    box = builder.box("box", (0.4, 0.4, 0.4), (0, 0, 0.6), movable=True, mass=5.0)
    scene = builder.scene()
    (still,), (pushed,) = (outcome(make(), scene, glide(0.0, 0.6)) for make in (kinematic, mujoco))
    assert still.objects == {}
    assert box in pushed.objects
