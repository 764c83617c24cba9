"""Bake the light of a scene: windows and lamps as area lights, light that surfaces pass on, one grid of probes.

A probe keeps how bright it makes a surface that faces each of six ways (Valve's ambient cube, McTaggart 2004).
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from humanclaw.body import Array
from humanclaw.world import compiled, internal
from humanclaw_raster.buffers import GOLDEN
from humanclaw_raster.packing import Floats

SPACING: Final = 0.24
"""Distance of probes, metres, two voxels. Larger in scenes that would need more than MOST, whose rays take 80 MB."""
MOST: Final = 250_000
"""Probes of a scene at most."""
RAYS: Final = 40
"""Of a probe. With 640, which take five times as long, brightness differs by .4 %."""
BOUNCES: Final = 3
"""Brightness is 1.3 % from that of eight bounces; with two it is 2.4 %."""
REACH: Final = 10.0
"""Places farther from the box around all lights get the light of its side, metres. A ground of 3 km cost .9 GB."""
OPEN: Final = 0.25
"""Share of the rays outdoors that meet nothing, at least: half do on open ground, a quarter before a wall."""
BRIGHTEST: Final = 0.75
"""Largest albedo: white paint and tiles."""
_STEP: Final = 0.75
"""Of a ray, voxels: below 1, or it would pass through thin walls."""
_SHORT: Final = 2.5
"""A probe whose rays are shorter than this in the mean is inside an object, voxels: 30 cm, as in a cupboard."""
_BEFORE: Final = 0.2
"""Rays to a light end this far before it, because its own voxels are solid, metres: their diagonal."""
_FAINT: Final = 1e-4
"""Light of a small light that counts for nothing. Ten times as much would change brightness by .7 %, this by none."""


class Lights(NamedTuple):
    """N small lights; a window is many of them."""

    place: Array
    """(N, 3) metres."""
    way: Array
    """(N, 3) unit vector along which it shines, as a pane does; zero if it shines to all sides."""
    power: Array
    """(N,) irradiance / pi at a distance of one metre."""


class Voxels(NamedTuple):
    """Which places are solid."""

    albedo: NDArray[np.uint8]
    """(Y, Z, X) 0 where it is empty, otherwise 1 to 255 for an albedo up to 1."""
    corner: Array
    """(3,) metres."""
    size: float
    """Side of a voxel, metres."""

    @property
    def shape(self) -> tuple[int, ...]:
        """Y, Z, X: number of probes along each axis."""
        return tuple(side // 2 for side in self.albedo.shape)


def voxels(triangles: Floats, albedo: Floats, lights: Array) -> Voxels:
    """Return the voxels of (T, 3, 3) triangles with (T,) albedos, as far as (N, 3) places of lights reach."""
    points = np.concatenate([triangles.reshape(-1, 3), lights.astype(np.float32)])
    low = np.maximum(points.min(axis=0) - SPACING, lights.min(axis=0) - REACH)
    high = np.minimum(points.max(axis=0) + SPACING, lights.max(axis=0) + REACH)
    size = SPACING / 2
    # Eight voxels to a probe, two along each axis.
    while np.prod(shape := 2 * np.ceil((high - low) / (2 * size)).astype(int)) > 8 * MOST:
        size *= 1.02
    solid = np.zeros((shape[1], shape[2], shape[0]), np.uint8)
    a, b, c = np.moveaxis(triangles, 1, 0)
    longest = np.maximum.reduce([_square(a - b), _square(b - c), _square(c - a)]).astype(float)
    steps = (np.sqrt(longest) / (0.6 * size)).astype(int) + 1  # So close that no voxel is left out.
    # From 1, because 0 is empty.
    tones = (1 + 254 * np.clip(albedo.astype(float), 0.0, BRIGHTEST)).astype(np.uint8)
    _fill(solid, triangles, steps, tones, low, size)
    return Voxels(solid, low, size)


def _square(vectors: Floats) -> Floats:
    x, y, z = vectors.T
    return np.asarray(x * x + y * y + z * z)


@compiled
def _fill(
    solid: NDArray[np.uint8], triangles: Floats, counts: NDArray[np.int64], tones: NDArray[np.uint8], corner: Array,
    size: float,
) -> None:  # fmt: skip
    sides, start, way = (solid.shape[2], solid.shape[0], solid.shape[1]), np.empty(3), np.empty(3)
    for face in range(triangles.shape[0]):
        a, b, c = triangles[face]
        steps = counts[face]
        for i in range(steps + 1):
            # Of a row only what lies in the space: a ground may be kilometres wide.
            near, far = 0.0, float(steps - i)
            for axis in range(3):
                start[axis] = (a[axis] + (b[axis] - a[axis]) * (i / steps) - corner[axis]) / size
                # Never 0, because the space is cut by dividing by it.
                way[axis] = (c[axis] - a[axis]) / steps / size + 1e-12
                enter, leave = -start[axis] / way[axis], (sides[axis] - start[axis]) / way[axis]
                near, far = max(near, min(enter, leave)), min(far, max(enter, leave))
            for j in range(int(np.ceil(near)), int(far) + 1):
                x, y, z = start[0] + j * way[0], start[1] + j * way[1], start[2] + j * way[2]
                if x < sides[0] and y < sides[1] and z < sides[2]:
                    solid[int(y), int(z), int(x)] = tones[face]


def bake(space: Voxels, lights: Lights, sky: float, indoors: NDArray[np.bool_] | None) -> Floats:
    """Return (Y, Z, X, 6) irradiance / pi on surfaces that face +x, -x, +y, -y, +z, -z; NaN far from rooms.

    sky: radiance where a ray leaves the scene. indoors: (Y, Z, X) which probes count: others get what those have. None
    for those that see little of the sky, or for all if there is none.
    """
    count, ways = int(np.prod(space.shape)), _spread(RAYS)
    direct, free = np.zeros((count, 6)), np.zeros(count)
    hit, albedo = np.full((count, RAYS), -1, np.int32), np.zeros((count, RAYS), np.float32)
    _trace(space.albedo, ways, hit, albedo, free)
    valid = free > _SHORT
    inside = (hit < 0).mean(axis=1) < OPEN if indoors is None else indoors.ravel()
    kept = valid & inside if inside[valid].any() or indoors is not None else valid
    lit = kept.copy()
    for _ in range(BOUNCES):
        lit[hit[lit]] = True  # Those that pass light on to probes that are kept; the others take as long.
    _shine(space, lights, np.flatnonzero(lit), direct)
    light = direct.copy()
    for _ in range(BOUNCES):
        passed = np.zeros_like(direct)
        _gather(light, free, ways, hit, albedo, sky, passed)
        light = direct + passed
    light[~kept] = np.nan
    return _filled(_blurred(light.reshape(*space.shape, 6), space.albedo == 0)).astype(np.float32)


def _spread(count: int) -> Array:
    """Return (N, 3) unit vectors spread evenly over the sphere."""
    height = 1 - (2 * np.arange(count) + 1) / count
    angle = GOLDEN * np.arange(count)
    flat = np.sqrt(1 - height * height)
    return np.stack([flat * np.cos(angle), height, flat * np.sin(angle)], axis=1)


@compiled
def _shine(space: Voxels, lights: Lights, lit: NDArray[np.int64], direct: Array) -> None:
    """Add the light of all lights to the probes with these numbers."""
    (solid, corner, size), (place, way, power) = space, lights
    depth, width = solid.shape[1] // 2, solid.shape[2] // 2
    start, to, end = np.empty(3), np.empty(3), 0.0
    for number in lit:
        start[0] = 2 * (number % width) + 1
        start[1], start[2] = 2 * (number // (depth * width)) + 1, 2 * (number // width % depth) + 1
        for light in range(power.size):
            square, toward, flat = 1e-6, 0.0, False
            for axis in range(3):
                to[axis] = place[light, axis] - corner[axis] - start[axis] * size
                square += to[axis] * to[axis]
                toward -= to[axis] * way[light, axis]
                flat |= way[light, axis] != 0
            far = np.sqrt(square)
            strength = power[light] * (toward / far if flat else 1.0) / max(square, 0.1)  # Lamps have a size.
            if strength > _FAINT:
                # Most lights are behind the wall that the one before is behind.
                end = _end(solid, start, to, max(far - _BEFORE, 0.0) / far / size, end)
                for axis in range(3 if end == 1 else 0):
                    direct[number, 2 * axis + (to[axis] < 0)] += strength * abs(to[axis]) / far


@internal
def _end(solid: NDArray[np.uint8], start: Array, to: Array, share: float, likely: float) -> float:
    """Return how much of the way from a place in voxels along a share of a vector ends at something solid, 1 if none.

    likely: the part at whose end is looked first.
    """
    dx, dy, dz = to[0] * share, to[1] * share, to[2] * share
    steps = int(np.sqrt(dx * dx + dy * dy + dz * dz) / _STEP) + 1
    near = int(likely * steps)
    for first, last in ((max(near, 1), min(near + 2, steps)), (1, steps)):
        for k in range(first, last):
            part = k / steps
            x, y, z = int(start[0] + dx * part), int(start[1] + dy * part), int(start[2] + dz * part)
            if solid[np.uint64(y), np.uint64(z), np.uint64(x)]:
                return part
    return 1.0


@compiled
def _trace(solid: NDArray[np.uint8], ways: Array, hit: NDArray[np.int32], albedo: Floats, free: Array) -> None:
    """Note which probe is before the place that each ray of each probe hits, and its albedo; -1 where it hits nothing.

    free: mean length of a probe's rays, voxels.
    """
    (high, deep, wide), width, depth = solid.shape, solid.shape[2] // 2, solid.shape[1] // 2
    for number in range(hit.shape[0]):
        y, z, x = 2.0 * (number // (depth * width)) + 1, 2.0 * (number // width % depth) + 1, 2.0 * (number % width) + 1
        if solid[int(y), int(z), int(x)]:
            continue
        total = 0.0
        for ray in range(ways.shape[0]):
            dx, dy, dz = ways[ray, 0] * _STEP, ways[ray, 1] * _STEP, ways[ray, 2] * _STEP
            px, py, pz, steps = x, y, z, 0
            while True:
                qx, qy, qz = px + dx, py + dy, pz + dz
                if not (0 <= qx < wide and 0 <= qy < high and 0 <= qz < deep):
                    break
                tone = solid[np.uint64(int(qy)), np.uint64(int(qz)), np.uint64(int(qx))]
                if tone:
                    # The probe of the last place may be inside the wall: then the one before it.
                    while solid[int(py) // 2 * 2 + 1, int(pz) // 2 * 2 + 1, int(px) // 2 * 2 + 1]:
                        px, py, pz = px - dx, py - dy, pz - dz
                    hit[number, ray] = (int(py) // 2 * depth + int(pz) // 2) * width + int(px) // 2
                    albedo[number, ray] = np.float32(tone - 1) / np.float32(254)
                    break
                px, py, pz, steps = qx, qy, qz, steps + 1
            total += steps * _STEP
        free[number] = total / ways.shape[0]


@compiled
def _gather(
    light: Array, free: Array, ways: Array, hit: NDArray[np.int32], albedo: Floats, sky: float, out: Array
) -> None:
    """Add (N, 6) the light that surfaces pass on to each probe once more."""
    count = ways.shape[0]
    for number in range(hit.shape[0]):
        for ray in range(count if free[number] > 0 else 0):
            before = hit[number, ray]
            if before < 0:
                bright = sky if ways[ray, 1] > 0 else 0.4 * sky  # The ground outdoors reflects it.
            else:
                bright = 0.0
                for axis in range(3):
                    toward = ways[ray, axis]
                    bright += toward * toward * light[before, 2 * axis + (toward > 0)]
                bright *= albedo[number, ray]
            for axis in range(3):
                toward = ways[ray, axis]
                out[number, 2 * axis + (toward < 0)] += 4 / count * abs(toward) * bright  # 4 pi / count, over pi.


def _blurred(light: Array, empty: NDArray[np.bool_]) -> Array:
    """Mix probes with their neighbours where nothing is between: rays in few directions leave a pattern."""
    for axis in (0, 1, 2) * 2:
        near, way = np.moveaxis(light.copy(), axis, 0), np.moveaxis(empty, axis, 0)[:, 1::2, 1::2]
        clear = way[1:-2:2] & way[2:-1:2] & way[3::2] & ~np.isnan(near[:-1, ..., 0]) & ~np.isnan(near[1:, ..., 0])
        # With the opposite step these are weights of 1, 2 and 1.
        step = np.where(clear[..., None], 0.25 * (near[1:] - near[:-1]), 0.0)
        near[:-1] += step
        near[1:] -= step
        light = np.moveaxis(near, 0, axis)
    return light


def _filled(light: Array) -> Array:
    """Give probes in walls and objects what their neighbours have: facing a way, the one on that side, or else those
    beside it. The one behind may be in another room."""
    for _ in range(3):
        padded = np.pad(light, ((1, 1), (1, 1), (1, 1), (0, 0)), constant_values=np.nan)
        around = [np.roll(padded, -sign, axis)[1:-1, 1:-1, 1:-1] for axis in (2, 0, 1) for sign in (1, -1)]
        facing = np.stack([side[..., face] for face, side in enumerate(around)], axis=-1)
        for face in range(6):
            around[face ^ 1][..., face] = np.nan
        known = np.maximum(sum(~np.isnan(side) for side in around), 1e-9)
        mean = sum(np.nan_to_num(side) for side in around) / known
        near = np.where(np.isnan(facing), np.where(known < 1, np.nan, mean), facing)
        light = np.where(np.isnan(light), near, light)
    return light
