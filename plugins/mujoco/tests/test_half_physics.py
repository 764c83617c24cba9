"""MuJoCo passes the physics checks that every simulator has to pass."""

from humanclaw.testing import SimulatorConformance
from humanclaw_mujoco.world import mujoco


class TestMujoco(SimulatorConformance):
    simulator = staticmethod(mujoco)
