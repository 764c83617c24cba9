"""Fixtures: the command line, a motion model that stands still, and a real walk."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest
from tiny_motion import write_base

from humanclaw.cli import main
from humanclaw.motion import Base


@pytest.fixture
def humanclaw() -> Callable[..., int]:
    """A function that runs a command line in this process and returns its exit code."""

    def run(*words: object) -> int:
        try:
            main([str(word) for word in words])
        except SystemExit as end:
            return int(end.code or 0)
        return 0

    return run


@pytest.fixture(scope="session")
def still_base() -> Callable[[Path], Base]:
    """A function that writes a base which holds the last pose, and reads it."""
    return partial(write_base, scale=0.0)


@pytest.fixture(scope="session")
def humanoid3d() -> Path:
    """A real walk that PyBullet contains. PyBullet has no wheel for the newest Pythons."""
    data = pytest.importorskip("pybullet_data", reason="PyBullet has no wheel for this Python")
    return Path(data.getDataPath()) / "data/motions/humanoid3d_walk.txt"
