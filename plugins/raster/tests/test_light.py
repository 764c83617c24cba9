"""Light from windows and lamps."""

from __future__ import annotations

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest

from humanclaw.body import rest_pose
from humanclaw.world import Room, WorldState
from humanclaw_raster.baking import _filled
from humanclaw_raster.buffers import GBuffer
from humanclaw_raster.packing import PANE
from humanclaw_raster.painting import _light_near
from humanclaw_raster.renderer import RasterRenderer
from humanclaw_raster.surfaces import KIND, SURFACE

AWAY = rest_pose()
AWAY.root[:, 0] += 500.0


@pytest.fixture
def room(builder, monkeypatch, tmp_path):
    """A closed room of 6 x 6 x 2.6 m, and its cache."""
    monkeypatch.setenv("HUMANCLAW_CACHE", str(tmp_path))
    for y in (-0.2, 2.6):
        builder.box((6.4, 0.2, 6.4), (0, y, 0))
    for middle in (-3.1, 3.1):
        builder.box((6.4, 2.6, 0.2), (0, 0, middle))
        builder.box((0.2, 2.6, 6.4), (middle, 0, 0))
    return builder


def _floor(room, camera, z):
    return room.look(camera((0, 1.5, z), (0, -1, 0), 64, up=(0, 0, 1))).rgb[32, 32].mean()


def test_the_floor_near_a_window_is_brighter(room, camera):
    room.box((1.5, 1.2, 0.04), (0, 1.0, -2.95), category="window")
    near, middle, far = (_floor(room, camera, z) for z in (-1.5, 0.0, 2.0))
    assert near > 1.1 * middle > 1.1 * far


@pytest.mark.parametrize(("grey", "seen"), [(60, 28), (120, 93), (180, 170), (240, 233)])
def test_dark_tones_are_darker_and_bright_ones_level_off_as_on_film(builder, camera, grey, seen):
    """Tops of a scene without lamps have brightness 1: with s = grey / 255 / 1.15 they show 255 s s (3 - 2 s)."""
    builder.box((20, 0.2, 20), (0, -0.2, 0), (grey, grey, grey))
    assert builder.look(camera((0, 1.5, 0), (0, -1, 0), 64, up=(0, 0, 1))).rgb[32, 32, 0] == pytest.approx(seen, abs=1)


def test_a_lamp_lights_what_is_near_it(room, camera):
    room.box((0.3, 0.1, 0.3), (0, 2.4, 2.0), category="ceiling_lamp")
    assert _floor(room, camera, 2.0) > 1.1 * _floor(room, camera, -2.0)


def test_a_wall_keeps_the_light_of_a_window_away(room, camera):
    room.box((1.5, 1.2, 0.04), (0, 1.0, -2.95), category="window")
    before = _floor(room, camera, 2.0) / _floor(room, camera, -1.5)
    room.box((6.0, 2.6, 0.3), (0, 0, 0))
    assert _floor(room, camera, 2.0) / _floor(room, camera, -1.5) < 0.8 * before


def test_a_wall_behind_a_bed_does_not_show_the_dark_of_the_next_room():
    """Probes along x: bed, gap, wall, next room. Beside the bed there is light."""
    light = np.full((1, 3, 4, 6), np.nan)
    light[..., :2, :], light[..., 3, :] = 0.9, 0.1
    light[0, 1, :2] = np.nan
    filled = _filled(light)
    assert filled[0, 1, 2, 1] == pytest.approx(0.9)
    assert filled[0, 1, 2, 0] == pytest.approx(0.1)


def test_the_sky_in_a_window_is_far_away(room, camera):
    pane = room.box((3.0, 2.0, 0.04), (0, 0.3, -2.95), category="window")
    left, right = (room.look(camera((x, 1.3, 1.0), (0, 0, -1), 256)) for x in (-0.3, 0.3))
    both = (left.ids == pane) & (right.ids == pane)
    assert both.mean() > 0.05
    assert np.median(np.abs(left.rgb[both].astype(int) - right.rgb[both])) <= 1  # Edges are mixed with the frame.
    assert left.rgb[both].std() > 10  # It is a view, not one colour.


def test_a_window_takes_no_light_from_its_frame(room, camera):
    room.box((1.5, 1.2, 0.04), (0, 1.0, -2.95), category="window")
    frame = room.box((0.1, 1.2, 0.14), (0.8, 1.0, -2.9))
    view = room.look(camera((0, 1.6, -2.0), (0.7, 0, -1), 512))
    row = view.rgb[256][view.ids[256] == frame].mean(axis=1)
    assert np.ptp(row[2:12]) < 5  # Its side, from the pane to the front: 225 to 243 if the pane shaded it.


@pytest.mark.parametrize(("mean", "light"), [(0.0, 0.5), (0.8, 0.8)])
def test_a_frame_too_thin_for_a_sample_is_lit_as_the_frame(mean, light):
    """As its neighbour, and not as the pane; or as the rest of its own narrow face, if that has samples elsewhere."""
    table = np.zeros((3, SURFACE), np.float32)
    table[0, KIND] = PANE
    faces, surface = np.array([[0, 1], [1, 2], [2, 2]], np.int32), np.array([[0, 1, 2], [0, 1, 2]], np.int32)
    gbuffer = GBuffer(np.ones((2, 3), np.float32), surface, faces, table)
    samples = np.array([[1.0, 0.5]], np.float32)
    assert _light_near(samples, gbuffer, mean, 1.0, 1, 0, 1) == pytest.approx(light, abs=1e-3)


def test_a_large_screen_in_the_dark_is_as_bright_as_a_small_one(room, camera):
    room.box((1.5, 1.2, 0.04), (0, 1.0, -2.95), category="window")
    room.box((6.0, 2.6, 0.3), (0, 0, 0))
    large = room.box((1.2, 0.6, 0.1), (0.8, 1.0, 2.5), category="tv")
    small = room.box((0.3, 0.3, 0.1), (-0.8, 1.0, 2.5), category="tv")
    view = room.look(camera((0, 1.2, 1.2), (0, 0, 1)))
    bright = {key: np.median(view.rgb[view.ids == key]) for key in (large, small)}
    assert bright[large] == pytest.approx(bright[small], rel=0.05)


def test_a_loose_window_without_a_house_is_drawn(builder, camera):
    pane = builder.box((1.5, 1.2, 0.04), (0, 0.5, -2.0), category="window", movable=True, mass=5.0)
    assert (builder.look(camera((0, 1.0, 0), (0, 0, -1))).ids == pane).any()


def test_a_scene_whose_rooms_lie_elsewhere_has_no_windows_light(room, camera, recwarn):
    eye = camera((0, 1.5, 2.0), (0, -0.3, -1))
    dark = room.look(eye).rgb
    room.box((0.3, 0.1, 0.3), (0, 2.4, 2.0), category="ceiling_lamp")
    scene = replace(room.scene(), rooms=(Room("elsewhere", "bedroom", 90, 90, 93, 93),))
    renderer = RasterRenderer()
    renderer.load(scene)
    view = renderer.render(WorldState(AWAY, {}), eye)
    assert not recwarn.list
    assert np.abs(view.rgb.astype(int) - dark).mean() < 2


def test_a_ground_of_kilometres_takes_little_memory(room, camera):
    room.box((1.5, 1.2, 0.04), (0, 1.0, -2.95), category="window")
    room.box((0.6, 0.6, 0.6), (0, 0, 0))
    eye = camera((0, 1.5, 2.0), (0, -0.5, -1))
    before = room.look(eye).rgb
    room.box((3000.0, 0.1, 3000.0), (0, -0.35, 0))
    tracemalloc.start()
    after, most = room.look(eye).rgb, tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert np.abs(after.astype(int) - before).mean() < 5  # The probes lie elsewhere. 70 with few of them.
    assert most < 200e6  # 900 MB with probes all over the ground.


def test_light_is_baked_once_for_a_scene(room, camera, tmp_path):
    room.box((1.5, 1.2, 0.04), (0, 1.0, -2.95), category="window")
    eye = camera((0, 1.5, 2.0), (0, -0.3, -1))
    first, kept = room.look(eye), {file: file.stat().st_ino for file in (tmp_path / "light").iterdir()}
    assert kept
    assert np.array_equal(room.look(eye).rgb, first.rgb)
    # A second baking would replace the file by another one.
    assert {file: file.stat().st_ino for file in (tmp_path / "light").iterdir()} == kept
