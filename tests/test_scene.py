"""A scene refuses what nobody could act in, where its author has written it."""

import json
from dataclasses import replace

import numpy as np
import pytest
from rooms import asset, block, scene, scene_object, two_rooms
from safetensors.numpy import load, save

from humanclaw import SceneError
from humanclaw.body import Pose2D
from humanclaw.world import Hinge, Room, SceneBuilder, Slide, box_mesh, pack_scene, unpack_scene

STOOL = asset("stool", "chair", block(0.4, 0.45, 0.4), seat=0.45)


@pytest.mark.parametrize(
    ("name", "kind", "words"), [("living", "living", "the living room"), ("bedroom_2", "bedroom", "bedroom 2")]
)
def test_a_room_is_told_as_people_say_it(name, kind, words):
    assert Room(name, kind, 0, 0, 1, 1).told == words


@pytest.mark.parametrize("height", [0.5, 45.0, 0.0, -0.45, float("nan")])
def test_a_seat_that_is_not_on_its_asset_is_refused_with_both_heights(height):
    with pytest.raises(
        SceneError, match=rf"the seat of asset 'stool' is at {height:g} m, and the asset is 0\.45 m high"
    ):
        replace(STOOL, seat_height=height)


def test_a_seat_may_be_below_the_back_and_above_what_carries_it():
    couch = asset("couch", "couch", block(2.0, 0.42, 0.9), block(2.0, 0.4, 0.25, (0, 0.42, -0.325)), seat=0.42)
    assert replace(couch, seat_height=0.43).seat_height == 0.43
    assert replace(STOOL, seat_height=0.46).seat_height == 0.46


def test_a_seat_without_collision_pieces_carries_nobody():
    with pytest.raises(SceneError, match="has a seat and no collision pieces"):
        replace(STOOL, hulls=())


LEAF = asset("leaf", "door", block(0.9, 2.0, 0.04))
HINGE = Hinge((-0.45, 0.0, 0.0), 0.0, 1.6)


def hung(**facts):
    return scene_object(1, LEAF, 0.0, 0.0, **{"movable": True, "mass": 25.0, "joint": HINGE} | facts)


def test_a_scene_without_hinges_keeps_its_digest():
    assert two_rooms().digest == "55ea765119fc1f1acbc21cfac243f67b1050a6a4aa8d411cefc1ccb166cc2e30"


def test_a_door_with_another_hinge_range_or_angle_is_another_scene():
    others = [hung(), hung(state=0.5), hung(joint=replace(HINGE, high=1.7)), hung(joint=None)]
    assert len({scene((LEAF, door)).digest for door in others}) == len(others)


@pytest.mark.parametrize(
    ("facts", "message"),
    [
        ({"state": 2.0}, r"object 1 \(door\) is at 2 rad, and its joint goes from 0 to 1.6"),
        ({"movable": False}, "is on a joint and is not movable"),
        ({"joint": None, "state": 0.2}, "has the state 0.2 and no joint"),
    ],
)
def test_a_door_that_could_not_turn_is_refused_in_words(facts, message):
    with pytest.raises(SceneError, match=message):
        hung(**facts)


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("joint", []),
        ("state", 10**400),
        ("position", []),
        ("mass", -1.0),
        ("joint", {"point": [], "low": 0.0, "high": 1.0}),
    ],
    ids=["no joint", "huge", "nowhere", "lighter than nothing", "no point"],
)
def test_a_packed_door_that_is_none_is_refused_in_words(key, value):
    arrays = load(pack_scene(scene((LEAF, hung(state=0.5)))))
    head = json.loads(arrays["scene"].tobytes())
    head["objects"][0][key] = value
    arrays["scene"] = np.frombuffer(json.dumps(head).encode(), np.uint8)
    with pytest.raises(SceneError, match=r"not a packed scene|finite"):
        unpack_scene(save(arrays))


def test_a_drawer_and_a_lid_survive_being_packed():
    drawer = hung(joint=Slide(0.0, 0.4, friction=8.0), state=0.1)
    lid = hung(joint=Hinge((0.0, 0.0, 0.0), 0.0, 1.6, axis=(1.0, 0.0, 0.0)))
    for part in (hung(state=0.5), drawer, lid):
        assert unpack_scene(pack_scene(scene((LEAF, part)))).objects[0] == part


def test_a_drawer_is_as_far_out_as_its_slide_however_it_is_turned():
    """Turned by 90 degrees to the left, its front, and so its way out, points to +X."""
    drawer = replace(hung(joint=Slide(0.0, 0.4), state=0.1), rotation=(0.0, 0.5**0.5, 0.0, 0.5**0.5))
    assert drawer.at(0.3) == pytest.approx([0.2, 0.0, 0.0, 0.0, 0.5**0.5, 0.0, 0.5**0.5])


def test_a_lid_turns_down_about_its_lower_edge():
    """At 90 degrees about +X what was up is ahead: a point 0.5 m over the hinge is 0.5 m before it."""
    lid = hung(joint=Hinge((0.0, 0.1, 0.0), 0.0, 1.6, axis=(1.0, 0.0, 0.0)))
    assert lid.at(np.pi / 2) == pytest.approx([0.0, 0.1, -0.1, 0.5**0.5, 0.0, 0.0, 0.5**0.5])


@pytest.mark.parametrize(
    "broken", [{"low": 0.4}, {"axis": (0.0, 0.0, 2.0)}, {"axis": (1.0, 0.0)}, {"damping": float("nan")}]
)
def test_a_slide_with_impossible_or_missing_numbers_is_refused(broken):
    with pytest.raises(SceneError, match="slide"):
        replace(Slide(0.0, 0.4), **broken)


@pytest.mark.parametrize(
    "broken", [{"low": 1.6}, {"high": 7.0}, {"high": float("nan")}, {"friction": -1.0}, {"point": (0.0, 0.0)}]
)
def test_a_hinge_with_impossible_or_missing_numbers_is_refused(broken):
    with pytest.raises(SceneError) as refused:
        replace(HINGE, **broken)
    assert "hinge" in refused.value.message


@pytest.mark.parametrize(
    ("facts", "message"),
    [
        ({"mass": float("nan")}, "finite"),
        ({"mass": float("inf")}, "finite"),
        ({"friction": float("nan")}, "finite"),
        ({"friction": -0.5}, "no negative friction"),
        ({"position": (0.0, float("nan"), 0.0)}, "finite"),
        ({"rotation": (0.0, 0.0, 0.0, 0.0)}, "unit quaternion"),
        ({"rotation": (0.0, 2.0, 0.0, 2.0)}, "unit quaternion"),
    ],
)
def test_an_object_of_impossible_numbers_is_refused_where_it_is_made(facts, message):
    with pytest.raises(SceneError, match=message) as refused:
        replace(hung(), **facts)
    assert "object 1 (door)" in str(refused.value)


def test_a_scene_with_another_start_is_the_scene_made_with_it():
    """Equal digests and boxes, whether or not they were asked for before."""
    made, start = two_rooms(), Pose2D(1.5, 0.5, 0.25)
    begun, made_digest = replace(made, start=start), made.digest
    made.aabb(made.objects[0].id)
    other = made.starting(start)
    assert other.start == start
    assert other.digest == begun.digest != made_digest
    assert other.still == begun.still == made.still
    assert np.array_equal(other.aabb(made.objects[0].id), begun.aabb(made.objects[0].id))


def test_two_meshes_of_a_category_keep_a_shape_each():
    builder = SceneBuilder()
    for wide in (0.5, 0.25):
        builder.mesh("vase", box_mesh((wide, 0.5, 0.5)), (0.0, 0.0, 0.0))
    built = builder.scene()
    assert [np.ptp(built.vertices(obj.id)[:, 0]) for obj in built.objects] == [0.5, 0.25]
