"""Behaviour that only Bullet has."""

import os
import subprocess
import sys

import pytest

pybullet = pytest.importorskip("pybullet", reason="PyBullet has no wheel for this Python")

from humanclaw.body import Pose2D, forward_kinematics, shoe_heights
from humanclaw.laws.fixture import Fixture
from humanclaw.world import HalfPhysics, SceneBuilder
from humanclaw_bullet.engine import Client
from humanclaw_bullet.world import BulletWorld


@pytest.mark.integration
def test_nothing_is_printed_so_that_protocols_may_use_stdout():
    code = "import humanclaw_bullet.engine as engine; engine.Client().close()"
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert (done.stdout, done.stderr) == ("", "")


@pytest.mark.integration
def test_the_body_is_the_same_to_the_last_bit_in_every_process():
    """Each process orders a set of names differently, and a sum in another order is another number."""
    code = """
from humanclaw.world import find_profile
from humanclaw_bullet.body import urdf
print(urdf(find_profile('default')))
"""
    command, bodies = [sys.executable, "-c", code], set()
    for seed in range(4):
        seeded = os.environ | {"PYTHONHASHSEED": str(seed)}
        bodies.add(subprocess.run(command, env=seeded, capture_output=True, text=True, check=True).stdout)
    assert len(bodies) == 1


def test_a_closed_world_does_not_reach_into_its_numbers_next_owner():
    closed = Client()
    closed.setGravity(0, 0, -1)
    closed.close()
    other = Client()
    with pytest.raises(pybullet.error):
        closed.setGravity(0, 0, 1)
    other.close()


def test_shoes_of_a_fast_walk_stop_at_the_floor():
    command = {"hips.left": 0.0, "hips.forward": 0.8, "heading.left": 0.0}
    walk = Fixture.of("bullet").perform(SceneBuilder.on_floor().scene(), [command] * 4).simulated
    assert shoe_heights(*forward_kinematics(walk.root, walk.rotations)).min() > -0.001


def test_a_reset_that_fails_half_way_closes_its_world():
    """Bullet has room for some hundred worlds."""

    class FailingWorld(BulletWorld):
        opened = 0

        def __init__(self, *args):
            super().__init__(*args)
            FailingWorld.opened += 1

        def close(self):
            super().close()
            FailingWorld.opened -= 1

        def objects(self):
            raise RuntimeError("the engine failed")

    simulator = HalfPhysics(FailingWorld)
    for _ in range(2):
        with pytest.raises(RuntimeError, match="the engine failed"):
            simulator.reset(SceneBuilder.on_floor().scene(), Pose2D(0.0, 0.0, 0.0))
    assert FailingWorld.opened == 0
