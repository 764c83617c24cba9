"""The loss of a model on clips that it never learns from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import torch
from torch import nn

from humanclaw_train.data import tensors
from humanclaw_train.data.tensors import ChunkTensors
from humanclaw_train.trainer import Recipe, draw, seeded

HELD_OUT: Final = "held_out"
"""Folder in a folder of chunks (humanclaw_train.data.build)."""
_MOST: Final = 1024
"""Most chunks of a validation, spread evenly over all: a second of time for the shipped size."""


@dataclass(frozen=True)
class Validation:
    """A problem, usually of a run's running mean, and the held-out chunks."""

    problem: nn.Module
    chunks: ChunkTensors
    recipe: Recipe

    def __len__(self) -> int:
        return min(len(self.chunks), _MOST)

    @torch.no_grad()
    def loss(self) -> float:
        """Return the mean loss. Errors of histories, noise and flow times are the same in every run."""
        device = self.chunks.root.device
        chosen = torch.linspace(0, len(self.chunks) - 1, len(self), device=device).long()
        total = 0.0
        for number, part in enumerate(torch.split(chosen, self.recipe.batch)):
            batch = draw(self.chunks, part, self.recipe, seeded(device, 0, number))
            total += len(part) * float(self.problem(*batch))
        return total / len(self)


def held_out(folders: Sequence[Path], name: str) -> ChunkTensors | None:
    """Load the held-out chunks of a skill, or of `base`, beside folders of chunks; None if there are none."""
    beside = [folder / HELD_OUT for folder in folders if (folder / HELD_OUT / f"{name}.npz").is_file()]
    return tensors.load(beside, name) if beside else None
