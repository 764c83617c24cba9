"""Rules by which rooms are furnished: beds against walls, chairs at tables, the television opposite the couch."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from humanclaw_houses.building import Placed
from humanclaw_houses.furniture import bath, beds, decor, kitchen, media, plants, seats, small, storage, tables
from humanclaw_houses.model import Piece
from humanclaw_houses.plan import CEILING
from humanclaw_houses.space import SIDES, YAW, Rect, Side, Space, at_hand, block_of, local, turn
from humanclaw_houses.stock import Stock, apart
from humanclaw_houses.style import Style

Maker = Callable[[Style, str], Piece]
_COUCHES: Final = (0.3, 0.3, 0.25, 0.15)
"""Shares of the households with one to four couches, as far as there is room for them."""


@dataclass(eq=False)
class Kit:
    """What the rules draw on: the taste of the house, its random numbers, and names for new pieces."""

    style: Style
    rng: np.random.Generator
    rooms: tuple[str, ...]
    """Kinds of room in this house."""
    stock: Stock | None = None
    """Imported furniture, taken where it has what a rule asks for."""
    left: dict[str, int] = field(default_factory=dict)
    """How many more chairs and couches this household has."""
    _count: dict[str, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        couches, chairs = self.rng.choice(4, p=_COUCHES) + 1, self.rng.integers(1, 15)
        self.left.update(couch=int(couches), chair=int(chairs))

    def name(self, word: str) -> str:
        self._count[word] = self._count.get(word, 0) + 1
        return f"{word}_{self._count[word]}"

    def make(self, maker: Callable[..., Piece], *args: object, **options: object) -> Piece:
        word = maker.__name__.rstrip("_")
        piece = maker(self.style, self.name(word), *args, **options)
        return self.stock.instead_of(word, piece) if self.stock else piece

    def chance(self, share: float) -> bool:
        return bool(self.rng.random() < share)


def furnish(space: Space, kit: Kit) -> None:
    """Furnish one room by the rule of its kind."""
    _RULES[space.area.kind](space, kit)
    for side, hole in space.windows:
        if space.area.kind not in ("bathroom", "laundry", "hall", "kitchen", "landing", "stairs"):
            _curtain(space, kit, side, hole.at, hole.width, hole.top)
    _light(space, kit)


# -- rooms -------------------------------------------------------------------------------------------------------------
def _living(space: Space, kit: Kit) -> None:
    if not _lounge(space, kit):
        _couch(space, kit)
        _wall_tv(space, kit)
    if "dining" not in kit.rooms and space.area.name == "living":
        _dining_set(space, kit, 4, at_wall=False)
    _couch(space, kit)
    _stand(space, kit, storage.bookshelf, front=0.5)
    _plant(space, kit)
    if kit.chance(0.6):
        _stand(space, kit, storage.sideboard, front=0.5)
    _armchair(space, kit)
    if kit.chance(0.4):
        _armchair(space, kit)
    _plant(space, kit)
    if kit.chance(0.5):
        _stand(space, kit, tables.cushion_block, target=False)
    _hang(space, kit, 5)


def _dining(space: Space, kit: Kit) -> None:
    any(_dining_set(space, kit, count) for count in (8, 6, 4, 2)) or _bare_table(space, kit)
    _stand(space, kit, storage.sideboard, front=0.5)
    _plant(space, kit)
    _hang(space, kit, 4)


def _kitchen(space: Space, kit: Kit) -> None:
    _counters(space, kit)
    _dining_set(space, kit, 4 if kit.chance(0.4) else 2) or _dining_set(space, kit, 2)
    if kit.chance(0.5):
        _plant(space, kit)
    _stand(space, kit, small.bin_)
    _hang(space, kit, 2)


def _bedroom(space: Space, kit: Kit) -> None:
    _bed(space, kit, double=True) or _bed(space, kit, double=False)
    _stand(space, kit, storage.wardrobe, front=0.6)
    if kit.chance(0.7):
        _stand(space, kit, tables.dresser, front=0.55)
    if kit.chance(0.45):
        _wall_tv(space, kit)
    if kit.chance(0.3):
        _couch(space, kit)
    _armchair(space, kit) if kit.chance(0.4) else _chair(space, kit)
    if kit.chance(0.6):
        _plant(space, kit)
    if kit.chance(0.4):
        _stand(space, kit, storage.bookshelf, front=0.45)
    _hang(space, kit, 4)


def _kids(space: Space, kit: Kit) -> None:
    _bed(space, kit, double=False)
    _work_place(space, kit)
    _stand(space, kit, storage.wardrobe, front=0.6)
    _stand(space, kit, storage.bookshelf, True, front=0.4)
    if kit.chance(0.4):
        _plant(space, kit)
    for maker in (small.teddy, small.toy_ball, small.toy_car, small.toy_block, small.basket):
        _stand(space, kit, maker)
    _hang(space, kit, 3)


def _office(space: Space, kit: Kit) -> None:
    _work_place(space, kit)
    for _ in range(2):
        _stand(space, kit, storage.bookshelf, front=0.5)
    _plant(space, kit)
    if kit.chance(0.7):
        _couch(space, kit)
    if kit.chance(0.6):
        _armchair(space, kit)
    if kit.chance(0.5):
        _stand(space, kit, small.carton)
    _stand(space, kit, small.bin_)
    _hang(space, kit, 3)


def _bathroom(space: Space, kit: Kit) -> None:
    _toilet(space, kit)
    _basin(space, kit)
    order: list[tuple[Maker, float]] = [(bath.bathtub, 0.55), (bath.shower, 0.5)]
    for maker, front in order if kit.chance(0.6) else order[::-1]:
        if _corner(space, kit, maker, front):
            break
    _hang_one(space, kit, kit.make(bath.towel_rail), 0.85)
    if kit.chance(0.5):
        _stand(space, kit, small.basket)
    _stand(space, kit, small.bin_)
    if kit.chance(0.35):
        _plant(space, kit)
    _mat(space, kit, 0.8, 0.55)


def _laundry(space: Space, kit: Kit) -> None:
    _stand(space, kit, bath.washing_machine, front=0.65)
    _stand(space, kit, storage.open_shelf, front=0.5)
    _stand(space, kit, bath.vanity, front=0.6)
    for maker in (small.basket, small.carton, small.basket):
        _stand(space, kit, maker)


def _hall(space: Space, kit: Kit) -> None:
    _hang_one(space, kit, kit.make(storage.coat_rack), 0.75)
    if kit.chance(0.7):
        _stand(space, kit, seats.bench, front=0.3)
    if kit.chance(0.7):
        console = _stand(space, kit, tables.console)
        if console:
            _above(space, console, kit.make(decor.mirror), 1.15)
    _plant(space, kit)
    pair = kit.make(small.shoe)
    for _ in range(2):
        space.try_put(space.spots(pair, kit.rng))
    _hang(space, kit, 4)
    long_x = space.length("south") > space.length("west")
    if kit.chance(0.6):
        _mat(space, kit, *((2.2, 0.75) if long_x else (0.75, 2.2)))


def _landing(space: Space, kit: Kit) -> None:
    """Furnish the hall upstairs: the way from the stairs to the bedrooms."""
    if kit.chance(0.6):
        console = _stand(space, kit, tables.console)
        if console:
            _above(space, console, kit.make(decor.mirror), 1.15)
    if kit.chance(0.5):
        _stand(space, kit, storage.bookshelf, front=0.4)
    _plant(space, kit)
    if kit.chance(0.4):
        _couch(space, kit)
    if kit.chance(0.4):
        _chair(space, kit)
    _hang(space, kit, 4)


def _stairs(space: Space, kit: Kit) -> None:
    """Nothing stands on stairs."""


_RULES: Final[dict[str, Callable[[Space, Kit], None]]] = {
    "living": _living, "dining": _dining, "kitchen": _kitchen, "bedroom": _bedroom, "kids": _kids, "office": _office,
    "bathroom": _bathroom, "laundry": _laundry, "hall": _hall,
    "landing": _landing, "stairs": _stairs,
}  # fmt: skip


# -- groups ------------------------------------------------------------------------------------------------------------
def _lounge(space: Space, kit: Kit) -> bool:
    """Television, couch opposite, low table and rug between; a smaller couch if the room asks for it."""
    for count in (3, 2):
        couch = kit.make(seats.couch, count)
        screen = kit.make(media.tv, round(float(kit.rng.uniform(1.0, 1.3)), 2))
        stand = kit.make(tables.tv_stand, round(screen.size[0] + 0.35, 2))
        for spot in space.spots(stand, kit.rng, step=0.2):
            if not space.before_window(spot) and _try_lounge(space, kit, spot, screen, couch):
                return True
    return False


def _try_lounge(space: Space, kit: Kit, stand: Placed, screen: Piece, couch: Piece) -> bool:
    side = next(s for s in SIDES if YAW[s] == stand.yaw)
    depth = space.depth(side)
    room = depth - stand.piece.size[2] - couch.size[2]
    if room < 1.5:
        return False
    gap = room - 0.05 if room < 2.9 else float(kit.rng.uniform(2.1, 2.7))
    return _seat_across(space, kit, stand, screen, couch, gap) or (
        room > 2.0 and _seat_across(space, kit, stand, screen, couch, room - 0.5)  # before an open side
    )


def _seat_across(space: Space, kit: Kit, stand: Placed, screen: Piece, couch: Piece, gap: float) -> bool:
    """Put the couch so far before the television, looking at it."""
    out = stand.piece.size[2] / 2 + gap + couch.size[2] / 2
    seat = Placed(
        couch, stand.x + out * np.sin(stand.yaw), 0.0, stand.z + out * np.cos(stand.yaw), stand.yaw + np.pi, stand.room
    )
    if not space.fits(stand, 0.6) or not space.fits(seat, 0.65):
        return False
    front = local(stand, -0.4, stand.piece.size[2] / 2, 0.4, stand.piece.size[2] / 2 + 0.55)
    knees = space.ahead(seat, 0.65)
    tv = _on_front_edge(stand, screen)
    if not space.put(stand, tv, seat, keep=[knees, front], want=[(knees,), at_hand(tv)]):
        return False
    kit.left["couch"] -= 1
    _around_couch(space, kit, seat, gap)
    return True


def _on_front_edge(stand: Placed, screen: Piece) -> Placed:
    """Return a television as far to the front of its stand as it can be, so that one can step up to it."""
    out = stand.piece.size[2] / 2 - screen.size[2] / 2 - 0.03
    y = stand.piece.tops[0].y + 0.001
    return Placed(
        screen, stand.x + out * np.sin(stand.yaw), y, stand.z + out * np.cos(stand.yaw), stand.yaw, stand.room
    )


def _around_couch(space: Space, kit: Kit, seat: Placed, gap: float) -> None:
    front = seat.piece.size[2] / 2
    rug = kit.make(decor.rug, round(seat.piece.size[0] + 0.3, 2), round(min(1.7, gap - 0.3), 2))
    _lay(space, _beside(seat, rug, 0.0, front + gap / 2 + 0.05))
    table = kit.make(tables.coffee_table)
    spot = _beside(seat, table, 0.0, front + 0.7 + table.size[2] / 2)
    if gap > 1.9 and space.fits(spot):
        space.put(spot)
    for side in (-1, 1):
        piece = kit.make(tables.side_table if side < 0 else decor.floor_lamp)
        out = side * (seat.piece.size[0] / 2 + piece.size[0] / 2 + 0.06)
        space.try_put([_beside(seat, piece, out, -front + piece.size[2] / 2 + 0.1)])


def _beside(obj: Placed, piece: Piece, x: float, z: float, yaw: float = 0.0) -> Placed:
    """Return a piece at (x, z) in the frame of another."""
    (dx, _, dz) = turn(np.array([[x, 0.0, z]]), obj.yaw)[0]
    return Placed(piece, obj.x + float(dx), 0.0, obj.z + float(dz), obj.yaw + yaw, obj.room)


def _dining_set(space: Space, kit: Kit, count: int, at_wall: bool = True) -> bool:
    """Put down a table with chairs at its long sides and room to get behind them; at_wall: or at a wall."""
    if kit.left["chair"] < count:
        return False
    table = kit.make(tables.dining_table, count)
    chair = kit.make(seats.dining_chair)
    w, _, d = table.size
    apart = {2: [0.0], 4: [-0.22 * w, 0.22 * w], 6: [-0.295 * w, 0.0, 0.295 * w],
             8: [-0.345 * w, -0.115 * w, 0.115 * w, 0.345 * w]}[count]  # fmt: skip
    if d > 1.0:  # round
        apart = [0.0]
    spots = _open_spots(space, w, d + 2 * 0.35, kit.rng)
    for x, z, yaw in spots:
        spot = Placed(table, x, 0.0, z, yaw, space.area.name)
        chairs = [_at_table(spot, chair, along, side, kit.rng) for along in apart for side in (-1, 1)]
        if d > 1.0:
            chairs += [_at_end(spot, chair, side) for side in (-1, 1)]
        if _set_down(space, kit, spot, chairs):
            return True
    for spot in space.spots(table, kit.rng, step=0.2) if at_wall else ():
        front = [_at_table(spot, chair, along, 1, kit.rng) for along in apart]
        beside = [_at_end(spot, chair, side) for side in (-1, 1)] if w < 1.0 else []
        if (beside and _set_down(space, kit, spot, beside)) or _set_down(space, kit, spot, front):
            return True
    return False


def _bare_table(space: Space, kit: Kit) -> bool:
    """Put down a table without a chair, at a wall."""
    return _stand(space, kit, tables.dining_table, 4, front=0.5) is not None


def _set_down(space: Space, kit: Kit, table: Placed, chairs: Sequence[Placed]) -> bool:
    """Place a table and its chairs if every chair can be got at."""
    want = [at_hand(chair) for chair in chairs]
    done = all(space.fits(obj) for obj in (table, *chairs)) and space.put(table, *chairs, want=want)
    kit.left["chair"] -= len(chairs) * done
    return done


def _open_spots(space: Space, w: float, d: float, rng: np.random.Generator) -> list[tuple[float, float, float]]:
    """Middles of free rectangles, away from walls if there is room."""
    r = space.rect
    found = []
    for yaw, (a, b) in ((0.0, (w, d)), (np.pi / 2, (d, w))):
        xs = np.arange(r.x0 + a / 2 + 0.06, r.x1 - a / 2 - 0.05, 0.15)
        zs = np.arange(r.z0 + b / 2 + 0.06, r.z1 - b / 2 - 0.05, 0.15)
        for x in xs:
            for z in zs:
                rect = Rect(x - a / 2, z - b / 2, x + a / 2, z + b / 2)
                if space.is_free(rect):
                    roomy = space.is_free(rect.grown(0.5)) * 2.0 + space.is_free(rect.grown(0.3))
                    found.append((roomy + float(rng.random()), float(x), float(z), float(yaw)))
    return [spot[1:] for spot in sorted(found, reverse=True)[:40]]


def _at_table(table: Placed, chair: Piece, along: float, side: int, rng: np.random.Generator) -> Placed:
    out = table.piece.size[2] / 2 + chair.size[2] / 2 - 0.16 + float(rng.uniform(0.0, 0.1))
    yaw = (np.pi if side > 0 else 0.0) + float(rng.uniform(-0.06, 0.06))
    return apart(_beside(table, chair, along, side * out, yaw), table)


def _at_end(table: Placed, chair: Piece, side: int) -> Placed:
    out = table.piece.size[0] / 2 + chair.size[2] / 2 - 0.12
    return apart(_beside(table, chair, side * out, 0.0, -side * np.pi / 2), table)


def _counters(space: Space, kit: Kit) -> None:
    """One run of units along the wall with the longest free stretch, fridge at an end, cupboards and hood above."""
    side, start, end = max((_stretch(space, side) for side in SIDES), key=lambda run: run[2] - run[1])
    fronts = kitchen.Fronts.draw(kit.style)
    pieces = _run(kit, fronts, end - start)
    if kit.chance(0.5):
        pieces = pieces[::-1]
    along = start
    for piece in pieces:
        obj = space.at_wall(piece, side, along + piece.size[0] / 2, gap=0.02)
        along += piece.size[0] + 0.002
        if space.put(obj, keep=[space.ahead(obj, 0.6)]):
            _above_unit(space, kit, fronts, obj)
    if not any(obj.piece.asset.category == "fridge" for obj in space.objects):
        _stand(space, kit, kitchen.fridge, front=0.65)


def _stretch(space: Space, side: Side) -> tuple[Side, float, float]:
    """Return the longest part of a wall along which units 0.65 m deep fit."""
    best, start, step = (side, 0.0, 0.0), 0.02, 0.05
    for at in np.arange(0.02, space.length(side) - 0.02, step):
        if not space.is_free_unit(side, float(at), step):
            start = float(at) + step
        elif at + step - start > best[2] - best[1]:
            best = (side, start, float(at) + step)
    return best


def _run(kit: Kit, fronts: kitchen.Fronts, length: float) -> list[Piece]:
    """Units that fill a length: sink and stove always if they fit, a fridge if there is room, worktops between."""
    sink, stove = kit.make(kitchen.sink, fronts), kit.make(kitchen.stove)
    left = min(length, 4.2) - 0.8 - 0.6 - 0.02
    if left < 0:
        return [sink] if length > 0.85 else []
    with_fridge = left > 1.1
    fridge = [kit.make(kitchen.fridge)] if with_fridge else []
    left -= fridge[0].size[0] if fridge else 0.0
    widths = [w for w in ([0.5 * left, 0.5 * left] if left > 1.0 else [left]) if w > 0.28]
    tops = [kit.make(kitchen.counter, fronts, round(w - 0.005, 3)) for w in widths]
    return [*fridge, *tops[:1], sink, *tops[1:], stove]


def _above_unit(space: Space, kit: Kit, fronts: kitchen.Fronts, unit: Placed) -> None:
    kind, side = unit.piece.asset.category, next(s for s in SIDES if YAW[s] == unit.yaw)
    if kind == "stove":
        piece, y = kit.make(kitchen.hood), 1.6
    elif kind in ("kitchen_counter", "sink"):
        piece, y = kit.make(kitchen.wall_cabinet, fronts, round(unit.piece.size[0] - 0.005, 3)), 1.45
    else:
        return
    along = unit.x - space.rect.x0 if side in ("south", "north") else unit.z - space.rect.z0
    obj = space.at_wall(piece, side, along, y, gap=0.002)
    if space.fits(obj, gap=-0.002):
        space.put(obj)


def _bed(space: Space, kit: Kit, double: bool) -> bool:
    """Return a bed with its head at a wall and free floor at both sides (one for a single bed) and its foot;
    nightstands and lamps."""
    bed = kit.make(beds.bed, double)
    w, _, d = bed.size
    for spot in space.spots(bed, kit.rng, step=0.15):
        left = local(spot, w / 2 + 0.01, -d / 2 + 0.45, w / 2 + 0.62, d / 2)
        right = local(spot, -w / 2 - 0.62, -d / 2 + 0.45, -w / 2 - 0.01, d / 2)
        foot = local(spot, -w / 2, d / 2 + 0.01, w / 2, d / 2 + 0.55)
        free = [rect for rect in (left, right) if space.is_free(rect)]
        if len(free) < (2 if double else 1) or not space.is_free(foot) or not space.fits(spot):
            continue
        if space.put(spot, keep=[*free, foot], want=[tuple(free)]):
            _beside_bed(space, kit, spot)
            return True
    return False


def _beside_bed(space: Space, kit: Kit, bed: Placed) -> None:
    w, _, d = bed.piece.size
    stand, lamp = kit.make(tables.nightstand), kit.make(decor.table_lamp)
    for side in (-1, 1):
        spot = _beside(bed, stand, side * (w / 2 + stand.size[0] / 2 + 0.03), -d / 2 + stand.size[2] / 2)
        if space.fits(spot) and space.put(spot):
            space.put(replace(spot, piece=lamp, y=stand.tops[0].y + 0.001))
    if kit.chance(0.7):
        rug = kit.make(decor.rug, round(w + 1.0, 2), 1.3)
        _lay(space, _beside(bed, rug, 0.0, d / 2 - 0.35))
    picture = kit.make(decor.picture, round(min(1.0, w * 0.6), 2), 0.5)
    _above(space, bed, picture, 1.45)


def _work_place(space: Space, kit: Kit) -> bool:
    """Return a desk at a wall with a chair drawn up to it; lamp and laptop on it."""
    desk = kit.make(tables.desk)
    if kit.left["chair"] < 1:
        return _stand(space, kit, tables.desk, front=0.5) is not None
    chair = kit.make(seats.office_chair if kit.chance(0.7) else seats.dining_chair)
    for spot in space.spots(desk, kit.rng, step=0.15):
        seat = apart(_beside(spot, chair, -0.19, desk.size[2] / 2 + chair.size[2] / 2 - 0.12, np.pi), spot)
        if space.fits(spot, 0.95) and space.put(spot, seat, want=[at_hand(seat)]):
            kit.left["chair"] -= 1
            y = desk.tops[0].y + 0.002
            space.put(replace(_beside(spot, kit.make(media.laptop), -0.19, 0.02), y=y))
            space.put(replace(_beside(spot, kit.make(decor.table_lamp), desk.size[0] / 2 - 0.2, -0.12), y=y))
            return True
    return False


def _toilet(space: Space, kit: Kit) -> bool:
    """Return a toilet with elbow room at both sides and standing room in front."""
    piece = kit.make(bath.toilet)
    w, _, d = piece.size
    for spot in space.spots(piece, kit.rng):
        around = local(spot, -w / 2 - 0.18, -d / 2 + 0.02, w / 2 + 0.18, d / 2)
        front = local(spot, -0.35, d / 2 + 0.01, 0.35, d / 2 + 0.65)
        knees = local(spot, -0.15, d / 2 + 0.01, 0.15, d / 2 + 0.45)
        free = space.fits(spot) and space.is_free(around) and space.is_free(front)
        if free and space.put(spot, keep=[front, around], want=[(knees,)]):
            paper = kit.make(bath.paper_holder)
            space.try_put(s for s in space.spots(paper, kit.rng, y=0.62) if np.hypot(s.x - spot.x, s.z - spot.z) < 0.9)
            return True
    return False


def _basin(space: Space, kit: Kit) -> None:
    basin = _stand(space, kit, bath.vanity, front=0.6)
    if basin:
        _above(space, basin, kit.make(decor.mirror, round(basin.piece.size[0] - 0.1, 2), 0.75), 1.15)


def _wall_tv(space: Space, kit: Kit) -> Placed | None:
    """Return a screen on the wall or on a cabinet of its own, with floor to stand on before it."""
    if kit.chance(0.5):
        piece = kit.make(media.wall_tv, 1.0)
        return space.try_put(space.spots(piece, kit.rng, y=0.95), front=0.5, target=True)
    return _stand(space, kit, media.floor_tv, 1.0, front=0.5, target=True)


# -- single objects ----------------------------------------------------------------------------------------------------
def _stand(
    space: Space, kit: Kit, maker: Callable[..., Piece], *args: object, front: float = 0.0, target: bool = False
) -> Placed | None:
    """One piece against a wall."""
    return space.try_put(space.spots(kit.make(maker, *args), kit.rng), front=front, target=target)


def _corner(space: Space, kit: Kit, maker: Maker, front: float = 0.0, target: bool = False) -> Placed | None:
    """One piece as near to a corner as it can be."""
    r = space.rect
    corners = [(x, z) for x in (r.x0, r.x1) for z in (r.z0, r.z1)]
    spots = space.spots(kit.make(maker), kit.rng)
    spots.sort(key=lambda spot: min(abs(spot.x - x) + abs(spot.z - z) for x, z in corners))
    return space.try_put(spots, front=front, target=target)


def _plant(space: Space, kit: Kit) -> Placed | None:
    """Return a plant, in a corner if one is free."""
    return _corner(space, kit, plants.plant, target=True)


def _household(kit: Kit, category: str, put: Callable[[], Placed | None]) -> Placed | None:
    """Put one of those chairs or couches that the household has left."""
    placed = put() if kit.left[category] > 0 else None
    kit.left[category] -= placed is not None
    return placed


def _couch(space: Space, kit: Kit) -> Placed | None:
    """Put a couch for two at a wall."""
    return _household(kit, "couch", lambda: _stand(space, kit, seats.couch, 2, front=0.65, target=True))


def _chair(space: Space, kit: Kit) -> Placed | None:
    return _household(kit, "chair", lambda: _stand(space, kit, seats.dining_chair, front=0.3, target=True))


def _armchair(space: Space, kit: Kit) -> Placed | None:
    """Put an armchair in a corner or at a wall, turned a little towards the room."""
    return _household(kit, "chair", lambda: _turned_in(space, kit))


def _turned_in(space: Space, kit: Kit) -> Placed | None:
    piece = kit.make(seats.armchair)
    spots = []
    for spot in space.spots(piece, kit.rng, step=0.25):
        x, z = spot.x + 0.16 * np.sin(spot.yaw), spot.z + 0.16 * np.cos(spot.yaw)
        spots += [replace(spot, x=x, z=z, yaw=spot.yaw + angle) for angle in (0.35, -0.35)]
    return space.try_put(spots, front=0.5, target=True)


def _hang(space: Space, kit: Kit, count: int) -> None:
    """Pictures, and a shelf at times, on what is left of the walls."""
    for _ in range(int(kit.rng.integers(max(1, count - 1), count + 1))):
        w, h = (round(float(v), 2) for v in kit.rng.uniform((0.4, 0.4), (0.9, 0.65)))
        _hang_one(space, kit, kit.make(decor.picture, w, h), 1.4)
    if kit.chance(0.4):
        _hang_one(space, kit, kit.make(storage.wall_shelf), 1.45)


def _hang_one(space: Space, kit: Kit, piece: Piece, y: float) -> Placed | None:
    return space.try_put((replace(s, y=y) for s in _flush(space, piece, kit.rng)), gap=0.08)


def _flush(space: Space, piece: Piece, rng: np.random.Generator) -> Sequence[Placed]:
    """Spots along the walls without the gap that skirting needs."""
    return [
        replace(s, x=s.x - 0.014 * np.sin(s.yaw), z=s.z - 0.014 * np.cos(s.yaw))
        for s in space.spots(piece, rng, step=0.2)
    ]


def _above(space: Space, obj: Placed, piece: Piece, y: float) -> None:
    """Hang a piece on the wall behind another."""
    back = -obj.piece.size[2] / 2 + piece.size[2] / 2 - 0.014
    spot = replace(_beside(obj, piece, 0.0, back), y=y)
    if space.fits(spot):
        space.put(spot)


def _lay(space: Space, rug: Placed) -> None:
    """Lay a rug where it stays inside the room."""
    if block_of(rug).rect.within(space.rect):
        space.put(rug)


def _mat(space: Space, kit: Kit, w: float, d: float) -> None:
    piece = kit.make(decor.rug, w, d)
    x, z = space.rect.middle
    mat = Placed(piece, x, 0.0, z, 0.0, space.area.name)
    if space.is_free(block_of(mat).rect.grown(-0.05)):
        _lay(space, mat)


def _curtain(space: Space, kit: Kit, side: Side, at: float, width: float, top: float) -> None:
    """Curtains beside a window; they hang free of the furniture and do not collide."""
    short = kit.chance(0.5)
    height = round(top + 0.1 - (0.75 if short else 0.05), 2)
    piece = kit.make(decor.curtain, width, height, kit.style.second_cloth)
    start = space.rect.x0 if side in ("south", "north") else space.rect.z0
    spot = space.at_wall(piece, side, at - start, y=round(top + 0.1 - height, 2), gap=0.03)
    if block_of(spot).rect.within(space.rect.grown(0.001)) and space.clear_of_doors(spot):
        space.put(spot)


def _light(space: Space, kit: Kit) -> None:
    x, z = space.rect.middle
    piece = kit.make(decor.ceiling_lamp, 0.15)
    space.put(Placed(piece, x, round(CEILING - piece.size[1], 3), z, 0.0, space.area.name))


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


def scatter(spaces: Sequence[Space], kit: Kit, count: int) -> None:
    """Put up to so many small objects on tops and floors, a room at a time."""
    done = 0
    for round_ in range(8 * count):
        if done >= count:
            return
        space = spaces[round_ % len(spaces)]
        on_top = kit.chance(0.75)
        done += bool(_on_top(space, kit) if on_top else _on_floor(space, kit))


def _on_top(space: Space, kit: Kit) -> bool:
    hosts = [obj for obj in space.objects if obj.piece.tops]
    if not hosts:
        return False
    host = hosts[int(kit.rng.integers(len(hosts)))]
    top = host.piece.tops[int(kit.rng.integers(len(host.piece.tops)))]
    makers = _ON_TOP[space.area.kind]
    piece = kit.make(makers[int(kit.rng.integers(len(makers)))])
    reach = (max(piece.size[0], piece.size[2]) / 2 + 0.02) * 1.1
    if piece.size[1] > top.room or top.x1 - top.x0 < 2 * reach or top.z1 - top.z0 < 2 * reach:
        return False
    for _ in range(6):
        x, z = kit.rng.uniform((top.x0 + reach, top.z0 + reach), (top.x1 - reach, top.z1 - reach))
        spot = replace(
            _beside(host, piece, float(x), float(z), float(kit.rng.uniform(-0.5, 0.5))), y=top.y + host.y + 0.001
        )
        if space.rests(spot, host):
            return space.put(spot)
    return False


def _on_floor(space: Space, kit: Kit) -> bool:
    maker = _ON_FLOOR[int(kit.rng.integers(len(_ON_FLOOR)))]

    def put() -> Placed | None:
        return space.try_put(space.spots(kit.make(maker), kit.rng)[:40])

    return (_household(kit, "chair", put) if maker is seats.stool else put()) is not None
