"""MuJoCo keeps the laws that every simulator has to keep."""

from humanclaw.testing import SimulatorConformance
from humanclaw_mujoco.world import mujoco


class TestMujoco(SimulatorConformance):
    simulator = staticmethod(mujoco)
