"""Build small scenes whose pictures can be computed by hand."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import pytest

from humanclaw import Scene
from humanclaw.body import Pose2D, rest_pose
from humanclaw.world import Asset, Camera, Mesh, SceneObject, WorldState
from humanclaw_raster.renderer import RasterRenderer

AWAY = rest_pose()
AWAY.root[:, 0] += 500.0
"""A body far from everything, for pictures of objects alone."""


def box_mesh(size, colour):
    """Return a box that stands on y = 0; each of its six faces has its own vertices."""
    corners, faces = [], []
    for axis in range(3):
        for sign in (-1, 1):
            square = np.zeros((4, 3))
            square[:, axis] = sign
            square[:, (axis + 1) % 3], square[:, (axis + 2) % 3] = (-1, 1, 1, -1), (-1, -1, 1, 1)
            order = (0, 1, 2, 3) if sign > 0 else (3, 2, 1, 0)
            faces += [[len(corners) + order[0], len(corners) + order[k], len(corners) + order[k + 1]] for k in (1, 2)]
            corners += (square * np.array(size) / 2 + [0, size[1] / 2, 0]).tolist()
    return flat_mesh(corners, faces, colour)


def flat_mesh(vertices, faces, colour=(200, 200, 200)):
    uv = np.full((len(vertices), 2), 0.5, np.float32)
    return Mesh(np.array(vertices, np.float32), np.array(faces, np.int32), uv, np.full((2, 2, 3), colour, np.uint8))


@dataclass
class SceneBuilder:
    """Collects objects for a scene. Ids count from 1."""

    assets: dict = field(default_factory=dict)
    objects: list = field(default_factory=list)

    def mesh(self, mesh, position=(0, 0, 0), category="object", **facts):
        number = len(self.objects) + 1
        self.assets[str(number)] = Asset(str(number), category, mesh, ())
        self.objects.append(SceneObject(number, str(number), category, position, **facts))
        return number

    def box(self, size, position, colour=(200, 200, 200), **facts):
        return self.mesh(box_mesh(size, colour), position, **facts)

    def sheet(self, corners, position, category, colour=(200, 200, 200)):
        return self.mesh(flat_mesh(corners, [[0, 1, 2], [0, 2, 3]], colour), position, category)

    def floor(self):
        return self.box((20, 0.2, 20), (0, -0.2, 0))

    def scene(self):
        return Scene("builder", self.assets, tuple(self.objects), (), Pose2D(0, 0, 0))

    def look(self, eye, state=None):
        renderer = RasterRenderer()
        renderer.load(self.scene())
        return renderer.render(state or WorldState(AWAY, {}), eye)


@pytest.fixture
def builder():
    return SceneBuilder()


@pytest.fixture
def camera():
    def make(position, forward, size=128, up=(0.0, 1.0, 0.0)):
        return Camera(np.array(position, float), np.array(forward, float), np.array(up, float), 90.0, size, size)

    return make
