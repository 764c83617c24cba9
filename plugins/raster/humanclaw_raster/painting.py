"""Compute the colours of the pixels: textures, light, smooth edges."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from humanclaw.body import Array
from humanclaw_raster.buffers import SURFACE, GBuffer, Instances, Pinhole, compiled, inlined
from humanclaw_raster.drawing import prepare_face
from humanclaw_raster.packing import LEVELS, Floats, Model
from humanclaw_raster.shading import AMBIENT, DIFFUSE, SUN

UPLIFT: Final = 0.6
"""Added to the upward component of normals before shading, as if light from above bounced around the room.

Without it, all faces turned away from the sun would be equally dark, and the corners between them would vanish.
"""
BOUNCE: Final = 0.5
"""Share of the floor's light that lights faces which look down."""


@compiled
def paint(
    model: Model, instances: Instances, pinhole: Pinhole, gbuffer: GBuffer, light: Floats, rgb: NDArray[np.uint8]
) -> None:
    """Colour every pixel that shows a surface. light: as from ambient_occlusion. rgb: (H, W, 3), changed in place."""
    height, width = gbuffer.inverse_depth.shape
    s, last, owner = np.empty(SURFACE), -1, -1
    for row in range(height):
        down = (row + 0.5 - height / 2) / pinhole.focal
        for column in range(width):
            instance, face = gbuffer.instance[row, column], gbuffer.face[row, column]
            if instance < 0:
                continue
            if face != last or instance != owner:  # Neighbouring pixels mostly show the same face.
                prepare_face(model, instances, pinhole, face, instance, s)
                last, owner = face, instance
            depth, right = 1 / gbuffer.inverse_depth[row, column], (column + 0.5 - width / 2) / pinhole.focal
            here = _light_at(light, gbuffer, row, column)
            _colour(model, instances.mesh[instance], s, depth, right, down, here, rgb, row, column)


@compiled
def smooth_edges(
    model: Model, instances: Instances, pinhole: Pinhole, gbuffer: GBuffer, coarse: GBuffer, light: Floats,
    sky: NDArray[np.uint8], rgb: NDArray[np.uint8],
) -> None:  # fmt: skip
    """Repaint pixels whose 2 x 2 samples show more than one face: with the mean of the samples.

    pinhole, gbuffer: of the picture at twice its size. coarse, light: of the picture at its own size. sky: (H, 3)
    colours of empty pixels in each row. rgb: the picture from paint, changed in place.
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
                    prepare_face(model, instances, pinhole, face, instance, s)
                    last, owner = face, instance
                down, right = (r + 0.5 - height) / pinhole.focal, (c + 0.5 - width) / pinhole.focal
                here = _light_near(light, coarse, gbuffer.inverse_depth[r, c], face, instance, row, column, 1)
                depth = 1 / gbuffer.inverse_depth[r, c]
                _colour(model, instances.mesh[instance], s, depth, right, down, here, samples, k // 2, k % 2)
            for channel in range(3):
                total = 2  # Rounds the mean of four to the nearest number.
                for k in range(4):
                    total += samples[k // 2, k % 2, channel]
                rgb[row, column, channel] = total // 4


@compiled
def _one_face(gbuffer: GBuffer, coarse: GBuffer, row: int, column: int) -> bool:
    """Return whether the four samples of a pixel and its centre all show the same face."""
    face, instance = coarse.face[row, column], coarse.instance[row, column]
    for r in range(2 * row, 2 * row + 2):
        for c in range(2 * column, 2 * column + 2):
            if gbuffer.face[r, c] != face or gbuffer.instance[r, c] != instance:
                return False
    return True


@inlined
def _colour(
    model: Model, mesh: int, s: Array, depth: float, right: float, down: float, light: float,
    rgb: NDArray[np.uint8], row: int, column: int,
) -> None:  # fmt: skip
    """Write the colour of a point on the face for which s was prepared, seen at (right, down) on the plane z = 1."""
    b = min(1.0, max(0.0, s[0] + depth * (s[1] * right + s[2] * down + s[3])))
    c = min(1.0 - b, max(0.0, s[4] + depth * (s[5] * right + s[6] * down + s[7])))
    bright = _lit(s[11] + b * s[14] + c * s[17], s[12] + b * s[15] + c * s[18], s[13] + b * s[16] + c * s[19])
    u, v = s[20] + b * s[22] + c * s[24], s[21] + b * s[23] + c * s[25]
    _texture(model, mesh, u, v, s[26] * depth, bright * light, rgb, row, column)


@inlined
def _texture(
    model: Model, mesh: int, u: float, v: float, footprint: float, bright: float,
    rgb: NDArray[np.uint8], row: int, column: int,
) -> None:  # fmt: skip
    """Write the colour between four texels, from the size at which a pixel covers about one texel.

    footprint: texels per pixel in the full-size texture.
    """
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


@inlined
def _lit(x: float, y: float, z: float) -> float:
    """Return the brightness of a surface from its normal in the world frame, without the shadows of other objects."""
    y = (-BOUNCE * y if y < 0 else y) + UPLIFT
    size = np.sqrt(x * x + y * y + z * z) + 1e-20
    return AMBIENT + DIFFUSE * max(0.0, (x * SUN[0] + y * SUN[1] + z * SUN[2]) / size)  # type: ignore[no-any-return]


@inlined
def _light_at(light: Floats, gbuffer: GBuffer, row: int, column: int) -> float:
    """Return the light of a pixel: its own sample, or a mean of the samples beside it."""
    if row % 2 == 0 and column % 2 == 0:
        return light[row // 2, column // 2]  # type: ignore[no-any-return]
    face, instance = gbuffer.face[row, column], gbuffer.instance[row, column]
    return _light_near(light, gbuffer, gbuffer.inverse_depth[row, column], face, instance, row, column, 0)  # type: ignore[no-any-return]


@compiled
def _light_near(
    light: Floats, gbuffer: GBuffer, here: float, face: int, instance: int, row: int, column: int, wide: int
) -> float:
    """Return the mean light of the samples around a pixel, weighted by similar depth and by the same face.

    here: inverse depth of the face in the pixel. wide: 1 to take the samples on both sides even if the pixel itself is
    a sample.
    """
    total, weight = np.float32(1e-6), np.float32(1e-6)
    for r in range(max((row - wide) // 2, 0), min((row + 1 + wide) // 2 + 1, light.shape[0])):
        for c in range(max((column - wide) // 2, 0), min((column + 1 + wide) // 2 + 1, light.shape[1])):
            near = here / (here + 40 * abs(gbuffer.inverse_depth[2 * r, 2 * c] - here)) + np.float32(1e-4)
            if gbuffer.face[2 * r, 2 * c] != face or gbuffer.instance[2 * r, 2 * c] != instance:
                near *= np.float32(0.05)  # Not 0: a small face may have no sample of its own.
            total += near * light[r, c]
            weight += near
    return total / weight  # type: ignore[return-value]
