"""The laws of half-physics: what a body may do, and what the world does to it."""

import numpy as np
import pytest

from humanclaw.body import BODY_GROUPS, JOINT_INDEX, STANDING_HEIGHT
from humanclaw.errors import HumanclawError, SceneError
from humanclaw.pose import FPS, Motion, Pose2D, heading, matrix_from_vector, rest_pose
from humanclaw_bullet.simulator import HalfPhysics

PROFILES = ("default", "paper", "reference")


def uprightness(motion):
    """(T,) cosine between the pelvis's own up and the world's."""
    return matrix_from_vector(motion.rotations[:, 0])[:, 1, 1]


def waving(frames):
    motion = rest_pose(frames)
    swing = np.sin(np.arange(frames) / 5)
    for joint, axis, size in (("left_shoulder", 2, 0.8), ("right_elbow", 1, 0.9), ("spine2", 0, 0.3), ("head", 1, 0.5)):
        motion.rotations[:, JOINT_INDEX[joint], axis] += size * swing
    return motion


@pytest.mark.parametrize("profile", PROFILES)
def test_a_body_in_free_space_does_what_it_is_told(workshop, play, profile):
    workshop.floor()
    played = play(workshop.scene(), waving(45), profile)
    error = np.linalg.norm(played.realised.joints() - played.commanded.joints(), axis=-1)
    assert error.mean() < 0.001
    assert error.max() < 0.01


def test_a_falling_body_does_what_it_is_told_too(workshop, play, glide):
    workshop.box("floor", (2, 3, 0.6), (0, -3, 0))
    command = glide((0.0, 2.0), 30)
    command.rotations[:, JOINT_INDEX["left_hip"], 0] = -0.5 * np.sin(np.arange(30) / 5)
    played = play(workshop.scene(), command)
    shape = [motion.joints() - motion.root[:, None] for motion in (played.realised, played.commanded)]
    assert np.linalg.norm(shape[0] - shape[1], axis=-1)[15:].mean() < 0.002


def test_walking_on_a_floor_tracks_the_command_without_sinking_or_sliding(workshop, play, gait):
    workshop.floor()
    command = gait(4, 0.4)
    played = play(workshop.scene(), command)
    error = np.linalg.norm(played.realised.joints() - command.joints(), axis=-1)[15:]
    assert error.mean() < 0.02
    assert np.abs(played.realised.root[-1] - command.root[-1]).max() < 0.05
    assert max(contact.depth for contact in played.contacts) < 0.02


@pytest.mark.parametrize("profile", PROFILES)
def test_a_wall_blocks_the_body(workshop, play, gait, profile):
    workshop.floor()
    wall = workshop.box("wall", (6, 2.5, 0.2), (0, 0, 1.1))
    played = play(workshop.scene(), gait(6, 0.4), profile)
    assert played.commanded.root[-1, 2] > 2.0
    assert played.realised.joints()[..., 2].max() < 1.0
    assert max(contact.depth for contact in played.touched(wall)) < 0.02


def test_nobody_climbs_a_wall(workshop, play, gait):
    workshop.floor()
    workshop.box("wall", (6, 2.5, 0.2), (0, 0, 0.7))
    played = play(workshop.scene(), gait(5, 0.28, rise=0.17))
    assert played.commanded.root[-1, 1] > 1.7
    assert played.realised.root[:, 1].max() < STANDING_HEIGHT + 0.01


def test_a_wall_does_not_turn_the_body(workshop, play, glide):
    workshop.floor()
    workshop.box("wall", (6, 2.5, 0.2), (0, 0, 0.7), rotation=(0, np.sin(0.4), 0, np.cos(0.4)))
    played = play(workshop.scene(), glide((0.0, 1.0), 30))
    assert np.abs(heading(played.realised.rotations[:, 0])).max() < 0.01


def test_blocked_distance_is_not_made_up_for(workshop, play, glide):
    workshop.floor()
    workshop.box("wall", (6, 2.5, 0.2), (0, 0, 0.4))
    ahead, back = glide((0.0, 1.0), 12), glide((0.0, -1.0), 3)
    command = ahead.then(Motion(back.root + [0, 0, ahead.root[-1, 2]], back.rotations))
    realised = play(workshop.scene(), command).realised.root[:, 2]
    assert realised[11] < 0.2
    assert realised[14] - realised[11] == pytest.approx(-3 / FPS, abs=0.01)


@pytest.mark.parametrize("profile", PROFILES)
def test_stairs_carry_the_body_up(workshop, play, gait, profile):
    workshop.floor()
    workshop.steps(5, rise=0.17, run=0.28, first=0.29)
    played = play(workshop.scene(), gait(5, 0.28, rise=0.17), profile)
    assert played.realised.root[-1, 1] == pytest.approx(0.93 + 5 * 0.17, abs=0.01)
    assert np.diff(played.realised.root[:, 1]).max() * FPS < 1.0


def test_climbing_where_no_stairs_are_lifts_nobody(workshop, play, gait):
    workshop.floor()
    played = play(workshop.scene(), gait(5, 0.28, rise=0.17))
    assert played.realised.root[:, 1].max() < STANDING_HEIGHT + 0.01


def test_a_step_into_the_air_falls_at_g(workshop, play, glide):
    workshop.box("floor", (2, 3, 2), (0, -3, 0))
    height = play(workshop.scene(), glide((0.0, 3.0), 30)).realised.root[18:, 1]
    assert height[-1] < 0.5
    assert np.diff(height, 2) * FPS**2 == pytest.approx(-9.81, rel=0.02)


def test_a_pushed_box_moves(workshop, play, gait):
    workshop.floor()
    box = workshop.box("box", (0.4, 0.4, 0.4), (0, 0, 0.7), movable=True, mass=5.0)
    played = play(workshop.scene(), gait(4, 0.3))
    assert played.objects[box][2] > 0.9
    assert all(contact.movable for contact in played.touched(box))


def test_a_fixed_box_does_not_move_and_stops_the_body(workshop, play, gait):
    workshop.floor()
    box = workshop.box("table", (0.4, 0.4, 0.4), (0, 0, 0.7))
    played = play(workshop.scene(), gait(4, 0.3))
    assert box not in played.objects
    assert played.realised.root[-1, 2] < 0.7 < played.commanded.root[-1, 2]


def test_a_push_that_is_handed_on_is_reported(workshop, play, glide):
    workshop.floor()
    near = workshop.box("box", (0.3, 0.3, 0.3), (0, 0, 0.5), movable=True, mass=2.0)
    far = workshop.box("box", (0.3, 0.3, 0.3), (0, 0, 0.85), movable=True, mass=2.0)
    played = play(workshop.scene(), glide((0.0, 0.8), 30))
    assert not played.touched(far)
    assert (near, far) in {touch[1:] for touch in played.touches}
    assert played.objects[far][2] > 0.9


def test_only_objects_that_moved_have_a_path(workshop, glide):
    workshop.floor()
    near = workshop.box("box", (0.3, 0.3, 0.3), (0, 0, 0.4), movable=True, mass=2.0)
    workshop.box("box", (0.3, 0.3, 0.3), (3, 0, 3), movable=True, mass=2.0)
    simulator, scene = HalfPhysics(), workshop.scene()
    simulator.reset(scene, scene.start)
    assert simulator.execute(rest_pose(15)).objects == {}
    assert {key: path.shape for key, path in simulator.execute(glide((0.0, 0.8))).objects.items()} == {near: (15, 7)}


@pytest.mark.parametrize("seat", [0.38, 0.42, 0.46, 0.5])
def test_sitting_down_ends_with_the_pelvis_on_the_seat_and_upright(workshop, play, sitting_down, seat):
    """Also where the seat is higher than the knees: thighs that slope give way to it."""
    workshop.floor()
    couch = workshop.box("couch", (1.6, seat, 0.8), (0, 0, -0.65))
    played = play(workshop.scene(), sitting_down(seat + 0.12, -0.45))
    assert "pelvis" in {contact.joint for contact in played.contacts[-40:] if contact.object_id == couch}
    assert played.realised.root[-1, 1] == pytest.approx(seat + 0.14, abs=0.02)
    assert uprightness(played.realised).min() > 0.99
    assert np.abs(np.diff(played.realised.root[-15:], axis=0)).max() < 0.001


def test_who_sat_on_a_high_seat_stands_up_on_straight_legs(workshop, play, sitting_down, glide):
    workshop.floor()
    workshop.box("couch", (1.6, 0.5, 0.8), (0, 0, -0.65))
    down = sitting_down(0.62, -0.45)
    forward = glide((0.0, 0.6), 30)
    up = Motion(forward.root + [0, 0, down.root[-1, 2]], forward.rotations)
    realised = play(workshop.scene(), down.then(up)).realised
    assert realised.root[-1, 1] == pytest.approx(STANDING_HEIGHT, abs=0.01)
    assert np.abs(realised.rotations[-1, [1, 2]]).max() < 0.01


def test_a_toe_that_catches_an_edge_is_lifted_over_it_and_over_no_more(workshop, play, glide):
    """Soles drag along the floor at 0.6 m/s into a board of 3 cm, and into one of 6 cm."""
    ends = []
    for height in (0.03, 0.06):
        shop = type(workshop)()
        shop.floor()
        shop.box("board", (2, height, 2), (0, 0, 1.4))
        ends.append(play(shop.scene(), glide((0.0, 0.6), 30)).realised.root[-1])
    assert ends[0] == pytest.approx([0, STANDING_HEIGHT + 0.03, 0.6], abs=0.05)
    assert ends[1][1] == pytest.approx(STANDING_HEIGHT, abs=0.01)
    assert ends[1][2] < 0.25


@pytest.mark.parametrize("profile", PROFILES)
def test_a_kick_does_not_enter_a_wall(workshop, play, profile):
    """A straight leg swung from the hip at 12 m/s."""
    workshop.floor()
    wall = workshop.box("wall", (6, 2.5, 0.2), (0, 0, 0.55))
    command = rest_pose(15)
    command.rotations[:, JOINT_INDEX["right_hip"], 0] = -1.4 * np.sin(np.arange(15) / 15 * 4 * np.pi)
    depths = [contact.depth for contact in play(workshop.scene(), command, profile).touched(wall)]
    assert depths
    assert max(depths) < 0.015


def test_lifted_feet_let_the_body_down_as_gravity_would_and_no_bounce_follows(workshop, play):
    workshop.floor()
    command = rest_pose(45)
    for side in ("left", "right"):
        command.rotations[:, JOINT_INDEX[f"{side}_hip"], 0] = -1.7
    height = play(workshop.scene(), command).realised.root[:, 1]
    assert 0.13 < height[-1] < 0.17
    assert -np.diff(height).min() * FPS < np.sqrt(2 * 9.81 * STANDING_HEIGHT)
    assert np.diff(height[20:]).max() * FPS < 0.1


def test_straightening_the_legs_at_once_lifts_the_body_and_does_not_launch_it(workshop, play, sitting_down):
    workshop.floor()
    down = sitting_down(0.6, -0.2)
    up = Motion(np.repeat(down.root[:1], 30, 0), rest_pose(30).rotations)
    height = play(workshop.scene(), down.then(up)).realised.root[:, 1]
    assert height[75:].max() < STANDING_HEIGHT + 0.05


@pytest.mark.parametrize("seed", range(3))
def test_walking_anywhere_in_a_closed_room_never_leaves_it_and_ends_on_both_feet(workshop, gait, seed):
    workshop.floor()
    workshop.box("couch", (1.6, 0.45, 0.8), (0, 0, -1.0))
    for size, x, z in (((4, 2.5, 0.2), 0, 2), ((4, 2.5, 0.2), 0, -2), ((0.2, 2.5, 4), 2, 0), ((0.2, 2.5, 4), -2, 0)):
        workshop.box("wall", size, (x, 0, z))
    simulator, scene, random = HalfPhysics(), workshop.scene(), np.random.default_rng(seed)
    here = simulator.reset(scene, scene.start).body
    for _ in range(10):
        walk = Pose2D(0, 0, random.uniform(-np.pi, np.pi)).to_world(gait(3, 0.4))
        for first in range(0, len(walk), 15):
            gap = (here.root[-1] - walk.root[max(first - 1, 0)]) * [1, 0, 1]
            here = simulator.execute(
                Motion(walk.root[first : first + 15] + gap, walk.rotations[first : first + 15])
            ).realised
            assert np.abs(here.joints()[..., [0, 2]]).max() < 1.95
            assert 0.4 < here.root[:, 1].min() < here.root[:, 1].max() < 1.6
    for _ in range(4):
        here = simulator.execute(Motion(here.root[-1:].repeat(15, axis=0), rest_pose(15).rotations)).realised
    assert here.root[-1, 1] == pytest.approx(STANDING_HEIGHT, abs=0.02)


def test_the_same_commands_have_the_same_outcome_bit_for_bit(workshop, play, gait):
    workshop.floor()
    workshop.box("box", (0.4, 0.4, 0.4), (0, 0, 0.7), movable=True, mass=5.0)
    first, second = (play(workshop.scene(), gait(3, 0.3)) for _ in range(2))
    assert np.array_equal(first.realised.root, second.realised.root)
    assert np.array_equal(first.realised.rotations, second.realised.rotations)
    assert first.contacts == second.contacts


def test_contacts_say_who_touched_what_when_and_where(workshop, glide):
    workshop.floor()
    wall = workshop.box("wall", (6, 2.5, 0.2), (0, 0, 0.4))
    simulator, scene = HalfPhysics(), workshop.scene()
    simulator.reset(scene, scene.start)
    contacts = simulator.execute(glide((0.0, 1.0))).contacts
    assert {frame for contact in contacts for frame in contact.frames} <= set(range(15))
    assert {contact.group for contact in contacts} <= set(BODY_GROUPS)
    feet = [contact for contact in contacts if contact.object_id == 1]
    assert {contact.joint for contact in feet} == {"left_ankle", "right_ankle", "left_foot", "right_foot"}
    assert all(abs(contact.height) < 0.01 for contact in feet)
    assert min(contact.frames[0] for contact in contacts if contact.object_id == wall) == pytest.approx(3, abs=3)


def test_a_start_inside_something_is_refused_with_a_remedy(workshop):
    workshop.floor()
    workshop.box("table", (1, 0.8, 1), (2, 0, 0))
    with pytest.raises(SceneError, match=r"does not fit .* inside table 2") as raised:
        HalfPhysics().reset(workshop.scene(), Pose2D(2.0, 0.0, 0.0))
    assert raised.value.remedy


def test_a_start_without_a_floor_is_refused_with_a_remedy(workshop):
    workshop.floor()
    with pytest.raises(SceneError, match="does not stay on its start") as raised:
        HalfPhysics().reset(workshop.scene(), Pose2D(0.0, 0.0, 0.0, floor=1.0))
    assert raised.value.remedy


def test_a_start_may_lie_on_an_upper_floor_and_face_anywhere(workshop):
    workshop.floor(y=2.9)
    state = HalfPhysics().reset(workshop.scene(), Pose2D(1.0, -2.0, 1.5, floor=2.9))
    assert state.body.root[0] == pytest.approx([1.0, 2.9 + STANDING_HEIGHT, -2.0], abs=0.005)
    assert state.body.yaw()[0] == pytest.approx(1.5, abs=0.001)


def test_numbers_that_are_not_finite_are_refused_and_change_nothing(workshop):
    workshop.floor()
    simulator, scene = HalfPhysics(), workshop.scene()
    before = simulator.reset(scene, scene.start).body.root
    broken = rest_pose(15)
    broken.root[3, 1] = np.nan
    with pytest.raises(HumanclawError, match="finite"):
        simulator.execute(broken)
    assert np.array_equal(simulator.state().body.root, before)


def test_an_unknown_profile_is_refused_with_the_known_ones():
    with pytest.raises(HumanclawError, match="default, paper, reference"):
        HalfPhysics("papper")


def test_a_simulator_without_a_scene_says_so():
    with pytest.raises(HumanclawError, match="reset"):
        HalfPhysics().execute(rest_pose(15))
