"""The scene is complete, and the same for the same number."""

import numpy as np
import pytest

from humanclaw import Plugins, SceneError
from humanclaw.navigation import OccupancyGrid
from humanclaw_example.scene import box, make


def test_a_number_names_one_scene():
    assert make("1").digest == make("1").digest != make("2").digest


def test_the_body_starts_on_free_floor():
    scene = make("0")
    (chair,) = scene.of_category("chair")
    assert np.hypot(scene.start.x - chair.position[0], scene.start.z - chair.position[2]) > 0.5
    grid = OccupancyGrid.of(scene)
    assert grid.at(grid.fits(0.25), np.array([scene.start.x, scene.start.z]))


def test_the_faces_of_a_box_look_outwards():
    mesh = box("chair", (1.0, 2.0, 3.0)).mesh
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    outwards = (a + b + c) / 3 - [0, 1, 0]
    assert (np.sum(np.cross(b - a, c - a) * outwards, axis=1) > 0).all()


def test_what_is_no_number_is_refused():
    with pytest.raises(SceneError, match="no number"):
        make("kitchen")


def test_it_is_found_once_it_is_installed():
    assert Plugins.discover().scene("example:0").name == "example:0"
