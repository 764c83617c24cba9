"""Scenes of a dataset: positions, categories and error messages. The numbers are derived by hand."""

from __future__ import annotations

import functools
import json
import struct
import sys
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
import trimesh
from toy_dataset import HALF, PLACED, box, model, room, textured, walls, write

from humanclaw import HumanclawError, Plugins, Scene, SceneError
from humanclaw.body import matrix_from_quaternion
from humanclaw.world import DistanceField, MultiFloorMap, OccupancyGrid, SceneObject

host = functools.cache(Plugins.discover)


@pytest.fixture(scope="module")
def scene(dataset: Path) -> Scene:
    return host().scene(f"hssd:{dataset}#toy1")


def load(folder: Path, rest: str = "") -> Scene:
    return host().scene(f"hssd:{folder}#toy1{rest}")


def edit(file: Path, **changes: object) -> None:
    write(file, json.loads(file.read_text()) | changes)


def change_object(folder: Path, number: int, **changes: object) -> None:
    placed = [dict(entry) for entry in PLACED]
    placed[number] |= changes
    edit(folder / "scenes" / "toy1.scene_instance.json", object_instances=placed)


def front(scene: Scene, number: int) -> np.ndarray:
    return matrix_from_quaternion(np.array(scene.by_id[number].rotation)) @ np.array([0.0, 0.0, 1.0])


# -- what there is ----------------------------------------------------------------------------------------------------
def test_objects_are_numbered_as_in_the_scene_instance(scene: Scene) -> None:
    assert [scene.by_id[k].category for k in range(1, 6)] == ["couch", "tv", "potted_plant", "cup", "chair"]
    assert {thing.category for thing in scene.objects if thing.id > 5} == {"floor", "ceiling", "wall"}


@pytest.mark.parametrize(
    ("number", "low", "high"),
    [
        # 2 m wide and 0.9 m deep, turned by 90 degrees about (7.3, 0, 3).
        (1, (6.85, 0, 2), (7.75, 0.85, 4)),
        # Z-up, 1.2 x 0.7 x 0.1 m, its back's lower edge at (0, 1, 3) and all of it on the side of +X.
        (2, (0, 1, 2.4), (0.1, 1.7, 3.6)),
        # From 0.3 m below its origin to 0.7 m above, times 1.5, the origin at 0.45 m.
        (3, (7.3, 0, 5.3), (7.7, 1.5, 5.7)),
        # A cube of 0.1 m whose centre, not its corner, is at (1, 0.05, 5).
        (4, (0.95, 0, 4.95), (1.05, 0.1, 5.05)),
        # 0.5 x 0.9 x 0.5 m, times 1.2.
        (5, (0.7, 0, 0.7), (1.3, 1.08, 1.3)),
    ],
)
def test_every_object_is_where_habitat_puts_it(scene: Scene, number: int, low: tuple, high: tuple) -> None:
    np.testing.assert_allclose(scene.aabb(number), (low, high), atol=1e-4)


@pytest.mark.parametrize(("number", "way"), [(1, (-1, 0, 0)), (2, (1, 0, 0)), (3, (0, 0, -1)), (5, (0, 0, -1))])
def test_fronts_look_where_habitat_turns_minus_z(scene: Scene, number: int, way: tuple) -> None:
    np.testing.assert_allclose(front(scene, number), way, atol=1e-6)


def test_assets_stand_on_the_middle_of_their_footprint(scene: Scene) -> None:
    for asset in scene.assets.values():
        low, high = asset.mesh.vertices.min(axis=0), asset.mesh.vertices.max(axis=0)
        np.testing.assert_allclose([low[0] + high[0], low[1], low[2] + high[2]], 0, atol=1e-4)


@pytest.mark.integration
def test_a_seat_is_turned_to_its_real_front(mine: Path) -> None:
    # The couch's back is at +Z; the config calls +Z the front.
    edit(mine / "objects" / "c" / "couch1.object_config.json", front=[0, 0, 1])
    scene = load(mine)
    # Habitat turns the asset by half a turn, so its back is at -Z, then left by a quarter: the back at -X, the front at
    # +X.
    np.testing.assert_allclose(front(scene, 1), (1, 0, 0), atol=1e-6)
    np.testing.assert_allclose(scene.aabb(1), ((6.85, 0, 2), (7.75, 0.85, 4)), atol=1e-4)


def test_seat_heights_are_measured_and_scaled(scene: Scene) -> None:
    assert scene.assets[scene.by_id[1].asset].seat_height == pytest.approx(0.42, abs=0.005)
    assert scene.assets[scene.by_id[5].asset].seat_height == pytest.approx(1.2 * 0.45, abs=0.005)
    assert scene.assets[scene.by_id[2].asset].seat_height is None


def test_only_dynamic_things_move_with_mass_and_friction_as_given(scene: Scene) -> None:
    assert [thing.id for thing in scene.objects if thing.movable] == [4]
    assert (scene.by_id[4].mass, scene.by_id[4].friction) == (0.3, 0.4)
    assert scene.by_id[1].friction == 0.7


def test_a_thing_of_unknown_motion_type_is_dynamic_as_in_habitat(mine: Path) -> None:
    change_object(mine, 4, motion_type="UNDEFINED", mass_scale=3)
    thing = load(mine).by_id[5]
    assert thing.movable
    assert thing.mass == 3


@pytest.mark.integration
def test_small_things_can_be_made_movable_and_weigh_by_their_size(mine: Path) -> None:
    change_object(mine, 3, motion_type="static")
    scene = load(mine, "?movable=small")
    # The cup's config says 0.3 kg; the chair's says nothing, and it is more than 1 m high.
    assert [(thing.id, thing.mass) for thing in scene.objects if thing.movable] == [(4, 0.3)]
    change_object(mine, 4, uniform_scale=1)
    # 200 kg/m^3 of 0.5 x 0.9 x 0.5 m are 45 kg, more than the limit of 15 kg.
    assert {thing.id: thing.mass for thing in load(mine, "?movable=small").objects if thing.movable} == {
        4: 0.3,
        5: 15.0,
    }
    assert not any(thing.movable for thing in load(mine).objects if thing.id != 4)


def test_the_centre_of_mass_of_the_config_goes_before_that_of_the_box(mine: Path) -> None:
    edit(mine / "objects" / "c" / "cup1.object_config.json", COM=[0.02, 0.05, 0.05])
    np.testing.assert_allclose(load(mine).aabb(4)[0], (0.98, 0, 4.95), atol=1e-4)


def test_a_given_collision_model_becomes_its_convex_parts(scene: Scene) -> None:
    hulls = scene.assets[scene.by_id[5].asset].hulls
    # A seat of 0.5 x 0.45 x 0.5 m and a back of 0.5 x 0.45 x 0.05 m, times 1.2.
    sizes = sorted(np.ptp(hull, axis=0).tolist() for hull in hulls)
    np.testing.assert_allclose(sizes, [(0.6, 0.54, 0.06), (0.6, 0.54, 0.6)], atol=1e-4)


@pytest.mark.integration
def test_a_part_of_a_collision_model_that_is_not_convex_is_decomposed(mine: Path) -> None:
    tall, wide = box((0, 0, 0), (0.2, 1, 0.2)), box((0.2, 0, 0), (1, 0.2, 0.2))
    ell = tall.union(wide) if find_spec("manifold3d") else pytest.skip("needs manifold3d")
    ell.visual = tall.visual
    model(mine / "objects" / "c" / "chair1.collider.glb", ell)
    hulls = load(mine).assets[load(mine).by_id[5].asset].hulls
    assert len(hulls) > 1
    assert not any((hull.max(axis=0) - hull.min(axis=0) > 0.9).sum() > 1 for hull in hulls)


def test_what_is_not_collidable_has_no_body(mine: Path) -> None:
    edit(mine / "objects" / "t" / "tv1.object_config.json", is_collidable=False)
    edit(mine / "objects" / "c" / "couch1.object_config.json", use_bounding_box_for_collision=True)
    scene = load(mine)
    assert scene.assets[scene.by_id[2].asset].hulls == ()
    (hull,) = scene.assets[scene.by_id[1].asset].hulls
    np.testing.assert_allclose(np.ptp(hull, axis=0), (2, 0.85, 0.9), atol=1e-4)


def test_joined_collision_meshes_of_a_movable_thing_are_one_piece(mine: Path) -> None:
    edit(mine / "objects" / "c" / "chair1.object_config.json", join_collision_meshes=True)
    change_object(mine, 4, motion_type="dynamic")
    scene = load(mine)
    (hull,) = scene.assets[scene.by_id[5].asset].hulls
    np.testing.assert_allclose(np.ptp(hull, axis=0), (0.6, 1.08, 0.6), atol=1e-4)


# -- the building -----------------------------------------------------------------------------------------------------
def test_the_floor_is_solid_below_and_the_walls_fill_their_width(scene: Scene) -> None:
    floor = next(thing for thing in scene.objects if thing.category == "floor")
    (slab,) = scene.assets[floor.asset].hulls
    low, high = slab.min(axis=0) + floor.position, slab.max(axis=0) + floor.position
    np.testing.assert_allclose((low, high), ((0, -0.1, 0), (8, 0, 6)), atol=1e-4)
    # The wall at x = 4 up to the doorway: a 5 cm slab behind each of its two sides, and one behind its end.
    (wall,) = [t for t in scene.objects if np.allclose(scene.aabb(t.id), ((3.95, 0, 0), (4.05, 2.7, 2.5)), atol=1e-3)]
    spans = [(*h.min(axis=0) + wall.position, *h.max(axis=0) + wall.position) for h in scene.assets[wall.asset].hulls]
    for span in [(3.95, 0, 0, 4, 2.7, 2.5), (4, 0, 0, 4.05, 2.7, 2.5), (3.95, 0, 2.45, 4.05, 2.7, 2.5)]:
        assert any(np.allclose(span, other, atol=1e-3) for other in spans)


def test_a_building_collides_as_its_collision_model_does(mine: Path) -> None:
    model(mine / "stages" / "shell.glb", *walls(), box((2, 0, 2), (2.5, 1, 2.5)))
    edit(mine / "stages" / "toy.stage_config.json", collision_asset="shell.glb")
    plan = OccupancyGrid.of(load(mine))
    assert plan.at(plan.blocked, np.array([2.25, 2.02]))
    assert not plan.at(plan.blocked, np.array([1.0, 3.0]))


def test_a_building_that_is_not_collidable_stops_nobody(mine: Path) -> None:
    edit(mine / "stages" / "toy.stage_config.json", is_collidable=False)
    scene = load(mine)
    assert not any(scene.assets[thing.asset].hulls for thing in scene.objects if thing.id > 5)


def test_the_doorway_is_open_and_the_wall_beside_it_is_not(scene: Scene) -> None:
    plan = OccupancyGrid.of(scene)
    assert not plan.at(plan.blocked, np.array([[4.0, 3.1], [3.0, 3.1], [5.0, 3.1]])).any()
    assert plan.at(plan.blocked, np.array([[4.0, 1.0], [4.0, 5.0], [8.05, 3.0], [-1.0, 3.0]])).all()


def test_a_wall_with_a_doorway_may_be_one_polygon(mine: Path) -> None:
    """As Blender and SketchUp write it: a floor of 8 m by 6 m, and across it a wall with a doorway 1.2 m wide."""
    floor = [(0, 0, 0), (0, 0, 6), (8, 0, 6), (8, 0, 0)]
    across = [(0, 0), (0, 2.5), (2.1, 2.5), (2.1, 3.7), (0, 3.7), (0, 6), (2.7, 6), (2.7, 0)]
    points = [*floor, *((4, y, z) for y, z in across)]
    text = [f"v {x} {y} {z}" for x, y, z in points] + ["f 1 2 3 4", "f 5 6 7 8 9 10 11 12"]
    (mine / "stages" / "toy.obj").write_text("\n".join(text))
    edit(mine / "stages" / "toy.stage_config.json", render_asset="toy.obj")
    way = DistanceField.of(plan := MultiFloorMap.of(load(mine)), np.array([[6.0, 0.0, 3.1]]))
    # Straight through the doorway from 2 m before the wall to 2 m behind it, give or take half a cell of 5 cm.
    assert float(way.at(np.array([2.0, 0.0, 3.1]))) == pytest.approx(4.0, abs=0.06)
    (storey,) = plan.floors
    assert storey.at(storey.blocked, np.array([[4.0, 1.0], [4.0, 5.0]])).all()


def test_regions_become_rooms_on_the_floor_that_is_really_there(scene: Scene) -> None:
    assert [(r.name, r.kind, r.x0, r.z0, r.x1, r.z1, r.floor) for r in scene.rooms] == [
        ("living room", "living_room", 0, 0, 4, 6, 0), ("bedroom", "bedroom", 4, 0, 8, 6, 0),
    ]  # fmt: skip
    assert (scene.by_id[1].room, scene.by_id[2].room) == ("bedroom", "living room")


def test_a_room_with_a_corner_missing_becomes_rectangles_of_one_name(mine: Path) -> None:
    ell = room("hall", (0, 0), (4, 6))
    ell["poly_loop"] = [[x, 0, z] for x, z in ((0, 0), (4, 0), (4, 2), (1, 2), (1, 6), (0, 6))]
    write(mine / "semantics" / "scenes" / "toy1.semantic_config.json", {"region_annotations": [ell]})
    rooms = load(mine).rooms
    assert {r.name for r in rooms} == {"hall"}
    assert sum((r.x1 - r.x0) * (r.z1 - r.z0) for r in rooms) == pytest.approx(4 * 2 + 1 * 4)
    assert not any(r.x0 < 2 < r.x1 and r.z0 < 3 < r.z1 for r in rooms)


def test_without_annotations_the_floor_itself_is_the_room(mine: Path) -> None:
    (mine / "semantics" / "scenes" / "toy1.semantic_config.json").unlink()
    rooms = load(mine).rooms
    assert sum((r.x1 - r.x0) * (r.z1 - r.z0) for r in rooms) == pytest.approx(8 * 6)
    assert {r.floor for r in rooms} == {0.0}


def test_a_floor_without_walls_is_a_floor(mine: Path) -> None:
    model(mine / "stages" / "toy.glb", walls()[0])
    scene = load(mine)
    assert {thing.category for thing in scene.objects if thing.id > 5} == {"floor", "wall", "ceiling"}
    assert {r.floor for r in scene.rooms} == {0.0}


def test_an_upper_floor_is_found(mine: Path) -> None:
    model(mine / "stages" / "toy.glb", *walls(), *(part.apply_translation((0, 2.8, 0)) for part in walls()))
    (mine / "semantics" / "scenes" / "toy1.semantic_config.json").unlink()
    assert sorted({r.floor for r in load(mine).rooms}) == [0.0, 2.8]


# -- as a whole -------------------------------------------------------------------------------------------------------
def test_the_digest_is_the_same_again_and_covers_every_model(mine: Path, dataset: Path, scene: Scene) -> None:
    assert load(mine).digest == scene.digest
    model(mine / "objects" / "c" / "cup1.glb", box((0, 0, 0), (0.1, 0.1, 0.1), (250, 0, 0)))
    other = load(mine)
    assert other.digest != scene.digest
    assert other.notes["files"] != scene.notes["files"]


def test_a_second_load_reads_the_cache_and_gives_the_same(mine: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    first = load(mine)
    monkeypatch.setattr("humanclaw_habitat.models.read_model", lambda path: pytest.fail(f"{path} is read again"))
    assert load(mine).digest == first.digest


def test_the_licence_of_the_dataset_is_told(scene: Scene) -> None:
    assert scene.licences == ("cc-by-nc-4.0: toy",)


def test_a_dataset_with_one_scene_needs_no_name(dataset: Path) -> None:
    scene = host().scene(f"habitat:{dataset}?triangles=500")
    assert scene.name == f"habitat:{dataset}#toy1?triangles=500"
    assert host().scene(scene.name).digest == scene.digest


def test_without_a_table_of_objects_the_lexicon_says_what_they_are(mine: Path) -> None:
    (mine / "semantics" / "objects.csv").unlink()
    write(mine / "semantics" / "toy_lexicon.json", {"classes": [{"id": 7, "name": "sofa"}]})
    config = json.loads((mine / "toy.scene_dataset_config.json").read_text())
    config["semantic_scene_descriptor_instances"]["default_attributes"] = {
        "semantic_descriptor_filename": "../toy_lexicon.json"
    }
    write(mine / "toy.scene_dataset_config.json", config)
    edit(mine / "objects" / "c" / "couch1.object_config.json", semantic_id=7)
    scene = load(mine)
    assert (scene.by_id[1].category, scene.by_id[2].category) == ("couch", "object")


# -- templates without files of their own
# --------------------------------------------------------------------------------
def nest(folder: Path, section: str, *configs: dict) -> None:
    """Write `configs` into the dataset's own config."""
    file = folder / "toy.scene_dataset_config.json"
    values = json.loads(file.read_text())
    values.setdefault(section, {})["configs"] = list(configs)
    write(file, values)


def test_a_nested_config_changes_a_file_and_gives_it_another_name(mine: Path) -> None:
    heavy = {
        "original_file": "objects/c/cup1.object_config.json",
        "template_handle": "heavy_cup",
        "attributes": {"mass": 3.5},
    }
    nest(mine, "objects", heavy)
    assert load(mine).by_id[4].mass == 0.3
    change_object(mine, 3, template_name="heavy_cup")
    thing = load(mine).by_id[4]
    # Unchanged attributes are those of the file; its model lies beside that file.
    assert (thing.mass, thing.friction) == (3.5, 0.4)
    np.testing.assert_allclose(load(mine).aabb(4), ((0.95, 0, 4.95), (1.05, 0.1, 5.05)), atol=1e-4)


def test_a_nested_config_without_a_name_changes_the_file_itself(mine: Path) -> None:
    nest(mine, "objects", {"original_file": "objects/c/cup1.object_config.json", "attributes": {"mass": 3.5}})
    assert load(mine).by_id[4].mass == 3.5


def test_a_nested_config_without_a_file_makes_a_template(mine: Path) -> None:
    nest(mine, "objects", {"template_handle": "mug", "attributes": {"render_asset": "objects/c/cup1.glb", "mass": 1.1}})
    nest(
        mine,
        "stages",
        {"template_handle": "flat", "attributes": {"render_asset": "stages/toy.glb", "scale": [2, 1, 2]}},
    )
    nest(mine, "scene_instances", {"original_file": "scenes/toy1.scene_instance.json", "template_handle": "toy2",
                                   "attributes": {"stage_instance": {"template_name": "flat"}}})  # fmt: skip
    change_object(mine, 3, template_name="mug")
    thing = load(mine).by_id[4]
    # The default friction of all objects of this dataset is 0.7.
    assert (thing.mass, thing.friction) == (1.1, 0.7)
    wide = host().scene(f"hssd:{mine}#toy2")
    floor = next(thing for thing in wide.objects if thing.category == "floor")
    np.testing.assert_allclose(np.ptp(wide.aabb(floor.id), axis=0)[[0, 2]], (16, 12), atol=1e-3)


@pytest.mark.parametrize(
    ("config", "said"),
    [
        ({"original_file": "objects/nowhere.object_config.json", "attributes": {}}, "nowhere.object_config.json"),
        ({"attributes": {}}, "original_file or a template_handle"),
        ({"template_handle": "mug"}, "attributes"),
    ],
)
def test_a_nested_config_that_says_nothing_usable_is_named(mine: Path, config: dict, said: str) -> None:
    nest(mine, "objects", config)
    fails(mine, "toy.scene_dataset_config.json", said)


# -- articulated objects -----------------------------------------------------------------------------------------------
FRIDGE = """<robot name="fridge">
  <link name="body">
    <visual><origin xyz="0 0.9 0"/><geometry><box size="0.6 1.8 0.6"/></geometry></visual>
    <collision><origin xyz="0 0.9 0"/><geometry><box size="0.6 1.8 0.6"/></geometry></collision>
  </link>
  <link name="door">
    <visual><origin xyz="0.3 0 0" rpy="0 0 1.570796"/>
    <geometry><mesh filename="door.glb" scale="2 1 1"/></geometry></visual>
    <collision><origin xyz="0.3 0 0"/><geometry><box size="0.6 1.2 0.05"/></geometry></collision>
  </link>
  <link name="drawer"><visual><geometry><cylinder radius="0.1" length="0.4"/></geometry></visual></link>
  <joint name="hinge" type="revolute">
    <parent link="body"/><child link="door"/><origin xyz="-0.3 1 -0.325"/><axis xyz="0 1 0"/>
    <limit lower="LOWER" upper="1.570796"/>
  </joint>
  <joint name="rail" type="prismatic">
    <parent link="body"/><child link="drawer"/><origin xyz="0 0.2 -0.3"/><axis xyz="0 0 -1"/>
    <limit lower="0" upper="0.4"/>
  </joint>
</robot>"""


def fridge(folder: Path, *changes: tuple[str, str], lower: str = "0", **placing: object) -> Path:
    """A fridge of 0.6 x 1.8 x 0.6 m with a door of 5 cm before it and a round drawer of 0.4 m, half of it outside, at
    (2, 0, 5)."""
    place = folder / "urdf" / "fridge"
    # 0.6 m wide once it is turned by a quarter and 1.2 m high once it is doubled.
    model(place / "door.glb", box((-0.3, -0.3, -0.025), (0.3, 0.3, 0.025)))
    text = FRIDGE.replace("LOWER", lower)
    for was, becomes in changes:
        text = text.replace(was, becomes)
    (place / "fridge.urdf").write_text(text)
    config = json.loads((folder / "toy.scene_dataset_config.json").read_text())
    write(folder / "toy.scene_dataset_config.json", config | {"articulated_objects": {"paths": {".urdf": ["urdf/*"]}}})
    placed = {
        "template_name": "fridge",
        "translation": [2, 0, 5],
        "translation_origin": "COM",
        "fixed_base": True,
        **placing,
    }
    edit(folder / "scenes" / "toy1.scene_instance.json", articulated_object_instances=[placed])
    return place


def parts(scene: Scene) -> dict[str, SceneObject]:
    """The fixed part of the fridge, its door and its drawer."""
    objects = [obj for obj in scene.objects if obj.category == "fridge"]
    return {obj.asset.partition(" ")[2]: obj for obj in objects}


def test_an_articulated_object_keeps_its_hinges_and_slides(mine: Path, scene: Scene) -> None:
    fridge(mine)
    loaded = load(mine)
    body, door, drawer = (parts(loaded)[name] for name in ("", "door", "drawer"))
    # The door's front is at z = -0.325 - 0.025, the drawer's end at -0.3 - 0.2; the root link is at the translation.
    np.testing.assert_allclose(loaded.aabb(body.id), ((1.7, 0, 4.7), (2.3, 1.8, 5.3)), atol=2e-3)
    np.testing.assert_allclose(loaded.aabb(door.id)[0], (1.7, 0.4, 4.65), atol=2e-3)
    assert (body.id, body.movable, door.movable, drawer.movable) == (6, False, True, True)
    assert len(loaded.objects) == len(scene.objects) + 3
    # A quarter turn to the left about y brings the door, to +X of its hinge, to -Z of it: 0.6 m before z = 5 - 0.325.
    np.testing.assert_allclose(loaded.aabb(door.id, door.at(np.pi / 2))[0], (1.675, 0.4, 4.075), atol=2e-3)
    np.testing.assert_allclose(loaded.aabb(drawer.id, drawer.at(0.4))[0][2], 4.1, atol=2e-3)
    assert json.loads(loaded.notes["ignored"]) == []


def test_each_link_collides_as_its_own_convex_pieces(mine: Path) -> None:
    fridge(mine)
    scene = load(mine)
    sizes = [np.ptp(hull, axis=0) for name in ("", "door") for hull in scene.assets[parts(scene)[name].asset].hulls]
    np.testing.assert_allclose(sizes, [(0.6, 1.8, 0.6), (0.6, 1.2, 0.05)], atol=1e-3)


@pytest.mark.parametrize("pose", [[1.0, 0.3], {"hinge": 1.0, "drawer": 0.3}])
def test_a_scene_says_how_far_its_joints_are_open(mine: Path, pose: object) -> None:
    fridge(mine, initial_joint_pose=pose)
    links = parts(load(mine))
    assert (links["door"].state, links["drawer"].state) == (1.0, 0.3)


def test_a_joint_on_another_stands_still(mine: Path) -> None:
    fridge(mine, ('<parent link="body"/><child link="drawer"/>', '<parent link="door"/><child link="drawer"/>'))
    loaded = load(mine)
    assert set(parts(loaded)) == {"", "door"}
    assert json.loads(loaded.notes["ignored"]) == ["articulated object 0 (fridge): 1 of its joints stand still"]


def test_commas_between_numbers_are_blanks(mine: Path) -> None:
    """As in Habitat's own fridge_static.urdf."""
    fridge(mine, ("0.6 1.8 0.6", "0.6, 1.8, 0.6"))
    np.testing.assert_allclose(load(mine).aabb(6), ((1.7, 0, 4.7), (2.3, 1.8, 5.3)), atol=2e-3)


@pytest.mark.parametrize("name", ["a'drawer", " drawer ", " "])
def test_the_name_of_a_link_is_a_name_alone(mine: Path, name: str) -> None:
    fridge(mine, ('"drawer"', f'"{name}"'))
    assert name in parts(load(mine))


def test_what_would_fall_by_its_weight_is_held(mine: Path) -> None:
    """A box of 0.2 x 0.2 x 0.4 m weighs 4.8 kg, and a joint holds half as much again: 70.6 N."""
    fridge(mine, ('<axis xyz="0 0 -1"/>', '<axis xyz="0 1 0"/>'))
    drawer = parts(load(mine))["drawer"]
    assert drawer.joint is not None
    assert (drawer.mass, drawer.joint.friction) == (pytest.approx(4.8, 0.03), pytest.approx(70.6, 0.03))


def test_a_joint_that_cannot_be_at_zero_is_at_the_nearest_that_it_can(mine: Path) -> None:
    fridge(mine, lower="1.2")
    door = parts(load(mine))["door"]
    assert door.state == pytest.approx(1.2)


@pytest.mark.parametrize("end", [100, 1e30])
@pytest.mark.integration
def test_a_hinge_of_many_turns_turns_once_and_keeps_its_nearer_stop(mine: Path, end: float) -> None:
    """Files write a large number for a hinge without stops."""
    for lower, low in ((-end, -np.pi), (-1, -1), (1, 1)):
        fridge(mine, ('upper="1.570796"', f'upper="{end}"'), lower=f"{lower}")
        door = parts(load(mine))["door"]
        assert door.joint is not None
        assert (door.joint.low, door.joint.high) == pytest.approx((low, low + 2 * np.pi))
        assert door.state == max(lower, 0)


def test_a_slide_may_be_longer_than_a_turn(mine: Path) -> None:
    fridge(mine, ('upper="0.4"', 'upper="8"'))
    drawer = parts(load(mine))["drawer"]
    assert drawer.joint is not None
    assert drawer.joint.high == 8


def test_a_link_without_a_surface_is_left_out(mine: Path) -> None:
    fridge(mine, ('scale="2 1 1"', 'scale="0 0 0"'))
    loaded = load(mine)
    assert set(parts(loaded)) == {"", "drawer"}
    assert json.loads(loaded.notes["ignored"]) == ["articulated object 0 (fridge): 1 of its joints stand still"]


def test_an_articulated_object_is_turned_and_scaled_about_its_root(mine: Path) -> None:
    fridge(mine, rotation=[HALF, 0, HALF, 0], uniform_scale=0.5)
    loaded = load(mine)
    drawer = parts(loaded)["drawer"]
    # The side at -Z is now at -X, and all distances are halved, the way of the drawer too.
    np.testing.assert_allclose(loaded.aabb(6), ((1.85, 0, 4.85), (2.15, 0.9, 5.15)), atol=2e-3)
    np.testing.assert_allclose(loaded.aabb(drawer.id, drawer.at(0.2))[0][0], 1.55, atol=2e-3)
    assert drawer.joint is not None
    assert drawer.joint.high == pytest.approx(0.2)


def test_a_config_of_an_articulated_object_names_its_file(mine: Path) -> None:
    place = fridge(mine)
    (place / "fridge.urdf").rename(place / "cold.urdf")
    write(
        place / "fridge.ao_config.json", {"urdf_filepath": "cold.urdf", "uniform_scale": 2.0, "render_mode": "default"}
    )
    config = json.loads((mine / "toy.scene_dataset_config.json").read_text())
    config["articulated_objects"]["paths"] = {".json": ["urdf/*"]}
    write(mine / "toy.scene_dataset_config.json", config)
    np.testing.assert_allclose(load(mine).aabb(6)[1], (2.6, 3.6, 5.6), atol=2e-3)


def test_another_mesh_of_a_link_makes_another_scene(mine: Path) -> None:
    place = fridge(mine)
    digest = load(mine).digest
    model(place / "door.glb", box((-0.3, -0.3, -0.025), (0.3, 0.3, 0.025), (0, 0, 250)))
    assert load(mine).digest != digest


@pytest.mark.parametrize(
    ("was", "becomes", "said"),
    [
        ('filename="door.glb"', 'filename="gate.glb"', "gate.glb"),
        ('filename="door.glb"', 'filename="../../../door.glb"', "outside of its dataset"),
        ('filename="door.glb"', 'filename="file:///etc/hosts.glb"', "outside of its dataset"),
        ('xyz="0 0.9 0"', 'xyz="0 0.9"', "3 finite numbers"),
        ("<cylinder", "<plane", "shape plane"),
        ("</robot>", "", "not a URDF"),
        ('<parent link="body"/><child link="door"/>', '<parent link="door"/><child link="door"/>', "circle"),
        ("<robot", '<?xml version="1.0" encoding="big5"?><robot', "multi-byte"),
        ('<cylinder radius="0.1"', '<capsule radius="0"', "radius 0"),
        ('<child link="drawer"/>', '<child link=""/>', "child link"),
        ('<parent link="body"/><child link="drawer"/>', '<child link="drawer"/>', "parent link"),
        ("</robot>", "<link/>" * 500 + "</robot>", "at most 500"),
    ],
)
def test_an_articulated_object_that_cannot_be_read_is_named(mine: Path, was: str, becomes: str, said: str) -> None:
    fridge(mine, (was, becomes))
    fails(mine, "articulated object 0 (fridge)", said)
    with pytest.warns(UserWarning, match="fridge"):
        assert 6 not in load(mine, "?missing=skip").by_id


def test_a_scale_of_nothing_is_named(mine: Path) -> None:
    fridge(mine, uniform_scale=0)
    fails(mine, "articulated object 0 (fridge)", "must not be 0")


def test_lights_and_a_moved_stage_are_ignored_and_that_is_said(mine: Path) -> None:
    moved = {"template_name": "stages/toy", "translation": [0, 1, 0]}
    edit(mine / "scenes" / "toy1.scene_instance.json", default_lighting="lights/evening", stage_instance=moved)
    stage, lights = json.loads(load(mine).notes["ignored"])
    assert stage.startswith("stage 'stages/toy': it stands where its model puts it")
    assert lights.startswith("light setup lights/evening")


# -- what is wrong ----------------------------------------------------------------------------------------------------
def fails(folder: Path, *words: str, rest: str = "") -> None:
    with pytest.raises(SceneError) as caught:
        load(folder, rest)
    for word in words:
        assert word in str(caught.value)


def test_a_lost_mesh_is_named_with_its_object(mine: Path) -> None:
    (mine / "objects" / "t" / "tv1.glb").unlink()
    fails(mine, "object 1 (tv1)", "tv1.glb", "No such file", "missing=skip")


def test_the_rest_is_loaded_if_asked_for(mine: Path, scene: Scene) -> None:
    (mine / "objects" / "t" / "tv1.glb").unlink()
    with pytest.warns(UserWarning, match="1 left out"):
        rest = load(mine, "?missing=skip")
    assert 2 not in rest.by_id
    np.testing.assert_allclose(rest.aabb(3), scene.aabb(3))
    (said,) = json.loads(rest.notes["left_out"])
    assert "object 1 (tv1)" in said
    assert "tv1.glb" in said


def test_a_name_that_fits_two_templates_is_the_first_by_path(mine: Path) -> None:
    edit(mine / "scenes" / "toy1.scene_instance.json", stage_instance={"template_name": "modified_stage"})
    nest(mine, "stages", *({"original_file": "stages/toy.stage_config.json", "template_handle": f"modified_stage_{k}",
                            "attributes": {"is_collidable": not k}} for k in (1, 0)))  # fmt: skip
    scene = load(mine)
    (said,) = json.loads(scene.notes["ignored"])
    assert said == "template 'modified_stage' fits modified_stage_0, which is taken, and modified_stage_1"
    assert all(scene.assets[thing.asset].hulls for thing in scene.objects if thing.category == "floor")


def test_a_template_that_nobody_defines_is_named(mine: Path) -> None:
    (mine / "objects" / "t" / "tv1.object_config.json").unlink()
    fails(mine, "object 1 (tv1)", "is not among the 4 objects")


POINTER = b"version https://git-lfs.github.com/spec/v1\noid sha256:00\n"
TABLE, INSTANCE = "semantics/objects.csv", "scenes/toy1.scene_instance.json"
CONFIG, REGIONS = "toy.scene_dataset_config.json", "semantics/scenes/toy1.semantic_config.json"


@pytest.mark.parametrize(("file", "content", "said"), [
    (TABLE, "id\nFougère\n".encode("latin-1"), ("objects.csv", "UTF-8", "byte 0xe8")),
    (TABLE, b"id\n" + b"x" * 200_000, ("objects.csv", "field larger than field limit")),
    (INSTANCE, b"[" * 100_000, ("toy1.scene_instance.json", "is not JSON", "recursion depth")),
    (INSTANCE, b'{"a":' * 100_000, ("toy1.scene_instance.json", "is not JSON", "recursion depth")),
    (INSTANCE, POINTER, ("toy1.scene_instance.json", "not JSON", "git lfs pull")),
    ("objects/t/tv1.glb", POINTER, ("tv1.glb", "pointer", "git lfs pull")),
])  # fmt: skip
def test_a_file_of_no_use_is_told(mine: Path, file: str, content: bytes, said: tuple[str, ...]) -> None:
    (mine / file).write_bytes(content)
    fails(mine, *said)


@pytest.mark.parametrize(("file", "field", "value", "said"), [
    (REGIONS, "region_annotations", [{"poly_loop": [[0, 0, 0], [1e30, 0, 0], [0, 0, 1e30]]}], ("poly_loop", "1000")),
    ("objects/t/tv1.object_config.json", "front", [0, 1, 1], ("tv1.object_config.json", "orthogonal")),
    ("objects/c/cup1.object_config.json", "render_asset", "cup\0.glb", ("object 3 (cup1)", "cannot be read")),
    (CONFIG, "objects", "objects", ("valid dict",)), (CONFIG, "objects", {"paths": {".json": ["a**b"]}}, ("a**b",)),
    (CONFIG, "objects", {"default_attributes": [1]}, ("default_attributes",)),
    (CONFIG, "objects", {"paths": {".json": [5]}}, ("paths",)),
    (CONFIG, "objects", {"paths": {".json": "objects/*"}}, ("paths",)),
    (INSTANCE, "articulated_object_instances", [{"template_name": "fridge"}],
     ("articulated object 0 (fridge)", "is not among the 0 articulated_objects")),
])  # fmt: skip
def test_a_field_of_no_use_is_told(mine: Path, file: str, field: str, value: object, said: tuple[str, ...]) -> None:
    edit(mine / file, **{field: value})
    fails(mine, *said)


@pytest.mark.parametrize(("changed", "said"), [
    ({"translation": [1e30, 0, 0]}, ("translation", "1000")), ({"translation": [0, -1e30, 0]}, ("translation", "1000")),
    ({"translation": [0, 0, 20_000]}, ("translation", "1000")), ({"uniform_scale": 1e30}, ("scale", "1000")),
    ({"non_uniform_scale": [1, 1e5, 1]}, ("scale", "1000")), ({"translation": [0, 1]}, ("instances.2.translation",)),
    ({"rotation": [0, 0, 0, 0]}, ("toy1.scene_instance.json", "object_instances.2", "w, x, y, z")),
    ({"translation_origin": "corner"}, ("asset_local or COM", "corner")),
])  # fmt: skip
def test_an_object_that_cannot_be_placed_is_told(mine: Path, changed: dict, said: tuple[str, ...]) -> None:
    change_object(mine, 2, **changed)
    fails(mine, *said)


@pytest.mark.parametrize("grown", [(1e5, 1e5, 1e5), (1e30, 1, 1), (6000, 1, 6000)])
def test_a_model_too_large_to_walk_around_is_told(mine: Path, grown: tuple[float, ...]) -> None:
    """The cup is 0.1 m wide."""
    mesh = box((0, 0, 0), (0.1, 0.1, 0.1)).apply_scale(grown)
    model(mine / "objects" / "c" / "cup1.glb", mesh)
    with pytest.raises(SceneError, match=r"at most 100,000 m².*object 4 \(cup1"):
        load(mine)


def test_a_model_of_lines_alone_is_told_and_costs_a_building_nothing(mine: Path) -> None:
    line = trimesh.Trimesh([(0, 0, 0), (1, 0, 0), (2, 0, 0)], [(0, 1, 2)])
    before = load(mine)
    model(mine / "stages" / "toy.glb", *walls(), line.copy())
    assert [thing.category for thing in load(mine).objects] == [thing.category for thing in before.objects]
    model(mine / "objects" / "c" / "cup1.glb", line)
    fails(mine, "object 3 (cup1)", "has an area")


def test_a_model_cut_short_is_told(mine: Path) -> None:
    file = mine / "objects" / "t" / "tv1.glb"
    file.write_bytes(file.read_bytes()[:-100])
    fails(mine, "tv1.glb", "of its", "Fetch the file again")


def rewrite(file: Path, change) -> None:
    """Change the JSON of a GLB."""
    data = file.read_bytes()
    (length,) = struct.unpack_from("<I", data, 12)
    head = json.loads(data[20 : 20 + length])
    change(head)
    text = json.dumps(head).encode()
    text += b" " * (-len(text) % 4)
    rest = data[20 + length :]
    file.write_bytes(b"glTF" + struct.pack("<IIII", 2, 20 + len(text) + len(rest), len(text), 0x4E4F534A) + text + rest)


@pytest.mark.parametrize("extension", ["EXT_meshopt_compression", "ACME_rubber"])
def test_an_extension_that_the_shape_needs_and_nobody_knows_is_named(mine: Path, extension: str) -> None:
    rewrite(mine / "objects" / "t" / "tv1.glb", lambda head: head.update(extensionsRequired=[extension]))
    fails(mine, "object 1 (tv1)", "tv1.glb", extension)


def test_draco_is_named_and_so_is_what_reads_it(mine: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "DracoPy", None)  # As if it were not installed.

    def change(head: dict) -> None:
        head["meshes"][0]["primitives"][0]["extensions"] = {"KHR_draco_mesh_compression": {}}
        for accessor in head["accessors"]:  # With them it would be read without Draco.
            accessor.pop("bufferView", None)

    rewrite(mine / "objects" / "t" / "tv1.glb", change)
    fails(mine, "tv1.glb", "KHR_draco_mesh_compression", "pip install DracoPy")


def basis(head: dict) -> None:
    """As Habitat's tools leave a model: the picture is KTX2, which only an extension names."""
    head["images"][0]["mimeType"] = "image/ktx2"
    head["textures"][0] = {"extensions": {"KHR_texture_basisu": {"source": 0}}}
    head.update(extensionsUsed=["KHR_texture_basisu"], extensionsRequired=["KHR_texture_basisu"])


def test_ktx2_textures_give_way_to_the_base_colour_and_are_told(mine: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "alktx2", None)  # As if it were not installed.
    rewrite(textured(mine / "objects" / "c" / "cup1.glb"), basis)
    for _ in range(2):
        with pytest.warns(UserWarning, match=r"1 not read in full:\n.*cup1.glb: KTX2"):
            scene = load(mine)
        mesh = scene.assets[scene.by_id[4].asset].mesh
        # The factor 1, 0.5, 0 in linear light is 255, 186, 0 on a screen.
        np.testing.assert_allclose(mesh.texture.reshape(-1, 3).max(axis=0), (255, 186, 0), atol=2)


@pytest.mark.parametrize("classes", [5, [{"id": 1}], [{"id": "x", "name": "couch"}]])
def test_a_lexicon_of_no_use_is_told(mine: Path, classes: object) -> None:
    (mine / "semantics" / "objects.csv").unlink()
    write(mine / "semantics" / "toy.json", {"classes": classes})
    named = {"default_attributes": {"semantic_descriptor_filename": "semantics/toy.json"}}
    edit(mine / "toy.scene_dataset_config.json", semantic_scene_descriptor_instances=named)
    fails(mine, "toy.json", "classes")


def test_a_missing_scene_is_answered_with_the_nearest_that_are(mine: Path) -> None:
    with pytest.raises(SceneError, match=r"there is no scene 'toy2'.*such as toy1"):
        host().scene(f"hssd:{mine}#toy2")


@pytest.mark.parametrize(
    "argument", ["", "?missing=skip", "/x#y?missing=perhaps", "/x?triangles=many", "/x?colour=red"]
)
def test_a_reference_of_another_form_is_answered_with_the_form(argument: str) -> None:
    with pytest.raises(HumanclawError, match=r"hssd:/path/to/dataset#scene"):
        host().scene(f"hssd:{argument}")


def test_a_folder_without_a_dataset_is_told(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=r"scene_dataset_config.json; it holds none"):
        host().scene(f"hssd:{tmp_path}")
    with pytest.raises(SceneError, match="there is no scene dataset"):
        host().scene(f"hssd:{tmp_path / 'nowhere'}")


def test_mirrored_objects_keep_their_outside_outside(mine: Path) -> None:
    change_object(mine, 3, non_uniform_scale=[-1, 1, 1], rotation=[HALF, 0, HALF, 0])
    scene = load(mine)
    mesh = scene.assets[scene.by_id[4].asset].mesh
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    assert np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6 == pytest.approx(0.001, rel=1e-3)
