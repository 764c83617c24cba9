"""Model files (GLB, glTF, OBJ with MTL, PLY, STL and what else trimesh reads) as plain parts."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace
from io import BytesIO
from pathlib import Path
from typing import Any, Final
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from humanclaw.errors import SceneError
from humanclaw.storage.files import MIB, Folder, read_file
from humanclaw.world.meshes.gltf import gltf_parts
from humanclaw.world.meshes.parts import MOST, Part, pixels
from humanclaw.world.meshes.polygon_files import off_part, plain_obj, ply_part, whole_stl
from humanclaw.world.meshes.polygons import unfolded

KINDS: Final = ("dae", "glb", "gltf", "obj", "off", "ply", "stl")
"""Suffixes of models that are read. trimesh also reads archives, whose size nobody knows."""
MODEL_BYTES: Final = 512 * MIB
"""Maximum bytes of a model file, and of each file that it names."""
TEXT_BYTES: Final = 32 * MIB
"""Maximum bytes of a model in text: read, it takes twenty times as much."""
_PIECES: Final = 3000
"""Maximum pieces of one material of an OBJ file: trimesh takes seconds for more."""
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
    if kind not in KINDS:
        raise SceneError(f"models are {', '.join(KINDS)}.", "Convert it, for example with Blender.")
    if kind in ("glb", "gltf"):
        read = [*gltf_parts(data, beside, lost)]
    elif kind in ("off", "ply"):
        read = [ply_part(data, beside, lost) if kind == "ply" else off_part(data)]
    else:
        read = _others(kind, data, beside, lost)
    parts = [part for part in read if len(part.faces)]
    for part in parts:
        if part.faces.min() < 0 or part.faces.max() >= len(part.vertices):
            raise ValueError(f"a triangle names vertex {part.faces.max()} of {len(part.vertices)}")
    if kind in ("off", "ply"):
        parts = [replace(part, faces=unfolded(part.vertices, part.faces, lost)) for part in parts]
    return parts


def _beside(folder: Path) -> Callable[[str], bytes]:
    """Return what reads the files that a model names: those in its own folder, and no others."""
    inside = Folder(folder)

    def read(name: str) -> bytes:
        name = name.strip().replace("\\", "/").lstrip("/")  # Windows writes one, the format wants the other.
        return inside.read(name if inside.has(name) else unquote(name), MODEL_BYTES)

    return read


def _others(kind: str, data: bytes, beside: Callable[[str], bytes], lost: Counter[str]) -> list[Part]:
    """Read a file with trimesh."""
    import trimesh
    from trimesh.resolvers import FilePathResolver

    class Beside(FilePathResolver):
        def get(self, name: str) -> bytes:
            try:
                return beside(name)
            except (OSError, ValueError):  # trimesh goes on without materials and pictures.
                lost[f"files that cannot be read ({name})"] += 1
                raise

    if kind == "obj" and data.count(b"usemtl") > _PIECES:
        raise SceneError(f"it has more than {_PIECES:,} pieces.", "Join those of one material.")
    data = {"obj": plain_obj, "stl": whole_stl}.get(kind, bytes)(data)
    # Vertices stay as they are in the file: merging them would lose texture seams.
    scene = trimesh.load_scene(BytesIO(data), kind, process=False, resolver=Beside("."))
    shapes = [scene.geometry[scene.graph[node][1]] for node in scene.graph.nodes_geometry]
    if sum(len(getattr(shape, "faces", ())) + len(getattr(shape, "vertices", ())) for shape in shapes) > MOST:
        raise SceneError(f"it holds more than {MOST:,} vertices and triangles.", "Simplify it.")
    lost.update("pieces of points or lines" for shape in shapes if not hasattr(shape, "faces"))
    return [part for name in scene.graph.nodes_geometry for part in _parts(scene, name, lost)]


def _parts(scene: Any, node: str, lost: Counter[str]) -> list[Part]:
    transform, name = scene.graph[node]
    geometry = scene.geometry[name]
    faces = np.asarray(getattr(geometry, "faces", np.zeros((0, 3))), np.int64)
    if not len(faces):
        return []
    vertices = np.asarray(geometry.vertices, float)
    faces = unfolded(vertices, faces, lost)
    vertices = vertices @ transform[:3, :3].T + transform[:3, 3]
    if np.linalg.det(transform[:3, :3]) < 0:
        faces = faces[:, ::-1]
    uv = getattr(geometry.visual, "uv", None)
    uv = None if uv is None or len(uv) != len(vertices) or not np.isfinite(uv).all() else np.asarray(uv, float)
    colour, picture = _look(geometry.visual)
    return [Part(vertices, faces, uv, colour, picture if uv is not None else None)]


def _look(visual: Any) -> tuple[tuple[int, int, int], NDArray[np.uint8] | None]:
    """Colour and picture of a trimesh visual."""
    material = getattr(visual, "material", None)
    if material is None:
        colours = np.asarray(getattr(visual, "vertex_colors", [[190, 190, 190, 255]]), float)
        return _rgb(colours.mean(axis=0)), None
    if hasattr(material, "baseColorFactor"):  # Of a DAE file, in linear light.
        colour = _rgb(255 * (np.asarray(material.baseColorFactor, float) / 255) ** (1 / 2.2))
        return colour, None if material.baseColorTexture is None else pixels(material.baseColorTexture, colour)
    # In an MTL file the colour beside a picture is commonly left at any value, and viewers ignore it.
    image = getattr(material, "image", None)
    return _rgb(material.diffuse), None if image is None else pixels(image, (255, 255, 255))


def _rgb(colour: Any) -> tuple[int, int, int]:
    red, green, blue = (round(float(value)) for value in np.asarray(colour)[:3])
    return red, green, blue
