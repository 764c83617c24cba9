"""Bullet passes the physics checks that every simulator has to pass."""

import pytest

pytest.importorskip("pybullet", reason="PyBullet has no wheel for this Python")

from humanclaw.testing import SimulatorConformance
from humanclaw_bullet.world import bullet


class TestBullet(SimulatorConformance):
    simulator = staticmethod(bullet)
