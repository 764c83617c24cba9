"""What the eyes are told: colours, distances and ids agree with the world."""

import numpy as np
import pytest

from humanclaw.body import JOINT_INDEX
from humanclaw.errors import HumanclawError
from humanclaw.interfaces import BODY_ID, Camera, WorldState, ego_camera
from humanclaw.pose import rest_pose
from humanclaw.scene import Mesh
from humanclaw_bullet.renderer import BulletRenderer

STANDING = WorldState(rest_pose(), {})


def camera(position, forward, size=128):
    return Camera(np.array(position, float), np.array(forward, float), np.array([0.0, 1.0, 0.0]), 90.0, size, size)


@pytest.fixture
def look():
    def at(scene, lens, state=STANDING):
        renderer = BulletRenderer()
        renderer.load(scene)
        view = renderer.render(state, lens)
        renderer.close()
        return view

    return at


def test_depth_is_measured_in_metres_along_the_optical_axis(workshop, look):
    wall = workshop.box("wall", (40, 40, 0.2), (0, -20, 5.1))
    view = look(workshop.scene(), camera((3, 1, 0), (0, 0, 1)))
    assert (view.ids == wall).all()
    assert view.depth == pytest.approx(np.full((128, 128), 5.0), abs=0.005)


def test_a_thing_is_drawn_where_a_pinhole_would_see_it(workshop, look):
    box = workshop.box("box", (0.2, 0.2, 0.2), (1.0, 1.4, 2.0))
    rows, columns = np.nonzero(look(workshop.scene(), camera((0, 1, 0), (0, 0, 1), 512)).ids == box)
    # Left is +X, so the box is left of the middle: at depth 2 the middle of it is 256 * 1.0 / 2 pixels to the left.
    assert columns.mean() == pytest.approx(256 - 256 * 1.0 / 2, abs=6)
    assert rows.mean() == pytest.approx(256 - 256 * 0.5 / 2, abs=4)


def test_where_nothing_is_the_id_is_zero_and_the_sky_is_bright(workshop, look):
    workshop.floor()
    view = look(workshop.scene(), camera((0, 5, 0), (0, 0.9, 1)))
    assert (view.ids[:32] == 0).all()
    assert view.rgb[:32].min() > 150


def test_pictures_have_the_promised_types(workshop, look):
    workshop.floor()
    view = look(workshop.scene(), ego_camera(STANDING.body))
    assert (view.rgb.shape, view.rgb.dtype) == ((512, 512, 3), np.uint8)
    assert (view.depth.shape, view.depth.dtype) == ((512, 512), np.float32)
    assert (view.ids.shape, view.ids.dtype) == ((512, 512), np.int32)


def test_from_outside_the_whole_body_is_seen(workshop, look):
    workshop.floor()
    rows, _ = np.nonzero(look(workshop.scene(), camera((0, 1, 8), (0, 0, -1), 512)).ids == BODY_ID)
    tall = (rows.max() - rows.min()) * 8 / 256
    assert tall == pytest.approx(1.72, abs=0.08)


def test_standing_eyes_see_no_part_of_their_own_head(workshop, look):
    workshop.floor()
    assert not (look(workshop.scene(), ego_camera(STANDING.body)).ids == BODY_ID).any()


def test_eyes_that_look_down_see_their_own_feet(workshop, look):
    workshop.floor()
    eye = ego_camera(STANDING.body).position
    view = look(workshop.scene(), camera(eye, (0, -1, 0.3)))
    assert (view.ids == BODY_ID).sum() > 100
    assert view.depth[view.ids == BODY_ID].max() > 1.2


def test_arms_held_out_are_in_the_picture(workshop, look):
    workshop.floor()
    body = rest_pose()
    for side, sign in (("left", 1), ("right", -1)):
        body.rotations[0, JOINT_INDEX[f"{side}_shoulder"]] = (0.0, -1.3 * sign, 0.0)
    view = look(workshop.scene(), ego_camera(body), WorldState(body, {}))
    assert (view.ids == BODY_ID)[:, :256].sum() > 500
    assert (view.ids == BODY_ID)[:, 256:].sum() > 500


def test_movable_things_are_drawn_where_the_state_says(workshop, look):
    workshop.floor()
    box = workshop.box("box", (0.3, 0.3, 0.3), (0, 0, 2), movable=True, mass=1.0)
    lens = ego_camera(STANDING.body)
    assert (look(workshop.scene(), lens).ids == box).any()
    away = WorldState(STANDING.body, {box: np.array([0.0, 0.0, -2.0, 0.0, 0.0, 0.0, 1.0])})
    assert not (look(workshop.scene(), lens, away).ids == box).any()


def test_textures_are_the_right_way_round(workshop, look):
    """A picture that is green at u = 0, and to the right of that red at v = 1 and blue at v = 0, seen from its front."""
    texture = np.zeros((64, 64, 3), np.uint8)
    texture[:32], texture[32:], texture[:, :16] = (255, 0, 0), (0, 0, 255), (0, 255, 0)
    corners = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32)
    vertices = np.concatenate([corners - [0.5, 0.5], np.zeros((4, 1))], axis=1).astype(np.float32)
    mesh = Mesh(vertices, np.array([[0, 1, 2], [0, 2, 3]], np.int32), corners, texture)
    workshop.mesh("tv", mesh, (0, 5, -1))
    rgb = look(workshop.scene(), camera((0, 5, 0), (0, 0, -1))).rgb
    # At distance 1 the picture spans the middle half of the view: pixels 32 to 96.
    brightest = np.argmax(rgb, axis=-1)
    assert (brightest[40:88, 36:46] == 1).all()
    assert (brightest[40:60, 54:90] == 0).all()
    assert (brightest[68:88, 54:90] == 2).all()


def test_the_four_walls_of_a_room_differ_in_brightness(workshop, look):
    walls = [((8, 4, 0.2), 0, 3), ((8, 4, 0.2), 0, -3), ((0.2, 4, 8), 3, 0), ((0.2, 4, 8), -3, 0)]
    for size, x, z in walls:
        workshop.box("wall", size, (x, 0, z))
    scene = workshop.scene()
    tones = [look(scene, camera((0.5, 2, 0.5), (x, 0, z))).rgb[64, 64].mean() for _, x, z in walls]
    assert np.diff(sorted(tones)).min() > 5


def test_the_same_moment_gives_the_same_picture(workshop, look):
    workshop.floor()
    workshop.box("box", (0.3, 0.3, 0.3), (0, 0, 2))
    first, second = (look(workshop.scene(), ego_camera(STANDING.body)) for _ in range(2))
    assert all(np.array_equal(getattr(first, part), getattr(second, part)) for part in ("rgb", "depth", "ids"))


def test_a_renderer_can_load_one_scene_after_another(workshop):
    workshop.floor()
    renderer, scene = BulletRenderer(), workshop.scene()
    for _ in range(2):
        renderer.load(scene)
        assert (renderer.render(STANDING, ego_camera(STANDING.body)).ids == 1).any()
    renderer.close()


def test_a_renderer_without_a_scene_says_so():
    with pytest.raises(HumanclawError, match="load"):
        BulletRenderer().render(STANDING, ego_camera(STANDING.body))
