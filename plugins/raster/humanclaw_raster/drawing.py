"""Draw triangles into the depth and face buffers."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from humanclaw.body import Array
from humanclaw_raster.buffers import NEAR, GBuffer, Instances, Pinhole, compiled
from humanclaw_raster.packing import Floats, Model


@compiled
def in_view(
    model: Model, instances: Instances, pinhole: Pinhole, width: int, height: int
) -> tuple[NDArray[np.int32], Floats]:
    """Return (K, 2) instance and cluster of all clusters that may be visible, and (K,) their smallest depths."""
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
        to_camera, shift = place_model(instances, instance, pinhole)
        for cluster in range(model.meshes[instances.mesh[instance], 0], model.meshes[instances.mesh[instance], 1]):
            x, y, z = move_point(to_camera, shift, model.spheres[cluster])
            radius = model.spheres[cluster, 3]
            # A sphere outside one of the four side planes is invisible; the slant is the length of a plane's normal.
            behind = z + radius < NEAR
            if behind or abs(x) - side * z > radius * side_slant or abs(y) - rise * z > radius * rise_slant:
                continue
            found[count, 0], found[count, 1] = instance, cluster
            depth[count] = z - radius
            count += 1
    return found[:count], depth[:count]


@compiled
def place_model(instances: Instances, instance: int, pinhole: Pinhole) -> tuple[Array, Array]:
    """Return rotation and shift from the frame of an instance's mesh to that of the camera."""
    turn, shift = np.zeros((3, 3)), np.zeros(3)
    for a in range(3):
        for b in range(3):
            shift[a] += pinhole.axes[a, b] * (instances.place[instance, b] - pinhole.eye[b])
            for c in range(3):
                turn[a, b] += pinhole.axes[a, c] * instances.turn[instance, c, b]
    return turn, shift


@compiled
def move_point(turn: Array, shift: Array, point: Floats) -> tuple[float, float, float]:
    return (
        turn[0, 0] * point[0] + turn[0, 1] * point[1] + turn[0, 2] * point[2] + shift[0],
        turn[1, 0] * point[0] + turn[1, 1] * point[1] + turn[1, 2] * point[2] + shift[1],
        turn[2, 0] * point[0] + turn[2, 1] * point[1] + turn[2, 2] * point[2] + shift[2],
    )


@compiled
def draw(model: Model, instances: Instances, pinhole: Pinhole, order: NDArray[np.int32], gbuffer: GBuffer) -> None:
    """Fill the G-buffer with the nearest triangles, both sides of each face.

    order: (K, 2) as from in_view. Nearest first is fastest, because hidden pixels are then never written.
    """
    seen, flat = np.empty((3, 3)), np.empty((4, 3))
    for item in range(order.shape[0]):
        instance, cluster = order[item]
        turn, shift = place_model(instances, instance, pinhole)
        for face in range(model.clusters[cluster, 0], model.clusters[cluster, 1]):
            for corner in range(3):
                seen[corner] = move_point(turn, shift, model.corners[face, corner])
            count = _project(seen, pinhole.focal, gbuffer.inverse_depth.shape, flat)
            for last in range(2, count):
                _fill(flat[0], flat[last - 1], flat[last], face, instance, gbuffer)


@compiled
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


@compiled
def _fill(a: Array, b: Array, c: Array, face: int, instance: int, gbuffer: GBuffer) -> None:
    """Fill a triangle row by row. A pixel belongs to it if its centre does.

    A pixel centre on the common side of two triangles belongs to exactly one of them.
    """
    height, width = gbuffer.inverse_depth.shape
    x0, y0, w0, x1, y1, w1, x2, y2, w2 = a[0], a[1], a[2], b[0], b[1], b[2], c[0], c[1], c[2]
    area = (x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0)
    top = max(0, int(np.ceil(max(min(y0, y1, y2), 0.0) - 0.5)))
    bottom = int(np.ceil(min(max(y0, y1, y2), float(height)) - 0.5))
    if area == 0.0 or top >= bottom or max(x0, x1, x2) <= 0.5 or min(x0, x1, x2) > width - 0.5:
        return
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


@compiled
def prepare_face(model: Model, instances: Instances, pinhole: Pinhole, face: int, instance: int, out: Array) -> None:
    """Compute the values that all pixels of a face share.

    0..7    barycentric weights of the second and the third corner: a constant and a gradient each, camera frame
    8..10   unit normal of the face towards the camera, camera frame
    11..19  normal for shading, world frame: at the first corner, and the differences of the other two to it
    20..25  uv likewise
    26      texels per pixel at a depth of one metre
    """
    turn, shift = place_model(instances, instance, pinhole)
    px, py, pz = move_point(turn, shift, model.corners[face, 0])
    qx, qy, qz = move_point(turn, shift, model.corners[face, 1])
    rx, ry, rz = move_point(turn, shift, model.corners[face, 2])
    ux, uy, uz, vx, vy, vz = qx - px, qy - py, qz - pz, rx - px, ry - py, rz - pz
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    square = nx * nx + ny * ny + nz * nz + 1e-30
    out[1], out[2], out[3] = (vy * nz - vz * ny) / square, (vz * nx - vx * nz) / square, (vx * ny - vy * nx) / square
    out[5], out[6], out[7] = (ny * uz - nz * uy) / square, (nz * ux - nx * uz) / square, (nx * uy - ny * ux) / square
    out[0], out[4] = -(out[1] * px + out[2] * py + out[3] * pz), -(out[5] * px + out[6] * py + out[7] * pz)
    # Faces are drawn from both sides: seen from behind, the normals are reversed.
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
