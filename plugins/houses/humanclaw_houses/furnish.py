"""The furnishing rules, one for each kind of room."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

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
from humanclaw_houses.kit import Kit, Maker
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
from humanclaw_houses.space import Space


def furnish(space: Space, kit: Kit) -> None:
    """Furnish one room by the rule of its kind."""
    _RULES[space.area.kind](space, kit)
    for side, hole in space.windows:
        if space.area.kind not in ("bathroom", "laundry", "hall", "kitchen", "landing", "stairs"):
            put_curtain(space, kit, side, hole.at, hole.width, hole.top)
    put_light(space, kit)


# -- rooms -------------------------------------------------------------------------------------------------------------
def _living(space: Space, kit: Kit) -> None:
    if not put_lounge(space, kit):
        put_couch(space, kit)
        put_wall_tv(space, kit)
    if "dining" not in kit.rooms and space.area.name == "living":
        put_dining_set(space, kit, 4, at_wall=False)
    put_couch(space, kit)
    put_at_wall(space, kit, storage.bookshelf, front=0.5)
    put_plant(space, kit)
    if kit.chance(0.6):
        put_at_wall(space, kit, storage.sideboard, front=0.5)
    put_armchair(space, kit)
    if kit.chance(0.4):
        put_armchair(space, kit)
    put_plant(space, kit)
    if kit.chance(0.5):
        put_at_wall(space, kit, tables.cushion_block, target=False)
    hang(space, kit, 5)


def _dining(space: Space, kit: Kit) -> None:
    any(put_dining_set(space, kit, count) for count in (8, 6, 4, 2)) or put_bare_table(space, kit)
    put_at_wall(space, kit, storage.sideboard, front=0.5)
    put_plant(space, kit)
    hang(space, kit, 4)


def _kitchen(space: Space, kit: Kit) -> None:
    put_counters(space, kit)
    put_dining_set(space, kit, 4 if kit.chance(0.4) else 2) or put_dining_set(space, kit, 2)
    if kit.chance(0.5):
        put_plant(space, kit)
    put_at_wall(space, kit, small.bin_)
    hang(space, kit, 2)


def _bedroom(space: Space, kit: Kit) -> None:
    put_bed(space, kit, double=True) or put_bed(space, kit, double=False)
    put_at_wall(space, kit, storage.wardrobe, front=0.6)
    if kit.chance(0.7):
        put_at_wall(space, kit, tables.dresser, front=0.55)
    if kit.chance(0.45):
        put_wall_tv(space, kit)
    if kit.chance(0.3):
        put_couch(space, kit)
    put_armchair(space, kit) if kit.chance(0.4) else put_chair(space, kit)
    if kit.chance(0.6):
        put_plant(space, kit)
    if kit.chance(0.4):
        put_at_wall(space, kit, storage.bookshelf, front=0.45)
    hang(space, kit, 4)


def _kids(space: Space, kit: Kit) -> None:
    put_bed(space, kit, double=False)
    put_work_place(space, kit)
    put_at_wall(space, kit, storage.wardrobe, front=0.6)
    put_at_wall(space, kit, storage.bookshelf, True, front=0.4)
    if kit.chance(0.4):
        put_plant(space, kit)
    for maker in (small.teddy, small.toy_ball, small.toy_car, small.toy_block, small.basket):
        put_at_wall(space, kit, maker)
    hang(space, kit, 3)


def _office(space: Space, kit: Kit) -> None:
    put_work_place(space, kit)
    for _ in range(2):
        put_at_wall(space, kit, storage.bookshelf, front=0.5)
    put_plant(space, kit)
    if kit.chance(0.7):
        put_couch(space, kit)
    if kit.chance(0.6):
        put_armchair(space, kit)
    if kit.chance(0.5):
        put_at_wall(space, kit, small.carton)
    put_at_wall(space, kit, small.bin_)
    hang(space, kit, 3)


def _bathroom(space: Space, kit: Kit) -> None:
    put_toilet(space, kit)
    put_basin(space, kit)
    order: list[tuple[Maker, float]] = [(bath.bathtub, 0.55), (bath.shower, 0.5)]
    for maker, front in order if kit.chance(0.6) else order[::-1]:
        if put_in_corner(space, kit, maker, front):
            break
    hang_one(space, kit, kit.make(bath.towel_rail), 0.85)
    if kit.chance(0.5):
        put_at_wall(space, kit, small.basket)
    put_at_wall(space, kit, small.bin_)
    if kit.chance(0.35):
        put_plant(space, kit)
    lay_mat(space, kit, 0.8, 0.55)


def _laundry(space: Space, kit: Kit) -> None:
    put_at_wall(space, kit, bath.washing_machine, front=0.65)
    put_at_wall(space, kit, storage.open_shelf, front=0.5)
    put_at_wall(space, kit, bath.vanity, front=0.6)
    for maker in (small.basket, small.carton, small.basket):
        put_at_wall(space, kit, maker)


def _hall(space: Space, kit: Kit) -> None:
    hang_one(space, kit, kit.make(storage.coat_rack), 0.75)
    if kit.chance(0.7):
        put_at_wall(space, kit, seats.bench, front=0.3)
    if kit.chance(0.7):
        console = put_at_wall(space, kit, tables.console)
        if console:
            put_above(space, console, kit.make(decor.mirror), 1.15)
    put_plant(space, kit)
    pair = kit.make(small.shoe)
    for _ in range(2):
        space.try_put(space.spots(pair, kit.rng))
    hang(space, kit, 4)
    long_x = space.length("south") > space.length("west")
    if kit.chance(0.6):
        lay_mat(space, kit, *((2.2, 0.75) if long_x else (0.75, 2.2)))


def _landing(space: Space, kit: Kit) -> None:
    """Furnish the hall upstairs, between the stairs and the bedrooms."""
    if kit.chance(0.6):
        console = put_at_wall(space, kit, tables.console)
        if console:
            put_above(space, console, kit.make(decor.mirror), 1.15)
    if kit.chance(0.5):
        put_at_wall(space, kit, storage.bookshelf, front=0.4)
    put_plant(space, kit)
    if kit.chance(0.4):
        put_couch(space, kit)
    if kit.chance(0.4):
        put_chair(space, kit)
    hang(space, kit, 4)


def _stairs(space: Space, kit: Kit) -> None:
    """Put nothing on the stairs."""


_RULES: Final[dict[str, Callable[[Space, Kit], None]]] = {
    "living": _living, "dining": _dining, "kitchen": _kitchen, "bedroom": _bedroom, "kids": _kids, "office": _office,
    "bathroom": _bathroom, "laundry": _laundry, "hall": _hall,
    "landing": _landing, "stairs": _stairs,
}  # fmt: skip
