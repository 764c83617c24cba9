"""Tests of where the oracle takes hold of what opens."""

import numpy as np
import pytest

from humanclaw.body import rest_pose
from humanclaw.testing import SceneBuilder
from humanclaw.world import Hinge, WorldState
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
