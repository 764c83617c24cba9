"""Many parts with many materials as one mesh with one atlas."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from humanclaw.body.pose import Array
from humanclaw.world.meshes.parts import Part
from humanclaw.world.scene import Mesh

CELL: Final = 128
"""Pixels along a side of a picture's cell in the atlas."""
_BLOCK: Final = 4
"""Pixels along a side of a plain colour's block: a filter that reads neighbours in its middle meets no other colour."""
_REPEATS: Final = 4
"""How often a picture may repeat across its cell; what repeats more often is drawn larger."""


def bake(parts: Sequence[Part], cell: int = CELL) -> Mesh:
    """Make one mesh of some parts: pictures in the cells of an atlas, all plain colours together in one cell more."""
    pictures = {id(part.picture): part.picture for part in parts if part.picture is not None}
    colours = sorted({part.colour for part in parts if part.picture is None})
    pieces = [_unrolled(part) for part in parts]
    repeats = {
        key: max(span for part, (_, _, _, span) in zip(parts, pieces, strict=True) if id(part.picture) == key)
        for key in pictures
    }
    tiles = [_tiled(picture, repeats[key], cell) for key, picture in pictures.items()]
    palette = _palette(colours)
    picture, corners, extent = atlas([*tiles, *([palette] if colours else [])])
    places = dict(zip(pictures, corners, strict=False))
    vertices, faces, uvs, count = [], [], [], 0
    for part, (points, triangles, uv, _) in zip(parts, pieces, strict=True):
        if part.picture is None:
            spot = _spot(colours.index(part.colour), len(palette)) * extent + corners[-1]
            uv = np.tile(spot, (len(points), 1))
        else:
            key = id(part.picture)
            uv = np.clip(uv / repeats[key], 0.0, 1.0) * extent + places[key]
        vertices.append(points)
        faces.append(triangles + count)
        uvs.append(uv)
        count += len(points)
    return _welded(np.concatenate(vertices), np.concatenate(faces), np.concatenate(uvs), picture)


def _unrolled(part: Part) -> tuple[Array, NDArray[np.int64], Array, int]:
    """Return a part whose uv begin at 0 on every face, and how many repeats of the picture its widest face covers."""
    if part.picture is None or part.uv is None:
        return part.vertices, part.faces, np.zeros((len(part.vertices), 2)), 1
    corner = part.uv[part.faces]
    low = np.floor(corner.min(axis=1) + 1e-4)
    span = (corner.max(axis=1) - low).max(axis=1)
    wide = np.maximum(span / _REPEATS, 1.0)
    uv = (corner - low[:, None]) / wide[:, None, None]
    count = int(np.clip(np.ceil(np.minimum(span, _REPEATS).max() - 1e-3), 1, _REPEATS))
    faces = np.arange(part.faces.size).reshape(-1, 3)
    return part.vertices[part.faces].reshape(-1, 3), faces, np.maximum(uv, 0.0).reshape(-1, 2), count


def _tiled(picture: NDArray[np.uint8], repeats: int, cell: int) -> NDArray[np.uint8]:
    """(cell, cell, 3) a picture, repeated so often."""
    side = max(cell // repeats, 1)
    small = np.asarray(Image.fromarray(picture).resize((side, side), Image.Resampling.BOX), np.uint8)
    whole = np.tile(small, (repeats, repeats, 1))
    return np.asarray(Image.fromarray(whole).resize((cell, cell), Image.Resampling.NEAREST), np.uint8)


def _palette(colours: Sequence[tuple[int, int, int]]) -> NDArray[np.uint8]:
    """Return a square of blocks, one a colour."""
    across = max(1, int(np.ceil(np.sqrt(len(colours)))))
    square = np.zeros((across * across, 3), np.uint8)
    square[: len(colours)] = np.array(colours, np.uint8).reshape(-1, 3)
    return square.reshape(across, across, 3).repeat(_BLOCK, axis=0).repeat(_BLOCK, axis=1)


def _spot(index: int, side: int) -> Array:
    """(2,) uv of the middle of a colour's block within its cell."""
    across = side // _BLOCK
    row, column = divmod(index, across)
    return np.array([(column + 0.5) / across, 1 - (row + 0.5) / across])


def atlas(tiles: Sequence[NDArray[np.uint8]]) -> tuple[NDArray[np.uint8], list[Array], Array]:
    """Put square tiles in a grid; return it with the lower left corner of each in uv, and their common extent."""
    side = max(len(tile) for tile in tiles)
    columns = int(np.ceil(np.sqrt(len(tiles))))
    rows = int(np.ceil(len(tiles) / columns))
    picture = np.zeros((rows * side, columns * side, 3), np.uint8)
    # Half a pixel stays free at each border of a cell: a sample on the edge must not fall into the neighbour.
    inset = 0.5 / np.array([columns * side, rows * side])
    corners = []
    for number, tile in enumerate(tiles):
        row, column = divmod(number, columns)
        large = np.asarray(Image.fromarray(tile).resize((side, side), Image.Resampling.NEAREST), np.uint8)
        picture[row * side : (row + 1) * side, column * side : (column + 1) * side] = large
        corners.append(np.array([column / columns, 1 - (row + 1) / rows]) + inset)
    return picture, corners, np.array([1 / columns, 1 / rows]) - 2 * inset


def _welded(vertices: Array, faces: NDArray[np.int64], uv: Array, atlas: NDArray[np.uint8]) -> Mesh:
    """Vertices that are alike become one; faces without area go. Rounded to hundredths of a millimetre."""
    rows = np.concatenate([np.round(vertices, 5) + 0.0, np.round(uv, 5)], axis=1)
    rows, place = np.unique(rows, axis=0, return_inverse=True)
    faces = place.ravel()[faces]
    a, b, c = (rows[faces[:, k], :3] for k in range(3))
    faces = faces[np.linalg.norm(np.cross(b - a, c - a), axis=1) > 1e-10]
    return used(rows[:, :3], faces, rows[:, 3:], atlas)


def used(vertices: NDArray[Any], faces: NDArray[np.int64], uv: NDArray[Any], texture: NDArray[np.uint8]) -> Mesh:
    """Without the vertices that no face names."""
    used, place = np.unique(faces, return_inverse=True)
    return Mesh(
        vertices[used].astype(np.float32), place.reshape(-1, 3).astype(np.int32), uv[used].astype(np.float32), texture
    )


def area(mesh: Mesh) -> float:
    """Surface of a mesh, square metres."""
    a, b, c = (mesh.vertices[mesh.faces[:, k]].astype(float) for k in range(3))
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)
