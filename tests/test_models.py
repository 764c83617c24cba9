"""Model files as exporters write them: one table of what is read of each, derived by hand from the formats."""

from __future__ import annotations

import base64
import json
import struct
from collections.abc import Callable
from dataclasses import dataclass, field
from importlib.util import find_spec
from io import BytesIO
from itertools import combinations, product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from PIL import Image

from humanclaw.errors import SceneError
from humanclaw.world import read_model

HALF = 0.5**0.5
CORNERS = [[0, 0, 0], [2, 0, 0], [0, 1, 0]]
"""A triangle with legs of 2 m along x and 1 m along y: 1 m²."""
KINDS = {"b": 5120, "B": 5121, "h": 5122, "H": 5123, "I": 5125, "f": 5126}


@dataclass
class Gltf:
    """A .gltf file in the making, of one mesh of one piece on one node."""

    piece: dict[str, Any] = field(default_factory=dict)
    head: dict[str, Any] = field(default_factory=dict)
    data: bytes = b""

    def __post_init__(self) -> None:
        self.head = {"asset": {"version": "2.0"}, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
                     "meshes": [{"primitives": [self.piece]}], "bufferViews": [], "accessors": []}  # fmt: skip
        self.piece["attributes"] = {"POSITION": self.array(CORNERS)}

    def view(self, data: bytes) -> int:
        self.head["bufferViews"].append({"buffer": 0, "byteOffset": len(self.data), "byteLength": len(data)})
        self.data += data + bytes(-len(data) % 4)
        return len(self.head["bufferViews"]) - 1

    def array(self, rows: Any, kind: str = "f", **more: Any) -> int:
        values = np.array(rows, kind)
        width = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}[values[0].size]
        accessor = {"bufferView": self.view(values.tobytes()), "componentType": KINDS[kind], "count": len(values)}
        self.head["accessors"].append({**accessor, "type": width, **more})
        return len(self.head["accessors"]) - 1

    def give(self, **arrays: int) -> None:
        self.piece["attributes"].update(arrays)

    def material(self, **facts: Any) -> None:
        self.head["materials"], self.piece["material"] = [facts], 0

    def texture(self, *colours: tuple[int, int, int], **more: Any) -> dict[str, Any]:
        """A picture of these colours from left to right, as a texture's facts."""
        out = BytesIO()
        Image.fromarray(np.array([colours], np.uint8)).save(out, "PNG")
        self.head["images"] = [{"bufferView": self.view(out.getvalue()), "mimeType": "image/png"}]
        self.head["textures"] = [{"source": 0}]
        return {"index": 0, **more}

    def write(self, folder: Path) -> Path:
        uri = "data:application/octet-stream;base64," + base64.b64encode(self.data).decode()
        path = folder / "model.gltf"
        path.write_text(json.dumps({"buffers": [{"uri": uri, "byteLength": len(self.data)}], **self.head}))
        return path


# -- shapes ------------------------------------------------------------------------------------------------------------
def sparse(file: Gltf) -> None:
    """The second corner is moved to x = 4."""
    rows, values = file.view(np.array([1], "H").tobytes()), file.view(np.array([[4, 0, 0]], "f").tobytes())
    file.head["accessors"][0]["sparse"] = {
        "count": 1, "indices": {"bufferView": rows, "componentType": 5123}, "values": {"bufferView": values}
    }  # fmt: skip


def sparse_alone(file: Gltf) -> None:
    """Without a view of its own an array is zeros: the other corners stay at the origin."""
    sparse(file)
    del file.head["accessors"][0]["bufferView"]


def bytes_from_minus_one_to_one(file: Gltf) -> None:
    file.give(POSITION=file.array([[0, 0, 0], [127, 0, 0], [-128, -127, 0]], "b", normalized=True))


def whole_numbers_that_the_node_scales(file: Gltf) -> None:
    file.give(POSITION=file.array(np.array(CORNERS) * 1000, "h"))
    file.head["nodes"][0] |= {"scale": [0.001] * 3, "translation": [0, 0, 3]}


def strip(file: Gltf) -> None:
    """Corners 0 1 2, then 2 1 3: the second triangle of a strip runs the other way round."""
    file.give(POSITION=file.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]]))
    file.piece["mode"] = 5


def fan(file: Gltf) -> None:
    file.give(POSITION=file.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]))
    file.piece |= {"mode": 6, "indices": file.array([0, 1, 2, 3], "H")}


def skinned(file: Gltf) -> None:
    """Corners hang on bones at z = 5 and z = 1: the first, the second, and half on each. Their node has no effect."""
    file.give(JOINTS_0=file.array([[0, 0, 0, 0], [1, 0, 0, 0], [0, 1, 0, 0]], "B"))
    file.give(WEIGHTS_0=file.array([[1, 0, 0, 0], [1, 0, 0, 0], [0.5, 0.5, 0, 0]]))
    file.head["nodes"] = [{"mesh": 0, "skin": 0, "scale": [10] * 3}, {"translation": [0, 0, 5]},
                          {"translation": [0, 0, 3]}]  # fmt: skip
    # The second bone was bound at z = 2: from there it has moved by 1 m.
    binds = np.stack([np.eye(4), np.eye(4)])
    binds[1, 3, 2] = -2
    file.head |= {
        "scenes": [{"nodes": [0, 1, 2]}],
        "skins": [{"joints": [1, 2], "inverseBindMatrices": file.array(binds)}],
    }


def on_no_bone(file: Gltf) -> None:
    """The second corner stays where it is; the others move with their bones."""
    skinned(file)
    file.give(WEIGHTS_0=file.array([[1, 0, 0, 0], [0, 0, 0, 0], [0.5, 0.5, 0, 0]]))


def draco_beside(file: Gltf) -> None:
    """The plain arrays are whole: what Draco holds need not be read."""
    packed = {"bufferView": 0, "attributes": {"POSITION": 0}}
    file.piece["extensions"] = {"KHR_draco_mesh_compression": packed}


def morphed(file: Gltf) -> None:
    """Half of 2 m along z by the node's weight, which counts instead of the mesh's."""
    file.piece["targets"] = [{"POSITION": file.array([[0, 0, 2]] * 3)}]
    file.head["meshes"][0]["weights"], file.head["nodes"][0]["weights"] = [1.0], [0.5]


def mirrored(file: Gltf) -> None:
    file.head["nodes"][0]["scale"] = [-1, 1, 1]


def turned_twice(file: Gltf) -> None:
    """A quarter turn about z, of a node that another moves by 1 m along x. The file names no scene."""
    file.head["nodes"] = [{"mesh": 0, "rotation": [0, 0, HALF, HALF]}, {"children": [0], "translation": [1, 0, 0]}]
    del file.head["scenes"]


def copied(file: Gltf) -> None:
    """A copy as it is, and one twice as large 3 m along z, of a node that moves by 1 m along x."""
    copies = {"TRANSLATION": file.array([[0, 0, 0], [0, 0, 3]]), "SCALE": file.array([[1, 1, 1], [2, 2, 2]])}
    file.head["nodes"][0] |= {
        "translation": [1, 0, 0],
        "extensions": {"EXT_mesh_gpu_instancing": {"attributes": copies}},
    }
    file.head["extensionsRequired"] = ["EXT_mesh_gpu_instancing"]


SHAPES: dict[Callable[[Gltf], None], Any] = {
    sparse: [[[0, 0, 0], [4, 0, 0], [0, 1, 0]]],
    sparse_alone: [[[0, 0, 0], [4, 0, 0], [0, 0, 0]]],
    bytes_from_minus_one_to_one: [[[0, 0, 0], [1, 0, 0], [-1, -1, 0]]],
    whole_numbers_that_the_node_scales: [[[0, 0, 3], [2, 0, 3], [0, 1, 3]]],
    strip: [[[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 0], [1, 0, 0], [1, 1, 0]]],
    fan: [[[0, 0, 0], [1, 0, 0], [1, 1, 0]], [[0, 0, 0], [1, 1, 0], [0, 1, 0]]],
    skinned: [[[0, 0, 5], [2, 0, 1], [0, 1, 3]]],
    on_no_bone: [[[0, 0, 5], [2, 0, 0], [0, 1, 3]]],
    draco_beside: [CORNERS],
    morphed: [[[0, 0, 1], [2, 0, 1], [0, 1, 1]]],
    mirrored: [[[0, 1, 0], [-2, 0, 0], [0, 0, 0]]],
    turned_twice: [[[1, 0, 0], [1, 2, 0], [0, 0, 0]]],
    copied: [[[1, 0, 0], [3, 0, 0], [1, 1, 0]], [[1, 0, 3], [5, 0, 3], [1, 2, 3]]],
}


@pytest.mark.parametrize("change", SHAPES, ids=lambda change: change.__name__)
def test_a_gltf_has_the_shape_that_its_file_says(tmp_path: Path, change: Callable[[Gltf], None]) -> None:
    file = Gltf()
    change(file)
    model = read_model(file.write(tmp_path))
    triangles = np.concatenate([part.vertices[part.faces] for part in model.parts])
    np.testing.assert_allclose(triangles, SHAPES[change], atol=1e-6)
    assert model.left_out == ()


# -- looks -------------------------------------------------------------------------------------------------------------
RED, BLUE = (255, 0, 0), (0, 0, 255)
UV = [[0, 0], [1, 0], [0, 1]]


def second_set(file: Gltf) -> None:
    file.give(TEXCOORD_0=file.array([[9, 9]] * 3), TEXCOORD_1=file.array(UV))
    file.material(pbrMetallicRoughness={"baseColorTexture": file.texture(RED, BLUE, texCoord=1)})


def turned_texture(file: Gltf) -> None:
    """Twice as wide, a quarter turn against the clock, 1 further on: right (1, 0) is 2 up, (0, -2) as v runs down."""
    file.give(TEXCOORD_0=file.array(UV))
    change = {"offset": [1, 0], "rotation": np.pi / 2, "scale": [2, 1]}
    texture = file.texture(RED, BLUE, extensions={"KHR_texture_transform": change})
    file.material(pbrMetallicRoughness={"baseColorTexture": texture})
    file.head["extensionsRequired"] = ["KHR_texture_transform"]


def plain(file: Gltf) -> None:
    """Half the light is 255 x 0.5^(1 / 2.2) = 186 on a screen."""
    file.material(pbrMetallicRoughness={"baseColorFactor": [1, 0.5, 0, 1]})


def vertex_colours(file: Gltf) -> None:
    """They are multiplied with the material's."""
    plain(file)
    file.give(COLOR_0=file.array([[255, 255, 255, 255]] * 2 + [[255, 255, 255, 0]], "B", normalized=True))


def many_vertex_colours(file: Gltf) -> None:
    """The mean of red, green and blue, each a third of the light: 255 x (1/3)^(1 / 2.2) = 155."""
    file.give(COLOR_0=file.array(np.eye(3)))


def clamped(file: Gltf) -> None:
    """The picture ends at its edges, and the second corner lies one picture further on."""
    file.give(TEXCOORD_0=file.array([[0, 0], [2, 0], [0, 1]]))
    file.material(pbrMetallicRoughness={"baseColorTexture": file.texture(RED, BLUE)})
    file.head["textures"][0]["sampler"], file.head["samplers"] = 0, [{"wrapS": 33071}]


def glossy(file: Gltf) -> None:
    plain(file)
    gloss = {"diffuseFactor": [0, 0.5, 1, 1]}
    file.head["materials"][0]["extensions"] = {"KHR_materials_pbrSpecularGlossiness": gloss}
    file.head["extensionsRequired"] = ["KHR_materials_pbrSpecularGlossiness"]


def packed_picture(file: Gltf) -> None:
    """A picture that no decoder here reads gives way to the base colour."""
    second_set(file)
    file.head["images"][0] = {"uri": "data:image/ktx2,%ABKTX%2020"}


def lost_picture(file: Gltf) -> None:
    second_set(file)
    file.head["images"][0] = {"uri": "wood%20floor.png"}


def corners_left_over(file: Gltf) -> None:
    plain(file)
    file.give(POSITION=file.array([*CORNERS, [7, 7, 7], [8, 8, 8]]))


def glass_that_shines(file: Gltf) -> None:
    plain(file)
    file.head["materials"][0] |= {"alphaMode": "BLEND", "emissiveFactor": [1, 0, 0]}
    file.head["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"][3] = 0


def points_beside(file: Gltf) -> None:
    plain(file)
    file.head["meshes"][0]["primitives"].append({"mode": 0, "attributes": file.piece["attributes"]})


def nothing_beside(file: Gltf) -> None:
    plain(file)
    pair = {**file.piece, "indices": file.array([0, 1], "H")}
    file.head["meshes"][0]["primitives"] += [{"attributes": {}}, pair]


def hidden_beside(file: Gltf) -> None:
    """A hidden node hides the node below it, whose mesh is the same."""
    plain(file)
    hidden = {"children": [2], "extensions": {"KHR_node_visibility": {"visible": False}}}
    file.head |= {"scenes": [{"nodes": [0, 1]}], "nodes": [{"mesh": 0}, hidden, {"mesh": 0}]}
    file.head["extensionsRequired"] = ["KHR_node_visibility"]


LOOKS: dict[Callable[[Gltf], None], tuple[Any, Any, tuple[str, ...]]] = {
    second_set: ((255, 255, 255), [[0, 1], [1, 1], [0, 0]], ()),
    turned_texture: ((255, 255, 255), [[1, 1], [1, 3], [2, 1]], ()),
    plain: ((255, 186, 0), None, ()),
    vertex_colours: ((255, 186, 0), None, ()),
    many_vertex_colours: ((155, 155, 155), None, ("vertex colours (drawn as their mean): 1",)),
    clamped: (
        (255, 255, 255),
        [[0, 1], [2, 1], [0, 0]],
        ("pictures that end at their edges (drawn repeated): 1",),
    ),
    glossy: ((0, 186, 255), None, ()),
    lost_picture: ((255, 255, 255), [[0, 1], [1, 1], [0, 0]], ("pictures that cannot be read (wood%20floor.png): 1",)),
    corners_left_over: ((255, 186, 0), None, ("corners behind the last triangle: 2",)),
    glass_that_shines: (
        (255, 186, 0),
        None,
        ("see-through pieces (drawn solid): 1", "pieces that shine (drawn without their light): 1"),
    ),
    hidden_beside: ((255, 186, 0), None, ("hidden pieces: 1",)),
    nothing_beside: ((255, 186, 0), None, ("pieces without a triangle: 2",)),
    points_beside: ((255, 186, 0), None, ("pieces of points or lines: 1",)),
}


if not find_spec("alktx2"):
    left_out = ("KTX2 pictures (`pip install alktx2` reads them): 1",)
    LOOKS[packed_picture] = ((255, 255, 255), [[0, 1], [1, 1], [0, 0]], left_out)


@pytest.mark.parametrize("change", LOOKS, ids=lambda change: change.__name__)
def test_a_gltf_looks_as_its_file_says(tmp_path: Path, change: Callable[[Gltf], None]) -> None:
    file = Gltf()
    change(file)
    model = read_model(file.write(tmp_path))
    (part,), (colour, uv, left_out) = model.parts, LOOKS[change]
    assert np.abs(np.subtract(part.colour, colour)).max() <= 1
    assert (part.uv is None) == (uv is None)
    if part.uv is not None:
        np.testing.assert_allclose(part.uv, uv, atol=1e-6)
    assert (part.picture is None) == (uv is None or "pictures that cannot" in str(left_out) or "KTX2" in str(left_out))
    assert model.left_out == left_out


def test_a_picture_is_tinted_by_the_colours_beside_it(tmp_path: Path) -> None:
    file = Gltf()
    file.give(TEXCOORD_0=file.array(UV), COLOR_0=file.array([[0, 0, 1]] * 3))
    file.material(pbrMetallicRoughness={"baseColorTexture": file.texture((200, 100, 50))})
    (part,) = read_model(file.write(tmp_path)).parts
    assert part.picture is not None
    assert part.picture.tolist() == [[[0, 0, 50]]]


def test_a_file_whose_name_is_percent_encoded_is_found(tmp_path: Path) -> None:
    file = Gltf()
    (tmp_path / "my shape.bin").write_bytes(file.data)
    file.head["buffers"] = [{"uri": "my%20shape.bin", "byteLength": len(file.data)}]
    assert len(read_model(file.write(tmp_path)).parts) == 1


def test_a_packed_picture_is_read_where_there_is_a_decoder(tmp_path: Path) -> None:
    alktx2 = pytest.importorskip("alktx2")
    Image.fromarray(np.full((64, 64, 3), (0, 160, 0), np.uint8)).save(tmp_path / "green.png")
    alktx2.encode_image_to_ktx2(str(tmp_path / "green.png"), str(tmp_path / "green.ktx2"), codec="uastc")
    file = Gltf()
    second_set(file)
    file.head |= {
        "images": [{"uri": "green.ktx2"}],
        "textures": [{"extensions": {"KHR_texture_basisu": {"source": 0}}}],
    }
    (part,) = read_model(file.write(tmp_path)).parts
    assert part.picture is not None
    np.testing.assert_allclose(np.median(part.picture.reshape(-1, 3), axis=0), (0, 160, 0), atol=4)


# -- what would be another shape ---------------------------------------------------------------------------------------
def bone_elsewhere(file: Gltf) -> None:
    skinned(file)
    file.head["scenes"] = [{"nodes": [0]}]


def corner_elsewhere(file: Gltf) -> None:
    file.piece["indices"] = file.array([0, 1, 2**31], "I")


def another(*keys: Any) -> Callable[[Gltf], None]:
    """The last of keys as the value of the others."""

    def change(file: Gltf) -> None:
        place: Any = file.head
        for key in keys[:-2]:
            place = place[key]
        place[keys[-2]] = keys[-1]

    return change


@pytest.mark.parametrize(("change", "said"), [
    (another("nodes", 0, "mesh", 9), "names number 9 of its 1 meshes"),
    (another("nodes", 0, "mesh", -1), "names number -1 of its 1 meshes"),
    (another("scenes", 0, "nodes", [7]), "names number 7 of its 1 nodes"),
    (another("meshes", 0, "primitives", 0, "attributes", "POSITION", 9), "names number 9 of its 1 accessors"),
    (another("meshes", 0, "primitives", 0, "mode", 9), "mode of a piece must be 0 to 6, not 9"),
    (another("meshes", 0, "primitives", 0, "material", 0), "names number 0 of its 0 materials"),
    (another("accessors", 0, "count", 50), "an array of 50 values has only 36 bytes of data"),
    (another("accessors", 0, "type", "VEC2"), "a POSITION has 2 numbers instead of 3"),
    (another("accessors", 0, "type", "VEC9"), "'VEC9' is missing in it, or unknown"),
    (another("nodes", 0, "rotation", [0, 0, 0, 0]), r"rotation \[0, 0, 0, 0\], which is no place"),
    (another("nodes", 0, "matrix", [float("nan")] * 16), "a node has matrix .*must be of numbers"),
    (another("buffers", [{"uri": "gone.bin"}]), "gone.bin, which it names, is not beside it. Copy it there"),
    (another("asset", {}), "'version' is missing"), (another("nodes", {"a": 1}), "value of the wrong kind"),
    (another("asset", "version", "1.0"), "must be glTF 2; it is glTF 1.0. Convert it"),
    (another("extensionsRequired", ["EXT_meshopt_compression"]), "EXT_meshopt_compression, which may change"),
    (another("bufferViews", 0, "byteLength", 99), "data end before byte 99"),
    (bone_elsewhere, "a bone that is not in its scene"),
    (corner_elsewhere, "a triangle names vertex 2147483648 of 3"),
])  # fmt: skip
def test_what_would_be_another_shape_is_refused(tmp_path: Path, change: Callable[[Gltf], None], said: str) -> None:
    file = Gltf()
    change(file)
    with pytest.raises(SceneError, match=said) as caught:
        read_model(file.write(tmp_path))
    assert "model.gltf" in str(caught.value)


def test_draco_is_unpacked(tmp_path: Path) -> None:
    draco = pytest.importorskip("DracoPy")
    file = Gltf()
    packed = draco.encode(np.array(CORNERS, float), np.array([[0, 1, 2]]), quantization_bits=20)
    (number,) = [attribute["unique_id"] for attribute in draco.decode(packed).attributes]
    file.piece["indices"] = file.array([0, 0, 0], "H")
    for accessor in file.head["accessors"]:
        del accessor["bufferView"]
    file.piece["extensions"] = {
        "KHR_draco_mesh_compression": {"bufferView": file.view(packed), "attributes": {"POSITION": number}}
    }
    (part,) = read_model(file.write(tmp_path)).parts
    assert sorted(part.vertices[part.faces][0].round(5).tolist()) == sorted(CORNERS)


# -- polygons ----------------------------------------------------------------------------------------------------------
Loop = list[tuple[float, float]]
WALL: Loop = [(0, 0), (2, 0), (2, 2), (3, 2), (3, 0), (5, 0), (5, 2.5), (0, 2.5)]
"""A wall of 5 m by 2.5 m with a doorway of 1 m by 2 m: 10.5 m²."""
ELL: Loop = [(0, 0), (4, 0), (4, 2), (2, 2), (2, 4), (0, 4)]
"""4 m by 4 m without a quarter: 12 m². The fan from its first corner does not fold, those from its second do."""
DART: Loop = [(0, 0), (2, 2), (4, 0), (2, 4)]
"""A half of 4 m by 4 m without a half of 4 m by 2 m: 4 m². Cut from its first corner, its halves fold."""
WINDOW: Loop = [(0, 0), (4, 0), (4, 3), (3, 2), (3, 1), (1, 1), (1, 2), (3, 2), (4, 3), (0, 3)]
"""4 m by 3 m round a window of 2 m by 1 m, as a loop that goes to the window and back: 10 m²."""
BUTTERFLY: Loop = [(0, 0), (2, 2), (2, 0), (0, 2)]
"""Crosses itself, so it has no inside: its two triangles stay as they are, 2 m² each."""
POLYGONS: dict[str, tuple[list[Loop], float]] = {
    "wall": ([WALL], 10.5), "ell": ([ELL[1:] + ELL[:1]], 12), "dart": ([DART], 4), "window": ([WINDOW], 10),
    "butterfly": ([BUTTERFLY], 4), "together": ([WALL, DART, ELL[1:] + ELL[:1], ELL[:3]], 30.5),
}  # fmt: skip


def listed(loops: list[Loop]) -> tuple[list[str], list[list[int]]]:
    """Points that stand apart by 10 m along z, and the loops of their numbers."""
    starts = np.cumsum([0, *map(len, loops)]).tolist()
    points = [f"{x} {y} {10 * number}" for number, loop in enumerate(loops) for x, y in loop]
    return points, [[*range(start, start + len(loop))] for start, loop in zip(starts, loops, strict=False)]


def obj(points: list[str], loops: list[list[int]]) -> str:
    return "\n".join([*(f"v {p}" for p in points), *("f " + " ".join(f"{k + 1}" for k in loop) for loop in loops), ""])


def off(points: list[str], loops: list[list[int]]) -> str:
    faces = [" ".join(map(str, [len(loop), *loop])) for loop in loops]
    return "\n".join(["OFF", f"{len(points)} {len(loops)} 0", *points, *faces, ""])


def ply(points: list[str], loops: list[list[int]]) -> str:
    axes = [f"property float {axis}" for axis in "xyz"]
    head = ["ply", "format ascii 1.0", f"element vertex {len(points)}", *axes, f"element face {len(loops)}",
            "property list uchar int vertex_indices", "end_header"]  # fmt: skip
    return "\n".join([*head, *off(points, loops).splitlines()[2:], ""])


@pytest.mark.parametrize("written", [obj, off, ply], ids=lambda written: written.__name__)
@pytest.mark.parametrize("name", POLYGONS)
def test_a_polygon_has_its_own_area(tmp_path: Path, written: Any, name: str) -> None:
    loops, area = POLYGONS[name]
    path = tmp_path / f"model.{written.__name__}"
    path.write_text(written(*listed(loops)))
    (part,) = read_model(path).parts
    a, b, c = (part.vertices[part.faces[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)[:, 2]
    assert np.abs(normals).sum() / 2 == pytest.approx(area)
    assert name == "butterfly" or (normals >= -1e-9).all()


@pytest.mark.parametrize("heading", [0.5, 1.1, 2.3, 4.0])
def test_a_doorway_is_open_in_a_wall_of_any_heading(tmp_path: Path, heading: float) -> None:
    for first in range(len(WALL)):
        corners = [
            f"{3 + x * np.cos(heading):.6f} {y:.6f} {x * np.sin(heading) - 1:.6f}"
            for x, y in WALL[first:] + WALL[:first]
        ]
        path = tmp_path / f"{first}.obj"
        path.write_text(obj(corners, [[*range(len(WALL))]]))
        assert whole_area(path) == pytest.approx(10.5, abs=1e-4)


NICHE: Loop = [(0, 0), (4.5, 0), (4.5, 0.001), (5.5, 0.001), (5.5, 0), (10, 0), (10, 0.1), (0, 0.1)]
"""A wall of 10 m by 10 cm with a niche of 1 m by 1 mm: .999 m²."""


def any_loop(rng: np.random.Generator) -> Loop:
    """A loop of up to 16 corners that does not cross itself: while two of its sides cross, what is between turns."""
    loop = rng.uniform(-3, 3, (rng.integers(4, 17), 2))
    while crossing := next((pair for pair in combinations(range(len(loop)), 2) if crossed(loop, *pair)), None):
        first, last = crossing
        loop[first + 1 : last + 1] = loop[first + 1 : last + 1][::-1]
    return [(float(x), float(y)) for x, y in loop]


def crossed(loop: np.ndarray, *sides: int) -> bool:
    (a, b), (c, d) = ((loop[side], loop[(side + 1) % len(loop)]) for side in sides)

    def left(p: np.ndarray, q: np.ndarray, r: np.ndarray) -> float:
        return float(np.sign((q - p)[0] * (r - p)[1] - (q - p)[1] * (r - p)[0]))

    return left(a, b, c) * left(a, b, d) < 0 and left(c, d, a) * left(c, d, b) < 0


@pytest.mark.parametrize("seed", range(30))
def test_any_flat_polygon_is_covered_once_from_any_corner(tmp_path: Path, seed: int) -> None:
    """As large as the shoelace says, with every triangle on the same side, in a plane that is turned at random."""
    rng = np.random.default_rng(seed)
    loop = any_loop(rng) if seed else NICHE
    x, y = np.array(loop).T
    area = float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    normal = np.cross(*turn[:2]) * np.sign(area)
    for first, way in product(range(len(loop)), (1, -1)):
        corners = (np.roll(loop, first, axis=0)[::way] @ turn[:2] + 5).tolist()
        path = tmp_path / "model.obj"
        path.write_text(obj([f"{x!r} {y!r} {z!r}" for x, y, z in corners], [[*range(len(loop))]]))
        (part,) = read_model(path).parts
        a, b, c = (part.vertices[part.faces[:, k]] for k in range(3))
        areas = np.cross(b - a, c - a) @ normal * way / 2
        assert areas.min() > -1e-9
        assert areas.sum() == pytest.approx(abs(area))


@pytest.mark.parametrize(("offset", "written"), [(0, ".2f"), (1000, ".6g")])
def test_a_doorway_is_open_however_its_corners_are_rounded(tmp_path: Path, offset: float, written: str) -> None:
    for heading, first in product((0.5, 1.1, 2.3, 4.0), range(len(WALL))):
        corners = [
            " ".join(format(float(value), written) for value in (offset + x * np.cos(heading), y, x * np.sin(heading)))
            for x, y in WALL[first:] + WALL[:first]
        ]
        path = tmp_path / "model.obj"
        path.write_text(obj(corners, [[*range(len(WALL))]]))
        assert whole_area(path) == pytest.approx(10.5, abs=0.05)


def test_a_polygon_that_cannot_be_cut_is_counted(tmp_path: Path) -> None:
    (tmp_path / "model.obj").write_text(obj(*listed([[(0, 0), (3, 3), (3, 0), (0, 1)]])))
    (message,) = read_model(tmp_path / "model.obj").left_out
    assert "cross themselves" in message


@pytest.mark.parametrize("bend", [0.05, 0.1, 0.3])
def test_a_doorway_is_open_in_a_wall_that_is_bent(tmp_path: Path, bend: float) -> None:
    """One corner stands out by up to 30 cm, which makes the wall larger by less than a twentieth."""
    for corner, first in product(range(len(WALL)), repeat=2):
        corners = [f"{x} {y} {bend if k == corner else 0}" for k, (x, y) in enumerate(WALL)]
        path = tmp_path / "model.obj"
        path.write_text(obj(corners[first:] + corners[:first], [[*range(len(WALL))]]))
        assert 10.5 <= whole_area(path) + 1e-9 < 11


def whole_area(path: Path) -> float:
    return sum(float(trimesh.Trimesh(part.vertices, part.faces).area) for part in read_model(path).parts)


def packed_ply(order: str, lengths: str, numbers: str) -> bytes:
    """The wall and the triangle in bytes. lengths, numbers: struct's letters for those of the corners."""
    points, loops = listed([WALL, ELL[:3]])
    kinds, written = {"B": "uchar", "H": "ushort", "i": "int", "I": "uint"}, {"<": "little", ">": "big"}[order]
    text = ply(points, loops).split("end_header")[0].replace("ascii", f"binary_{written}_endian")
    rows = [struct.pack(f"{order}3f", *map(float, point.split())) for point in points]
    rows += [struct.pack(f"{order}{lengths}{len(loop)}{numbers}", len(loop), *loop) for loop in loops]
    return text.replace("uchar int", f"{kinds[lengths]} {kinds[numbers]}").encode() + b"end_header\n" + b"".join(rows)


def packed_stl(*behind: bytes) -> bytes:
    corners = struct.pack("<12f", 0, 0, 0, *np.ravel(CORNERS))
    return b"solid made by a CAD".ljust(80) + struct.pack("<I", 1) + corners + b"\0\0" + b"".join(behind)


FACET = "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 2 0 0\nvertex 0 1 0\nendloop\nendfacet\n"
TEXT_STL = f"solid a solid\n{FACET}endsolid\n"
TRIANGLE = "v 0 0 0\nv 2 0 0\nv 0 1 0\n"
AS_WRITTEN: dict[str, tuple[bytes, float]] = {
    "relative.obj": (f"{TRIANGLE}f -3 -2 -1\nv 0 0 1\nv 4 0 1\nv 0 1 1\nf -3//-1 -2//-1 -1//-1\n".encode(), 3.0),
    "blanks.obj": (f"\ufeff  {TRIANGLE}\tf\t1 2 3  # face\nfo 1 2 3\n".encode(), 2.0),
    "mac.obj": (f"{TRIANGLE}f 1 2 3\n".replace("\n", "\r").encode(), 1.0),
    "number.obj": (f"{TRIANGLE}usemtl Material #25\nf 1 2 3\n".encode(), 1.0),
    "latin.obj": (f"# M\xf6bel\n{TRIANGLE}f 1 2 3\n".encode("latin-1"), 1.0),
    "unicode.obj": (f"{TRIANGLE}f -3 -2 -1 # face\n".encode("utf-16"), 1.0),
    "continued.obj": (f"{TRIANGLE}f 1 \\\r\n2 3\n".encode(), 1.0),
    "text.stl": (b"\xef\xbb\xbf" + TEXT_STL.upper().encode(), 1.0),
    "colours.off": (b"COFF 3 1 0\n# vertices\n0 0 0 9 9 9 1\n2 0 0 9 9 9 1\n0 1 0 9 9 9 1\n3 0 1 2 255 0 0\n", 1.0),
    "headless.off": (b"3 1\n0 0 0\n2 0 0\n0 1 0\n3 0 1 2\n", 1.0),
    "little.ply": (packed_ply("<", "B", "i"), 14.5),
    "big.ply": (packed_ply(">", "I", "I"), 14.5),
    "short.ply": (packed_ply(">", "H", "H"), 14.5),
    "more.ply": (ply(*listed([ELL[:3]])).replace("3 0 1 2", "3 0 1 2 9 9").encode(), 4.0),
    "behind.stl": (packed_stl(b"by a CAD"), 1.0),
}
"""A file's content and its area, square metres: of the triangle of 1, or of the wall of 10.5 and a triangle of 4."""


@pytest.mark.parametrize("name", AS_WRITTEN)
def test_a_file_is_read_as_programs_write_it(tmp_path: Path, name: str) -> None:
    content, area = AS_WRITTEN[name]
    (tmp_path / name).write_bytes(content)
    assert whole_area(tmp_path / name) == pytest.approx(area)


@pytest.mark.parametrize(("name", "left_out"), [("one", ()), ("two", ("vertex colours (drawn as their mean): 1",))])
@pytest.mark.parametrize("kind", ["obj", "ply"])
def test_colours_of_vertices_are_drawn_as_their_mean(tmp_path: Path, kind: str, name: str, left_out: Any) -> None:
    """Red and twice black have a third of 255 red."""
    reds = {"one": (85, 85, 85), "two": (255, 0, 0)}[name]
    points, loops = listed([ELL[:3]])
    colours = "property uchar red\nproperty uchar green\nproperty uchar blue\n"
    head = ply(points, loops).replace("element face", f"{colours}element face")
    for point, red in zip(points, reds, strict=True):
        head = head.replace(f"\n{point}\n", f"\n{point} {red} 0 0\n")
    text = {"ply": head, "obj": obj([f"{p} {red / 255} 0 0" for p, red in zip(points, reds, strict=True)], loops)}[kind]
    (tmp_path / f"model.{kind}").write_text(text)
    model = read_model(tmp_path / f"model.{kind}")
    assert model.parts[0].colour == (85, 0, 0)
    assert model.left_out == left_out


def test_models_in_bytes_may_be_larger_than_those_in_text(tmp_path: Path) -> None:
    """A triangle of STL has 50 bytes, so 700,000 have 35 MB, more than 32 MiB."""
    triangle = struct.pack("<12fH", 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0)
    (tmp_path / "model.stl").write_bytes(bytes(80) + struct.pack("<I", 700_000) + triangle * 700_000)
    assert sum(len(part.faces) for part in read_model(tmp_path / "model.stl").parts) == 700_000
    (tmp_path / "model.off").write_bytes(b"#" * 35_000_000)
    with pytest.raises(SceneError, match=r"larger than 32 MiB.*convert it to glb"):
        read_model(tmp_path / "model.off")


def test_an_obj_of_a_million_triangles_is_read(tmp_path: Path) -> None:
    """A sheet of 700 by 700 squares, in triangles with uv on its left and in squares on its right."""
    numbers = np.arange(1, 701 * 701 + 1).reshape(701, 701)
    a, b, c, d = (corner.ravel() for corner in (numbers[:-1, :-1], numbers[1:, :-1], numbers[1:, 1:], numbers[:-1, 1:]))
    points = "".join(f"v {k // 701} {k % 701} 0.25\n" for k in range(701 * 701))
    left, right = slice(0, 350 * 700), slice(350 * 700, None)
    triangles = np.stack([a, a, b, b, c, c, a, a, c, c, d, d], 1)[left].tolist()
    squares = np.stack([a, b, c, d], 1)[right].tolist()
    text = points + "vt 0 0\n" * (701 * 701)
    text += "".join("f {}/{}/1 {}/{}/1 {}/{}/1\nf {}/{}/1 {}/{}/1 {}/{}/1\n".format(*row) for row in triangles)
    (tmp_path / "model.obj").write_text(text + "".join("f {} {} {} {}\n".format(*row) for row in squares))
    for part in read_model(tmp_path / "model.obj").parts:
        assert len(part.faces) == 490_000
        assert trimesh.Trimesh(part.vertices, part.faces, process=False).area == pytest.approx(245_000)


@pytest.mark.parametrize(("lines", "shape", "left_out"), [
    ("vt 0\nvt 1 0\nvt 0 1 0\nf 1/1 2/2 3/3\n", [CORNERS], ()),
    ("f 1 2 \\ \n3\n", [CORNERS], ()), ("f 1 2 3 \\", [CORNERS], ()),
    ("f \nf 1 2\nF 3 1 2\n", [np.roll(CORNERS, 1, 0)], ()),
    ("mtllib model.obj\nf 1 2 3\n", [CORNERS], ()), ("mtllib other.mtl\nf 1 2 3\n", [CORNERS], ()),
    ("vn 0 0 1\nv 0 0 1\nvn 0 0 1\nv 2 0 1\nvn 0 0 1\nv 0 1 1\nf -3//1 -2//-2 -1//3 # three\n",
     [np.add(CORNERS, [0, 0, 1])], ()),
    ("f 1 2 3\ncstype bspline\nsurf 0 1 0 1 1 2 3\nend\n", [CORNERS], ("curved surfaces: 1",)),
    ("mtllib seen.mtl\nusemtl glass\nf 1 2 3\n", [CORNERS],
     ("pieces that shine (drawn without their light): 1", "see-through pieces (drawn solid): 1")),
])  # fmt: skip
def test_odd_lines_of_an_obj_are_read_or_counted(tmp_path: Path, lines: str, shape: Any, left_out: Any) -> None:
    (tmp_path / "other.mtl").write_text("mtllib other.mtl\nnewmtl a\nKd 1 0 0\nv 9 9 9\nf 1 2 3\n")
    (tmp_path / "seen.mtl").write_text("newmtl glass\nKd 1 0 0\nd 0.0\nKe 1 1 1\nnewmtl wall\nd 1.0\nTr 0\nKe 0 0 0\n")
    (tmp_path / "model.obj").write_text(f"{TRIANGLE}{lines}")
    model = read_model(tmp_path / "model.obj")
    np.testing.assert_allclose([part.vertices[part.faces][0] for part in model.parts], shape)
    assert tuple(sorted(model.left_out)) == left_out


@pytest.mark.parametrize("line", [
    "v 2 0", "v 2 x 0", "v", "vt", "vt x 0", "f 1 two 3", "f 1.0 2.0 3.0", "f /1 /2 /3", "f 1/x 2/1 3/1", "f 1 2 3-",
])  # fmt: skip
def test_a_line_of_an_obj_that_cannot_be_read_is_quoted(tmp_path: Path, line: str) -> None:
    (tmp_path / "model.obj").write_text(f"{TRIANGLE}{line}\nf 1 2 3\n")
    with pytest.raises(SceneError, match=rf"model.obj cannot be read: its line '{line}' must hold .* Correct it, or"):
        read_model(tmp_path / "model.obj")


@pytest.mark.parametrize(
    ("code", "names"), [("latin-1", "üä"), ("cp1251", "жд"), ("shift-jis", "壁表"), ("utf-8", "жд")]
)
def test_materials_keep_their_names_in_any_code(tmp_path: Path, code: str, names: str) -> None:
    first, second = names
    (tmp_path / "m.mtl").write_bytes(f"newmtl T{first}\nKd 1 0 0\nnewmtl T{second}\nKd 0 1 0\n".encode(code))
    faces = f"usemtl T{first}\nf 1 2 3\nusemtl T{second}\nf 3 2 1\n"
    (tmp_path / "model.obj").write_bytes(f"mtllib m.mtl\n{TRIANGLE}{faces}".encode(code))
    assert [part.colour for part in read_model(tmp_path / "model.obj").parts] == [(255, 0, 0), (0, 255, 0)]


def test_comments_and_odd_colours_lose_no_other_material(tmp_path: Path) -> None:
    (tmp_path / "m.mtl").write_text("newmtl a\nKd 1 0 0 # red\nnewmtl b\nKd xyz 1 1 1\nnewmtl c\nKd 0 1 0#green\n")
    faces = "usemtl a\nf 1/1 2/1 3/1\nusemtl b\nf 1 2 3\nusemtl c\nf 1 2 3\n"
    (tmp_path / "model.obj").write_text(f"mtllib m.mtl\n{TRIANGLE}vt 0 0 # place\n{faces}")
    model = read_model(tmp_path / "model.obj")
    assert [part.colour for part in model.parts] == [(255, 0, 0), (102, 102, 102), (0, 255, 0)]
    assert model.left_out == ("lines that cannot be read (m.mtl): 1",)


def test_every_table_of_materials_that_an_obj_names_is_read(tmp_path: Path) -> None:
    """Names may have blanks, or be a path on another disk. The picture is scaled by 2 and 3, and moved by 1."""
    (tmp_path / "my red.mtl").write_text("newmtl Red one\nKd 1 0 0\n")
    (tmp_path / "blue.mtl").write_text("newmtl Grey\nKd 0,6\nnewmtl Blue\nKd 0 0 1\n")
    (tmp_path / "green.mtl").write_text(
        "newmtl Green\nmap_Kd -s 2 3 1 -clamp on -bm 0.5 -o 1 0 0 C:\\pictures\\2 gre en.png\n"
    )
    Image.new("RGB", (2, 2), (0, 160, 0)).save(tmp_path / "2 gre en.png")
    faces = (
        "usemtl Red one\nf 1 2 3\nusemtl Blue\nf 3 2 1\nusemtl Grey\nf 3 2 1\nusemtl Green\nf 1/1 2/2 3/3\nf 1 2 3\n"
    )
    text = f"mtllib my red.mtl blue.mtl\nmtllib green.mtl\n{TRIANGLE}vt 0 0\nvt 1 0\nvt 0 1\n{faces}"
    (tmp_path / "model.obj").write_text(text)
    model = read_model(tmp_path / "model.obj")
    red, blue, grey, green, bare = model.parts
    assert [red.colour, blue.colour, grey.colour] == [(255, 0, 0), (0, 0, 255), (153, 153, 153)]
    assert green.uv is not None
    assert green.picture is not None
    assert green.uv[green.faces[0]].tolist() == [[1, 0], [3, 0], [1, 3]]
    assert green.picture[0, 0].tolist() == [0, 160, 0]
    assert bare.picture is None
    # Its uv go to 3, and its picture does not repeat.
    assert model.left_out == (
        "pictures that end at their edges (drawn repeated): 1", "pieces without places in their picture: 1",
    )  # fmt: skip


def test_meshlabs_corners_have_places_in_the_picture_of_their_own(tmp_path: Path) -> None:
    head = ply(["0 0 0", "2 0 0", "0 1 0"], [[0, 1, 2]]).replace(
        "end_header", "property list uchar float texcoord\nend_header"
    )
    text = head.replace("1.0\n", "1.0\ncomment TextureFile green.png\n", 1)
    (tmp_path / "model.ply").write_text(text.rstrip() + " 6 0 0 1 0 0 1\n")
    Image.new("RGB", (2, 2), (0, 160, 0)).save(tmp_path / "green.png")
    (part,) = read_model(tmp_path / "model.ply").parts
    assert part.uv is not None
    assert part.picture is not None
    assert part.vertices[part.faces[0]].tolist() == [[0, 0, 0], [2, 0, 0], [0, 1, 0]]
    assert part.uv[part.faces[0]].tolist() == [[0, 0], [1, 0], [0, 1]]
    assert part.picture[0, 0].tolist() == [0, 160, 0]


@pytest.mark.parametrize(("name", "content", "said"), [
    ("word.ply", ply(*listed([ELL[:3]])).replace("4 0 0", "4 x 0").encode(), "its line '4 x 0' must hold a number"),
    ("few.ply", ply(*listed([ELL[:3]])).replace("4 0 0", "4 0").encode(), "its line '4 0' must hold a number"),
    ("half.ply", ply(*listed([ELL[:3]])).replace("0 1 2", "0 1 1.5").encode(), "names vertex 1.5"),
    ("lists.ply", ply(*listed([ELL[:3]])).replace("3 0 1 2", "2.5 0 1 2").encode(), "its line '2.5 0 1 2' must"),
    ("minus.ply", ply(*listed([ELL[:3]])).replace("0 1 2", "0 1 -1").encode(), "names vertex -1 of 3"),
    ("many.ply", ply(*listed([ELL[:3]])).replace("vertex 3", "vertex three").encode(), "'element vertex three'"),
    ("mode.ply", ply(*listed([ELL[:3]])).replace("ascii", "text").encode(), "format must be ascii, .* not 'text'"),
    ("word.stl", TEXT_STL.replace("2 0 0", "2 x 0").encode(), "its line 'vertex 2 x 0' must hold 3 numbers"),
    ("word.off", b"OFF 3 1 0\n0 0 0\n2 x 0\n0 1 0\n3 0 1 2\n", "its line '2 x 0' must hold 3 numbers"),
    ("five.off", b"OFF 3 1 0\n0 0 0\n2 0 0\n0 1 0\n5 0 1 2\n", "its line '5 0 1 2' must hold a count"),
    ("empty.off", b"OFF\n", "OFF file in text with its counts"), ("four.glb", b"glTF", "it has only 4 bytes"),
    ("page.glb", b"<html>", "its JSON breaks off in line 1"),
    ("far.obj", b"v 0 0 0\nv 1e300 0 0\nv 0 1 0\nf 1 2 3\n", "not numbers below"),
    ("cut.ply", packed_ply("<", "B", "i")[:-3], "data end after"),
    ("cut.stl", packed_stl().replace(b"solid", b"SOLVE")[:-9], "ends after"),
    ("commas.obj", f"{TRIANGLE}f 1 2 3\n".replace("2 0 0", "2,5 0,0 0,0").encode(), "decimal commas"),
    ("commas.stl", b"solid a\nfacet normal 0 0 1\nouter loop\nvertex 1,5 0 0\n", "decimal commas"),
    ("solid.stl", packed_stl()[:-9], "ends after"), ("nought.obj", f"{TRIANGLE}f 0 1 2\n".encode(), "counts from 1"),
    ("past.obj", f"{TRIANGLE}f 1 2 7\n".encode(), "names vertex 7 of 3"),
    ("before.obj", f"{TRIANGLE}f 1 2 -4\n".encode(), "names vertex 0 of 3"),
    ("facet.stl", TEXT_STL[: TEXT_STL.rindex("vertex")].encode(), "middle of a solid"),
    ("second.stl", (TEXT_STL + TEXT_STL[:60]).encode(), "middle of a solid"),
    ("model.dae", b"<COLLADA/>", "glb, gltf, obj, off, ply, stl"),
    ("fewer.stl", packed_stl(bytes(50)), "counts 1 triangles; it holds 2"),
    ("cut.off", b"OFF 3 1 0\n0 0 0\n2 0 0\n0 1 0\n", "3 of 4 lines"), ("four.off", b"4OFF 3 1 0\n", "4OFF"),
])  # fmt: skip
def test_a_file_that_ends_early_or_is_of_another_kind_is_told(
    tmp_path: Path, name: str, content: bytes, said: str
) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(SceneError, match=said):
        read_model(tmp_path / name)


def test_a_sheet_with_two_sides_keeps_them(tmp_path: Path) -> None:
    (tmp_path / "model.obj").write_text("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3\nf 1 3 4\nf 1 4 3\nf 1 3 2\n")
    (part,) = read_model(tmp_path / "model.obj").parts
    assert part.faces.tolist() == [[0, 1, 2], [0, 2, 3], [0, 3, 2], [0, 2, 1]]
