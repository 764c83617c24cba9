"""Objects made of several convex pieces, and where they are said to be."""

import numpy as np
import pytest

from humanclaw.errors import SceneError
from humanclaw.pose import rest_pose
from humanclaw.scene import Asset
from humanclaw_bullet.simulator import HalfPhysics


def block(low, high):
    return np.array(
        [[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])], np.float32
    )


def table():
    """A top 0.7 m over the floor on two legs, one thicker than the other: its centre of mass is not over its origin."""
    top = block((-0.5, 0.7, -0.3), (0.5, 0.75, 0.3))
    return top, block((-0.5, 0, -0.3), (-0.3, 0.7, 0.3)), block((0.45, 0, -0.3), (0.5, 0.7, 0.3))


def with_hulls(workshop, hulls, position, **facts):
    thing = workshop.box("table", (1, 0.75, 0.6), position, **facts)
    name = workshop.objects[-1].asset
    workshop.assets[name] = Asset(name, "table", workshop.assets[name].mesh, tuple(hulls))
    return thing


@pytest.mark.parametrize("movable", [True, False])
def test_there_is_room_under_a_table(workshop, movable):
    workshop.floor()
    with_hulls(workshop, table(), (2, 0, 0), movable=movable, mass=10.0)
    box = workshop.box("box", (0.3, 0.6, 0.3), (2.05, 0, 0), movable=True, mass=1.0)
    simulator, scene = HalfPhysics(), workshop.scene()
    assert simulator.reset(scene, scene.start).objects[box][:3] == pytest.approx([2.05, 0, 0], abs=0.005)


def test_a_table_carries_what_stands_on_it(workshop):
    workshop.floor()
    with_hulls(workshop, table(), (2, 0, 0))
    cup = workshop.box("cup", (0.1, 0.1, 0.1), (2.0, 0.75, 0), movable=True, mass=0.3)
    simulator, scene = HalfPhysics(), workshop.scene()
    assert simulator.reset(scene, scene.start).objects[cup][1] == pytest.approx(0.75, abs=0.005)


def test_a_thing_at_rest_is_where_the_scene_put_it_however_it_is_turned(workshop):
    workshop.floor()
    turn = (0.0, np.sin(0.5), 0.0, np.cos(0.5))
    thing = with_hulls(workshop, table(), (2, 0, 1), rotation=turn, movable=True, mass=10.0)
    simulator, scene = HalfPhysics(), workshop.scene()
    simulator.reset(scene, scene.start)
    simulator.execute(rest_pose(15))
    assert simulator.state().objects[thing] == pytest.approx([2, 0, 1, *turn], abs=0.005)


def test_a_thing_in_the_air_falls(workshop):
    workshop.floor()
    box = workshop.box("box", (0.2, 0.2, 0.2), (2, 1.5, 0), movable=True, mass=1.0)
    simulator, scene = HalfPhysics(), workshop.scene()
    simulator.reset(scene, scene.start)
    simulator.execute(rest_pose(15))
    assert simulator.state().objects[box][1] == pytest.approx(0.0, abs=0.01)


def test_things_without_a_body_are_walked_through(workshop):
    workshop.floor()
    rug = with_hulls(workshop, (), (0, 0, 0), movable=True, mass=1.0)
    simulator, scene = HalfPhysics(), workshop.scene()
    state = simulator.reset(scene, scene.start)
    assert state.objects[rug][:3] == pytest.approx([0, 0, 0])
    assert rug not in {contact.object_id for contact in simulator.execute(rest_pose(15)).contacts}


def test_a_movable_thing_needs_a_mass(workshop):
    workshop.floor()
    workshop.box("box", (0.2, 0.2, 0.2), (2, 0, 0), movable=True)
    with pytest.raises(SceneError, match="mass"):
        HalfPhysics().reset(workshop.scene(), workshop.scene().start)
