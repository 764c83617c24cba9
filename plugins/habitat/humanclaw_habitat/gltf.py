"""Prepare GLB files of Habitat's tools for trimesh: decode KTX2 textures, and refuse unknown extensions by name."""

from __future__ import annotations

import base64
import importlib.util
import io
import json
import struct
from typing import Any, Final

from PIL import Image

from humanclaw import SceneError

_JSON: Final = 0x4E4F534A
_BASIS: Final = "KHR_texture_basisu"
_DRACO: Final = "KHR_draco_mesh_compression"
_KNOWN: Final = frozenset({_BASIS, "EXT_texture_webp", "KHR_lights_punctual"})
"""Required extensions that do not change the shape of a model. Those of materials (KHR_materials_*) are extra."""
_PIXELS: Final = 512
"""Longest side of a decoded texture, pixels. The cell of a texture in the atlas is smaller."""
_FETCH: Final = "Fetch it again; in a git checkout run `git lfs pull`."
PLAIN: Final = "KTX2 textures are not read, so it is drawn in the base colours of its materials"


def readable(data: bytes, name: str) -> tuple[bytes, tuple[str, ...]]:
    """Return a GLB that trimesh can read, and messages about what is lost.

    Raises SceneError if it is not a GLB or requires an unknown extension.
    """
    head, rest = _split(data, name)
    try:
        return _converted(data, head, rest, name)
    except (AttributeError, IndexError, KeyError, TypeError, ValueError) as error:
        raise SceneError(f"{name} is a broken GLB file: {type(error).__name__}: {error}.", _FETCH) from error


def _converted(data: bytes, head: dict[str, Any], rest: bytes, name: str) -> tuple[bytes, tuple[str, ...]]:
    _check(head, name)
    images = {number for number, image in enumerate(head.get("images", ())) if _is_basis(image)}
    lost = [texture for texture in head.get("textures", ()) if _source(texture) in images]
    if not lost:
        return data, ()
    if not importlib.util.find_spec("alktx2"):
        return data, (PLAIN,)
    for number in images:
        head["images"][number] = _decoded(head, head["images"][number], rest, name)
    for texture in lost:
        texture["source"] = _source(texture)
    return _join(head, rest), ()


def _split(data: bytes, name: str) -> tuple[dict[str, Any], bytes]:
    """Return the JSON of a GLB, and the chunks after it."""
    if data[:4] != b"glTF":
        said = data[:40].split(b"\n")[0].decode("ascii", "replace")
        raise SceneError(f"{name} is not a GLB file; it begins with {said!r}.", _FETCH)
    try:
        size, length, kind = struct.unpack_from("<III", data, 8)
        if kind != _JSON or len(data) < size:
            raise ValueError(f"it has {len(data)} of its {size} bytes")
        return json.loads(data[20 : 20 + length]), data[20 + length : size]
    except (struct.error, ValueError, RecursionError) as error:
        raise SceneError(f"{name} is a broken GLB file: {error}.", _FETCH) from error


def _check(head: dict[str, Any], name: str) -> None:
    """Raise SceneError if a model requires an unknown extension that may change its shape."""
    required = {
        extension for extension in head.get("extensionsRequired", ()) if not extension.startswith("KHR_materials_")
    }
    if _DRACO in required and not importlib.util.find_spec("DracoPy"):
        raise SceneError(f"{name} is compressed with {_DRACO}.", "Run `pip install DracoPy`.")
    unknown = sorted(required - _KNOWN - {_DRACO})
    if unknown:
        raise SceneError(
            f"{name} needs the glTF extension {', '.join(unknown)}, which is not supported.",
            "Write it without, for example with `gltf-transform copy` or `gltf-transform dequantize`.",
        )


def _is_basis(image: dict[str, Any]) -> bool:
    return image.get("mimeType") == "image/ktx2" or str(image.get("uri", "")).lower().endswith(".ktx2")


def _source(texture: dict[str, Any]) -> int | None:
    """Return the image index of a texture, preferring other formats to KTX2."""
    inner = texture.get("extensions", {}).get(_BASIS, {}).get("source")
    source = texture.get("source", inner)
    return source if isinstance(source, int) else None


def _decoded(head: dict[str, Any], image: dict[str, Any], rest: bytes, name: str) -> dict[str, Any]:
    """Convert a KTX2 image of a GLB to a small PNG embedded in the JSON."""
    import alktx2  # type: ignore[import-not-found,unused-ignore]

    view = head["bufferViews"][image["bufferView"]]
    first = 8 + view.get("byteOffset", 0)  # The binary chunk begins with its length and kind, 4 bytes each.
    try:
        picture, _ = alktx2.decode_ktx2_to_bytes(rest[first : first + view["byteLength"]], format="png")
        found = Image.open(io.BytesIO(picture))
        found.thumbnail((_PIXELS, _PIXELS))
    except Exception as error:  # The native decoder raises errors of many types for broken files.
        raise SceneError(f"{name} holds a KTX2 texture that cannot be decoded: {error}.", _FETCH) from error
    out = io.BytesIO()
    found.save(out, "PNG")
    return {"uri": "data:image/png;base64," + base64.b64encode(out.getvalue()).decode()}


def _join(head: dict[str, Any], rest: bytes) -> bytes:
    text = json.dumps(head).encode()
    text += b" " * (-len(text) % 4)  # Chunks of a GLB are padded to multiples of 4 bytes.
    return b"glTF" + struct.pack("<IIII", 2, 20 + len(text) + len(rest), len(text), _JSON) + text + rest
