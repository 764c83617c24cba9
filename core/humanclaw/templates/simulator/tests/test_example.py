"""The world does what a simulator promises, as far as it promises it."""

import numpy as np

from humanclaw import Motion, Plugins
from humanclaw.pose import FUTURE, Pose2D, rest_pose
from humanclaw.testing import SceneBuilder
from humanclaw_example.world import ExampleWorld


def reset(start):
    builder = SceneBuilder()
    builder.floor()
    box = builder.box("box", (0.4, 0.4, 0.4), (1.0, 0.0, 2.0), movable=True, mass=5.0)
    world = ExampleWorld()
    return world, world.reset(builder.scene(), start), box


def test_the_body_stands_on_its_start():
    _, state, box = reset(Pose2D(1.0, -2.0, 0.5))
    assert np.allclose(state.body.root[0, [0, 2]], [1.0, -2.0])
    assert np.allclose(state.body.yaw(), 0.5)
    assert np.allclose(state.objects[box], [1.0, 0.0, 2.0, 0.0, 0.0, 0.0, 1.0])


def test_the_body_ends_where_it_was_told():
    world, _, _ = reset(Pose2D(0.0, 0.0, 0.0))
    rest = rest_pose(FUTURE)
    ahead = Motion(rest.root + np.linspace(0, 0.4, FUTURE)[:, None] * [0, 0, 1], rest.rotations)
    done = world.execute(ahead)
    assert np.array_equal(done.simulated.root, ahead.root)
    assert np.array_equal(world.state().body.root[0], ahead.root[-1])


def test_it_is_found_once_it_is_installed():
    assert Plugins.discover().make("simulators", "example", profile="default") is not None
