"""Tests of where the oracle takes hold of what opens."""

import numpy as np
import pytest

from humanclaw.body import rest_pose
from humanclaw.world import Hinge, SceneBuilder, WorldState, block
from humanclaw_scripted.handles import Handle, free_sides, spot_on


@pytest.mark.parametrize("floor", [0.0, 2.88, 6.1])
def test_a_door_is_taken_at_the_height_of_a_hand_on_every_floor(floor):
    """A storey of 2.88 m is none of 3 m: there the oracle took wardrobes at the ankles, and its head shut them."""
    built = SceneBuilder()
    key = built.box("door", (0.6, 1.9, 0.04), (0, floor + 0.05, 0.75), movable=True, mass=9.0,
                    joint=Hinge((-0.3, 0, 0.02), -np.pi / 2, 0.0, 1.5, 2.0))  # fmt: skip
    scene = built.scene()
    handle = Handle.of(scene.hulls, scene.by_id[key], floor)
    assert handle.at(0.0)[1] - floor == pytest.approx(1.05, abs=0.01)


def test_a_hand_has_room_where_nothing_is_beside_a_thing():
    built = SceneBuilder()
    built.floor()
    box = built.box("box", (0.3, 0.3, 0.3), (0, 0, 0), movable=True)
    built.box("wall", (0.2, 2.5, 3), (0.27, 0, 0))
    places = np.array([(0.0, -0.8), (0.0, 0.8), (-0.8, 0.0)])
    free = free_sides(built.scene(), WorldState(rest_pose(), {}), box, places)
    assert free.tolist() == [[True, False], [False, True], [True, True]]


def test_a_thing_is_laid_where_a_full_table_has_most_room():
    built = SceneBuilder()
    ball = built.box("ball", (0.3, 0.3, 0.3), (0, 0, -1), movable=True)
    table = built.box("table", (1.0, 0.5, 0.36), (0, 0, 0.5))
    for x in (-0.35, 0.05):
        built.box("bowl", (0.2, 0.1, 0.2), (x, 0.5, 0.5), movable=True)
    x, y, _ = spot_on(built.scene(), WorldState(rest_pose(), {}), ball, table)
    assert (x, y) == pytest.approx((0.3, 0.5), abs=0.03)


def test_a_chair_under_a_table_takes_no_room_on_it():
    """Its back is beside the table, and a box around it reaches over the top."""
    built = SceneBuilder()
    shoe = built.box("shoe", (0.28, 0.1, 0.1), (0, 0, -1), movable=True)
    table = built.box("table", (1.0, 0.75, 0.36), (0, 0, 0.5))
    seat, back = block((-0.5, 0, 0.4), (0.1, 0.45, 0.6)), block((-0.5, 0.45, 0.72), (0.1, 0.9, 0.76))
    built.solid("chair", [seat, back], (0, 0, 0))
    built.box("bowl", (0.3, 0.1, 0.36), (0.35, 0.75, 0.5))
    x, _, _ = spot_on(built.scene(), WorldState(rest_pose(), {}), shoe, table)
    assert x < 0.2 - 0.14


def test_a_thing_is_laid_on_a_round_table_and_not_beside_it():
    """The nearest corner of its box is bare: there the oracle let go of a bottle."""
    built = SceneBuilder()
    bottle = built.box("bottle", (0.08, 0.3, 0.08), (0, 0, -1), movable=True)
    rim = [(0.4 * np.cos(turn), y, 0.4 * np.sin(turn)) for turn in np.arange(0.0, 6.28, 0.1) for y in (0.0, 0.39)]
    table = built.solid("table", [np.array(rim)], (1.0, 0.0, 1.0))
    x, y, z = spot_on(built.scene(), WorldState(rest_pose(), {}), bottle, table)
    assert y == pytest.approx(0.39)
    assert np.hypot(x - 1.0, z - 1.0) < 0.4 - 0.03
