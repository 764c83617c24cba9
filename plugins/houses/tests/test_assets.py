"""`humanclaw assets import` and houses furnished from a library, with models that the tests write."""

from __future__ import annotations

import json
import zipfile
from pathlib import Path

import numpy as np
import pytest
import trimesh
from click.testing import CliRunner, Result
from PIL import Image
from scipy.spatial import ConvexHull

from humanclaw import HumanclawError, Plugins, Scene, SceneError
from humanclaw.cli import build
from humanclaw.records import SEATS
from humanclaw_houses.door import open_house
from humanclaw_houses.importers.categories import category_of, scale_of
from humanclaw_houses.importers.sweethome import licence_of, properties
from humanclaw_houses.library import Library
from humanclaw_houses.source import house
from humanclaw_houses.validity import problems

Box = tuple[tuple[float, float, float], tuple[float, float, float]]

COUCH: list[Box] = [  # metres, back at -Z, seat 0.44
    ((2.2, 0.44, 0.9), (0, 0, 0)), ((2.2, 0.40, 0.2), (0, 0.44, -0.35)),
    ((0.2, 0.18, 0.7), (1.0, 0.44, 0.1)), ((0.2, 0.18, 0.7), (-1.0, 0.44, 0.1)),
]  # fmt: skip
CHAIR: list[Box] = [((0.44, 0.05, 0.44), (0, 0.41, 0)), ((0.44, 0.45, 0.05), (0, 0.46, -0.195))]
CHAIR += [((0.04, 0.41, 0.04), (x, 0, z)) for x in (-0.2, 0.2) for z in (-0.2, 0.2)]
BED: list[Box] = [((1.6, 0.5, 2.0), (0, 0, 0)), ((1.6, 1.0, 0.08), (0, 0, -0.96))]
TABLE: list[Box] = [((1.4, 0.05, 0.8), (0, 0.69, 0))]
TABLE += [((0.06, 0.69, 0.06), (x, 0, z)) for x in (-0.65, 0.65) for z in (-0.35, 0.35)]
WARDROBE: list[Box] = [((1.2, 2.0, 0.6), (0, 0, 0))]


def obj(boxes: list[Box], scale: float = 1.0, turn: float = 0.0) -> str:
    """A Wavefront file of boxes that stand on points; turn: degrees to the left about y."""
    shape = shapes(boxes)
    shape.apply_transform(trimesh.transformations.rotation_matrix(np.radians(turn), [0, 1, 0]))
    lines = ["mtllib m.mtl", "usemtl cloth"]
    lines += [f"v {x:.5f} {y:.5f} {z:.5f}" for x, y, z in shape.vertices * scale]
    lines += [f"vt {x:.3f} {z:.3f}" for x, _, z in shape.vertices]
    lines += ["f " + " ".join(f"{k + 1}/{k + 1}" for k in face) for face in shape.faces]
    return "\n".join(lines)


def shapes(boxes: list[Box]) -> trimesh.Trimesh:
    parts = []
    for size, (x, y, z) in boxes:
        part = trimesh.creation.box(size)
        part.apply_translation((x, y + size[1] / 2, z))
        parts.append(part)
    return trimesh.util.concatenate(parts)


PIECES = {  # name: boxes, raw scale, turn, category, size in the catalogue
    "Sofa": (COUCH, 37.0, 90.0, "Living room", (220, 84, 90)),
    "Oak chair": (CHAIR, 1.0, 0.0, "Living room", (44, 91, 44)),
    "Wardrobe": (WARDROBE, 100.0, 0.0, "Bedroom", (120, 200, 60)),
    "Grand piano": (TABLE, 1.0, 0.0, "Living room", (140, 74, 80)),
    "Front door": (WARDROBE, 1.0, 0.0, "Doors", (90, 210, 10)),
    "Toy sofa": (COUCH, 1.0, 0.0, "Bedroom", (22, 8, 9)),
}


def write_sh3f(path: Path) -> Path:
    """A Sweet Home 3D library. The sofa's model lies on its side along x and is stood up by the catalogue's
    rotation."""
    lines = ["id=Test", "name=Test\\u0020library", "license=Creative Commons Attribution 3.0 license"]
    with zipfile.ZipFile(path, "w") as file:
        for number, (name, (boxes, scale, turn, group, size)) in enumerate(PIECES.items(), 1):
            folder = name.lower().replace(" ", "")
            lines += [
                f"id#{number}=test#{folder}", f"name#{number}={name}", f"category#{number}={group}",
                f"model#{number}=/test/{folder}/m.obj", f"width#{number}={size[0]}", f"height#{number}={size[1]}",
                f"depth#{number}={size[2]}", f"movable#{number}=true",
                f"doorOrWindow#{number}={str('door' in name).lower()}",
                f"creator#{number}=Ada \\\n    Example",
            ]  # fmt: skip
            if turn:
                lines.append(f"modelRotation#{number}=0 0 -1 0 1 0 1 0 0")
            file.writestr(f"test/{folder}/m.obj", obj(boxes, scale, turn))
            file.writestr(f"test/{folder}/m.mtl", "newmtl cloth\nKd 0.2 0.4 0.6\nmap_Kd cloth.png\n")
            file.writestr(f"test/{folder}/cloth.png", png())
        number = len(PIECES) + 1
        lines += [f"id#{number}=test#broken", f"name#{number}=Broken bed", f"model#{number}=/test/broken/m.obj"]
        file.writestr("test/broken/m.obj", "v 0 0 nothing\nf 1 2 3")
        file.writestr("PluginFurnitureCatalog.properties", "\n".join(lines))
    return path


def png() -> bytes:
    import io

    buffer = io.BytesIO()
    Image.fromarray(np.full((8, 8, 3), (200, 40, 40), np.uint8)).save(buffer, "PNG")
    return buffer.getvalue()


def run(*args: object) -> Result:
    return CliRunner().invoke(build(Plugins.discover), [str(arg) for arg in args])


@pytest.fixture(scope="module")
def work(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("assets")


@pytest.fixture(autouse=True)
def own_cache(work: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HUMANCLAW_CACHE", str(work / "cache"))


@pytest.fixture(scope="module")
def imported(work: Path) -> tuple[Path, Result]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("HUMANCLAW_CACHE", str(work / "cache"))
        source = write_sh3f(work / "test.sh3f")
        return work / "lib", run("assets", "import", source, "--out", work / "lib")


def entry(folder: Path, name: str):  # type: ignore[no-untyped-def]
    return next(entry for entry in Library(folder).entries if entry.name == name)


# -- a Sweet Home 3D library -------------------------------------------------------------------------------------------
def test_the_summary_counts_what_came_in_what_was_left_out_and_names_what_was_broken(
    imported: tuple[Path, Result],
) -> None:
    _, result = imported
    assert result.exit_code == 0, result.output
    told = (
        "couch", "chair", "wardrobe", "rejected: broken: m.obj cannot be read", "Grand piano",
        "doors, windows and stairs: 1", "3 assets", "rejected: toysofa: Toy sofa (couch): 0.22 m width",
    )  # fmt: skip
    for words in told:
        assert words in " ".join(result.output.split()), (words, result.output)


def test_a_model_of_any_unit_and_up_axis_has_the_size_that_the_catalogue_gives(imported: tuple[Path, Result]) -> None:
    folder, _ = imported
    sofa = entry(folder, "Sofa")
    mesh = Library(folder).asset(sofa).mesh
    assert np.ptp(mesh.vertices, axis=0) == pytest.approx([2.2, 0.84, 0.9], abs=1e-3)
    assert mesh.vertices.min(axis=0) == pytest.approx([-1.1, 0.0, -0.45], abs=1e-3)


def test_seats_are_measured_and_backs_are_behind(imported: tuple[Path, Result]) -> None:
    folder, _ = imported
    for name, height in (("Sofa", 0.44), ("Oak chair", 0.46)):
        found = entry(folder, name)
        assert found.seat_height == pytest.approx(height, abs=0.005)
        mesh = Library(folder).asset(found).mesh
        assert (mesh.vertices[mesh.vertices[:, 1] > height + 0.2][:, 2] < 0).all()


def test_licence_author_and_picture_are_kept(imported: tuple[Path, Result]) -> None:
    folder, _ = imported
    asset = Library(folder).asset(entry(folder, "Sofa"))
    assert asset.licence == "CC-BY-3.0"
    assert "Ada Example" in asset.source
    assert (asset.mesh.texture.reshape(-1, 3) == (200, 40, 40)).all()


def test_hulls_hold_up_the_seat_and_leave_the_room_over_it_free(imported: tuple[Path, Result]) -> None:
    folder, _ = imported
    asset = Library(folder).asset(entry(folder, "Sofa"))
    over = np.array([[x, 0.47, z] for x in (-0.7, 0, 0.7) for z in (0.0, 0.3)])
    under = over - [0, 0.05, 0]
    assert len(asset.hulls) <= 20
    assert not any(inside(hull, over).any() for hull in asset.hulls)
    assert np.any([inside(hull, under) for hull in asset.hulls], axis=0).all()


def inside(hull: np.ndarray, points: np.ndarray) -> np.ndarray:
    planes = ConvexHull(hull).equations
    return (points @ planes[:, :3].T + planes[:, 3] < 0).all(axis=1)


def test_a_box_stays_a_box(imported: tuple[Path, Result]) -> None:
    folder, _ = imported
    (hull,) = Library(folder).asset(entry(folder, "Wardrobe")).hulls
    assert len(hull) == 8
    assert np.ptp(hull, axis=0) == pytest.approx([1.2, 2.0, 0.6], abs=1e-3)


def test_importing_again_changes_no_byte(imported: tuple[Path, Result], work: Path) -> None:
    folder, _ = imported
    before = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    result = run("assets", "import", work / "test.sh3f", "--out", folder)
    assert "3 unchanged" in " ".join(result.output.split())
    assert {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()} == before


def test_a_list_names_the_targets_that_are_taken_and_lets_other_furniture_through(work: Path) -> None:
    source, listed, folder = write_sh3f(work / "test.sh3f"), work / "known.txt", work / "gated"
    listed.write_text("# looked at by a detector\n\ntest-oakchair  # 0.61\n")
    done = run("assets", "import", source, "--out", folder, "--only", listed)
    assert done.exit_code == 0, done.output
    assert {e.category for e in Library(folder).entries} == {"chair", "wardrobe"}
    assert "not in known.txt: 3 (test-broken, test-sofa, test-toysofa)" in " ".join(done.output.split())


def test_a_list_that_names_nothing_of_a_library_is_told(work: Path) -> None:
    listed = work / "typo.txt"
    listed.write_text("test-oakchiar\n")
    done = run("assets", "import", write_sh3f(work / "test.sh3f"), "--out", work / "typo", "--only", listed)
    assert "test-oakchiar" in done.output
    missing = run("assets", "import", work / "test.sh3f", "--out", work / "typo", "--only", work / "none.txt")
    assert missing.exit_code == 2
    assert "none.txt" in missing.output


def test_an_unpacked_library_gives_the_same_models(imported: tuple[Path, Result], work: Path) -> None:
    folder, _ = imported
    with zipfile.ZipFile(work / "test.sh3f") as file:
        file.extractall(work / "test")
    run("assets", "import", work / "test", "--out", work / "lib_unpacked")
    assert [e.digest for e in Library(work / "lib_unpacked").entries] == [e.digest for e in Library(folder).entries]


# -- a folder of models ------------------------------------------------------------------------------------------------
@pytest.fixture(scope="module")
def kit(work: Path) -> Path:
    folder = work / "kit"
    folder.mkdir()
    for name, boxes, scale in (("bedDouble", BED, 100.0), ("tableRound", TABLE, 1.0), ("loungeSofa", COUCH, 1.0)):
        shape = shapes(boxes)
        shape.apply_scale(scale)
        shape.visual = trimesh.visual.TextureVisuals(
            material=trimesh.visual.material.PBRMaterial(baseColorFactor=[55, 255, 0, 255])
        )
        shape.export(folder / f"{name}.glb")
    (folder / "chairBroken.glb").write_bytes(b"glTF but not really")
    return folder


@pytest.fixture(scope="module")
def kit_library(work: Path, kit: Path) -> Path:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("HUMANCLAW_CACHE", str(work / "cache"))
        result = run(
            "assets", "import", kit, "--out", work / "lib_kit", "--licence", "CC0-1.0", "--author", "Kit Maker"
        )
    assert result.exit_code == 0, result.output
    assert "rejected: chairBroken" in result.output
    return work / "lib_kit"


def test_units_of_files_without_a_catalogue_are_told_by_size(kit_library: Path) -> None:
    assert entry(kit_library, "bedDouble").unit == "centimetres"
    assert entry(kit_library, "tableRound").unit == "metres"
    assert entry(kit_library, "bedDouble").size == pytest.approx((1.6, 1.0, 2.0), abs=1e-3)


def test_linear_colours_of_gltf_are_seen_in_srgb(kit_library: Path) -> None:
    texture = Library(kit_library).asset(entry(kit_library, "bedDouble")).mesh.texture
    assert texture[0, 0] == pytest.approx([127, 255, 0], abs=2)  # 255 (55 / 255)^(1 / 2.2) = 126.9


def test_a_table_has_a_top_where_its_hulls_end(kit_library: Path) -> None:
    table = entry(kit_library, "tableRound")
    assert table.top.y == pytest.approx(0.74, abs=0.002)
    assert table.top.x1 - table.top.x0 > 1.2
    hulls = Library(kit_library).asset(table).hulls
    under = np.array([[0.0, 0.3, 0.0], [0.3, 0.5, 0.1]])
    assert max(float(hull[:, 1].max()) for hull in hulls) == pytest.approx(0.74, abs=0.002)
    assert not any(inside(hull, under).any() for hull in hulls)


# -- what goes wrong ---------------------------------------------------------------------------------------------------
def test_a_source_that_is_nothing_known_is_refused_with_what_was_expected(work: Path) -> None:
    (work / "empty").mkdir()
    (work / "no.sh3f").write_bytes(b"not a zip")
    for source, words in ((work / "missing", "there is nothing at"), (work / "empty", "there is no model in"),
                          (work / "no.sh3f", "is not a Sweet Home 3D furniture library")):  # fmt: skip
        result = run("assets", "import", source, "--out", work / "never")
        assert result.exit_code == 2
        assert words in " ".join(result.output.split())
    assert not (work / "never").exists()


def test_a_folder_that_is_no_library_and_a_damaged_index_are_told_apart(work: Path, kit_library: Path) -> None:
    with pytest.raises(HumanclawError, match="there is no asset library"):
        open_house(f"0?assets={work / 'nowhere'}")
    bad = work / "bad"
    bad.mkdir()
    index = json.loads((kit_library / "index.json").read_text())
    index["assets"][0]["hulls"] = "many"
    (bad / "index.json").write_text(json.dumps(index))
    with pytest.raises(HumanclawError, match=r"assets\.0\.hulls"):
        Library(bad)


def test_a_changed_mesh_is_noticed(work: Path, kit_library: Path) -> None:
    import shutil

    copy = work / "changed"
    shutil.copytree(kit_library, copy)
    found = entry(copy, "tableRound")
    path = copy / "models" / f"{found.id}.glb"
    path.write_bytes(path.read_bytes() + b"    ")
    with pytest.raises(SceneError, match="changed after the import"):
        Library(copy).asset(found)


@pytest.mark.parametrize("argument", ["0?colour=red", "0?assets=", "0?assets"])
def test_an_unknown_option_of_a_house_is_refused(argument: str) -> None:
    with pytest.raises(SceneError, match=r"house:3\?assets="):
        open_house(argument)


# -- names -------------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("name", "group", "category"),
    [
        ("loungeSofaLong", "", "couch"), ("Bedside table", "Bedroom", "nightstand"), ("Baby bed", "Bedroom", ""),
        ("televisionModern", "", "tv"), ("TV stand", "Living room", "tv_stand"), ("Toilet brush", "Bathroom", ""),
        ("SofaB_01", "", "couch"), ("Thing", "couch", "couch"), ("Teapot", "Kitchen", ""), ("Shelves", "", "bookshelf"),
        ("Oak chairs", "", "chair"), ("Armchair", "", "chair"), ("Ficus", "", "potted_plant"),
    ],
)  # fmt: skip
def test_names_lead_to_categories(name: str, group: str, category: str) -> None:
    assert category_of(name, group) == category


def test_a_kit_drawn_a_little_too_large_is_made_smaller() -> None:
    assert scale_of("toilet", (0.625, 0.902, 0.954)) == ("metres, scaled by 0.9", 0.9)
    assert scale_of("toilet", (625, 902, 954)) == ("millimetres, scaled by 0.9", pytest.approx(0.0009))
    assert scale_of("toilet", (5.0, 0.1, 0.1)) is None


def test_java_properties_are_read_as_java_reads_them() -> None:
    text = "# no\n! no\na=1\nb : two words\nc=\\u00e9t\\u00e9\nd=one,\\\n   two\ne=x=y\n".encode("latin-1")
    assert properties(text) == {"a": "1", "b": "two words", "c": "été", "d": "one,two", "e": "x=y"}


@pytest.mark.parametrize(
    ("text", "licence"),
    [("Public domain", "CC0-1.0"), ("http://creativecommons.org/licenses/by/3.0/us/", "CC-BY-3.0-US"),
     ("Creative Commons Attribution 3.0 Unported license", "CC-BY-3.0"), ("all rights reserved", "LicenseRef-unknown")],
)  # fmt: skip
def test_licences_are_named_as_spdx_names_them(text: str, licence: str) -> None:
    assert licence_of(text) == licence


# -- houses ------------------------------------------------------------------------------------------------------------
@pytest.fixture(scope="module")
def library(work: Path, imported: tuple[Path, Result], kit: Path, kit_library: Path) -> Path:
    """Both sources in one library."""
    folder = work / "both"
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("HUMANCLAW_CACHE", str(work / "cache"))
        for source in (work / "test.sh3f", kit):
            run("assets", "import", source, "--out", folder, "--licence", "CC0-1.0", "--author", "Kit Maker")
    return folder


@pytest.fixture(scope="module")
def furnished(library: Path) -> Scene:
    return house("0", Library(library))


def test_a_second_source_joins_the_first(library: Path) -> None:
    assert {entry.collection for entry in Library(library).entries} == {"test", "kit"}


def test_a_house_takes_from_the_library_what_it_has_and_makes_the_rest(furnished: Scene) -> None:
    sources = {furnished.assets[scene_object.asset].source == "generated" for scene_object in furnished.objects}
    assert sources == {True, False}
    for category, credit in (("bed", "Kit Maker"), ("wardrobe", "Ada Example")):
        named = [furnished.assets[scene_object.asset].source for scene_object in furnished.of_category(category)]
        assert any(credit in text for text in named), (category, named)


def test_nothing_is_wrong_with_a_house_of_real_furniture(furnished: Scene) -> None:
    assert problems(furnished) == []


def test_real_pieces_keep_their_proportions_and_nearly_their_size(furnished: Scene, library: Path) -> None:
    sizes = {entry.id: np.array(entry.size) for entry in Library(library).entries}
    real = {name: asset for name, asset in furnished.assets.items() if asset.source != "generated"}
    assert real
    for name, asset in real.items():
        ratio = np.ptp(asset.mesh.vertices, axis=0) / sizes[name.split("@")[0]]
        assert np.ptp(ratio) < 0.002
        assert 0.8999 <= ratio.mean() <= 1.1001


def test_real_seats_have_their_real_height(furnished: Scene) -> None:
    seen = 0
    for scene_object in furnished.objects:
        asset = furnished.assets[scene_object.asset]
        if scene_object.category in SEATS and asset.source != "generated":
            scale = float(np.ptp(asset.mesh.vertices[:, 0])) / {"couch": 2.2, "bed": 1.6}[scene_object.category]
            assert asset.seat_height == pytest.approx(
                {"couch": 0.44, "bed": 0.5}[scene_object.category] * scale, abs=0.006
            )
            seen += 1
    assert seen


def test_the_scene_names_all_licences_it_is_under(furnished: Scene) -> None:
    assert "Apache-2.0: generated" in furnished.licences
    assert any(text.startswith("CC0-1.0: ") and "Kit Maker" in text for text in furnished.licences)


def test_the_same_library_gives_the_same_house_and_another_one_another(furnished: Scene, library: Path) -> None:
    assert house("0", Library(library)).digest == furnished.digest
    assert house("0").digest != furnished.digest
