"""Bullet passes the physics checks that every simulator has to pass."""

import pytest

pytest.importorskip("pybullet", reason="PyBullet has no wheel for this Python")

from humanclaw.testing import SimulatorConformance
from humanclaw_bullet.world import bullet

# `humanclaw physics` plays the same laws on Bullet; on every change MuJoCo plays them.
pytestmark = pytest.mark.evidence


class TestBullet(SimulatorConformance):
    simulator = staticmethod(bullet)
