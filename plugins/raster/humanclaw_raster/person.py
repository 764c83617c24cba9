"""A body in a Model: a mesh of its own, whose corners follow each pose."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from humanclaw import Motion
from humanclaw.body import JOINT_INDEX, Array, Skin
from humanclaw.world import Mesh, compiled
from humanclaw_raster.packing import Floats, Model, along_curve

_IN_HEAD: Final = 0.2
"""A camera closer to the head's joint than this is the body's own eye, metres."""


class Person:
    """Moves the triangles of one mesh of a model as a body moves."""

    def __init__(self, skin: Skin, number: int = 0) -> None:
        """Take the looks of a person and the number of its mesh in the model."""
        self._skin, self._number = skin, number
        # In the order that packing keeps, so that face k of the skin is face k of the mesh.
        self._faces = skin.faces[np.argsort(along_curve(skin.vertices[skin.faces], [len(skin.faces)]), kind="stable")]

    def mesh(self) -> Mesh:
        """Return the skin in its bind pose, coloured by a texture of one row."""
        skin = self._skin
        return Mesh(skin.vertices, self._faces, skin.uv, skin.colours[None], skin.normals)

    def dress(self, model: Model, body: Motion, eye: Array) -> Array:
        """Put the mesh's faces where the last frame of a motion has them; return the place of their frame.

        eye: (3,) place of the camera, metres. Inside the head it does not see head and neck.
        """
        joints, root = body[-1:].joints()[0], body.root[-1]
        # Relative to the pelvis: float32 is coarse far from the origin.
        vertices, normals = self._skin.posed(np.zeros(3), body.rotations[-1])
        if np.linalg.norm(joints[JOINT_INDEX["head"]] - eye) < _IN_HEAD:
            vertices = self._skin.headless(vertices, joints[JOINT_INDEX["neck"]] - root)
        _move(model, self._number, self._faces, vertices, normals)
        return np.asarray(root)


@compiled
def _move(model: Model, mesh: int, faces: NDArray[np.int32], vertices: Floats, normals: Floats) -> None:
    """Write corners, normals and bounding spheres of one of the model's meshes."""
    start, low, high = model.clusters[model.meshes[mesh, 0], 0], np.empty(3, np.float32), np.empty(3, np.float32)
    for cluster in range(model.meshes[mesh, 0], model.meshes[mesh, 1]):
        first, end = model.clusters[cluster]
        for axis in range(3):
            low[axis], high[axis] = np.float32(np.inf), np.float32(-np.inf)
        for face in range(first, end):
            for corner in range(3):
                vertex = faces[face - start, corner]
                for axis in range(3):
                    at = vertices[vertex, axis]
                    model.corners[face, corner, axis] = at
                    model.normals[face, corner, axis] = normals[vertex, axis]
                    low[axis], high[axis] = min(low[axis], at), max(high[axis], at)
        square = np.float32(0)
        for axis in range(3):
            model.spheres[cluster, axis] = (low[axis] + high[axis]) / 2
            square += (high[axis] - low[axis]) ** 2
        model.spheres[cluster, 3] = np.sqrt(square) / 2 * np.float32(1.0001) + np.float32(1e-6)
