"""Place groups of furniture: a couch opposite a television, chairs at a table, counters, a bed with nightstands."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from humanclaw_houses.building import Placed
from humanclaw_houses.furnishing_context import FurnishingContext
from humanclaw_houses.furniture import bath, beds, decor, kitchen, media, seats, tables
from humanclaw_houses.piece_builder import Piece
from humanclaw_houses.placing import beside, lay, put_above, put_at_wall
from humanclaw_houses.room_occupancy import SIDES, YAW, Rect, RoomOccupancy, Side, at_hand, local


# -- groups ------------------------------------------------------------------------------------------------------------
def put_lounge(space: RoomOccupancy, context: FurnishingContext) -> bool:
    """Put a television, a couch opposite, and a low table and a rug between; a smaller couch if a large one fails."""
    for count in (3, 2):
        couch = context.make(seats.couch, count)
        screen = context.make(media.tv, round(float(context.rng.uniform(1.0, 1.3)), 2))
        stand = context.make(tables.tv_stand, round(screen.size[0] + 0.35, 2))
        for spot in space.spots(stand, context.rng, step=0.2):
            if not space.before_window(spot) and _try_lounge(space, context, spot, screen, couch):
                return True
    return False


def _try_lounge(space: RoomOccupancy, context: FurnishingContext, stand: Placed, screen: Piece, couch: Piece) -> bool:
    side = next(s for s in SIDES if YAW[s] == stand.yaw)
    depth = space.depth(side)
    room = depth - stand.piece.size[2] - couch.size[2]
    if room < 1.5:
        return False
    gap = room - 0.05 if room < 2.9 else float(context.rng.uniform(2.1, 2.7))
    return _seat_across(space, context, stand, screen, couch, gap) or (
        # In front of an open side, a couch near it would block the way: half a metre stays free behind it.
        room > 2.0 and _seat_across(space, context, stand, screen, couch, room - 0.5)
    )


def _seat_across(
    space: RoomOccupancy, context: FurnishingContext, stand: Placed, screen: Piece, couch: Piece, gap: float
) -> bool:
    """Put the couch opposite the television. gap: metres between the stand and the couch."""
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
    context.left["couch"] -= 1
    _around_couch(space, context, seat, gap)
    return True


def _on_front_edge(stand: Placed, screen: Piece) -> Placed:
    """Return a television at the front edge of its stand, so that a body can come close to it."""
    out = stand.piece.size[2] / 2 - screen.size[2] / 2 - 0.03
    y = stand.piece.surfaces[0].y + 0.001
    return Placed(
        screen, stand.x + out * np.sin(stand.yaw), y, stand.z + out * np.cos(stand.yaw), stand.yaw, stand.room
    )


def _around_couch(space: RoomOccupancy, context: FurnishingContext, seat: Placed, gap: float) -> None:
    front = seat.piece.size[2] / 2
    rug = context.make(decor.rug, round(seat.piece.size[0] + 0.3, 2), round(min(1.7, gap - 0.3), 2))
    lay(space, beside(seat, rug, 0.0, front + gap / 2 + 0.05))
    table = context.make(tables.coffee_table)
    spot = beside(seat, table, 0.0, front + 0.7 + table.size[2] / 2)
    if gap > 1.9 and space.fits(spot):
        space.put(spot)
    for side in (-1, 1):
        piece = context.make(tables.side_table if side < 0 else decor.floor_lamp)
        out = side * (seat.piece.size[0] / 2 + piece.size[0] / 2 + 0.06)
        space.try_put([beside(seat, piece, out, -front + piece.size[2] / 2 + 0.1)])


def put_dining_set(space: RoomOccupancy, context: FurnishingContext, count: int, at_wall: bool = True) -> bool:
    """Put a table with chairs at its long sides and room behind them. at_wall: otherwise try it at a wall."""
    if context.left["chair"] < count:
        return False
    table = context.make(tables.dining_table, count)
    chair = context.make(seats.dining_chair)
    w, _, d = table.size
    apart = {2: [0.0], 4: [-0.22 * w, 0.22 * w], 6: [-0.295 * w, 0.0, 0.295 * w],
             8: [-0.345 * w, -0.115 * w, 0.115 * w, 0.345 * w]}[count]  # fmt: skip
    if d > 1.0:  # Only round tables are that deep: one chair on each of four sides.
        apart = [0.0]
    spots = _open_spots(space, w, d + 2 * 0.35, context.rng)
    for x, z, yaw in spots:
        spot = Placed(table, x, 0.0, z, yaw, space.area.name)
        chairs = [_at_table(spot, chair, along, side, context.rng) for along in apart for side in (-1, 1)]
        if d > 1.0:
            chairs += [_at_end(spot, chair, side) for side in (-1, 1)]
        if _set_down(space, context, spot, chairs):
            return True
    for spot in space.spots(table, context.rng, step=0.2) if at_wall else ():
        front = [_at_table(spot, chair, along, 1, context.rng) for along in apart]
        beside = [_at_end(spot, chair, side) for side in (-1, 1)] if w < 1.0 else []
        if (beside and _set_down(space, context, spot, beside)) or _set_down(space, context, spot, front):
            return True
    return False


def put_bare_table(space: RoomOccupancy, context: FurnishingContext) -> bool:
    """Put a table without chairs at a wall."""
    return put_at_wall(space, context, tables.dining_table, 4, front=0.5) is not None


def _set_down(space: RoomOccupancy, context: FurnishingContext, table: Placed, chairs: Sequence[Placed]) -> bool:
    """Place a table and its chairs if a body can reach every chair."""
    want = [at_hand(chair) for chair in chairs]
    done = all(space.fits(obj) for obj in (table, *chairs)) and space.put(table, *chairs, want=want)
    context.left["chair"] -= len(chairs) * done
    return done


def _open_spots(space: RoomOccupancy, w: float, d: float, rng: np.random.Generator) -> list[tuple[float, float, float]]:
    """Return (x, z, yaw) of free rectangles, those with free floor around them first.

    Only the best 40, because each one costs a check of the walkable floor.
    """
    r = space.rect
    spots = []
    for yaw, (a, b) in ((0.0, (w, d)), (np.pi / 2, (d, w))):
        xs = np.arange(r.x0 + a / 2 + 0.06, r.x1 - a / 2 - 0.05, 0.15)
        zs = np.arange(r.z0 + b / 2 + 0.06, r.z1 - b / 2 - 0.05, 0.15)
        for x in xs:
            for z in zs:
                rect = Rect(x - a / 2, z - b / 2, x + a / 2, z + b / 2)
                if space.is_free(rect):
                    roomy = space.is_free(rect.grown(0.5)) * 2.0 + space.is_free(rect.grown(0.3))
                    spots.append((roomy + float(rng.random()), float(x), float(z), float(yaw)))
    return [spot[1:] for spot in sorted(spots, reverse=True)[:40]]


def _at_table(table: Placed, chair: Piece, along: float, side: int, rng: np.random.Generator) -> Placed:
    out = table.piece.size[2] / 2 + chair.size[2] / 2 - 0.16 + float(rng.uniform(0.0, 0.1))
    yaw = (np.pi if side > 0 else 0.0) + float(rng.uniform(-0.06, 0.06))
    return beside(table, chair, along, side * out, yaw)


def _at_end(table: Placed, chair: Piece, side: int) -> Placed:
    out = table.piece.size[0] / 2 + chair.size[2] / 2 - 0.12
    return beside(table, chair, side * out, 0.0, -side * np.pi / 2)


def put_counters(space: RoomOccupancy, context: FurnishingContext) -> None:
    """Put a run of kitchen units along the longest free stretch of wall, with a fridge at an end.

    Cupboards and a hood hang above.
    """
    side, start, end = max((_stretch(space, side) for side in SIDES), key=lambda run: run[2] - run[1])
    fronts = kitchen.Fronts.draw(context.style)
    pieces = _run(context, fronts, end - start)
    if context.chance(0.5):
        pieces = pieces[::-1]
    along = start
    for piece in pieces:
        obj = space.at_wall(piece, side, along + piece.size[0] / 2, gap=0.02)
        along += piece.size[0] + 0.002
        if space.put(obj, keep=[space.ahead(obj, 0.72 if piece.hinged_parts else 0.6)]):
            _above_unit(space, context, fronts, obj)
    if not any(obj.piece.asset.category == "fridge" for obj in space.objects):
        put_at_wall(space, context, kitchen.fridge, front=0.72)


def _stretch(space: RoomOccupancy, side: Side) -> tuple[Side, float, float]:
    """Return the longest stretch of a wall along which units 0.65 m deep fit: side, start and end in metres."""
    best, start, step = (side, 0.0, 0.0), 0.02, 0.05
    for at in np.arange(0.02, space.length(side) - 0.02, step):
        if not space.is_free_unit(side, float(at), step):
            start = float(at) + step
        elif at + step - start > best[2] - best[1]:
            best = (side, start, float(at) + step)
    return best


def _run(context: FurnishingContext, fronts: kitchen.Fronts, length: float) -> list[Piece]:
    """Return units that fill a length: sink and stove if both fit, fridge and dishwasher if there is room, worktops.

    A run has at most 4.2 m. Sink and stove are 0.8 and 0.6 m wide.
    """
    sink, stove = context.make(kitchen.sink, fronts), context.make(kitchen.stove)
    left = min(length, 4.2) - 0.8 - 0.6 - 0.02
    if left < 0:
        return [sink] if length > 0.85 else []
    with_fridge = left > 1.1
    fridge = [context.make(kitchen.fridge)] if with_fridge else []
    left -= fridge[0].size[0] if fridge else 0.0
    washer = [context.make(kitchen.dishwasher, fronts)] if left > 0.9 else []
    left -= 0.605 * len(washer)
    widths = [w for w in ([0.5 * left, 0.5 * left] if left > 1.0 else [left]) if w > 0.28]
    tops = [context.make(kitchen.counter, fronts, round(w - 0.005, 3)) for w in widths]
    return [*fridge, *tops[:1], sink, *washer, *tops[1:], stove]


def _above_unit(space: RoomOccupancy, context: FurnishingContext, fronts: kitchen.Fronts, unit: Placed) -> None:
    kind, side = unit.piece.asset.category, next(s for s in SIDES if YAW[s] == unit.yaw)
    if kind == "stove":
        piece, y = context.make(kitchen.hood), 1.6
    elif kind in ("kitchen_counter", "sink", "dishwasher"):
        piece, y = context.make(kitchen.wall_cabinet, fronts, round(unit.piece.size[0] - 0.005, 3)), 1.45
    else:
        return
    along = (unit.x if side in ("south", "north") else unit.z) - space.start(side)
    obj = space.at_wall(piece, side, along, y, gap=0.002)
    # Neighbouring cupboards may touch.
    if space.fits(obj, gap=-0.002):
        space.put(obj)


def put_bed(space: RoomOccupancy, context: FurnishingContext, double: bool) -> bool:
    """Put a bed with its head at a wall, with nightstands and lamps.

    Floor stays free at its foot and at both sides, at one side for a single bed.
    """
    bed = context.make(beds.bed, double)
    w, _, d = bed.size
    for spot in space.spots(bed, context.rng, step=0.15):
        left = local(spot, w / 2 + 0.01, -d / 2 + 0.45, w / 2 + 0.62, d / 2)
        right = local(spot, -w / 2 - 0.62, -d / 2 + 0.45, -w / 2 - 0.01, d / 2)
        foot = local(spot, -w / 2, d / 2 + 0.01, w / 2, d / 2 + 0.55)
        free = [rect for rect in (left, right) if space.is_free(rect)]
        if len(free) < (2 if double else 1) or not space.is_free(foot) or not space.fits(spot):
            continue
        if space.put(spot, keep=[*free, foot], want=[tuple(free)]):
            _beside_bed(space, context, spot)
            return True
    return False


def _beside_bed(space: RoomOccupancy, context: FurnishingContext, bed: Placed) -> None:
    w, _, d = bed.piece.size
    stand, lamp = context.make(tables.nightstand), context.make(decor.table_lamp)
    for side in (-1, 1):
        spot = beside(bed, stand, side * (w / 2 + stand.size[0] / 2 + 0.03), -d / 2 + stand.size[2] / 2)
        if space.fits(spot) and space.put(spot):
            space.put(replace(spot, piece=lamp, y=stand.surfaces[0].y + 0.001))
    if context.chance(0.7):
        rug = context.make(decor.rug, round(w + 1.0, 2), 1.3)
        lay(space, beside(bed, rug, 0.0, d / 2 - 0.35))
    picture = context.make(decor.picture, round(min(1.0, w * 0.6), 2), 0.5)
    put_above(space, bed, picture, 1.45)


def put_work_place(space: RoomOccupancy, context: FurnishingContext) -> bool:
    """Put a desk at a wall with a chair at it, and a lamp and a laptop on it."""
    desk = context.make(tables.desk)
    if context.left["chair"] < 1:
        return put_at_wall(space, context, tables.desk, front=0.5) is not None
    chair = context.make(seats.office_chair if context.chance(0.7) else seats.dining_chair)
    for spot in space.spots(desk, context.rng, step=0.15):
        seat = beside(spot, chair, -0.19, desk.size[2] / 2 + chair.size[2] / 2 - 0.12, np.pi)
        if space.fits(spot, 0.95) and space.put(spot, seat, want=[at_hand(seat)]):
            context.left["chair"] -= 1
            y = desk.surfaces[0].y + 0.002
            space.put(beside(spot, context.make(media.laptop), -0.19, 0.02, y=y))
            space.put(beside(spot, context.make(decor.table_lamp), desk.size[0] / 2 - 0.2, -0.12, y=y))
            return True
    return False


def put_toilet(space: RoomOccupancy, context: FurnishingContext) -> bool:
    """Put a toilet with elbow room at both sides and standing room in front."""
    piece = context.make(bath.toilet)
    w, _, d = piece.size
    for spot in space.spots(piece, context.rng):
        around = local(spot, -w / 2 - 0.18, -d / 2 + 0.02, w / 2 + 0.18, d / 2)
        front = local(spot, -0.35, d / 2 + 0.01, 0.35, d / 2 + 0.65)
        knees = local(spot, -0.15, d / 2 + 0.01, 0.15, d / 2 + 0.45)
        free = space.fits(spot) and space.is_free(around) and space.is_free(front)
        if free and space.put(spot, keep=[front, around], want=[(knees,)]):
            paper = context.make(bath.paper_holder)
            space.try_put(
                s for s in space.spots(paper, context.rng, y=0.62) if np.hypot(s.x - spot.x, s.z - spot.z) < 0.9
            )
            return True
    return False


def put_basin(space: RoomOccupancy, context: FurnishingContext) -> None:
    basin = put_at_wall(space, context, bath.vanity, front=0.6)
    if basin:
        put_above(space, basin, context.make(decor.mirror, round(basin.piece.size[0] - 0.1, 2), 0.75), 1.15)


def put_wall_tv(space: RoomOccupancy, context: FurnishingContext) -> Placed | None:
    """Put a television on the wall or on its own cabinet, with free floor in front."""
    if context.chance(0.5):
        piece = context.make(media.wall_tv, 1.0)
        return space.try_put(space.spots(piece, context.rng, y=0.95), front=0.5, target=True)
    return put_at_wall(space, context, media.floor_tv, 1.0, front=0.5, target=True)
