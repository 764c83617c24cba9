"""The simulators that this Python can have: PyBullet has wheels for some alone."""

from importlib.util import find_spec

import pytest

needs_bullet = pytest.mark.skipif(find_spec("pybullet") is None, reason="PyBullet has no wheel for this Python")
BULLET = pytest.param("bullet", marks=needs_bullet)
DEFAULT = "bullet" if find_spec("pybullet") else "mujoco"
"""What moves the world where no simulator is named."""
