"""Checkpoints of the motion model: half-precision safetensors with a header that says what they are. Never pickle.

The header (metadata key `humanclaw`, JSON) names the format version, the kind, the shape of the model, for an adapter its
condition encoder and the digest of the base that it was trained against, and the training card: recipe and its digest, data
statistics, data licences.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Final

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save
from torch import Tensor, nn

from humanclaw.errors import CheckpointError
from humanclaw.files import write_atomically
from humanclaw.motion.control import Adapter, AdapterConfig
from humanclaw.motion.dit import DiT, ModelConfig

FORMAT: Final = 1
_KEY: Final = "humanclaw"
_MODEL: Final = "model."


@dataclass(frozen=True)
class Normaliser:
    """Brings the 219 numbers of a state to mean 0 and deviation 1. mean, std: (219,) float32."""

    mean: Tensor
    std: Tensor

    def forward(self, state: Tensor) -> Tensor:
        """(..., 219) states in metres and radians to normalised ones."""
        return (state - self.mean) / self.std

    def inverse(self, state: Tensor) -> Tensor:
        """(..., 219) normalised states to metres and radians."""
        return state * self.std + self.mean

    def to(self, device: torch.device) -> Normaliser:
        """The same numbers on another device."""
        return Normaliser(self.mean.to(device), self.std.to(device))


@dataclass(frozen=True)
class Card:
    """How a checkpoint came about: enough to make it again, and to know what may be done with it."""

    recipe: Mapping[str, Any] = field(default_factory=dict)
    data: Mapping[str, Any] = field(default_factory=dict)
    licences: tuple[str, ...] = ()

    @property
    def recipe_digest(self) -> str:
        """Names the recipe."""
        return hashlib.sha256(json.dumps(dict(self.recipe), sort_keys=True).encode()).hexdigest()[:16]

    def header(self) -> dict[str, Any]:
        """As it stands in a checkpoint's header."""
        return {**asdict(self), "recipe_digest": self.recipe_digest}


@dataclass(frozen=True)
class Base:
    """The motion prior with what is needed to run it. start_root: (5, 3). start_rotations: (5, 24, 3)."""

    model: DiT
    normaliser: Normaliser
    start_root: Tensor
    start_rotations: Tensor
    digest: str
    card: Card


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
    """Write an adapter checkpoint for the base of that digest."""
    tensors = {name: tensor.detach().cpu().contiguous() for name, tensor in _halved(adapter).items()}
    header = {"kind": "adapter", "adapter": asdict(adapter.config), "base": base_digest, "card": card.header()}
    _write(path, tensors, header)


def load_base(path: Path) -> Base:
    """Read a base checkpoint, in single precision, ready to run.

    Raises CheckpointError when the file is missing, broken or no base of this format.
    """
    header, tensors = _read(path, "base", "Train a base with: humanclaw train base")
    try:
        model = DiT(ModelConfig(**header["model"]))
        _fill(model, tensors)
        normaliser = Normaliser(tensors["normaliser.mean"], tensors["normaliser.std"])
        start = tensors["start.root"], tensors["start.rotations"]
        return Base(model.eval().requires_grad_(False), normaliser, *start, header["digest"], _card(header))
    except (KeyError, TypeError, RuntimeError, ValueError) as error:
        raise _broken(path, error, "Train a base with: humanclaw train base") from error


def load_adapter(path: Path, base: Base, skill: str | None = None) -> Adapter:
    """Read an adapter for this base, in single precision, ready to run; with `skill`, insist that it is that skill's.

    Raises CheckpointError when the file is missing, broken, another skill's, or was trained against another base.
    """
    header, tensors = _read(path, "adapter", f"Train it with: humanclaw train adapter {skill or path.parent.name}")
    try:
        config = AdapterConfig(**{key: _tuple(value) for key, value in header["adapter"].items()})
    except (KeyError, TypeError, ValueError) as error:
        raise _broken(path, error, f"Train it with: humanclaw train adapter {skill or path.parent.name}") from error
    remedy = f"Train it again with: humanclaw train adapter {skill or config.skill}"
    if skill is not None and config.skill != skill:
        raise CheckpointError(f"{path} is the adapter of {config.skill}, not of {skill}.", remedy)
    if header.get("base") != base.digest:
        trained = f"{path} was trained against base {header.get('base')}, and this base is {base.digest}."
        raise CheckpointError(trained, remedy)
    try:
        adapter = Adapter(base.model, config)
        _fill(adapter, tensors)
    except (KeyError, RuntimeError) as error:
        raise _broken(path, error, remedy) from error
    return adapter.eval().requires_grad_(False)


def read_header(path: Path) -> dict[str, Any]:
    """The header of a base or an adapter, without its weights. Raises CheckpointError."""
    return _open(path, "Train it with: humanclaw train")[0]


def _halved(module: nn.Module) -> dict[str, Tensor]:
    return {_MODEL + name: tensor.half() for name, tensor in module.state_dict().items()}


def _fill(module: nn.Module, tensors: Mapping[str, Tensor]) -> None:
    weights = {name.removeprefix(_MODEL): value for name, value in tensors.items() if name.startswith(_MODEL)}
    module.load_state_dict({name: tensor.float() for name, tensor in weights.items()})


def _digest(tensors: Mapping[str, Tensor]) -> str:
    """Names the numbers themselves, so that the same weights with another note in the header stay the same base."""
    hasher = hashlib.sha256()
    for name in sorted(tensors):
        tensor = tensors[name]
        hasher.update(f"{name} {tensor.dtype} {tuple(tensor.shape)};".encode())
        hasher.update(tensor.numpy().tobytes())
    return hasher.hexdigest()[:16]


def _write(path: Path, tensors: dict[str, Tensor], header: Mapping[str, Any]) -> None:
    content = save(tensors, {_KEY: json.dumps({"format": FORMAT, **header}, sort_keys=True)})
    path.parent.mkdir(parents=True, exist_ok=True)
    write_atomically(path, content)


def _read(path: Path, kind: str, remedy: str) -> tuple[dict[str, Any], dict[str, Tensor]]:
    header, tensors = _open(path, remedy, weights=True)
    if header.get("kind") != kind:
        raise CheckpointError(
            f"{path} holds {header.get('kind')!r} weights where {kind!r} weights were expected.", remedy
        )
    return header, tensors


def _open(path: Path, remedy: str, weights: bool = False) -> tuple[dict[str, Any], dict[str, Tensor]]:
    if not path.is_file():
        raise CheckpointError(f"There is no checkpoint at {path}.", remedy)
    try:
        with safe_open(str(path), framework="pt") as file:
            note = (file.metadata() or {}).get(_KEY)
            tensors = {name: file.get_tensor(name) for name in file.keys()} if weights else {}  # noqa: SIM118
    except (SafetensorError, OSError, ValueError) as error:
        raise _broken(path, error, remedy) from error
    if note is None:
        raise CheckpointError(f"{path} is a safetensors file, but no checkpoint of HumanCLAW.", remedy)
    header: dict[str, Any] = json.loads(note)
    if header.get("format") != FORMAT:
        found = f"{path} has checkpoint format {header.get('format')}; this version reads format {FORMAT}."
        raise CheckpointError(found, remedy)
    return header, tensors


def _card(header: Mapping[str, Any]) -> Card:
    card = header["card"]
    return Card(card["recipe"], card["data"], tuple(card["licences"]))


def _tuple(value: Any) -> Any:
    return tuple(value) if isinstance(value, list) else value


def _broken(path: Path, error: Exception, remedy: str) -> CheckpointError:
    return CheckpointError(f"{path} cannot be read as a checkpoint ({str(error).splitlines()[0]}).", remedy)
