"""Place single pieces: at a wall, in a corner, above another piece, at a window."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from humanclaw_houses.building import Placed
from humanclaw_houses.furnishing_context import FurnishingContext, Maker
from humanclaw_houses.furniture import decor, plants, seats, storage
from humanclaw_houses.piece_builder import Piece
from humanclaw_houses.plan import CEILING
from humanclaw_houses.room_occupancy import RoomOccupancy, Side, block_of, cos_sin


def beside(obj: Placed, piece: Piece, x: float, z: float, yaw: float = 0.0, y: float = 0.0) -> Placed:
    """Return a piece at (x, z) in the frame of another piece. yaw: relative to it, radians. y: over the floor."""
    cos, sin = cos_sin(obj.yaw)
    return Placed(piece, obj.x + (cos * x + sin * z), y, obj.z + (cos * z - sin * x), obj.yaw + yaw, obj.room)


# -- single objects ----------------------------------------------------------------------------------------------------
def put_at_wall(
    space: RoomOccupancy,
    context: FurnishingContext,
    maker: Callable[..., Piece],
    *args: object,
    front: float = 0.0,
    target: bool = False,
) -> Placed | None:
    """Put one piece against a wall."""
    return space.try_put(space.spots(context.make(maker, *args), context.rng), front=front, target=target)


def put_in_corner(
    space: RoomOccupancy, context: FurnishingContext, maker: Maker, front: float = 0.0, target: bool = False
) -> Placed | None:
    """Put one piece as close to a corner as possible."""
    r = space.rect
    corners = [(x, z) for x in (r.x0, r.x1) for z in (r.z0, r.z1)]
    spots = space.spots(context.make(maker), context.rng)
    near = sorted(spots, key=lambda spot: min(abs(spot.x - x) + abs(spot.z - z) for x, z in corners))
    return space.try_put(near, front=front, target=target)


def put_plant(space: RoomOccupancy, context: FurnishingContext) -> Placed | None:
    """Put a plant, in a corner if one is free."""
    return put_in_corner(space, context, plants.plant, target=True)


def from_household(context: FurnishingContext, category: str, put: Callable[[], Placed | None]) -> Placed | None:
    """Put a chair or couch if the household has one left, and count it."""
    placed = put() if context.left[category] > 0 else None
    context.left[category] -= placed is not None
    return placed


def put_couch(space: RoomOccupancy, context: FurnishingContext) -> Placed | None:
    """Put a couch for two at a wall."""
    return from_household(
        context, "couch", lambda: put_at_wall(space, context, seats.couch, 2, front=0.65, target=True)
    )


def put_chair(space: RoomOccupancy, context: FurnishingContext) -> Placed | None:
    return from_household(
        context, "chair", lambda: put_at_wall(space, context, seats.dining_chair, front=0.3, target=True)
    )


def put_armchair(space: RoomOccupancy, context: FurnishingContext) -> Placed | None:
    """Put an armchair at a wall or in a corner, turned 20 degrees to one side."""
    return from_household(context, "chair", lambda: _turned_in(space, context))


def _turned_in(space: RoomOccupancy, context: FurnishingContext) -> Placed | None:
    piece = context.make(seats.armchair)
    spots = []
    for spot in space.spots(piece, context.rng, step=0.25):
        x, z = spot.x + 0.16 * np.sin(spot.yaw), spot.z + 0.16 * np.cos(spot.yaw)
        spots += [replace(spot, x=x, z=z, yaw=spot.yaw + angle) for angle in (0.35, -0.35)]
    return space.try_put(spots, front=0.5, target=True)


def hang(space: RoomOccupancy, context: FurnishingContext, count: int) -> None:
    """Hang pictures and sometimes a shelf on free parts of the walls."""
    for _ in range(int(context.rng.integers(max(1, count - 1), count + 1))):
        w, h = (round(float(v), 2) for v in context.rng.uniform((0.4, 0.4), (0.9, 0.65)))
        hang_one(space, context, context.make(decor.picture, w, h), 1.4)
    if context.chance(0.4):
        hang_one(space, context, context.make(storage.wall_shelf), 1.45)


def hang_one(space: RoomOccupancy, context: FurnishingContext, piece: Piece, y: float) -> Placed | None:
    spots = space.spots(piece, context.rng, y, step=0.2)
    # Without the gap for the skirting.
    flush = (replace(s, x=s.x - 0.014 * np.sin(s.yaw), z=s.z - 0.014 * np.cos(s.yaw)) for s in spots)
    return space.try_put(flush, gap=0.08)


def put_above(space: RoomOccupancy, obj: Placed, piece: Piece, y: float) -> None:
    """Hang a piece on the wall behind another."""
    back = -obj.piece.size[2] / 2 + piece.size[2] / 2 - 0.014
    spot = beside(obj, piece, 0.0, back, y=y)
    if space.fits(spot):
        space.put(spot)


def lay(space: RoomOccupancy, rug: Placed) -> None:
    """Lay a rug where it stays inside the room."""
    if block_of(rug).rect.within(space.rect):
        space.put(rug)


def lay_mat(space: RoomOccupancy, context: FurnishingContext, w: float, d: float) -> None:
    piece = context.make(decor.rug, w, d)
    x, z = space.rect.middle
    mat = Placed(piece, x, 0.0, z, 0.0, space.area.name)
    if space.is_free(block_of(mat).rect.grown(-0.05)):
        lay(space, mat)


def put_curtain(
    space: RoomOccupancy, context: FurnishingContext, side: Side, at: float, width: float, top: float
) -> None:
    """Hang curtains beside a window. They do not collide, so furniture may stand under them."""
    short = context.chance(0.5)
    # Short ones end 75 cm over the floor, long ones 5 cm.
    height = round(top + 0.1 - (0.75 if short else 0.05), 2)
    piece = context.make(decor.curtain, width, height, context.style.second_cloth)
    spot = space.at_wall(piece, side, at - space.start(side), y=round(top + 0.1 - height, 2), gap=0.03)
    if block_of(spot).rect.within(space.rect.grown(0.001)) and space.clear_of_doors(spot):
        space.put(spot)


def put_light(space: RoomOccupancy, context: FurnishingContext) -> None:
    x, z = space.rect.middle
    piece = context.make(decor.ceiling_lamp, 0.15)
    space.put(Placed(piece, x, round(CEILING - piece.size[1], 3), z, 0.0, space.area.name))
