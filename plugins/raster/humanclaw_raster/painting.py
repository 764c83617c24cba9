"""Compute the colours of the pixels: textures and light."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from humanclaw.body import Array
from humanclaw.world import compiled, internal
from humanclaw_raster.buffers import HALF, ONE, TWO, ZERO, GBuffer, Instances, Pinhole, floats, ints
from humanclaw_raster.lighting import SKY
from humanclaw_raster.packing import LEVELS, PANE, Floats, Model
from humanclaw_raster.sky import BOTTOM, TOP
from humanclaw_raster.surfaces import BRIGHT, DENSITY, KIND, UV

WHITE: Final = 1.15
"""Brightness that is drawn white: above the sky's, so that windows keep their colours."""
FEW: Final = 200
"""Most samples of light on a narrow surface: a wider one has its own beside each pixel."""
BRIGHTNESS: Final = WHITE * (0.5 - np.sin(np.arcsin(1 - np.arange(256) / 127.5) / 3))
"""Brightness of each tone: the film curve, undone."""


class _Points(NamedTuple):
    """N points that are coloured together, (N,) each."""

    depth: Floats
    right: Floats
    """Where the line of sight meets the plane z = 1, camera frame."""
    light: Floats
    u: Floats
    v: Floats
    """Negated: it increases downwards, as the rows of a texture do."""
    bright: Floats
    footprint: Floats
    """Texels per pixel."""
    texture: NDArray[np.int32]
    """First row of the texture in model.levels."""


@compiled
def paint(
    model: Model, instances: Instances, pinhole: Pinhole, gbuffer: GBuffer, light: Floats, sky: NDArray[np.uint8],
    rgb: NDArray[np.uint8], depth: Floats, ids: NDArray[np.int32],
) -> None:  # fmt: skip
    """Write rgb, depth and ids of a View.

    light: as from ambient_occlusion. sky: (H, 3) colours of empty pixels in each row.
    """
    height, width = gbuffer.surface.shape
    points, scale, means = _points(width), np.float32(1 / pinhole.focal), _means(light, gbuffer)
    for k in range(width):
        points.right[k] = np.float32(k + 0.5 - width / 2) * scale
    for row in range(height):
        surface, down = gbuffer.surface[row], np.float32(row + 0.5 - height / 2) * scale
        _light_row(light, means, gbuffer, row, points.light)
        for k in range(width):
            depth[row, k] = points.depth[k] = ONE / gbuffer.inverse_depth[row, k]
        end = np.int64(0)  # A literal would compile what takes it twice.
        while end < width:
            first, number = end, surface[end]
            while end < width and surface[end] == number:
                end += 1
            instance = gbuffer.faces[number, 1] if number >= 0 else -1
            # Unsigned: the compiler does not vectorize a loop between signed numbers, which takes ten times as long.
            for k in range(np.uint64(first), np.uint64(end)):
                ids[row, k] = instances.id[instance] if number >= 0 else 0
            if number >= 0:
                _span(gbuffer.table[number], instances.mesh[instance], down, first, end, points)
                # Not in _span: each array that a call passes costs time.
                if gbuffer.table[number, KIND] == PANE:
                    _outside(model, pinhole, down, first, end, points)
        _colours(model, points, width, rgb[row])
        for k in range(width):
            if surface[k] < 0:
                rgb[row, k, 0], rgb[row, k, 1], rgb[row, k, 2] = sky[row, 0], sky[row, 1], sky[row, 2]


@internal
def _points(count: int) -> _Points:
    """Allocate points. They start as zeros, because _colours also reads points of empty pixels, which stay unset."""
    depth, right, light, u, v = floats(count), floats(count), floats(count), floats(count), floats(count)
    bright, footprint, texture = floats(count), floats(count), ints(count)
    for k in range(count):
        depth[k] = right[k] = light[k] = u[k] = v[k] = bright[k] = footprint[k] = ZERO
        texture[k] = 0
    return _Points(depth, right, light, u, v, bright, footprint, texture)


@internal
def _span(s: Floats, mesh: int, down: float, first: int, end: int, points: _Points) -> None:
    """Prepare successive points of one row of the picture on one surface. s: the surface's row of the table."""
    _, right, light, u, v, bright, footprint, texture = points
    depth, span = points.depth, (np.uint64(first), np.uint64(end))
    for k in range(*span):
        texture[k] = mesh * LEVELS
    density = s[DENSITY]
    for k in range(*span):
        footprint[k] = density * depth[k]
    b0, b1, b2, c0, c1, c2 = s[0], s[1], s[2] * down + s[3], s[4], s[5], s[6] * down + s[7]
    bright0, bright1, bright2 = s[BRIGHT], s[BRIGHT + 1], s[BRIGHT + 2]
    u0, u1, u2, v0, v1, v2 = s[UV], s[UV + 2], s[UV + 4], -s[UV + 1], -s[UV + 3], -s[UV + 5]
    for k in range(*span):
        b = min(ONE, max(ZERO, b0 + depth[k] * (b1 * right[k] + b2)))
        c = min(ONE - b, max(ZERO, c0 + depth[k] * (c1 * right[k] + c2)))
        u[k], v[k] = u0 + b * u1 + c * u2, v0 + b * v1 + c * v2
        bright[k] = light[k] * (bright0 + b * bright1 + c * bright2)


@internal
def _outside(model: Model, pinhole: Pinhole, down: float, first: int, end: int, points: _Points) -> None:
    """Let points show the sky in the direction in which they are seen: it is far behind the window."""
    mesh, axes = model.levels.shape[0] // LEVELS - 1, pinhole.axes
    texels = np.float32(model.levels[mesh * LEVELS, 2] / (2 * np.pi) / pinhole.focal)
    for k in range(first, end):
        x = points.right[k] * axes[0, 0] + down * axes[1, 0] + axes[2, 0]
        y = points.right[k] * axes[0, 1] + down * axes[1, 1] + axes[2, 1]
        z = points.right[k] * axes[0, 2] + down * axes[1, 2] + axes[2, 2]
        height = np.arctan2(y, np.sqrt(x * x + z * z))
        points.u[k] = np.arctan2(x, z) / (2 * np.pi)
        points.v[k] = min(max((TOP - height) / (TOP - BOTTOM), 0.01), 0.99)  # At its ends a texture repeats.
        points.footprint[k], points.texture[k], points.bright[k] = texels, mesh * LEVELS, np.float32(SKY)


@internal
def _colours(model: Model, points: _Points, count: int, rgb: NDArray[np.uint8]) -> None:
    """Write the colour of each point between four texels, from the size at which a pixel covers about one texel.

    rgb: (N, 3).
    """
    level, first, height, width = ints(count), ints(count), ints(count), ints(count)
    for k in range(count):
        level[k] = points.texture[k]
    edge = np.float32(1.5)
    for _ in range(LEVELS - 1):
        for k in range(count):
            level[k] += points.footprint[k] > edge
        edge *= TWO
    for k in range(count):
        first[k], height[k], width[k] = model.levels[level[k]]
    a, b, c, d = ints(count), ints(count), ints(count), ints(count)
    left, right, upper, lower = ints(count), ints(count), ints(count), ints(count)
    east, south = floats(count), floats(count)
    _between(points.u, width, left, right, east)
    _between(points.v, height, upper, lower, south)
    for k in range(count):
        high, low = first[k] + upper[k] * width[k], first[k] + lower[k] * width[k]
        a[k], b[k] = model.texels[high + left[k]], model.texels[high + right[k]]
        c[k], d[k] = model.texels[low + left[k]], model.texels[low + right[k]]
    red, green, blue = np.empty(count, np.uint8), np.empty(count, np.uint8), np.empty(count, np.uint8)
    for shift, tone in ((0, red), (8, green), (16, blue)):
        _blend(a, b, c, d, east, south, points.bright, shift, tone)
    for k in range(count):
        rgb[k, 0], rgb[k, 1], rgb[k, 2] = red[k], green[k], blue[k]


@internal
def _between(
    place: Floats, size: NDArray[np.int32], before: NDArray[np.int32], after: NDArray[np.int32], part: Floats
) -> None:
    """Write the texels before and after each place along one axis, and its distance from the first, 0 to 1.

    place: in repeats of the texture. size: of the texture, texels.
    """
    for k in range(size.size):
        part[k] = (place[k] - np.floor(place[k])) * np.float32(size[k]) - HALF
    for k in range(size.size):
        texel = np.int32(np.floor(part[k]))
        after[k] = texel + 1 if texel + 1 < size[k] else 0
    for k in range(size.size):
        before[k] = np.int32(part[k]) if part[k] >= ZERO else size[k] - 1
    for k in range(size.size):
        part[k] -= np.floor(part[k])


def tones(brightness: Array) -> Array:
    """Return the tones of brightness, 0 to 255: the film curve, as in `_blend`."""
    share = np.minimum(brightness / WHITE, 1.0)
    return np.asarray(255 * share**2 * (3 - 2 * share))


@internal
def _blend(
    a: NDArray[np.int32], b: NDArray[np.int32], c: NDArray[np.int32], d: NDArray[np.int32], east: Floats, south: Floats,
    bright: Floats, shift: int, tone: NDArray[np.uint8],
) -> None:  # fmt: skip
    """Write one channel of the colours between the texels a and b in the upper row and c and d in the lower."""
    for k in range(tone.size):
        p, q = np.float32(np.uint8(a[k] >> shift)), np.float32(np.uint8(b[k] >> shift))
        r, s = np.float32(np.uint8(c[k] >> shift)), np.float32(np.uint8(d[k] >> shift))
        high, low = p + (q - p) * east[k], r + (s - r) * east[k]
        value = (high + (low - high) * south[k]) * bright[k] * np.float32(1 / (255 * WHITE))
        # The curve of a film, level at black and white. A detector trained on photos recognises more with it.
        value = min(value, ONE)
        tone[k] = np.uint8(value * value * (np.float32(3 * 255) - np.float32(2 * 255) * value) + HALF)


@internal
def _means(light: Floats, gbuffer: GBuffer) -> Floats:
    """Return (K,) the mean light of the samples on each surface; 0 on one without any or with more than FEW."""
    total, count = floats(gbuffer.faces.shape[0]), ints(gbuffer.faces.shape[0])
    for number in range(count.size):
        total[number], count[number] = ZERO, 0
    for row in range(light.shape[0]):
        for column in range(light.shape[1]):
            number = gbuffer.surface[2 * row, 2 * column]
            if number >= 0:
                total[number] += light[row, column]
                count[number] += 1
    for number in range(count.size):
        total[number] = total[number] / np.float32(count[number]) if 0 < count[number] <= FEW else ZERO
    return total  # type: ignore[no-any-return]  # Numba's float is NumPy's.


@internal
def _light_row(light: Floats, means: Floats, gbuffer: GBuffer, row: int, out: Floats) -> None:
    """Write the light of the pixels of a row: the mean of the samples beside each, weighted where faces differ."""
    surface, inverse_depth = gbuffer.surface, gbuffer.inverse_depth
    r, s, last = row // 2, min((row + 1) // 2, light.shape[0] - 1), light.shape[1] - 1
    for k in range(out.size):
        left, right, here = k // 2, min((k + 1) // 2, last), surface[row, k]
        alike = (surface[2 * r, 2 * left] == here) & (surface[2 * r, 2 * right] == here)
        if alike & (surface[2 * s, 2 * left] == here) & (surface[2 * s, 2 * right] == here):
            out[k] = (light[r, left] + light[r, right] + light[s, left] + light[s, right]) * np.float32(0.25)
        elif here >= 0:
            out[k] = _light_near(light, gbuffer, means[here], inverse_depth[row, k], here, row, k)


@compiled
def _light_near(light: Floats, gbuffer: GBuffer, mean: float, here: float, own: int, row: int, column: int) -> float:
    """Return the mean light of the samples around a pixel, weighted by similar depth and by the same surface.

    A narrow surface has few samples. Where none is near, it has the mean of its own: that of its neighbours would break
    it into dashes. A depth that differs by a fortieth halves a sample's weight; another surface leaves a fiftieth.

    mean: as from _means. here: inverse depth in the pixel. own: number of its surface.
    """
    total, weight, others = np.float32(1e-6), np.float32(1e-6), np.float32(0.02)
    if mean > ZERO:
        total, others = np.float32(1e-6) * mean, ZERO
    for r in range(row // 2, min((row + 1) // 2 + 1, light.shape[0])):
        for c in range(column // 2, min((column + 1) // 2 + 1, light.shape[1])):
            number = gbuffer.surface[2 * r, 2 * c]
            if number < 0 or gbuffer.table[number, KIND] == PANE:
                continue  # The sky lights nothing in the room by itself.
            near = here / (here + np.float32(40) * abs(gbuffer.inverse_depth[2 * r, 2 * c] - here)) + np.float32(1e-4)
            near *= ONE if number == own else others
            total += near * light[r, c]
            weight += near
    return total / weight  # type: ignore[return-value]  # Numba's float is NumPy's.
