"""The Renderer: a scene packed once, a body of rigid links, and the kernels in their order."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from humanclaw import HumanclawError, Motion, Scene
from humanclaw.body import JOINT_INDEX
from humanclaw.interfaces import BODY_ID, Camera, View, WorldState
from humanclaw.pose import Array, forward_kinematics, matrix_from_quaternion
from humanclaw_raster import kernels
from humanclaw_raster.canopy import CanopyMaker
from humanclaw_raster.kernels import Hits, Lens, Things
from humanclaw_raster.packing import Model, pack
from humanclaw_raster.robot import robot

SKY: Final = np.array([[196, 221, 243], [240, 244, 247]], float)
"""Colours where nothing was drawn, at the top and at the bottom of the picture."""
_IN_HEAD: Final = 0.2
"""A camera closer to the head's centre than this is the body's own eye, metres."""
_EGO_HIDDEN: Final = ("head", "neck")


class _Stage(NamedTuple):
    """A scene ready to be drawn, the body in it."""

    model: Model
    things: Things
    canopy: CanopyMaker


class RasterRenderer:
    """The Renderer in software, on the thread that calls it. The same state and camera give the same bytes.

    Pixels where nothing is have id 0, infinite depth and the colour of the sky. Not thread-safe.
    """

    def __init__(self) -> None:
        self._stage: _Stage | None = None

    def load(self, scene: Scene) -> None:
        """Make a scene ready to be drawn, in the place of the one before."""
        self.close()  # Before packing: two scenes at once would fragment the heap of a process that moves through many houses.
        links, names = robot(), sorted({thing.asset for thing in scene.objects})
        number = {name: len(links) + k for k, name in enumerate(names)}
        model = pack([*links.values(), *(scene.assets[name].mesh for name in names)])
        self._joints = np.array([JOINT_INDEX[joint] for joint in links])
        self._head = np.array([joint in _EGO_HIDDEN for joint in links])
        self._movers = {thing.id: len(links) + k for k, thing in enumerate(scene.objects) if thing.movable}
        self._rest = {thing.id: np.array([*thing.position, *thing.rotation], float) for thing in scene.objects}
        things = Things(
            mesh=np.array([*range(len(links)), *(number[thing.asset] for thing in scene.objects)], np.int32),
            id=np.array([BODY_ID] * len(links) + [thing.id for thing in scene.objects], np.int32),
            shown=np.ones(len(links) + len(scene.objects), np.bool_),
            turn=np.tile(np.eye(3), (len(links) + len(scene.objects), 1, 1)),
            place=np.zeros((len(links) + len(scene.objects), 3)),
        )
        for row, thing in enumerate(scene.objects, start=len(links)):
            self._put(things, row, self._rest[thing.id])
        moving = [*range(len(links)), *self._movers.values()]
        still = sorted(set(range(len(things.mesh))) - set(moving))
        self._stage = _Stage(model, things, CanopyMaker(scene, model, things, still, moving))

    def render(self, state: WorldState, camera: Camera) -> View:
        """Draw one moment. The head is left out of a picture that is taken from inside it.

        Raises HumanclawError before the first load.
        """
        if self._stage is None:
            raise HumanclawError("the renderer holds no scene.", "Call load(scene) first.")
        model, things, canopy = self._stage
        for key, row in self._movers.items():
            self._put(things, row, state.objects.get(key, self._rest[key]))
        self._put_body(things, state.body, camera.position)
        lens = _lens(camera)
        hits = _hits(model, things, lens, camera)
        light = kernels.openness(model, things, lens, hits, canopy.now(things))
        rgb = _sky(camera)
        kernels.paint(model, things, lens, hits, light, rgb)
        with np.errstate(divide="ignore"):
            depth = np.float32(1) / hits.nearness
        # The last place of the table is reached with -1, which stands for nothing.
        return View(rgb, depth, np.append(things.id, np.int32(0))[hits.thing])

    def close(self) -> None:
        """Free the scene; a closed renderer can load again."""
        self._stage = None

    @staticmethod
    def _put(things: Things, row: int, where: Array) -> None:
        things.place[row] = where[:3]
        things.turn[row] = matrix_from_quaternion(where[3:])

    def _put_body(self, things: Things, body: Motion, eye: Array) -> None:
        positions, orientations = forward_kinematics(body.root[-1], body.rotations[-1])
        things.place[: len(self._joints)] = positions[self._joints]
        things.turn[: len(self._joints)] = orientations[self._joints]
        ego = np.linalg.norm(positions[JOINT_INDEX["head"]] - eye) < _IN_HEAD
        things.shown[: len(self._joints)] = ~(self._head & ego)


def _hits(model: Model, things: Things, lens: Lens, camera: Camera) -> Hits:
    found, depth = kernels.in_view(model, things, lens, camera.width, camera.height)
    shape = (camera.height, camera.width)
    hits = Hits(np.zeros(shape, np.float32), np.full(shape, -1, np.int32), np.full(shape, -1, np.int32))
    kernels.draw(model, things, lens, found[np.argsort(depth, kind="stable")], hits)
    return hits


def _lens(camera: Camera) -> Lens:
    forward = camera.forward / np.linalg.norm(camera.forward)
    right = np.cross(forward, camera.up)
    right /= np.linalg.norm(right)
    focal = camera.height / 2 / np.tan(np.radians(camera.fov) / 2)
    return Lens(np.asarray(camera.position, float), np.stack([right, np.cross(forward, right), forward]), float(focal))


def _sky(camera: Camera) -> NDArray[np.uint8]:
    """(H, W, 3) a gradient."""
    down = np.linspace(0.0, 1.0, camera.height)[:, None]
    rows = ((1 - down) * SKY[0] + down * SKY[1]).astype(np.uint8)
    return np.repeat(rows[:, None], camera.width, axis=1)
