"""An empty yard of 8 by 8 metres: `humanclaw run --plugin examples/hooks/scenes.py --scene yard:`."""

import numpy as np

from humanclaw import Scene, hookimpl
from humanclaw.body import Pose2D
from humanclaw.plugins import Register, SceneFactory
from humanclaw.world import Asset, Mesh, SceneObject

SLAB = np.array([(x, y, z) for x in (-4, 4) for y in (-0.1, 0) for z in (-4, 4)], np.float32)
SIDES = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))


def yard(argument: str) -> Scene:
    faces = np.array([side for a, b, c, d in SIDES for side in ((a, b, c), (a, c, d))], np.int32)
    mesh = Mesh(SLAB, faces, np.zeros((8, 2), np.float32), np.full((2, 2, 3), 120, np.uint8))
    floor = Asset("floor", "floor", mesh, (SLAB,), None)
    placed = SceneObject(1, "floor", "floor", (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))
    return Scene(f"yard:{argument}", {"floor": floor}, (placed,), (), Pose2D(0.0, 0.0, 0.0))


@hookimpl
def humanclaw_scenes(register: Register[SceneFactory]) -> None:
    register("yard", yard, "an empty yard of 8 by 8 metres")
