"""What every simulator has to pass: a test class that the tests of an engine's plugin inherit.

from humanclaw.testing.simulators import SimulatorConformance

class TestMyEngine(SimulatorConformance):
    simulator = staticmethod(my_factory)
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np
import pytest
from numpy.typing import NDArray

from humanclaw.body.pose import (
    FPS,
    Array,
    Motion,
    Pose2D,
    heading,
    matrix_from_quaternion,
    matrix_from_vector,
    rest_pose,
    vector_from_quaternion,
)
from humanclaw.body.skeleton import BODY_GROUPS, JOINT_INDEX, STANDING_HEIGHT
from humanclaw.errors import HumanclawError, SceneError
from humanclaw.testing.motions import Played, gait, glide, play, sitting_down
from humanclaw.testing.physics import CHECKS, Fixture
from humanclaw.testing.scenes import SceneBuilder, block, box_mesh
from humanclaw.world.half_physics.profile import Profile, find_profile
from humanclaw.world.scene import Scene
from humanclaw.world.simulator import Simulator

PROFILES: Final = ("default", "paper", "reference")


class SimulatorConformance:
    """The checks of half-physics: what a body may do, and what the world does to it. simulator: the factory that a
    plugin offers."""

    def simulator(self, profile: str | Profile = "default") -> Simulator:
        raise NotImplementedError("a conformance test names its simulator.")

    def play(self, scene: Scene, motion: Motion, profile: str = "default") -> Played:
        simulator = self.simulator(profile)
        played = play(simulator, scene, motion)
        simulator.close()
        return played

    @pytest.mark.parametrize("profile", PROFILES)
    def test_a_body_in_free_space_does_what_it_is_told(self, profile: str) -> None:
        builder = SceneBuilder()
        builder.floor()
        played = self.play(builder.scene(), _waving(45), profile)
        error = np.linalg.norm(played.simulated.joints() - played.commanded.joints(), axis=-1)
        assert error.mean() < 0.001
        assert error.max() < 0.01

    def test_a_falling_body_does_what_it_is_told_too(self) -> None:
        builder = SceneBuilder()
        builder.box("floor", (2, 3, 0.6), (0, -3, 0))
        command = glide(0.0, 2.0, 30)
        command.rotations[:, JOINT_INDEX["left_hip"], 0] = -0.5 * np.sin(np.arange(30) / 5)
        played = self.play(builder.scene(), command)
        shape = [motion.joints() - motion.root[:, None] for motion in (played.simulated, played.commanded)]
        assert np.linalg.norm(shape[0] - shape[1], axis=-1)[15:].mean() < 0.002

    def test_walking_on_a_floor_tracks_the_command_without_sinking_or_sliding(self) -> None:
        builder = SceneBuilder()
        builder.floor()
        command = gait(4, 0.4)
        played = self.play(builder.scene(), command)
        error = np.linalg.norm(played.simulated.joints() - command.joints(), axis=-1)[15:]
        assert error.mean() < 0.02
        assert np.abs(played.simulated.root[-1] - command.root[-1]).max() < 0.05
        assert max(contact.depth for contact in played.contacts) < 0.02

    @pytest.mark.parametrize("profile", PROFILES)
    def test_a_wall_blocks_the_body(self, profile: str) -> None:
        builder = SceneBuilder()
        builder.floor()
        wall = builder.box("wall", (6, 2.5, 0.2), (0, 0, 1.1))
        played = self.play(builder.scene(), gait(6, 0.4), profile)
        assert played.commanded.root[-1, 2] > 2.0
        assert played.simulated.joints()[..., 2].max() < 1.0
        assert max(contact.depth for contact in played.touched(wall)) < 0.02

    @pytest.mark.parametrize("speed", [1.0, 1.6, 5.0])
    def test_a_thin_wall_is_not_entered_however_fast_one_walks(self, speed: float) -> None:
        """3 cm of wall, and a body that is moved 80 cm a step, and faster than any sprint."""
        builder = SceneBuilder()
        builder.floor()
        wall = builder.box("wall", (6, 2.5, 0.03), (0, 0, 0.8))
        played = self.play(builder.scene(), glide(0.0, speed, 30))
        assert max(contact.depth for contact in played.touched(wall)) < 0.015
        assert played.simulated.joints()[..., 2].max() < 0.785

    @pytest.mark.parametrize(("mass", "low", "high"), [(5.0, 1.0, 2.5), (60.0, 0.5, 1.6), (300.0, -0.01, 0.01)])
    def test_mass_counts_and_nobody_pushes_with_more_than_a_person_can(
        self, mass: float, low: float, high: float
    ) -> None:
        """Gliding 1.8 m at a box that begins 35 cm ahead; friction holds 60 kg with 147 N and 300 kg with 736 N."""
        builder = SceneBuilder()
        builder.floor()
        box = builder.box("box", (0.4, 0.8, 0.4), (0, 0, 0.55), movable=True, mass=mass)
        played = self.play(builder.scene(), glide(0.0, 1.2, 45))
        way = played.paths[box][:, 2]
        assert low < way[-1] - way[0] < high
        assert mass * np.diff(way, 2).max() * FPS**2 < 600

    def test_a_body_that_pushes_what_it_cannot_move_stands_before_it_and_not_in_it(self) -> None:
        builder = SceneBuilder()
        builder.floor()
        box = builder.box("box", (0.8, 1.2, 0.8), (0, 0, 0.75), movable=True, mass=1000.0)
        played = self.play(builder.scene(), glide(0.0, 1.0, 60))
        assert played.simulated.root[-1, 2] < 0.35
        assert max(contact.depth for contact in played.touched(box)) < 0.015

    def test_a_light_thing_on_one_that_nobody_could_push_is_pushed(self) -> None:
        """A chest that stands out over the edge of a table of 300 kg, which friction holds with 736 N."""
        builder = SceneBuilder()
        builder.floor()
        table = builder.box("table", (1.2, 0.8, 0.5), (0, 0, 1.0), movable=True, mass=300.0)
        chest = builder.box("chest", (0.3, 0.4, 0.8), (0, 0.8, 0.8), movable=True, mass=3.0)
        played = self.play(builder.scene(), glide(0.0, 1.0, 45))
        assert played.paths[chest][-1, 2] - 0.8 > 0.1
        assert np.abs(played.paths[table][-1, :3] - [0, 0, 1.0]).max() < 0.01

    def test_a_light_thing_beside_one_that_nobody_could_push_is_pushed(self) -> None:
        builder = SceneBuilder()
        builder.floor()
        cabinet = builder.box("cabinet", (0.5, 1.0, 2.0), (0.505, 0, 1.4), movable=True, mass=300.0)
        chair = builder.box("chair", (0.5, 0.5, 0.5), (0, 0, 0.65), movable=True, mass=8.0)
        played = self.play(builder.scene(), gait(4, 0.5))
        assert played.paths[chair][-1, 2] - 0.65 > 1.8
        assert np.abs(played.paths[cabinet][-1, :3] - [0.505, 0, 1.4]).max() < 0.01

    def test_a_light_thing_before_one_that_nobody_could_push_stays_down_and_blocks(self) -> None:
        builder = SceneBuilder()
        builder.floor()
        light = builder.box("box", (0.4, 0.4, 0.4), (0, 0, 0.7), movable=True, mass=5.0)
        heavy = builder.box("box", (0.6, 0.6, 0.6), (0, 0, 1.25), movable=True, mass=1000.0)
        played = self.play(builder.scene(), glide(0.0, 1.0, 60))
        assert played.simulated.root[-1, 2] < 0.5
        assert played.paths[light][:, 1].max() < 0.1
        assert np.abs(played.paths[heavy][-1, :3] - [0, 0, 1.25]).max() < 0.02

    def test_the_far_end_of_a_long_thing_weighs_as_much_as_its_middle(self) -> None:
        """A beam of 8 m whose middle is out of reach; friction holds it with 1,226 N."""
        builder = SceneBuilder()
        builder.floor()
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
        assert played.objects[box][:3] == pytest.approx([2, 0, 0], abs=0.01)

    def test_nobody_climbs_a_wall(self) -> None:
        builder = SceneBuilder()
        builder.floor()
        builder.box("wall", (6, 2.5, 0.2), (0, 0, 0.7))
        played = self.play(builder.scene(), gait(5, 0.28, rise=0.17))
        assert played.commanded.root[-1, 1] > 1.7
        assert played.simulated.root[:, 1].max() < STANDING_HEIGHT + 0.01

    def test_a_wall_does_not_turn_the_body(self) -> None:
        builder = SceneBuilder()
        builder.floor()
        builder.box("wall", (6, 2.5, 0.2), (0, 0, 0.7), rotation=(0, np.sin(0.4), 0, np.cos(0.4)))
        played = self.play(builder.scene(), glide(0.0, 1.0, 30))
        assert np.abs(heading(played.simulated.rotations[:, 0])).max() < 0.01

    def test_blocked_distance_is_not_made_up_for(self) -> None:
        builder = SceneBuilder()
        builder.floor()
        builder.box("wall", (6, 2.5, 0.2), (0, 0, 0.4))
        ahead, back = glide(0.0, 1.0, 12), glide(0.0, -1.0, 3)
        command = ahead.then(Motion(back.root + [0, 0, ahead.root[-1, 2]], back.rotations))
        simulated = self.play(builder.scene(), command).simulated.root[:, 2]
        assert simulated[11] < 0.2
        assert simulated[14] - simulated[11] == pytest.approx(-3 / FPS, abs=0.01)

    @pytest.mark.parametrize("profile", PROFILES)
    def test_stairs_carry_the_body_up(self, profile: str) -> None:
        builder = SceneBuilder()
        builder.floor()
        builder.steps(5, rise=0.17, run=0.28, first=0.29)
        played = self.play(builder.scene(), gait(5, 0.28, rise=0.17), profile)
        assert played.simulated.root[-1, 1] == pytest.approx(0.93 + 5 * 0.17, abs=0.01)
        assert np.diff(played.simulated.root[:, 1]).max() * FPS < 1.0

    def test_climbing_where_no_stairs_are_lifts_nobody(self) -> None:
        builder = SceneBuilder()
        builder.floor()
        played = self.play(builder.scene(), gait(5, 0.28, rise=0.17))
        assert played.simulated.root[:, 1].max() < STANDING_HEIGHT + 0.01

    def test_a_step_into_the_air_falls_at_g(self) -> None:
        builder = SceneBuilder()
        builder.box("floor", (2, 3, 2), (0, -3, 0))
        height = self.play(builder.scene(), glide(0.0, 3.0, 30)).simulated.root[18:, 1]
        assert height[-1] < 0.5
        assert np.diff(height, 2) * FPS**2 == pytest.approx(-9.81, rel=0.02)

    def test_a_pushed_box_moves(self) -> None:
        builder = SceneBuilder()
        builder.floor()
        box = builder.box("box", (0.4, 0.4, 0.4), (0, 0, 0.7), movable=True, mass=5.0)
        played = self.play(builder.scene(), gait(4, 0.3))
        assert played.objects[box][2] > 0.9
        assert all(contact.movable for contact in played.touched(box))

    def test_a_fixed_box_does_not_move_and_stops_the_body(self) -> None:
        builder = SceneBuilder()
        builder.floor()
        box = builder.box("table", (0.4, 0.4, 0.4), (0, 0, 0.7))
        played = self.play(builder.scene(), gait(4, 0.3))
        assert box not in played.objects
        assert played.simulated.root[-1, 2] < 0.7 < played.commanded.root[-1, 2]

    def test_a_push_that_is_handed_on_is_reported(self) -> None:
        builder = SceneBuilder()
        builder.floor()
        near = builder.box("box", (0.3, 0.3, 0.3), (0, 0, 0.5), movable=True, mass=2.0)
        far = builder.box("box", (0.3, 0.3, 0.3), (0, 0, 0.85), movable=True, mass=2.0)
        played = self.play(builder.scene(), glide(0.0, 0.8, 30))
        assert not played.touched(far)
        assert (near, far) in {touch[1:] for touch in played.touches}
        assert played.objects[far][2] > 0.9

    def test_only_objects_that_moved_have_a_path(self) -> None:
        builder = SceneBuilder()
        builder.floor()
        near = builder.box("box", (0.3, 0.3, 0.3), (0, 0, 0.4), movable=True, mass=2.0)
        builder.box("box", (0.3, 0.3, 0.3), (3, 0, 3), movable=True, mass=2.0)
        simulator, scene = self.simulator(), builder.scene()
        simulator.reset(scene, scene.start)
        assert simulator.execute(rest_pose(15)).objects == {}
        assert {key: path.shape for key, path in simulator.execute(glide(0.0, 0.8)).objects.items()} == {near: (15, 7)}

    @pytest.mark.parametrize("seat", [0.38, 0.42, 0.46, 0.5])
    def test_sitting_down_ends_with_the_pelvis_on_the_seat_and_upright(self, seat: float) -> None:
        """Also where the seat is higher than the knees: thighs that slope give way to it."""
        builder = SceneBuilder()
        builder.floor()
        couch = builder.box("couch", (1.6, seat, 0.8), (0, 0, -0.65))
        played = self.play(builder.scene(), sitting_down(seat + 0.12, -0.45))
        assert "pelvis" in {contact.joint for contact in played.contacts[-40:] if contact.object_id == couch}
        assert played.simulated.root[-1, 1] == pytest.approx(seat + 0.14, abs=0.02)
        assert _uprightness(played.simulated).min() > 0.99
        assert np.abs(np.diff(played.simulated.root[-15:], axis=0)).max() < 0.001

    def test_who_sat_on_a_high_seat_stands_up_on_straight_legs(self) -> None:
        builder = SceneBuilder()
        builder.floor()
        builder.box("couch", (1.6, 0.5, 0.8), (0, 0, -0.65))
        down = sitting_down(0.62, -0.45)
        forward = glide(0.0, 0.6, 30)
        up = Motion(forward.root + [0, 0, down.root[-1, 2]], forward.rotations)
        simulated = self.play(builder.scene(), down.then(up)).simulated
        assert simulated.root[-1, 1] == pytest.approx(STANDING_HEIGHT, abs=0.01)
        assert np.abs(simulated.rotations[-1, [1, 2]]).max() < 0.01

    def test_a_toe_that_catches_an_edge_is_lifted_over_it_and_over_no_more(self) -> None:
        """Soles drag along the floor at 0.6 m/s into a board of 3 cm, and into one of 6 cm."""
        ends = []
        for height in (0.03, 0.06):
            builder = SceneBuilder()
            builder.floor()
            builder.box("board", (2, height, 2), (0, 0, 1.4))
            ends.append(self.play(builder.scene(), glide(0.0, 0.6, 30)).simulated.root[-1])
        assert ends[0] == pytest.approx([0, STANDING_HEIGHT + 0.03, 0.6], abs=0.05)
        assert ends[1][1] == pytest.approx(STANDING_HEIGHT, abs=0.01)
        assert ends[1][2] < 0.25

    @pytest.mark.parametrize("profile", PROFILES)
    def test_a_kick_does_not_enter_a_wall(self, profile: str) -> None:
        """A straight leg swung from the hip at 12 m/s."""
        builder = SceneBuilder()
        builder.floor()
        wall = builder.box("wall", (6, 2.5, 0.2), (0, 0, 0.55))
        command = rest_pose(15)
        command.rotations[:, JOINT_INDEX["right_hip"], 0] = -1.4 * np.sin(np.arange(15) / 15 * 4 * np.pi)
        depths = [contact.depth for contact in self.play(builder.scene(), command, profile).touched(wall)]
        assert depths
        assert max(depths) < 0.015

    def test_lifted_feet_let_the_body_down_as_gravity_would_and_no_bounce_follows(self) -> None:
        builder = SceneBuilder()
        builder.floor()
        command = rest_pose(45)
        for side in ("left", "right"):
            command.rotations[:, JOINT_INDEX[f"{side}_hip"], 0] = -1.7
        height = self.play(builder.scene(), command).simulated.root[:, 1]
        assert 0.13 < height[-1] < 0.17
        assert -np.diff(height).min() * FPS < np.sqrt(2 * 9.81 * STANDING_HEIGHT)
        assert np.diff(height[20:]).max() * FPS < 0.1

    def test_straightening_the_legs_at_once_lifts_the_body_and_does_not_launch_it(self) -> None:
        builder = SceneBuilder()
        builder.floor()
        down = sitting_down(0.6, -0.2)
        up = Motion(np.repeat(down.root[:1], 30, 0), rest_pose(30).rotations)
        height = self.play(builder.scene(), down.then(up)).simulated.root[:, 1]
        assert height[75:].max() < STANDING_HEIGHT + 0.05

    @pytest.mark.parametrize("seed", range(3))
    def test_walking_anywhere_in_a_closed_room_never_leaves_it_and_ends_on_both_feet(self, seed: int) -> None:
        builder = SceneBuilder()
        builder.floor()
        builder.box("couch", (1.6, 0.45, 0.8), (0, 0, -1.0))
        for size, x, z in (
            ((4, 2.5, 0.2), 0, 2),
            ((4, 2.5, 0.2), 0, -2),
            ((0.2, 2.5, 4), 2, 0),
            ((0.2, 2.5, 4), -2, 0),
        ):
            builder.box("wall", size, (x, 0, z))
        simulator, scene, random = self.simulator(), builder.scene(), np.random.default_rng(seed)
        here = simulator.reset(scene, scene.start).body
        for _ in range(10):
            walk = Pose2D(0, 0, random.uniform(-np.pi, np.pi)).to_world(gait(3, 0.4))
            for first in range(0, len(walk), 15):
                gap = (here.root[-1] - walk.root[max(first - 1, 0)]) * [1, 0, 1]
                here = simulator.execute(
                    Motion(walk.root[first : first + 15] + gap, walk.rotations[first : first + 15])
                ).simulated
                assert np.abs(here.joints()[..., [0, 2]]).max() < 1.95
                assert 0.4 < here.root[:, 1].min() < here.root[:, 1].max() < 1.6
        for _ in range(4):
            here = simulator.execute(Motion(here.root[-1:].repeat(15, axis=0), rest_pose(15).rotations)).simulated
        assert here.root[-1, 1] == pytest.approx(STANDING_HEIGHT, abs=0.02)

    def test_the_same_commands_have_the_same_outcome_bit_for_bit(self) -> None:
        builder = SceneBuilder()
        builder.floor()
        builder.box("box", (0.4, 0.4, 0.4), (0, 0, 0.7), movable=True, mass=5.0)
        first, second = (self.play(builder.scene(), gait(3, 0.3)) for _ in range(2))
        assert np.array_equal(first.simulated.root, second.simulated.root)
        assert np.array_equal(first.simulated.rotations, second.simulated.rotations)
        assert first.contacts == second.contacts

    def test_contacts_say_who_touched_what_when_and_where(self) -> None:
        builder = SceneBuilder()
        builder.floor()
        wall = builder.box("wall", (6, 2.5, 0.2), (0, 0, 0.4))
        simulator, scene = self.simulator(), builder.scene()
        simulator.reset(scene, scene.start)
        contacts = simulator.execute(glide(0.0, 1.0)).contacts
        assert {frame for contact in contacts for frame in contact.frames} <= set(range(15))
        assert {contact.group for contact in contacts} <= set(BODY_GROUPS)
        feet = [contact for contact in contacts if contact.object_id == 1]
        assert {contact.joint for contact in feet} == {"left_ankle", "right_ankle", "left_foot", "right_foot"}
        assert all(abs(contact.height) < 0.01 for contact in feet)
        assert min(contact.frames[0] for contact in contacts if contact.object_id == wall) == pytest.approx(3, abs=3)

    def test_a_start_inside_something_is_refused_with_a_remedy(self) -> None:
        builder = SceneBuilder()
        builder.floor()
        builder.box("table", (1, 0.8, 1), (2, 0, 0))
        with pytest.raises(SceneError, match=r"does not fit .* inside table 2") as raised:
            self.simulator().reset(builder.scene(), Pose2D(2.0, 0.0, 0.0))
        assert raised.value.remedy

    def test_a_start_without_a_floor_is_refused_with_a_remedy(self) -> None:
        builder = SceneBuilder()
        builder.floor()
        with pytest.raises(SceneError, match="does not stay on its start") as raised:
            self.simulator().reset(builder.scene(), Pose2D(0.0, 0.0, 0.0, floor=1.0))
        assert raised.value.remedy

    def test_a_start_may_lie_on_an_upper_floor_and_face_anywhere(self) -> None:
        builder = SceneBuilder()
        builder.floor(y=2.9)
        state = self.simulator().reset(builder.scene(), Pose2D(1.0, -2.0, 1.5, floor=2.9))
        assert state.body.root[0] == pytest.approx([1.0, 2.9 + STANDING_HEIGHT, -2.0], abs=0.005)
        assert state.body.yaw()[0] == pytest.approx(1.5, abs=0.001)

    def test_numbers_that_are_not_finite_are_refused_and_change_nothing(self) -> None:
        builder = SceneBuilder()
        builder.floor()
        simulator, scene = self.simulator(), builder.scene()
        before = simulator.reset(scene, scene.start).body.root
        broken = rest_pose(15)
        broken.root[3, 1] = np.nan
        with pytest.raises(HumanclawError, match="finite"):
            simulator.execute(broken)
        assert np.array_equal(simulator.state().body.root, before)

    def test_an_unknown_profile_is_refused_with_the_known_ones(self) -> None:
        with pytest.raises(HumanclawError, match="default, paper, reference"):
            self.simulator("papper")

    def test_a_simulator_without_a_scene_says_so(self) -> None:
        with pytest.raises(HumanclawError, match="reset"):
            self.simulator().execute(rest_pose(15))

    @pytest.mark.parametrize("movable", [True, False])
    def test_there_is_room_under_a_table(self, movable: bool) -> None:
        builder = SceneBuilder()
        builder.floor()
        builder.solid("table", _table(), (2, 0, 0), movable=movable, mass=10.0)
        box = builder.box("box", (0.3, 0.6, 0.3), (2.05, 0, 0), movable=True, mass=1.0)
        simulator, scene = self.simulator(), builder.scene()
        assert simulator.reset(scene, scene.start).objects[box][:3] == pytest.approx([2.05, 0, 0], abs=0.005)

    def test_a_table_carries_what_stands_on_it(self) -> None:
        builder = SceneBuilder()
        builder.floor()
        builder.solid("table", _table(), (2, 0, 0))
        cup = builder.box("cup", (0.1, 0.1, 0.1), (2.0, 0.75, 0), movable=True, mass=0.3)
        simulator, scene = self.simulator(), builder.scene()
        assert simulator.reset(scene, scene.start).objects[cup][1] == pytest.approx(0.75, abs=0.005)

    def test_an_object_at_rest_is_where_the_scene_put_it_however_it_is_turned(self) -> None:
        builder = SceneBuilder()
        builder.floor()
        turn = (0.0, np.sin(0.5), 0.0, np.cos(0.5))
        obj = builder.solid("table", _table(), (2, 0, 1), rotation=turn, movable=True, mass=10.0)
        simulator, scene = self.simulator(), builder.scene()
        simulator.reset(scene, scene.start)
        simulator.execute(rest_pose(15))
        assert simulator.state().objects[obj] == pytest.approx([2, 0, 1, *turn], abs=0.005)

    def test_an_object_in_the_air_falls(self) -> None:
        builder = SceneBuilder()
        builder.floor()
        box = builder.box("box", (0.2, 0.2, 0.2), (2, 1.5, 0), movable=True, mass=1.0)
        simulator, scene = self.simulator(), builder.scene()
        simulator.reset(scene, scene.start)
        simulator.execute(rest_pose(15))
        assert simulator.state().objects[box][1] == pytest.approx(0.0, abs=0.01)

    def test_objects_without_a_body_are_walked_through(self) -> None:
        builder = SceneBuilder()
        builder.floor()
        rug = builder.mesh("rug", box_mesh((1, 0.01, 1)), (0, 0, 0), movable=True, mass=1.0)
        simulator, scene = self.simulator(), builder.scene()
        state = simulator.reset(scene, scene.start)
        assert state.objects[rug][:3] == pytest.approx([0, 0, 0])
        assert rug not in {contact.object_id for contact in simulator.execute(rest_pose(15)).contacts}

    def test_a_movable_object_needs_a_mass(self) -> None:
        builder = SceneBuilder()
        builder.floor()
        builder.box("box", (0.2, 0.2, 0.2), (2, 0, 0), movable=True)
        with pytest.raises(SceneError, match="mass"):
            self.simulator().reset(builder.scene(), builder.scene().start)

    def test_a_door_keeps_its_angle_until_somebody_pushes_it(self) -> None:
        builder = SceneBuilder()
        builder.floor()
        door = builder.door(angle=0.5)
        simulator, scene = self.simulator(), builder.scene()
        leaf = scene.by_id[door]
        simulator.reset(scene, scene.start)
        assert simulator.execute(rest_pose(30)).objects == {}
        assert simulator.state().objects[door] == pytest.approx([*leaf.position, *leaf.rotation], abs=1e-4)

    def test_a_door_opens_for_a_body_turns_about_its_hinge_and_comes_to_rest(self) -> None:
        builder = SceneBuilder()
        builder.floor()
        door = builder.door()
        simulator, scene = self.simulator(), builder.scene()
        simulator.reset(scene, scene.start)
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
        builder = SceneBuilder()
        builder.floor()
        builder.box("post", (0.2, 2.0, 0.2), (0, 0, 1.15))
        door = builder.door()
        box = builder.box("box", (0.2, 0.5, 0.2), (0.3, 0, 1.1), movable=True, mass=2.0)
        simulator, scene = self.simulator(), builder.scene()
        simulator.reset(scene, scene.start)
        simulator.execute(glide(0.0, 1.0, 45))
        moved = simulator.state().objects
        assert np.degrees(-vector_from_quaternion(moved[door][3:])[1]) > 30
        assert np.linalg.norm(moved[box][:3] - [0.3, 0, 1.1]) > 0.1

    def test_what_brakes_a_door_is_overcome_by_the_same_force_as_its_weight(self) -> None:
        """500 N at the edge of a leaf, 0.89 m from its hinge, hold a damping of 1,000 N m s at 0.45 rad/s."""
        builder = SceneBuilder()
        builder.floor()
        door = builder.door()
        leaf = builder.objects[door - 1]
        assert leaf.joint is not None
        builder.objects[door - 1] = replace(leaf, joint=replace(leaf.joint, damping=1000.0))
        played = self.play(builder.scene(), glide(0.0, 1.0, 60))
        angles = -vector_from_quaternion(played.paths[door][:, 3:])[:, 1]
        assert 0.1 < np.diff(angles).max() * FPS < 0.6

    def test_a_door_needs_a_mass(self) -> None:
        builder = SceneBuilder()
        builder.floor()
        builder.door(mass=0.0)
        with pytest.raises(SceneError, match="mass"):
            self.simulator().reset(builder.scene(), builder.scene().start)

    @pytest.mark.parametrize("check", sorted(CHECKS))
    def test_the_law_holds(self, check: str) -> None:
        """What `humanclaw physics` measures, on few samples: the same code, within the same bounds."""
        fixture = Fixture(self.simulator, find_profile("default"), samples=2, chunks=60)
        found = list(CHECKS[check](fixture, lambda: None))
        assert found
        assert [finding for finding in found if not finding.holds] == []

    @pytest.mark.parametrize("profile", ["paper", "reference"])
    def test_the_papers_constants_keep_bodies_whole_too(self, profile: str) -> None:
        fixture = Fixture(self.simulator, find_profile(profile), chunks=30)
        for check in ("free-space", "ledge", "wild"):
            assert [finding for finding in CHECKS[check](fixture, lambda: None) if not finding.holds] == []


def _uprightness(motion: Motion) -> Array:
    """(T,) cosine between the pelvis's own up and the world's."""
    return np.asarray(matrix_from_vector(motion.rotations[:, 0])[:, 1, 1])


def _waving(frames: int) -> Motion:
    motion = rest_pose(frames)
    swing = np.sin(np.arange(frames) / 5)
    for joint, axis, size in (("left_shoulder", 2, 0.8), ("right_elbow", 1, 0.9), ("spine2", 0, 0.3), ("head", 1, 0.5)):
        motion.rotations[:, JOINT_INDEX[joint], axis] += size * swing
    return motion


def _table() -> tuple[NDArray[np.float32], ...]:
    """Return a top 0.7 m over the floor on two legs, one thicker than the other: its centre of mass is not over its
    origin."""
    top = block((-0.5, 0.7, -0.3), (0.5, 0.75, 0.3))
    return top, block((-0.5, 0, -0.3), (-0.3, 0.7, 0.3)), block((0.45, 0, -0.3), (0.5, 0.7, 0.3))
