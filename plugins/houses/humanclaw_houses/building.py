"""Build the walls, floors, ceilings, doors and windows of a plan as placed pieces."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from humanclaw.world import Hinge, Joint
from humanclaw_houses import textures as t
from humanclaw_houses.piece_builder import Piece, PieceBuilder, maker
from humanclaw_houses.plan import CEILING, WALL, Area, FloorPlan, Wall, WallOpening, room_at
from humanclaw_houses.shapes import Point, Shape, box, post, quads, sheet
from humanclaw_houses.stairs import staircase
from humanclaw_houses.style import Style
from humanclaw_houses.textures import Texture

SKIRTING = 0.08
"""Height of the skirting boards, metres."""
_CELL = 1.2
"""Length that a texture covers on walls, floors and ceilings, about, metres."""
_WIDEST = 95.0
"""Largest angle to which a door opens, degrees: a wall or a shelf is behind it."""
_AJAR = (70.0, 85.0)
"""Smallest and largest angle of a door that is not fully open, degrees: a body still passes without touching it."""
_AJAR_SHARE = 0.3
"""Share of doors that are not fully open."""


@dataclass(frozen=True, eq=False)
class Placed:
    """A placed piece: x, y, z of its origin in metres, and its heading in radians."""

    piece: Piece
    x: float
    y: float
    z: float
    yaw: float = 0.0
    room: str = ""
    joint: Joint | None = None
    state: float = 0.0
    """The angle of the joint, radians."""


@dataclass(frozen=True, eq=False)
class Finish:
    """The textures on the walls and the floor of a room."""

    wall: Texture
    floor: Texture


def draw_finishes(plan: FloorPlan, style: Style) -> Mapping[str, Finish]:
    """Draw a finish for every room. Hall, living and dining room share the same floor boards."""
    rng = style.rng
    boards = t.planks(t.pick(rng, t.WOODS[:3] + t.WOODS[4:]), rng)
    paints = [t.plain(t.PAINTS[k], rng) for k in rng.permutation(len(t.PAINTS))]
    finishes = {}
    zones = _zones(plan)
    for area in plan.areas:
        wall = paints[zones[area.name] % len(paints)]
        if area.kind in ("bathroom", "laundry"):
            finishes[area.name] = Finish(_bath_tiles(rng), _floor_tiles(rng))
        elif area.kind == "kitchen":
            finishes[area.name] = Finish(wall, _floor_tiles(rng) if rng.random() < 0.6 else boards)
        elif area.kind in ("bedroom", "kids") and rng.random() < 0.5:
            finishes[area.name] = Finish(
                wall, t.carpet(t.pick(rng, ((176, 166, 150), (128, 136, 146), (150, 128, 112))), rng)
            )
        else:
            finishes[area.name] = Finish(wall, boards)
    return finishes


def _zones(plan: FloorPlan) -> dict[str, int]:
    """Return a number for each area. Areas without a wall between them share a number, and so the same paint."""
    zone = {area.name: number for number, area in enumerate(plan.areas)}
    for wall in plan.walls:
        if any(opening.kind == "open" for opening in wall.openings):
            old, new = zone[wall.high], zone[wall.low]
            zone = {name: new if number == old else number for name, number in zone.items()}
    return zone


def _bath_tiles(rng: np.random.Generator) -> Texture:
    return t.ceramic(t.pick(rng, ((226, 236, 238), (236, 234, 226), (206, 222, 226), (220, 232, 220))), rng, 8)


def _floor_tiles(rng: np.random.Generator) -> Texture:
    return t.ceramic(t.pick(rng, ((196, 190, 180), (150, 152, 156), (214, 206, 192))), rng, 4)


def build(plan: FloorPlan, style: Style, finishes: Mapping[str, Finish]) -> Iterator[Placed]:
    """Build everything of one storey except its furniture. Heights are above the storey's floor."""
    outside = t.plain((206, 198, 186), style.rng)
    for area in plan.areas:
        stairs, upper = area.kind == "stairs", plan.floor > 0
        if not (stairs and upper):
            yield _floor(area, finishes[area.name], 0.12 if upper else 0.2)
        if not stairs or upper:
            yield _ceiling(area, style)
        if stairs and not upper:
            yield _stairs(plan, area, finishes, style)
    above = "upper_" if plan.floor > 0 else ""
    for number, wall in enumerate(plan.walls):
        textures = [finishes[name].wall if name else outside for name in (wall.low, wall.high)]
        yield _wall(plan, wall, f"{above}{number}", textures, style)
        for index, opening in enumerate(wall.openings):
            yield from _fill(wall, opening, f"{above}{number}_{index}", style)


def _stairs(plan: FloorPlan, area: Area, finishes: Mapping[str, Finish], style: Style) -> Placed:
    """Build the staircase, from the wall line of the hall to the wall behind the half-landing."""
    assert plan.stair is not None
    wall = next(wall for wall in plan.walls if wall.openings and wall.openings[0].kind == "stairs")
    x0, z0, x1, z1 = area.inner
    if wall.axis == "x":
        z0, z1 = (wall.line, z1) if wall.high == area.name else (z0, wall.line)
        size, yaw = (x1 - x0, z1 - z0), np.pi if wall.high == area.name else 0.0
    else:
        x0, x1 = (wall.line, x1) if wall.high == area.name else (x0, wall.line)
        size, yaw = (z1 - z0, x1 - x0), -np.pi / 2 if wall.high == area.name else np.pi / 2
    width, depth = (round(v, 4) for v in size)
    piece = staircase(style, "stairs", plan.stair, width, depth, finishes[area.name].wall)
    return Placed(piece, (x0 + x1) / 2, 0.0, (z0 + z1) / 2, yaw, area.name)


def _cells(length: float) -> int:
    return max(1, round(length / _CELL))


def _floor(area: Area, finish: Finish, thick: float) -> Placed:
    """Build a slab whose top is at height 0."""
    m = PieceBuilder()
    w, d = area.x1 - area.x0, area.z1 - area.z0
    m.add(_tiled((-w / 2, thick, d / 2), (w, 0, 0), (0, 0, -d)), finish.floor)
    m.add(box((w, thick, d), (0, 0, 0), skip="t"), finish.floor)
    m.solid((w, thick, d), (0, 0, 0))
    middle = (area.x0 + area.x1) / 2, (area.z0 + area.z1) / 2
    return Placed(m.piece(f"floor_{area.name}", "floor"), middle[0], -thick, middle[1], room=area.name)


def _tiled(corner: Point, along: Point, up: Point) -> Shape:
    """Return a rectangle as quads of about one texture each, so that the texture repeats and no uv leaves 0..1."""
    start, side, rise = np.array(corner), np.array(along), np.array(up)
    columns, rows = _cells(float(np.linalg.norm(side))), _cells(float(np.linalg.norm(rise)))
    i, j = np.indices((columns, rows)).reshape(2, -1, 1)
    places = start + side * i / columns + rise * j / rows
    return Shape(quads(places, np.broadcast_to([[side / columns], [rise / rows]], (2, *places.shape))))


def _ceiling(area: Area, style: Style) -> Placed:
    m = PieceBuilder()
    w, d = area.x1 - area.x0, area.z1 - area.z0
    columns, rows = _cells(w), _cells(d)
    m.add(Shape((sheet((-w / 2, 0, -d / 2), (w, 0, 0), (0, 0, d), (columns, rows)),)), style.white)
    m.add(box((w, 0.1, d), (0, 0, 0), skip="b"), style.white)
    middle = (area.x0 + area.x1) / 2, (area.z0 + area.z1) / 2
    return Placed(m.piece(f"ceiling_{area.name}", "ceiling"), middle[0], CEILING, middle[1], room=area.name)


# -- walls -------------------------------------------------------------------------------------------------------------
def _wall(plan: FloorPlan, wall: Wall, number: str, textures: list[Texture], style: Style) -> Placed:
    """Build a wall: faces, reveals of the openings, top, skirting, and a collision box for every solid stretch.

    It is built along x. A wall along z is turned so that its x becomes z; its low room is then at the builder's +Z.
    """
    m = PieceBuilder()
    middle, turn = (wall.start + wall.end) / 2, 1 if wall.axis == "x" else -1
    for low, texture in zip((True, False), textures, strict=True):
        start, end = _face_ends(plan, wall, low)
        side = (-1 if low else 1) * turn
        for x0, x1, y0, y1 in _stretches(wall, start - middle, end - middle, middle, plan.height):
            _face(m, side, (x0, x1, y0, y1), texture)
            if y0 == 0 and (wall.low if low else wall.high):
                m.add(box((x1 - x0, SKIRTING, 0.012), ((x0 + x1) / 2, 0, side * (WALL / 2 + 0.006)), "b"), style.white)
    reach = WALL / 2
    for x0, x1, y0, y1 in _stretches(wall, wall.start - middle - reach, wall.end - middle + reach, middle, plan.height):
        m.solid((x1 - x0, y1 - y0, WALL), ((x0 + x1) / 2, y0, 0))
    if not any(opening.top > plan.height for opening in wall.openings):
        m.add(box((wall.end - wall.start + WALL, 0.004, WALL), (0, plan.height - 0.004, 0), "bfk"), style.black)
    for opening in wall.openings:
        _reveal(m, replace(opening, top=min(opening.top, plan.height)), opening.at - middle, style)
    x, z = wall.point(middle)
    piece = _centred(m, f"wall_{number}")
    yaw = 0.0 if wall.axis == "x" else -np.pi / 2
    return Placed(piece[0], *_shift(x, z, piece[1], yaw), yaw, room=wall.low or wall.high)


def _centred(m: PieceBuilder, name: str) -> tuple[Piece, tuple[float, float]]:
    """Return the centred piece, and the (x, z) of its centre in the builder's frame."""
    points = m.points()
    cx, cz = ((points[:, k].min() + points[:, k].max()) / 2 for k in (0, 2))
    return m.piece(name, "wall"), (float(cx), float(cz))


def _shift(x: float, z: float, offset: tuple[float, float], yaw: float) -> tuple[float, float, float]:
    """Return the place of a centred piece at which its builder's origin is at (x, z)."""
    ox, oz = offset
    cos, sin = np.round(np.cos(yaw)), np.round(np.sin(yaw))
    return float(x + cos * ox + sin * oz), 0.0, float(z - sin * ox + cos * oz)


def _face_ends(plan: FloorPlan, wall: Wall, low: bool) -> tuple[float, float]:
    """Return the start and the end of a wall's face.

    It ends at the face of a crossing wall, at the node if the wall continues straight, and half a thickness beyond the
    node at an outer corner.
    """
    across, ends = (-1 if low else 1), []
    for node, away in ((wall.start, -1), (wall.end, 1)):
        here = room_at(plan.areas, *wall.point(node - away * 1e-3, across * 1e-3))
        beside = room_at(plan.areas, *wall.point(node + away * 1e-3, across * 1e-3))
        beyond = room_at(plan.areas, *wall.point(node + away * 1e-3, -across * 1e-3))
        if here != beside:
            ends.append(node - away * WALL / 2)
        else:
            ends.append(node if beyond != beside else node + away * WALL / 2)
    return ends[0], ends[1]


def _stretches(
    wall: Wall, start: float, end: float, middle: float, height: float
) -> list[tuple[float, float, float, float]]:
    """Return x0, x1, y0, y1 of the solid rectangles between start and end, around the openings."""
    parts, x = [], start
    for hole in sorted(wall.openings, key=lambda hole: hole.at):
        left, right = hole.at - hole.width / 2 - middle, hole.at + hole.width / 2 - middle
        parts.append((x, left, 0.0, height))
        if hole.bottom > 0:
            parts.append((left, right, 0.0, hole.bottom))
        parts.append((left, right, hole.top, height))
        x = right
    parts.append((x, end, 0.0, height))
    return [part for part in parts if part[1] - part[0] > 1e-6 and part[3] - part[2] > 1e-6]


def _face(m: PieceBuilder, side: int, span: tuple[float, float, float, float], texture: Texture) -> None:
    x0, x1, y0, y1 = span
    z = side * WALL / 2
    corner, along = ((x1, y0, z), (x0 - x1, 0.0, 0.0)) if side < 0 else ((x0, y0, z), (x1 - x0, 0.0, 0.0))
    m.add(_tiled(corner, along, (0, y1 - y0, 0)), texture)


def _reveal(m: PieceBuilder, hole: WallOpening, x: float, style: Style) -> None:
    """Build the inner faces of an opening, and a white frame around it on both sides."""
    half, high = hole.width / 2, hole.top - hole.bottom
    depth = WALL
    m.add(Shape((sheet((x - half, hole.bottom, depth / 2), (0, 0, -depth), (0, high, 0)),)), style.white)
    m.add(Shape((sheet((x + half, hole.bottom, -depth / 2), (0, 0, depth), (0, high, 0)),)), style.white)
    to_ceiling = hole.kind in ("stairs", "open")
    if not to_ceiling:
        m.add(Shape((sheet((x - half, hole.top, -depth / 2), (hole.width, 0, 0), (0, 0, depth)),)), style.white)
    if hole.bottom > 0:
        m.add(Shape((sheet((x - half, hole.bottom, depth / 2), (hole.width, 0, 0), (0, 0, -depth)),)), style.white)
    sill, lintel = 0.06 if hole.bottom > 0 else 0.0, 0.0 if to_ceiling else 0.06
    for z in () if hole.kind == "open" else (-1, 1):
        face = z * (WALL / 2 + 0.008)
        for side in (-1, 1):
            at = (x + side * (half + 0.03), hole.bottom - sill, face)
            m.add(box((0.06, high + lintel + sill, 0.016), at), style.white)
        if lintel:
            m.add(box((hole.width, lintel, 0.016), (x, hole.top, face)), style.white)
        if hole.bottom > 0:
            m.add(box((hole.width, 0.06, 0.03), (x, hole.bottom - 0.06, z * (WALL / 2 + 0.015))), style.white)


# -- doors and windows -------------------------------------------------------------------------------------------------
def _fill(wall: Wall, hole: WallOpening, name: str, style: Style) -> Iterator[Placed]:
    x, z = wall.point(hole.at)
    inside_high = wall.low == ""
    yaw = (0.0 if inside_high else np.pi) if wall.axis == "x" else (np.pi / 2 if inside_high else -np.pi / 2)
    if hole.kind == "window":
        yield Placed(_window(style, f"window_{name}", hole), x, hole.bottom, z, yaw, wall.low or wall.high)
    elif hole.kind == "front_door":
        yield Placed(_front_door(style, f"front_door_{name}", hole), x, 0.0, z, yaw, wall.low or wall.high)
    elif hole.leaf:
        yield _leaf(wall, hole, name, style)


@maker("window")
def _window(m: PieceBuilder, style: Style, hole: WallOpening) -> None:
    """Build a frame with a bright pane, in two casements if it is wide."""
    w, h = hole.width, hole.top - hole.bottom
    m.add(Shape((sheet((-w / 2, 0, 0), (w, 0, 0), (0, h, 0)),)), t.sky(style.rng))
    m.add(Shape((sheet((w / 2, 0, -0.01), (-w, 0, 0), (0, h, 0)),)), style.steel)
    bars = [-w / 2 + 0.025, w / 2 - 0.025] + ([0.0] if w > 0.9 else [])
    for x in bars:
        m.add(box((0.05, h, 0.04), (x, 0, 0.0), "bt"), style.white)
    for y in (0.0, h - 0.05):
        m.add(box((w, 0.05, 0.04), (0, y, 0.0)), style.white)
    m.add(box((0.02, 0.1, 0.03), (0.045 if w > 0.9 else w / 2 - 0.07, h * 0.45, 0.03)), style.chrome)
    m.solid((w, h, 0.08), (0, 0, 0))


@maker("door")
def _front_door(m: PieceBuilder, style: Style, hole: WallOpening) -> None:
    """Build the front door, closed."""
    texture = t.panel_door(t.pick(style.rng, ((120, 60, 48), (52, 78, 92), (62, 88, 70), (104, 74, 50))), style.rng)
    m.box((hole.width, hole.top, 0.06), (0, 0, 0), texture)
    m.add(box((0.13, 0.02, 0.03), (hole.width / 2 - 0.13, 1.02, 0.06)), style.brass)
    m.add(post(0.018, 0.02).moved((0, 1.5, 0.03), (90, 0, 0)), style.brass)


def _leaf(wall: Wall, hole: WallOpening, name: str, style: Style) -> Placed:
    """Build a door leaf that stands open at about a right angle to its wall. Shut, it lies in front of the frame."""
    m = PieceBuilder(mass=25.0)
    length, thick = hole.width, 0.04
    m.box((thick, hole.top - 0.02, length), (0, 0.01, 0), t.panel_door((236, 234, 228), style.rng))
    for side in (-1, 1):
        m.add(box((0.03, 0.02, 0.12), (side * 0.045, 1.0, length / 2 - 0.1)), style.chrome)
    piece = m.piece(f"door_{name}", "door")
    across = -1 if hole.opens_low else 1
    # The open leaf hangs beside the clear width of the doorway, not in it.
    along = hole.at + hole.leaf * (hole.width / 2 + thick / 2 + 0.005)
    x, z = wall.point(along, across * (WALL / 2 + 0.02 + length / 2))
    yaw = (0.0 if across > 0 else np.pi) if wall.axis == "x" else (np.pi / 2 if across > 0 else -np.pi / 2)
    room = wall.low if hole.opens_low else wall.high
    left = hole.leaf * across * (1 if wall.axis == "x" else -1)
    low, high = sorted((0.0, left * float(np.radians(_WIDEST))))
    hinge = Hinge((-left * thick / 2, 0.0, -length / 2), low, high)
    wide = _stands(style.rng.spawn(1)[0])
    return _swung(Placed(piece, x, 0.0, z, yaw, room, hinge, left * np.pi / 2), left * (wide - np.pi / 2))


def _stands(rng: np.random.Generator) -> float:
    """Draw the angle to which a door stands open, radians."""
    return float(np.radians(round(rng.uniform(*_AJAR), 1) if rng.random() < _AJAR_SHARE else 90.0))


def _swung(leaf: Placed, by: float) -> Placed:
    """Return a leaf turned about its hinge by an angle in radians."""
    assert isinstance(leaf.joint, Hinge)
    px, _, pz = leaf.joint.point

    def arm(yaw: float) -> tuple[float, float]:
        return np.cos(yaw) * px + np.sin(yaw) * pz, np.cos(yaw) * pz - np.sin(yaw) * px

    (x0, z0), (x1, z1), yaw = arm(leaf.yaw), arm(leaf.yaw + by), leaf.yaw + by
    return replace(leaf, x=leaf.x + x0 - x1, z=leaf.z + z0 - z1, yaw=yaw, state=leaf.state + by)
