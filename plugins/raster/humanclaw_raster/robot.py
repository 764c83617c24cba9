"""The body's looks: a blue robot with a capsule or a rounded box for each link."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

import numpy as np

from humanclaw.body import LINKS, Array, Box, Capsule
from humanclaw.world import Mesh

PALETTE: Final = np.array([[[66, 133, 214], [235, 240, 246], [34, 40, 52], [120, 232, 255]]], np.uint8)
BLUE, WHITE, DARK, GLOW = range(4)
_AROUND, _ACROSS = 14, 10
"""Meridians and parallels of a rounded surface: enough to look round, few enough to draw fast."""
_COLOURS: Final = {
    "neck": DARK,
    "spine1": DARK,
    "spine2": WHITE,
    "elbow": WHITE,
    "knee": WHITE,
    "foot": DARK,
    "hand": DARK,
}
"""Colours of the links that are not blue."""


def robot() -> dict[str, Mesh]:
    """Return joint name to the mesh of its link, in the frame of the joint, metres."""
    meshes = {}
    for link in LINKS:
        colour = _COLOURS.get(link.joint.removeprefix("left_").removeprefix("right_"), BLUE)
        meshes[link.joint] = _painted([(_skin(link.shape), colour)])
    meshes["head"] = _painted(_head())
    return meshes


def _head() -> list[tuple[Array, int]]:
    """Return a round skull, a dark visor over the face with two glowing eyes, and an ear on each side."""
    skull = _blob(np.array([0.0, 0.085, 0.012]), np.array([0.088, 0.118, 0.1]))
    visor = _blob(np.array([0.0, 0.092, 0.05]), np.array([0.074, 0.052, 0.072]))
    eyes = [_blob(np.array([x, 0.095, 0.116]), np.array([0.012, 0.017, 0.008])) for x in (-0.028, 0.028)]
    ears = [_blob(np.array([x, 0.085, 0.01]), np.array([0.016, 0.032, 0.032])) for x in (-0.088, 0.088)]
    return [(skull, BLUE), (visor, DARK), *((eye, GLOW) for eye in eyes), *((ear, WHITE) for ear in ears)]


def _skin(shape: Capsule | Box) -> Array:
    if isinstance(shape, Box):
        return _blob(np.array(shape.centre), np.array(shape.half), roundness=0.35)
    return _capsule(np.array(shape.a), np.array(shape.b), shape.radius)


def _sphere() -> Array:
    """Return (parallels, meridians + 1, 3) unit vectors from the south to the north pole (Y); each ring is closed."""
    tilt = np.linspace(-np.pi / 2, np.pi / 2, _ACROSS)[:, None]
    turn = np.linspace(0.0, 2 * np.pi, _AROUND + 1)[None]
    return np.stack([np.cos(tilt) * np.sin(turn), np.sin(tilt) + 0 * turn, np.cos(tilt) * np.cos(turn)], -1)


def _blob(centre: Array, half: Array, roundness: float = 1.0) -> Array:
    """Return a grid of points on an ellipsoid. A roundness below 1 makes it a superellipsoid: a rounded box."""
    unit = _sphere()
    return np.asarray(centre + half * np.sign(unit) * np.abs(unit) ** roundness)


def _capsule(a: Array, b: Array, radius: float) -> Array:
    """Return a grid of points on a capsule: a sphere cut at its equator, with the halves moved to a and b."""
    axis = (b - a) / np.linalg.norm(b - a)
    side = np.cross(axis, [0.0, 0.0, 1.0] if abs(axis[2]) < 0.9 else [1.0, 0.0, 0.0])
    side /= np.linalg.norm(side)
    unit = _sphere() @ np.stack([side, axis, np.cross(side, axis)])
    ends = np.where((np.arange(_ACROSS) < _ACROSS // 2)[:, None, None], a, b)
    return np.asarray(ends + radius * unit)


def _painted(parts: Iterable[tuple[Array, int]]) -> Mesh:
    """Combine grids of points with their colours into one mesh."""
    vertices, faces, uv, first = [], [], [], 0
    for grid, colour in parts:
        vertices.append(grid.reshape(-1, 3))
        faces.append(_grid_faces(*grid.shape[:2]) + first)
        uv.append(np.tile([(colour + 0.5) / PALETTE.shape[1], 0.5], (grid.shape[0] * grid.shape[1], 1)))
        first += grid.shape[0] * grid.shape[1]
    stacked = [np.concatenate(piece) for piece in (vertices, faces, uv)]
    return Mesh(stacked[0].astype(np.float32), stacked[1].astype(np.int32), stacked[2].astype(np.float32), PALETTE)


def _grid_faces(rows: int, columns: int) -> Array:
    row, column = np.meshgrid(np.arange(rows - 1), np.arange(columns - 1), indexing="ij")
    corner = (row * columns + column).ravel()
    up, along = corner + columns, corner + 1
    return np.concatenate([np.stack([corner, along, up], 1), np.stack([along, up + 1, up], 1)])
