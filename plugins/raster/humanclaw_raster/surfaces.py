"""Compute the values that all pixels of a visible triangle share, once per picture."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from humanclaw.body import Array
from humanclaw.world import compiled, internal
from humanclaw_raster.buffers import ZERO, Instances, Pinhole
from humanclaw_raster.drawing import move_point, place_model
from humanclaw_raster.lighting import Lit, facing
from humanclaw_raster.packing import SMALL, WIDE, Floats, Model

FLAT: Final = 8
BRIGHT: Final = 11
UV: Final = 14
DENSITY: Final = 20
KIND: Final = 21
SURFACE: Final = 22
"""First columns of the values in the table of surfaces, and the number of columns.

0        barycentric weights of the second and the third corner: a constant and a gradient each, camera frame
FLAT     unit normal of the face towards the camera, camera frame
BRIGHT   brightness at the first corner, and the differences of the other two to it
UV       uv likewise
DENSITY  texels per pixel at a depth of one metre
KIND     as in the model, but no face of what shines itself is WIDE
"""


def prepare(model: Model, instances: Instances, lit: Lit, pinhole: Pinhole, faces: NDArray[np.int32]) -> Floats:
    """Return the table of a GBuffer. faces: (K, 2) as from draw."""
    table = np.empty((len(faces), SURFACE), np.float32)
    # A mirror image of a camera sees a face turn the other way round.
    hand = np.sign(np.cross(pinhole.axes[0], pinhole.axes[1]) @ pinhole.axes[2])
    _prepare(model, instances, lit, pinhole, hand, faces, table)
    return table


@compiled
def _prepare(
    model: Model, instances: Instances, lit: Lit, pinhole: Pinhole, hand: float, faces: NDArray[np.int32], table: Floats
) -> None:
    owner, turn, shift = -1, np.empty((3, 3)), np.empty(3)
    for number in range(faces.shape[0]):
        face, instance = faces[number]
        if instance != owner:
            turn, shift = place_model(instances, np.int64(instance), pinhole)
            owner = instance
        side = hand * _place(model, turn, shift, face, table[number])
        _shade(model, instances.turn[instance], lit.around[instance], side, face, table[number])
        # What shines itself is no darker where less light falls on it.
        if lit.glow[instance] > ZERO and model.kind[face] == WIDE:
            table[number, KIND] = SMALL
        table[number, DENSITY] = model.density[face] / pinhole.focal


@internal
def _place(model: Model, turn: Array, shift: Array, face: int, out: Floats) -> float:
    """Write the barycentric weights and the flat normal. Return -1 if the camera sees the back of the face, else 1."""
    px, py, pz = move_point(turn, shift, model.corners[face, 0])
    qx, qy, qz = move_point(turn, shift, model.corners[face, 1])
    rx, ry, rz = move_point(turn, shift, model.corners[face, 2])
    ux, uy, uz, vx, vy, vz = qx - px, qy - py, qz - pz, rx - px, ry - py, rz - pz
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    # 1e-30, because a face without an area would divide by 0.
    square = nx * nx + ny * ny + nz * nz + 1e-30
    each = 1 / square
    bx, by, bz = (vy * nz - vz * ny) * each, (vz * nx - vx * nz) * each, (vx * ny - vy * nx) * each
    cx, cy, cz = (ny * uz - nz * uy) * each, (nz * ux - nx * uz) * each, (nx * uy - ny * ux) * each
    out[0], out[1], out[2], out[3] = -(bx * px + by * py + bz * pz), bx, by, bz
    out[4], out[5], out[6], out[7] = -(cx * px + cy * py + cz * pz), cx, cy, cz
    # Faces are drawn from both sides: seen from behind, the normals are reversed.
    side = 1.0 if nx * px + ny * py + nz * pz < 0 else -1.0
    size = side / np.sqrt(square)
    out[FLAT], out[FLAT + 1], out[FLAT + 2] = nx * size, ny * size, nz * size
    return side


@internal
def _shade(model: Model, turn: Array, around: Floats, side: float, face: int, out: Floats) -> None:
    """Write brightness, kind and texture coordinates. around: (6,) as in Lit."""
    out[KIND] = model.kind[face]
    for corner in range(3):
        n = model.normals[face, corner]
        x = np.float32(side * (turn[0, 0] * n[0] + turn[0, 1] * n[1] + turn[0, 2] * n[2]))
        y = np.float32(side * (turn[1, 0] * n[0] + turn[1, 1] * n[1] + turn[1, 2] * n[2]))
        z = np.float32(side * (turn[2, 0] * n[0] + turn[2, 1] * n[1] + turn[2, 2] * n[2]))
        out[BRIGHT + corner] = facing(around, np.uint64(0), x, y, z) - (out[BRIGHT] if corner else ZERO)
    for axis in range(2):
        first = model.uv[face, 0, axis]
        out[UV + axis] = first
        out[UV + 2 + axis] = model.uv[face, 1, axis] - first
        out[UV + 4 + axis] = model.uv[face, 2, axis] - first
