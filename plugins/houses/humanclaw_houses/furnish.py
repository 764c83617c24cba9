"""The furnishing rules, one for each kind of room."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from humanclaw_houses.furnishing_context import FurnishingContext, Maker
from humanclaw_houses.furniture import bath, decor, seats, small, storage, tables
from humanclaw_houses.groups import (
    put_bare_table,
    put_basin,
    put_bed,
    put_counters,
    put_dining_set,
    put_lounge,
    put_toilet,
    put_wall_tv,
    put_work_place,
)
from humanclaw_houses.placing import (
    hang,
    hang_one,
    lay_mat,
    put_above,
    put_armchair,
    put_at_wall,
    put_chair,
    put_couch,
    put_curtain,
    put_in_corner,
    put_light,
    put_plant,
)
from humanclaw_houses.room_occupancy import RoomOccupancy


def furnish(space: RoomOccupancy, context: FurnishingContext) -> None:
    """Furnish one room by the rule of its kind."""
    _RULES[space.area.kind](space, context)
    for side, hole in space.windows:
        if space.area.kind not in ("bathroom", "laundry", "hall", "kitchen", "landing", "stairs"):
            put_curtain(space, context, side, hole.at, hole.width, hole.top)
    put_light(space, context)


# -- rooms -------------------------------------------------------------------------------------------------------------
def _living(space: RoomOccupancy, context: FurnishingContext) -> None:
    if not put_lounge(space, context):
        put_couch(space, context)
        put_wall_tv(space, context)
    if "dining" not in context.rooms and space.area.name == "living":
        put_dining_set(space, context, 4, at_wall=False)
    put_couch(space, context)
    put_at_wall(space, context, storage.bookshelf, front=0.5)
    put_plant(space, context)
    if context.chance(0.6):
        put_at_wall(space, context, storage.sideboard, front=0.5)
    put_armchair(space, context)
    if context.chance(0.4):
        put_armchair(space, context)
    put_plant(space, context)
    if context.chance(0.5):
        put_at_wall(space, context, tables.cushion_block, target=False)
    hang(space, context, 5)


def _dining(space: RoomOccupancy, context: FurnishingContext) -> None:
    any(put_dining_set(space, context, count) for count in (8, 6, 4, 2)) or put_bare_table(space, context)
    put_at_wall(space, context, storage.sideboard, front=0.5)
    put_plant(space, context)
    hang(space, context, 4)


def _kitchen(space: RoomOccupancy, context: FurnishingContext) -> None:
    put_counters(space, context)
    put_dining_set(space, context, 4 if context.chance(0.4) else 2) or put_dining_set(space, context, 2)
    if context.chance(0.5):
        put_plant(space, context)
    put_at_wall(space, context, small.bin_)
    hang(space, context, 2)


def _bedroom(space: RoomOccupancy, context: FurnishingContext) -> None:
    put_bed(space, context, double=True) or put_bed(space, context, double=False)
    put_at_wall(space, context, storage.wardrobe, front=0.6)
    if context.chance(0.7):
        put_at_wall(space, context, tables.dresser, front=0.55)
    if context.chance(0.45):
        put_wall_tv(space, context)
    if context.chance(0.3):
        put_couch(space, context)
    put_armchair(space, context) if context.chance(0.4) else put_chair(space, context)
    if context.chance(0.6):
        put_plant(space, context)
    if context.chance(0.4):
        put_at_wall(space, context, storage.bookshelf, front=0.45)
    hang(space, context, 4)


def _kids(space: RoomOccupancy, context: FurnishingContext) -> None:
    put_bed(space, context, double=False)
    put_work_place(space, context)
    put_at_wall(space, context, storage.wardrobe, front=0.6)
    put_at_wall(space, context, storage.bookshelf, True, front=0.4)
    if context.chance(0.4):
        put_plant(space, context)
    for maker in (small.teddy, small.toy_ball, small.toy_car, small.toy_block, small.basket):
        put_at_wall(space, context, maker)
    hang(space, context, 3)


def _office(space: RoomOccupancy, context: FurnishingContext) -> None:
    put_work_place(space, context)
    for _ in range(2):
        put_at_wall(space, context, storage.bookshelf, front=0.5)
    put_plant(space, context)
    if context.chance(0.7):
        put_couch(space, context)
    if context.chance(0.6):
        put_armchair(space, context)
    if context.chance(0.5):
        put_at_wall(space, context, small.carton)
    put_at_wall(space, context, small.bin_)
    hang(space, context, 3)


def _bathroom(space: RoomOccupancy, context: FurnishingContext) -> None:
    put_toilet(space, context)
    put_basin(space, context)
    order: list[tuple[Maker, float]] = [(bath.bathtub, 0.55), (bath.shower, 0.5)]
    for maker, front in order if context.chance(0.6) else order[::-1]:
        if put_in_corner(space, context, maker, front):
            break
    hang_one(space, context, context.make(bath.towel_rail), 0.85)
    if context.chance(0.5):
        put_at_wall(space, context, small.basket)
    put_at_wall(space, context, small.bin_)
    if context.chance(0.35):
        put_plant(space, context)
    lay_mat(space, context, 0.8, 0.55)


def _laundry(space: RoomOccupancy, context: FurnishingContext) -> None:
    put_at_wall(space, context, bath.washing_machine, front=0.65)
    put_at_wall(space, context, storage.open_shelf, front=0.5)
    put_at_wall(space, context, bath.vanity, front=0.6)
    for maker in (small.basket, small.carton, small.basket):
        put_at_wall(space, context, maker)


def _hall(space: RoomOccupancy, context: FurnishingContext) -> None:
    hang_one(space, context, context.make(storage.coat_rack), 0.75)
    if context.chance(0.7):
        put_at_wall(space, context, seats.bench, front=0.3)
    if context.chance(0.7):
        console = put_at_wall(space, context, tables.console)
        if console:
            put_above(space, console, context.make(decor.mirror), 1.15)
    put_plant(space, context)
    pair = context.make(small.shoe)
    for _ in range(2):
        space.try_put(space.spots(pair, context.rng))
    hang(space, context, 4)
    long_x = space.length("south") > space.length("west")
    if context.chance(0.6):
        lay_mat(space, context, *((2.2, 0.75) if long_x else (0.75, 2.2)))


def _landing(space: RoomOccupancy, context: FurnishingContext) -> None:
    """Furnish the hall upstairs, between the stairs and the bedrooms."""
    if context.chance(0.6):
        console = put_at_wall(space, context, tables.console)
        if console:
            put_above(space, console, context.make(decor.mirror), 1.15)
    if context.chance(0.5):
        put_at_wall(space, context, storage.bookshelf, front=0.4)
    put_plant(space, context)
    if context.chance(0.4):
        put_couch(space, context)
    if context.chance(0.4):
        put_chair(space, context)
    hang(space, context, 4)


def _stairs(space: RoomOccupancy, context: FurnishingContext) -> None:
    """Put nothing on the stairs."""


_RULES: Final[dict[str, Callable[[RoomOccupancy, FurnishingContext], None]]] = {
    "living": _living, "dining": _dining, "kitchen": _kitchen, "bedroom": _bedroom, "kids": _kids, "office": _office,
    "bathroom": _bathroom, "laundry": _laundry, "hall": _hall,
    "landing": _landing, "stairs": _stairs,
}  # fmt: skip
