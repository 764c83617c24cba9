"""Routes in the hand-made houses of rooms.py; every expected number follows from their measures."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from rooms import GOING, RISER, STEPS, UPSTAIRS, asset, block, scene, scene_object, two_rooms, two_storeys

from humanclaw.records.difficulty import route_difficulty
from humanclaw.world import (
    CELL,
    RADIUS,
    DistanceField,
    Hinge,
    MultiFloorMap,
    OccupancyGrid,
    SceneBuilder,
    geodesics,
    goals_at,
    length,
    room_at,
    stair_runs,
    viewpoints,
)

BEDROOM, LIVING = np.array([1.0, 1.0]), np.array([7.0, 1.0])


def on_floor(points: np.ndarray) -> np.ndarray:
    """(..., 2) points on the floor at 0 as (..., 3) points."""
    return np.insert(np.asarray(points, float), 1, 0.0, axis=-1)


def route(grid: OccupancyGrid, start: np.ndarray, goal: np.ndarray) -> np.ndarray | None:
    """The polyline (N, 2) from one place on a floor to another; None if there is no way."""
    segments = DistanceField.comfortable(MultiFloorMap((grid,)), on_floor(start)).route(on_floor(goal))
    return segments[0].points if segments else None


def geodesic(where: MultiFloorMap, start: np.ndarray, goal: np.ndarray) -> float:
    return float(DistanceField.of(where, np.atleast_2d(goal)).at(start))


def on_one_floor(grid: OccupancyGrid, start: np.ndarray, goal: np.ndarray) -> float:
    return geodesic(MultiFloorMap((grid,)), on_floor(start), on_floor(goal))


def turns(path: np.ndarray) -> int:
    return route_difficulty(two_rooms(), on_floor(path), 0.0).turns


def test_the_way_to_the_next_room_leads_through_the_doorway() -> None:
    path = route(OccupancyGrid.of(two_rooms()), BEDROOM, LIVING)
    assert path is not None
    crossing = [a + (b - a) * (4 - a[0]) / (b[0] - a[0]) for a, b in pairwise(path) if a[0] < 4 <= b[0]]
    assert len(crossing) == 1
    assert crossing[0][1] == pytest.approx(4.5, abs=0.1)


def test_the_geodesic_distance_is_that_of_the_taut_string() -> None:
    # The doorway spans z 4.05 to 4.95 in a wall from x 3.95 to 4.05; a disk of radius 0.28 keeps off its lower posts.
    post = np.array([[3.95, 4.05], [4.05, 4.05]])
    inner = np.array(
        [post[0] + [-0.28 * np.sin(0.75), 0.28 * np.cos(0.75)], post[1] + [0.28 * np.sin(0.75), 0.28 * np.cos(0.75)]]
    )
    taut = length(np.array([BEDROOM, *inner, LIVING]))
    assert on_one_floor(OccupancyGrid.of(two_rooms()), BEDROOM, LIVING) == pytest.approx(taut, rel=0.08)


def test_a_straight_way_is_as_long_as_it_is() -> None:
    assert on_one_floor(OccupancyGrid.of(two_rooms()), BEDROOM, np.array([3.0, 2.5])) == pytest.approx(2.5, rel=0.08)


def test_a_route_keeps_off_the_walls_where_there_is_room() -> None:
    plan = OccupancyGrid.of(two_rooms())
    path = route(plan, BEDROOM, LIVING)
    assert path is not None
    samples = np.concatenate([np.linspace(a, b, 60) for a, b in pairwise(path)])
    in_rooms = np.abs(samples[:, 0] - 4) > 0.6
    assert plan.at(plan.clearance, samples).min() > RADIUS
    assert plan.at(plan.clearance, samples[in_rooms]).min() > 0.4


def test_a_narrow_door_is_passed_only_if_there_is_no_other_way() -> None:
    plan = OccupancyGrid.of(two_rooms(door=0.45))
    assert np.isinf(on_one_floor(plan, BEDROOM, LIVING))
    assert route(plan, BEDROOM, LIVING) is not None


def test_there_is_no_way_through_a_closed_wall() -> None:
    plan = OccupancyGrid.of(two_rooms(door=0.1))
    assert route(plan, BEDROOM, LIVING) is None
    assert np.isinf(on_one_floor(plan, BEDROOM, LIVING))


def test_what_hangs_above_the_head_or_lies_flat_is_no_obstacle() -> None:
    lamp, rug = asset("lamp", "lamp", block(0.4, 0.4, 0.4)), asset("rug", "rug", block(2, 0.02, 2))
    plan = OccupancyGrid.of(
        two_rooms(0.9, (lamp, scene_object(30, lamp, 2, 2, y=2.0)), (rug, scene_object(31, rug, 2, 2)))
    )
    assert not plan.at(plan.blocked, np.array([2.0, 2.0]))


def test_movable_objects_are_walked_around_but_do_not_close_a_way() -> None:
    stool = asset("stool", "stool", block(0.4, 0.4, 0.4))
    free = OccupancyGrid.of(two_rooms(0.9, (stool, scene_object(30, stool, 2.5, 1.0, movable=True, mass=2.0))))
    path = route(free, BEDROOM, np.array([3.5, 1.0]))
    assert path is not None
    assert length(path) > 2.55
    in_door = OccupancyGrid.of(two_rooms(0.9, (stool, scene_object(30, stool, 4.0, 4.5, movable=True, mass=2.0))))
    assert route(in_door, BEDROOM, LIVING) is not None


@pytest.mark.parametrize(("degrees", "way"), [(0, False), (10, False), (60, True), (90, True)])
def test_a_door_on_its_hinge_closes_a_way_unless_it_stands_open(degrees: float, way: bool) -> None:
    """Nobody counts on pushing it: from its other side it could not be pushed."""
    leaf, angle = asset("leaf", "door", block(0.04, 2.0, 0.9, (0.02, 0, 0.45))), np.radians(degrees)
    hinge = Hinge((0.0, 0.0, 0.0), 0.0, 1.6)
    door = scene_object(40, leaf, 4.05, 4.05, angle, movable=True, mass=25.0, joint=hinge, state=float(angle))
    where = MultiFloorMap.of(two_rooms(0.9, (leaf, door)))
    start, goals = np.array([1.0, 0.0, 1.0]), np.array([[7.0, 0.0, 1.0]])
    assert bool(np.isfinite(geodesic(where, start, goals))) is way


def test_a_movable_object_is_where_the_state_says_it_is() -> None:
    stool = asset("stool", "stool", block(0.4, 0.4, 0.4))
    scene = two_rooms(0.9, (stool, scene_object(30, stool, 2.5, 1.0, movable=True, mass=2.0)))
    plan = OccupancyGrid.of(scene, moved={30: np.array([3.0, 0, 3.0, 0, 0, 0, 1])})
    assert plan.at(plan.movable, np.array([3.0, 3.0]))
    assert not plan.at(plan.movable, np.array([2.5, 1.0]))


def test_an_obstacle_found_on_the_way_closes_it() -> None:
    plan = OccupancyGrid.of(two_rooms()).with_obstacle(np.array([4.0, 4.5]), 0.4)
    assert route(plan, BEDROOM, LIVING) is None


def test_one_stands_in_front_of_a_couch_with_the_back_to_it() -> None:
    # The couch looks along -X; its front edge lies at x = 7.5 - 0.45 and it is 2 m wide about z = 2.5.
    scene = two_rooms()
    first, *_ = stands = viewpoints(MultiFloorMap.of(scene), scene, 20, sit=True)
    assert (first.x, first.z) == pytest.approx((7.05 - first.gap, 2.5), abs=1e-6)
    assert first.yaw == pytest.approx(-np.pi / 2)
    assert first.seat_height == pytest.approx(0.42)
    assert all(abs(stand.z - 2.5) <= 0.51 for stand in stands)


def test_a_corner_couch_is_sat_on_where_it_has_a_seat() -> None:
    # Seen from above, an L of 2.4 m, 0.8 m deep, whose right 0.8 m reach 0.8 m further: fronts at z = 0.4 and 1.2.
    parts = block(2.4, 0.42, 0.8), block(0.8, 0.42, 0.8) + np.array([0.8, 0, 0.8], np.float32)
    corner = asset("corner couch", "couch", *parts, seat=0.42)
    placed = scene((corner, scene_object(1, corner, 0.0, 0.0)))
    stands = viewpoints(MultiFloorMap.of(placed), placed, 1, sit=True)
    assert {(round(stand.z - stand.gap, 6), stand.x > 0.19) for stand in stands} == {(0.4, False), (1.2, True)}


def test_a_blocked_seat_is_sat_on_beside_the_obstacle() -> None:
    box = asset("box", "table", block(0.5, 0.5, 0.5))
    scene = two_rooms(0.9, (box, scene_object(30, box, 6.6, 2.5)))
    stands = viewpoints(MultiFloorMap.of(scene), scene, 20, sit=True)
    assert stands
    assert all(abs(stand.z - 2.5) > 0.45 for stand in stands)


def test_a_bed_is_sat_on_from_its_foot_and_its_open_side() -> None:
    # The bed's foot looks along +X; one long side is 0.6 m from the wall at z = 6, too near to turn round, the other is
    # free.
    scene = two_rooms()
    yaws = {
        round(float(np.degrees(stand.yaw))) % 360 for stand in viewpoints(MultiFloorMap.of(scene), scene, 22, sit=True)
    }
    assert yaws == {90, 180}


def test_a_target_is_never_approached_through_a_wall() -> None:
    tall = asset("plant", "potted_plant", block(0.3, 1.0, 0.3))
    scene = two_rooms(0.9, (tall, scene_object(30, tall, 4.25, 1.0)))
    assert (goals_at(MultiFloorMap.of(scene), scene, 30)[:, 0] > 4.25).all()


def test_an_object_on_the_wall_is_approached_along_its_whole_width() -> None:
    scene = two_rooms()
    stands = viewpoints(MultiFloorMap.of(scene), scene, 21)
    assert min(stand.gap for stand in stands) < 0.32
    assert all(stand.seat_height is None for stand in stands)
    assert np.ptp([stand.x for stand in stands]) > 0.9


def test_turns_are_counted_on_the_simplified_line() -> None:
    assert turns(np.array([[0, 0], [0, 2], [2, 2], [2, 4]], float)) == 2
    assert turns(np.array([[0, 0], [0, 2], [0.05, 4], [0, 6]], float)) == 0


def test_rooms_are_found_by_point_and_storey() -> None:
    assert room_at(two_rooms(), 1, 1) == "bedroom"
    assert room_at(two_rooms(), 1, 1, floor=3.0) == ""


def test_wall_and_lintel_hide_what_is_behind_them() -> None:
    plan = OccupancyGrid.of(two_rooms())
    assert not plan.sees(np.array([3.0, 1.6, 2.0]), np.array([6.0, 1.0, 2.0]))
    assert plan.sees(np.array([3.0, 1.6, 4.5]), np.array([6.0, 1.0, 4.5]))
    assert not plan.sees(np.array([3.0, 2.9, 4.5]), np.array([6.0, 0.1, 4.5]))
    assert plan.sees(np.array([3.0, 2.4, 4.5]), np.array([6.0, 0.1, 4.5]))


def test_sight_is_computed_for_many_points_at_once() -> None:
    plan = OccupancyGrid.of(two_rooms())
    points = np.array([[6.0, 1.0, 4.5], [6.0, 1.0, 2.0]])
    assert plan.sees(np.array([3.0, 1.6, 4.5]), points).tolist() == [True, False]


# -- storeys -----------------------------------------------------------------------------------------------------------
FOOT, HEAD = np.array([1.0, 0.0, 0.5]), np.array([7.0, UPSTAIRS, 0.5])
SLOPE = float(np.hypot(GOING, RISER) / GOING)


def test_a_way_up_the_stairs_is_as_long_as_slope_and_floors() -> None:
    # 6 m over the floor, of which 15 treads of 25 cm are climbed along the slope of 17 in 25 (the 16th riser is the
    # edge above).
    expected = 6.0 + (STEPS - 1) * GOING * (SLOPE - 1)
    assert geodesic(MultiFloorMap.of(two_storeys()), FOOT, HEAD) == pytest.approx(expected, rel=0.02)
    assert geodesic(MultiFloorMap.of(two_storeys()), HEAD, FOOT) == pytest.approx(expected, rel=0.02)


def test_two_places_above_one_another_are_as_far_as_the_stairs() -> None:
    # A string round the two ends of the wall and the rail at z = 1.03, 0.28 m off them, and along the slope between.
    below, above = np.array([4.0, 0.0, 2.0]), np.array([4.0, UPSTAIRS, 2.0])
    down = length(np.array([(4.0, 2.0), (1.9, 1.3), (1.75, 1.0), (2.0, 0.72)]))
    up = length(np.array([(5.75, 0.72), (6.0, 1.0), (5.85, 1.3), (4.0, 2.0)]))
    expected = down + (STEPS - 1) * GOING * SLOPE + up
    # Eight directions overestimate by up to 8.2 %, and each turn lies up to a cell farther off.
    assert 0.99 * expected < geodesic(MultiFloorMap.of(two_storeys()), below, above) < 1.09 * expected
    assert geodesic(MultiFloorMap.of(two_storeys()), below, below + [1.0, 0, 0]) == pytest.approx(1.0, abs=0.05)


def test_storeys_without_stairs_are_apart() -> None:
    whole = two_storeys()
    kept = tuple(obj for obj in whole.objects if obj.asset != "stairs")
    assert geodesic(MultiFloorMap.of(replace(whole, objects=kept)), FOOT, HEAD) == np.inf


def test_steps_higher_than_a_leg_can_lift_are_no_stairs() -> None:
    whole = two_storeys()
    blocks = [block(GOING, 0.34 * ((k + 1) // 2), 1.0, (2.0 + (k - 0.5) * GOING, 0, 0.5)) for k in range(1, STEPS)]
    steep = {**whole.assets, "stairs": asset("stairs", "stairs", *blocks)}
    assert geodesic(MultiFloorMap.of(replace(whole, assets=steep)), FOOT, HEAD) == np.inf


def test_stairs_need_no_label() -> None:
    whole = two_storeys()
    plain = {name: replace(kind, category="stage") for name, kind in whole.assets.items()}
    unnamed = replace(whole, assets=plain, objects=tuple(replace(obj, category="stage") for obj in whole.objects))
    assert geodesic(MultiFloorMap.of(unnamed), FOOT, HEAD) == geodesic(MultiFloorMap.of(whole), FOOT, HEAD)


def test_a_point_is_on_the_floor_or_the_step_below_it() -> None:
    storeys = MultiFloorMap.of(two_storeys())
    points = np.array(
        [FOOT, HEAD, HEAD + [0, 0.95, 0], [4.0, 9 * RISER + 0.95, 0.5], [4.0, 0.95, 2.0], [4.0, 3.6, 2.0]]
    )
    assert storeys.level(points).tolist() == [0, 2, 2, 1, 0, 2]


@pytest.mark.parametrize(("start", "goal", "way", "foot"), [(FOOT, HEAD, 1.0, 2.0), (HEAD, FOOT, -1.0, 5.75)])
def test_the_flight_on_a_route_has_the_steps_that_were_built(start, goal, way: float, foot: float) -> None:
    legs = DistanceField.comfortable(MultiFloorMap.of(two_storeys()), start).route(goal)
    (flight,) = [flight for leg in legs for flight in stair_runs(leg.grid, leg.samples)]
    assert flight.way == pytest.approx([way, 0.0], abs=0.02)
    assert flight.foot == pytest.approx([foot, 0.5], abs=0.06)
    assert flight.levels == pytest.approx([RISER * k for k in range(STEPS + 1)][:: int(way)], abs=1e-5)
    assert np.diff(flight.edges) == pytest.approx([GOING] * (STEPS - 1), abs=0.06)


def test_a_target_is_approached_on_its_own_storey() -> None:
    scene, storeys = two_storeys(), MultiFloorMap.of(two_storeys())
    assert {stand.floor for stand in viewpoints(storeys, scene, 30)} == {0.0}
    assert {stand.floor for stand in viewpoints(storeys, scene, 31, sit=True)} == {UPSTAIRS}
    assert all(stand.seat_height == pytest.approx(0.5) for stand in viewpoints(storeys, scene, 31, sit=True))


def test_starts_are_found_on_every_storey_with_room_around_them() -> None:
    below, above = MultiFloorMap.of(two_storeys()).starts(FOOT)
    assert set(below[:, 1]) == {0.0}
    assert set(above[:, 1]) == {UPSTAIRS}
    assert below[:, 0].min() >= 0.5 - CELL
    assert not ((above[:, 0] < 5.7) & (above[:, 2] < 1.5)).any(), "the hole over the stairs and its rail"


def test_the_distance_to_the_goal_is_measured_over_the_stairs() -> None:
    way = geodesics(two_storeys(), (32,))
    assert way(FOOT) == pytest.approx(way(FOOT + [0.0, 0.95, 0.0]))
    assert way(HEAD) < 2.2 < 7.0 < way(FOOT)
    on_ninth = np.array([4.1, 9 * RISER + 0.95, 0.5])
    assert way(on_ninth) == pytest.approx((way(FOOT) + way(HEAD)) / 2, abs=0.6)


def test_a_map_of_solid_things_counts_on_pushing_none():
    builder = SceneBuilder.on_floor()
    builder.box("box", (0.6, 0.6, 0.6), (0, 0, 2), movable=True, mass=10.0)
    ways = MultiFloorMap.of(builder.scene())
    middle = np.array([0.0, 0.0, 2.0])
    blocked = [bool(grid.at(grid.blocked, middle[[0, 2]])) for grid in (ways.grids[0], ways.solid().grids[0])]
    assert blocked == [False, True]
