"""A folder of imported furniture: an index, and for each asset a GLB to draw and its collision hulls.

LIB/index.json              all assets; checked against this module's types when it is read
LIB/models/ID.glb           the mesh in the asset's frame: metres, +Y up, front +Z, y = 0 at the bottom
LIB/models/ID.hulls         the convex pieces (safetensors)
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from functools import cached_property
from pathlib import Path
from typing import Annotated, Final, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, ValidationError
from safetensors import SafetensorError
from safetensors.numpy import load, save

from humanclaw import HumanclawError, SceneError
from humanclaw.records import first_fault
from humanclaw.storage import write_atomically
from humanclaw.world import Asset, Mesh, read_mesh, write_model

INDEX: Final = "index.json"
_IMPORT: Final = "Make one with `humanclaw assets import SOURCE --out {}`."
Metres = Annotated[float, Field(ge=0, allow_inf_nan=False)]


class _Frozen(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class Level(_Frozen):
    """A level rectangle that objects can stand on, in the asset's frame, metres."""

    x0: float
    z0: float
    x1: float
    z1: float
    y: Metres


class Entry(_Frozen):
    """One asset of a library."""

    id: Annotated[str, Field(pattern=r"^[A-Za-z0-9.-]{1,120}$")]
    name: str
    category: str
    size: tuple[Metres, Metres, Metres]
    """Width, height, depth."""
    unit: str
    """Unit of the model file, or a note that the catalogue states the size."""
    turned: str = ""
    """Rotation that made the model face +Z."""
    seat_height: Metres | None = None
    top: Level | None = None
    mass: Metres | None = None
    movable: bool | None = None
    triangles: int
    triangles_in_source: int
    textured: bool
    hulls: int
    licence: str
    author: str
    collection: str
    source_digest: str
    """Digest of the source's files and of the metadata given for them."""
    recipe: str
    """Version and options of the import."""
    digest: str
    """Digest of the asset's two files in the library."""

    @property
    def credit(self) -> str:
        """Attribution, as licences such as CC-BY require it."""
        return f"{self.name} ({self.id}) by {self.author or 'unknown'}, from {self.collection}"


class Index(_Frozen):
    """index.json."""

    format: Literal[1] = 1
    assets: tuple[Entry, ...] = ()


class Library:
    """A library on disk, for reading."""

    def __init__(self, folder: Path) -> None:
        """Open a library. Raises HumanclawError if the folder has no index or an invalid one."""
        self.folder = folder
        self._read: dict[str, Asset] = {}
        self.index = read_index(folder)
        if self.index is None:
            raise HumanclawError(f"there is no asset library in {folder}.", _IMPORT.format(folder))

    @property
    def entries(self) -> Sequence[Entry]:
        assert self.index is not None
        return self.index.assets

    @cached_property
    def digest(self) -> str:
        """Digest of the whole library: the index holds the digests of all files."""
        return hashlib.sha256((self.folder / INDEX).read_bytes()).hexdigest()

    def asset(self, entry: Entry) -> Asset:
        """Return an asset, read on first use. Raises a SceneError that names it if a file is missing or changed."""
        if entry.id not in self._read:
            self._read[entry.id] = self._load(entry)
        return self._read[entry.id]

    def _load(self, entry: Entry) -> Asset:
        glb, hulls = paths(self.folder, entry.id)
        try:
            data = hulls.read_bytes()
            if digest_of(glb.read_bytes(), data) != entry.digest:
                raise SceneError(f"{glb} or its hulls were changed after the import.", "Import the source again.")
            pieces = load(data)
        except (OSError, SafetensorError) as error:
            raise SceneError(
                f"asset {entry.id} of {self.folder} cannot be read: {error}.", "Import it again."
            ) from error
        points = tuple(pieces[str(number)] for number in range(len(pieces)))
        return Asset(
            entry.id, entry.category, read_mesh(glb), points, entry.seat_height, source=entry.credit,
            licence=entry.licence,
        )  # fmt: skip


def read_index(folder: Path) -> Index | None:
    """Return the index of a library; None if there is none. Raises HumanclawError if it is invalid."""
    path = folder / INDEX
    if not path.is_file():
        return None
    try:
        return Index.model_validate_json(path.read_text("utf-8"))
    except (ValidationError, UnicodeDecodeError) as error:
        fault = first_fault(error) if isinstance(error, ValidationError) else str(error)
        said = f"{path} is not the index of an asset library: {fault}."
        raise HumanclawError(said, "Remove it and import again.") from error


def write_index(folder: Path, entries: Sequence[Entry]) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    index = Index(assets=tuple(sorted(entries, key=lambda entry: entry.id)))
    write_atomically(folder / INDEX, (index.model_dump_json(indent=1) + "\n").encode())


def write_asset(folder: Path, name: str, mesh: Mesh, hulls: Sequence[NDArray[np.float32]]) -> str:
    """Write the two files of an asset and return their digest."""
    glb, packed = write_model(mesh), save({str(number): hull for number, hull in enumerate(hulls)})
    (folder / "models").mkdir(parents=True, exist_ok=True)
    for path, data in zip(paths(folder, name), (glb, packed), strict=True):
        write_atomically(path, data)
    return digest_of(glb, packed)


def paths(folder: Path, name: str) -> tuple[Path, Path]:
    return folder / "models" / f"{name}.glb", folder / "models" / f"{name}.hulls"


def digest_of(*files: bytes) -> str:
    state = hashlib.sha256()
    for data in files:
        state.update(hashlib.sha256(data).digest())
    return state.hexdigest()
