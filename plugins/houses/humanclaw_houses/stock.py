"""Replace parametric furniture by imported furniture of the same kind and a similar size."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np
from manifold3d import Manifold

from humanclaw.records import SEATS
from humanclaw.world import Asset, exact
from humanclaw_houses.building import Placed
from humanclaw_houses.importers.categories import sits
from humanclaw_houses.library import Entry, Library
from humanclaw_houses.model import Piece, Top
from humanclaw_houses.space import turn

CATEGORY: Final = {
    "couch": "couch", "armchair": "chair", "dining_chair": "chair", "office_chair": "chair", "stool": "chair",
    "bench": "bench", "bed": "bed", "tv": "tv", "wall_tv": "tv", "toilet": "toilet", "plant": "potted_plant",
    "coffee_table": "coffee_table", "side_table": "side_table", "dining_table": "table", "desk": "desk",
    "nightstand": "nightstand", "dresser": "dresser", "wardrobe": "wardrobe", "bookshelf": "bookshelf",
    "sideboard": "sideboard", "tv_stand": "tv_stand", "floor_lamp": "lamp", "table_lamp": "lamp", "bathtub": "bathtub",
    "washing_machine": "washing_machine", "fridge": "fridge", "bin": "bin", "cushion_block": "pouffe", "vase": "vase",
    "cup": "cup", "bottle": "bottle", "bowl": "bowl", "book": "book", "clock": "clock", "backpack": "backpack",
    "toy_ball": "ball", "basket": "basket", "carton": "box", "teddy": "teddy_bear", "laptop": "laptop",
}  # fmt: skip
"""Maker of a parametric piece to the category that may replace it. Kitchen units stay, because they are cut to fit."""
_SCALE: Final = 0.1
"""Largest share by which a model is scaled up or down, equally along all axes."""
_SMALLER: Final = 1.5
"""Largest factor by which a model may be smaller than the wanted piece along an axis, or higher."""
_WIDER: Final = 1.2
"""Largest factor by which a model may be wider or deeper: rules rely on the free floor around a piece."""
_SEAT: Final = (0.36, 0.64)
"""Lowest and highest seat of couches, beds and toilets that can be sat on, metres."""
_STEP: Final = 0.03
"""Distance by which a chair is moved back from a table in one step, metres."""
_STEPS: Final = 16
"""Largest number of such steps."""
_FLAT: Final = 0.14
"""Largest depth of a television on a wall, metres."""


class Stock:
    """Pieces of a library for one house. Its choices depend only on the library and the random numbers."""

    def __init__(self, library: Library, rng: np.random.Generator) -> None:
        self._library, self._rng = library, rng
        self._pieces: dict[tuple[str, float], Piece] = {}

    def instead_of(self, maker: str, wanted: Piece) -> Piece:
        """Return an imported piece similar to `wanted`, which `maker` made; `wanted` itself if there is none."""
        found = [(entry, scale) for entry in self._fitting(maker, wanted) if (scale := _scale(entry, wanted))]
        if not found:
            return wanted
        entry, scale = found[int(self._rng.integers(len(found)))]
        return self._piece(entry, scale, wanted)

    def _fitting(self, maker: str, wanted: Piece) -> list[Entry]:
        category = CATEGORY.get(maker)
        return [
            entry for entry in self._library.entries
            if entry.category == category
            and (entry.top is not None or all(top.inside for top in wanted.tops) or maker == "bookshelf")
            and (maker != "wall_tv" or entry.size[2] <= _FLAT)
        ]  # fmt: skip

    def _piece(self, entry: Entry, scale: float, wanted: Piece) -> Piece:
        key = entry.id, scale
        if key not in self._pieces:
            self._pieces[key] = _scaled(self._library.asset(entry), entry, scale)
        mass = entry.mass if entry.mass and wanted.mass else wanted.mass
        return replace(self._pieces[key], mass=mass, friction=wanted.friction)


def _scale(entry: Entry, wanted: Piece) -> float | None:
    """Return the scale at which a model is closest to the wanted size; None if even then it does not fit."""
    # The geometric mean of the three ratios: twice as wide and half as deep cancel out.
    have = np.maximum(entry.size, 1e-6)
    scale = round(float(np.clip(np.exp(np.log(wanted.size / have).mean()), 1 - _SCALE, 1 + _SCALE)), 2)
    ratio = have * scale / wanted.size
    too_large = ratio[[0, 2]].max() > _WIDER or ratio[1] > _SMALLER
    if too_large or ratio.min() < 1 / _SMALLER or not _sittable(entry, scale):
        return None
    return scale


def _sittable(entry: Entry, scale: float) -> bool:
    """Return whether a body can sit at the height of the seat; true for categories without a seat."""
    if entry.category not in SEATS or entry.seat_height is None:
        return True
    return _SEAT[0] <= scale * entry.seat_height <= _SEAT[1]


def _scaled(asset: Asset, entry: Entry, scale: float) -> Piece:
    mesh = replace(asset.mesh, vertices=exact(asset.mesh.vertices.astype(float) * scale))
    hulls = tuple(exact(hull.astype(float) * scale) for hull in asset.hulls)
    seat = None if entry.seat_height is None or not sits(entry.category) else round(entry.seat_height * scale, 4)
    name = entry.id if scale == 1.0 else f"{entry.id}@{scale:.2f}"
    top = entry.top
    tops: tuple[Top, ...] = ()
    if top is not None:
        tops = (Top(scale * top.x0, scale * top.z0, scale * top.x1, scale * top.z1, scale * top.y),)
    return Piece(replace(asset, name=name, mesh=mesh, hulls=hulls, seat_height=seat), tops)


def apart(chair: Placed, table: Placed) -> Placed:
    """Return a chair at a table, moved back until the two no longer overlap: some armrests do not fit under the top.

    Parametric chairs fit under parametric tables, so they stay where they are.
    """
    if {chair.piece.asset.source, table.piece.asset.source} == {"generated"}:
        return chair
    for _ in range(_STEPS):
        if not _share_space(chair, table):
            break
        x, z = chair.x - _STEP * np.sin(chair.yaw), chair.z - _STEP * np.cos(chair.yaw)
        chair = replace(chair, x=float(x), z=float(z))
    return chair


def _share_space(one: Placed, other: Placed) -> bool:
    """Return whether a collision hull of one piece overlaps one of the other's."""
    first, second = _solids(one), _solids(other)
    return any((a ^ b).volume() > 1e-6 for a in first for b in second)


def _solids(obj: Placed) -> list[Manifold]:
    offset = np.array([obj.x, obj.y, obj.z])
    return [Manifold.hull_points(turn(np.asarray(hull, float), obj.yaw) + offset) for hull in obj.piece.asset.hulls]
