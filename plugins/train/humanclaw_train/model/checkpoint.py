"""Write checkpoints of the motion model, and read them into trainable modules.

`humanclaw.motion.checkpoint` documents the format and reads it without torch.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import torch
from safetensors.torch import save
from torch import Tensor, nn

from humanclaw.motion import (
    FORMAT,
    HEADER,
    MODEL,
    Card,
    ModelConfig,
    Normaliser,
    Tensors,
    broken,
    own_tensors,
    read_adapter,
    read_checkpoint,
)
from humanclaw.storage import write_atomically
from humanclaw_train.model.control import Adapter
from humanclaw_train.model.dit import DiT

M = TypeVar("M", bound=nn.Module)


@dataclass(frozen=True)
class Base:
    """The frozen prior that adapters are trained against."""

    model: DiT
    normaliser: Normaliser
    digest: str

    def to(self, device: torch.device) -> Base:
        """Move to another device."""
        return Base(self.model.to(device), moved(self.normaliser, device), self.digest)


def moved(normaliser: Normaliser, device: torch.device) -> Normaliser:
    """Move tensors of a normaliser to another device."""
    return Normaliser(normaliser.mean.to(device), normaliser.std.to(device))


def save_base(path: Path, model: DiT, normaliser: Normaliser, start: tuple[Tensor, Tensor], card: Card) -> str:
    """Write a base checkpoint and return its digest. start: root (5, 3) and rotations (5, 24, 3) of standing."""
    tensors = {
        **_halved(model),
        "normaliser.mean": normaliser.mean,
        "normaliser.std": normaliser.std,
        "start.root": start[0],
        "start.rotations": start[1],
    }
    tensors = {name: tensor.detach().cpu().contiguous() for name, tensor in tensors.items()}
    digest = _digest(tensors)
    _write(path, tensors, {"kind": "base", "model": asdict(model.config), "digest": digest, "card": card.header()})
    return digest


def save_adapter(path: Path, adapter: Adapter, base_digest: str, card: Card) -> None:
    """Write an adapter checkpoint for the base with that digest."""
    tensors = {name: tensor.detach().cpu().contiguous() for name, tensor in _halved(adapter).items()}
    header = {"kind": "adapter", "adapter": asdict(adapter.config), "base": base_digest, "card": card.header()}
    _write(path, tensors, header)


def load_base(path: Path) -> Base:
    """Read a base checkpoint as a frozen module in single precision.

    Raises CheckpointError if the file is missing, broken or no base of this format.
    """
    remedy = "Train a base with: humanclaw train base"
    header, tensors = read_checkpoint(path, "base", remedy)
    try:
        model = _filled(DiT(ModelConfig(**header["model"])), own_tensors(tensors))
        mean, std = (torch.from_numpy(tensors[f"normaliser.{name}"].astype(np.float32)) for name in ("mean", "std"))
        return Base(model.eval().requires_grad_(False), Normaliser(mean, std), header["digest"])
    except (KeyError, TypeError, RuntimeError, ValueError) as error:
        raise broken(path, error, remedy) from error


def load_adapter(path: Path, base: Base, skill: str | None = None) -> Adapter:
    """Read an adapter of this base as a frozen module in single precision. skill: the expected skill, if any.

    Raises CheckpointError if the file is missing, broken, of another skill or of another base.
    """
    config, tensors = read_adapter(path, base.digest, skill)
    try:
        return _filled(Adapter(base.model, config), tensors).eval().requires_grad_(False)
    except (KeyError, RuntimeError) as error:
        raise broken(path, error, f"Train it again with: humanclaw train adapter {config.skill}") from error


def _halved(module: nn.Module) -> dict[str, Tensor]:
    # Half precision halves the shipped files; weights are read back in single precision.
    return {MODEL + name: tensor.half() for name, tensor in module.state_dict().items()}


def _filled(module: M, tensors: Tensors) -> M:
    module.load_state_dict({name: torch.from_numpy(tensor).float() for name, tensor in tensors.items()})
    return module


def _digest(tensors: Mapping[str, Tensor]) -> str:
    """Hash the numbers alone, so that a change of notes in the header leaves the digest the same."""
    hasher = hashlib.sha256()
    for name in sorted(tensors):
        tensor = tensors[name]
        hasher.update(f"{name} {tensor.dtype} {tuple(tensor.shape)};".encode())
        hasher.update(tensor.numpy().tobytes())
    return hasher.hexdigest()[:16]


def _write(path: Path, tensors: dict[str, Tensor], header: Mapping[str, Any]) -> None:
    # Sorted keys, so that the same training writes the same bytes.
    content = save(tensors, {HEADER: json.dumps({"format": FORMAT, **header}, sort_keys=True)})
    path.parent.mkdir(parents=True, exist_ok=True)
    write_atomically(path, content)
