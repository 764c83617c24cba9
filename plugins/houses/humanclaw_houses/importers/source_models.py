"""What a collection says of its models, in one form whatever the collection is."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

Vec3 = tuple[float, float, float]


@dataclass(frozen=True)
class SourceModel:
    """One model that can be imported."""

    id: str
    """Unique in its collection, letters, digits and dashes."""
    name: str
    """What people call it."""
    fetch: Callable[[Path], Path]
    """Puts the model and what belongs to it into an empty folder, if it is not on disk, and returns the model's
    path."""
    group: str = ""
    """The collection's own category."""
    category: str = ""
    """Ours, where the collection was labelled by hand."""
    size: Vec3 | None = None
    """Width, height, depth in metres; None where the file itself has to tell."""
    rotation: tuple[float, ...] | None = None
    """(9,) row-major, to be applied to the vertices first."""
    front: str = "+z"
    """The way its front faces in the file, after the rotation."""
    mass: float | None = None
    movable: bool | None = None
    author: str = ""
    licence: str = ""

    @property
    def statement(self) -> str:
        """Everything said of the model, as text for a digest."""
        rest = {key: value for key, value in vars(self).items() if key != "fetch"}
        return repr(sorted(rest.items()))


@dataclass(frozen=True)
class Collection:
    """A collection of models under one name."""

    name: str
    models: Sequence[SourceModel]
    passed_over: int = 0
    """Doors, windows and other objects that the collection says are no furniture."""


def digest_of(path: Path, statement: str) -> str:
    """SHA-256 of a model file, of what lies beside it with a known role, and of what is said of it."""
    state = hashlib.sha256(statement.encode())
    beside = [path]
    if path.suffix.lower() != ".glb":
        beside = sorted(p for p in path.parent.iterdir() if p.suffix.lower() in _ROLES)
    for file in beside:
        state.update(file.name.encode() + file.read_bytes())
    return state.hexdigest()


_ROLES = {".obj", ".mtl", ".png", ".jpg", ".jpeg", ".gltf", ".bin", ".glb", ".dae", ".ply", ".stl"}
