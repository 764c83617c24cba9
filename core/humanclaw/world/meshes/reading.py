"""Model files (GLB, OBJ with MTL, PLY, STL and what else trimesh reads) as plain parts."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from humanclaw.body.pose import Array
from humanclaw.errors import SceneError
from humanclaw.storage.files import MIB, Folder, read_file

KINDS: Final = ("dae", "glb", "gltf", "obj", "off", "ply", "stl")
"""Suffixes of models that are read. trimesh also reads archives, whose size nobody knows."""
MODEL_BYTES: Final = 512 * MIB
"""Maximum bytes of a model file, and of each file that it names."""
TEXT_BYTES: Final = 32 * MIB
"""Maximum bytes of a model in text: read, it takes twenty times as much."""
_BLANK_BYTES: Final = 256 * MIB
_MOST: Final = 20_000_000
"""Maximum vertices and triangles of a model, copies included."""
_PIECES: Final = 3000
"""Maximum pieces of one material of a model in a file: trimesh takes seconds for more."""
_LARGEST_PICTURE: Final = 8192 * 8192
"""Maximum pixels of a picture."""
_WIDTHS: Final = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
_PIXELS: Final = 2048
"""The longest side at which a picture is read: an atlas keeps far less of it, and a larger one takes gigabytes."""


@dataclass(frozen=True, eq=False)
class Part:
    """Triangles of one material. vertices: (N, 3) file units, transforms applied. faces: (M, 3). uv: (N, 2), v up, or
    None."""

    vertices: Array
    faces: NDArray[np.int64]
    uv: Array | None
    colour: tuple[int, int, int]
    """sRGB colour of a part without a texture."""
    picture: NDArray[np.uint8] | None = None
    """(H, W, 3), first row at v = 1."""


def read_model(path: Path, data: bytes | None = None) -> list[Part]:
    """Read all parts of a model file, with the files that it names in its folder. data: its content, if it is known.

    Raises SceneError if it cannot be read or holds no triangle.
    """
    import trimesh

    kind = path.suffix[1:].lower()
    try:
        content = read_file(path, MODEL_BYTES if kind == "glb" else TEXT_BYTES) if data is None else data
        _check_kind(kind, content)
        # Vertices stay as they are in the file: merging them would lose texture seams.
        scene = trimesh.load_scene(BytesIO(content), kind, process=False, resolver=_beside(path.parent))
        _check_size(scene)
        parts = [part for name in scene.graph.nodes_geometry for part in _parts(scene, name)]
    except Exception as error:  # Third-party readers fail on broken files in every way there is.
        raise SceneError(f"{path.name} cannot be read: {type(error).__name__}: {error}.") from error
    if not parts:
        raise SceneError(f"{path.name} holds no triangle.")
    if not all(np.isfinite(part.vertices).all() for part in parts):
        raise SceneError(f"{path.name} holds vertices that are not numbers.")
    return parts


def _check_kind(kind: str, data: bytes) -> None:
    """Raise ValueError for an archive, and for a model that asks for more memory or time than its size tells."""
    if kind not in KINDS:
        raise ValueError(f"models are {', '.join(KINDS)}")
    if kind == "obj" and data.count(b"usemtl") > _PIECES:
        raise ValueError(f"it has more than {_PIECES:,} pieces")
    if kind not in ("glb", "gltf"):
        return
    size = int.from_bytes(data[12:16], "little")
    head = json.loads(data[20 : 20 + size] if kind == "glb" else data)
    # An accessor without a view of the data means zeros, or compressed data.
    blank = [one for one in head.get("accessors", ()) if "bufferView" not in one]
    if sum(4 * one["count"] * _WIDTHS[one["type"]] for one in blank) > _BLANK_BYTES:
        raise ValueError(f"its arrays without data are larger than {_BLANK_BYTES // MIB} MiB")
    _check_pieces(head)


def _check_pieces(head: Any) -> None:
    """Raise ValueError for a glTF file of too many pieces, or too many corners: pieces may share an array, and each
    gets a copy."""
    pieces = [piece for mesh in head.get("meshes", ()) for piece in mesh["primitives"]]
    if len(pieces) > _PIECES:
        raise ValueError(f"it has more than {_PIECES:,} pieces")
    counts = [abs(one["count"]) for one in head.get("accessors", ())]
    corners = sum(max(counts[key] for key in piece["attributes"].values()) for piece in pieces)
    triangles = sum(counts[piece["indices"]] // 3 for piece in pieces if "indices" in piece)
    if corners + triangles > _MOST:
        raise ValueError(f"it holds more than {_MOST:,} vertices and triangles")


def _check_size(scene: Any) -> None:
    """Raise ValueError if the copies of meshes have too many corners together."""
    shapes = [scene.geometry[scene.graph[node][1]] for node in scene.graph.nodes_geometry]
    if sum(len(getattr(one, "faces", ())) + len(getattr(one, "vertices", ())) for one in shapes) > _MOST:
        raise ValueError(f"it holds more than {_MOST:,} vertices and triangles")


def _beside(folder: Path) -> Any:
    """Return what reads the materials and pictures that a model names: those in its own folder, and no others."""
    from trimesh.resolvers import FilePathResolver

    class Beside(FilePathResolver):
        def get(self, name: str) -> bytes:
            return Folder(folder).read(name.strip().lstrip("/"), MODEL_BYTES)

    return Beside(str(folder))


def _parts(scene: Any, node: str) -> list[Part]:
    transform, name = scene.graph[node]
    geometry = scene.geometry[name]
    faces = np.asarray(getattr(geometry, "faces", np.zeros((0, 3))), np.int64)
    if not len(faces):
        return []
    vertices = np.asarray(geometry.vertices, float) @ transform[:3, :3].T + transform[:3, 3]
    if np.linalg.det(transform[:3, :3]) < 0:
        faces = faces[:, ::-1]
    if faces.min() < 0 or faces.max() >= len(vertices):
        raise ValueError(f"a triangle names vertex {faces.max()} of {len(vertices)}")
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
    if type(material).__name__ == "PBRMaterial":
        factor = material.baseColorFactor
        image = material.baseColorTexture
        # glTF keeps its factors in linear light.
        colour = (255, 255, 255) if factor is None else _rgb(255 * (np.asarray(factor, float) / 255) ** (1 / 2.2))
        return colour, None if image is None else _pixels(image, colour)
    # In an MTL file the colour beside a picture is commonly left at any value, and viewers ignore it.
    image = getattr(material, "image", None)
    return _rgb(material.diffuse), None if image is None else _pixels(image, (255, 255, 255))


def _rgb(colour: Any) -> tuple[int, int, int]:
    red, green, blue = (round(float(value)) for value in np.asarray(colour)[:3])
    return red, green, blue


def _pixels(image: Image.Image, tint: tuple[int, int, int]) -> NDArray[np.uint8]:
    """(H, W, 3); where the picture is see-through, the mean colour of the rest, since nothing here draws holes."""
    if image.width * image.height > _LARGEST_PICTURE:
        raise ValueError(f"its picture has {image.width} x {image.height} pixels, more than {_LARGEST_PICTURE:,}")
    picture = image.convert("RGBA")
    picture.thumbnail((_PIXELS, _PIXELS))
    rgba = np.asarray(picture, float)
    opaque = rgba[..., 3:] / 255
    mean = (rgba[..., :3] * opaque).sum(axis=(0, 1)) / max(float(opaque.sum()), 1e-6)
    filled = rgba[..., :3] * opaque + mean * (1 - opaque)
    return np.asarray(np.clip(np.round(filled * np.array(tint) / 255), 0, 255), np.uint8)


def bounds(parts: Sequence[Part]) -> tuple[Array, Array]:
    """Lowest and highest corner of some parts, file units."""
    used = np.concatenate([part.vertices[np.unique(part.faces)] for part in parts])
    return used.min(axis=0), used.max(axis=0)
