"""The motion prior: a diffusion transformer over 20 frame tokens (paper, section 3.3; blocks after Peebles and Xie,
2023).

Every frame of 219 numbers is one token: 5 clean history frames and 15 noisy future frames. The flow time tau enters
through adaLN-Zero alone, so the modulations of a block depend on tau and on nothing else; `modulations` computes them
apart from the rest, once per solver time, whatever the motion.

In numpy, single precision, for running; the trained definition is `humanclaw_train.model.dit`, which this follows line
by line.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Final, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from humanclaw.body.pose import CHUNK, HISTORY, STATE_SIZE

Array = NDArray[np.float32]
Prediction = Literal["velocity", "clean"]
_EPSILON: Final = 1e-5
"""Of a layer norm."""


_WIDEST: Final = 4096
"""Maximum of each size of a model: memory is asked for by the header of a file."""


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
        sizes = (self.hidden, self.layers, self.heads, self.mlp_ratio)
        if not all(isinstance(size, int) and 1 <= size <= _WIDEST for size in sizes):
            raise ValueError(f"hidden, layers, heads and mlp_ratio must be 1 to {_WIDEST}; got {sizes!r:.80}")
        if self.hidden % self.heads or self.hidden % 2:
            raise ValueError(f"hidden must be even and a multiple of heads; got {self.hidden} and {self.heads}")


SIZES: Final = {
    "paper": ModelConfig(512, 10, 8),
    "lite": ModelConfig(192, 6, 6, prediction="clean"),
    "tiny": ModelConfig(48, 2, 2, prediction="clean"),
}
"""`tiny` trains in seconds and walks badly: for trials."""

Layer = Callable[[int, Array], Array]
"""Carry the tokens z_l (B, T, hidden) that enter layer l to z_{l+1}."""


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


class Pair:
    """Two affine maps side by side. Neither copies its weights, since a base has a pair with each of its adapters."""

    def __init__(self, first: Linear, second: Linear) -> None:
        self._weights = first.weight, second.weight
        self._bias = None
        if first.bias is not None and second.bias is not None:
            self._bias = np.stack([first.bias, second.bias])[:, None, None]

    def __call__(self, z: Array) -> Array:
        """(2, B, T, inputs) to (2, B, T, outputs)."""
        mapped = np.empty((*z.shape[:-1], self._weights[0].shape[1]), np.float32)
        for half, weight, out in zip(z, self._weights, mapped, strict=True):
            np.matmul(half, weight, out=out)
        if self._bias is not None:
            mapped += self._bias
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


@dataclass(frozen=True)
class Block:
    """Self-attention and an MLP, each shifted, scaled and gated by tau."""

    heads: int
    qkv: Linear | Pair
    out: Linear | Pair
    up: Linear | Pair
    down: Linear | Pair

    @classmethod
    def of(cls, config: ModelConfig, weights: Weights, name: str) -> Block:
        """Take a block's tensors."""
        hidden, wide = config.hidden, config.mlp_ratio * config.hidden
        sizes = {"qkv": (hidden, 3 * hidden), "out": (hidden, hidden), "up": (hidden, wide), "down": (wide, hidden)}
        return cls(config.heads, **{part: Linear(weights, f"{name}.{part}", *size) for part, size in sizes.items()})

    @classmethod
    def pair(cls, block: Block, other: Block) -> Block:
        """Return two blocks as one, for tokens (2, B, T, hidden). It takes less time than one after the other: each
        operation on few numbers is made once instead of twice."""
        parts = [(part.name, getattr(block, part.name), getattr(other, part.name)) for part in fields(cls)[1:]]
        return cls(block.heads, **{name: Pair(first, second) for name, first, second in parts})

    def __call__(self, z: Array, modulation: Array) -> Array:
        """z: (..., B, T, hidden). modulation: (6, ..., B, 1, hidden) of this block."""
        shift, scale, gate, shift_mlp, scale_mlp, gate_mlp = modulation
        z = z + gate * self._attend(_modulate(z, shift, scale))
        hidden = _gelu(self.up(_modulate(z, shift_mlp, scale_mlp)))
        result: Array = z + gate_mlp * self.down(hidden)
        return result

    def _attend(self, z: Array) -> Array:
        *batch, tokens, hidden = z.shape
        heads = self.qkv(z).reshape(*batch, tokens, 3, self.heads, hidden // self.heads)
        # (..., heads, T, hidden / heads) each.
        query, key, value = (heads[..., part, :, :].swapaxes(-3, -2) for part in range(3))
        share = _softmax(query @ key.swapaxes(-1, -2) / math.sqrt(hidden // self.heads))  # (..., heads, T, T)
        return self.out((share @ value).swapaxes(-3, -2).reshape(z.shape))


class DiT:
    """The base model G: skill-agnostic continuation of five frames by fifteen."""

    def __init__(self, config: ModelConfig, weights: Weights) -> None:
        hidden = config.hidden
        self.config = config
        self.time = TimeEmbedding(hidden, weights)
        self.enter = Linear(weights, "enter", STATE_SIZE, hidden)
        self.position = weights.take("position", CHUNK, hidden)
        self.blocks = [Block.of(config, weights, f"blocks.{layer}") for layer in range(config.layers)]
        self.modulators = modulators(config, weights)
        self.final_modulation = Linear(weights, "final_modulation", hidden, 2 * hidden)
        self.leave = Linear(weights, "leave", hidden, STATE_SIZE)

    def modulations(self, tau: Array) -> Modulations:
        """(B,) flow times to the modulations of every block and of the output."""
        embedded = silu(self.time(tau))
        return Modulations(modulate_blocks(self.modulators, embedded), _split(self.final_modulation(embedded), 2))

    def __call__(self, history: Array, noisy: Array, at: Modulations, through: Layer | None = None) -> Array:
        """(B, 5, 219) history and (B, 15, 219) noisy future, both normalised, to the (B, 15, 219) output on the future
        tokens.

        through: what carries the tokens through each layer; the base's own blocks alone by default.
        """
        z = self.enter(np.concatenate([history, noisy], 1)) + self.position  # (B, 20, hidden)
        for layer, block in enumerate(self.blocks):
            z = through(layer, z) if through else block(z, at.blocks[layer])
        shift, scale = at.final
        output = self.leave(_modulate(z[:, HISTORY:], shift, scale))
        return output + history[:, -1:] if self.config.prediction == "clean" else output


def time_frequencies(hidden: int) -> Array:
    """(hidden / 2,) angular frequencies of a time embedding: wavelengths from ten times the interval to a thousandth of
    it."""
    return (2 * np.pi * np.logspace(-1, 3, hidden // 2)).astype(np.float32)


def modulators(config: ModelConfig, weights: Weights) -> list[Linear]:
    """Take what maps the embedded flow time to each block's modulations. They are a third of the weights, and needed
    once for each flow time alone."""
    return [
        Linear(weights, f"blocks.{layer}.modulation", config.hidden, 6 * config.hidden)
        for layer in range(config.layers)
    ]


def modulate_blocks(modulators: Sequence[Linear], embedded: Array) -> Array:
    """(B, hidden) embedded flow times to the (layers, 6, B, 1, hidden) modulations of a stack of blocks."""
    return np.stack([_split(modulator(embedded), 6) for modulator in modulators])


def silu(x: Array) -> Array:
    """x times its sigmoid, written so that nothing overflows."""
    result: Array = x * (0.5 + 0.5 * np.tanh(0.5 * x))
    return result


def _split(modulation: Array, parts: int) -> Array:
    """(B, parts * hidden) to (parts, B, 1, hidden)."""
    return modulation.reshape(len(modulation), parts, 1, -1).swapaxes(0, 1)


def _modulate(z: Array, shift: Array, scale: Array) -> Array:
    """Apply layer norm without learned weights, then scale and shift."""
    centred: Array = z - np.add.reduce(z, -1, keepdims=True) / z.shape[-1]
    variance = np.einsum("...i,...i->...", centred, centred)[..., None] / z.shape[-1]
    centred *= 1 / np.sqrt(variance + _EPSILON)
    centred *= 1 + scale
    centred += shift
    return centred


def _gelu(x: Array) -> Array:
    """In its tanh form, 0.5 x (1 + tanh(sqrt(2 / pi) (x + 0.044715 x^3))), step by step in one array."""
    inner = x * x
    inner *= 0.044715
    inner += 1
    inner *= x
    inner *= math.sqrt(2 / math.pi)
    result: Array = np.tanh(inner, out=inner)
    result += 1
    result *= x
    result *= 0.5
    return result


def _softmax(x: Array) -> Array:
    """Over the last axis."""
    shares: Array = x - x.max(-1, keepdims=True)  # So that exp never overflows.
    np.exp(shares, out=shares)
    shares /= shares.sum(-1, keepdims=True)
    return shares
