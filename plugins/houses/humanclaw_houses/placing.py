"""Place single pieces: at a wall, in a corner, above another piece, at a window."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from humanclaw_houses.building import Placed
from humanclaw_houses.furniture import decor, plants, seats, storage
from humanclaw_houses.kit import Kit, Maker
from humanclaw_houses.model import Piece
from humanclaw_houses.plan import CEILING
from humanclaw_houses.space import Side, Space, block_of, cos_sin


def beside(obj: Placed, piece: Piece, x: float, z: float, yaw: float = 0.0, y: float = 0.0) -> Placed:
    """Return a piece at (x, z) in the frame of another piece. yaw: relative to it, radians. y: over the floor."""
    cos, sin = cos_sin(obj.yaw)
    return Placed(piece, obj.x + (cos * x + sin * z), y, obj.z + (cos * z - sin * x), obj.yaw + yaw, obj.room)


# -- single objects ----------------------------------------------------------------------------------------------------
def put_at_wall(
    space: Space, kit: Kit, maker: Callable[..., Piece], *args: object, front: float = 0.0, target: bool = False
) -> Placed | None:
    """Put one piece against a wall."""
    return space.try_put(space.spots(kit.make(maker, *args), kit.rng), front=front, target=target)


def put_in_corner(space: Space, kit: Kit, maker: Maker, front: float = 0.0, target: bool = False) -> Placed | None:
    """Put one piece as close to a corner as possible."""
    r = space.rect
    corners = [(x, z) for x in (r.x0, r.x1) for z in (r.z0, r.z1)]
    spots = space.spots(kit.make(maker), kit.rng)
    near = sorted(spots, key=lambda spot: min(abs(spot.x - x) + abs(spot.z - z) for x, z in corners))
    return space.try_put(near, front=front, target=target)


def put_plant(space: Space, kit: Kit) -> Placed | None:
    """Put a plant, in a corner if one is free."""
    return put_in_corner(space, kit, plants.plant, target=True)


def from_household(kit: Kit, category: str, put: Callable[[], Placed | None]) -> Placed | None:
    """Put a chair or couch if the household has one left, and count it."""
    placed = put() if kit.left[category] > 0 else None
    kit.left[category] -= placed is not None
    return placed


def put_couch(space: Space, kit: Kit) -> Placed | None:
    """Put a couch for two at a wall."""
    return from_household(kit, "couch", lambda: put_at_wall(space, kit, seats.couch, 2, front=0.65, target=True))


def put_chair(space: Space, kit: Kit) -> Placed | None:
    return from_household(kit, "chair", lambda: put_at_wall(space, kit, seats.dining_chair, front=0.3, target=True))


def put_armchair(space: Space, kit: Kit) -> Placed | None:
    """Put an armchair at a wall or in a corner, turned 20 degrees to one side."""
    return from_household(kit, "chair", lambda: _turned_in(space, kit))


def _turned_in(space: Space, kit: Kit) -> Placed | None:
    piece = kit.make(seats.armchair)
    spots = []
    for spot in space.spots(piece, kit.rng, step=0.25):
        x, z = spot.x + 0.16 * np.sin(spot.yaw), spot.z + 0.16 * np.cos(spot.yaw)
        spots += [replace(spot, x=x, z=z, yaw=spot.yaw + angle) for angle in (0.35, -0.35)]
    return space.try_put(spots, front=0.5, target=True)


def hang(space: Space, kit: Kit, count: int) -> None:
    """Hang pictures and sometimes a shelf on free parts of the walls."""
    for _ in range(int(kit.rng.integers(max(1, count - 1), count + 1))):
        w, h = (round(float(v), 2) for v in kit.rng.uniform((0.4, 0.4), (0.9, 0.65)))
        hang_one(space, kit, kit.make(decor.picture, w, h), 1.4)
    if kit.chance(0.4):
        hang_one(space, kit, kit.make(storage.wall_shelf), 1.45)


def hang_one(space: Space, kit: Kit, piece: Piece, y: float) -> Placed | None:
    spots = space.spots(piece, kit.rng, y, step=0.2)
    # Without the gap for the skirting.
    flush = (replace(s, x=s.x - 0.014 * np.sin(s.yaw), z=s.z - 0.014 * np.cos(s.yaw)) for s in spots)
    return space.try_put(flush, gap=0.08)


def put_above(space: Space, obj: Placed, piece: Piece, y: float) -> None:
    """Hang a piece on the wall behind another."""
    back = -obj.piece.size[2] / 2 + piece.size[2] / 2 - 0.014
    spot = beside(obj, piece, 0.0, back, y=y)
    if space.fits(spot):
        space.put(spot)


def lay(space: Space, rug: Placed) -> None:
    """Lay a rug where it stays inside the room."""
    if block_of(rug).rect.within(space.rect):
        space.put(rug)


def lay_mat(space: Space, kit: Kit, w: float, d: float) -> None:
    piece = kit.make(decor.rug, w, d)
    x, z = space.rect.middle
    mat = Placed(piece, x, 0.0, z, 0.0, space.area.name)
    if space.is_free(block_of(mat).rect.grown(-0.05)):
        lay(space, mat)


def put_curtain(space: Space, kit: Kit, side: Side, at: float, width: float, top: float) -> None:
    """Hang curtains beside a window. They do not collide, so furniture may stand under them."""
    short = kit.chance(0.5)
    height = round(top + 0.1 - (0.75 if short else 0.05), 2)
    piece = kit.make(decor.curtain, width, height, kit.style.second_cloth)
    spot = space.at_wall(piece, side, at - space.start(side), y=round(top + 0.1 - height, 2), gap=0.03)
    if block_of(spot).rect.within(space.rect.grown(0.001)) and space.clear_of_doors(spot):
        space.put(spot)


def put_light(space: Space, kit: Kit) -> None:
    x, z = space.rect.middle
    piece = kit.make(decor.ceiling_lamp, 0.15)
    space.put(Placed(piece, x, round(CEILING - piece.size[1], 3), z, 0.0, space.area.name))
