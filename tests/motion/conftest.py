from pathlib import Path

import numpy as np
import pytest
import torch

from humanclaw.motion.checkpoint import Card, Normaliser, load_base, save_adapter, save_base
from humanclaw.motion.control import Adapter, AdapterConfig
from humanclaw.motion.dit import DiT, ModelConfig
from humanclaw.pose import encode, rest_pose

WALK = AdapterConfig("walk", "fourier", ("x", "z", "yaw"), (0.0, 0.4, 0.0), (0.3, 0.4, 0.5))


def _shaken(module, seed: int):
    generator = torch.Generator().manual_seed(seed)
    with torch.no_grad():
        for parameter in module.parameters():
            parameter.add_(0.05 * torch.randn(parameter.shape, generator=generator))
    return module


@pytest.fixture(scope="session")
def shaken():
    """Puts random numbers into every weight of a module, so that no branch is silenced by its zero initialisation."""
    return _shaken


@pytest.fixture(scope="session")
def base_file(tmp_path_factory) -> Path:
    """A small base with random weights."""
    path = tmp_path_factory.mktemp("base") / "base.safetensors"
    model = _shaken(DiT(ModelConfig(32, 2, 4, prediction="clean")), seed=1)
    standing = rest_pose(5)
    mean = torch.from_numpy(encode(standing)[-1]).float()
    start = torch.from_numpy(standing.root).float(), torch.from_numpy(standing.rotations).float()
    card = Card({"steps": 3}, {"chunks": 10}, ("CC0",))
    save_base(path, model, Normaliser(mean, torch.full((219,), 0.1)), start, card)
    return path


@pytest.fixture(scope="session")
def base(base_file):
    return load_base(base_file)


@pytest.fixture(scope="session")
def walk_file(base, tmp_path_factory) -> Path:
    """An adapter with random weights for that base."""
    path = tmp_path_factory.mktemp("walk") / "adapter.safetensors"
    save_adapter(path, _shaken(Adapter(base.model, WALK), seed=2), base.digest, Card({"steps": 3}, {}, ("CC0",)))
    return path


@pytest.fixture(scope="session")
def untrained_file(base, tmp_path_factory) -> Path:
    """An adapter just made for that base."""
    path = tmp_path_factory.mktemp("untrained") / "adapter.safetensors"
    save_adapter(path, Adapter(base.model, WALK), base.digest, Card())
    return path


@pytest.fixture
def swaying():
    """Five frames of a body that moves."""
    standing = rest_pose(5)
    rotations = standing.rotations + np.linspace(0, 0.05, 5)[:, None, None]
    return type(standing)(standing.root + np.linspace(0, 0.04, 5)[:, None], rotations)
