"""Tests of cameras and views."""

import numpy as np
import pytest

from humanclaw.errors import HumanclawError
from humanclaw.world import BODY_ID, Camera, View, together


def test_a_camera_tells_where_points_are_in_its_picture():
    camera = Camera.looking((0, 0, -2), (0, 0, 0), 90.0, (80, 64))
    # Half of 64 pixels are 2 m at a distance of 2 m, and +X is to the left of who looks along +Z.
    assert np.allclose(camera.pixels([[0, 0, 0], [0, 1, 0], [1, 0, 0]]), [[40, 32], [40, 16], [24, 32]])


def test_a_camera_above_a_place_looks_straight_down_at_it():
    camera = Camera.looking((2, 5, 1), (2, 0, 1), 90.0, (80, 64))
    assert np.allclose(camera.pixels([2, 0, 1]), [40, 32])
    with pytest.raises(HumanclawError, match="finite"):
        Camera.looking((2, 5, 1), (2, np.nan, 1), 90.0, (80, 64))


def test_several_bodies_in_one_picture_hide_and_shade_as_one_would():
    def view(grey, depth, ids):
        return View(np.repeat(np.uint8([grey])[..., None], 3, -1), np.float32([depth]), np.int32([ids]))

    body, floor = BODY_ID, 7
    near = view([200, 200, 90, 180], [2, 9, 9, 9], [body, floor, floor, floor])
    far = view([50, 60, 100, 190], [3, 4, 9, 9], [body, body, floor, floor])
    assert together([near, far])[0, :, 0].tolist() == [200, 60, 90, 180]
