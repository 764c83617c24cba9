"""Model files (GLB, glTF, OBJ with MTL, OFF, PLY, STL) as plain parts."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Final
from urllib.parse import unquote

import numpy as np

from humanclaw.errors import SceneError
from humanclaw.storage.files import MIB, Folder, read_file
from humanclaw.world.meshes.gltf import gltf_parts
from humanclaw.world.meshes.obj import obj_parts
from humanclaw.world.meshes.parts import Part
from humanclaw.world.meshes.polygon_files import off_parts, ply_parts, stl_parts

_READERS: Final = {
    "glb": gltf_parts, "gltf": gltf_parts, "obj": obj_parts, "off": off_parts, "ply": ply_parts, "stl": stl_parts,
}  # fmt: skip
MODEL_BYTES: Final = 512 * MIB
"""Maximum bytes of a model file, and of each file that it names."""
TEXT_BYTES: Final = 32 * MIB
"""Maximum bytes of a model in text: read, it takes twenty times as much."""
_LFS: Final = b"version https://git-lfs"


@dataclass(frozen=True, eq=False)
class Model:
    """The content of a model file."""

    parts: list[Part]
    left_out: tuple[str, ...]
    """What of the file no part holds, each with its count."""


def read_model(path: Path) -> Model:
    """Read a model file, with the files that it names in its folder.

    Raises SceneError if it cannot be read, holds no triangle, or would be another shape than its file says.
    """
    kind, lost = path.suffix[1:].lower(), Counter[str]()
    try:
        data = read_file(path, MODEL_BYTES if kind == "glb" else TEXT_BYTES)
        if data.startswith(_LFS):
            raise SceneError("it is a pointer of git-lfs.", "Run `git lfs pull` in its folder.")
        parts = _read(kind, data, _beside(path.parent), lost)
    except SceneError as error:
        raise SceneError(f"{path} cannot be read: {error.message}", error.remedy) from error
    except Exception as error:  # Broken files make readers fail in every way there is.
        said = f"{path} cannot be read: {type(error).__name__}: {error}."
        raise SceneError(said, "" if isinstance(error, ImportError) else "Check that the file is complete.") from error
    if not parts:
        raise SceneError(f"{path} holds no triangle.", "Export its surfaces as a mesh.")
    if not all(np.isfinite(part.vertices).all() for part in parts):
        raise SceneError(f"{path} holds vertices that are not numbers.", "Export it again.")
    return Model(parts, tuple(f"{what}: {count}" for what, count in lost.items()))


def _read(kind: str, data: bytes, beside: Callable[[str], bytes], lost: Counter[str]) -> list[Part]:
    if kind not in _READERS:
        raise SceneError(f"models are {', '.join(_READERS)}.", "Convert it to glb, for example with Blender.")
    parts = [part for part in _READERS[kind](data, beside, lost) if len(part.faces)]
    for part in parts:
        if part.faces.min() < 0 or part.faces.max() >= len(part.vertices):
            raise ValueError(f"a triangle names vertex {part.faces.max()} of {len(part.vertices)}")
    return parts


def _beside(folder: Path) -> Callable[[str], bytes]:
    """Return what reads the files that a model names: those in its own folder, and no others."""
    inside = Folder(folder)

    def read(name: str) -> bytes:
        name = name.strip().replace("\\", "/").lstrip("/")  # Windows writes one, the format wants the other.
        names = (name, unquote(name), name.rpartition("/")[2])  # The last for a path on the maker's own disk.
        return inside.read(next(filter(inside.has, names), name), MODEL_BYTES)

    return read
