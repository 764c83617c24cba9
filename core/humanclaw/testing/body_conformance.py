"""What half-physics does to a body, as tests beside the laws: it is blocked, is carried and sits."""

from __future__ import annotations

import numpy as np
import pytest

from humanclaw.body.pose import FPS, Motion, Pose2D, heading, matrix_from_vector, rest_pose
from humanclaw.body.skeleton import JOINT_INDEX, STANDING_HEIGHT
from humanclaw.checks.motions import gait, glide, sitting_down
from humanclaw.laws.played import Played, play
from humanclaw.world.half_physics.profile import PROFILES, Profile
from humanclaw.world.joints import GRAVITY
from humanclaw.world.scene import Scene
from humanclaw.world.scene_builder import SceneBuilder
from humanclaw.world.simulator import Simulator


class BodyConformance:
    """Tests of a body in the world. simulator: the factory that a plugin offers."""

    def simulator(self, profile: str | Profile = "default") -> Simulator:
        raise NotImplementedError("a conformance test must define simulator().")

    def reset(self, builder: SceneBuilder) -> Simulator:
        """Return a simulator whose body stands on a scene's start."""
        simulator, scene = self.simulator(), builder.scene()
        simulator.reset(scene, scene.start)
        return simulator

    def play(self, scene: Scene, motion: Motion, profile: str = "default") -> Played:
        simulator = self.simulator(profile)
        played = play(simulator, scene, motion)
        simulator.close()
        return played

    def test_walking_on_a_floor_tracks_the_command_and_does_not_sink(self) -> None:
        command = gait(4, 0.4)
        played = self.play(SceneBuilder.on_floor().scene(), command)
        error = np.linalg.norm(played.simulated.joints() - command.joints(), axis=-1)[15:]
        assert error.mean() < 0.02
        assert np.abs(played.simulated.root[-1] - command.root[-1]).max() < 0.05
        assert max(contact.depth for contact in played.contacts) < 0.02

    @pytest.mark.parametrize("speed", [1.0, 1.6, 5.0])
    def test_a_thin_wall_is_not_entered_however_fast_one_walks(self, speed: float) -> None:
        """A wall of 3 cm; a body that moves 80 cm a step, and faster than any sprint."""
        builder = SceneBuilder.on_floor()
        wall = builder.box("wall", (6, 2.5, 0.03), (0, 0, 0.8))
        played = self.play(builder.scene(), glide(0.0, speed, 30))
        assert max(contact.depth for contact in played.touched(wall)) < 0.015
        assert played.simulated.joints()[..., 2].max() < 0.785

    @pytest.mark.parametrize("wall", [[0.7], []])
    def test_climbing_where_no_stairs_are_lifts_nobody(self, wall: list[float]) -> None:
        """Neither up a wall nor into the air. wall: how far ahead one stands, metres."""
        builder = SceneBuilder.on_floor()
        for ahead in wall:
            builder.box("wall", (6, 2.5, 0.2), (0, 0, ahead))
        command = gait(5, 0.28, rise=0.17)
        played = self.play(builder.scene(), command)
        assert command.root[-1, 1] > 1.7
        assert played.simulated.root[:, 1].max() < STANDING_HEIGHT + 0.01

    def test_a_wall_does_not_turn_the_body(self) -> None:
        builder = SceneBuilder.on_floor()
        builder.box("wall", (6, 2.5, 0.2), (0, 0, 0.7), rotation=(0, np.sin(0.4), 0, np.cos(0.4)))
        played = self.play(builder.scene(), glide(0.0, 1.0, 30))
        assert np.abs(heading(played.simulated.rotations[:, 0])).max() < 0.01

    def test_blocked_distance_is_not_made_up_for(self) -> None:
        builder = SceneBuilder.on_floor()
        builder.box("wall", (6, 2.5, 0.2), (0, 0, 0.4))
        ahead, back = glide(0.0, 1.0, 12), glide(0.0, -1.0, 3)
        command = ahead.then(Motion(back.root + [0, 0, ahead.root[-1, 2]], back.rotations))
        simulated = self.play(builder.scene(), command).simulated.root[:, 2]
        assert simulated[11] < 0.2
        assert simulated[14] - simulated[11] == pytest.approx(-3 / FPS, abs=0.01)

    @pytest.mark.parametrize("profile", PROFILES)
    def test_stairs_carry_the_body_up(self, profile: str) -> None:
        builder = SceneBuilder.on_floor()
        builder.steps(5, rise=0.17, run=0.28, first=0.29)
        played = self.play(builder.scene(), gait(5, 0.28, rise=0.17), profile)
        assert played.simulated.root[-1, 1] == pytest.approx(0.93 + 5 * 0.17, abs=0.01)
        assert np.diff(played.simulated.root[:, 1]).max() * FPS < 1.0

    @pytest.mark.parametrize("seat", [0.38, 0.42, 0.46, 0.5])
    def test_sitting_down_ends_with_the_pelvis_on_the_seat_and_upright(self, seat: float) -> None:
        """Seats above the knees too: sloping thighs give way."""
        builder = SceneBuilder.on_floor()
        couch = builder.box("couch", (1.6, seat, 0.8), (0, 0, -0.65))
        played = self.play(builder.scene(), sitting_down(seat + 0.12, -0.45))
        assert "pelvis" in {contact.joint for contact in played.contacts[-40:] if contact.object_id == couch}
        assert played.simulated.root[-1, 1] == pytest.approx(seat + 0.14, abs=0.02)
        assert matrix_from_vector(played.simulated.rotations[:, 0])[:, 1, 1].min() > 0.99  # Cosine with up.
        assert np.abs(np.diff(played.simulated.root[-15:], axis=0)).max() < 0.0015

    def test_who_sat_on_a_high_seat_stands_up_on_straight_legs(self) -> None:
        builder = SceneBuilder.on_floor()
        builder.box("couch", (1.6, 0.5, 0.8), (0, 0, -0.65))
        down = sitting_down(0.62, -0.45)
        forward = glide(0.0, 0.6, 30)
        up = Motion(forward.root + [0, 0, down.root[-1, 2]], forward.rotations)
        simulated = self.play(builder.scene(), down.then(up)).simulated
        assert simulated.root[-1, 1] == pytest.approx(STANDING_HEIGHT, abs=0.01)
        assert np.abs(simulated.rotations[-1, [1, 2]]).max() < 0.01

    def test_a_toe_that_catches_an_edge_is_lifted_over_it_and_no_higher(self) -> None:
        """Soles drag along the floor at 0.6 m/s into a board of 3 cm, and into one of 6 cm."""
        ends = []
        for height in (0.03, 0.06):
            builder = SceneBuilder.on_floor()
            builder.box("board", (2, height, 2), (0, 0, 1.4))
            ends.append(self.play(builder.scene(), glide(0.0, 0.6, 30)).simulated.root[-1])
        assert ends[0] == pytest.approx([0, STANDING_HEIGHT + 0.03, 0.6], abs=0.05)
        assert ends[1][1] == pytest.approx(STANDING_HEIGHT, abs=0.01)
        assert ends[1][2] < 0.25

    @pytest.mark.parametrize("profile", PROFILES)
    def test_a_kick_does_not_enter_a_wall(self, profile: str) -> None:
        """A straight leg swings from the hip at 12 m/s."""
        builder = SceneBuilder.on_floor()
        wall = builder.box("wall", (6, 2.5, 0.2), (0, 0, 0.55))
        command = rest_pose(15)
        command.rotations[:, JOINT_INDEX["right_hip"], 0] = -1.4 * np.sin(np.arange(15) / 15 * 4 * np.pi)
        depths = [contact.depth for contact in self.play(builder.scene(), command, profile).touched(wall)]
        assert depths
        assert max(depths) < 0.015

    def test_lifted_feet_let_the_body_down_by_gravity_without_a_bounce(self) -> None:
        command = rest_pose(45)
        for side in ("left", "right"):
            command.rotations[:, JOINT_INDEX[f"{side}_hip"], 0] = -1.7
        height = self.play(SceneBuilder.on_floor().scene(), command).simulated.root[:, 1]
        assert 0.13 < height[-1] < 0.17
        assert -np.diff(height).min() * FPS < np.sqrt(2 * GRAVITY * STANDING_HEIGHT)
        assert np.diff(height[20:]).max() * FPS < 0.1

    def test_legs_straightened_at_once_lift_the_body_and_do_not_launch_it(self) -> None:
        down = sitting_down(0.6, -0.2)
        up = Motion(np.repeat(down.root[:1], 30, 0), rest_pose(30).rotations)
        height = self.play(SceneBuilder.on_floor().scene(), down.then(up)).simulated.root[:, 1]
        assert height[75:].max() < STANDING_HEIGHT + 0.05

    @pytest.mark.parametrize("seed", range(3))
    def test_a_walk_in_a_closed_room_never_leaves_it_and_ends_on_its_feet(self, seed: int) -> None:
        builder = SceneBuilder()
        builder.room()
        builder.box("couch", (1.6, 0.45, 0.8), (0, 0, -1.0))
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
