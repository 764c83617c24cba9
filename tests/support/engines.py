"""The simulators of this Python version: PyBullet has wheels for some versions only."""

from importlib.util import find_spec

import pytest

needs_bullet = pytest.mark.skipif(find_spec("pybullet") is None, reason="PyBullet has no wheel for this Python")
BULLET = pytest.param("bullet", marks=needs_bullet)
DEFAULT = "bullet" if find_spec("pybullet") else "mujoco"
"""The simulator that runs if none is named."""
