"""Checkpoints of small motion models, written without torch, for tests that run a model."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from safetensors.numpy import save_file

from humanclaw.body import STATE_SIZE, encode, rest_pose
from humanclaw.motion.checkpoint import FORMAT, HEADER, MODEL, Base, Card, load_base
from humanclaw.motion.control import Adapter, AdapterConfig
from humanclaw.motion.dit import DiT, ModelConfig, Weights

TINY = ModelConfig(32, 2, 4, prediction="clean")
WALK = AdapterConfig("walk", "fourier", ("x", "z", "yaw"), (0.0, 0.4, 0.0), (0.3, 0.4, 0.5))


class Drawn(Weights):
    """Hands out random tensors of any shape and keeps them. scale: their standard deviation."""

    def __init__(self, scale: float, seed: int) -> None:
        self._scale, self._random = scale, np.random.default_rng(seed)
        self.tensors: dict[str, NDArray[np.float16]] = {}

    def take(self, name: str, *shape: int) -> NDArray[np.float32]:
        self.tensors[MODEL + name] = (self._scale * self._random.standard_normal(shape)).astype(np.float16)
        return self.tensors[MODEL + name].astype(np.float32)


def write_base(
    path: Path,
    config: ModelConfig = TINY,
    scale: float = 0.05,
    seed: int = 1,
    digest: str = "tiny",
    card: Card = Card(),  # noqa: B008
) -> Base:
    """Write a base with random weights. With scale 0 and prediction `clean` it holds the last pose."""
    drawn, standing = Drawn(scale, seed), rest_pose(5)
    DiT(config, drawn)
    tensors = {
        **drawn.tensors,
        "normaliser.mean": encode(standing)[-1].astype(np.float32),
        "normaliser.std": np.full(STATE_SIZE, 0.1, np.float32),
        "start.root": standing.root.astype(np.float32),
        "start.rotations": standing.rotations.astype(np.float32),
    }
    _write(path, tensors, {"kind": "base", "model": vars(config), "digest": digest, "card": card.header()})
    return load_base(path)


def write_adapter(
    path: Path,
    base: Base,
    config: AdapterConfig = WALK,
    scale: float = 0.05,
    seed: int = 2,
    card: Card = Card(),  # noqa: B008
) -> Path:
    """Write an adapter with random weights. With scale 0 it changes nothing."""
    drawn = Drawn(scale, seed)
    Adapter(base.model, config, drawn)
    header = {"kind": "adapter", "adapter": vars(config), "base": base.digest, "card": card.header()}
    return _write(path, drawn.tensors, header)


def _write(path: Path, tensors: dict[str, NDArray[np.floating]], header: dict[str, object]) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    save_file(tensors, path, {HEADER: json.dumps({"format": FORMAT, **header})})
    return path
