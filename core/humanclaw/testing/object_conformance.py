"""What half-physics does to objects, as tests beside the laws: they block, carry, fall, and doors open."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from humanclaw.body.pose import FPS, matrix_from_quaternion, rest_pose, vector_from_quaternion
from humanclaw.checks.motions import gait, glide
from humanclaw.errors import SceneError
from humanclaw.testing.body_conformance import BodyConformance
from humanclaw.world.joints import Slide
from humanclaw.world.scene_builder import SceneBuilder, block, box_mesh


class ObjectConformance(BodyConformance):
    """Tests of objects that a body meets."""

    def test_a_body_stands_before_what_it_cannot_push_and_not_in_it(self) -> None:
        builder = SceneBuilder.on_floor()
        box = builder.box("box", (0.8, 1.2, 0.8), (0, 0, 0.75), movable=True, mass=1000.0)
        played = self.play(builder.scene(), glide(0.0, 1.0, 60))
        assert played.simulated.root[-1, 2] < 0.35
        assert max(contact.depth for contact in played.touched(box)) < 0.015

    def test_a_light_thing_on_one_that_nobody_could_push_is_pushed(self) -> None:
        """A chest that stands out over the edge of a table of 300 kg, which friction holds with 736 N."""
        builder = SceneBuilder.on_floor()
        table = builder.box("table", (1.2, 0.8, 0.5), (0, 0, 1.0), movable=True, mass=300.0)
        chest = builder.box("chest", (0.3, 0.4, 0.8), (0, 0.8, 0.8), movable=True, mass=3.0)
        played = self.play(builder.scene(), glide(0.0, 1.0, 45))
        assert played.paths[chest][-1, 2] - 0.8 > 0.1
        assert np.abs(played.paths[table][-1, :3] - [0, 0, 1.0]).max() < 0.01

    def test_a_light_thing_beside_one_that_nobody_could_push_is_pushed(self) -> None:
        builder = SceneBuilder.on_floor()
        cabinet = builder.box("cabinet", (0.5, 1.0, 2.0), (0.505, 0, 1.4), movable=True, mass=300.0)
        chair = builder.box("chair", (0.5, 0.5, 0.5), (0, 0, 0.65), movable=True, mass=8.0)
        played = self.play(builder.scene(), gait(4, 0.5))
        assert played.paths[chair][-1, 2] - 0.65 > 1.5
        assert np.abs(played.paths[cabinet][-1, :3] - [0.505, 0, 1.4]).max() < 0.01

    def test_the_far_end_of_a_long_thing_weighs_as_much_as_its_middle(self) -> None:
        """A beam of 8 m whose middle is out of reach; friction holds it with 1,226 N."""
        builder = SceneBuilder.on_floor()
        beam = builder.box("beam", (8, 0.5, 0.4), (-3.6, 0, 0.6), movable=True, mass=500.0)
        played = self.play(builder.scene(), glide(0.0, 1.0, 60))
        assert played.simulated.root[-1, 2] < 0.5
        assert np.abs(played.paths[beam][-1, :3] - [-3.6, 0, 0.6]).max() < 0.02

    def test_what_has_no_friction_bears_and_blocks(self) -> None:
        builder = SceneBuilder()
        builder.box("floor", (20, 0.2, 20), (0, -0.2, 0), friction=0.0)
        builder.box("wall", (6, 2.5, 0.2), (0, 0, 0.9), friction=0.0)
        box = builder.box("box", (0.4, 0.4, 0.4), (2, 0, 0), movable=True, mass=5.0, friction=0.0)
        played = self.play(builder.scene(), glide(0.0, 1.0, 60))
        assert played.simulated.root[:, 1].min() > 0.85
        assert played.simulated.root[-1, 2] < 0.8
        assert played.paths[box][-1, :3] == pytest.approx([2, 0, 0], abs=0.01)

    def test_a_push_that_is_handed_on_is_reported(self) -> None:
        builder = SceneBuilder.on_floor()
        near = builder.box("box", (0.3, 0.3, 0.3), (0, 0, 0.5), movable=True, mass=2.0)
        far = builder.box("box", (0.3, 0.3, 0.3), (0, 0, 0.85), movable=True, mass=2.0)
        played = self.play(builder.scene(), glide(0.0, 0.8, 30))
        assert not played.touched(far)
        assert (near, far) in {touch[1:] for chunk in played.chunks for touch in chunk.execution.touches}
        assert played.paths[far][-1, 2] > 0.9

    def test_only_objects_that_moved_have_a_path(self) -> None:
        builder = SceneBuilder.on_floor()
        near = builder.box("box", (0.3, 0.3, 0.3), (0, 0, 0.4), movable=True, mass=2.0)
        builder.box("box", (0.3, 0.3, 0.3), (3, 0, 3), movable=True, mass=2.0)
        simulator = self.reset(builder)
        assert simulator.execute(rest_pose(15)).objects == {}
        assert {key: path.shape for key, path in simulator.execute(glide(0.0, 0.8)).objects.items()} == {near: (15, 7)}

    @pytest.mark.parametrize("movable", [True, False])
    def test_there_is_room_under_a_table(self, movable: bool) -> None:
        builder = SceneBuilder.on_floor()
        builder.solid("table", _table(), (2, 0, 0), movable=movable, mass=10.0)
        box = builder.box("box", (0.3, 0.6, 0.3), (2.05, 0, 0), movable=True, mass=1.0)
        assert self.reset(builder).state().objects[box][:3] == pytest.approx([2.05, 0, 0], abs=0.005)

    def test_a_table_carries_what_stands_on_it(self) -> None:
        builder = SceneBuilder.on_floor()
        builder.solid("table", _table(), (2, 0, 0))
        cup = builder.box("cup", (0.1, 0.1, 0.1), (2.0, 0.75, 0), movable=True, mass=0.3)
        assert self.reset(builder).state().objects[cup][1] == pytest.approx(0.75, abs=0.005)

    def test_an_object_at_rest_is_where_the_scene_put_it_at_any_turn(self) -> None:
        builder = SceneBuilder.on_floor()
        turn = (0.0, np.sin(0.5), 0.0, np.cos(0.5))
        obj = builder.solid("table", _table(), (2, 0, 1), rotation=turn, movable=True, mass=10.0)
        simulator = self.reset(builder)
        simulator.execute(rest_pose(15))
        assert simulator.state().objects[obj] == pytest.approx([2, 0, 1, *turn], abs=0.005)

    def test_an_object_in_the_air_falls(self) -> None:
        builder = SceneBuilder.on_floor()
        box = builder.box("box", (0.2, 0.2, 0.2), (2, 1.5, 0), movable=True, mass=1.0)
        simulator = self.reset(builder)
        simulator.execute(rest_pose(15))
        assert simulator.state().objects[box][1] == pytest.approx(0.0, abs=0.01)

    def test_objects_without_a_body_are_walked_through(self) -> None:
        builder = SceneBuilder.on_floor()
        rug = builder.mesh("rug", box_mesh((1, 0.01, 1)), (0, 0, 0), movable=True, mass=1.0)
        simulator = self.reset(builder)
        assert simulator.state().objects[rug][:3] == pytest.approx([0, 0, 0])
        assert rug not in {contact.object_id for contact in simulator.execute(rest_pose(15)).contacts}

    @pytest.mark.parametrize("door", [False, True])
    def test_what_moves_needs_a_mass(self, door: bool) -> None:
        builder = SceneBuilder.on_floor()
        builder.door(mass=0.0) if door else builder.box("box", (0.2, 0.2, 0.2), (2, 0, 0), movable=True)
        with pytest.raises(SceneError, match="mass"):
            self.reset(builder)

    def test_a_door_keeps_its_angle_until_somebody_pushes_it(self) -> None:
        builder = SceneBuilder.on_floor()
        door = builder.door(angle=0.5)
        simulator, leaf = self.reset(builder), builder.objects[door - 1]
        assert simulator.execute(rest_pose(30)).objects == {}
        assert simulator.state().objects[door] == pytest.approx([*leaf.position, *leaf.rotation], abs=1e-4)

    def test_a_door_opens_for_a_body_about_its_hinge_and_comes_to_rest(self) -> None:
        builder = SceneBuilder.on_floor()
        door = builder.door()
        simulator = self.reset(builder)
        execution = simulator.execute(glide(0.0, 1.0, 45))
        places = execution.objects[door]
        hinge = places[:, :3] + matrix_from_quaternion(places[:, 3:]) @ [-0.45, 0.0, 0.0]
        assert {contact.movable for contact in execution.contacts if contact.object_id == door} == {True}
        assert hinge == pytest.approx(np.tile([-0.45, 0.01, 0.8], (45, 1)), abs=0.001)
        assert np.degrees(-vector_from_quaternion(places[-1, 3:])[1]) > 60
        for _ in range(8):
            execution = simulator.execute(glide(0.0, 1.0, 15))
        assert door not in execution.objects

    def test_a_door_passes_its_frame_and_moves_what_is_free_to(self) -> None:
        builder = SceneBuilder.on_floor()
        builder.box("post", (0.2, 2.0, 0.2), (0, 0, 1.15))
        door = builder.door()
        box = builder.box("box", (0.2, 0.5, 0.2), (0.3, 0, 1.1), movable=True, mass=2.0)
        simulator = self.reset(builder)
        simulator.execute(glide(0.0, 1.0, 45))
        moved = simulator.state().objects
        assert np.degrees(-vector_from_quaternion(moved[door][3:])[1]) > 30
        assert np.linalg.norm(moved[box][:3] - [0.3, 0, 1.1]) > 0.1

    def test_a_braked_door_meets_the_same_force_as_a_heavy_one(self) -> None:
        """500 N at the edge of a leaf, 0.89 m from its hinge, hold a damping of 1,000 N m s at 0.45 rad/s."""
        builder = SceneBuilder.on_floor()
        door = builder.door()
        leaf = builder.objects[door - 1]
        assert leaf.joint is not None
        builder.objects[door - 1] = replace(leaf, joint=replace(leaf.joint, damping=1000.0))
        played = self.play(builder.scene(), glide(0.0, 1.0, 60))
        angles = -vector_from_quaternion(played.paths[door][:, 3:])[:, 1]
        assert 0.1 < np.diff(angles).max() * FPS < 0.6

    def test_a_drawer_pushed_shut_keeps_its_line_and_its_load_and_stops(self) -> None:
        """It stands 40 cm open towards the body, with its front at 0.4 m."""
        builder = SceneBuilder.on_floor()
        hulls = [block((-0.3, 0.0, -0.25), (0.3, 0.02, 0.25)), block((-0.3, 0.0, 0.23), (0.3, 0.25, 0.25))]
        drawer = builder.solid(
            "drawer", hulls, (0, 0.6, 0.65), rotation=(0.0, 1.0, 0.0, 0.0), movable=True, mass=4.0,
            joint=Slide(0.0, 0.4), state=0.4,
        )  # fmt: skip
        cup = builder.box("cup", (0.1, 0.1, 0.1), (0.1, 0.62, 0.6), movable=True, mass=0.3)
        played = self.play(builder.scene(), glide(0.0, 0.6, 45))
        path = played.paths[drawer]
        assert np.abs(path[:, [0, 1]] - [0, 0.6]).max() < 0.001
        assert path[:, 2].max() == pytest.approx(1.05, abs=0.005)
        assert played.paths[cup][-1, 2] - 0.6 > 0.3
        assert played.simulated.root[-1, 2] < 0.75


def _table() -> tuple[NDArray[np.float32], ...]:
    """Return a top 0.7 m over the floor on two legs, one thicker than the other: its centre of mass is not over its
    origin."""
    top = block((-0.5, 0.7, -0.3), (0.5, 0.75, 0.3))
    return top, block((-0.5, 0, -0.3), (-0.3, 0.7, 0.3)), block((0.45, 0, -0.3), (0.5, 0.7, 0.3))
