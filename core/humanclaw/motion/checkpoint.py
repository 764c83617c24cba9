"""Read checkpoints of the motion model: half-precision safetensors with a descriptive header. Never pickle.

The header (metadata key `humanclaw`, JSON) names the format version, the kind, the shape of the model, for an adapter
its condition encoder and the digest of the base that it was trained against, and the training card: recipe and its
digest, data statistics, data licences. `humanclaw_train.model.checkpoint` writes them.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Final, cast

import numpy as np
from numpy.typing import NDArray
from safetensors import SafetensorError, safe_open

from humanclaw.body.skeleton import N_JOINTS
from humanclaw.errors import CheckpointError
from humanclaw.motion.control import Adapter, AdapterConfig
from humanclaw.motion.dit import Array, DiT, ModelConfig, Weights

FORMAT: Final = 1
"""Of the header and the names of tensors. Raise it when an older reader would misread a checkpoint."""
HEADER: Final = "humanclaw"
"""The metadata key of the header."""
_HEADER_BYTES: Final = 8 << 20
"""Longest header: one that a file only claims would be read into memory before anything is checked."""
MODEL: Final = "model."
"""Prefix of the names of a model's tensors."""
Tensors = Mapping[str, NDArray[np.floating]]


@dataclass(frozen=True)
class Normaliser:
    """Scales the 219 numbers of a state to mean 0 and deviation 1, arrays and tensors alike.

    mean, std: (219,) float32.
    """

    mean: Any
    std: Any

    def forward(self, state: Any) -> Any:
        """Return (..., 219) normalised states from metres and radians."""
        return (state - self.mean) / self.std

    def inverse(self, state: Any) -> Any:
        """Return (..., 219) states in metres and radians from normalised ones."""
        return state * self.std + self.mean


@dataclass(frozen=True)
class Card:
    """How a checkpoint was made: recipe, data and licences."""

    recipe: Mapping[str, Any] = field(default_factory=dict)
    data: Mapping[str, Any] = field(default_factory=dict)
    licences: tuple[str, ...] = ()

    @property
    def recipe_digest(self) -> str:
        """Digest of the recipe."""
        return hashlib.sha256(json.dumps(dict(self.recipe), sort_keys=True).encode()).hexdigest()[:16]

    def header(self) -> dict[str, Any]:
        """Return the card as a checkpoint's header holds it."""
        return {**asdict(self), "recipe_digest": self.recipe_digest}

    @classmethod
    def of(cls, header: Mapping[str, Any]) -> Card:
        """Return the card in a checkpoint's header. Raises KeyError."""
        card = header["card"]
        return cls(card["recipe"], card["data"], tuple(card["licences"]))


@dataclass(frozen=True)
class Base:
    """The motion prior, ready to run. start_root: (5, 3). start_rotations: (5, 24, 3)."""

    model: DiT
    normaliser: Normaliser
    start_root: Array
    start_rotations: Array
    digest: str
    card: Card

    @property
    def usual(self) -> NDArray[np.float64]:
        """Mean rotation (24, 3) of each joint in the data, radians; zero for the pelvis."""
        joints: NDArray[np.float64] = self.normaliser.mean[6 : 3 + 3 * N_JOINTS].astype(float)  # After root and pelvis.
        return np.concatenate([np.zeros(3), joints]).reshape(N_JOINTS, 3)


def shipped_base() -> Path:
    """Return the path of the shipped prior's weights."""
    return Path(__file__).parent / "weights" / "base.safetensors"


def load_base(path: Path) -> Base:
    """Read a base checkpoint, in single precision, ready to run.

    Raises CheckpointError if the file is missing, broken, or not a base of this format.
    """
    remedy = "Train a base with: humanclaw train base"
    header, tensors = read_checkpoint(path, "base", remedy)
    try:
        weights = Weights(own_tensors(tensors))
        model = DiT(ModelConfig(**header["model"]), weights)
        weights.check_all_taken()
        normaliser = Normaliser(tensors["normaliser.mean"], tensors["normaliser.std"])
        start = tensors["start.root"], tensors["start.rotations"]
        return Base(model, normaliser, *start, header["digest"], Card.of(header))
    except (KeyError, TypeError, ValueError) as error:
        raise broken(path, error, remedy) from error


def load_adapter(path: Path, base: Base, skill: str | None = None) -> Adapter:
    """Read an adapter for this base, in single precision, ready to run. skill: the skill that it must belong to.

    Raises CheckpointError if the file is missing, broken, of another skill, or trained against another base.
    """
    config, tensors = read_adapter(path, base.digest, skill)
    try:
        weights = Weights(tensors)
        del tensors  # Each is freed as it is taken.
        adapter = Adapter(base.model, config, weights)
        weights.check_all_taken()
    except (KeyError, ValueError) as error:
        raise broken(path, error, _again(config.skill)) from error
    return adapter


def read_adapter(path: Path, base_digest: str, skill: str | None = None) -> tuple[AdapterConfig, Tensors]:
    """Return the configuration and the weights of an adapter for the base of that digest, as they are stored.

    Raises CheckpointError as load_adapter does.
    """
    remedy = f"Train it with: humanclaw train adapter {skill or path.parent.name}"
    header, tensors = read_checkpoint(path, "adapter", remedy)
    try:
        # JSON has no tuples.
        said = {key: tuple(value) if isinstance(value, list) else value for key, value in header["adapter"].items()}
        config = AdapterConfig(**cast("dict[str, Any]", said))
    except (KeyError, TypeError, ValueError) as error:
        raise broken(path, error, remedy) from error
    if skill is not None and config.skill != skill:
        raise CheckpointError(f"{path} is the adapter of {config.skill}, not of {skill}.", _again(skill))
    if header.get("base") != base_digest:
        trained = f"{path} was trained against base {header.get('base')}, and this base is {base_digest}."
        raise CheckpointError(trained, _again(config.skill))
    return config, own_tensors(tensors)


def read_checkpoint(path: Path, kind: str, remedy: str) -> tuple[dict[str, Any], Tensors]:
    """Return the header and the tensors of a checkpoint of one kind, `base` or `adapter`.

    Raises CheckpointError with that remedy, also for a weight that is not a finite float.
    """
    header, tensors = _open(path, remedy, weights=True)
    _check_kind(path, header, kind, remedy)
    for name, tensor in tensors.items():
        # One weight that is not finite would spread over the whole motion.
        if tensor.dtype.kind != "f" or not np.isfinite(tensor).all():
            raise CheckpointError(f"{path} holds NaN, infinity or no floats in {name}.", remedy)
    return header, tensors


def _check_kind(path: Path, header: Mapping[str, Any], kind: str, remedy: str) -> None:
    if header.get("kind") != kind:
        problem = f"{path} holds {header.get('kind')!r} weights where {kind!r} weights were expected."
        raise CheckpointError(problem, remedy)


def adapters_beside(path: Path) -> Mapping[str, Path]:
    """Return the adapters of one skill by the digest of the prior that each was trained against: the file itself, and
    files beside it such as adapter-tiny.safetensors. Unreadable ones are left out."""
    adapters: dict[str, Path] = {}
    for file in (path, *sorted(path.parent.glob(f"{path.stem}-*{path.suffix}"))):
        with suppress(CheckpointError):
            adapters.setdefault(str(read_header(file).get("base")), file)
    return adapters


def read_header(path: Path, remedy: str = "Train it with: humanclaw train", kind: str = "") -> dict[str, Any]:
    """Return the header of a base or an adapter, without its weights.

    kind: `base` or `adapter`, if it must be one. Raises CheckpointError with that remedy.
    """
    header, _ = _open(path, remedy)
    if kind:
        _check_kind(path, header, kind, remedy)
    return header


def own_tensors(tensors: Tensors) -> Tensors:
    """Return the model's own tensors of a checkpoint, by their names in the model."""
    return {name.removeprefix(MODEL): tensor for name, tensor in tensors.items() if name.startswith(MODEL)}


def broken(path: Path, error: Exception, remedy: str) -> CheckpointError:
    """Return the error for an unusable checkpoint, in one line."""
    return CheckpointError(f"{path} cannot be read as a checkpoint ({str(error).splitlines()[0]}).", remedy)


def _open(path: Path, remedy: str, weights: bool = False) -> tuple[dict[str, Any], Tensors]:
    if not path.is_file():
        raise CheckpointError(f"There is no checkpoint at {path}.", remedy)
    try:
        with path.open("rb") as stream:  # Reading a header takes sixteen times its size.
            if int.from_bytes(stream.read(8), "little") > _HEADER_BYTES:
                raise ValueError("its header is too large")
        with safe_open(str(path), framework="np") as file:
            note = (file.metadata() or {}).get(HEADER)
            tensors = {name: file.get_tensor(name) for name in file.keys()} if weights else {}  # noqa: SIM118
        header: dict[str, Any] = json.loads(note or "{}")
        if not isinstance(header, dict):
            raise ValueError("its header is not an object")
    except (SafetensorError, OSError, ValueError, RecursionError) as error:
        raise broken(path, error, remedy) from error
    if note is None:
        raise CheckpointError(f"{path} is a safetensors file, but not a checkpoint of HumanCLAW.", remedy)
    if header.get("format") != FORMAT:
        problem = f"{path} has checkpoint format {header.get('format')!r:.80}; this version reads format {FORMAT}."
        raise CheckpointError(problem, remedy)
    return header, tensors


def _again(skill: str) -> str:
    return f"Train it again with: humanclaw train adapter {skill}"
