"""Model files (GLB, glTF, OBJ with MTL, OFF, PLY, STL) as plain parts."""

from __future__ import annotations

import errno
import json
import os
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Final
from urllib.parse import unquote

import numpy as np

from humanclaw.errors import SceneError
from humanclaw.storage.files import MIB, Folder, open_file
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
"""Maximum bytes of a model in text: read, it takes twenty times as much, but for OBJ."""
_LIGHT: Final = {"glb": b"", "obj": b"", "ply": b"\nformat binary", "stl": b"\0"}
"""What the beginning of a model holds that takes less, by its kind: most are in bytes."""
_FAR: Final = 1e37
"""What no vertex lies beyond, in the unit of its file: a number of 32 bits holds no more."""
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
        data = _content(path, kind)
        if data.startswith(_LFS):
            raise SceneError("it is a pointer of git-lfs.", "Run `git lfs pull` in its folder.")
        parts = _read(kind, data, _beside(path.parent), lost)
    except SceneError as error:
        raise SceneError(f"{path} cannot be read: {error.message}", error.remedy) from error
    except Exception as error:  # Broken files make readers fail in every way there is.
        reason, remedy = _told(error, path)
        raise SceneError(f"{path} cannot be read: {reason}.", remedy) from error
    if not parts:
        raise SceneError(f"{path} holds no triangle.", "Export its surfaces as a mesh.")
    if not all((np.abs(part.vertices) < _FAR).all() for part in parts):
        raise SceneError(f"{path} holds vertices that are not numbers below {_FAR:g}.", "Export it again.")
    return Model(parts, tuple(f"{what}: {count}" for what, count in lost.items()))


def _told(error: Exception, path: Path) -> tuple[str, str]:
    """Return what a reader failed on, and what helps."""
    remedy = "Check that the file is complete."
    match error:
        case json.JSONDecodeError():
            return f"its JSON breaks off in line {error.lineno}, column {error.colno}: {error.msg}", remedy
        case FileNotFoundError() if Path(error.filename).name != path.name:
            return f"{error.filename}, which it names, is not beside it", "Copy it there, or export one glb."
        case KeyError():
            return f"{error} is missing in it, or unknown", remedy
        case TypeError() | AttributeError():
            return f"it holds a value of the wrong kind ({error})", "Export it again."
        case ValueError():
            return str(error).rstrip("."), remedy
    return f"{type(error).__name__}: {error}", "" if isinstance(error, ImportError) else remedy


def _content(path: Path, kind: str) -> bytes:
    """Return the bytes of a model file. Raises SceneError for one that is too large."""
    most, mark = MODEL_BYTES, _LIGHT.get(kind)
    try:
        with open_file(path, most) as stream:
            if mark is None or mark not in stream.peek():
                most = TEXT_BYTES
            if os.fstat(stream.fileno()).st_size > most:
                raise OSError(errno.EFBIG, os.strerror(errno.EFBIG))
            return stream.read()
    except OSError as error:
        if error.errno != errno.EFBIG:
            raise
        raise SceneError(f"it is larger than {most // MIB} MiB.", "Simplify it, or convert it to glb.") from error


def _read(kind: str, data: bytes, beside: Callable[[str], bytes], lost: Counter[str]) -> list[Part]:
    if kind not in _READERS:
        raise SceneError(f"models are {', '.join(_READERS)}.", "Convert it to glb, for example with Blender.")
    parts = [part for part in _READERS[kind](data, beside, lost) if len(part.faces)]
    for part in parts:
        if (wrong := part.faces[(part.faces < 0) | (part.faces >= len(part.vertices))]).size:
            raise ValueError(f"a triangle names vertex {wrong[0]} of {len(part.vertices)}")
    return parts


def _beside(folder: Path) -> Callable[[str], bytes]:
    """Return what reads the files that a model names: those in its own folder, and no others."""
    inside = Folder(folder)

    def read(name: str) -> bytes:
        name = name.strip().replace("\\", "/").lstrip("/")  # Windows writes one, the format wants the other.
        names = (name, unquote(name), name.rpartition("/")[2])  # The last for a path on the maker's own disk.
        return inside.read(next(filter(inside.has, names), name), MODEL_BYTES)

    return read
