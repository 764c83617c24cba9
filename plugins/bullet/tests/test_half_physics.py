"""Bullet keeps the laws that every simulator has to keep."""

from humanclaw.testing import SimulatorConformance
from humanclaw_bullet.world import bullet


class TestBullet(SimulatorConformance):
    simulator = staticmethod(bullet)
