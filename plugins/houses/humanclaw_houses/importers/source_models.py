"""The metadata of a collection's models, in one form for every kind of collection."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from humanclaw.storage import read_file
from humanclaw.world import MODEL_BYTES

Vec3 = tuple[float, float, float]


@dataclass(frozen=True)
class SourceModel:
    """One model that can be imported."""

    id: str
    """Unique in its collection; letters, digits and dashes."""
    name: str
    """Name for people."""
    fetch: Callable[[Path], Path]
    """Returns the model's path; if it is not on disk yet, first puts it and its textures into an empty folder."""
    group: str = ""
    """Category in the collection's own terms."""
    category: str = ""
    """Category in this project's terms, if the collection was labelled by hand."""
    size: Vec3 | None = None
    """Width, height, depth in metres; None if only the file shows it."""
    rotation: tuple[float, ...] | None = None
    """(9,) row-major matrix to apply to the vertices first."""
    front: str = "+z"
    """Direction of the front in the file, after the rotation."""
    mass: float | None = None
    movable: bool | None = None
    author: str = ""
    licence: str = ""

    @property
    def statement(self) -> str:
        """All metadata of the model, as text for a digest."""
        rest = {key: value for key, value in vars(self).items() if key != "fetch"}
        return repr(sorted(rest.items()))


@dataclass(frozen=True)
class Collection:
    """A collection of models under one name."""

    name: str
    models: Sequence[SourceModel]
    passed_over: int = 0
    """Number of doors, windows and stairs, which the collection marks as such."""


def digest_of(path: Path, statement: str) -> str:
    """Return the SHA-256 of a model file, of model and texture files beside it, and of its metadata."""
    state = hashlib.sha256(statement.encode())
    beside = [path]
    if path.suffix.lower() != ".glb":
        beside = sorted(p for p in path.parent.iterdir() if p.suffix.lower() in _ROLES)
    for file in beside:
        state.update(file.name.encode() + read_file(file, MODEL_BYTES))
    return state.hexdigest()


_ROLES = {".obj", ".mtl", ".png", ".jpg", ".jpeg", ".gltf", ".bin", ".glb", ".dae", ".ply", ".stl"}
