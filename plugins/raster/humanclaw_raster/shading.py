"""Ambient occlusion and the sun's shadow, in image space."""

from __future__ import annotations

from typing import Final

import numpy as np

from humanclaw_raster.buffers import FLAT, SURFACE, GBuffer, Instances, OverheadMap, Pinhole, compiled, inlined
from humanclaw_raster.drawing import prepare_face
from humanclaw_raster.packing import Floats, Model

SUN: Final = (0.505, 0.808, 0.303)
"""Unit vector towards the light, oblique to both axes of a house, so that its walls differ in brightness."""
AMBIENT: Final = 0.6
"""Brightness of a surface that the sun does not reach."""
DIFFUSE: Final = 0.45
"""Brightness that the sun adds to a surface which faces it."""
REACH: Final = 0.45
"""Largest distance at which surfaces darken each other, metres."""
DARKEST: Final = 0.4
"""Share of the light that remains in the deepest corner."""
DEPTH_OF_CORNERS: Final = 1.6
"""Share of the light lost per occluded share of the neighbourhood."""
RAYS: Final = 8
"""Samples of the neighbourhood per pixel. The 16 pixels of a 4 x 4 square use different sets and are then averaged."""
SHADE: Final = 0.6
"""Share of the light that a place loses if the whole cone above it is covered."""
CONE: Final = 0.6
"""Light from above comes from within this horizontal distance, metres, ..."""
STEEP: Final = 0.9
"""... and at least this steeply: metres down per metre aside."""
SUN_SIZE: Final = 0.12
"""Horizontal radius of the sun as seen from one metre below, metres. It makes shadows soft."""
TALLEST: Final = 2.1
"""Objects that reach higher over their floor than this cast no shadow, because they reach above the lamps; metres."""
LEAN: Final = 0.08
"""Sine of the angle above the surface below which neighbours do not count: they are the rounded surface itself."""


@compiled
def ambient_occlusion(
    model: Model, instances: Instances, pinhole: Pinhole, gbuffer: GBuffer, overhead: OverheadMap
) -> Floats:
    """Return (H / 2, W / 2) the share of the light that reaches every second pixel.

    Screen-space ambient occlusion darkens corners. The overhead map adds the shadows of objects above and towards the
    sun.
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
                prepare_face(model, instances, pinhole, face, instance, surface)
                last, owner = face, instance
            for axis in range(3):
                normals[row, column, axis] = surface[FLAT + axis]
    light = _occlusion(depth, normals, pinhole.focal / 2)
    _shadow(depth, normals, pinhole, overhead, light)
    return _smoothed(light, depth, normals)  # type: ignore[no-any-return]


@compiled
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
                # int() rounds towards 0; the offset of 100 keeps its argument positive, so that it rounds down.
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


@compiled
def _shadow(depth: Floats, normals: Floats, pinhole: Pinhole, overhead: OverheadMap, light: Floats) -> None:
    """Darken places under or close beside objects, and places in the sun's shadow.

    Surfaces that face up get light from a cone above them. Surfaces that face the sun get light from the sun.
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


@inlined
def _covered(overhead: OverheadMap, storey: int, x: float, y: float, z: float, swing: Floats) -> float:
    """Return the covered share of the cone above a point. x, z: in cells of the map; y: metres."""
    taken = 0
    for ray in range(RAYS):
        aside, ahead = swing[ray, 0] * CONE, swing[ray, 1] * CONE
        i, j = int(z + ahead / overhead.cell), int(x + aside / overhead.cell)
        if i >= 0 and j >= 0 and i < overhead.heights.shape[1] and j < overhead.heights.shape[2]:
            over = overhead.heights[storey, i, j] - y
            # Surfaces up to 3 cm higher are the point's own surface, within the accuracy of the map.
            taken += over > 0.03 and over * over > STEEP * STEEP * (aside * aside + ahead * ahead)
    return taken / RAYS


@inlined
def _sun_blocked(overhead: OverheadMap, storey: int, x: float, y: float, z: float, aside: Floats) -> bool:
    """Return whether an object stands between a point and a place on the sun. aside: offset of that place."""
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


@compiled
def _swing() -> Floats:
    """Return (16, RAYS, 2) points in the unit disk, spread by the golden angle (2.399963 rad), in 16 rotations."""
    out = np.empty((16, RAYS, 2), np.float32)
    for turn in range(16):
        for ray in range(RAYS):
            angle, reach = 2.399963 * ray + 2 * np.pi * (turn * 7 % 16) / 16, np.sqrt((ray + 0.5) / RAYS)
            out[turn, ray, 0], out[turn, ray, 1] = reach * np.sin(angle), reach * np.cos(angle)
    return out


@compiled
def _smoothed(raw: Floats, depth: Floats, normals: Floats) -> Floats:
    """Return the mean over those of 4 x 4 neighbours that lie on the same surface: each of the 16 rotations once."""
    height, width = raw.shape
    out = np.ones_like(raw)
    for row in range(height):
        for column in range(width):
            z, total, weight = depth[row, column], raw[row, column], np.float32(1)
            x, y, n = normals[row, column]
            for r in range(max(0, row - 2), min(height, row + 2)):
                for c in range(max(0, column - 2), min(width, column + 2)):
                    # Same surface: depth within 5 %, normals within 37 degrees (cosine 0.8).
                    same = abs(depth[r, c] - z) < np.float32(0.05) * z
                    if same and normals[r, c, 0] * x + normals[r, c, 1] * y + normals[r, c, 2] * n > np.float32(0.8):
                        total += raw[r, c]
                        weight += np.float32(1)
            out[row, column] = total / weight
    return out
