"""Ambient occlusion, the light of wide faces and the shadows of objects, in image space."""

from __future__ import annotations

import math
from functools import cache
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from humanclaw.world import compiled, inlined, internal
from humanclaw_raster.buffers import GOLDEN, HALF, ONE, TINY, TWO, ZERO, GBuffer, OverheadMap, Pinhole, floats, ints
from humanclaw_raster.lighting import OFFSET, Light, facing, jitter, probe
from humanclaw_raster.packing import PANE, SKIN, WIDE, Floats
from humanclaw_raster.surfaces import BRIGHT, FLAT, KIND

REACH: Final = 0.25
"""Largest distance at which surfaces darken each other, metres. Walls behind furniture had dark halos from
farther; with half of it, four times as strong, a detector trained on photos recognised 8 % fewer targets."""
DARKEST: Final = 0.4
"""Share of the light that remains in the deepest corner: with less, slits between furniture turn black."""
DEPTH_OF_CORNERS: Final = 2.0
"""Share of the light lost per occluded share of the neighbourhood. With twice as much it recognised 1 to 2 % fewer."""
RAYS: Final = 8
"""Samples of the neighbourhood per pixel. The 16 pixels of a 4 x 4 square use different sets and are then averaged."""
NEARBY: Final = 1.0
"""A thing darkens what is less than this far behind its edge, metres. At any distance, doorways would be dark."""
AROUND: Final = 1 / 16
"""It does so up to this far beside its edge, metres in a picture one metre away."""
BEHIND: Final = 4.0
"""Share of the light lost there per share by which the neighbourhood is nearer to the eye, ..."""
MOST: Final = 0.6
"""... and at most. 6 % more targets are recognised with it than without."""
SHADE: Final = 0.4
"""Share of the light that a place loses if the whole cone above it is covered: light still comes from the sides."""
CONE: Final = 0.6
"""Light from above comes from within this horizontal distance, metres, which blurs the edges of shadows as much, ..."""
STEEP: Final = 0.9
"""... and at least this steeply, metres down per metre aside: a flatter cone would darken floors beside furniture."""
LEVEL: Final = np.float32(0.2)
"""Least upward component of the normal of a surface on which objects cast shadows."""
SIZE: Final = 0.25
"""Radius of the strongest light from one metre away, metres: the median window's, seen from the middle of its room."""
DIRECT: Final = 0.6
"""Largest share of the light that comes from there: shadows are never darker than the rest allows."""
FARTHEST: Final = 16
"""Longest way on which an object is looked for, steps: farther shadows are blurred away."""
TALLEST: Final = 2.1
"""Objects that reach higher over their floor than this cast no shadow, because they reach above the lamps; metres."""
VOID: Final = np.float32(1e9)
"""Depth of empty pixels, metres. Infinity would give NaN in the formulas."""
LEAN: Final = np.float32(0.08)
"""Sine of the angle above the surface below which neighbours do not count: they are the rounded surface itself."""
STEPS: Final = 4
"""Number of steps towards the light that are skipped together where nothing around them is high enough."""
_CLOSE: Final = np.float32(1 / (REACH * REACH))
"""Of a neighbour's squared distance, to a share of REACH: multiplying is cheaper than a root and a division."""


class Half(NamedTuple):
    """Every second pixel of every second row."""

    depth: Floats
    """(H, W), metres; VOID in empty pixels."""
    things: Floats
    """(H, W) the same, but VOID where a body is."""
    normals: Floats
    """(3, H, W) camera frame; zero in empty pixels."""
    tone: Floats
    """(H, W) the brightness of a wide face as a whole; zero for other faces."""


def ambient_occlusion(pinhole: Pinhole, gbuffer: GBuffer, overhead: OverheadMap, lamps: Light) -> Floats:
    """Return (H / 2, W / 2) the share of the light that reaches every second pixel.

    Screen-space ambient occlusion darkens corners, and things darken what is close behind their edges. The overhead map
    adds the shadows of objects above and towards the strongest light. Wide faces get the light of the probes here, too;
    other faces have it from their corners.
    """
    # Arrays are made and combined here: in a kernel that takes a second to compile.
    half = _halved(gbuffer)
    swing, light = _swing(half.depth.shape[1]), np.empty_like(half.depth)
    _occlusion(half, np.float32(pinhole.focal / 2), swing, light)
    taken = np.zeros_like(light)
    _set_off(half, ONE / half.depth, ONE / half.things, AROUND * pinhole.focal / 2, taken)
    light *= ONE - np.minimum(np.float32(BEHIND / RAYS / 2) * taken * half.depth, np.float32(MOST))
    _shadow(half, pinhole, pinhole.axes.astype(np.float32), overhead, lamps, jitter(lamps), swing, light)
    smoothed = light.copy()
    _smooth(light, half, smoothed)
    return smoothed


def _halved(gbuffer: GBuffer) -> Half:
    shape = (gbuffer.surface.shape[0] + 1) // 2, (gbuffer.surface.shape[1] + 1) // 2
    depth, things = np.full(shape, VOID, np.float32), np.full(shape, VOID, np.float32)
    half = Half(depth, things, np.zeros((3, *shape), np.float32), np.zeros(shape, np.float32))
    _halve(gbuffer, half)
    return half


@compiled
def _halve(gbuffer: GBuffer, half: Half) -> None:
    depth, things, normals, tone = half
    height, width = depth.shape
    for row in range(height):
        for column in range(width):
            number = gbuffer.surface[2 * row, 2 * column]
            if number >= 0 and gbuffer.table[number, KIND] != PANE:  # A window takes no light from its frame.
                depth[row, column] = ONE / gbuffer.inverse_depth[2 * row, 2 * column]
                if gbuffer.table[number, KIND] != SKIN:
                    things[row, column] = depth[row, column]
                if gbuffer.table[number, KIND] == WIDE:
                    tone[row, column] = gbuffer.table[number, BRIGHT]
                for axis in range(3):
                    normals[axis, row, column] = gbuffer.table[number, FLAT + axis]


@compiled
def _occlusion(half: Half, focal: float, swing: Floats, light: Floats) -> None:
    """Write the share of the light that corners leave.

    Each step is a loop of its own over a whole row, simple enough to be vectorized: places of the samples, their
    depths, the light that they take.
    """
    height, width = half.depth.shape
    depths, columns, place = half.depth.ravel(), floats(width), ints(width)
    r, c, far, radius, taken = floats(width), floats(width), floats(width), floats(width), floats(width)
    for k in range(width):
        columns[k] = k
    scale, mid, centre = ONE / focal, np.float32(width / 2 - 0.5), np.float32(height / 2 - 0.5)
    high, wide, reach, most = np.float32(height), np.float32(width), focal * np.float32(REACH), np.float32(width / 8)
    for row in range(height):
        z, here = half.depth[row], np.float32(row)
        nx, ny, nz = half.normals[0, row], half.normals[1, row], half.normals[2, row]
        down = (here - centre) * scale
        for k in range(width):
            radius[k] = min(max(reach / z[k], TWO), most)
            taken[k] = ZERO
        for ray in range(RAYS):
            up, aside = swing[row % 4, ray, 0], swing[row % 4, ray, 1]
            for k in range(width):
                y, x = np.floor(here + up[k] * radius[k] + HALF), np.floor(columns[k] + aside[k] * radius[k] + HALF)
                # A sample outside the picture becomes the pixel itself, which takes no light.
                inside = (y >= ZERO) & (y < high) & (x >= ZERO) & (x < wide)
                r[k], c[k] = (y if inside else here), (x if inside else columns[k])
            for k in range(width):
                place[k] = np.int32(r[k]) * np.int32(width) + np.int32(c[k])
            for k in range(width):
                far[k] = depths[place[k]]
            for k in range(width):
                x, y, deep = (columns[k] - mid) * scale * z[k], down * z[k], far[k]
                dx, dy, dz = (c[k] - mid) * scale * deep - x, (r[k] - centre) * scale * deep - y, deep - z[k]
                square = dx * dx + dy * dy + dz * dz + TINY
                slope = (dx * nx[k] + dy * ny[k] + dz * nz[k]) / np.sqrt(square) - LEAN
                taken[k] += max(ZERO, slope) * max(ZERO, ONE - square * _CLOSE)
        for k in range(width):
            light[row, k] = max(np.float32(DARKEST), ONE - np.float32(DEPTH_OF_CORNERS / RAYS) * taken[k])


@inlined
def _nearer(
    z: np.float32, z1: np.float32, z2: np.float32, own: np.float32, before: np.float32, after: np.float32
) -> np.float32:
    """Return by how much two opposite neighbours are nearer to the eye than a pixel, 1/m; 0 on a plane.

    z, z1, z2: depths of the pixel and of both. own, one, two: their inverses.
    """
    gap = max(abs(z1 - z), abs(z2 - z))
    return max(ZERO, ONE - gap * np.float32(1 / NEARBY)) * max(ZERO, before + after - TWO * own)


@inlined
def _within(way: int, place: int, size: int) -> int:
    """Return a way in pixels that leaves the picture neither forwards nor backwards from a place."""
    most = min(place, size - 1 - place)
    return min(max(way, -most), most)


@compiled
def _set_off(half: Half, own: Floats, inverse: Floats, radius: float, taken: Floats) -> None:
    """Add by how much things beside each pixel are nearer. A detector trained on photos recognises more with it.

    own, inverse: (H, W) one over half.depth and half.things. radius: pixels. Opposite neighbours are compared with each
    pixel in pairs: on a plane, the mean of their inverse depths is the pixel's own. Towards the border of the picture
    they come closer to it. A body darkens nothing: own hands are so close to the eyes that all behind them would be
    black.
    """
    height, width = taken.shape
    for ray in range(RAYS):
        reach = radius * np.sqrt((ray + 0.5) / RAYS)
        down, aside = int(np.rint(reach * np.sin(GOLDEN * ray))), int(np.rint(reach * np.cos(GOLDEN * ray)))
        a = _within(aside, width // 2, width)
        first, last = abs(a), width - abs(a)
        for row in range(height):
            to = _within(down, row, height)
            z, z1, z2 = half.depth[row], half.things[row - to], half.things[row + to]
            o, before, after = own[row], inverse[row - to], inverse[row + to]
            for edge in range(2 * first):
                k = edge if edge < first else edge + last - first
                by = _within(aside, k, width)
                taken[row, k] += _nearer(z[k], z1[k - by], z2[k + by], o[k], before[k - by], after[k + by])
            inner, here, there = z[first:last], z1[first - a : last - a], z2[first + a : last + a]
            mine, near, off = o[first:last], before[first - a : last - a], after[first + a : last + a]
            out = taken[row, first:last]
            for k in range(out.size):
                out[k] += _nearer(inner[k], here[k], there[k], mine[k], near[k], off[k])


@compiled
def _shadow(
    half: Half, pinhole: Pinhole, axes: Floats, overhead: OverheadMap, lamps: Light, shift: Floats, swing: Floats,
    light: Floats,
) -> None:  # fmt: skip
    """Light wide faces, and darken surfaces that face up, under or close beside objects and in the shadow of the
    strongest light there.

    They get light from a cone above them. axes: pinhole's. shift: as from jitter.
    """
    height, width = half.depth.shape
    x, y, z, up, open_ = floats(width), floats(width), floats(width), floats(width), floats(width)
    storey, cell, off = ints(width), np.float32(overhead.cell), np.float32(OFFSET)
    left, near = np.float32(overhead.corner[0]), np.float32(overhead.corner[1])
    for row in range(height):
        nx, ny, nz = half.normals[0, row], half.normals[1, row], half.normals[2, row]
        for k in range(width):
            up[k] = nx[k] * axes[0, 1] + ny[k] * axes[1, 1] + nz[k] * axes[2, 1]
        # A quarter: sample k is pixel 2 k, whose middle is (2 k + .5) / 2 samples from the border.
        _on_map(half.depth[row], pinhole, overhead, row - height / 2 + 0.25, x, y, z, storey)
        _cone(overhead, storey, x, y, z, swing[row % 4], open_)
        for k in range(width):
            light[row, k] *= ONE - np.float32(SHADE) * min(ONE, up[k]) * open_[k] if up[k] >= LEVEL else ONE
        for k in range(width):
            if half.tone[row, k] == ZERO and up[k] < LEVEL:
                continue
            a = nx[k] * axes[0, 0] + ny[k] * axes[1, 0] + nz[k] * axes[2, 0]
            c = nx[k] * axes[0, 2] + ny[k] * axes[1, 2] + nz[k] * axes[2, 2]
            turn = 4 * (row % 4) + k % 4
            first = probe(
                lamps, left + x[k] * cell + off * a + shift[turn, 0], y[k] + off * up[k] + shift[turn, 1],
                near + z[k] * cell + off * c + shift[turn, 2],
            )  # fmt: skip
            bright = facing(lamps.bright, first, a, up[k], c)
            if up[k] >= LEVEL:
                aside = swing[row % 4, turn % RAYS, :, k]
                light[row, k] *= _unblocked(
                    overhead, lamps.bright, first, bright, storey[k], x[k], y[k], z[k], a, up[k], c, aside
                )
            if half.tone[row, k] > ZERO:
                light[row, k] *= bright / half.tone[row, k]


@internal
def _on_map(
    depth: Floats, pinhole: Pinhole, overhead: OverheadMap, down: float, x: Floats, y: Floats, z: Floats,
    storey: NDArray[np.int32],
) -> None:  # fmt: skip
    """Write the places of a row of pixels: x and z in cells of the map, y in metres, and the storey."""
    base, step = floats(3), floats(3)
    middle = (depth.size - 0.5) / 2
    for axis in range(3):
        step[axis] = 2 * pinhole.axes[0, axis] / pinhole.focal
        slant = 2 * down * pinhole.axes[1, axis] / pinhole.focal + pinhole.axes[2, axis]
        base[axis] = slant - middle * step[axis]
    cells, eye = np.float32(1 / overhead.cell), pinhole.eye
    east, up, north = (
        np.float32((eye[0] - overhead.corner[0]) / overhead.cell), np.float32(eye[1]),
        np.float32((eye[2] - overhead.corner[1]) / overhead.cell),
    )  # fmt: skip
    for k in range(depth.size):
        x[k] = east + depth[k] * cells * (base[0] + step[0] * np.float32(np.int32(k)))
    for k in range(depth.size):
        y[k] = up + depth[k] * (base[1] + step[1] * np.float32(np.int32(k)))
    for k in range(depth.size):
        z[k] = north + depth[k] * cells * (base[2] + step[2] * np.float32(np.int32(k)))
    for k in range(depth.size):
        storey[k] = 0
    for floor in overhead.floors[1:]:
        least = np.float32(floor - 0.1)
        for k in range(depth.size):
            storey[k] += least < y[k]


@internal
def _cone(
    overhead: OverheadMap, storey: NDArray[np.int32], x: Floats, y: Floats, z: Floats, swing: Floats, out: Floats
) -> None:
    """Write the covered share of the cone above each point of a row."""
    heights, (_, rows, columns) = overhead.heights.ravel(), overhead.heights.shape
    width, cone = x.size, np.float32(CONE / overhead.cell)
    place, over = ints(width), floats(width)
    last_row, last_column, storeys = np.float32(rows - 1), np.float32(columns - 1), np.int32(rows * columns)
    for k in range(width):
        out[k] = ZERO
    for ray in range(RAYS):
        aside, ahead = swing[ray, 0], swing[ray, 1]
        # All pixels have this sample equally far aside. Surfaces up to 3 cm higher are the point's own, within the
        # accuracy of the map.
        steep = np.float32(max(0.03, STEEP * CONE * np.sqrt((ray + 0.5) / RAYS)))
        for k in range(width):
            # Beyond the map is the outermost cell, which is empty.
            i = min(max(z[k] + ahead[k] * cone, ZERO), last_row)
            j = min(max(x[k] + aside[k] * cone, ZERO), last_column)
            place[k] = storey[k] * storeys + np.int32(i) * np.int32(columns) + np.int32(j)
        for k in range(width):
            over[k] = heights[place[k]]
        for k in range(width):
            out[k] += ONE if over[k] - y[k] > steep else ZERO
    for k in range(width):
        out[k] *= np.float32(1 / RAYS)


@inlined
def _unblocked(
    overhead: OverheadMap, cube: Floats, first: np.uint64, bright: np.float32, storey: int, x: np.float32,
    y: np.float32, z: np.float32, nx: np.float32, ny: np.float32, nz: np.float32, aside: Floats,
) -> np.float32:  # fmt: skip
    """Return the share of the light that remains if an object stands between a point and its strongest light, or 1.

    cube, first: the six values of its probe. x, z: in cells of the map. aside: where on the light it is looked for, in
    a unit disk.
    """
    one = np.uint64(1)
    east, rise, north = (
        cube[first] - cube[first + one], cube[first + np.uint64(2)] - cube[first + np.uint64(3)],
        cube[first + np.uint64(4)] - cube[first + np.uint64(5)],
    )  # fmt: skip
    lit = nx * east + ny * rise + nz * north
    if lit < np.float32(0.05) * bright or rise < np.float32(0.02):  # Light from all sides, or from no height.
        return ONE
    size = np.float32(SIZE) * np.sqrt(east * east + rise * rise + north * north)
    east, north = (east + size * aside[0]) / rise, (north + size * aside[1]) / rise
    # .01: towards a light straight above, the way along the map is 0.
    stride, blocked = np.float32(1.5) / np.sqrt(east * east + north * north + np.float32(0.01)), False
    east, north, rise = east * stride, north * stride, stride * np.float32(overhead.cell)
    # What stands on the map ends at TALLEST: the rest of the way is free.
    steps, step = min(int((np.float32(TALLEST + overhead.floors[storey]) - y) / rise), FARTHEST), 1
    y += np.float32(0.02)  # A surface is no obstacle to itself.
    # Up to half a cell aside: pictures from close by would show the cells as steps.
    x, z = x + HALF * aside[0], z + HALF * aside[1]
    while step < steps and not blocked:
        middle = np.float32(step) + np.float32(STEPS / 2 - 0.5)
        if _height(overhead.around, storey, x + east * middle, z + north * middle) > y + rise * np.float32(step):
            for near in range(step, min(step + STEPS, steps)):
                far = np.float32(near)
                blocked |= _height(overhead.heights, storey, x + east * far, z + north * far) > y + rise * far
        step += STEPS
    return ONE - min(lit / bright, np.float32(DIRECT)) if blocked else ONE


@inlined
def _height(heights: Floats, storey: int, x: np.float32, z: np.float32) -> np.float32:
    """Return the height at a place; beyond the map that of the outermost cell, which is empty."""
    i = int(min(max(float(z), 0.0), heights.shape[1] - 1.0))
    j = int(min(max(float(x), 0.0), heights.shape[2] - 1.0))
    # Numba's float is NumPy's.
    return heights[np.uint64(storey), np.uint64(i), np.uint64(j)]  # type: ignore[no-any-return]


@cache
def _swing(width: int) -> Floats:
    """Return (4, RAYS, 2, width) points in the unit disk for each pixel of four rows.

    They are spread by the golden angle, in 16 rotations.
    """
    out = np.empty((4, RAYS, 2, width), np.float32)
    for row in range(4):
        for ray in range(RAYS):
            reach = math.sqrt((ray + 0.5) / RAYS)
            for column in range(4):
                # 7 and 16 share no divisor: each of the 16 pixels has a turn of its own, and neighbours distant ones.
                angle = GOLDEN * ray + 2 * np.pi * ((4 * row + column) * 7 % 16) / 16
                out[row, ray, 0, column::4], out[row, ray, 1, column::4] = (
                    reach * math.sin(angle),
                    reach * math.cos(angle),
                )
    return out


@compiled
def _smooth(raw: Floats, half: Half, out: Floats) -> None:
    """Write the mean over four by four neighbours that lie on the same surface: each of the 16 turns once.

    out: a copy of raw.
    """
    (height, width), weight, same = raw.shape, floats(raw.shape[1]), floats(raw.shape[1])
    for row in range(height):
        for k in range(width):
            weight[k] = ONE
        for r in range(max(0, row - 2), min(height, row + 2)):
            for aside in range(-2, 2):
                first, last = max(0, -aside), min(width, width - aside)
                near, sums, weights = raw[r, first + aside : last + aside], out[row, first:last], weight[first:last]
                _same_surface(half, row, r, first, last, aside, same)
                for k in range(near.size):
                    sums[k] += same[k] * near[k]
                for k in range(near.size):
                    weights[k] += same[k]
        for k in range(width):
            out[row, k] /= weight[k]


@internal
def _same_surface(half: Half, row: int, other: int, first: int, last: int, aside: int, same: Floats) -> None:
    """Write 1 where a pixel of a row and the one aside of it in the other row lie on one surface, otherwise 0.

    Same surface: depth within 5 %, normals within 37 degrees (cosine 0.8).
    """
    nx, ny, nz = half.normals[0, row, first:last], half.normals[1, row, first:last], half.normals[2, row, first:last]
    a, first, last = half.depth[row, first:last], first + aside, last + aside
    ox, oy, oz = (
        half.normals[0, other, first:last],
        half.normals[1, other, first:last],
        half.normals[2, other, first:last],
    )
    b = half.depth[other, first:last]
    for k in range(a.size):
        near = abs(b[k] - a[k]) < np.float32(0.05) * a[k]
        alike = nx[k] * ox[k] + ny[k] * oy[k] + nz[k] * oz[k] > np.float32(0.8)
        same[k] = ONE if near & alike else ZERO
