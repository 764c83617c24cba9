"""The Renderer: packs a scene once, places the body's rigid links, and runs the kernels in order."""

from __future__ import annotations

from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from humanclaw import HumanclawError, Motion, Scene
from humanclaw.body import JOINT_INDEX, Array, forward_kinematics, matrix_from_quaternion
from humanclaw.world import BODY_ID, Camera, View, WorldState
from humanclaw_raster.buffers import GBuffer, Instances, OverheadMap, Pinhole
from humanclaw_raster.drawing import draw, in_view
from humanclaw_raster.overhead import OverheadMapper
from humanclaw_raster.packing import Model, pack
from humanclaw_raster.painting import paint, smooth_edges
from humanclaw_raster.robot import robot
from humanclaw_raster.shading import ambient_occlusion

SKY: Final = np.array([[196, 221, 243], [240, 244, 247]], float)
"""Colours of empty pixels at the top and at the bottom of the picture."""
_IN_HEAD: Final = 0.2
"""A camera closer to the head's joint than this is the body's own eye, metres."""
_EGO_HIDDEN: Final = ("head", "neck")


class _LoadedScene(NamedTuple):
    """A scene with the body, ready to be drawn."""

    model: Model
    instances: Instances
    overhead: OverheadMapper


class RasterRenderer:
    """Renders in software, on the calling thread. The same state and camera give the same bytes.

    Empty pixels have id 0, infinite depth and the colour of the sky. Not thread-safe.
    """

    def __init__(self, *, smooth: bool = False) -> None:
        """Create a renderer without a scene.

        smooth: pixels on edges get the mean of 2 x 2 samples. Ids and depth are those of the pixel's centre either way.
        """
        self._smooth = smooth
        self._loaded: _LoadedScene | None = None

    def load(self, scene: Scene) -> None:
        """Make a scene ready to be drawn; it replaces the previous one."""
        # Freed before packing: two scenes at once would fragment the heap of a process that visits many houses.
        self.close()
        links, names = robot(), sorted({obj.asset for obj in scene.objects})
        number = {name: len(links) + k for k, name in enumerate(names)}
        model = pack([*links.values(), *(scene.assets[name].mesh for name in names)])
        self._joints = np.array([JOINT_INDEX[joint] for joint in links])
        self._head = np.array([joint in _EGO_HIDDEN for joint in links])
        self._movers = {obj.id: len(links) + k for k, obj in enumerate(scene.objects) if obj.movable}
        self._rest = {obj.id: np.array([*obj.position, *obj.rotation], float) for obj in scene.objects}
        instances = Instances(
            mesh=np.array([*range(len(links)), *(number[obj.asset] for obj in scene.objects)], np.int32),
            id=np.array([BODY_ID] * len(links) + [obj.id for obj in scene.objects], np.int32),
            shown=np.ones(len(links) + len(scene.objects), np.bool_),
            turn=np.tile(np.eye(3), (len(links) + len(scene.objects), 1, 1)),
            place=np.zeros((len(links) + len(scene.objects), 3)),
        )
        for row, obj in enumerate(scene.objects, start=len(links)):
            self._put(instances, row, self._rest[obj.id])
        moving = [*range(len(links)), *self._movers.values()]
        still = sorted(set(range(len(instances.mesh))) - set(moving))
        self._loaded = _LoadedScene(model, instances, OverheadMapper(scene, model, instances, still, moving))

    def render(self, state: WorldState, camera: Camera) -> View:
        """Draw one moment. A camera inside the head does not see head and neck.

        Raises HumanclawError if no scene is loaded.
        """
        if self._loaded is None:
            raise HumanclawError("the renderer holds no scene.", "Call load(scene) first.")
        model, instances, overhead = self._loaded
        for key, row in self._movers.items():
            self._put(instances, row, state.objects.get(key, self._rest[key]))
        self._put_body(instances, state.body, camera.position)
        pinhole = _pinhole(camera)
        gbuffer = _gbuffer(model, instances, pinhole, camera)
        rgb = self._colours(camera, gbuffer, overhead.now(instances))
        with np.errstate(divide="ignore"):
            depth = np.float32(1) / gbuffer.inverse_depth
        # Empty pixels have instance -1, which indexes the appended last id, 0.
        return View(rgb, depth, np.append(instances.id, np.int32(0))[gbuffer.instance])

    def _colours(self, camera: Camera, gbuffer: GBuffer, above: OverheadMap) -> NDArray[np.uint8]:
        """Return the (H, W, 3) colours. gbuffer: of this camera. above: height maps of this moment."""
        assert self._loaded is not None
        model, instances, _ = self._loaded
        light = ambient_occlusion(model, instances, _pinhole(camera), gbuffer, above)
        sky = _sky(camera)
        rgb = np.repeat(sky[:, None], camera.width, axis=1)
        paint(model, instances, _pinhole(camera), gbuffer, light, rgb)
        if self._smooth:
            fine = replace(camera, width=2 * camera.width, height=2 * camera.height)
            samples = _gbuffer(model, instances, _pinhole(fine), fine)
            smooth_edges(model, instances, _pinhole(fine), samples, gbuffer, light, sky, rgb)
        return rgb

    def close(self) -> None:
        """Free the scene; a closed renderer can load again."""
        self._loaded = None

    @staticmethod
    def _put(instances: Instances, row: int, where: Array) -> None:
        instances.place[row] = where[:3]
        instances.turn[row] = matrix_from_quaternion(where[3:])

    def _put_body(self, instances: Instances, body: Motion, eye: Array) -> None:
        positions, orientations = forward_kinematics(body.root[-1], body.rotations[-1])
        instances.place[: len(self._joints)] = positions[self._joints]
        instances.turn[: len(self._joints)] = orientations[self._joints]
        ego = np.linalg.norm(positions[JOINT_INDEX["head"]] - eye) < _IN_HEAD
        instances.shown[: len(self._joints)] = ~(self._head & ego)


def _gbuffer(model: Model, instances: Instances, pinhole: Pinhole, camera: Camera) -> GBuffer:
    found, depth = in_view(model, instances, pinhole, camera.width, camera.height)
    shape = (camera.height, camera.width)
    gbuffer = GBuffer(np.zeros(shape, np.float32), np.full(shape, -1, np.int32), np.full(shape, -1, np.int32))
    draw(model, instances, pinhole, found[np.argsort(depth, kind="stable")], gbuffer)
    return gbuffer


def _pinhole(camera: Camera) -> Pinhole:
    forward = camera.forward / np.linalg.norm(camera.forward)
    right = np.cross(forward, camera.up)
    right /= np.linalg.norm(right)
    focal = camera.height / 2 / np.tan(np.radians(camera.fov) / 2)
    return Pinhole(
        np.asarray(camera.position, float), np.stack([right, np.cross(forward, right), forward]), float(focal)
    )


def _sky(camera: Camera) -> NDArray[np.uint8]:
    """Return (H, 3) the sky's colour in each row: a vertical gradient."""
    down = np.linspace(0.0, 1.0, camera.height)[:, None]
    return np.asarray((1 - down) * SKY[0] + down * SKY[1], np.uint8)
