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
from humanclaw.storage import Folder
from humanclaw.world import Asset, Mesh, read_mesh, write_model

INDEX: Final = "index.json"
LARGEST: Final = 256 << 20
"""Maximum bytes of each file."""
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
        return Folder(self.folder).digest(INDEX, LARGEST)

    def asset(self, entry: Entry) -> Asset:
        """Return an asset, read on first use. Raises a SceneError that names it if a file is missing or changed."""
        if entry.id not in self._read:
            self._read[entry.id] = self._load(entry)
        return self._read[entry.id]

    def _load(self, entry: Entry) -> Asset:
        glb, hulls = paths(entry.id)
        try:
            model, data = (Folder(self.folder).read(name, LARGEST) for name in (glb, hulls))
            if digest_of(model, data) != entry.digest:
                raise SceneError(
                    f"{self.folder / glb} or its hulls were changed after the import.", "Import the source again."
                )
            pieces = load(data)
            points = tuple(pieces[str(number)] for number in range(len(pieces)))
        except (OSError, SafetensorError, KeyError) as error:
            told = error.strerror if isinstance(error, OSError) else error
            raise SceneError(
                f"asset {entry.id} of {self.folder} cannot be read: {told}.", "Import it again."
            ) from error
        return Asset(
            entry.id, entry.category, read_mesh(self.folder / glb, model), points, entry.seat_height,
            source=entry.credit, licence=entry.licence,
        )  # fmt: skip


def read_index(folder: Path) -> Index | None:
    """Return the index of a library; None if there is none. Raises HumanclawError if it is invalid."""
    path = folder / INDEX
    try:
        return Index.model_validate_json(Folder(folder).read(INDEX, LARGEST))
    except FileNotFoundError:
        return None
    except (ValidationError, OSError) as error:
        fault = first_fault(error) if isinstance(error, ValidationError) else error.strerror
        said = f"{path} is not the index of an asset library: {fault}."
        raise HumanclawError(said, "Remove it and import again.") from error


def write_index(folder: Path, entries: Sequence[Entry]) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    index = Index(assets=tuple(sorted(entries, key=lambda entry: entry.id)))
    Folder(folder).write(INDEX, (index.model_dump_json(indent=1) + "\n").encode())


def write_asset(folder: Path, name: str, mesh: Mesh, hulls: Sequence[NDArray[np.float32]]) -> str:
    """Write the two files of an asset and return their digest."""
    glb, packed = write_model(mesh), save({str(number): hull for number, hull in enumerate(hulls)})
    folder.mkdir(parents=True, exist_ok=True)
    for file, data in zip(paths(name), (glb, packed), strict=True):
        Folder(folder).write(file, data)
    return digest_of(glb, packed)


def paths(name: str) -> tuple[str, str]:
    """Return the names of an asset's files in the library."""
    return f"models/{name}.glb", f"models/{name}.hulls"


def digest_of(*files: bytes) -> str:
    state = hashlib.sha256()
    for data in files:
        state.update(hashlib.sha256(data).digest())
    return state.hexdigest()
