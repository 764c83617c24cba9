from pathlib import Path

import numpy as np
import pytest
from tiny_motion import write_adapter, write_base

from humanclaw.body import rest_pose
from humanclaw.motion.checkpoint import Card

CARD = Card({"steps": 3}, {"chunks": 10}, ("CC0",))


@pytest.fixture(scope="session")
def base_file(tmp_path_factory) -> Path:
    """A small base with random weights."""
    path = tmp_path_factory.mktemp("base") / "base.safetensors"
    write_base(path, card=CARD)
    return path


@pytest.fixture(scope="session")
def base(tmp_path_factory):
    """That base, read."""
    return write_base(tmp_path_factory.mktemp("base") / "base.safetensors", card=CARD)


@pytest.fixture(scope="session")
def walk_file(base, tmp_path_factory) -> Path:
    """An adapter with random weights for that base."""
    return write_adapter(tmp_path_factory.mktemp("walk") / "adapter.safetensors", base, card=CARD)


@pytest.fixture(scope="session")
def untrained_file(base, tmp_path_factory) -> Path:
    """An adapter for that base that has learned nothing."""
    return write_adapter(tmp_path_factory.mktemp("untrained") / "adapter.safetensors", base, scale=0.0)


@pytest.fixture
def swaying():
    """Five frames of a body that moves."""
    standing = rest_pose(5)
    rotations = standing.rotations + np.linspace(0, 0.05, 5)[:, None, None]
    return type(standing)(standing.root + np.linspace(0, 0.04, 5)[:, None], rotations)
