"""Build small scenes whose pictures can be computed by hand."""

from __future__ import annotations

import numpy as np
import pytest

from humanclaw.body import rest_pose
from humanclaw.world import Asset, Camera, Mesh, SceneBuilder, WorldState
from humanclaw_raster.renderer import RasterRenderer

AWAY = rest_pose()
AWAY.root[:, 0] += 500.0
"""A body far from everything, for pictures of objects alone."""


def flat_mesh(vertices, faces, colour=(200, 200, 200)):
    uv = np.full((len(vertices), 2), 0.5, np.float32)
    return Mesh(np.array(vertices, np.float32), np.array(faces, np.int32), uv, np.full((2, 2, 3), colour, np.uint8))


class Looked(SceneBuilder):
    """Builds a scene and looks at it."""

    def mesh(self, mesh, position=(0, 0, 0), category="object"):
        name = f"{category} {len(self.objects)}"
        self.assets[name] = Asset(name, category, mesh, ())
        return self._put(name, category, position, {})

    def box(self, size, position, colour=(200, 200, 200), category="object", **facts):
        return super().box(category, size, position, colour, **facts)

    def sheet(self, corners, position, category, colour=(200, 200, 200)):
        return self.mesh(flat_mesh(corners, [[0, 1, 2], [0, 2, 3]], colour), position, category)

    def floor(self):
        return self.box((20, 0.2, 20), (0, -0.2, 0))

    def look(self, eye, state=None):
        renderer = RasterRenderer()
        renderer.load(self.scene())
        return renderer.render(state or WorldState(AWAY, {}), eye)


@pytest.fixture
def builder():
    return Looked()


@pytest.fixture
def camera():
    def make(position, forward, size=128, up=(0.0, 1.0, 0.0)):
        return Camera(np.array(position, float), np.array(forward, float), np.array(up, float), 90.0, size, size)

    return make
