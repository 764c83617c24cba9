"""A lens and a sensor's noise over the pictures of another renderer."""

import numpy as np
import pytest

from humanclaw.body import rest_pose
from humanclaw.world import WorldState


@pytest.fixture
def looks(plugins, builder, camera):
    """Return a function that draws a white wall at 5 m, with a board on its right side, by a renderer."""
    builder.box((40, 40, 0.2), (0, -20, 5.1))
    builder.box((1.0, 6.0, 0.1), (-4.0, -2.0, 4.95))
    scene, away = builder.scene(), rest_pose()
    away.root[:, 0] += 500.0

    def look(name, size=256):
        renderer = plugins.make("renderers", name)
        renderer.load(scene)
        return renderer.render(WorldState(away, {}), camera((0, 1, 0), (0, 0, 1), size))

    return look


def test_a_lens_bulges_straight_lines_and_keeps_colour_depth_and_id_of_a_pixel_together(looks):
    view = looks("raster-lens")
    edge = np.array([np.flatnonzero(row == row[-20])[0] for row in view.ids])
    assert edge[128] - edge[8] == edge[128] - edge[-9] > 2
    # 1 m at 5 m and 128 pixels to the metre at 1 m: the board begins 3.5 / 4.9 of half the picture to the right, which
    # the lens shows where r * (1 + 0.04 * r**2) / 1.08 is that much: at 0.7548.
    assert edge[128] == pytest.approx(127.5 * 1.7548, abs=1)
    assert set(view.depth[view.ids == view.ids[128, 128]].tolist()) == {view.depth[128, 128]}
    plain = looks("raster").rgb.astype(float)
    assert view.rgb[127, 127] == pytest.approx(plain[127, 127], abs=2)
    assert view.rgb[0, 0] == pytest.approx(0.7 * plain[0, 0], abs=3)


def test_the_only_pixel_of_a_picture_is_the_middle_of_the_lens(looks):
    assert np.array_equal(looks("raster-lens", 1).rgb, looks("raster", 1).rgb)


def test_noise_is_that_of_light_and_sensor_and_the_same_each_time(looks):
    plain, view, again = looks("raster"), looks("raster-noise"), looks("raster-noise")
    assert np.array_equal(view.rgb, again.rgb)
    assert np.array_equal(view.ids, plain.ids)
    part = np.s_[100:150, 60:160]
    grey, off = plain.rgb[part].astype(float), view.rgb[part].astype(float) - plain.rgb[part]
    # Poisson noise of light and 2 steps of the sensor, rounded: variances add up.
    assert off.mean() == pytest.approx(0.0, abs=0.2)
    assert off.std() == pytest.approx(np.sqrt(0.15 * grey.mean() + 2**2 + 1 / 12), rel=0.05)
