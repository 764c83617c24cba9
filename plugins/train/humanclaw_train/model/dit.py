"""The motion prior: a diffusion transformer over 20 frames (paper, section 3.3; blocks after Peebles and Xie, 2023).

Every frame of 219 numbers is one token: 5 clean history frames and 15 noisy future frames. The flow time tau enters
through adaLN-Zero alone, so the modulations of a block depend only on tau. `modulations` computes them separately, once
per solver time.

This is the definition. `humanclaw.motion.dit` follows it line by line in numpy, to run the model without torch.
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
"""Maps a layer l and the tokens z_l that enter it to a control branch's addition."""


class Modulations(NamedTuple):
    """The flow time as the model uses it. blocks: (layers, 6, B, 1, hidden). final: (2, B, 1, hidden)."""

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
        """Embed flow times (B,) as (B, hidden)."""
        angles = tau[:, None] * self.frequencies  # (B, hidden / 2)
        embedded: Tensor = self.mlp(torch.cat([angles.sin(), angles.cos()], -1))  # (B, hidden)
        return embedded


class Block(nn.Module):
    """Self-attention and an MLP, each shifted, scaled and gated by tau. Zero-initialised gates make it the identity."""

    def __init__(self, config: ModelConfig) -> None:
        super().__init__()
        hidden = config.hidden
        self.heads = config.heads
        # Six: shift, scale and gate, of the attention and of the MLP.
        self.modulation = nn.Linear(hidden, 6 * hidden)
        self.qkv = nn.Linear(hidden, 3 * hidden)
        self.out = nn.Linear(hidden, hidden)
        self.up = nn.Linear(hidden, config.mlp_ratio * hidden)
        self.down = nn.Linear(config.mlp_ratio * hidden, hidden)
        # adaLN-Zero: gates start at zero.
        nn.init.zeros_(self.modulation.weight)
        nn.init.zeros_(self.modulation.bias)

    def forward(self, z: Tensor, modulation: Tensor) -> Tensor:
        """Return the tokens after this block (B, T, hidden). z: (B, T, hidden); modulation: (6, B, 1, hidden)."""
        shift, scale, gate, shift_mlp, scale_mlp, gate_mlp = modulation.unbind(0)  # Each (B, 1, hidden).
        z = z + gate * self._attend(_modulate(z, shift, scale))
        # The approximation of GELU by tanh, because numpy, which runs the model, has no erf.
        hidden = F.gelu(self.up(_modulate(z, shift_mlp, scale_mlp)), approximate="tanh")  # (B, T, ratio * hidden)
        result: Tensor = z + gate_mlp * self.down(hidden)
        return result

    def _attend(self, z: Tensor) -> Tensor:
        """Attend without the fused kernel, whose backward pass on 20 tokens is eight times slower on a CPU."""
        batch, tokens, hidden = z.shape
        parts = self.qkv(z).view(batch, tokens, 3, self.heads, -1)  # (B, T, 3, heads, hidden / heads)
        query, key, value = parts.permute(2, 0, 3, 1, 4).flatten(1, 2).unbind(0)  # Each (B * heads, T, hidden / heads).
        share = torch.softmax(query @ key.transpose(1, 2) / math.sqrt(hidden // self.heads), -1)  # (B * heads, T, T)
        mixed = (share @ value).view(batch, self.heads, tokens, -1)  # (B, heads, T, hidden / heads)
        result: Tensor = self.out(mixed.transpose(1, 2).reshape(batch, tokens, hidden))
        return result


class DiT(nn.Module):
    """The base model G: continues five frames by fifteen, for any skill."""

    def __init__(self, config: ModelConfig) -> None:
        super().__init__()
        self.config = config
        hidden = config.hidden
        self.time = TimeEmbedding(hidden)
        self.enter = nn.Linear(STATE_SIZE, hidden)
        self.position = nn.Parameter(0.02 * torch.randn(CHUNK, hidden))  # As in vision transformers.
        self.blocks = nn.ModuleList(Block(config) for _ in range(config.layers))
        self.final_modulation = nn.Linear(hidden, 2 * hidden)
        self.leave = nn.Linear(hidden, STATE_SIZE)
        # The output starts at zero too: an untrained model holds the last pose, or predicts no velocity.
        for layer in (self.final_modulation, self.leave):
            nn.init.zeros_(layer.weight)
            nn.init.zeros_(layer.bias)

    def modulations(self, tau: Tensor) -> Modulations:
        """Return the modulations of every block and of the output at flow times tau (B,)."""
        embedded = F.silu(self.time(tau))
        return Modulations(modulate_blocks(self.blocks, embedded), _split(self.final_modulation(embedded), 2))

    def forward(self, history: Tensor, noisy: Tensor, at: Modulations, residual: Residual | None = None) -> Tensor:
        """Return the output on the future tokens (B, 15, 219).

        history: (B, 5, 219) and noisy: (B, 15, 219), both normalised.
        """
        z = self.enter(torch.cat([history, noisy], 1)) + self.position  # (B, 20, hidden)
        for layer, block in enumerate(self.blocks):
            entering = z
            z = block(entering, at.blocks[layer])
            if residual is not None:
                z = z + residual(layer, entering)  # From what entered the layer, as the control branch's copy does.
        shift, scale = at.final.unbind(0)
        # (B, 15, 219), in single precision whatever the layers' is.
        output: Tensor = self.leave(_modulate(z[:, HISTORY:], shift, scale)).float()
        # Relative to the last history frame, so that an untrained model holds the pose.
        return output + history[:, -1:] if self.config.prediction == "clean" else output


def modulate_blocks(blocks: nn.ModuleList, embedded: Tensor) -> Tensor:
    """Return the modulations of a stack of blocks (layers, 6, B, 1, hidden) for embedded flow times (B, hidden)."""
    return torch.stack([_split(cast(Block, block).modulation(embedded), 6) for block in blocks])


def _split(modulation: Tensor, parts: int) -> Tensor:
    """Split (B, parts * hidden) into (parts, B, 1, hidden)."""
    return modulation.view(len(modulation), parts, 1, -1).transpose(0, 1)


def _modulate(z: Tensor, shift: Tensor, scale: Tensor) -> Tensor:
    return F.layer_norm(z, z.shape[-1:]) * (1 + scale) + shift
