"""Pictures of a world, drawn on one CPU core by Bullet's software rasteriser: no display, no GPU, no driver."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from humanclaw.body import JOINT_INDEX
from humanclaw.errors import HumanclawError
from humanclaw.interfaces import BODY_ID, Camera, View, WorldState
from humanclaw.pose import Array, Motion, forward_kinematics, quaternion_from_matrix
from humanclaw.scene import Mesh, Scene
from humanclaw_bullet.engine import Client
from humanclaw_bullet.robot import robot

NEAR: Final = 0.05
FAR: Final = 60.0
SKY: Final = np.array([[196, 221, 243], [240, 244, 247]], float)
"""Colours where nothing was drawn, at the top and at the bottom of the picture."""
SUN: Final = (0.5, 0.8, 0.3)
"""Direction towards the light, oblique to both axes of a house, so that its walls differ in brightness."""
UPLIFT: Final = 0.6
"""Normals are lifted by this much before shading, as light that comes from above and bounces all round would: without it
every face that is turned away from the sun would have one and the same darkness, and corners between them would vanish."""
BOUNCE: Final = 0.5
"""Faces that look down are lit by the floor, with this share of what it gets."""
SMOOTH: Final = float(np.cos(np.radians(40.0)))
"""A face that leaves the mean of its neighbours by more than this angle has an edge there."""
_IN_HEAD: Final = 0.2
"""A camera closer to the head's centre than this is the body's own eye, metres."""
_AWAY: Final = (0.0, -1000.0, 0.0)
_EGO_HIDDEN: Final = ("head", "neck")


class BulletRenderer:
    """The Renderer on Bullet's TinyRenderer. Not thread-safe; the same state and camera give the same picture."""

    def __init__(self) -> None:
        self._client: Client | None = None

    def load(self, scene: Scene) -> None:
        """Make a scene ready to be drawn. Raises SceneError for a mesh that cannot be drawn."""
        self.close()
        self._client = Client()
        self._shapes: dict[str, int] = {}
        self._textures: dict[str, int] = {}
        self._bodies: dict[int, int] = {}
        self._rest = {
            thing.id: np.array([*thing.position, *thing.rotation], float) for thing in scene.objects if thing.movable
        }
        with tempfile.TemporaryDirectory() as folder:
            self._links = {joint: self._put(f"robot/{joint}", mesh, Path(folder)) for joint, mesh in robot().items()}
            for thing in scene.objects:
                body = self._put(thing.asset, scene.assets[thing.asset].mesh, Path(folder))
                self._client.resetBasePositionAndOrientation(body, thing.position, thing.rotation)
                self._bodies[thing.id] = body
        self._ids = self._table()

    def render(self, state: WorldState, camera: Camera) -> View:
        """Draw one moment. The head is left out of a picture that is taken from inside it.

        Raises HumanclawError before the first load.
        """
        if self._client is None:
            raise HumanclawError("the renderer holds no scene.", "Call load(scene) first.")
        self._place_things(state)
        self._place_body(state.body, camera.position)
        _, _, rgba, depth, segments = self._client.getCameraImage(
            camera.width, camera.height, _view(camera), _projection(camera), lightDirection=SUN, shadow=0,
            lightAmbientCoeff=0.6, lightDiffuseCoeff=0.45, lightSpecularCoeff=0.0,
            renderer=self._client.ER_TINY_RENDERER,
        )  # fmt: skip
        ids = self._ids[np.asarray(segments).reshape(camera.height, camera.width)]
        rgb = np.asarray(rgba, np.uint8).reshape(camera.height, camera.width, 4)[..., :3]
        metres = FAR * NEAR / (FAR - (FAR - NEAR) * np.asarray(depth, np.float32).reshape(ids.shape))
        return View(np.where((ids == 0)[..., None], _sky(camera), rgb), metres.astype(np.float32), ids)

    def close(self) -> None:
        """Free the scene; a closed renderer can load again."""
        if self._client is not None:
            self._client.close()
            self._client = None

    def _place_things(self, state: WorldState) -> None:
        assert self._client is not None
        for key, rest in self._rest.items():
            where = state.objects.get(key, rest)
            self._client.resetBasePositionAndOrientation(self._bodies[key], where[:3], where[3:])

    def _place_body(self, body: Motion, eye: Array) -> None:
        assert self._client is not None
        positions, orientations = forward_kinematics(body.root[-1], body.rotations[-1])
        turns = quaternion_from_matrix(orientations)
        ego = np.linalg.norm(positions[JOINT_INDEX["head"]] - eye) < _IN_HEAD
        for joint, link in self._links.items():
            index = JOINT_INDEX[joint]
            place = _AWAY if ego and joint in _EGO_HIDDEN else positions[index]
            self._client.resetBasePositionAndOrientation(link, place, turns[index])

    def _put(self, name: str, mesh: Mesh, folder: Path) -> int:
        """A new body that looks like the mesh; shapes and textures are shared by name."""
        assert self._client is not None
        if name not in self._shapes:
            vertices, normals, uv = _corners(mesh)
            self._shapes[name] = self._client.createVisualShape(
                self._client.GEOM_MESH, vertices=vertices.tolist(), indices=list(range(len(vertices))),
                normals=normals.tolist(), uvs=uv.tolist(),
            )  # fmt: skip
            file = folder / f"{len(self._shapes)}.png"
            Image.fromarray(mesh.texture).save(file, compress_level=1)
            self._textures[name] = self._client.loadTexture(str(file))
        body = self._client.createMultiBody(0, -1, self._shapes[name])
        self._client.changeVisualShape(body, -1, textureUniqueId=self._textures[name])
        return int(body)

    def _table(self) -> NDArray[np.int32]:
        """Bullet's body number to scene id; the last entry is reached with -1, which stands for nothing."""
        table = np.zeros(max([*self._links.values(), *self._bodies.values()]) + 2, np.int32)
        table[list(self._links.values())] = BODY_ID
        for key, body in self._bodies.items():
            table[body] = key
        return table


def _corners(mesh: Mesh) -> tuple[Array, Array, Array]:
    """(3 M, 3) positions, (3 M, 3) normals for shading and (3 M, 2) uv of every corner of every face."""
    normals = _smooth_normals(mesh)
    normals[:, 1] = np.where(normals[:, 1] < 0, -BOUNCE * normals[:, 1], normals[:, 1]) + UPLIFT
    return mesh.vertices.astype(float)[mesh.faces.ravel()], _unit(normals), mesh.uv.astype(float)[mesh.faces.ravel()]


def _smooth_normals(mesh: Mesh) -> Array:
    """(3 M, 3) the normal of each face's corner: the mean of the faces that meet there, unless they meet at an edge."""
    points = mesh.vertices.astype(float)[mesh.faces]
    flat = np.repeat(_unit(np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])), 3, axis=0)
    _, place = np.unique(np.round(mesh.vertices, 5), axis=0, return_inverse=True)
    corner = place.ravel()[mesh.faces.ravel()]
    total = np.zeros((corner.max() + 1, 3))
    np.add.at(total, corner, flat)
    mean = _unit(total)[corner]
    return np.where(np.sum(flat * mean, axis=-1, keepdims=True) > SMOOTH, mean, flat)


def _unit(vectors: Array) -> Array:
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-12))


def _view(camera: Camera) -> list[float]:
    """The view matrix, column after column, as OpenGL has it."""
    forward = camera.forward / np.linalg.norm(camera.forward)
    right = np.cross(forward, camera.up)
    right /= np.linalg.norm(right)
    matrix = np.eye(4)
    matrix[:3, :3] = right, np.cross(right, forward), -forward
    matrix[:3, 3] = -matrix[:3, :3] @ camera.position
    return [float(number) for number in matrix.T.ravel()]


def _projection(camera: Camera) -> list[float]:
    scale = 1 / np.tan(np.radians(camera.fov) / 2)
    matrix = np.zeros((4, 4))
    matrix[0, 0], matrix[1, 1] = scale * camera.height / camera.width, scale
    matrix[2, 2:] = -(FAR + NEAR) / (FAR - NEAR), -2 * FAR * NEAR / (FAR - NEAR)
    matrix[3, 2] = -1
    return [float(number) for number in matrix.T.ravel()]


def _sky(camera: Camera) -> NDArray[np.uint8]:
    """(H, 1, 3) a gradient."""
    down = np.linspace(0.0, 1.0, camera.height)[:, None]
    return np.asarray((1 - down) * SKY[0] + down * SKY[1]).astype(np.uint8)[:, None]
