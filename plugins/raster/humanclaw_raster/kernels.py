"""The inner loops, compiled by Numba: what is in view, which triangle each pixel shows, how open it lies, its colour.

Camera frame: x right, y down, z forward, metres. Pixel (row, column) is looked at through its middle. Arithmetic is
strict (no fast-math) and in one fixed order, so that the same input gives the same bytes.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from humanclaw.body import Array
from humanclaw_raster.packing import LEVELS, Floats, Model

NEAR: Final = 0.02
"""What is closer to the eye than this is cut away, metres."""
SUN: Final = (0.505, 0.808, 0.303)
"""Direction towards the light, oblique to both axes of a house, so that its walls differ in brightness."""
UPLIFT: Final = 0.6
"""Normals are lifted by this much before shading, as light that comes from above and bounces all round would: without
it every face that is turned away from the sun would have one and the same darkness, and corners between them would
vanish."""
BOUNCE: Final = 0.5
"""Faces that look down are lit by the floor, with this share of what it gets."""
AMBIENT: Final = 0.6
DIFFUSE: Final = 0.45
REACH: Final = 0.45
"""Surfaces within this distance of each other take each other's light, metres."""
DARKEST: Final = 0.4
"""Share of the light that is left in the deepest corner."""
DEPTH_OF_CORNERS: Final = 1.6
"""How much of the light the taken share of the neighbourhood takes away."""
RAYS: Final = 8
"""Samples of the neighbourhood a pixel; 16 pixels of a square take 16 different sets and are then averaged."""
SHADE: Final = 0.6
"""Share of the light that a place loses of which all the sky is taken."""
CONE: Final = 0.6
"""Light comes down from within this distance aside, metres, ..."""
STEEP: Final = 0.9
"""... at least this steeply, as metres down for each metre aside."""
SUN_SIZE: Final = 0.12
"""How far the sun reaches to the sides, seen from one metre below: the softness of shadows."""
TALLEST: Final = 2.1
"""Walls and whatever else reaches higher over its floor than this throws no shadow: it would be beyond the lamps.
Metres."""
LEAN: Final = 0.08
"""Neighbours less steep than this above the surface do not count: they are the surface itself, seen with rounding."""


SURFACE: Final = 27
FLAT: Final = 8
"""Numbers that _prepare writes, and where among them the normal of the face begins."""


class Pinhole(NamedTuple):
    """A pinhole camera: intrinsics and pose."""

    eye: Array
    """(3,) world frame."""
    axes: Array
    """(3, 3) rows: right, down, forward."""
    focal: float
    """In pixels."""


class Instances(NamedTuple):
    """The meshes of a model, put somewhere. N instances."""

    mesh: NDArray[np.int32]
    id: NDArray[np.int32]
    shown: NDArray[np.bool_]
    turn: Array
    """(N, 3, 3) rotation from the mesh's frame to the world."""
    place: Array
    """(N, 3) world frame."""


class OverheadMap(NamedTuple):
    """Height maps from above. S storeys."""

    heights: Floats
    """(S, Z, X) world height of the highest surface over each cell, minus infinity where there is none."""
    floors: Array
    """(S,) heights of the floors, ascending."""
    corner: Array
    """(2,) least x and z of the maps."""
    cell: float
    """Side of a cell, metres."""


class GBuffer(NamedTuple):
    """What each pixel shows, all (H, W). Where nothing is, inverse_depth is 0, and face and instance are -1."""

    inverse_depth: Floats
    face: NDArray[np.int32]
    instance: NDArray[np.int32]


def _compiled(function: Callable[..., Any]) -> Callable[..., Any]:
    """Machine code, kept on disk beside the source or in the user's cache; compiled anew where neither can be
    written."""
    how: Any = {"error_model": "numpy", "nogil": True}
    try:
        return njit(cache=True, **how)(function)  # type: ignore[no-any-return]
    except RuntimeError:
        return njit(**how)(function)  # type: ignore[no-any-return]


def _inlined(function: Callable[..., Any]) -> Callable[..., Any]:
    return njit(inline="always", error_model="numpy")(function)


@_compiled
def in_view(
    model: Model, instances: Instances, pinhole: Pinhole, width: int, height: int
) -> tuple[NDArray[np.int32], Floats]:
    """(K, 2) instance and cluster of all clusters that may be seen, and (K,) their least depths."""
    count = 0
    for instance in range(instances.mesh.size):
        count += model.meshes[instances.mesh[instance], 1] - model.meshes[instances.mesh[instance], 0]
    found, depth = np.empty((count, 2), np.int32), np.empty(count, np.float32)
    side, rise = width / 2 / pinhole.focal, height / 2 / pinhole.focal
    side_slant, rise_slant = np.sqrt(1 + side * side), np.sqrt(1 + rise * rise)
    count = 0
    for instance in range(instances.mesh.size):
        if not instances.shown[instance]:
            continue
        to_camera, shift = _placed(instances, instance, pinhole)
        for cluster in range(model.meshes[instances.mesh[instance], 0], model.meshes[instances.mesh[instance], 1]):
            x, y, z = _moved(to_camera, shift, model.spheres[cluster])
            radius = model.spheres[cluster, 3]
            behind = z + radius < NEAR
            if behind or abs(x) - side * z > radius * side_slant or abs(y) - rise * z > radius * rise_slant:
                continue
            found[count, 0], found[count, 1] = instance, cluster
            depth[count] = z - radius
            count += 1
    return found[:count], depth[:count]


@_compiled
def _placed(instances: Instances, instance: int, pinhole: Pinhole) -> tuple[Array, Array]:
    """Rotation and shift from the frame of an instance's mesh to that of the camera."""
    turn, shift = np.zeros((3, 3)), np.zeros(3)
    for a in range(3):
        for b in range(3):
            shift[a] += pinhole.axes[a, b] * (instances.place[instance, b] - pinhole.eye[b])
            for c in range(3):
                turn[a, b] += pinhole.axes[a, c] * instances.turn[instance, c, b]
    return turn, shift


@_compiled
def _moved(turn: Array, shift: Array, point: Floats) -> tuple[float, float, float]:
    return (
        turn[0, 0] * point[0] + turn[0, 1] * point[1] + turn[0, 2] * point[2] + shift[0],
        turn[1, 0] * point[0] + turn[1, 1] * point[1] + turn[1, 2] * point[2] + shift[1],
        turn[2, 0] * point[0] + turn[2, 1] * point[1] + turn[2, 2] * point[2] + shift[2],
    )


@_compiled
def draw(model: Model, instances: Instances, pinhole: Pinhole, order: NDArray[np.int32], gbuffer: GBuffer) -> None:
    """Fill the G-buffer with the nearest triangles, both sides of a face. order: (K, 2) as from in_view, nearest
    first."""
    seen, flat = np.empty((3, 3)), np.empty((4, 3))
    for item in range(order.shape[0]):
        instance, cluster = order[item]
        turn, shift = _placed(instances, instance, pinhole)
        for face in range(model.clusters[cluster, 0], model.clusters[cluster, 1]):
            for corner in range(3):
                seen[corner] = _moved(turn, shift, model.corners[face, corner])
            count = _project(seen, pinhole.focal, gbuffer.inverse_depth.shape, flat)
            for last in range(2, count):
                _fill(flat[0], flat[last - 1], flat[last], face, instance, gbuffer)


@_compiled
def _project(seen: Array, focal: float, shape: tuple[int, int], flat: Array) -> int:
    """Cut a triangle at the near plane; returns the number of corners left, written as column, row and
    inverse_depth."""
    count = 0
    for corner in range(3):
        here, there = seen[corner], seen[(corner + 1) % 3]
        if here[2] >= NEAR:
            flat[count, 0] = shape[1] / 2 + focal * here[0] / here[2]
            flat[count, 1] = shape[0] / 2 + focal * here[1] / here[2]
            flat[count, 2] = 1 / here[2]
            count += 1
        if (here[2] >= NEAR) != (there[2] >= NEAR):
            # From the visible end to the other, whichever comes first: neighbours cut their common side at one point.
            a, b = (here, there) if here[2] >= NEAR else (there, here)
            part = (NEAR - a[2]) / (b[2] - a[2])
            flat[count, 0] = shape[1] / 2 + focal * (a[0] + part * (b[0] - a[0])) / NEAR
            flat[count, 1] = shape[0] / 2 + focal * (a[1] + part * (b[1] - a[1])) / NEAR
            flat[count, 2] = 1 / NEAR
            count += 1
    return count


@_compiled
def _fill(a: Array, b: Array, c: Array, face: int, instance: int, gbuffer: GBuffer) -> None:
    """Row by row. A pixel belongs to a triangle if its middle does; of two triangles with a common side exactly one has
    it."""
    height, width = gbuffer.inverse_depth.shape
    x0, y0, w0, x1, y1, w1, x2, y2, w2 = a[0], a[1], a[2], b[0], b[1], b[2], c[0], c[1], c[2]
    area = (x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0)
    top = max(0, int(np.ceil(max(min(y0, y1, y2), 0.0) - 0.5)))
    bottom = int(np.ceil(min(max(y0, y1, y2), float(height)) - 0.5))
    if area == 0.0 or top >= bottom or max(x0, x1, x2) <= 0.5 or min(x0, x1, x2) > width - 0.5:
        return
    across = ((w1 - w0) * (y2 - y0) - (w2 - w0) * (y1 - y0)) / area
    down = ((w2 - w0) * (x1 - x0) - (w1 - w0) * (x2 - x0)) / area
    corner = w0 + (0.5 - x0) * across + (0.5 - y0) * down
    # Corners from top to bottom, so that neighbours compute their common side in the same way, to the last bit.
    if y1 < y0 or (y1 == y0 and x1 < x0):
        x0, y0, x1, y1 = x1, y1, x0, y0
    if y2 < y0 or (y2 == y0 and x2 < x0):
        x0, y0, x2, y2 = x2, y2, x0, y0
    if y2 < y1 or (y2 == y1 and x2 < x1):
        x1, y1, x2, y2 = x2, y2, x1, y1
    step = np.float32(across)
    for row in range(top, bottom):
        y = row + 0.5
        long = x0 + (y - y0) * ((x2 - x0) / (y2 - y0))
        short = x0 + (y - y0) * ((x1 - x0) / (y1 - y0)) if y < y1 else x1 + (y - y1) * ((x2 - x1) / (y2 - y1))
        left = int(np.ceil(max(min(long, short), 0.0) - 0.5))
        right = int(np.ceil(min(max(long, short), float(width)) - 0.5))
        start = np.float32(corner + row * down)
        for column in range(left, right):
            inverse_depth = start + step * np.float32(column)
            if inverse_depth > gbuffer.inverse_depth[row, column]:
                gbuffer.inverse_depth[row, column] = inverse_depth
                gbuffer.face[row, column] = face
                gbuffer.instance[row, column] = instance


@_compiled
def ambient_occlusion(
    model: Model, instances: Instances, pinhole: Pinhole, gbuffer: GBuffer, overhead: OverheadMap
) -> Floats:
    """(H / 2, W / 2) share of the light that reaches every second pixel.

    Ambient occlusion in screen space takes the light of corners; instances over a place take the light that falls on it
    from above.
    """
    height, width = (gbuffer.inverse_depth.shape[0] + 1) // 2, (gbuffer.inverse_depth.shape[1] + 1) // 2
    depth, normals = np.empty((height, width), np.float32), np.zeros((height, width, 3), np.float32)
    surface, last, owner = np.empty(SURFACE), -1, -1
    for row in range(height):
        for column in range(width):
            depth[row, column] = 1 / gbuffer.inverse_depth[2 * row, 2 * column]
            face, instance = gbuffer.face[2 * row, 2 * column], gbuffer.instance[2 * row, 2 * column]
            if instance < 0:
                continue
            if face != last or instance != owner:
                _prepare(model, instances, pinhole, face, instance, surface)
                last, owner = face, instance
            for axis in range(3):
                normals[row, column, axis] = surface[FLAT + axis]
    light = _occlusion(depth, normals, pinhole.focal / 2)
    _shadow(depth, normals, pinhole, overhead, light)
    return _smoothed(light, depth, normals)  # type: ignore[no-any-return]


@_compiled
def _occlusion(depth: Floats, normals: Floats, focal: float) -> Floats:
    height, width = depth.shape
    out, swing = np.ones((height, width), np.float32), _swing()
    closeness = np.float32(1 / (REACH * REACH))
    for row in range(height):
        for column in range(width):
            z = depth[row, column]
            if z == np.inf:
                continue
            scale, mid, centre = np.float32(1 / focal), np.float32(width / 2 - 0.5), np.float32(height / 2 - 0.5)
            x, y = (column - mid) * scale * z, (row - centre) * scale * z
            a, b, c = normals[row, column]
            radius = min(max(np.float32(focal * REACH) / z, np.float32(2)), np.float32(width / 8))
            turn, taken = (row % 4) * 4 + column % 4, np.float32(0)
            for ray in range(RAYS):
                r = int(row + swing[turn, ray, 0] * radius + 100.5) - 100
                c_ = int(column + swing[turn, ray, 1] * radius + 100.5) - 100
                if r < 0 or c_ < 0 or r >= height or c_ >= width:
                    continue
                far = depth[r, c_]
                dx, dy, dz = (c_ - mid) * scale * far - x, (r - centre) * scale * far - y, far - z
                square = dx * dx + dy * dy + dz * dz
                fade = np.float32(1) - square * closeness
                if fade > 0 and square > 1e-9:
                    taken += max(np.float32(0), (dx * a + dy * b + dz * c) / np.sqrt(square) - LEAN) * fade
            out[row, column] = max(DARKEST, 1 - DEPTH_OF_CORNERS * taken / RAYS)  # type: ignore[call-overload]
    return out


@_compiled
def _shadow(depth: Floats, normals: Floats, pinhole: Pinhole, overhead: OverheadMap, light: Floats) -> None:
    """Darken what lies under or close beside something, and what something keeps the sun from.

    Light comes down in a cone, for which surfaces that face up are open, and from the sun.
    """
    height, width = depth.shape
    axes, eye, swing = pinhole.axes, pinhole.eye, _swing()
    for row in range(height):
        for column in range(width):
            n, z = normals[row, column], depth[row, column]
            if z == np.inf:
                continue
            up = n[0] * axes[0, 1] + n[1] * axes[1, 1] + n[2] * axes[2, 1]
            lit = up * SUN[1]
            for axis in (0, 2):
                lit += SUN[axis] * (n[0] * axes[0, axis] + n[1] * axes[1, axis] + n[2] * axes[2, axis])
            if up < 0.2 and lit < 0.05:
                continue
            right, down = (2 * column + 0.5 - width) / pinhole.focal * z, (2 * row + 0.5 - height) / pinhole.focal * z
            x = (eye[0] + right * axes[0, 0] + down * axes[1, 0] + z * axes[2, 0] - overhead.corner[0]) / overhead.cell
            y = eye[1] + right * axes[0, 1] + down * axes[1, 1] + z * axes[2, 1]
            z = (eye[2] + right * axes[0, 2] + down * axes[1, 2] + z * axes[2, 2] - overhead.corner[1]) / overhead.cell
            storey = 0
            while storey + 1 < overhead.floors.size and overhead.floors[storey + 1] < y + 0.1:
                storey += 1
            turn = (row % 4) * 4 + column % 4
            if up >= 0.2:
                light[row, column] *= 1 - SHADE * min(1.0, up) * _covered(overhead, storey, x, y, z, swing[turn])
            if lit >= 0.05 and _sun_blocked(overhead, storey, x, y, z, swing[turn, turn % RAYS]):
                light[row, column] *= AMBIENT / (AMBIENT + DIFFUSE * lit)


@_inlined
def _covered(overhead: OverheadMap, storey: int, x: float, y: float, z: float, swing: Floats) -> float:
    """Return the share of the cone over a point that something takes. x, z: in cells of the map."""
    taken = 0
    for ray in range(RAYS):
        aside, ahead = swing[ray, 0] * CONE, swing[ray, 1] * CONE
        i, j = int(z + ahead / overhead.cell), int(x + aside / overhead.cell)
        if i >= 0 and j >= 0 and i < overhead.heights.shape[1] and j < overhead.heights.shape[2]:
            over = overhead.heights[storey, i, j] - y
            taken += over > 0.03 and over * over > STEEP * STEEP * (aside * aside + ahead * ahead)
    return taken / RAYS


@_inlined
def _sun_blocked(overhead: OverheadMap, storey: int, x: float, y: float, z: float, aside: Floats) -> bool:
    """Return whether something stands between a point and a place on the sun, which lies aside of its middle."""
    east, north = SUN[0] / SUN[1] + SUN_SIZE * aside[0], SUN[2] / SUN[1] + SUN_SIZE * aside[1]
    blocked, stride = False, 1.5 * overhead.cell / np.sqrt(east * east + north * north)
    for step in range(1, int((TALLEST - y + overhead.floors[storey]) / stride)):
        rise = step * stride
        i, j = int(z + north * rise / overhead.cell), int(x + east * rise / overhead.cell)
        if i < 0 or j < 0 or i >= overhead.heights.shape[1] or j >= overhead.heights.shape[2]:
            break
        if overhead.heights[storey, i, j] > y + rise + 0.02:
            blocked = True
            break
    return blocked


@_compiled
def _swing() -> Floats:
    """(16, RAYS, 2) points in the unit disk, spread by the golden angle, in 16 turns."""
    out = np.empty((16, RAYS, 2), np.float32)
    for turn in range(16):
        for ray in range(RAYS):
            angle, reach = 2.399963 * ray + 2 * np.pi * (turn * 7 % 16) / 16, np.sqrt((ray + 0.5) / RAYS)
            out[turn, ray, 0], out[turn, ray, 1] = reach * np.sin(angle), reach * np.cos(angle)
    return out


@_compiled
def _smoothed(raw: Floats, depth: Floats, normals: Floats) -> Floats:
    """Return the mean over four by four neighbours that lie on the same surface: each of the 16 turns once."""
    height, width = raw.shape
    out = np.ones_like(raw)
    for row in range(height):
        for column in range(width):
            z, total, weight = depth[row, column], raw[row, column], np.float32(1)
            x, y, n = normals[row, column]
            for r in range(max(0, row - 2), min(height, row + 2)):
                for c in range(max(0, column - 2), min(width, column + 2)):
                    same = abs(depth[r, c] - z) < np.float32(0.05) * z
                    if same and normals[r, c, 0] * x + normals[r, c, 1] * y + normals[r, c, 2] * n > np.float32(0.8):
                        total += raw[r, c]
                        weight += np.float32(1)
            out[row, column] = total / weight
    return out


@_compiled
def paint(
    model: Model, instances: Instances, pinhole: Pinhole, gbuffer: GBuffer, light: Floats, rgb: NDArray[np.uint8]
) -> None:
    """Colour every pixel that shows something. light: as from ambient_occlusion. rgb: (H, W, 3), changed in place."""
    height, width = gbuffer.inverse_depth.shape
    s, last, owner = np.empty(SURFACE), -1, -1
    for row in range(height):
        down = (row + 0.5 - height / 2) / pinhole.focal
        for column in range(width):
            instance, face = gbuffer.instance[row, column], gbuffer.face[row, column]
            if instance < 0:
                continue
            if face != last or instance != owner:
                _prepare(model, instances, pinhole, face, instance, s)
                last, owner = face, instance
            depth, right = 1 / gbuffer.inverse_depth[row, column], (column + 0.5 - width / 2) / pinhole.focal
            here = _light_at(light, gbuffer, row, column)
            _colour(model, instances.mesh[instance], s, depth, right, down, here, rgb, row, column)


@_compiled
def smooth_edges(
    model: Model, instances: Instances, pinhole: Pinhole, gbuffer: GBuffer, coarse: GBuffer, light: Floats,
    sky: NDArray[np.uint8], rgb: NDArray[np.uint8],
) -> None:  # fmt: skip
    """Paint the pixels anew whose 2 x 2 samples do not all show one face: with the mean of the samples.

    pinhole, gbuffer: of the picture at twice its size. coarse, light: of the picture as it is. sky: (H, 3) its colours
    where nothing is. rgb: the picture as paint left it.
    """
    height, width = coarse.inverse_depth.shape
    s, last, owner = np.empty(SURFACE), -1, -1
    samples = np.empty((2, 2, 3), np.uint8)
    for row in range(height):
        for column in range(width):
            if _one_face(gbuffer, coarse, row, column):
                continue
            samples[:] = sky[row]
            for k in range(4):
                r, c = 2 * row + k // 2, 2 * column + k % 2
                instance, face = gbuffer.instance[r, c], gbuffer.face[r, c]
                if instance < 0:
                    continue
                if face != last or instance != owner:
                    _prepare(model, instances, pinhole, face, instance, s)
                    last, owner = face, instance
                down, right = (r + 0.5 - height) / pinhole.focal, (c + 0.5 - width) / pinhole.focal
                here = _light_near(light, coarse, gbuffer.inverse_depth[r, c], face, instance, row, column, 1)
                depth = 1 / gbuffer.inverse_depth[r, c]
                _colour(model, instances.mesh[instance], s, depth, right, down, here, samples, k // 2, k % 2)
            for channel in range(3):
                total = 2
                for k in range(4):
                    total += samples[k // 2, k % 2, channel]
                rgb[row, column, channel] = total // 4


@_compiled
def _prepare(model: Model, instances: Instances, pinhole: Pinhole, face: int, instance: int, out: Array) -> None:
    """Prepare what all pixels of a face share.

    0..7: the shares of the second and the third corner in a point of the face, each a constant and a gradient in the
    camera frame. 8..10: the unit normal of the face, towards the camera, camera frame. 11..19: the normal for shading,
    world frame, at the first corner and its change to the others. 20..25: uv likewise. 26: texels a pixel at a depth of
    one metre.
    """
    turn, shift = _placed(instances, instance, pinhole)
    px, py, pz = _moved(turn, shift, model.corners[face, 0])
    qx, qy, qz = _moved(turn, shift, model.corners[face, 1])
    rx, ry, rz = _moved(turn, shift, model.corners[face, 2])
    ux, uy, uz, vx, vy, vz = qx - px, qy - py, qz - pz, rx - px, ry - py, rz - pz
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    square = nx * nx + ny * ny + nz * nz + 1e-30
    out[1], out[2], out[3] = (vy * nz - vz * ny) / square, (vz * nx - vx * nz) / square, (vx * ny - vy * nx) / square
    out[5], out[6], out[7] = (ny * uz - nz * uy) / square, (nz * ux - nx * uz) / square, (nx * uy - ny * ux) / square
    out[0], out[4] = -(out[1] * px + out[2] * py + out[3] * pz), -(out[5] * px + out[6] * py + out[7] * pz)
    side = 1.0 if nx * px + ny * py + nz * pz < 0 else -1.0
    size = side / np.sqrt(square)
    out[8], out[9], out[10] = nx * size, ny * size, nz * size
    for axis in range(3):
        for corner in range(3):
            n = model.normals[face, corner]
            t = instances.turn[instance, axis]
            out[11 + 3 * corner + axis] = side * (t[0] * n[0] + t[1] * n[1] + t[2] * n[2])
        out[14 + axis] -= out[11 + axis]
        out[17 + axis] -= out[11 + axis]
    for axis in range(2):
        out[20 + axis] = model.uv[face, 0, axis]
        out[22 + axis] = model.uv[face, 1, axis] - model.uv[face, 0, axis]
        out[24 + axis] = model.uv[face, 2, axis] - model.uv[face, 0, axis]
    out[26] = model.density[face] / pinhole.focal


@_compiled
def _one_face(gbuffer: GBuffer, coarse: GBuffer, row: int, column: int) -> bool:
    """Whether all samples of a pixel, the middle one included, show the same face."""
    face, instance = coarse.face[row, column], coarse.instance[row, column]
    for r in range(2 * row, 2 * row + 2):
        for c in range(2 * column, 2 * column + 2):
            if gbuffer.face[r, c] != face or gbuffer.instance[r, c] != instance:
                return False
    return True


@_inlined
def _colour(
    model: Model, mesh: int, s: Array, depth: float, right: float, down: float, light: float,
    rgb: NDArray[np.uint8], row: int, column: int,
) -> None:  # fmt: skip
    """Write the colour of a point of the face that s was prepared for, seen at (right, down) on the plane z = 1."""
    b = min(1.0, max(0.0, s[0] + depth * (s[1] * right + s[2] * down + s[3])))
    c = min(1.0 - b, max(0.0, s[4] + depth * (s[5] * right + s[6] * down + s[7])))
    bright = _lit(s[11] + b * s[14] + c * s[17], s[12] + b * s[15] + c * s[18], s[13] + b * s[16] + c * s[19])
    u, v = s[20] + b * s[22] + c * s[24], s[21] + b * s[23] + c * s[25]
    _texture(model, mesh, u, v, s[26] * depth, bright * light, rgb, row, column)


@_inlined
def _texture(
    model: Model, mesh: int, u: float, v: float, footprint: float, bright: float,
    rgb: NDArray[np.uint8], row: int, column: int,
) -> None:  # fmt: skip
    """Write the colour between four texels, in the size where a pixel covers about one. footprint: texels a pixel."""
    level = 0
    while footprint > 1.5 and level < LEVELS - 1:
        footprint *= 0.5
        level += 1
    first, height, width = model.levels[mesh, level, 0], model.levels[mesh, level, 1], model.levels[mesh, level, 2]
    x, y = (u - np.floor(u)) * width - 0.5, (np.ceil(v) - v) * height - 0.5
    left, upper = int(np.floor(x)), int(np.floor(y))
    east, south = np.float32(x - left), np.float32(y - upper)
    right, lower = (left + 1 if left + 1 < width else 0), (upper + 1 if upper + 1 < height else 0)
    left, upper = (left if left >= 0 else width - 1), (upper if upper >= 0 else height - 1)
    a, b = first + upper * width + left, first + upper * width + right
    c, d = first + lower * width + left, first + lower * width + right
    west, north, scale = np.float32(1) - east, np.float32(1) - south, np.float32(bright)
    for channel in range(3):
        high = model.texels[a, channel] * west + model.texels[b, channel] * east
        low = model.texels[c, channel] * west + model.texels[d, channel] * east
        tone = (high * north + low * south) * scale + np.float32(0.5)
        rgb[row, column, channel] = min(tone, np.float32(255))


@_inlined
def _lit(x: float, y: float, z: float) -> float:
    """Return the brightness of a surface from its normal in the world, before what stands around it is counted."""
    y = (-BOUNCE * y if y < 0 else y) + UPLIFT
    size = np.sqrt(x * x + y * y + z * z) + 1e-20
    return AMBIENT + DIFFUSE * max(0.0, (x * SUN[0] + y * SUN[1] + z * SUN[2]) / size)  # type: ignore[no-any-return]


@_inlined
def _light_at(light: Floats, gbuffer: GBuffer, row: int, column: int) -> float:
    """Return the light of a pixel, between the samples beside it."""
    if row % 2 == 0 and column % 2 == 0:
        return light[row // 2, column // 2]  # type: ignore[no-any-return]
    face, instance = gbuffer.face[row, column], gbuffer.instance[row, column]
    return _light_near(light, gbuffer, gbuffer.inverse_depth[row, column], face, instance, row, column, 0)  # type: ignore[no-any-return]


@_compiled
def _light_near(
    light: Floats, gbuffer: GBuffer, here: float, face: int, instance: int, row: int, column: int, wide: int
) -> float:
    """Return the light of the nearest samples for a face at an inverse depth in a pixel, each by how near it is and
    whether it lies on the same face. wide: 1 to take those on both sides of a pixel that is one of them itself."""
    total, weight = np.float32(1e-6), np.float32(1e-6)
    for r in range(max((row - wide) // 2, 0), min((row + 1 + wide) // 2 + 1, light.shape[0])):
        for c in range(max((column - wide) // 2, 0), min((column + 1 + wide) // 2 + 1, light.shape[1])):
            near = here / (here + 40 * abs(gbuffer.inverse_depth[2 * r, 2 * c] - here)) + np.float32(1e-4)
            if gbuffer.face[2 * r, 2 * c] != face or gbuffer.instance[2 * r, 2 * c] != instance:
                near *= np.float32(0.05)
            total += near * light[r, c]
            weight += near
    return total / weight  # type: ignore[return-value]
