"""Routes on the hand-made flat of rooms.py; every expected number follows from its measures."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from rooms import asset, block, thing, two_rooms

from humanclaw.bench.routes import (
    RADIUS,
    FloorPlan,
    Routes,
    approach,
    geodesic,
    length,
    near,
    room_at,
    rooms_on,
    route,
    turns,
)

BEDROOM, LIVING = np.array([1.0, 1.0]), np.array([7.0, 1.0])


def test_the_way_to_the_next_room_leads_through_the_doorway() -> None:
    path = route(FloorPlan.of(two_rooms()), BEDROOM, LIVING)
    assert path is not None
    crossing = [a + (b - a) * (4 - a[0]) / (b[0] - a[0]) for a, b in pairwise(path) if a[0] < 4 <= b[0]]
    assert len(crossing) == 1
    assert crossing[0][1] == pytest.approx(4.5, abs=0.1)
    assert rooms_on(two_rooms(), path) == ("bedroom", "living room")


def test_the_geodesic_distance_is_that_of_the_taut_string_around_the_door_posts() -> None:
    # The doorway spans z 4.05 to 4.95 in a wall from x 3.95 to 4.05; a disk of radius 0.28 keeps off its lower posts.
    post = np.array([[3.95, 4.05], [4.05, 4.05]])
    inner = np.array(
        [post[0] + [-0.28 * np.sin(0.75), 0.28 * np.cos(0.75)], post[1] + [0.28 * np.sin(0.75), 0.28 * np.cos(0.75)]]
    )
    taut = length(np.array([BEDROOM, *inner, LIVING]))
    assert geodesic(FloorPlan.of(two_rooms()), BEDROOM, LIVING) == pytest.approx(taut, rel=0.03)


def test_a_straight_way_is_as_long_as_it_is() -> None:
    assert geodesic(FloorPlan.of(two_rooms()), BEDROOM, np.array([3.0, 2.5])) == pytest.approx(2.5, abs=0.03)


def test_a_route_keeps_off_the_walls_where_there_is_room() -> None:
    plan = FloorPlan.of(two_rooms())
    path = route(plan, BEDROOM, LIVING)
    assert path is not None
    samples = np.concatenate([np.linspace(a, b, 60) for a, b in pairwise(path)])
    in_rooms = np.abs(samples[:, 0] - 4) > 0.6
    assert plan.at(plan.clearance, samples).min() > RADIUS
    assert plan.at(plan.clearance, samples[in_rooms]).min() > 0.4


def test_a_narrow_door_is_passed_only_if_there_is_no_other_way() -> None:
    plan = FloorPlan.of(two_rooms(door=0.45))
    assert np.isinf(Routes.of(plan, BEDROOM, radius=RADIUS).to(LIVING))
    assert route(plan, BEDROOM, LIVING) is not None
    assert np.isfinite(geodesic(plan, BEDROOM, LIVING))


def test_there_is_no_way_through_a_closed_wall() -> None:
    plan = FloorPlan.of(two_rooms(door=0.1))
    assert route(plan, BEDROOM, LIVING) is None
    assert np.isinf(geodesic(plan, BEDROOM, LIVING))


def test_what_hangs_above_the_head_or_lies_flat_is_no_obstacle() -> None:
    lamp, rug = asset("lamp", "lamp", block(0.4, 0.4, 0.4)), asset("rug", "rug", block(2, 0.02, 2))
    plan = FloorPlan.of(two_rooms(0.9, (lamp, thing(30, lamp, 2, 2, y=2.0)), (rug, thing(31, rug, 2, 2))))
    assert not plan.at(plan.blocked, np.array([2.0, 2.0]))


def test_movable_things_are_walked_around_but_do_not_close_a_way() -> None:
    stool = asset("stool", "stool", block(0.4, 0.4, 0.4))
    free = FloorPlan.of(two_rooms(0.9, (stool, thing(30, stool, 2.5, 1.0, movable=True, mass=2.0))))
    path = route(free, BEDROOM, np.array([3.5, 1.0]))
    assert path is not None
    assert length(path) > 2.55
    in_door = FloorPlan.of(two_rooms(0.9, (stool, thing(30, stool, 4.0, 4.5, movable=True, mass=2.0))))
    assert route(in_door, BEDROOM, LIVING) is not None


def test_a_movable_thing_is_where_the_state_says_it_is() -> None:
    stool = asset("stool", "stool", block(0.4, 0.4, 0.4))
    scene = two_rooms(0.9, (stool, thing(30, stool, 2.5, 1.0, movable=True, mass=2.0)))
    plan = FloorPlan.of(scene, moved={30: np.array([3.0, 0, 3.0, 0, 0, 0, 1])})
    assert plan.at(plan.movable, np.array([3.0, 3.0]))
    assert not plan.at(plan.movable, np.array([2.5, 1.0]))


def test_an_obstacle_found_on_the_way_closes_it() -> None:
    plan = FloorPlan.of(two_rooms()).with_obstacle(np.array([4.0, 4.5]), 0.4)
    assert route(plan, BEDROOM, LIVING) is None


def test_one_stands_in_front_of_a_couch_with_the_back_to_it() -> None:
    # The couch looks along -X; its front edge lies at x = 7.5 - 0.45 and it is 2 m wide about z = 2.5.
    scene = two_rooms()
    first, *_ = stands = approach(FloorPlan.of(scene), scene, 20, sit=True)
    assert (first.x, first.z) == pytest.approx((7.05 - first.gap, 2.5), abs=1e-6)
    assert first.yaw == pytest.approx(-np.pi / 2)
    assert first.seat_height == pytest.approx(0.42)
    assert all(abs(stand.z - 2.5) <= 0.51 for stand in stands)


def test_a_blocked_seat_is_sat_on_beside_the_obstacle() -> None:
    box = asset("box", "table", block(0.5, 0.5, 0.5))
    scene = two_rooms(0.9, (box, thing(30, box, 6.6, 2.5)))
    stands = approach(FloorPlan.of(scene), scene, 20, sit=True)
    assert stands
    assert all(abs(stand.z - 2.5) > 0.45 for stand in stands)


def test_a_bed_is_sat_on_from_the_foot_and_from_the_side_that_no_wall_closes() -> None:
    # The bed's foot looks along +X; one long side is 0.6 m from the wall at z = 6, too near to turn round, the other is free.
    scene = two_rooms()
    yaws = {round(float(np.degrees(stand.yaw))) % 360 for stand in approach(FloorPlan.of(scene), scene, 22, sit=True)}
    assert yaws == {90, 180}


def test_a_target_is_never_approached_through_a_wall() -> None:
    tall = asset("plant", "potted_plant", block(0.3, 1.0, 0.3))
    scene = two_rooms(0.9, (tall, thing(30, tall, 4.25, 1.0)))
    assert (near(FloorPlan.of(scene), scene, 30)[:, 0] > 4.25).all()


def test_a_thing_on_the_wall_is_approached_along_its_whole_width() -> None:
    scene = two_rooms()
    stands = approach(FloorPlan.of(scene), scene, 21)
    assert min(stand.gap for stand in stands) < 0.32
    assert all(stand.seat_height is None for stand in stands)
    assert np.ptp([stand.x for stand in stands]) > 0.9


def test_turns_are_counted_on_the_simplified_line() -> None:
    assert turns(np.array([[0, 0], [0, 2], [2, 2], [2, 4]], float)) == 2
    assert turns(np.array([[0, 0], [0, 2], [0.05, 4], [0, 6]], float)) == 0


def test_rooms_are_found_by_point_and_storey() -> None:
    assert room_at(two_rooms(), 1, 1) == "bedroom"
    assert room_at(two_rooms(), 1, 1, floor=3.0) == ""


def test_a_wall_hides_what_is_behind_it_and_an_open_door_does_not() -> None:
    plan = FloorPlan.of(two_rooms())
    assert not plan.sees(np.array([3.0, 1.6, 2.0]), np.array([6.0, 1.0, 2.0]))
    assert plan.sees(np.array([3.0, 1.6, 4.5]), np.array([6.0, 1.0, 4.5]))


def test_a_lintel_hides_what_is_behind_it_and_the_open_door_below_does_not() -> None:
    plan = FloorPlan.of(two_rooms())
    assert not plan.sees(np.array([3.0, 2.9, 4.5]), np.array([6.0, 0.1, 4.5]))
    assert plan.sees(np.array([3.0, 2.4, 4.5]), np.array([6.0, 0.1, 4.5]))


def test_sight_is_computed_for_many_points_at_once() -> None:
    plan = FloorPlan.of(two_rooms())
    points = np.array([[6.0, 1.0, 4.5], [6.0, 1.0, 2.0]])
    assert plan.sees(np.array([3.0, 1.6, 4.5]), points).tolist() == [True, False]
