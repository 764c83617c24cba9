"""Ambient occlusion and the sun's shadow, in image space."""

from __future__ import annotations

from typing import Final

import numpy as np

from humanclaw_raster.buffers import FLAT, SURFACE, GBuffer, Instances, OverheadMap, Pinhole, compiled, inlined
from humanclaw_raster.drawing import prepare_face
from humanclaw_raster.packing import Floats, Model

SUN: Final = (0.505, 0.808, 0.303)
"""Direction towards the light, oblique to both axes of a house, so that its walls differ in brightness."""
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


@compiled
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


@inlined
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


@inlined
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


@compiled
def _swing() -> Floats:
    """(16, RAYS, 2) points in the unit disk, spread by the golden angle, in 16 turns."""
    out = np.empty((16, RAYS, 2), np.float32)
    for turn in range(16):
        for ray in range(RAYS):
            angle, reach = 2.399963 * ray + 2 * np.pi * (turn * 7 % 16) / 16, np.sqrt((ray + 0.5) / RAYS)
            out[turn, ray, 0], out[turn, ray, 1] = reach * np.sin(angle), reach * np.cos(angle)
    return out


@compiled
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
