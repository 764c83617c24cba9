"""Scatter small objects on tables, shelves and floors."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import islice
from typing import Final

from humanclaw_houses.building import Placed
from humanclaw_houses.furnishing_context import FurnishingContext, Maker
from humanclaw_houses.furniture import seats, small
from humanclaw_houses.placing import beside, from_household
from humanclaw_houses.room_occupancy import RoomOccupancy

# -- small objects -----------------------------------------------------------------------------------------------------
_ON_TOP: Final[dict[str, tuple[Maker, ...]]] = {
    "kitchen": (small.cup, small.bottle, small.bowl, small.pot, small.cup),
    "dining": (small.vase, small.bowl, small.bottle, small.cup),
    "living": (small.book, small.vase, small.cup, small.bowl, small.book),
    "bedroom": (small.book, small.clock, small.cup, small.vase),
    "kids": (small.book, small.toy_block, small.toy_car, small.teddy),
    "office": (small.book, small.cup, small.book, small.vase),
    "bathroom": (small.soap, small.cup),
    "laundry": (small.bottle, small.basket, small.soap),
    "hall": (small.vase, small.book, small.bowl),
    "landing": (small.vase, small.book, small.bowl),
}
_ON_FLOOR: Final[tuple[Maker, ...]] = (
    small.carton, small.basket, small.toy_ball, small.backpack, small.shoe, small.book, seats.stool,
)  # fmt: skip


def scatter(spaces: Sequence[RoomOccupancy], context: FurnishingContext, count: int) -> None:
    """Put up to `count` small objects on tops and floors, in one room after the other."""
    done = 0
    # Eight tries per object: many draws find no free place.
    for round_ in range(8 * count):
        if done >= count:
            return
        space = spaces[round_ % len(spaces)]
        on_top = context.chance(0.75)
        done += bool(_on_top(space, context) if on_top else _on_floor(space, context))


def _on_top(space: RoomOccupancy, context: FurnishingContext) -> bool:
    tops = [(obj, top) for obj in space.objects for top in obj.piece.surfaces if not top.inside]
    if not tops:
        return False
    host, top = tops[int(context.rng.integers(len(tops)))]
    makers = _ON_TOP[space.area.kind]
    piece = context.make(makers[int(context.rng.integers(len(makers)))])
    reach = (max(piece.size[0], piece.size[2]) / 2 + 0.02) * 1.1
    if piece.size[1] > top.room or top.x1 - top.x0 < 2 * reach or top.z1 - top.z0 < 2 * reach:
        return False
    for _ in range(6):
        x, z = context.rng.uniform(top.x0 + reach, top.x1 - reach), context.rng.uniform(top.z0 + reach, top.z1 - reach)
        spot = beside(host, piece, x, z, context.rng.uniform(-0.5, 0.5), top.y + host.y + 0.001)
        if space.rests(spot, host):
            return space.put(spot)
    return False


def _on_floor(space: RoomOccupancy, context: FurnishingContext) -> bool:
    maker = _ON_FLOOR[int(context.rng.integers(len(_ON_FLOOR)))]

    def put() -> Placed | None:
        return space.try_put(islice(space.spots(context.make(maker), context.rng), 40))

    return (from_household(context, "chair", put) if maker is seats.stool else put()) is not None
