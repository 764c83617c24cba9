"""Skills as ControlNet branches on the frozen base (paper, section 3.3).

    z_{l+1} = B_l(z_l, tau) + W_l C_l(z_l + e_s(c), tau)

B_l are the base's frozen blocks and C_l their trainable copies. W_l begins at zero, so an untrained adapter changes
nothing. e_s encodes the skill's parameters c: the outcome that the chunk should have. This is the definition;
`humanclaw.motion.control` follows it in numpy.
"""

from __future__ import annotations

import copy

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from humanclaw.motion import FOURIER_FREQUENCIES, OCTAVES, AdapterConfig
from humanclaw_train.model.dit import DiT, Residual, modulate_blocks


class Adapter(nn.Module):
    """The control branch of one skill. Begins as a copy of the base's blocks."""

    centre: Tensor
    scale: Tensor

    def __init__(self, base: DiT, config: AdapterConfig) -> None:
        super().__init__()
        self.config = config
        hidden = base.config.hidden
        self.blocks = copy.deepcopy(base.blocks).requires_grad_(True)  # The base is frozen, and so is its copy.
        # Zero weights: before training, the branch adds nothing to the base.
        self.weights = nn.ModuleList(_zeros(hidden) for _ in self.blocks)
        self.encode = _encoder(config, hidden)
        # Not persistent: the header has both numbers.
        self.register_buffer("centre", torch.tensor(config.centre), persistent=False)
        self.register_buffer("scale", torch.tensor(config.scale), persistent=False)

    def condition(self, values: Tensor) -> Tensor:
        """Encode parameters in SI (B, k) as e_s(c) (B, 1, hidden)."""
        encoded: Tensor = self.encode((values - self.centre) / self.scale)  # (B, hidden)
        return encoded[:, None]

    def modulations(self, base: DiT, tau: Tensor) -> Tensor:
        """Return the modulations of the copied blocks (layers, 6, B, 1, hidden) at flow times tau (B,).

        The embedding of tau is the base's.
        """
        return modulate_blocks(self.blocks, F.silu(base.time(tau)))

    def residual(self, condition: Tensor, modulations: Tensor) -> Residual:
        """Return the function that gives this branch's addition to each layer of the base."""

        def add(layer: int, z: Tensor) -> Tensor:
            added: Tensor = self.weights[layer](self.blocks[layer](z + condition, modulations[layer]))
            return added

        return add


class Fourier(nn.Module):
    """Values with sines and cosines of their first octaves, which make small differences in displacement visible."""

    frequencies: Tensor

    def __init__(self) -> None:
        super().__init__()
        self.register_buffer("frequencies", torch.from_numpy(FOURIER_FREQUENCIES), persistent=False)

    def forward(self, values: Tensor) -> Tensor:
        """Map (B, k) to (B, k * (1 + 2 * octaves))."""
        angles = (values[..., None] * self.frequencies).flatten(-2)  # (B, k * octaves)
        return torch.cat([values, angles.sin(), angles.cos()], -1)


class Token(nn.Module):
    """One learned vector, for a skill without parameters."""

    def __init__(self, hidden: int) -> None:
        super().__init__()
        # .02, the usual deviation of embeddings at first.
        self.vector = nn.Parameter(0.02 * torch.randn(hidden))

    def forward(self, values: Tensor) -> Tensor:
        """Map (B, 0) to (B, hidden)."""
        return self.vector.expand(len(values), -1)


def _zeros(hidden: int) -> nn.Linear:
    layer = nn.Linear(hidden, hidden, bias=False)
    nn.init.zeros_(layer.weight)
    return layer


def _encoder(config: AdapterConfig, hidden: int) -> nn.Module:
    width = len(config.params)
    if config.encoder == "token":
        return Token(hidden)
    head: list[nn.Module] = [Fourier()] if config.encoder == "fourier" else []
    features = width * (1 + 2 * OCTAVES) if head else width
    return nn.Sequential(*head, nn.Linear(features, hidden), nn.SiLU(), nn.Linear(hidden, hidden))
