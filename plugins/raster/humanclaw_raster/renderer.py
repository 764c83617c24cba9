"""The Renderer: packs a scene once, moves the skins of its people, and runs the kernels in order."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from humanclaw import HumanclawError, Scene
from humanclaw.body import SKINS, Array, Motion, matrix_from_quaternion, skin
from humanclaw.world import BODY_ID, Camera, View, WorldState, body_numbers
from humanclaw_raster.buffers import GBuffer, Instances, Pinhole
from humanclaw_raster.drawing import draw, in_view
from humanclaw_raster.edges import soften
from humanclaw_raster.lighting import Lit, light_again, light_up, panes
from humanclaw_raster.mirrors import COARSE, Glass, blend
from humanclaw_raster.overhead import OverheadMapper
from humanclaw_raster.packing import Model, pack
from humanclaw_raster.painting import paint
from humanclaw_raster.person import Person
from humanclaw_raster.shading import ambient_occlusion
from humanclaw_raster.sky import panorama
from humanclaw_raster.surfaces import prepare

SKY: Final = np.array([[196, 221, 243], [240, 244, 247]], float)
"""Colours of empty pixels at the top and at the bottom of the picture."""
LOWER: Final = 0.001
"""Walls are drawn this much lower, metres: those of one storey end level with the floor of the next."""

OUTSIDE: Final = 1.0
"""A camera farther from the pelvis than this is not the body's own eye, metres: then the body casts a shadow."""


class _LoadedScene(NamedTuple):
    """A scene with the body and other people, ready to be drawn."""

    scene: Scene
    model: Model
    instances: Instances
    overhead: OverheadMapper
    lit: Lit
    mirrors: tuple[Glass, ...]
    body: Person
    people: Mapping[int, Person]
    """The others by id. Their instances are the last ones."""


class RasterRenderer:
    """Renders in software, on the calling thread. The same state and camera give the same bytes.

    Empty pixels have id 0, infinite depth and the colour of the sky. Not thread-safe.
    """

    def __init__(self) -> None:
        """Create a renderer without a scene."""
        self._loaded: _LoadedScene | None = None

    def load(self, scene: Scene) -> None:
        """Make a scene ready to be drawn; it replaces the previous one."""
        self._load(scene, ())

    def _load(self, scene: Scene, others: Sequence[int]) -> _LoadedScene:
        """Make a scene with other people, by id, ready to be drawn."""
        # Freed before packing: two scenes at once would fragment the heap of a process that visits many houses.
        self.close()
        names = sorted({obj.asset for obj in scene.objects})
        # A body looks like its number among the people of its world: without others it is the first.
        own, *looks = [SKINS[number % len(SKINS)] for number in body_numbers(others)]
        body = Person(skin(own))
        people = {key: Person(skin(looks[k]), len(names) + 1 + k) for k, key in enumerate(others)}
        model = _model(scene, names, [body, *people.values()])
        self._movers = {obj.id: 1 + k for k, obj in enumerate(scene.objects) if obj.movable}
        self._rest = {obj.id: np.array([*obj.position, *obj.rotation], float) for obj in scene.objects}
        for obj in scene.of_category("wall"):
            self._rest[obj.id][1] -= LOWER
        instances = _instances(scene, names, list(people))
        _put(instances, range(1, 1 + len(scene.objects)), list(self._rest.values()))
        overhead = OverheadMapper(scene, model, instances, list(self._movers.values()))
        lit, mirrors = light_up(scene, model, instances), tuple(Glass.all_in(scene))
        self._loaded = _LoadedScene(scene, model, instances, overhead, lit, mirrors, body, people)
        return self._loaded

    def render(self, state: WorldState, camera: Camera) -> View:
        """Draw one moment. A camera inside a head does not see its head and neck.

        Raises HumanclawError if no scene is loaded.
        """
        if self._loaded is None:
            raise HumanclawError("the renderer holds no scene.", "Call load(scene) first.")
        loaded, others = self._loaded, sorted(state.people, reverse=True)
        if list(loaded.people) != others:
            loaded = self._load(loaded.scene, others)
        model, instances, lit = loaded.model, loaded.instances, loaded.lit
        poses = [state.objects.get(key, self._rest[key]) for key in self._movers]
        _put(instances, list(self._movers.values()), poses)
        instances.place[0] = loaded.body.dress(model, state.body, camera.position)
        rows = range(len(instances.id) - len(others), len(instances.id))
        for row, key in zip(rows, others, strict=True):
            instances.place[row] = loaded.people[key].dress(model, state.people[key], camera.position)
        light_again(lit, instances, np.array([0, *self._movers.values(), *rows]))
        pinhole = _pinhole(camera)
        view, gbuffer = _painted(loaded, pinhole, camera)
        soften(pinhole, gbuffer, view.rgb)
        drawn = instances.id[gbuffer.faces[:, 1]]
        _reflect(loaded, [glass for glass in loaded.mirrors if glass.id in drawn], state.body, camera, pinhole, view)
        return view

    def close(self) -> None:
        """Free the scene; a closed renderer can load again."""
        self._loaded = None


def _reflect(
    scene: _LoadedScene, mirrors: Sequence[Glass], body: Motion, camera: Camera, pinhole: Pinhole, view: View
) -> None:
    """Draw what the largest mirror in a view reflects. mirrors: those in view."""
    seen = [(glass, glass.reflects(pinhole, view)) for glass in mirrors]
    glass, shown = max(seen, key=lambda each: each[1].sum(), default=(None, np.zeros(0, bool)))
    if glass is None or not shown.any():
        return
    image = glass.image(pinhole)
    small = replace(camera, width=-(-camera.width // COARSE), height=-(-camera.height // COARSE))
    scene.instances.place[0] = scene.body.dress(scene.model, body, image.eye)
    reflection, _ = _painted(scene, image, small, glass)
    blend(view.rgb, shown, reflection.rgb, glass.shine)


def _model(scene: Scene, names: Sequence[str], people: Sequence[Person]) -> Model:
    """Return the meshes of the body, of the assets with these names, and of the other people, in this order."""
    body, *others = [person.mesh() for person in people]
    meshes = [body, *(scene.assets[name].mesh for name in names), *others]
    glass = {1 + k: panes(scene, name) for k, name in enumerate(names)}
    return pack(meshes, [glass.get(k, np.zeros(len(mesh.faces), bool)) for k, mesh in enumerate(meshes)], panorama())


def _instances(scene: Scene, names: Sequence[str], others: Sequence[int]) -> Instances:
    """Return the body, the objects and the other people, all at the origin. names: of the assets, as in the model."""
    number, rows = {name: 1 + k for k, name in enumerate(names)}, 1 + len(scene.objects) + len(others)
    last = range(len(names) + 1, len(names) + 1 + len(others))
    return Instances(
        mesh=np.array([0, *(number[obj.asset] for obj in scene.objects), *last], np.int32),
        id=np.array([BODY_ID, *(obj.id for obj in scene.objects), *others], np.int32),
        turn=np.tile(np.eye(3), (rows, 1, 1)),
        place=np.zeros((rows, 3)),
    )


def _put(instances: Instances, rows: Sequence[int], poses: Sequence[Array]) -> None:
    """Move instances. rows: their numbers. poses: (7,) position and quaternion of each."""
    where = np.reshape(poses, (-1, 7))
    instances.place[rows] = where[:, :3]
    instances.turn[rows] = matrix_from_quaternion(where[:, 3:])


def _painted(scene: _LoadedScene, pinhole: Pinhole, camera: Camera, glass: Glass | None = None) -> tuple[View, GBuffer]:
    """Return a view with rough edges, and its surfaces. camera: of its size.

    glass: nothing behind it is drawn.
    """
    model, instances, overhead, lit = scene.model, scene.instances, scene.overhead, scene.lit
    gbuffer = _gbuffer(scene, pinhole, camera, glass)
    outside = glass is None and np.linalg.norm(camera.position - instances.place[0]) > OUTSIDE
    seen = [*range(len(instances.id) - len(scene.people), len(instances.id)), *([0] if outside else [])]
    light = ambient_occlusion(pinhole, gbuffer, overhead.with_people(instances, seen), lit.light)
    shape = (camera.height, camera.width)
    view = View(np.empty((*shape, 3), np.uint8), np.empty(shape, np.float32), np.empty(shape, np.int32))
    paint(model, instances, pinhole, gbuffer, light, _sky(camera), view.rgb, view.depth, view.ids)
    return view, gbuffer


def _gbuffer(scene: _LoadedScene, pinhole: Pinhole, camera: Camera, glass: Glass | None = None) -> GBuffer:
    model, instances = scene.model, scene.instances
    drawn, depth = in_view(model, instances, pinhole, camera.width, camera.height)
    if glass:
        kept = glass.before(model, instances, drawn)
        drawn, depth = drawn[kept], depth[kept]
    shape = (camera.height, camera.width)
    inverse_depth, surface = np.zeros(shape, np.float32), np.full(shape, -1, np.int32)
    # Stable: clusters at one depth keep their order, and pictures their bytes.
    order = drawn[np.argsort(depth, kind="stable")]
    faces = draw(model, instances, pinhole, order, inverse_depth, surface)
    return GBuffer(inverse_depth, surface, faces, prepare(model, instances, scene.lit, pinhole, faces))


def _pinhole(camera: Camera) -> Pinhole:
    forward = camera.forward / np.linalg.norm(camera.forward)
    right = np.cross(forward, camera.up)
    if np.linalg.norm(right) < 1e-9:  # Straight along `up`, which then names no top of the picture: +Z, if it can be.
        right = np.cross(forward, np.eye(3)[2 - np.abs(forward[::-1]).argmin()])
    right /= np.linalg.norm(right)
    focal = camera.height / 2 / np.tan(np.radians(camera.fov) / 2)
    axes = np.stack([right, np.cross(forward, right), forward])
    return Pinhole(np.asarray(camera.position, float), axes, float(focal))


def _sky(camera: Camera) -> NDArray[np.uint8]:
    """Return (H, 3) the sky's colour in each row: a vertical gradient."""
    down = np.linspace(0.0, 1.0, camera.height)[:, None]
    return np.asarray((1 - down) * SKY[0] + down * SKY[1], np.uint8)
