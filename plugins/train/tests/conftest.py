"""A motion model that does nothing, for tests of what is measured on motion."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest
from tiny_motion import write_base

from humanclaw.motion import Base


@pytest.fixture(scope="session")
def still_base() -> Callable[[Path], Base]:
    """Writes a base that holds the last pose to a path, and reads it."""
    return partial(write_base, scale=0.0)


@pytest.fixture(scope="session")
def humanoid3d() -> Path:
    """A walk of a real person that PyBullet brings, which has no wheel for the newest Pythons."""
    data = pytest.importorskip("pybullet_data", reason="PyBullet has no wheel for this Python")
    return Path(data.getDataPath()) / "data/motions/humanoid3d_walk.txt"
