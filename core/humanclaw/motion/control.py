"""Skills as ControlNet branches on the frozen base (paper, section 3.3):

    z_{l+1} = B_l(z_l, tau) + W_l C_l(z_l + e_s(c), tau)

B_l are the base's blocks, frozen; C_l their trained copies; W_l began at zero; e_s encodes the skill's parameters c,
which are the outcome that the chunk should have. In numpy; the trained definition is
`humanclaw_train.model.control`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final, Literal, get_args

import numpy as np

from humanclaw.errors import CheckpointError
from humanclaw.motion.dit import (
    Array,
    Block,
    DiT,
    Layer,
    Linear,
    Weights,
    modulate_blocks,
    modulators,
    silu,
)

Encoder = Literal["mlp", "fourier", "token"]
ENCODERS: Final = get_args(Encoder)
OCTAVES: Final = 4
"""Of a Fourier encoder: the shortest period is a quarter of the range. More would tell closer values apart."""
FOURIER_FREQUENCIES: Final = (np.pi / 2 * 2.0 ** np.arange(OCTAVES)).astype(np.float32)
"""Half a period over [-1, 1] at first, so that no two values of the range look alike."""


@dataclass(frozen=True)
class AdapterConfig:
    """What an adapter is conditioned on: parameters in SI, brought to about [-1, 1] by (value - centre) / scale."""

    skill: str
    encoder: Encoder
    params: tuple[str, ...] = ()
    centre: tuple[float, ...] = ()
    scale: tuple[float, ...] = ()
    measures: tuple[str, ...] = ()
    """What each parameter commanded in training (humanclaw.skills); empty in checkpoints that do not say."""

    def __post_init__(self) -> None:
        if self.encoder not in ENCODERS:
            raise ValueError(f"encoder must be one of {', '.join(ENCODERS)}; got {self.encoder!r}")
        if not len(self.params) == len(self.centre) == len(self.scale):
            raise ValueError(f"params, centre and scale of {self.skill} must be of one length")
        if len(self.measures) not in (0, len(self.params)):
            raise ValueError(f"{self.skill} has {len(self.measures)} measures for {len(self.params)} parameters")
        if (self.encoder == "token") != (not self.params):
            raise ValueError(f"{self.skill}: the encoder 'token' is for skills without parameters, and only for those")

    @property
    def features(self) -> int:
        """How many numbers the encoder's MLP is given."""
        return len(self.params) * (1 + 2 * OCTAVES if self.encoder == "fourier" else 1)

    def conditions(self, values: Sequence[Mapping[str, float]]) -> Array:
        """Return values of B bodies as (B, k), in the order in which the adapter was trained.

        Raises CheckpointError unless every body has one value for each parameter.
        """
        for row in values:
            if set(row) != set(self.params):
                raise CheckpointError(
                    f"The adapter of {self.skill} takes {_listed(self.params)}; it got {_listed(row)}.",
                    "Give one value for each parameter that its header names.",
                )
        rows = [[row[name] for name in self.params] for row in values]
        return np.array(rows, np.float32).reshape(len(values), len(self.params))


def _listed(names: Iterable[str]) -> str:
    return ", ".join(names) or "no parameter"


class Adapter:
    """The control branch of one skill."""

    def __init__(self, base: DiT, config: AdapterConfig, weights: Weights) -> None:
        hidden = base.config.hidden
        self.config = config
        self.blocks = [Block.of(base.config, weights, f"blocks.{layer}") for layer in range(base.config.layers)]
        self.modulators = modulators(base.config, weights)
        self.weights = [
            Linear(weights, f"weights.{layer}", hidden, hidden, bias=False) for layer in range(len(self.blocks))
        ]
        encode = _encoder(config, weights, hidden)
        centre, scale = np.array(config.centre, np.float32), np.array(config.scale, np.float32)
        self.condition: Callable[[Array], Array] = lambda values: encode((values - centre) / scale)[:, None]
        """e_s(c): (B, k) parameters in SI to (B, 1, hidden)."""


class Controlled:
    """A base with the branch of one skill, at the flow times at which a solver asks them."""

    def __init__(self, base: DiT, adapter: Adapter, tau: Array) -> None:
        """tau: (B,) flow times."""
        self.config = adapter.config
        # Of the adapter's parts those that every step needs: whoever plays many skills holds one of these for each.
        self._condition, self._weights = adapter.condition, adapter.weights
        self._blocks = [Block.pair(*both) for both in zip(base.blocks, adapter.blocks, strict=True)]
        embedded = silu(base.time(tau))  # The embedding of tau is the base's.
        both = modulate_blocks(base.modulators, embedded), modulate_blocks(adapter.modulators, embedded)
        self._modulations = np.stack(both, axis=2)  # (layers, 6, 2, B, 1, hidden): base and branch

    def through(self, values: Array, times: slice = slice(None)) -> Layer:
        """Return what carries tokens through each layer (the module's equation).

        values: (B, k) parameters in SI. times: which of tau; one for all of a batch, or one for each.
        """
        condition, at = self._condition(values), self._modulations[:, :, :, times]

        def layer(index: int, z: Array) -> Array:
            own, branch = self._blocks[index](np.stack([z, z + condition]), at[index])  # (B, T, hidden) each
            carried: Array = own + self._weights[index](branch)
            return carried

        return layer


def fourier(values: Array) -> Array:
    """(B, k) values to (B, k * (1 + 2 * octaves)): with sines and cosines, fine differences of a displacement become
    large ones."""
    angles = (values[..., None] * FOURIER_FREQUENCIES).reshape(len(values), -1)
    return np.concatenate([values, np.sin(angles), np.cos(angles)], -1)


def _encoder(config: AdapterConfig, weights: Weights, hidden: int) -> Callable[[Array], Array]:
    if config.encoder == "token":
        vector = weights.take("encode.vector", hidden)
        return lambda values: np.broadcast_to(vector, (len(values), hidden))
    # The layers of the trained Sequential are numbered, and the Fourier features are its first.
    first = 1 if config.encoder == "fourier" else 0
    enter = Linear(weights, f"encode.{first}", config.features, hidden)
    leave = Linear(weights, f"encode.{first + 2}", hidden, hidden)
    features = fourier if config.encoder == "fourier" else np.asarray
    return lambda values: leave(silu(enter(features(values))))
