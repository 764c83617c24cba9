"""The motion prior: a diffusion transformer over 20 frame tokens (paper, section 3.3; blocks after Peebles and Xie,
2023).

Every frame of 219 numbers is one token: 5 clean history frames and 15 noisy future frames. The flow time tau enters
through adaLN-Zero alone, so the modulations of a block depend on tau and on nothing else; `modulations` computes them
apart from the rest, once per solver time, whatever the motion.

This is the definition. `humanclaw.motion.dit` follows it line by line in numpy, for who only runs the model.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple, cast

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from humanclaw.body import CHUNK, HISTORY, STATE_SIZE
from humanclaw.motion import ModelConfig, time_frequencies

Residual = Callable[[int, Tensor], Tensor]
"""What a control branch adds to layer l, given the tokens z_l that enter it."""


class Modulations(NamedTuple):
    """All that the model needs to know of tau. blocks: (layers, 6, B, 1, hidden). final: (2, B, 1, hidden)."""

    blocks: Tensor
    final: Tensor


class TimeEmbedding(nn.Module):
    """Sinusoids of tau, then a two-layer MLP."""

    frequencies: Tensor

    def __init__(self, hidden: int) -> None:
        super().__init__()
        self.register_buffer("frequencies", torch.from_numpy(time_frequencies(hidden)), persistent=False)
        self.mlp = nn.Sequential(nn.Linear(hidden, hidden), nn.SiLU(), nn.Linear(hidden, hidden))

    def forward(self, tau: Tensor) -> Tensor:
        """(B,) flow times to (B, hidden)."""
        angles = tau[:, None] * self.frequencies
        embedded: Tensor = self.mlp(torch.cat([angles.sin(), angles.cos()], -1))
        return embedded


class Block(nn.Module):
    """Self-attention and an MLP, each shifted, scaled and gated by tau. Zero-initialised gates make it the identity."""

    def __init__(self, config: ModelConfig) -> None:
        super().__init__()
        hidden = config.hidden
        self.heads = config.heads
        self.modulation = nn.Linear(hidden, 6 * hidden)
        self.qkv = nn.Linear(hidden, 3 * hidden)
        self.out = nn.Linear(hidden, hidden)
        self.up = nn.Linear(hidden, config.mlp_ratio * hidden)
        self.down = nn.Linear(config.mlp_ratio * hidden, hidden)
        nn.init.zeros_(self.modulation.weight)
        nn.init.zeros_(self.modulation.bias)

    def forward(self, z: Tensor, modulation: Tensor) -> Tensor:
        """z: (B, T, hidden). modulation: (6, B, 1, hidden) of this block."""
        shift, scale, gate, shift_mlp, scale_mlp, gate_mlp = modulation.unbind(0)
        z = z + gate * self._attend(_modulate(z, shift, scale))
        hidden = F.gelu(self.up(_modulate(z, shift_mlp, scale_mlp)), approximate="tanh")
        result: Tensor = z + gate_mlp * self.down(hidden)
        return result

    def _attend(self, z: Tensor) -> Tensor:
        """Written out: on 20 tokens the fused kernel's backward pass is eight times slower on a CPU."""
        batch, tokens, hidden = z.shape
        heads = self.qkv(z).view(batch, tokens, 3, self.heads, -1).permute(2, 0, 3, 1, 4).flatten(1, 2)
        query, key, value = heads.unbind(0)
        share = torch.softmax(query @ key.transpose(1, 2) / math.sqrt(hidden // self.heads), -1)
        mixed = (share @ value).view(batch, self.heads, tokens, -1)
        result: Tensor = self.out(mixed.transpose(1, 2).reshape(batch, tokens, hidden))
        return result


class DiT(nn.Module):
    """The base model G: skill-agnostic continuation of five frames by fifteen."""

    def __init__(self, config: ModelConfig) -> None:
        super().__init__()
        self.config = config
        hidden = config.hidden
        self.time = TimeEmbedding(hidden)
        self.enter = nn.Linear(STATE_SIZE, hidden)
        self.position = nn.Parameter(0.02 * torch.randn(CHUNK, hidden))
        self.blocks = nn.ModuleList(Block(config) for _ in range(config.layers))
        self.final_modulation = nn.Linear(hidden, 2 * hidden)
        self.leave = nn.Linear(hidden, STATE_SIZE)
        for layer in (self.final_modulation, self.leave):
            nn.init.zeros_(layer.weight)
            nn.init.zeros_(layer.bias)

    def modulations(self, tau: Tensor) -> Modulations:
        """(B,) flow times to the modulations of every block and of the output."""
        embedded = F.silu(self.time(tau))
        return Modulations(modulate_blocks(self.blocks, embedded), _split(self.final_modulation(embedded), 2))

    def forward(self, history: Tensor, noisy: Tensor, at: Modulations, residual: Residual | None = None) -> Tensor:
        """(B, 5, 219) history and (B, 15, 219) noisy future, both normalised, to the (B, 15, 219) output on the future
        tokens."""
        z = self.enter(torch.cat([history, noisy], 1)) + self.position
        for layer, block in enumerate(self.blocks):
            entering = z
            z = block(entering, at.blocks[layer])
            if residual is not None:
                z = z + residual(layer, entering)
        shift, scale = at.final.unbind(0)
        output: Tensor = self.leave(_modulate(z[:, HISTORY:], shift, scale)).float()
        return output + history[:, -1:] if self.config.prediction == "clean" else output


def modulate_blocks(blocks: nn.ModuleList, embedded: Tensor) -> Tensor:
    """(B, hidden) embedded flow times to the (layers, 6, B, 1, hidden) modulations of a stack of blocks."""
    return torch.stack([_split(cast(Block, block).modulation(embedded), 6) for block in blocks])


def _split(modulation: Tensor, parts: int) -> Tensor:
    """(B, parts * hidden) to (parts, B, 1, hidden)."""
    return modulation.view(len(modulation), parts, 1, -1).transpose(0, 1)


def _modulate(z: Tensor, shift: Tensor, scale: Tensor) -> Tensor:
    return F.layer_norm(z, z.shape[-1:]) * (1 + scale) + shift
