"""What only its mesh can tell of a model: its front and its seat.

All of it is read off a map of heights: the mesh seen from above, in cells of 2.5 cm. Frame of the meshes: the asset's
own. "Measured" is: on the 18 seats of the generated houses.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from humanclaw.errors import SceneError
from humanclaw.world.meshes.hulls import KeepOutBox, surface
from humanclaw.world.scene import Mesh

CELL: Final = 0.025
"""Metres: twice the spacing of surface(), so that no cell of a surface stays empty."""
_MOST: Final = 100.0
"""Largest side of a mesh, metres: its map has 16 million cells, 128 MB."""
_ANYWHERE: Final = (0.4, 0.85)
_MIDDLE: Final[Mapping[str, tuple[float, float]]] = {"bed": (0.4, 0.8), "toilet": (0.5, 0.85)}
"""Where the sitting surface of a category is surely found, in shares of the depth from the back; _ANYWHERE for
others. Measured: couches are level from .32 of their depth to .94, beds from .06 to .96."""
_RIM: Final = {"toilet": 0.9}
"""Quantile of the heights from side to side that is the rim of an open bowl, whose middle bears nobody."""
_CUSHION: Final = 0.035
"""Metres by which a cushion may rise over the middle of a seat. Measured: .012."""
_LEVEL: Final = 0.85
"""Share of a line that must be level to be part of a seat. Measured: .89 where the corner of a couch cuts in."""
Field = NDArray[np.float64]
Window = tuple[int, int, int, int]


@dataclass(frozen=True, eq=False)
class HeightMap:
    """heights: (columns along x, rows along z) of the highest surface in each cell; 0 where there is none."""

    heights: Field
    x0: float
    z0: float

    @classmethod
    def of(cls, mesh: Mesh) -> HeightMap:
        """Return the map of a mesh. Raises SceneError if it is wider than 100 m."""
        wide, deep = np.ptp(mesh.vertices[:, [0, 2]], axis=0) if len(mesh.vertices) else (np.nan, np.nan)
        if not max(wide, deep) < _MOST:  # True of NaN too.
            message = f"a mesh is {wide:g} by {deep:g} m; at most {_MOST:g} m."
            raise SceneError(message, "Give its vertices in metres.")
        points = surface(mesh.vertices.astype(float), mesh.faces.astype(np.int64))
        low = points.min(axis=0)
        cells = ((points[:, [0, 2]] - low[[0, 2]]) / CELL).astype(int)
        heights = np.zeros(tuple(cells.max(axis=0) + 1))
        np.maximum.at(heights, (cells[:, 0], cells[:, 1]), points[:, 1])
        return cls(heights, float(low[0]), float(low[2]))

    def part(self, x0: float, x1: float, z0: float, z1: float) -> Window:
        """Return the cells of a part of the footprint, given in shares of it; at least one."""
        w, d = self.heights.shape
        a, b, c, e = int(x0 * w), int(np.ceil(x1 * w)), int(z0 * d), int(np.ceil(z1 * d))
        return a, max(b, a + 1), c, max(e, c + 1)

    def box(self, window: Window, y: float) -> KeepOutBox:
        a, b, c, d = window
        return KeepOutBox(self.x0 + a * CELL, self.z0 + c * CELL, self.x0 + b * CELL, self.z0 + d * CELL, y)

    def grown(self, window: Window, fits: NDArray[np.bool_], share: float) -> Window | None:
        """Return the window, made larger at its four sides while that much of each new line fits.

        None if it does not itself.
        """
        a, b, c, d = window
        if fits[a:b, c:d].mean() < share:
            return None
        w, e = fits.shape
        moved = True
        while moved:
            moved = False
            for k, line in enumerate((fits[a - 1, c:d] if a else None, fits[b, c:d] if b < w else None,
                                      fits[a:b, c - 1] if c else None, fits[a:b, d] if d < e else None)):  # fmt: skip
                if line is not None and line.mean() >= share:
                    a, b, c, d = a - (k == 0), b + (k == 1), c - (k == 2), d + (k == 3)
                    moved = True
                    break
        return a, b, c, d


def back_of(mesh: Mesh) -> str:
    """Find the side on which a seat rises to its back: '-z', '+z', '-x', '+x'; empty if it rises on no side or on
    all."""
    height_map = HeightMap.of(mesh)
    heights = height_map.heights
    a, b, c, d = height_map.part(0.3, 0.7, 0.3, 0.7)  # Between arms, in front of a back.
    seat = float(np.median(heights[a:b, c:d]))
    rise = np.clip(heights - seat - 0.08, 0, None)  # Pillows are no back.
    if rise.sum() < 1e-6:
        return ""
    x, z = np.meshgrid(*(np.linspace(-1, 1, n) for n in heights.shape), indexing="ij")
    along = float((x * rise).sum() / rise.sum()), float((z * rise).sum() / rise.sum())
    axis = int(abs(along[1]) >= abs(along[0]))
    # Measured: the least of a back is .48, that of a stool, a table or a bathtub at most .01.
    if abs(along[axis]) < 0.12:
        return ""
    return ("-" if along[axis] < 0 else "+") + "xz"[axis]


@dataclass(frozen=True)
class Seat:
    """Height of a sitting surface, and the part of the footprint over which nothing else rises. Metres."""

    height: float
    room: KeepOutBox | None


def seat_of(mesh: Mesh, category: str = "") -> Seat:
    """Find the sitting surface of a mesh whose back is at -Z."""
    height_map, middle = HeightMap.of(mesh), _MIDDLE.get(category, _ANYWHERE)
    a, b, c, d = height_map.part(0.35, 0.65, *middle)
    inside = height_map.heights[:, c:d] if category in _RIM else height_map.heights[a:b, c:d]
    inside = inside[inside > 0.1]  # Holes, and feet seen through them: nobody sits lower than 10 cm.
    height = round(float(np.quantile(inside, _RIM.get(category, 0.5))), 3) if inside.size else 0.0
    low = height_map.heights < height + _CUSHION
    # Where that window is not level, a smaller one may be.
    windows = (a, b, c, d), height_map.part(0.42, 0.58, 0.5, 0.75)
    window = next(filter(None, (height_map.grown(each, low, _LEVEL) for each in windows)), None)
    return Seat(height, height_map.box(window, height) if window else None)
