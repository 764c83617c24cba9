"""The light of a scene as the kernels read it: where it comes from, what is baked, and how bright a surface is."""

from __future__ import annotations

import hashlib
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from humanclaw import Scene
from humanclaw.body import Array, matrix_from_quaternion
from humanclaw.storage import Cache, source_digest
from humanclaw.world import Mesh, SceneObject, compiled, inlined
from humanclaw_raster.baking import Lights, bake, voxels
from humanclaw_raster.buffers import HALF, TINY, ZERO, Instances
from humanclaw_raster.packing import LEVELS, Floats, Model

_CODE: Final = tuple(f"humanclaw_raster/{name}.py" for name in ("baking", "lighting", "packing"))
"""What may change the light of the same scene."""
DAYLIGHT: Final = 1.0
"""Radiance of the sky, which all other brightness is relative to."""
LAMPS: Final = {"ceiling_lamp": 0.22, "lamp": 0.12}
"""Intensity of lamps by category, in the same unit."""
SAMPLES: Final = 4
"""Lights on a pane along each side."""
PLAIN: Final = (0.95, 0.65, 1.0, 0.75, 0.85, 0.7)
"""Brightness of surfaces that face +x, -x, +y, -y, +z, -z in a scene without windows and lamps: from one side above."""
MEAN: Final = 0.74
"""Brightness of the mean surface indoors: a camera's exposure."""
CONTRAST: Final = 0.32
"""Exponent from light to brightness. A display's is 0.45; less, because eyes and cameras adapt to a dark room."""
DARK: Final = 0.03
"""Least light, as a share of the mean."""
GLOW: Final = {"ceiling_lamp": 1.1, "lamp": 1.0, "tv": 0.95}
"""Least brightness of what shines itself, by category."""
PERSON: Final = "person"
"""Category of things that look like people, whose frame is a pelvis. They are lit as a body, and shade no floor."""
SKY: Final = 1.1
"""Brightness of the sky behind windows."""
OFFSET: Final = 0.16
"""A surface is lit as the air this far before it, metres: probes in the wall behind it do not count."""
_BODY: Final = 0.2
"""From the pelvis to the places where the body's light is looked up, metres."""


class Light(NamedTuple):
    """The light of a scene."""

    shape: tuple[int, int, int]
    """Y, Z, X: number of probes along each axis. The array has them in one row: kernels would pay for every axis."""
    bright: Floats
    """(6 Y Z X,) brightness of surfaces that face +x, -x, +y, -y, +z, -z at each probe."""
    corner: Floats
    """(3,) the first probe, metres."""
    density: np.float32
    """Probes a metre."""


class Lit(NamedTuple):
    """The light on the N instances of a model."""

    light: Light
    middle: Floats
    """(N, 3) from an instance's place to the middle of its box, metres."""
    half: Floats
    """(N, 3) half the sides of the box."""
    glow: Floats
    """(N,) its least brightness."""
    around: Floats
    """(N, 6) brightness of its surfaces that face +x, -x, +y, -y, +z, -z."""


def light_up(scene: Scene, model: Model, instances: Instances) -> Lit:
    """Return the light on the instances: the body, the objects of a scene, in their places at the start, and people."""
    boxes = np.array([scene.aabb(obj.id) for obj in scene.objects]).reshape(-1, 2, 3)
    people = len(instances.place) - 1 - len(boxes)
    off = boxes.mean(axis=1) - instances.place[1 : 1 + len(boxes)]
    half, bodies = np.ptp(boxes, axis=1) / 2, [obj.category == PERSON for obj in scene.objects]
    # A body has no box: that of a thing like it would end under the floor and at the ceiling.
    off[bodies], half[bodies] = 0.0, _BODY
    middle = np.concatenate([np.zeros((1, 3)), off, np.zeros((people, 3))]).astype(np.float32)
    half = np.concatenate([np.full((1, 3), _BODY), half, np.full((people, 3), _BODY)]).astype(np.float32)
    glow = [0.0, *(GLOW.get(obj.category, 0.0) for obj in scene.objects), *[0.0] * people]
    around = np.empty((len(glow), 6), np.float32)
    lit = Lit(light_of(scene, model, instances), middle, half, np.array(glow, np.float32), around)
    light_again(lit, instances, np.arange(len(glow)))
    return lit


def light_again(lit: Lit, instances: Instances, rows: NDArray[np.int64]) -> None:
    """Look up the light on some instances where they are now."""
    _light_again(lit, instances, rows, jitter(lit.light))


@compiled
def _light_again(lit: Lit, instances: Instances, rows: NDArray[np.int64], aside: Floats) -> None:
    place = np.empty(3, np.float32)
    for row in rows:
        for face in range(6):
            axis, sign, total = face // 2, np.float32(1 - 2 * (face % 2)), ZERO
            for k in range(3):
                place[k] = np.float32(instances.place[row, k]) + lit.middle[row, k]
            place[axis] += sign * (lit.half[row, axis] + np.float32(OFFSET))
            for k in range(16):
                x, y, z = place[0] + aside[k, 0], place[1] + aside[k, 1], place[2] + aside[k, 2]
                total += lit.light.bright[probe(lit.light, x, y, z) + np.uint64(face)]
            lit.around[row, face] = max(total / np.float32(16), lit.glow[row])


def light_of(scene: Scene, model: Model, instances: Instances) -> Light:
    """Return the light of a scene, from the cache if it was baked before.

    instances: the body, then the objects of the scene, in their places at the start.
    """
    lights = _lights(scene)
    if not lights.power.size:
        return Light((2, 2, 2), np.tile(np.array(PLAIN, np.float32), 8), np.zeros(3, np.float32), np.float32(1))
    key, store = hashlib.sha256(f"{source_digest(_CODE)}|{scene.digest}".encode()).hexdigest(), Cache("light")
    if (data := store.get(key)) is None:
        space = voxels(*_solid(scene, model, instances), lights.place)
        head = np.array([*space.shape, *(space.corner + space.size), 1 / (2 * space.size)])
        data = head.tobytes() + _exposed(bake(space, lights, DAYLIGHT, _indoors(scene, head))).astype("<f2").tobytes()
        store.put(key, data)
    head, bright = np.frombuffer(data, "<f8", 7), np.frombuffer(data, "<f2", offset=56).astype(np.float32)
    high, deep, wide = head[:3].astype(int).tolist()
    return Light((high, deep, wide), bright, head[3:6].astype(np.float32), np.float32(head[6]))


def _exposed(light: Floats) -> Floats:
    """Return brightness, as a camera sees light that is exposed for the rooms; PLAIN if no probe is in one."""
    if np.isnan(light).all():
        return np.broadcast_to(np.array(PLAIN, np.float32), light.shape)
    middle = np.exp(np.nanmean(np.log(np.maximum(light.mean(axis=-1), 0.01))))
    return np.asarray(MEAN * (np.nan_to_num(light / middle, nan=1.0) + DARK) ** CONTRAST, np.float32)


def _indoors(scene: Scene, head: Array) -> NDArray[np.bool_] | None:
    """Return (Y, Z, X) which probes are in rooms; None for a scene without rooms."""
    shape, corner = head[:3].astype(int), head[3:6]
    inside = np.zeros(shape, bool)
    y, z, x = (corner[axis] + np.arange(shape[k]) / head[6] for k, axis in enumerate((1, 2, 0)))
    for room in scene.rooms:
        high, deep, wide = ((room.floor < y) & (y < room.floor + 2.4), (room.z0 < z) & (z < room.z1),
                            (room.x0 < x) & (x < room.x1))  # fmt: skip
        inside[np.ix_(high, deep, wide)] = True
    return inside if scene.rooms else None


def panes(scene: Scene, name: str) -> NDArray[np.bool_]:
    """Return (F,) which faces of an asset are the glass of a window: large and to the front."""
    asset = scene.assets[name]
    return front(asset.mesh) if asset.category == "window" else np.zeros(len(asset.mesh.faces), bool)


def front(mesh: Mesh) -> NDArray[np.bool_]:
    """Return (F,) which faces of a mesh are large and to the front."""
    a, b, c = (mesh.vertices[mesh.faces[:, k]].astype(float) for k in range(3))
    normal = np.cross(b - a, c - a) / 2
    area = np.linalg.norm(normal, axis=1)
    return np.asarray((area > 0.1) & (normal[:, 2] > 0.9 * area))


def _lights(scene: Scene) -> Lights:
    """Return the lamps of a scene, and SAMPLES x SAMPLES lights on each pane."""
    place, way, power = [], [], []
    for obj in scene.objects:
        turn, mesh = matrix_from_quaternion(np.array(obj.rotation)), scene.assets[obj.asset].mesh
        if _stays(obj) and (pane := panes(scene, obj.asset)).any():
            low, high = _box(mesh.vertices[mesh.faces[pane]].reshape(-1, 3))
            grid = (np.indices((SAMPLES, SAMPLES, 1)).reshape(3, -1).T + 0.5) / [SAMPLES, SAMPLES, 1]
            place.append((low + grid * (high - low)) @ turn.T + obj.position)
            way.append(np.tile(turn[:, 2], (SAMPLES**2, 1)))
            power.append(np.full(SAMPLES**2, DAYLIGHT * np.prod((high - low)[:2]) / SAMPLES**2 / np.pi))
        elif obj.category in LAMPS and not obj.movable:
            low, high = _box(mesh.vertices)
            end = low if obj.category == "ceiling_lamp" else high
            place.append(np.array([obj.position]) + [0, end[1] - 0.1, 0])
            way.append(np.zeros((1, 3)))
            power.append(np.array([LAMPS[obj.category]]))
    return Lights(*(np.concatenate(part) if part else np.zeros(0) for part in (place, way, power)))


def _stays(obj: SceneObject) -> bool:
    """Return whether an object stays where it is, or on its joint; people do not."""
    return obj.category != PERSON and (not obj.movable or obj.joint is not None)


def _box(points: Floats) -> tuple[Array, Array]:
    return points.min(axis=0).astype(float), points.max(axis=0).astype(float)


def _solid(scene: Scene, model: Model, instances: Instances) -> tuple[Floats, Floats]:
    """Return (T, 3, 3) triangles of all that stays where it is, and their (T,) albedo."""
    triangles, albedo = [], []
    for row, obj in enumerate(scene.objects, 1):
        if not _stays(obj):
            continue
        first, end = _faces(model, instances.mesh[row])
        triangles.append(model.corners[first:end] @ instances.turn[row].T + instances.place[row])
        albedo.append(_albedo(model, instances.mesh[row], first, end))
    return np.concatenate(triangles).astype(np.float32), np.concatenate(albedo).astype(np.float32)


def _faces(model: Model, mesh: int) -> tuple[int, int]:
    first, last = model.meshes[mesh]
    return int(model.clusters[first, 0]), int(model.clusters[last - 1, 1])


def _albedo(model: Model, mesh: int, first: int, end: int) -> Array:
    """Return the share of the light that faces reflect, by the texel in their middle."""
    start, height, width = model.levels[mesh * LEVELS].tolist()
    middle = model.uv[first:end].mean(axis=1) % 1.0
    texel = start + ((1 - middle[:, 1]) * height).astype(int).clip(0, height - 1) * width
    packed = model.texels[texel + (middle[:, 0] * width).astype(int).clip(0, width - 1)]
    red, green, blue = (packed >> shift & 255 for shift in (0, 8, 16))
    return np.asarray(((0.3 * red + 0.59 * green + 0.11 * blue) / 255) ** 2.2)


def jitter(light: Light) -> Floats:
    """Return (16, 3) offsets within a probe's cell, metres: the mean of the probes nearest to them lies in between."""
    spread = (np.arange(16)[:, None] + 0.5) * np.array([1 / 16, 0.6180340, 0.7548777]) % 1 - 0.5
    return np.asarray(spread / float(light.density), np.float32)


@inlined
def probe(light: Light, x: np.float32, y: np.float32, z: np.float32) -> np.uint64:
    """Return where in light.bright the six values of the probe nearest to a place begin."""
    high, deep, wide = light.shape
    j = min(max((y - light.corner[1]) * light.density + HALF, ZERO), np.float32(high - 0.5))
    k = min(max((z - light.corner[2]) * light.density + HALF, ZERO), np.float32(deep - 0.5))
    i = min(max((x - light.corner[0]) * light.density + HALF, ZERO), np.float32(wide - 0.5))
    return np.uint64(6 * ((int(j) * deep + int(k)) * wide + int(i)))


@inlined
def facing(bright: Floats, first: np.uint64, nx: np.float32, ny: np.float32, nz: np.float32) -> np.float32:
    """Return how bright a surface with a unit normal is by the six values that begin at `first`."""
    a, b, c = np.uint64(nx < ZERO), np.uint64(2 + (ny < ZERO)), np.uint64(4 + (nz < ZERO))
    wx, wy, wz = nx * nx, ny * ny, nz * nz
    total = wx * bright[first + a] + wy * bright[first + b] + wz * bright[first + c]
    return total / (wx + wy + wz + TINY)  # type: ignore[no-any-return]  # Numba's float is NumPy's.
