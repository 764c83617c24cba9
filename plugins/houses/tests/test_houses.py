"""Generated houses through the public door: `house:N` gives a usable and plausible house."""

from __future__ import annotations

import re
import subprocess
import sys
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from humanclaw import Scene, SceneError
from humanclaw.records import SEATS
from humanclaw.world import STRUCTURE, DistanceField, SceneObject, goals_at
from humanclaw_houses.drafting import draw_plans
from humanclaw_houses.plan import Layout
from humanclaw_houses.source import house, layout_of, storeys_of
from humanclaw_houses.starting import WalkableArea
from humanclaw_houses.validity import FURNISHED, interpenetrating, problems, swung_through

SAMPLE = ("0", "2", "12", "20")
"""A straight hall, a living room that the other rooms open from, two storeys, and a hall that turns."""
EACH = ("0", *(pytest.param(name, marks=pytest.mark.integration) for name in SAMPLE[1:]))
THINGS = {
    "books", "bread", "candle", "cup", "desk_lamp", "detergent", "dish_rack", "glass", "jar", "kettle", "magazines",
    "microwave", "pan", "papers", "pens", "photo", "plate", "speaker", "storage_box", "succulent", "toaster",
    "toiletries", "towels",
}  # fmt: skip
"""Categories of things that dress a room. A cup may also be one that a body pushes."""
FITTINGS = {"bath_shelf", "handbag", "radiator", "shoes", "switch"}


@cache
def scene(argument: str) -> Scene:
    return house(argument)


def boxes(scene: Scene, obj: SceneObject) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return the world boxes of the hulls of an object turned by quarter turns."""
    _, y, _, w = obj.rotation
    yaw = 2 * np.arctan2(y, w)
    turn = np.array([[np.cos(yaw), 0, np.sin(yaw)], [0, 1, 0], [-np.sin(yaw), 0, np.cos(yaw)]])
    placed = [hull @ turn.T + np.array(obj.position) for hull in scene.assets[obj.asset].hulls]
    return [(points.min(axis=0), points.max(axis=0)) for points in placed]


def furniture(scene: Scene) -> list[SceneObject]:
    return [obj for obj in scene.objects if obj.category not in STRUCTURE and not obj.joint]


# -- the door ----------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("argument", ["41", "-1", "", "train-", "train", "07", "train-x", "1.0", "two"])
def test_an_unknown_house_is_refused_with_the_names_there_are(argument: str) -> None:
    with pytest.raises(SceneError, match=re.escape("house:0 to house:40")):
        house(argument)


@pytest.mark.integration
def test_importing_the_plugin_loads_no_geometry_library() -> None:
    code = (
        "import sys, humanclaw_houses; "
        "print([m for m in ('manifold3d', 'trimesh', 'scipy', 'skimage') if m in sys.modules])"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stdout.strip() == "[]"


@pytest.mark.integration
def test_the_same_number_gives_the_same_house_in_another_process() -> None:
    code = "from humanclaw_houses.source import house; print(house('2').digest)"
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stdout.strip() == scene("2").digest


@pytest.mark.integration
def test_different_numbers_give_different_houses() -> None:
    names = (*SAMPLE, "train-0")
    plans = {tuple((room.x0, room.z0, room.x1, room.z1) for room in scene(name).rooms) for name in names}
    assert len(plans) == len(names)


# -- layouts -----------------------------------------------------------------------------------------------------------
def test_validation_houses_are_of_every_layout() -> None:
    """Of 41: some of each shape, open plans and closed ones, a few with two living rooms."""
    layouts = [layout_of((0, number)) for number in range(41)]
    shapes = [layout.shape for layout in layouts if layout.storeys == 1]
    assert {shape: shapes.count(shape) for shape in shapes}.keys() == {"straight", "l", "t", "strip", "studio"}
    assert min(shapes.count(shape) for shape in set(shapes)) >= 4
    assert 10 <= sum(layout.open_plan for layout in layouts) <= 30
    assert 4 <= sum(layout.livings == 2 for layout in layouts) <= 15


@pytest.mark.parametrize("shape", ["straight", "l", "t", "strip", "studio"])
def test_in_every_plan_one_can_walk_from_each_room_to_each(shape: str) -> None:
    layout = Layout(shape, open_plan=shape in ("strip", "studio"))  # type: ignore[arg-type]
    for seed in range(20):
        (plan,) = draw_plans(np.random.default_rng(seed), layout)
        joined = {frozenset((w.low, w.high)) for w in plan.walls for o in w.openings if o.kind not in ("window",)}
        reached, kinds = {plan.areas[0].name}, [area.kind for area in plan.areas]
        for _ in plan.areas:
            reached |= {name for pair in joined if pair & reached for name in pair}
        assert reached - {""} == {area.name for area in plan.areas}
        assert sum(opening.kind == "front_door" for wall in plan.walls for opening in wall.openings) == 1
        assert kinds.count("hall") == {"straight": 1, "l": 2, "t": 2, "strip": 0, "studio": 1}[shape]


def test_nothing_stands_between_the_rooms_of_a_studio() -> None:
    (plan,) = draw_plans(np.random.default_rng(1), Layout("studio", open_plan=True))
    open_pairs = {frozenset((wall.low, wall.high)) for wall in plan.walls for o in wall.openings if o.kind == "open"}
    assert {frozenset(("living", "bedroom")), frozenset(("living", "kitchen"))} <= open_pairs


@pytest.mark.integration
def test_no_television_stands_before_a_window() -> None:
    for name in SAMPLE:
        whole = scene(name)
        windows = [whole.aabb(obj.id) for obj in whole.of_category("window")]
        for obj in whole.of_category("tv"):
            low, high = whole.aabb(obj.id)
            _, y, _, w = obj.rotation
            back = -np.array([2 * y * w, 0.0, w * w - y * y])
            behind = [np.minimum(low, low + 0.6 * back), np.maximum(high, high + 0.6 * back)]
            assert not any((a < behind[1]).all() and (b > behind[0]).all() for a, b in windows), obj.asset


# -- what is in a house ------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("name", EACH)
def test_every_house_has_all_six_target_categories(name: str) -> None:
    assert {obj.category for obj in scene(name).objects} >= set(FURNISHED)


@pytest.mark.parametrize("name", EACH)
def test_a_house_has_40_to_400_objects_and_a_fifth_can_be_moved(name: str) -> None:
    objects = furniture(scene(name))
    counted = [obj for obj in objects if obj.movable or obj.category not in THINGS | FITTINGS]
    assert 40 <= len(objects) <= 400
    assert 0.15 <= sum(obj.movable for obj in counted) / len(counted) <= 0.33


@pytest.mark.integration
def test_houses_have_30_small_things_that_stand_still() -> None:
    still = {name: [o for o in scene(name).objects if o.category in THINGS and not o.movable] for name in SAMPLE}
    assert min(len(objects) for objects in still.values()) >= 15
    assert sum(len(objects) for objects in still.values()) >= 30 * len(SAMPLE)
    assert not any(scene(name).assets[o.asset].hulls for name, objects in still.items() for o in objects)


def test_small_things_stand_on_furniture_or_on_the_floor() -> None:
    whole = scene(SAMPLE[0])
    tops = [(*part, obj.id) for obj in whole.objects for part in boxes(whole, obj)]
    tops += [(*whole.aabb(obj.id), obj.id) for obj in whole.objects if obj.category == "bath_shelf"]
    for obj in whole.objects:
        if obj.category in THINGS and not obj.movable:
            x, y, z = obj.position
            under = [high[1] for low, high, key in tops
                     if key != obj.id and low[0] <= x <= high[0] and low[2] <= z <= high[2]]  # fmt: skip
            assert min(abs(y - top) for top in under) < 0.01, obj.asset


@pytest.mark.parametrize("name", EACH)
def test_movable_objects_have_plausible_mass_and_friction(name: str) -> None:
    movable = [obj for obj in furniture(scene(name)) if obj.movable]
    assert all(0.1 <= obj.mass <= 15 and 0.2 <= obj.friction <= 0.9 for obj in movable)
    assert all(scene(name).assets[obj.asset].hulls for obj in movable)


@pytest.mark.parametrize("name", EACH)
def test_rooms_are_of_sensible_number_and_size(name: str) -> None:
    rooms = scene(name).rooms
    assert 4 <= len(rooms) <= 12
    for room in rooms:
        width, depth = room.x1 - room.x0, room.z1 - room.z0
        assert min(width, depth) >= 1.4, room
        assert (2 if room.kind == "hall" else 4) <= width * depth <= 45, room  # one arm of a hall that turns is short


@pytest.mark.parametrize("name", EACH)
def test_meshes_are_whole_and_small_enough_to_draw(name: str) -> None:
    count = 0
    for obj in scene(name).objects:
        mesh = scene(name).assets[obj.asset].mesh
        count += len(mesh.faces)
        assert mesh.uv.min() >= 0
        assert mesh.uv.max() <= 1
        assert mesh.faces.max() < len(mesh.vertices)
        if f"{obj.asset}_1" not in scene(name).assets:  # With its doors, a piece is centred as a whole.
            assert abs(mesh.vertices[:, [0, 2]].min(axis=0) + mesh.vertices[:, [0, 2]].max(axis=0)).max() < 1e-3
    assert count < 60_000


# -- walls and doors ---------------------------------------------------------------------------------------------------
def doorways(scene: Scene) -> list[tuple[str, float, float]]:
    """(wall, width, height) of each hole in the walls' collision boxes that begins at the floor and is not filled."""
    openings = []
    doors = [scene.aabb(obj.id) for obj in scene.of_category("door")]
    for wall in scene.of_category("wall"):
        parts = boxes(scene, wall)
        axis = 0 if np.ptp([p for pair in parts for p in pair], axis=0)[0] > 0.5 else 2
        floor = min(low[1] for low, _ in parts)
        high = [(low, top) for low, top in parts if low[1] > floor + 1.5]
        for low, top in high:
            under = [
                a for a, b in parts if a[1] < floor + 0.1 and a[axis] < top[axis] - 0.01 and b[axis] > low[axis] + 0.01
            ]
            middle = (low + top) / 2
            closed = any(
                (a <= [middle[0], floor + 1, middle[2]]).all() and (b >= [middle[0], floor + 1, middle[2]]).all()
                for a, b in doors
            )
            if not under and not closed:
                openings.append((wall.asset, float(top[axis] - low[axis]), float(low[1] - floor)))
    return openings


def joints(scene: Scene) -> int:
    """Walls of which nothing is left but the thickness of those that they meet: the sides of an open plan, of a hall
    that turns, and of stairs."""
    lengths = [
        sum(float(max((high - low)[[0, 2]])) for low, high in boxes(scene, obj)) for obj in scene.of_category("wall")
    ]
    return sum(length < 0.5 for length in lengths)


@pytest.mark.parametrize("name", EACH)
def test_doorways_are_wide_and_high_enough_for_a_body(name: str) -> None:
    holes = doorways(scene(name))
    assert len(holes) >= len(scene(name).rooms) - 1 - joints(scene(name))
    assert all(width >= 0.85 and height >= 2.04 for _, width, height in holes), holes


@pytest.mark.parametrize("name", EACH)
def test_walls_are_thick_enough_to_stop_a_body(name: str) -> None:
    for wall in scene(name).of_category("wall"):
        for low, high in boxes(scene(name), wall):
            assert min(high[0] - low[0], high[2] - low[2]) >= 0.1 - 1e-4


def hinged(whole: Scene) -> list[SceneObject]:
    return [obj for obj in whole.of_category("door") if obj.joint]


@pytest.mark.parametrize("name", EACH)
def test_furniture_opens_and_most_of_it_is_shut(name: str) -> None:
    leaves = [obj for obj in scene(name).objects if obj.joint and obj.category != "door"]
    assert {obj.category for obj in leaves} >= {"fridge", "stove", "sink", "nightstand"}
    assert len(leaves) >= 10
    assert sum(obj.state == 0 for obj in leaves) >= 0.6 * len(leaves)
    assert all(obj.joint and obj.joint.low <= obj.state <= obj.joint.high for obj in leaves)


@pytest.mark.integration
def test_most_houses_have_doors_and_some_of_them_are_ajar() -> None:
    angles = [np.degrees(abs(door.state)) for name in SAMPLE for door in hinged(scene(name))]
    assert len(angles) >= 4
    assert {bool(angle < 89) for angle in angles} == {True, False}


@pytest.mark.parametrize("name", EACH)
def test_doors_stand_open_and_nothing_stands_where_they_swing(name: str) -> None:
    whole = scene(name)
    for door in hinged(whole):
        assert 70 <= np.degrees(abs(door.state)) <= 90.1
    assert list(swung_through(whole)) == []


@pytest.mark.parametrize("name", EACH)
def test_a_door_that_is_shut_lies_before_its_doorway(name: str) -> None:
    """Seen from above its middle is in a gap of a wall, which its sides overlap by no more than 1 cm."""
    whole = scene(name)
    walls = [
        box for wall in whole.of_category("wall") for box in boxes(whole, wall) if box[0][1] < 0.1 + wall.position[1]
    ]
    for door in hinged(whole):
        place = door.at(0.0)
        low, high = whole.aabb(door.id, place)
        axis = 0 if high[0] - low[0] > high[2] - low[2] else 2
        middle, across = (low + high) / 2, 2 - axis
        nearest = [abs((a + b)[across] / 2 - middle[across]) for a, b in walls]
        beside = [
            (a, b) for (a, b), far in zip(walls, nearest, strict=True)
            if far < 0.13 and (b - a)[across] < 0.13 and a[1] < middle[1] < b[1]
        ]  # fmt: skip
        assert beside
        assert all(not (a[axis] - 0.01 < middle[axis] < b[axis] + 0.01) for a, b in beside), door.asset
        overlap = [min(high[axis], b[axis]) - max(low[axis], a[axis]) for a, b in beside]
        assert max(overlap) < 0.011, (door.asset, overlap)


def test_what_stands_where_a_door_swings_is_noticed() -> None:
    whole = scene("0")
    door, fridge = hinged(whole)[0], whole.of_category("fridge")[0]
    low, high = whole.aabb(door.id, door.at(door.state / 2))
    x, _, z = (low + high) / 2
    broken = Scene(
        whole.name, whole.assets,
        (*whole.objects, SceneObject(10_000, fridge.asset, "fridge", (float(x), door.position[1], float(z)))),
        whole.rooms, whole.start,
    )  # fmt: skip
    assert any(f"{door.asset} swings through {fridge.asset}" == problem for problem in problems(broken))


# -- validity ----------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("name", EACH)
def test_nothing_is_wrong_with_a_house(name: str) -> None:
    assert problems(scene(name)) == []


@pytest.mark.parametrize("name", EACH)
def test_no_furniture_reaches_into_a_wall(name: str) -> None:
    """Independent of the generator's own check: boxes of hulls against boxes of walls, for what is turned by quarter
    turns."""
    walls = [box for wall in scene(name).of_category("wall") for box in boxes(scene(name), wall)]
    for obj in furniture(scene(name)):
        for low, high in boxes(scene(name), obj):
            for wall_low, wall_high in walls:
                overlap = np.minimum(high, wall_high) - np.maximum(low, wall_low)
                assert overlap.min() < 0.01, (obj.asset, overlap)


def test_objects_put_into_each_other_are_noticed() -> None:
    whole = scene("0")
    couch, bed = whole.of_category("couch")[0], whole.of_category("bed")[0]
    moved = [SceneObject(**{**vars(obj), "position": bed.position}) if obj is couch else obj for obj in whole.objects]
    broken = Scene(whole.name, whole.assets, tuple(moved), whole.rooms, whole.start)
    assert (min(couch.id, bed.id), max(couch.id, bed.id)) in set(interpenetrating(broken))


def test_a_house_whose_doors_are_walled_up_is_noticed() -> None:
    whole = scene("0")
    hall = next(room for room in whole.rooms if room.kind == "hall")
    fridge = whole.of_category("fridge")[0]
    places = [(x, z) for x in np.arange(hall.x0, hall.x1, 0.5) for z in np.arange(hall.z0, hall.z1, 0.5)]
    fridges = [SceneObject(10_000 + k, fridge.asset, "fridge", (x, 0.0, z)) for k, (x, z) in enumerate(places)]
    broken = Scene(whole.name, whole.assets, (*whole.objects, *fridges), whole.rooms, whole.start)
    assert any("cannot be walked to" in problem for problem in problems(broken))


# -- storeys -----------------------------------------------------------------------------------------------------------
TALL = "12"


def staircase(whole: Scene) -> list[tuple[np.ndarray, np.ndarray]]:
    """Boxes of the steps, lowest first: they stand on the floor and are about a metre wide."""
    (stairs,) = whole.of_category("stairs")
    steps = [(low, high) for low, high in boxes(whole, stairs) if low[1] < 0.01 and max((high - low)[[0, 2]]) > 0.9]
    return sorted(steps, key=lambda box: box[1][1])


def test_a_third_of_the_validation_houses_has_two_storeys() -> None:
    tall = [number for number in range(41) if storeys_of((0, number)) == 2]
    assert 11 <= len(tall) <= 16
    assert int(TALL) in tall


@pytest.mark.integration
def test_the_steps_of_a_staircase_are_those_of_a_building_code() -> None:
    steps, upstairs = staircase(scene(TALL)), max(room.floor for room in scene(TALL).rooms)
    heights = [0.0, *(high[1] for _, high in steps), upstairs]
    assert len(steps) == 15
    assert all(0.15 <= rise <= 0.2 for rise in np.diff(heights))
    treads = [min((high - low)[[0, 2]]) for low, high in steps if (high - low)[[0, 2]].min() < 0.5]
    assert len(treads) == 14
    assert all(0.24 <= tread <= 0.3 for tread in treads)


@pytest.mark.integration
def test_over_every_step_there_is_room_for_a_head() -> None:
    whole = scene(TALL)
    rest = [box for obj in whole.objects if obj.category not in ("stairs", "wall") for box in boxes(whole, obj)]
    for low, high in staircase(whole):
        x, z = (low + high)[[0, 2]] / 2
        over = [a[1] for a, b in rest if a[0] <= x <= b[0] and a[2] <= z <= b[2] and a[1] > high[1] - 0.01]
        assert min(over, default=9.0) - high[1] > 1.95


@pytest.mark.integration
def test_nobody_can_walk_over_the_edge_of_the_upper_floor() -> None:
    """From the reachable floor upstairs every way of a step or less ends on a floor, on the stairs, or at something
    waist-high."""
    whole, walkable = scene(TALL), WalkableArea.of(scene(TALL))
    plan = walkable.floors.floors[1]
    solid = np.array([box for obj in whole.objects for box in boxes(whole, obj)])
    for cell in np.argwhere(np.isfinite(walkable.reached[2]))[::7]:
        point = plan.point(cell)
        for angle in np.linspace(0, 2 * np.pi, 8, endpoint=False):
            gap = 0  # a centimetre lies between the edge and the rail
            for reach in np.arange(0.03, 0.36, 0.03):
                x, z = point + reach * np.array([np.sin(angle), np.cos(angle)])
                there = (solid[:, 0, [0, 2]] <= [x, z]).all(1) & (solid[:, 1, [0, 2]] >= [x, z]).all(1)
                top = max(solid[there & (solid[:, 0, 1] < plan.floor + 0.5), 1, 1], default=-9.0)
                if top > plan.floor + 0.5:
                    break
                gap += top < plan.floor - 0.2
            assert gap < 2, (point, angle)


@pytest.mark.integration
def test_bedrooms_are_upstairs_and_the_way_to_them_is_over_the_stairs() -> None:
    whole, walkable = scene(TALL), WalkableArea.of(scene(TALL))
    upstairs = [room for room in whole.rooms if room.floor > 2]
    assert {"bedroom", "bathroom", "landing"} <= {room.kind for room in upstairs}
    start = np.array([whole.start.x, 0.0, whole.start.z])
    bed = next(obj for obj in whole.of_category("bed") if obj.position[1] > 2)
    direct = np.linalg.norm(np.array(bed.position) - start)
    assert direct + 2 < DistanceField.of(walkable.floors, goals_at(walkable.floors, whole, bed.id)).at(start) < 30


@pytest.mark.integration
def test_a_house_whose_stairs_are_barred_is_noticed() -> None:
    whole = scene(TALL)
    low, high = staircase(whole)[3]
    fridge = whole.of_category("fridge")[0]
    middle = (low + high) / 2
    barred = SceneObject(10_000, fridge.asset, "fridge", (float(middle[0]), float(high[1]), float(middle[2])))
    broken = Scene(whole.name, whole.assets, (*whole.objects, barred), whole.rooms, whole.start)
    assert any("landing cannot be walked to" in problem for problem in problems(broken))


def test_a_seat_at_a_wrong_height_is_noticed() -> None:
    whole = scene("0")
    couch = whole.of_category("couch")[0]
    assets = {**whole.assets, couch.asset: replace(whole.assets[couch.asset], seat_height=0.36)}
    broken = Scene(whole.name, assets, whole.objects, whole.rooms, whole.start)
    assert any("nothing to sit on at its seat height" in problem for problem in problems(broken))


@pytest.mark.parametrize("name", EACH)
def test_seats_have_their_real_height_and_collide_where_they_are_seen(name: str) -> None:
    limits = {"couch": (0.40, 0.48), "bed": (0.45, 0.60), "toilet": (0.40, 0.44)}
    for obj in scene(name).objects:
        if obj.category in SEATS:
            asset = scene(name).assets[obj.asset]
            low, high = limits[obj.category]
            assert asset.seat_height is not None
            assert low <= asset.seat_height <= high
            tops = [float(hull[:, 1].max()) for hull in asset.hulls]
            assert min(abs(top - asset.seat_height) for top in tops) < 0.012
            front = max(float(hull[:, 2].max()) for hull in asset.hulls)
            assert abs(front - float(asset.mesh.vertices[:, 2].max())) < 0.03


@pytest.mark.parametrize("name", EACH)
def test_small_objects_rest_on_something(name: str) -> None:
    """A collision box or the floor is straight below each movable object, within 5 mm of its lowest point."""
    whole = scene(name)
    solid = {obj.id: boxes(whole, obj) for obj in whole.objects}
    for obj in whole.objects:
        if not obj.movable or obj.joint:
            continue
        bottom = min(low[1] for low, _ in solid[obj.id])
        x, _, z = obj.position
        below = [
            high[1] for key, parts in solid.items() if key != obj.id for low, high in parts
            if low[0] <= x <= high[0] and low[2] <= z <= high[2] and high[1] <= bottom + 1e-3
        ]  # fmt: skip
        assert bottom - max(below) < 0.015, obj.asset
