"""The motion prior: a diffusion transformer over 20 frame tokens (paper, section 3.3; blocks after Peebles and Xie,
2023).

Every frame of 219 numbers is one token: 5 clean history frames and 15 noisy future frames. The flow time tau enters
through adaLN-Zero alone, so the modulations of a block depend on tau and on nothing else; `modulations` computes them
apart from the rest, once per solver time, whatever the motion.

In numpy, single precision, for running; the definition that is trained is `humanclaw_train.dit`, which this follows
line by line.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from humanclaw.body.pose import CHUNK, HISTORY, STATE_SIZE

Array = NDArray[np.float32]
Prediction = Literal["velocity", "clean"]
_EPSILON: Final = 1e-5
"""Of a layer norm."""


@dataclass(frozen=True)
class ModelConfig:
    """The shape of a model, and the meaning of its output (flow.velocity).

    `velocity` is the paper's. `clean` is for models narrower than a state: a velocity repeats the noise of
    all 219 numbers, which a hidden size below 219 cannot carry. The clean future needs fewer: its difference from the
    last frame of the history.
    """

    hidden: int
    layers: int
    heads: int
    mlp_ratio: int = 2
    prediction: Prediction = "velocity"

    def __post_init__(self) -> None:
        if self.hidden % self.heads or self.hidden % 2:
            raise ValueError(f"hidden must be even and a multiple of heads; got {self.hidden} and {self.heads}")


SIZES: Final = {"paper": ModelConfig(512, 10, 8), "lite": ModelConfig(192, 6, 6, prediction="clean")}

Residual = Callable[[int, Array], Array]
"""What a control branch adds to layer l, given the tokens z_l that enter it."""


class Modulations(NamedTuple):
    """All that the model needs to know of tau. blocks: (layers, 6, B, 1, hidden). final: (2, B, 1, hidden)."""

    blocks: Array
    final: Array


class Weights:
    """The tensors of a checkpoint, taken one by one, so that a missing, misshapen or unused tensor is an error."""

    def __init__(self, tensors: Mapping[str, NDArray[np.floating]]) -> None:
        self._left = dict(tensors)

    def take(self, name: str, *shape: int) -> Array:
        """One tensor in single precision. Raises KeyError when it is missing, ValueError when its shape is another."""
        tensor = self._left.pop(name)
        if tensor.shape != shape:
            raise ValueError(f"{name} has shape {tensor.shape}, not {shape}")
        return tensor.astype(np.float32)

    def check_all_taken(self) -> None:
        """Raise ValueError when a tensor is left over."""
        if self._left:
            raise ValueError(f"no part of the model takes {', '.join(sorted(self._left))}")


class Linear:
    """An affine map of the last axis."""

    def __init__(self, weights: Weights, name: str, inputs: int, outputs: int, bias: bool = True) -> None:
        self.weight = np.ascontiguousarray(weights.take(f"{name}.weight", outputs, inputs).T)
        self.bias = weights.take(f"{name}.bias", outputs) if bias else None

    def __call__(self, z: Array) -> Array:
        """(..., inputs) to (..., outputs)."""
        mapped: Array = z @ self.weight
        if self.bias is not None:
            mapped += self.bias
        return mapped


class TimeEmbedding:
    """Sinusoids of tau, then a two-layer MLP."""

    def __init__(self, hidden: int, weights: Weights) -> None:
        self._frequencies = time_frequencies(hidden)
        self._enter, self._leave = (Linear(weights, f"time.mlp.{layer}", hidden, hidden) for layer in (0, 2))

    def __call__(self, tau: Array) -> Array:
        """(B,) flow times to (B, hidden)."""
        angles = tau[:, None] * self._frequencies
        return self._leave(silu(self._enter(np.concatenate([np.sin(angles), np.cos(angles)], -1))))


class Block:
    """Self-attention and an MLP, each shifted, scaled and gated by tau."""

    def __init__(self, config: ModelConfig, weights: Weights, name: str) -> None:
        hidden, wide = config.hidden, config.mlp_ratio * config.hidden
        self.heads = config.heads
        self.modulation = Linear(weights, f"{name}.modulation", hidden, 6 * hidden)
        self.qkv = Linear(weights, f"{name}.qkv", hidden, 3 * hidden)
        self.out = Linear(weights, f"{name}.out", hidden, hidden)
        self.up = Linear(weights, f"{name}.up", hidden, wide)
        self.down = Linear(weights, f"{name}.down", wide, hidden)

    def __call__(self, z: Array, modulation: Array) -> Array:
        """z: (B, T, hidden). modulation: (6, B, 1, hidden) of this block."""
        shift, scale, gate, shift_mlp, scale_mlp, gate_mlp = modulation
        z = z + gate * self._attend(_modulate(z, shift, scale))
        hidden = _gelu(self.up(_modulate(z, shift_mlp, scale_mlp)))
        result: Array = z + gate_mlp * self.down(hidden)
        return result

    def _attend(self, z: Array) -> Array:
        batch, tokens, hidden = z.shape
        heads = self.qkv(z).reshape(batch, tokens, 3, self.heads, -1).transpose(2, 0, 3, 1, 4)
        query, key, value = heads
        share = _softmax(query @ key.swapaxes(-1, -2) / math.sqrt(hidden // self.heads))
        mixed = share @ value
        return self.out(mixed.swapaxes(1, 2).reshape(batch, tokens, hidden))


class DiT:
    """The base model G: skill-agnostic continuation of five frames by fifteen."""

    def __init__(self, config: ModelConfig, weights: Weights) -> None:
        hidden = config.hidden
        self.config = config
        self.time = TimeEmbedding(hidden, weights)
        self.enter = Linear(weights, "enter", STATE_SIZE, hidden)
        self.position = weights.take("position", CHUNK, hidden)
        self.blocks = [Block(config, weights, f"blocks.{layer}") for layer in range(config.layers)]
        self.final_modulation = Linear(weights, "final_modulation", hidden, 2 * hidden)
        self.leave = Linear(weights, "leave", hidden, STATE_SIZE)

    def modulations(self, tau: Array) -> Modulations:
        """(B,) flow times to the modulations of every block and of the output."""
        embedded = silu(self.time(tau))
        return Modulations(modulate_blocks(self.blocks, embedded), _split(self.final_modulation(embedded), 2))

    def __call__(self, history: Array, noisy: Array, at: Modulations, residual: Residual | None = None) -> Array:
        """(B, 5, 219) history and (B, 15, 219) noisy future, both normalised, to the (B, 15, 219) output on the future
        tokens."""
        z = self.enter(np.concatenate([history, noisy], 1)) + self.position
        for layer, block in enumerate(self.blocks):
            entering = z
            z = block(entering, at.blocks[layer])
            if residual is not None:
                z = z + residual(layer, entering)
        shift, scale = at.final
        output = self.leave(_modulate(z[:, HISTORY:], shift, scale))
        return output + history[:, -1:] if self.config.prediction == "clean" else output


def time_frequencies(hidden: int) -> Array:
    """(hidden / 2,) angular frequencies of a time embedding: wavelengths from ten times the interval to a thousandth of
    it."""
    return (2 * np.pi * np.logspace(-1, 3, hidden // 2)).astype(np.float32)


def modulate_blocks(blocks: Sequence[Block], embedded: Array) -> Array:
    """(B, hidden) embedded flow times to the (layers, 6, B, 1, hidden) modulations of a stack of blocks."""
    return np.stack([_split(block.modulation(embedded), 6) for block in blocks])


def silu(x: Array) -> Array:
    """x times its sigmoid, written so that nothing overflows."""
    result: Array = x * (0.5 + 0.5 * np.tanh(0.5 * x))
    return result


def _split(modulation: Array, parts: int) -> Array:
    """(B, parts * hidden) to (parts, B, 1, hidden)."""
    return modulation.reshape(len(modulation), parts, 1, -1).swapaxes(0, 1)


def _modulate(z: Array, shift: Array, scale: Array) -> Array:
    """Apply layer norm without learned weights, then scale and shift."""
    centred = z - z.mean(-1, keepdims=True)
    variance = np.square(centred).mean(-1, keepdims=True)
    result: Array = centred / np.sqrt(variance + _EPSILON) * (1 + scale) + shift
    return result


def _gelu(x: Array) -> Array:
    """In its tanh form."""
    inner = math.sqrt(2 / math.pi) * (x + 0.044715 * x * x * x)
    result: Array = 0.5 * x * (1 + np.tanh(inner))
    return result


def _softmax(x: Array) -> Array:
    """Over the last axis."""
    shares: Array = np.exp(x - x.max(-1, keepdims=True))
    shares /= shares.sum(-1, keepdims=True)
    return shares
