"""A motion model that does nothing, for tests of what is measured on motion."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
import torch

from humanclaw import pose
from humanclaw.motion.checkpoint import Base, Card, Normaliser, load_base, save_base
from humanclaw.motion.dit import DiT, ModelConfig


@pytest.fixture(scope="session")
def still_base() -> Callable[[Path], Base]:
    """Writes base.safetensors, an untrained base that holds the last pose, into a folder, and reads it."""

    def make(folder: Path) -> Base:
        rest = pose.rest_pose(5)
        state = torch.from_numpy(pose.encode(rest)[-1]).float()
        start = torch.from_numpy(rest.root).float(), torch.from_numpy(rest.rotations).float()
        model = DiT(ModelConfig(32, 1, 4, prediction="clean"))
        save_base(folder / "base.safetensors", model, Normaliser(state, torch.full((219,), 0.1)), start, Card())
        return load_base(folder / "base.safetensors")

    return make
