"""glTF 2.0: the pieces of a file as its nodes, bones and morph weights place them, in the colours of its materials.

Animations, lights, cameras and all of a material but its base colour have no place in a part.
"""

from __future__ import annotations

import base64
import importlib.util
import json
import struct
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from io import BytesIO
from typing import Any, Final
from urllib.parse import unquote_to_bytes

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from humanclaw.body.pose import Array
from humanclaw.errors import SceneError
from humanclaw.storage.files import MIB
from humanclaw.world.meshes.parts import CLAMPED, CLEAR, MOST, PLAIN, SHINING, Part, goes_beyond, mean_of, pixels

_GLB, _JSON, _BINARY = 0x46546C67, 0x4E4F534A, 0x004E4942  # "glTF", "JSON", "BIN\0".
_TYPES: Final = {5120: np.int8, 5121: np.uint8, 5122: np.int16, 5123: np.uint16, 5125: np.uint32, 5126: np.float32}
_WIDTHS: Final = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
_TRIANGLES, _STRIP, _FAN = 4, 5, 6  # As OpenGL numbers them, and the types above.
_REPEAT: Final = 10497
"""Magic numbers of GLB and its chunks, types, widths and modes of triangles: all from the specification of glTF 2.0."""
_PIECES: Final = 20_000
"""Maximum pieces of a model, copies included: each takes a tenth of a millisecond and more."""
_BLANK_BYTES: Final = 256 * MIB
"""Maximum bytes of an array that a file only announces: zeros cost the file nothing, and here all their memory."""
_DRACO: Final = "KHR_draco_mesh_compression"
_COPIES: Final = "EXT_mesh_gpu_instancing"
_VISIBLE: Final = "KHR_node_visibility"
_GLOSS, _TURNED = "KHR_materials_pbrSpecularGlossiness", "KHR_texture_transform"
_HARMLESS: Final = (
    "KHR_materials_",
    "KHR_techniq",
    "KHR_texture_",
    "EXT_texture_",
    "KHR_lights_",
    "KHR_mesh_quantization",
    "KHR_animation_pointer",
    _COPIES,
    _VISIBLE,
)
"""How the required extensions begin that are read, or that leave the shape of a model as it is."""
_FETCH: Final = "Fetch the file again."


def gltf_parts(data: bytes, beside: Callable[[str], bytes], lost: Counter[str]) -> Iterator[Part]:
    """Yield the parts of a GLB or .gltf file. beside: reads a file that it names. lost: counts what is left out.

    Raises SceneError for a file of another version, for an extension that may change its shape, and for more pieces or
    corners than MOST; for a broken file whatever the fault leads to.
    """
    head, binary = _split(data)
    _check(head)
    yield from _File(head, binary, beside, lost).parts()


def _split(data: bytes) -> tuple[Any, bytes]:
    """Return the JSON and the binary chunk of a file."""
    if data[:4] != b"glTF":
        return json.loads(data), b""
    if len(data) < 12:  # Magic, version and size; then chunks, each behind its length and kind.
        raise SceneError(f"it has only {len(data)} bytes.", _FETCH)
    version, size = struct.unpack_from("<II", data, 4)
    if version != 2:
        raise _of_version(version)
    if len(data) < size:
        raise SceneError(f"it has {len(data)} of its {size} bytes.", _FETCH)
    chunks, at = dict[int, bytes](), 12
    while at + 8 <= size:
        length, kind = struct.unpack_from("<II", data, at)
        chunks.setdefault(kind, data[at + 8 : at + 8 + length])
        at += 8 + length
    if _JSON not in chunks:
        raise SceneError("it holds no JSON.", _FETCH)
    return json.loads(chunks[_JSON]), chunks.get(_BINARY, b"")


def _check(head: Any) -> None:
    version = str(head["asset"]["version"])
    if version.partition(".")[0] != "2":
        raise _of_version(version)
    if unknown := [name for name in head.get("extensionsRequired", ()) if not name.startswith((*_HARMLESS, _DRACO))]:
        raise SceneError(
            f"it needs the glTF extension {', '.join(unknown)}, which may change its shape and is not supported.",
            "Write it without, for example with `gltf-transform copy`.",
        )


def _of_version(version: object) -> SceneError:
    return SceneError(f"it must be glTF 2; it is glTF {version}.", "Convert it, for example with Blender.")


@dataclass
class _File:
    """A file, and what of it is decoded so far."""

    head: Any
    binary: bytes
    beside: Callable[[str], bytes]
    lost: Counter[str]
    buffers: dict[int, bytes] = field(default_factory=dict)
    hidden: set[int] = field(default_factory=set)
    """Nodes of the scene that are hidden, themselves or below another."""
    pictures: dict[tuple[int, tuple[int, int, int]], NDArray[np.uint8] | None] = field(default_factory=dict)

    def parts(self) -> Iterator[Part]:
        places = self._places()
        nodes = [(number, self.named("nodes", number)) for number in places if number not in self.hidden]
        self.lost.update("hidden pieces" for number in self.hidden if "mesh" in self.named("nodes", number))
        shown = [(number, node, copy) for number, node in nodes if "mesh" in node for copy in self._copies(node)]
        self._check_size([self.named("meshes", node["mesh"]) for _, node, _ in shown])
        for number, node, copy in shown:
            mesh, there = self.named("meshes", node["mesh"]), places | {number: places[number] @ copy}
            weights = node.get("weights", mesh.get("weights", ()))
            for piece in mesh["primitives"]:
                mode = piece.get("mode", _TRIANGLES)
                if mode not in range(_FAN + 1):
                    raise SceneError(f"the mode of a piece must be 0 to {_FAN}, not {mode!r}.", "Export it again.")
                if mode < _TRIANGLES:
                    self.lost["pieces of points or lines"] += 1
                elif self._corners(piece) < 3:
                    self.lost["pieces without a triangle"] += 1
                else:
                    yield self._part(_Piece(self, piece), weights, there, number)

    def _corners(self, piece: Any) -> int:
        """Return how many corners the triangles of a piece have, 0 without vertices."""
        number = piece.get("indices", piece["attributes"].get("POSITION"))
        return self.named("accessors", number)["count"] if "POSITION" in piece["attributes"] else 0

    def _check_size(self, meshes: list[Any]) -> None:
        """Raise SceneError if the copies of meshes have too many pieces or corners together."""
        pieces = [piece for mesh in meshes for piece in mesh["primitives"]]

        def count(number: Any) -> int:
            return abs(int(self.named("accessors", number)["count"]))

        corners = sum(
            max(map(count, piece["attributes"].values()), default=0)
            + (count(piece["indices"]) if "indices" in piece else 0) // 3
            for piece in pieces
        )
        if corners > MOST or len(pieces) > _PIECES:
            raise SceneError(
                f"it holds more than {MOST:,} vertices and triangles, or {_PIECES:,} pieces.", "Simplify it."
            )

    def _copies(self, node: Any) -> list[Array]:
        """Return the (4, 4) frames of the copies of a node's mesh, in the frame of the node."""
        named = node.get("extensions", {}).get(_COPIES, {}).get("attributes", {})
        named = {name.lower(): number for name, number in named.items() if not name.startswith("_")}
        if any(self.named("accessors", number)["count"] > _PIECES for number in named.values()):
            raise SceneError(f"it holds more than {_PIECES:,} pieces.", "Simplify it.")
        values = {name: self.array(number) for name, number in named.items()}
        return [_frame(dict(zip(values, row, strict=True))) for row in zip(*values.values(), strict=True)] or [
            np.eye(4)
        ]

    def _part(self, piece: _Piece, weights: Any, places: dict[int, Array], node: int) -> Part:
        points, faces = piece.points(weights), piece.faces()
        frames = self._bones(piece, places, node)
        if frames.ndim == 2:
            points = points @ frames[:3, :3].T + frames[:3, 3]
        else:
            points = np.einsum("nij,nj->ni", frames[:, :3, :3], points) + frames[:, :3, 3]
        if np.linalg.det(frames.reshape(-1, 4, 4)[0, :3, :3]) < 0:
            faces = faces[:, ::-1]
        colour, picture, uv = piece.look()
        fits = uv is not None and len(uv) == len(points) and bool(np.isfinite(uv).all())
        return Part(points, faces, uv if fits else None, colour, picture if fits else None)

    # -- where it is ---------------------------------------------------------------------------------------------------
    def _places(self) -> dict[int, Array]:
        """Return the (4, 4) frame of each node of the scene in the world."""
        nodes = self.head.get("nodes", [])
        inner = {child for node in nodes for child in node.get("children", ())}
        scenes = self.head.get("scenes")
        shown = self.named("scenes", self.head.get("scene", 0)) if scenes else None
        roots = sorted(set(range(len(nodes))) - inner) if shown is None else shown.get("nodes", ())
        places, left = dict[int, Array](), [(root, np.eye(4), True) for root in roots]
        while left:
            number, above, seen = left.pop()
            if number not in places:
                node = self.named("nodes", number)
                places[number] = above @ _frame(node)
                seen &= node.get("extensions", {}).get(_VISIBLE, {}).get("visible", True)
                self.hidden |= set() if seen else {number}
                left += [(child, places[number], seen) for child in node.get("children", ())]
        return places

    def _bones(self, piece: _Piece, places: dict[int, Array], node: int) -> Array:
        """Return the (4, 4) frame of a piece, or the (N, 4, 4) frames of the vertices of one with bones, whose node
        does not move it."""
        if "skin" not in self.named("nodes", node) or "JOINTS_0" not in piece:
            return places[node]
        skin = self.named("skins", self.named("nodes", node)["skin"])
        if not places.keys() >= set(skin["joints"]):
            raise SceneError("it hangs on a bone that is not in its scene.", "Export it with all its bones.")
        bones = np.stack([places[joint] for joint in skin["joints"]])
        if "inverseBindMatrices" in skin:
            bones = bones @ self.array(skin["inverseBindMatrices"]).reshape(-1, 4, 4).swapaxes(1, 2)[: len(bones)]
        sets = [number for number in range(8) if f"JOINTS_{number}" in piece]
        joints = np.concatenate([piece[f"JOINTS_{number}"] for number in sets], axis=1).astype(int)
        shares = np.concatenate([piece[f"WEIGHTS_{number}"] for number in sets], axis=1)
        # One column after the other: all at once would take 128 bytes for each of them.
        frames = sum(share[:, None, None] * bones[joint] for joint, share in zip(joints.T, shares.T, strict=True))
        whole = shares.sum(axis=1)[:, None, None]
        # A vertex on which no bone has a share stays where the file has it.
        return np.asarray(np.where(whole > 0, frames / np.where(whole > 0, whole, 1), np.eye(4)))

    def named(self, kind: str, number: Any) -> Any:
        """Return one of the file's nodes, accessors and so on. Raises SceneError if it has none of this number."""
        items = self.head.get(kind, ())
        if number not in range(len(items)):
            raise SceneError(f"it names number {number} of its {len(items)} {kind}.", "Export it again.")
        return items[number]

    # -- data ----------------------------------------------------------------------------------------------------------
    def array(self, number: int) -> NDArray[Any]:
        """Return the (count, width) values of an accessor; normalised integers as numbers from -1 to 1."""
        accessor = self.named("accessors", number)
        kind, width, count = np.dtype(_TYPES[accessor["componentType"]]), _WIDTHS[accessor["type"]], accessor["count"]
        if "bufferView" in accessor:
            values = self._values(accessor, count, kind, width)
        elif count * width * kind.itemsize > _BLANK_BYTES:
            raise ValueError(f"its arrays without data are larger than {_BLANK_BYTES // MIB} MiB")
        else:
            values = np.zeros((count, width), kind)
        if "sparse" in accessor:
            sparse, values = accessor["sparse"], values.copy()
            indices = np.dtype(_TYPES[sparse["indices"]["componentType"]])
            rows = self._values(sparse["indices"], sparse["count"], indices, 1)[:, 0]
            values[rows] = self._values(sparse["values"], sparse["count"], kind, width)
        return _normalised(values) if accessor.get("normalized") else values

    def _values(self, place: Any, count: int, kind: np.dtype[Any], width: int) -> NDArray[Any]:
        view, size = self.named("bufferViews", place["bufferView"]), kind.itemsize * width
        stride = view.get("byteStride", size)
        if stride < size:
            raise ValueError(f"a stride of {stride} bytes is less than a value's {size}")
        data, first = self.view(place["bufferView"]), place.get("byteOffset", 0)
        if count and first + stride * (count - 1) + size > len(data):
            raise SceneError(f"an array of {count} values has only {len(data) - first} bytes of data.", _FETCH)
        return np.ndarray((count, width), kind, data, first, (stride, kind.itemsize))

    def view(self, number: int) -> bytes:
        view = self.named("bufferViews", number)
        first, length = view.get("byteOffset", 0), view["byteLength"]
        content = self._buffer(view["buffer"])[first : first + length]
        if len(content) != length:
            raise SceneError(f"its data end before byte {first + length}.", _FETCH)
        return content

    def _buffer(self, number: int) -> bytes:
        if number not in self.buffers:
            uri = self.named("buffers", number).get("uri")
            inside = b"" if number else self.binary  # Only the first buffer may be the file's own chunk.
            self.buffers[number] = inside if uri is None else self._content(uri)
        return self.buffers[number]

    def _content(self, uri: str) -> bytes:
        """Return the data of a URI: its own, or a file's."""
        if not uri.startswith("data:"):
            return self.beside(uri)
        kind, _, text = uri.partition(",")
        return base64.b64decode(text) if kind.endswith(";base64") else unquote_to_bytes(text)

    def picture(self, number: int, tint: tuple[int, int, int]) -> NDArray[np.uint8] | None:
        """Return the picture of a texture, tinted; None if it cannot be read."""
        texture = self.named("textures", number)
        others = [image.get("source") for image in texture.get("extensions", {}).values()]
        source = next((image for image in (texture.get("source"), *others) if image is not None), None)
        if source is None:
            return None
        if (source, tint) not in self.pictures:
            self.pictures[source, tint] = self._read_picture(self.named("images", source), tint)
        return self.pictures[source, tint]

    def _read_picture(self, image: Any, tint: tuple[int, int, int]) -> NDArray[np.uint8] | None:
        try:
            data = self.view(image["bufferView"]) if "bufferView" in image else self._content(image["uri"])
            if data[1:7] == b"KTX 20" or image.get("mimeType") == "image/ktx2":
                if not importlib.util.find_spec("alktx2"):
                    self.lost["KTX2 pictures (`pip install alktx2` reads them)"] += 1
                    return None
                import alktx2  # type: ignore[import-not-found,unused-ignore]  # Optional.

                data, _ = alktx2.decode_ktx2_to_bytes(data, format="png")
            return pixels(Image.open(BytesIO(data)), tint)
        except Exception as error:  # Decoders fail on broken pictures in every way there is.
            name = image.get("uri", type(error).__name__)[:80]  # A URI may be the whole picture.
            self.lost[f"pictures that cannot be read ({name})"] += 1
            return None


@dataclass
class _Piece:
    """Triangles of one material, before they are placed."""

    file: _File
    facts: Any

    def __post_init__(self) -> None:
        self._own = self._decoded()

    def __contains__(self, name: str) -> bool:
        return name in self.facts["attributes"]

    def __getitem__(self, name: str) -> NDArray[Any]:
        return self._own[name] if name in self._own else self.file.array(self.facts["attributes"][name])

    def _decoded(self) -> dict[str, NDArray[Any]]:
        """Return the arrays that Draco holds, with the corners of its triangles as 'indices'."""
        packed = self.facts.get("extensions", {}).get(_DRACO)
        plain = self.file.named("accessors", self.facts["attributes"]["POSITION"])
        if packed is None or "bufferView" in plain:  # The same shape, also without Draco.
            return {}
        if not importlib.util.find_spec("DracoPy"):
            raise SceneError(f"it is compressed with {_DRACO}.", "Run `pip install DracoPy`.")
        import DracoPy  # type: ignore[import-not-found,unused-ignore]  # Optional.

        mesh, names = DracoPy.decode(self.file.view(packed["bufferView"])), packed["attributes"]
        arrays = {attribute["unique_id"]: attribute["data"] for attribute in mesh.attributes}
        return {name: arrays[number] for name, number in names.items()} | {"indices": mesh.faces.reshape(-1, 1)}

    def points(self, weights: Any) -> Array:
        """Return the (N, 3) vertices in the frame of their node, moved by the weights of their morph targets."""
        points = self["POSITION"].astype(float)
        if points.shape[1] != 3:
            raise SceneError(f"a POSITION has {points.shape[1]} numbers instead of 3.", "Export it again.")
        for weight, target in zip(weights, self.facts.get("targets", ()), strict=False):
            if weight and "POSITION" in target:
                points += weight * self.file.array(target["POSITION"])
        return points

    def faces(self) -> NDArray[np.int64]:
        """Return (M, 3) corners of triangles."""
        if "indices" in self._own or "indices" in self.facts:
            corners = self._own["indices"] if self._own else self.file.array(self.facts["indices"])
        else:
            corners = np.arange(len(self["POSITION"]))
        corners, mode = corners.ravel().astype(np.int64), self.facts.get("mode", _TRIANGLES)
        if mode == _TRIANGLES or self._own:
            if over := len(corners) % 3:
                self.file.lost["corners behind the last triangle"] += over
                corners = corners[:-over]
            return corners.reshape(-1, 3)
        first = np.full(len(corners) - 2, corners[0]) if mode == _FAN else corners[:-2]
        triangles = np.stack([first, corners[1:-1], corners[2:]], axis=1)
        if mode == _STRIP:
            triangles[1::2] = triangles[1::2, [1, 0, 2]]  # Every second triangle of a strip runs the other way round.
        return np.asarray(triangles[(triangles != np.roll(triangles, 1, axis=1)).all(axis=1)])

    def look(self) -> tuple[tuple[int, int, int], NDArray[np.uint8] | None, Array | None]:
        """Return colour, picture and (N, 2) uv, v up."""
        material = self.file.named("materials", self.facts["material"]) if "material" in self.facts else {}
        gloss = material.get("extensions", {}).get(_GLOSS)
        base = material.get("pbrMetallicRoughness", {}) if gloss is None else gloss
        factor = base.get("baseColorFactor" if gloss is None else "diffuseFactor", (1, 1, 1))
        texture = base.get("baseColorTexture" if gloss is None else "diffuseTexture")
        light = np.clip(np.array(factor[:3], float), 0, 1) * self._tint()
        # glTF keeps its factors in linear light. In bytes first: a colour then is the same as ever.
        red, green, blue = np.round(255 * (np.round(255 * light) / 255) ** (1 / 2.2)).astype(int).tolist()
        self._count_unseen(material, factor)
        colour = (red, green, blue) if "material" in self.facts or "COLOR_0" in self else PLAIN
        if texture is None:
            return colour, None, None
        picture, uv = self.file.picture(texture["index"], colour), self._uv(texture)
        if uv is not None and goes_beyond(uv) and not self._repeats(texture):
            self.file.lost[CLAMPED] += 1
        return colour, picture, uv

    def _repeats(self, texture: Any) -> bool:
        sampler = self.file.named("textures", texture["index"]).get("sampler")
        wrapping = {} if sampler is None else self.file.named("samplers", sampler)
        return all(wrapping.get(key, _REPEAT) == _REPEAT for key in ("wrapS", "wrapT"))

    def _count_unseen(self, material: Any, factor: Any) -> None:
        """Count what a part cannot say of a material."""
        extensions = material.get("extensions", {})
        through = extensions.get("KHR_materials_transmission", {}).get("transmissionFactor", 0)
        if through or (material.get("alphaMode", "OPAQUE") != "OPAQUE" and min(factor[3:], default=1) < 1):
            self.file.lost[CLEAR] += 1
        if any(material.get("emissiveFactor", ())):
            self.file.lost[SHINING] += 1

    def _tint(self) -> Array:
        """Return the (3,) mean of the vertex colours, linear."""
        if "COLOR_0" not in self:
            return np.ones(3)
        return mean_of(_normalised(self["COLOR_0"])[:, :3], 1, self.file.lost)

    def _uv(self, texture: Any) -> Array | None:
        """Return the (N, 2) coordinates of a texture, turned, scaled and moved as it says."""
        change = texture.get("extensions", {}).get(_TURNED, {})
        name = f"TEXCOORD_{change.get('texCoord', texture.get('texCoord', 0))}"
        if name not in self:
            return None
        uv = self[name]
        if change:
            turn, scale = change.get("rotation", 0.0), change.get("scale", (1, 1))
            cos, sin = np.cos(turn), np.sin(turn)
            uv = uv * np.array(scale) @ np.array([[cos, -sin], [sin, cos]]) + change.get("offset", (0, 0))
        return np.stack([uv[:, 0], 1 - uv[:, 1]], axis=1).astype(float)


def _normalised(values: NDArray[Any]) -> NDArray[Any]:
    """Return integers as shares of the largest of their kind; other numbers as they are."""
    if values.dtype.kind == "f":
        return values
    return np.maximum(values / np.iinfo(values.dtype).max, -1.0)


def _frame(node: Any) -> Array:
    """Return the (4, 4) frame of a node in that of its parent. Raises SceneError for one that is not a place."""
    try:
        frame = _frame_of(node)
        if not np.isfinite(frame).all():
            raise ValueError("it must be of numbers")
        return frame
    except (TypeError, ValueError) as error:
        given = ", ".join(f"{key} {node[key]}" for key in ("matrix", "rotation", "scale", "translation") if key in node)
        raise SceneError(f"a node has {given}, which is no place ({error}).", "Export it again.") from error


def _frame_of(node: Any) -> Array:
    from scipy.spatial.transform import Rotation

    if "matrix" in node:
        return np.array(node["matrix"], float).reshape(4, 4).T
    frame = np.eye(4)
    turn = Rotation.from_quat(node.get("rotation", (0, 0, 0, 1))).as_matrix()
    frame[:3, :3] = turn * np.array(node.get("scale", (1, 1, 1)), float)
    frame[:3, 3] = node.get("translation", (0, 0, 0))
    return frame
