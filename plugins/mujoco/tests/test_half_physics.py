"""MuJoCo passes the physics checks that every simulator has to pass."""

import pytest

from humanclaw.testing import SimulatorConformance
from humanclaw_mujoco.world import mujoco

pytestmark = pytest.mark.integration


class TestMujoco(SimulatorConformance):
    simulator = staticmethod(mujoco)
