"""Pictures agree with the world: colours, distances and ids."""

import tracemalloc

import numpy as np
import pytest
from scipy import ndimage

from humanclaw import HumanclawError
from humanclaw.body import JOINT_INDEX, Pose2D, matrix_from_quaternion, rest_pose, skin
from humanclaw.world import BODY_ID, Camera, Mesh, WorldState, ego_camera, person_id
from humanclaw_raster.packing import pack
from humanclaw_raster.painting import BRIGHTNESS
from humanclaw_raster.renderer import RasterRenderer

STANDING = WorldState(rest_pose(), {})
AWAY = rest_pose()
AWAY.root[:, 0] += 500.0
RED, BLUE = (220, 40, 40), (40, 40, 220)


def mesh(vertices, faces, texture, uv=None):
    uv = np.full((len(vertices), 2), 0.5) if uv is None else uv
    return Mesh(np.array(vertices, np.float32), np.array(faces, np.int32), np.array(uv, np.float32), texture)


def picture_of(texture, size=1.0):
    """Return an upright square with a texture, facing +Z, its centre at the origin."""
    corners = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], float)
    vertices = np.concatenate([(corners - 0.5) * size, np.zeros((4, 1))], axis=1)
    return mesh(vertices, [[0, 1, 2], [0, 2, 3]], texture, corners)


# -- where objects appear ----------------------------------------------------------------------------------------------
def test_a_box_of_half_a_metre_at_two_metres_covers_64_by_64_pixels(builder, camera):
    box = builder.box((0.5, 0.5, 0.5), (0, 0.75, 2.25))
    view = builder.look(camera((0, 1, 0), (0, 0, 1), 512))
    rows, columns = np.nonzero(view.ids == box)
    # The focal length is 256 pixels: 0.5 m at 2 m are 64 pixels, and the box is in the middle.
    assert (rows.min(), rows.max(), columns.min(), columns.max()) == (224, 287, 224, 287)
    assert len(rows) == 64 * 64
    assert view.depth[256, 256] == pytest.approx(2.0, abs=1e-5)


@pytest.mark.parametrize("up", [(0, 0, 1), (0, 1, 0)])
def test_a_camera_that_looks_straight_down_sees_the_footprint(builder, camera, up):
    floor, table = builder.floor(), builder.box((2.0, 1.0, 1.0), (0, 0, 0))
    ids = builder.look(camera((0, 5, 0), (0, -1, 0), 512, up=up)).ids
    # The top is 4 m away: 64 pixels to the metre. Up in the picture is +Z, and so +X is to the left.
    assert (ids == table).sum() == 128 * 64
    assert (ids[224:288, 192:320] == table).all()
    assert ids[0, 0] == floor


def test_wide_pictures_have_square_pixels(builder):
    box = builder.box((0.5, 0.5, 0.5), (0, 0.75, 2.25))
    eye = Camera(np.array([0.0, 1, 0]), np.array([0.0, 0, 1]), np.array([0.0, 1, 0]), 90.0, 640, 256)
    rows, columns = np.nonzero(builder.look(eye).ids == box)
    assert (np.ptp(rows) + 1, np.ptp(columns) + 1) == (32, 32)


def test_a_floor_that_goes_on_behind_the_eyes_is_drawn_to_the_edge(builder, camera):
    floor = builder.floor()
    view = builder.look(camera((0, 0.3, 0), (0, 0, 1)))
    assert (view.ids[67:] == floor).all()
    assert (view.ids[:63] == 0).all()
    # In the middle of the last row the line of sight falls 63.5 for every 64 forward.
    assert view.depth[127, 64] == pytest.approx(0.3 * 64 / 63.5, abs=1e-4)


def test_where_nothing_is_there_is_bright_sky_without_an_end(builder, camera):
    builder.floor()
    view = builder.look(camera((0, 5, 0), (0, 0.9, 1)))
    assert (view.ids[:32] == 0).all()
    assert np.isinf(view.depth[:32]).all()
    assert view.rgb[:32].min() > 150


def test_pixels_agree_with_rays_cast_at_random_triangles(builder, camera):
    """Test each pixel against every triangle by solving three equations: independent of the rasterizer's method."""
    random = np.random.default_rng(3)
    triangles = random.normal(size=(60, 1, 3)) * [2, 2, 1] + [0, 0, 4] + random.normal(size=(60, 3, 3))
    for corners in triangles:
        builder.mesh(mesh(corners, [[0, 1, 2]], np.full((2, 2, 3), 200, np.uint8)))
    view = builder.look(camera((0, 0, 0), (0, 0, 1), 64))
    middle = (np.arange(64) + 0.5 - 32) / 32
    rays = np.stack(np.broadcast_arrays(-middle[None, :], -middle[:, None], 1.0), -1).reshape(-1, 1, 3)
    sides = np.stack([triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]], -1)
    matrix = np.concatenate(
        [np.broadcast_to(rays[..., None], (4096, 60, 3, 1)), np.broadcast_to(-sides, (4096, 60, 3, 2))], -1
    )
    depth, b, c = np.moveaxis(
        np.linalg.solve(matrix, np.broadcast_to(triangles[:, 0, :, None], (4096, 60, 3, 1)))[..., 0], -1, 0
    )
    inside = np.minimum(np.minimum(b, c), 1 - b - c)
    clear = (np.abs(inside) > 1e-6).all(axis=1)
    depth = np.where((inside > 0) & (depth > 0.02), depth, np.inf)
    nearest = depth.min(axis=1)
    expected = np.where(np.isinf(nearest), 0, depth.argmin(axis=1) + 1)
    assert clear.mean() > 0.99
    assert len(set(expected)) > 30
    assert (view.ids.ravel() == expected)[clear].all()
    seen = clear & (expected > 0)
    assert view.depth.ravel()[seen] == pytest.approx(nearest[seen], rel=1e-4)


def test_a_surface_of_many_triangles_has_no_holes(builder, camera):
    """Triangles of about a pixel, at an angle: every pixel of the wall is covered by exactly one of them."""
    steps = np.linspace(-8, 8, 161)
    x, y = (grid.ravel() for grid in np.meshgrid(steps, steps))
    corner = (np.arange(160)[:, None] * 161 + np.arange(160)).ravel()
    faces = np.concatenate(
        [np.stack([corner, corner + 1, corner + 162], 1), np.stack([corner, corner + 162, corner + 161], 1)]
    )
    wall = builder.mesh(mesh(np.stack([x, y, 0.1 * x + 0.15 * y + 2], 1), faces, np.full((2, 2, 3), 200, np.uint8)))
    assert (builder.look(camera((0, 0, 0), (0.1, 0.05, 1))).ids == wall).all()


def test_a_wall_that_ends_level_with_the_floor_above_is_not_seen(builder, camera):
    builder.box((0.2, 2.72, 8), (0, 0, 0), category="wall")
    floor = builder.box((20, 0.12, 20), (0, 2.6, 0))
    assert (builder.look(camera((0.3, 4.2, -2), (0, -1, 0.5))).ids == floor).all()


@pytest.mark.parametrize(("rise", "apart"), [(0.2, 0.05), (1.7, 0.391), (2.0, 0.0)])
def test_normals_are_smooth_over_blunt_edges_alone(rise, apart):
    """Three triangles lie in one plane and meet a fourth in an edge: at 11 and 60 degrees they share a normal, at 63
    none. Each counts by its area: a narrow rounded edge leaves a large face flat."""
    points = [[0, 0, 0], [1, 0, 0], [1, 0, -1], [0, 0, -1], [-1, 0, -1], [0, rise, 1], [1, rise, 1]]
    faces = [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 5, 1]]
    texture = np.zeros((2, 2, 3), np.uint8)
    normals = pack([mesh(points, faces, texture)], [np.zeros(4, bool)], texture).normals
    assert np.abs(normals[0, 0] - normals[0, 2]).max() == pytest.approx(apart, abs=0.005)


# -- the body ----------------------------------------------------------------------------------------------------------
def test_from_outside_the_whole_body_is_seen(builder, camera):
    builder.floor()
    rows, _ = np.nonzero(builder.look(camera((0, 1, 8), (0, 0, -1), 512), STANDING).ids == BODY_ID)
    tall = (rows.max() - rows.min()) * 8 / 256
    assert tall == pytest.approx(1.72, abs=0.08)


def test_standing_eyes_see_no_part_of_their_own_head(builder):
    builder.floor()
    assert not (builder.look(ego_camera(STANDING.body), STANDING).ids == BODY_ID).any()


def test_eyes_that_look_down_see_their_own_feet(builder, camera):
    builder.floor()
    body = rest_pose()
    body.rotations[0, JOINT_INDEX["neck"]] = (0.6, 0.0, 0.0)
    view = builder.look(camera(ego_camera(body).position, (0, -1, 0.3)), WorldState(body, {}))
    assert (view.ids == BODY_ID).sum() > 100
    assert view.depth[view.ids == BODY_ID].max() > 1.2


def test_arms_held_out_are_in_the_picture(builder):
    builder.floor()
    body = rest_pose()
    for side, sign in (("left", 1), ("right", -1)):
        body.rotations[0, JOINT_INDEX[f"{side}_shoulder"]] = (0.0, -1.3 * sign, 0.0)
    view = builder.look(ego_camera(body), WorldState(body, {}))
    assert (view.ids == BODY_ID)[:, :256].sum() > 500
    assert (view.ids == BODY_ID)[:, 256:].sum() > 500


def test_the_head_comes_back_after_a_picture_from_inside_it(builder, camera):
    renderer = RasterRenderer()
    builder.floor()
    renderer.load(builder.scene())
    outside = camera((0, 1.6, 1), (0, 0, -1))
    before = renderer.render(STANDING, outside)
    renderer.render(STANDING, ego_camera(STANDING.body))
    assert np.array_equal(renderer.render(STANDING, outside).ids, before.ids)


# -- objects that move -------------------------------------------------------------------------------------------------
def test_movable_objects_are_drawn_where_the_state_says(builder):
    builder.floor()
    box = builder.box((0.3, 0.3, 0.3), (0, 0, 2), movable=True, mass=1.0)
    eye = ego_camera(STANDING.body)
    assert (builder.look(eye, STANDING).ids == box).any()
    away = WorldState(STANDING.body, {box: np.array([0.0, 0.0, -2.0, 0.0, 0.0, 0.0, 1.0])})
    assert not (builder.look(eye, away).ids == box).any()


def test_objects_turn_as_their_quaternion_says(builder, camera):
    plank = builder.box((2.0, 0.2, 0.2), (0, 1, 3), movable=True, mass=1.0)
    upright = np.array([0.0, 0.0, np.sin(np.pi / 4), np.cos(np.pi / 4)])
    assert matrix_from_quaternion(upright) @ [1, 0, 0] == pytest.approx([0, 1, 0])
    ids = builder.look(camera((0, 1, 0), (0, 0, 1)), WorldState(AWAY, {plank: np.array([0, 1, 3, *upright])})).ids
    rows, columns = np.nonzero(ids == plank)
    assert np.ptp(rows) > 5 * np.ptp(columns)


# -- colours -----------------------------------------------------------------------------------------------------------
def test_ids_match_the_colours_away_from_edges(builder, camera):
    builder.floor()
    red = [builder.box((0.3, 0.4, 0.3), (x, 0, 2 + x * x), RED) for x in (-1.0, 0.1, 1.2)]
    blue = [builder.box((0.1, 1.5, 0.1), (x, 0, 1.5), BLUE) for x in (-0.6, 0.0, 0.7)]
    view = builder.look(camera((0, 1.2, 0), (0, -0.4, 1), 256))
    r, b = view.rgb[..., 0].astype(int), view.rgb[..., 2].astype(int)
    inner = np.ones_like(view.ids, bool)
    for axis in (0, 1):
        for step in (-1, 1):
            inner &= np.roll(view.ids, step, axis) == view.ids
    assert inner.mean() > 0.9
    assert np.array_equal((r > 2 * b)[inner], np.isin(view.ids, red)[inner])
    assert np.array_equal((b > 2 * r)[inner], np.isin(view.ids, blue)[inner])


def test_textures_are_the_right_way_round(builder, camera):
    """A picture that is green at u = 0, and to the right of that red at v = 1 and blue at v = 0, seen from its
    front."""
    texture = np.zeros((64, 64, 3), np.uint8)
    texture[:32], texture[32:], texture[:, :16] = (255, 0, 0), (0, 0, 255), (0, 255, 0)
    builder.mesh(picture_of(texture), (0, 5, -1))
    brightest = np.argmax(builder.look(camera((0, 5, 0), (0, 0, -1))).rgb, axis=-1)
    # At distance 1 the picture spans pixels 32 to 96: u = 0.25 is at 48, v = 0.5 at 64.
    assert (brightest[33:95, 33:47] == 1).all()
    assert (brightest[33:63, 49:95] == 0).all()
    assert (brightest[65:95, 49:95] == 2).all()


def test_textures_repeat_outside_of_their_square(builder, camera):
    texture = np.zeros((2, 64, 3), np.uint8)
    texture[:, :32], texture[:, 32:] = RED, BLUE
    square = picture_of(texture)
    builder.mesh(mesh(square.vertices, square.faces, texture, square.uv * [2, 1] - [1, 0]), (0, 5, -1))
    row = builder.look(camera((0, 5, 0), (0, 0, -1))).rgb[64].astype(int)
    # 64 pixels from 32 on show red, blue, red, blue.
    assert ((row[:, 0] > row[:, 2])[[40, 72]]).all()
    assert ((row[:, 2] > row[:, 0])[[56, 88]]).all()


def test_a_fine_pattern_far_away_becomes_its_mean_instead_of_noise(builder, camera):
    texture = np.zeros((256, 256, 3), np.uint8)
    texture[(np.indices((256, 256)).sum(0) % 2).astype(bool)] = 255
    wall = builder.mesh(picture_of(texture, 2.0), (0, 5, -8))
    view = builder.look(camera((0, 5, 0), (0, 0, -1), 256))
    assert view.rgb[view.ids == wall].std() < 3


def test_the_four_walls_of_a_room_differ_in_brightness(builder, camera):
    for size, x, z in [((8, 4, 0.2), 0, 3), ((8, 4, 0.2), 0, -3), ((0.2, 4, 8), 3, 0), ((0.2, 4, 8), -3, 0)]:
        builder.box(size, (x, 0, z))
    views = [builder.look(camera((0.5, 2, 0.5), (x, 0, z))) for x, z in ((0, 3), (0, -3), (3, 0), (-3, 0))]
    assert np.diff(sorted(view.rgb[64, 64].mean() for view in views)).min() > 5


def test_corners_are_darker_than_open_floor(builder, camera):
    floor = builder.floor()
    builder.box((20, 3, 0.2), (0, 0, 4))
    view = builder.look(camera((0, 1.5, 0), (0, -0.6, 1), 256))
    column = view.rgb[:, 128, 0][view.ids[:, 128] == floor].astype(int)
    # Its first row lies at the wall, the last before the feet.
    assert column[2] < 0.96 * column[-20]


def test_a_table_throws_a_soft_shadow_on_the_floor_below_it(builder, camera):
    floor = builder.floor()
    builder.box((2.0, 0.05, 2.0), (0, 1.0, 3))
    view = builder.look(camera((0, 0.8, 0), (0, -0.4, 1), 256))
    below, ahead = (_row_of_floor(distance, eye=0.8, slope=-0.4, size=256) for distance in (3.0, 1.0))
    assert (view.ids[[below, ahead], 128] == floor).all()
    assert view.rgb[below, 128, 0] < 0.75 * view.rgb[ahead, 128, 0]


def test_a_ceiling_and_walls_throw_no_shadow(builder, camera):
    builder.floor()
    eye = camera((0, 1.5, 0), (0, -1, 0.2), 64)
    before = builder.look(eye).rgb
    builder.box((20, 0.1, 20), (0, 2.5, 0))
    assert np.array_equal(builder.look(eye).rgb, before)


def test_the_shadow_of_an_object_goes_where_it_goes(builder, camera):
    builder.floor()
    box = builder.box((0.4, 0.4, 0.4), (0, 0.3, 2.0), movable=True, mass=1.0)
    eye = camera((0, 1.5, 0), (0, -0.8, 1), 128)
    here = builder.look(eye, WorldState(AWAY, {})).rgb
    gone = builder.look(eye, WorldState(AWAY, {box: np.array([0.0, 50.0, 0, 0, 0, 0, 1])})).rgb
    row = _row_of_floor(1.7, eye=1.5, slope=-0.8, size=128)
    assert here[row, 64, 0] < 0.95 * gone[row, 64, 0]


@pytest.mark.parametrize(
    "seen", [STANDING, WorldState(AWAY, {}, people={person_id(1): STANDING.body})], ids=["the body", "another"]
)
def test_a_body_throws_a_shadow_where_it_is_seen_from_outside(builder, camera, seen):
    floor = builder.floor()
    eye = camera((0.0, 1.5, 2.5), (0, -0.5, -1), 256)
    here, gone = builder.look(eye, seen), builder.look(eye)
    shaded = ndimage.binary_erosion((here.ids == floor) & (gone.ids == floor), iterations=3)
    shares = here.rgb[shaded].astype(float).mean(-1) / gone.rgb[shaded].mean(-1)
    assert shares.min() < 0.75
    assert (shares > 0.97).mean() > 0.8, "only around its feet"


def test_a_box_shades_the_side_that_is_turned_away_from_the_light(builder, camera):
    builder.floor()
    builder.box((0.8, 0.8, 0.8), (0, 0, 0))
    row = builder.look(camera((0, 3, 0), (0, -1, 0), up=(0, 0, 1))).rgb[64, :, 0]
    away = round(0.65 / 3 * 64)  # 65 cm from the middle of the box, 25 cm from its side; +X is on the left
    assert row[64 + away] < 0.8 * row[63 - away]


@pytest.mark.parametrize(("gap", "remains"), [(0.5, 0.915), (1.1, 1.0)])
def test_a_wall_is_darker_beside_what_stands_near_before_it(builder, camera, gap, remains):
    wall = builder.box((20, 20, 0.2), (0, -10, 5.1))
    builder.box((20, 20, 0.2), (10, -10, 5.1 - gap))
    view = builder.look(camera((0, 0, 0), (0, 0, 1), 512))
    light, edge = BRIGHTNESS[view.rgb[256, :, 0]], int(np.flatnonzero(view.ids[256] == wall)[0])
    # Its neighbour 5 m away and 4.5 m away in three of four pairs: 4 * (5 / 4.5 - 1) / 2 * (1 - 0.5) * 3 / 4 = 8.3 %.
    assert light[edge + 2] / light[edge + 40] == pytest.approx(remains, abs=0.02)
    assert light[edge - 3] == pytest.approx(light[edge - 40], abs=0.01)


def test_it_is_as_dark_at_the_border_of_the_picture(builder, camera):
    wall = builder.box((20, 20, 0.2), (0, -10, 5.1))
    builder.box((20, 20, 0.2), (10, -10, 4.6))
    view = builder.look(camera((0, 0, 0), (0, 0, 1), 512))
    beside = view.rgb[:, int(np.flatnonzero(view.ids[256] == wall)[0]) + 2, 0].astype(int)
    assert np.abs(beside - beside[256]).max() <= 2


def test_the_own_hands_darken_nothing(builder):
    builder.box((20, 20, 0.2), (0, -10, 1.1))
    body = rest_pose()
    body.rotations[0, JOINT_INDEX["left_shoulder"]] = (0, -np.pi / 2, 0)
    eye = ego_camera(body)
    with_hand, without = builder.look(eye, WorldState(body, {})), builder.look(eye, WorldState(AWAY, {}))
    others = ndimage.binary_erosion(with_hand.ids != BODY_ID, iterations=3)  # Edges are smoothed.
    assert (with_hand.ids == BODY_ID).mean() > 0.01
    assert np.abs(with_hand.rgb.astype(int) - without.rgb)[others].max() <= 2


def test_a_flat_wall_does_not_shade_itself(builder, camera):
    builder.box((80, 80, 0.2), (0, -40, 5.1))
    for eye, forward in (((0, 1, 0), (0, 0, 1)), ((0, 1, 0), (0.5, 0.2, 1)), ((0, 1, 4.7), (1, 0, 1.1))):
        assert np.ptp(builder.look(camera(eye, forward)).rgb[..., 0]) <= 2


# -- the renderer as a whole -------------------------------------------------------------------------------------------
def test_the_same_moment_gives_the_same_bytes(builder, camera):
    builder.floor()
    box = builder.box((0.3, 0.3, 0.3), (0, 0, 2), movable=True, mass=1.0)
    renderer, eye = RasterRenderer(), ego_camera(STANDING.body)
    renderer.load(builder.scene())
    first = renderer.render(STANDING, eye)
    renderer.render(WorldState(rest_pose(), {box: np.array([1.0, 0, 1, 0, 1, 0, 0])}), camera((0, 3, -3), (0, -1, 1)))
    for second in (renderer.render(STANDING, eye), builder.look(eye, STANDING)):
        assert all(
            getattr(first, part).tobytes() == getattr(second, part).tobytes() for part in ("rgb", "depth", "ids")
        )


def test_a_renderer_can_load_one_scene_after_another(builder):
    renderer = RasterRenderer()
    for count in (1, 2):
        obj = builder.box((0.3, 0.3, 0.3), (0, 1, 1.5 * count))
        renderer.load(builder.scene())
        assert (renderer.render(STANDING, ego_camera(STANDING.body)).ids == 1).any()
    renderer.close()
    assert obj == 2


def test_a_renderer_never_holds_two_scenes_and_none_once_it_is_closed(builder):
    """Packing a second scene has no higher peak memory than the first, whose texture alone takes 12 MB."""
    corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
    builder.mesh(mesh(corners, [[0, 1, 2]], np.zeros((2048, 2048, 3), np.uint8)))
    renderer, heights = RasterRenderer(), []
    tracemalloc.start()
    for _ in range(2):
        tracemalloc.reset_peak()
        renderer.load(builder.scene())
        heights.append(tracemalloc.get_traced_memory()[1])
    renderer.close()
    left = tracemalloc.get_traced_memory()[0]
    tracemalloc.stop()
    assert heights[1] < heights[0] + 2**20
    assert left < 2**20


def test_a_scene_with_nothing_in_it_is_sky(builder, camera):
    assert (builder.look(camera((0, 1, 5), (0, 0, 1))).ids == 0).all()


def test_a_renderer_without_a_scene_says_so():
    with pytest.raises(HumanclawError, match="load"):
        RasterRenderer().render(STANDING, ego_camera(STANDING.body))


def _row_of_floor(distance, eye, slope, size):
    """Return the row in which a camera at a height, looking along (0, slope, 1), sees the floor at a distance."""
    forward, up = np.array([slope, 1.0]) / np.hypot(slope, 1), np.array([1.0, -slope]) / np.hypot(slope, 1)
    point = np.array([-eye, distance])
    return int(size / 2 - size / 2 * (point @ up) / (point @ forward))


# -- edges -------------------------------------------------------------------------------------------------------------
@pytest.mark.integration
def test_an_edge_pixel_has_as_much_of_each_colour_as_the_edge_leaves(builder, camera):
    """A box 0.75 m away and 0.315 m wide before a black wall: its sides fall into the middle of two pixels."""
    builder.box((8, 8, 0.2), (0, -3, 3.1), (0, 0, 0))
    builder.box((0.315, 8, 0.2), (0, -3, 0.85), (200, 200, 200))
    row = builder.look(camera((0, 1, 0), (0, 0, 1))).rgb[40, :, 0].astype(int)
    # The focal length is 64 pixels, so that half the width is 13.44 pixels: 0.44 of a pixel.
    edge = [value for value in row if 0.2 * row[64] < value < 0.8 * row[64]]
    assert edge == pytest.approx([0.44 * row[64]] * 2, rel=0.03)


def test_other_people_are_drawn_where_they_stand_under_their_own_ids(builder, camera):
    builder.floor()
    there = [Pose2D(x, 3.0, np.pi).to_world(rest_pose()) for x in (0.8, -0.8)]
    people = WorldState(STANDING.body, {}, people={person_id(1): there[0], person_id(2): there[1]})
    view = builder.look(camera((0, 1.6, 0), (0, -0.2, 1), 256), people)
    left, right = (np.nonzero(view.ids == person_id(number))[1] for number in (1, 2))
    assert min(len(left), len(right)) > 500
    assert left.max() < 128 < right.min()  # +X is on the left of who looks along +Z.
    assert view.depth[view.ids == person_id(1)].min() == pytest.approx(2.8, abs=0.3)


def test_a_thing_of_the_looks_of_a_person_is_drawn_as_the_body(builder, camera):
    builder.floor()
    looks, root, eye = skin(), STANDING.body.root[-1], camera((0, 1.2, 0.9), (0, -0.2, -1), 512)
    body = builder.look(eye, STANDING)
    vertices, normals = looks.posed(np.zeros(3), STANDING.body.rotations[-1])
    builder.mesh(Mesh(vertices, looks.faces, looks.uv, looks.colours[None], normals), tuple(root.tolist()), "person")
    assert (body.ids == BODY_ID).mean() > 0.1
    assert np.array_equal(builder.look(eye).rgb, body.rgb)


def test_a_picture_without_others_is_as_before_they_came(builder, camera):
    builder.floor()
    renderer, eye = RasterRenderer(), camera((0, 1.6, 0), (0, -0.2, 1))
    renderer.load(builder.scene())
    before = renderer.render(STANDING, eye).rgb.copy()
    other = Pose2D(0.0, 2.0, np.pi).to_world(rest_pose())
    met = renderer.render(WorldState(STANDING.body, {}, people={person_id(1): other}), eye).rgb
    assert not np.array_equal(met, before)
    assert np.array_equal(renderer.render(STANDING, eye).rgb, before)
