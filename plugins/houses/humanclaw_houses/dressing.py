"""Dress a furnished room: things on tables, worktops and shelves, shoes in the hall, radiators and switches."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import islice
from typing import Final

import numpy as np

from humanclaw_houses.building import Placed
from humanclaw_houses.furnishing_context import FurnishingContext, Maker
from humanclaw_houses.furniture import small, things
from humanclaw_houses.piece_builder import Piece, SupportSurface
from humanclaw_houses.placing import beside, hang_one
from humanclaw_houses.room_occupancy import RoomOccupancy

_ON: Final[dict[str, tuple[Maker, ...]]] = {
    "kitchen_counter": (things.kettle, things.jar, things.toaster, things.board, things.jar, things.microwave,
                        things.mug, things.dish_rack, things.jar),
    "stove": (things.pan, things.kettle),
    "table": (things.candle, things.small_plant),
    "coffee_table": (things.magazines, things.mug, things.candle, things.small_plant),
    "side_table": (things.mug, things.candle),
    "nightstand": (things.glass, things.frame, things.mug, things.candle),
    "dresser": (things.frame, things.casket, things.candle, things.books, things.small_plant, things.frame),
    "console_table": (things.frame, things.casket, things.candle, things.small_plant),
    "sideboard": (things.frame, things.books, things.speaker, things.candle, things.casket, things.small_plant),
    "tv_stand": (things.speaker, things.speaker),
    "bookshelf": (things.casket, things.books, things.small_plant, things.casket),
    "shelf": (things.jar, things.casket, things.towels, things.detergent, things.books, things.casket),
    "washing_machine": (things.detergent, things.towels),
    "desk": (things.desk_lamp, things.papers, things.pens, things.books, things.mug),
    "bath_shelf": (things.toiletries, things.glass, things.candle, things.small_plant),
}  # fmt: skip
"""Things that stand on furniture of a category. All of them are tried, in random order."""
_IN: Final[dict[str, tuple[Maker, ...]]] = {
    "fridge": (things.jar, things.plate, small.bottle, things.toiletries, things.jar, things.glass),
    "wardrobe": (things.towels, things.casket, things.shoes, things.towels, things.handbag),
    "kitchen_counter": (things.pan, things.plate, things.jar),
    "dishwasher": (things.plate, things.glass, things.mug),
    "stove": (things.pan,),
}  # fmt: skip
"""Things behind the doors of furniture."""
_EMPTY: Final = 0.3
"""Share of furniture with doors that is empty."""
_AJAR: Final = 0.1
"""Share of doors and drawers that are not shut."""
_SPARE: Final = 0.02
"""Free space around a thing, metres."""
_SETTING: Final = 0.12
"""Distance from the edge of a table to the near edge of a plate's middle, metres."""
_TRIES: Final = 12
"""Places that are tried for a small thing."""


def dress(space: RoomOccupancy, context: FurnishingContext) -> None:
    """Dress one furnished room. Of what this adds, bottles in fridges can be pushed, and radiators collide."""
    _fittings(space, context)
    for _ in range(2 if space.area.kind == "bathroom" else 0):
        hang_one(space, context, context.make(things.bath_shelf), 1.1)
    for host in [obj for obj in space.objects if obj.piece.surfaces]:
        category, tops = host.piece.asset.category, host.piece.surfaces
        if category == "table":
            _lay_table(space, context, host)
        _fill(space, context, host, _ON.get(category, ()), [top for top in tops if not top.inside])
        if not context.chance(_EMPTY):
            _fill(space, context, host, _IN.get(category, ()), [top for top in tops if top.inside])
    space.objects[:] = [_ajar(obj, context) for obj in space.objects]
    if space.area.kind == "hall":
        for maker in (things.shoes, things.shoes, things.shoes, things.handbag):
            piece = context.make(maker)
            space.try_put(islice(space.spots(piece, context.rng), 40))


def _of(space: RoomOccupancy, category: str) -> list[Placed]:
    return [obj for obj in space.objects if obj.piece.asset.category == category]


def _ajar(obj: Placed, context: FurnishingContext) -> Placed:
    """Leave some doors and drawers of a piece open by up to a quarter of their range."""
    leaves = tuple(leaf.opened(float(context.rng.uniform(0.05, 0.25))) if context.chance(_AJAR) else leaf
                   for leaf in obj.piece.hinged_parts)  # fmt: skip
    return replace(obj, piece=replace(obj.piece, hinged_parts=leaves))


def _fill(
    space: RoomOccupancy,
    context: FurnishingContext,
    host: Placed,
    makers: Sequence[Maker],
    tops: Sequence[SupportSurface],
) -> None:
    """Put things on the tops of a piece, as many as find a place."""
    for number in context.rng.permutation(len(makers)) if tops else ():
        piece = context.make(makers[number])
        for _ in range(_TRIES):
            spot = _somewhere(host, piece, tops[int(context.rng.integers(len(tops)))], context.rng)
            if spot and space.rests(spot, host):
                space.put(spot)
                break


def _somewhere(host: Placed, piece: Piece, top: SupportSurface, rng: np.random.Generator) -> Placed | None:
    """Return a random place on a top, nearly square to its edges; None if it is too small."""
    yaw = float(rng.uniform(-0.15, 0.15))
    across, along = (size / 2 + _SPARE for size in (piece.size[0], piece.size[2]))
    if piece.size[1] > top.room or top.x1 - top.x0 < 2 * across or top.z1 - top.z0 < 2 * along:
        return None
    x, z = rng.uniform(top.x0 + across, top.x1 - across), rng.uniform(top.z0 + along, top.z1 - along)
    return beside(host, piece, x, z, yaw, host.y + top.y + 0.001)


def _lay_table(space: RoomOccupancy, context: FurnishingContext, table: Placed) -> None:
    """Put a plate and a glass before each chair at a table."""
    plate, glass, top = context.make(things.plate), context.make(things.glass), table.piece.surfaces[0]
    for chair in _of(space, "chair"):
        x, z = _seen_from(table, chair)
        # A chair that is farther off stands at no place of this table.
        if abs(x) > top.x1 + 0.6 or abs(z) > top.z1 + 0.6:
            continue
        ends = abs(x) / top.x1 > abs(z) / top.z1
        out = (np.sign(x) * (top.x1 - _SETTING - 0.05), z) if ends else (x, np.sign(z) * (top.z1 - _SETTING - 0.05))
        yaw = float(np.pi / 2 * np.sign(x) if ends else np.pi * (z < 0))
        for piece, right, ahead in ((plate, 0.0, 0.0), (glass, 0.12, 0.14)):
            at = out[0] + right * np.cos(yaw) - ahead * np.sin(yaw), out[1] - right * np.sin(yaw) - ahead * np.cos(yaw)
            spot = beside(table, piece, float(at[0]), float(at[1]), yaw, table.y + top.y + 0.001)
            if space.rests(spot, table, chair):
                space.put(spot)


def _seen_from(table: Placed, obj: Placed) -> tuple[float, float]:
    """Return x and z of a piece in the frame of another."""
    dx, dz, cos, sin = obj.x - table.x, obj.z - table.z, np.cos(table.yaw), np.sin(table.yaw)
    return float(cos * dx - sin * dz), float(sin * dx + cos * dz)


def _fittings(space: RoomOccupancy, context: FurnishingContext) -> None:
    """Put a radiator below each window and a switch beside each door, where the wall is free."""
    for spot in (*_radiators(space, context), *_switches(space, context)):
        if space.fits(spot):
            space.put(spot)


def _radiators(space: RoomOccupancy, context: FurnishingContext) -> Iterator[Placed]:
    for side, hole in space.windows:
        if hole.bottom > 0.75:
            piece = context.make(things.radiator, round(min(hole.width, 1.2) - 0.1, 2))
            yield space.at_wall(piece, side, hole.at - space.start(side), 0.14, gap=0.02)


def _switches(space: RoomOccupancy, context: FurnishingContext) -> Iterator[Placed]:
    piece = context.make(things.switch)
    for side, hole in space.doors:
        # Away from the hinge, where no open leaf is before it.
        along = hole.at - space.start(side) + (hole.leaf or 1) * -(hole.width / 2 + 0.14)
        if 0.05 < along < space.length(side) - 0.05:
            yield space.at_wall(piece, side, along, 1.05, gap=0.001)
