"""Hand-made scenes for the tests of routes and agents: two rooms on one floor, and two floors with a straight
staircase."""

from __future__ import annotations

import numpy as np

from humanclaw.body import Pose2D, quaternion_from_matrix, yaw_matrix
from humanclaw.world import Asset, Mesh, Room, Scene, SceneObject

CORNERS = np.array([(x, y, z) for x in (-0.5, 0.5) for y in (0, 1) for z in (-0.5, 0.5)], np.float32)
QUADS = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
FACES = np.array([t for a, b, c, d in QUADS for t in ((a, b, c), (a, c, d))], np.int32)


def block(x: float, y: float, z: float, at: tuple[float, float, float] = (0, 0, 0)) -> np.ndarray:
    """Return the (8, 3) corners of a box of this size; `at` is the centre of its bottom."""
    return (CORNERS * np.array([x, y, z]) + np.array(at)).astype(np.float32)


def asset(name: str, category: str, *parts: np.ndarray, seat: float | None = None) -> Asset:
    vertices = np.concatenate(parts)
    faces = np.concatenate([FACES + 8 * index for index in range(len(parts))])
    mesh = Mesh(vertices, faces, np.zeros((len(vertices), 2), np.float32), np.full((2, 2, 3), 128, np.uint8))
    return Asset(name, category, mesh, tuple(parts), seat)


def scene_object(
    number: int, kind: Asset, x: float, z: float, yaw: float = 0.0, y: float = 0.0, **more: object
) -> SceneObject:
    turn = quaternion_from_matrix(yaw_matrix(yaw))
    return SceneObject(number, kind.name, kind.category, (x, y, z), tuple(map(float, turn)), **more)  # type: ignore[arg-type]


def scene(*placed: tuple[Asset, SceneObject], rooms: tuple[Room, ...] = (), start: Pose2D | None = None) -> Scene:
    assets = {kind.name: kind for kind, _ in placed}
    return Scene("test:rooms", assets, tuple(obj for _, obj in placed), rooms, start or Pose2D(1.0, 1.0, 0.0))


def two_rooms(door: float = 0.9, *extra: tuple[Asset, SceneObject]) -> Scene:
    """Two rooms of 4 m x 6 m (x from 0 to 8, z from 0 to 6); the wall between them at x = 4 has a doorway at z = 4.5.

    Living room (x > 4): a couch (id 20) at the far wall, facing -X, and a TV (21) high on the wall at z = 0.
    Bedroom (x < 4): a bed (22) with its head at the wall x = 0. Start at (1, 1) facing +Z.
    """
    low, high = 4.5 - door / 2, 4.5 + door / 2
    pieces = {
        "wall_w": (block(0.1, 2.5, 6.2), -0.05, 3.0), "wall_e": (block(0.1, 2.5, 6.2), 8.05, 3.0),
        "wall_s": (block(8.2, 2.5, 0.1), 4.0, -0.05), "wall_n": (block(8.2, 2.5, 0.1), 4.0, 6.05),
        "wall_a": (block(0.1, 2.5, low), 4.0, low / 2), "wall_b": (block(0.1, 2.5, 6 - high), 4.0, (6 + high) / 2),
    }  # fmt: skip
    walls = [asset(name, "wall", shape) for name, (shape, _, _) in pieces.items()]
    placed = [(kind, scene_object(i, kind, *pieces[kind.name][1:])) for i, kind in enumerate(walls, start=1)]
    lintel = asset("lintel", "wall", block(0.1, 0.5, door))
    ground = asset("ground", "floor", block(8.2, 0.1, 6.2))
    couch = asset("couch", "couch", block(2.0, 0.42, 0.9), block(2.0, 0.4, 0.25, (0, 0.42, -0.325)), seat=0.42)
    tv = asset("tv", "tv", block(1.0, 0.6, 0.08))
    bed = asset("bed", "bed", block(1.6, 0.5, 2.0), block(1.6, 0.4, 0.1, (0, 0.5, -0.95)), seat=0.5)
    placed += [
        (lintel, scene_object(10, lintel, 4.0, 4.5, y=2.0)),
        (ground, scene_object(11, ground, 4.0, 3.0, y=-0.1)),
        (couch, scene_object(20, couch, 7.5, 2.5, -np.pi / 2)),
        (tv, scene_object(21, tv, 6.0, 0.05, y=0.9)),
        (bed, scene_object(22, bed, 1.05, 4.6, np.pi / 2)),
        *extra,
    ]
    rooms = (Room("bedroom", "bedroom", 0, 0, 4, 6), Room("living room", "living_room", 4, 0, 8, 6))
    return scene(*placed, rooms=rooms)


RISER, GOING, STEPS = 0.17, 0.25, 16
UPSTAIRS = 2.72
"""Height of the upper floor: 16 risers of 17 cm."""


def two_storeys(*extra: tuple[Asset, SceneObject]) -> Scene:
    """Two rooms of 8 m x 3 m, one above the other, and a flight of stairs along the wall z = 0, 1 m wide.

    The stairs rise towards +X. The first riser is at x = 2; the last, at x = 5.75, leads onto the upper floor. Rails
    stand along the stairs on both floors. Lower floor: a plant (id 30) at (1, 2.5). Upper floor: a bed (31) with its
    foot towards -Z, and a plant (32) at (7.4, 2.6). Start at (1, 0.5) facing +X.
    """
    ends = [("wall_w", -0.05), ("wall_e", 8.05)]
    parts = [(asset(name, "wall", block(0.1, 5.4, 3.2)), x, 1.5, 0.0) for name, x in ends]
    parts += [
        (asset(name, "wall", block(8.2, 5.4, 0.1)), 4.0, z, 0.0) for name, z in [("wall_s", -0.05), ("wall_n", 3.05)]
    ]
    parts += [(asset("ground", "floor", block(8.2, 0.1, 3.2)), 4.0, 1.5, -0.1)]
    parts += [(asset("slab", "floor", block(5.75, 0.12, 2.0, (-1.125, 0, 0)), block(2.25, 0.12, 3.0, (2.875, 0, -0.5))),
               4.0, 2.0, UPSTAIRS - 0.12)]  # fmt: skip
    steps = [block(GOING, k * RISER, 1.0, (2.0 + (k - 0.5) * GOING, 0, 0.5)) for k in range(1, STEPS)]
    parts += [(asset("stairs", "stairs", *steps), 0.0, 0.0, 0.0)]
    rail = asset("rail", "stairs", block(3.75, 0.9, 0.06))
    parts += [(rail, 3.875, 1.03, UPSTAIRS), (asset("under", "wall", block(3.75, 2.6, 0.06)), 3.875, 1.03, 0.0)]
    end = asset("end", "stairs", block(0.06, 0.9, 1.0))
    parts += [(end, 2.0 - 0.2, 0.5, UPSTAIRS)]
    placed = [(kind, scene_object(number, kind, x, z, y=y)) for number, (kind, x, z, y) in enumerate(parts, start=1)]
    plant = asset("plant", "potted_plant", block(0.3, 1.0, 0.3))
    bed = asset("bed", "bed", block(1.6, 0.5, 2.0), seat=0.5)
    placed += [
        (plant, scene_object(30, plant, 1.0, 2.5)),
        (bed, scene_object(31, bed, 1.0, 1.95, np.pi, y=UPSTAIRS)),
        (plant, scene_object(32, plant, 7.4, 2.6, y=UPSTAIRS)),
        *extra,
    ]
    rooms = (
        Room("cellar", "living", 0, 0, 8, 3), Room("attic", "bedroom", 0, 1.06, 5.7, 3, UPSTAIRS),
        Room("gallery", "hall", 5.75, 0, 8, 3, UPSTAIRS),
    )  # fmt: skip
    return scene(*placed, rooms=rooms, start=Pose2D(1.0, 0.5, np.pi / 2))
