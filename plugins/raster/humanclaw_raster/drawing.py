"""Draw triangles into the depth and face buffers."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from humanclaw.body import Array
from humanclaw.world import compiled, internal
from humanclaw_raster.buffers import NEAR, Instances, Pinhole
from humanclaw_raster.packing import Floats, Model


@compiled
def in_view(
    model: Model, instances: Instances, pinhole: Pinhole, width: int, height: int
) -> tuple[NDArray[np.int32], Floats]:
    """Return (K, 2) instance and cluster of all clusters that may be visible, and (K,) their smallest depths."""
    count = 0
    for instance in range(instances.mesh.size):
        count += model.meshes[instances.mesh[instance], 1] - model.meshes[instances.mesh[instance], 0]
    drawn, depth = np.empty((count, 2), np.int32), np.empty(count, np.float32)
    side, rise = width / 2 / pinhole.focal, height / 2 / pinhole.focal
    side_slant, rise_slant = np.sqrt(1 + side * side), np.sqrt(1 + rise * rise)
    count = 0
    for instance in range(instances.mesh.size):
        to_camera, shift = place_model(instances, instance, pinhole)
        for cluster in range(model.meshes[instances.mesh[instance], 0], model.meshes[instances.mesh[instance], 1]):
            x, y, z = move_point(to_camera, shift, model.spheres[cluster])
            radius = model.spheres[cluster, 3]
            # A sphere outside one of the four side planes is invisible; the slant is the length of a plane's normal.
            behind = z + radius < NEAR
            if behind or abs(x) - side * z > radius * side_slant or abs(y) - rise * z > radius * rise_slant:
                continue
            drawn[count, 0], drawn[count, 1] = instance, cluster
            depth[count] = z - radius
            count += 1
    return drawn[:count], depth[:count]


@internal
def place_model(instances: Instances, instance: int, pinhole: Pinhole) -> tuple[Array, Array]:
    """Return rotation and shift from the frame of an instance's mesh to that of the camera."""
    turn, shift = np.zeros((3, 3)), np.zeros(3)
    for a in range(3):
        for b in range(3):
            shift[a] += pinhole.axes[a, b] * (instances.place[instance, b] - pinhole.eye[b])
            for c in range(3):
                turn[a, b] += pinhole.axes[a, c] * instances.turn[instance, c, b]
    return turn, shift


@internal
def move_point(turn: Array, shift: Array, point: Floats) -> tuple[float, float, float]:
    return (
        turn[0, 0] * point[0] + turn[0, 1] * point[1] + turn[0, 2] * point[2] + shift[0],
        turn[1, 0] * point[0] + turn[1, 1] * point[1] + turn[1, 2] * point[2] + shift[1],
        turn[2, 0] * point[0] + turn[2, 1] * point[1] + turn[2, 2] * point[2] + shift[2],
    )


@compiled
def draw(
    model: Model, instances: Instances, pinhole: Pinhole, order: NDArray[np.int32],
    inverse_depth: Floats, surface: NDArray[np.int32],
) -> NDArray[np.int32]:  # fmt: skip
    """Fill two buffers of a GBuffer with the nearest triangles, both sides of each face, and return its faces.

    order: (C, 2) as from in_view. Nearest first is fastest, because hidden clusters are then skipped. inverse_depth,
    surface: changed in place.
    """
    count = np.int64(0)  # A literal 0 would compile what takes it twice.
    for item in range(order.shape[0]):
        count += model.clusters[order[item, 1], 1] - model.clusters[order[item, 1], 0]
    faces, count = np.empty((count, 2), np.int32), np.int64(0)
    for item in range(order.shape[0]):
        instance, cluster = order[item]
        # Another type of number would compile it twice.
        turn, shift = place_model(instances, np.int64(instance), pinhole)
        if _hidden(turn, shift, model.spheres[cluster], pinhole.focal, inverse_depth):
            continue
        for face in range(model.clusters[cluster, 0], model.clusters[cluster, 1]):
            if _triangle(model, turn, shift, pinhole, face, count, inverse_depth, surface):
                faces[count, 0], faces[count, 1] = face, instance
                count += 1
    return faces[:count]


@internal
def _hidden(turn: Array, shift: Array, sphere: Floats, focal: float, inverse_depth: Floats) -> bool:
    """Return whether all pixels that a sphere may cover already show a nearer surface."""
    x, y, z = move_point(turn, shift, sphere)
    if z - sphere[3] < NEAR:
        return False
    top, bottom = _extent(y, z, sphere[3], focal, inverse_depth.shape[0])
    left, right = _extent(x, z, sphere[3], focal, inverse_depth.shape[1])
    # A little nearer than the sphere, because depths are rounded.
    nearest, farther = np.float32(1.0001 / (z - sphere[3])), 0
    for row in range(top, bottom):
        for column in range(left, right):
            farther += inverse_depth[row, np.uint64(column)] < nearest
        if farther:
            return False
    return True


@internal
def _extent(middle: float, z: float, radius: float, focal: float, size: int) -> tuple[int, int]:
    """Return the first pixel that a sphere may cover along one axis of the picture, and the one after the last."""
    low, high = middle - radius, middle + radius
    low /= z - radius if low < 0 else z + radius
    high /= z + radius if high < 0 else z - radius
    first, last = max(size / 2 + focal * low, 0.0), min(size / 2 + focal * high + 1, float(size))
    return int(min(first, float(size))), int(max(last, 0.0))


@internal
def _triangle(
    model: Model, turn: Array, shift: Array, pinhole: Pinhole, face: int, number: int, inverse_depth: Floats,
    surface: NDArray[np.int32],
) -> int:  # fmt: skip
    """Draw a triangle and return the number of pixels that it changed."""
    focal, (x, y) = pinhole.focal, (surface.shape[1] / 2, surface.shape[0] / 2)
    right, down = pinhole.most[0] / focal, pinhole.most[1] / focal
    most = right, down, pinhole.most[2] + (0.5 - x) * right + (0.5 - y) * down
    px, py, pz = move_point(turn, shift, model.corners[face, 0])
    qx, qy, qz = move_point(turn, shift, model.corners[face, 1])
    rx, ry, rz = move_point(turn, shift, model.corners[face, 2])
    if pz >= NEAR and qz >= NEAR and rz >= NEAR:
        return _fill(  # type: ignore[no-any-return]  # Numba's float is NumPy's.
            x + focal * px / pz, y + focal * py / pz, 1 / pz, x + focal * qx / qz, y + focal * qy / qz, 1 / qz,
            x + focal * rx / rz, y + focal * ry / rz, 1 / rz, most, number, inverse_depth, surface,
        )  # fmt: skip
    if pz < NEAR and qz < NEAR and rz < NEAR:
        return 0
    seen, flat, pixels = np.empty((3, 3)), np.empty((4, 3)), 0
    seen[0, 0], seen[0, 1], seen[0, 2] = px, py, pz
    seen[1, 0], seen[1, 1], seen[1, 2] = qx, qy, qz
    seen[2, 0], seen[2, 1], seen[2, 2] = rx, ry, rz
    for last in range(2, _project(seen, focal, surface.shape, flat)):
        a, b, c = flat[0], flat[last - 1], flat[last]
        pixels += _fill(a[0], a[1], a[2], b[0], b[1], b[2], c[0], c[1], c[2], most, number, inverse_depth, surface)
    return pixels


@internal
def _project(seen: Array, focal: float, shape: tuple[int, int], flat: Array) -> int:
    """Cut a triangle at the near plane and project it; return the number of its corners.

    seen: (3, 3) corners in the camera frame. flat: (4, 3) receives column, row and inverse depth of each corner.
    """
    count = 0
    for corner in range(3):
        here, there = seen[corner], seen[(corner + 1) % 3]
        if here[2] >= NEAR:
            flat[count, 0] = shape[1] / 2 + focal * here[0] / here[2]
            flat[count, 1] = shape[0] / 2 + focal * here[1] / here[2]
            flat[count, 2] = 1 / here[2]
            count += 1
        if (here[2] >= NEAR) != (there[2] >= NEAR):
            # Always from the visible end to the other, so that neighbours cut their common side at the same point.
            a, b = (here, there) if here[2] >= NEAR else (there, here)
            part = (NEAR - a[2]) / (b[2] - a[2])
            flat[count, 0] = shape[1] / 2 + focal * (a[0] + part * (b[0] - a[0])) / NEAR
            flat[count, 1] = shape[0] / 2 + focal * (a[1] + part * (b[1] - a[1])) / NEAR
            flat[count, 2] = 1 / NEAR
            count += 1
    return count


@internal
def _fill(
    x0: float, y0: float, w0: float, x1: float, y1: float, w1: float, x2: float, y2: float, w2: float,
    most: tuple[float, float, float], number: int, inverse_depth: Floats, surface: NDArray[np.int32],
) -> int:  # fmt: skip
    """Fill a triangle row by row and return the number of pixels that it changed. A pixel belongs to it if its centre
    does.

    most: the greatest inverse depth: its change from pixel to pixel and from row to row, and that of the first pixel.

    A pixel centre on the common side of two triangles belongs to exactly one of them.
    """
    (height, width), pixels = surface.shape, 0
    area = (x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0)
    top = max(0, int(np.ceil(max(min(y0, y1, y2), 0.0) - 0.5)))
    bottom = int(np.ceil(min(max(y0, y1, y2), float(height)) - 0.5))
    if area == 0.0 or top >= bottom or max(x0, x1, x2) <= 0.5 or min(x0, x1, x2) > width - 0.5:
        return 0
    # Inverse depth, unlike depth, is linear in the picture: one gradient holds for the whole triangle.
    across = ((w1 - w0) * (y2 - y0) - (w2 - w0) * (y1 - y0)) / area
    down = ((w2 - w0) * (x1 - x0) - (w1 - w0) * (x2 - x0)) / area
    corner = w0 + (0.5 - x0) * across + (0.5 - y0) * down
    # Corners are sorted from top to bottom, so that neighbours compute their common side identically to the last bit.
    if y1 < y0 or (y1 == y0 and x1 < x0):
        x0, y0, x1, y1 = x1, y1, x0, y0
    if y2 < y0 or (y2 == y0 and x2 < x0):
        x0, y0, x2, y2 = x2, y2, x0, y0
    if y2 < y1 or (y2 == y1 and x2 < x1):
        x1, y1, x2, y2 = x2, y2, x1, y1
    step, side, upper, lower = np.float32(across), (x2 - x0) / (y2 - y0), (x1 - x0) / (y1 - y0), (x2 - x1) / (y2 - y1)
    for row in range(top, bottom):
        y = row + 0.5
        long = x0 + (y - y0) * side
        short = x0 + (y - y0) * upper if y < y1 else x1 + (y - y1) * lower
        left = int(np.ceil(max(min(long, short), 0.0) - 0.5))
        right = int(np.ceil(min(max(long, short), float(width)) - 0.5))
        start, limit, along = np.float32(corner + row * down), np.float32(most[2] + row * most[1]), np.float32(most[0])
        for column in range(np.uint64(left), np.uint64(max(left, right))):
            # Without a branch the compiler can vectorize this loop.
            here, before = start + step * np.float32(np.int32(column)), inverse_depth[row, column]
            nearer = (here > before) & (here < limit + along * np.float32(np.int32(column)))
            inverse_depth[row, column] = here if nearer else before
            surface[row, column] = number if nearer else surface[row, column]
            pixels += nearer
    return pixels
