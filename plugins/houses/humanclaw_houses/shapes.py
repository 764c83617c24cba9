"""Make the surfaces of furniture: boxes, lofts through rounded rings, tubes and leaves.

A shape is a list of charts. Charts share no vertices, so a renderer that averages normals shades each chart smoothly
and its borders sharply. Frame: metres, Y up. (u, v) are in metres until a builder fits them into a texture.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache, lru_cache
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Point = tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class Chart:
    """One smooth sheet. vertices (N, 3), faces (M, 3) counter-clockwise from outside, uv (N, 2) in metres."""

    vertices: Array
    faces: NDArray[np.int64]
    uv: Array


@dataclass(frozen=True, eq=False)
class Shape:
    charts: tuple[Chart, ...]

    @property
    def vertices(self) -> Array:
        return np.concatenate([chart.vertices for chart in self.charts])

    def __add__(self, other: Shape) -> Shape:
        return Shape(self.charts + other.charts)

    def moved(self, at: Point = (0.0, 0.0, 0.0), turn: Point = (0.0, 0.0, 0.0)) -> Shape:
        """Turn about x, then y, then z by angles in degrees, and then move by `at`."""
        matrix = _turn(turn)
        return Shape(tuple(replace(c, vertices=c.vertices @ matrix.T + np.array(at)) for c in self.charts))


def _turn(degrees: Point) -> Array:
    matrix = np.eye(3)
    for axis, angle in enumerate(np.radians(degrees)):
        if angle:
            first, second = [(1, 2), (2, 0), (0, 1)][axis]
            step = np.eye(3)
            step[first, first] = step[second, second] = np.cos(angle)
            step[first, second], step[second, first] = -np.sin(angle), np.sin(angle)
            matrix = step @ matrix
    return matrix


def sheet(corner: Point, along: Point, up: Point, cells: tuple[int, int] = (1, 1)) -> Chart:
    """Return a flat grid from a corner along two sides; its outside faces the cross product of `along` and `up`."""
    share = _lattice(cells)
    points = np.array(corner, float) + share[:, :1] * np.array(along, float) + share[:, 1:] * np.array(up, float)
    return Chart(points, _grid_faces(cells[1] + 1, cells[0] + 1), share * [math.hypot(*along), math.hypot(*up)])


@cache
def _lattice(cells: tuple[int, int]) -> Array:
    grid = np.meshgrid(np.linspace(0, 1, cells[0] + 1), np.linspace(0, 1, cells[1] + 1))
    return np.stack(grid, axis=-1).reshape(-1, 2)


@cache
def _grid_faces(rows: int, columns: int) -> NDArray[np.int64]:
    start = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)[None, :]).ravel()
    first = np.stack([start, start + 1, start + columns + 1], -1)
    second = np.stack([start, start + columns + 1, start + columns], -1)
    return np.concatenate([first, second])


def box(size: Point, at: Point = (0.0, 0.0, 0.0), skip: str = "") -> Shape:
    """Return a box; `at` is the centre of its bottom.

    skip: sides to leave out: b(ottom), t(op), l(eft), r(ight), (bac)k, f(ront).
    """
    corner, *ways = _SIDES * np.array(size)
    sides = quads(np.array([at[0] - size[0] / 2, at[1], at[2] - size[2] / 2]) + corner, np.array(ways))
    return Shape(tuple(chart for key, chart in zip("fklrtb", sides, strict=True) if key not in skip))


def quads(corners: Array, ways: Array) -> tuple[Chart, ...]:
    """Return N sheets of one cell. corners: (N, 3). ways: (2, N, 3) along and up as for a sheet, each along an axis."""
    share, faces = _lattice((1, 1)), _grid_faces(2, 2)
    points = corners[:, None] + share[:, :1] * ways[0][:, None] + share[:, 1:] * ways[1][:, None]
    uv = share * _lengths(ways).T[:, None]
    return tuple(Chart(points[k], faces, uv[k]) for k in range(len(corners)))


_SIDES: Final = np.array([
    [[0, 0, 1], [1, 0, 0], [1, 0, 1], [0, 0, 0], [0, 1, 1], [0, 0, 0]],
    [[1, 0, 0], [-1, 0, 0], [0, 0, -1], [0, 0, 1], [1, 0, 0], [1, 0, 0]],
    [[0, 1, 0], [0, 1, 0], [0, 1, 0], [0, 1, 0], [0, 0, -1], [0, 0, 1]],
], float)  # fmt: skip
"""(3, 6, 3) corner, way along and way up of the sides of a box of size 1: front, back, left, right, top, bottom."""


@dataclass(frozen=True)
class Ring:
    """A closed curve at a height: |x / rx|^power + |z / rz|^power = 1 about (x, z).

    Power 2 is an ellipse, power 8 nearly a rectangle.
    """

    y: float
    rx: float
    rz: float
    power: float = 2.0
    x: float = 0.0
    z: float = 0.0


@lru_cache(1024)
def _unit(power: float, segments: int) -> Array:
    """Return (segments + 1, 3) a ring of radius 1 around the origin."""
    angle = np.linspace(0, 2 * np.pi, segments + 1)
    # Rounded, so that sin(pi) is exactly 0: a large power would enlarge its error.
    cos, sin = np.round(np.cos(angle), 12), np.round(np.sin(angle), 12)
    x, z = (np.sign(way) * np.abs(way) ** (2 / power) for way in (cos, sin))
    return np.stack([x, np.zeros_like(x), z], -1)


def loft(rings: Sequence[Ring], segments: int = 16, bottom: bool = True, top: bool = True) -> Shape:
    """Return a surface through rings from the lowest to the highest (or inward for hollow objects), with flat ends."""
    places = np.array([(ring.x, ring.y, ring.z, ring.rx, 0.0, ring.rz) for ring in rings])[:, None]
    rows = places[..., :3] + places[..., 3:] * np.array([_unit(ring.power, segments) for ring in rings])
    uv = np.zeros((*rows.shape[:2], 2))
    uv[:, 1:, 0] = np.cumsum(_lengths(rows[:, 1:] - rows[:, :-1]).max(axis=0))
    uv[1:, :, 1] = np.cumsum(_lengths(rows[1:] - rows[:-1]).mean(axis=1))[:, None]
    # Angles run from +X to +Z, clockwise from above, so faces are reversed to look outward.
    side = Chart(rows.reshape(-1, 3), _grid_faces(*rows.shape[:2])[:, ::-1], uv.reshape(-1, 2))
    return Shape((side, *(_lid(rows[end, :-1], end < 0) for end, flat in ((0, bottom), (-1, top)) if flat)))


def _lengths(ways: Array) -> Array:
    square = ways * ways
    return np.asarray(np.sqrt(square[..., 0] + square[..., 1] + square[..., 2]))


def _lid(points: Array, up: bool) -> Chart:
    vertices = np.concatenate([points, points.sum(axis=0, keepdims=True) / len(points)])
    return Chart(vertices, _fan(len(points), up), vertices[:, ::2] * [1, -1])


@cache
def _fan(count: int, up: bool) -> NDArray[np.int64]:
    ring = np.arange(count)
    fan = np.stack([np.full(count, count), ring, (ring + 1) % count], -1)
    return fan[:, ::-1] if up else fan


def soft_box(size: Point, at: Point = (0.0, 0.0, 0.0), radius: float = 0.04, crown: float = 0.0) -> Shape:
    """Return a cushion: a box with rounded edges that stands on `at`. crown: height added to the middle of its top."""
    w, h, d = size
    # Few rings and segments where they would not be seen: thin and small cushions.
    large, thin = max(size) > 0.55, min(size) < 0.1
    r = min(radius, 0.49 * min(w, h, d))
    power = max(3.0, min(12.0, 0.75 * min(w, d) / r))
    levels = [(0.0, r), (0.3 * r, 0.3 * r), (r, 0.0), (h - r, 0.0), (h - 0.3 * r, 0.3 * r), (h, r)]
    if thin and h < 0.2:
        levels = [(0.0, 0.5 * r), (0.35 * h, 0.0), (0.65 * h, 0.0), (h, 0.5 * r)]
    elif thin:
        levels = [(0.0, r), (r, 0.0), (h - r, 0.0), (h, r)]
    rings = [Ring(at[1] + y, w / 2 - cut, d / 2 - cut, power, at[0], at[2]) for y, cut in levels]
    tops = ((0.8, 0.55), (1, 0.2)) if crown else ()
    rings += [Ring(at[1] + h + crown * k, s * w / 2, s * d / 2, power, at[0], at[2]) for k, s in tops]
    return loft(rings, 16 if large else 12)


def pillow(size: Point) -> Shape:
    """Return a pillow that lies on the origin: two bulging sheets with a seam all around and pointed corners."""
    pinch = 0.06  # Share by which the seam is drawn in at the middle of each side.
    u, v = 2 * _lattice((6, 6)).T - 1
    u, v = np.sin(u * np.pi / 2), np.sin(v * np.pi / 2)
    x = size[0] / 2 * u * (1 - pinch * (1 - v**2))
    z = size[2] / 2 * v * (1 - pinch * (1 - u**2))
    bulge = size[1] / 2 * ((1 - u**2) * (1 - v**2)) ** 0.42
    faces, uv = _grid_faces(7, 7), np.stack([x, -z], -1)
    sheets = [np.stack([x, size[1] / 2 + side * bulge, z], -1) for side in (1, -1)]
    return Shape((Chart(sheets[0], faces[:, ::-1], uv), Chart(sheets[1], faces, uv)))


def post(
    radius: float, height: float, at: Point = (0.0, 0.0, 0.0), top: float | None = None, segments: int = 8
) -> Shape:
    """Return a round bar that stands on `at`. top: its radius at the upper end."""
    end = radius if top is None else top
    rings = [Ring(at[1], radius, radius, 2, at[0], at[2]), Ring(at[1] + height, end, end, 2, at[0], at[2])]
    return loft(rings, segments)


def turned(
    profile: Sequence[tuple[float, float]], at: Point = (0.0, 0.0, 0.0), segments: int = 14, top: bool = True
) -> Shape:
    """Return a surface of revolution through (radius, height) points from the bottom up."""
    return loft([Ring(at[1] + y, r, r, 2, at[0], at[2]) for r, y in profile], segments, top=top)


def tube(path: Sequence[Point], radius: float, segments: int = 6) -> Shape:
    """Return a bent bar through points."""
    bars = [_bar(start, end, radius, segments) for start, end in pairwise(np.array(path, float))]
    return Shape(tuple(chart for bar in bars for chart in bar.charts))


def _bar(start: Array, end: Array, radius: float, segments: int) -> Shape:
    way = end - start
    length = float(np.linalg.norm(way))
    up = way / length
    side = np.array([0.0, up[2], -up[1]] if abs(up[0]) < 0.9 else [up[1], -up[0], 0.0])
    side /= np.linalg.norm(side)
    frame = np.stack([side, up, np.cross(side, up)])
    bar = post(radius, length, segments=segments)
    return Shape(tuple(replace(c, vertices=c.vertices @ frame + start) for c in bar.charts))


def ball(radius: float, at: Point = (0.0, 0.0, 0.0), squash: Point = (1.0, 1.0, 1.0), segments: int = 14) -> Shape:
    """Return a ball that stands on `at`, squashed along the axes."""
    rows = max(4, segments // 2)
    angle = np.linspace(-np.pi / 2, np.pi / 2, rows + 1)[1:-1]
    # The first and the last ring are 0.06 rad off the poles: a ring of radius 0 would have faces without area.
    angle = np.concatenate([[-np.pi / 2 + 0.06], angle, [np.pi / 2 - 0.06]])
    sx, sy, sz = (radius * s for s in squash)
    rings = [
        Ring(at[1] + sy * (1 + float(np.sin(a))), sx * float(np.cos(a)), sz * float(np.cos(a)), 2, at[0], at[2])
        for a in angle
    ]
    return loft(rings, segments)


def blade(base: Point, heading: float, length: float, width: float, rise: float, droop: float, rows: int = 4) -> Shape:
    """Return a two-sided leaf. It leaves its base at `rise` degrees and bends down by `droop` degrees."""
    t = np.linspace(0, 1, rows + 1)
    pitch = np.radians(rise - droop * (t[:-1] + t[1:]) / 2)
    reach, height = (np.append(0, np.cumsum(way)) * length / rows for way in (np.cos(pitch), np.sin(pitch)))
    out = np.array([np.sin(heading), 0.0, np.cos(heading)])
    across = np.array([np.cos(heading), 0.0, -np.sin(heading)])
    spine = np.array(base) + reach[:, None] * out + height[:, None] * np.array([0.0, 1.0, 0.0])
    edge = (width / 2 * np.sin(np.pi * np.clip(0.12 + 0.88 * t, 0, 0.985)) ** 0.8)[:, None] * across
    points = np.stack([spine - edge, spine + edge], 1).reshape(-1, 3)
    faces, uv = _grid_faces(rows + 1, 2), np.stack([np.tile([0.0, 1.0], rows + 1), np.repeat(t, 2)], -1)
    return Shape((Chart(points, faces, uv), Chart(points, faces[:, ::-1], uv)))
