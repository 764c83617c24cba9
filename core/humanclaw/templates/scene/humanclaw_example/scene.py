"""The scene, as plain values. Metres, Y up; a body that faces +Z has its left at +X."""

from __future__ import annotations

import numpy as np

from humanclaw import Scene, SceneError
from humanclaw.pose import Pose2D
from humanclaw.scene import Asset, Mesh, Room, SceneObject, Vec3

WIDE, HIGH, THICK = 6.0, 2.6, 0.1
SEAT = 0.45


def make(argument: str) -> Scene:
    """Put a room together; the number says where the chair is. Raises SceneError for anything but a number."""
    if not argument.isdigit():
        raise SceneError(f"{argument!r} is no number of a room.", "Ask for example:0, example:1 and so on.")
    place = np.random.default_rng(int(argument)).uniform(-0.3 * WIDE, 0.3 * WIDE, 2)
    parts = [("floor", (WIDE, THICK, WIDE), (0.0, -THICK, 0.0)), *_walls()]
    parts += [("chair", (0.45, SEAT, 0.45), (float(place[0]), 0.0, float(place[1])))]
    assets = {f"{category} {size}": box(category, size) for category, size, _ in parts}
    objects = tuple(
        SceneObject(number, f"{category} {size}", category, position, room="room")
        for number, (category, size, position) in enumerate(parts, start=1)
    )
    half = WIDE / 2
    room = Room("room", "living_room", -half, -half, half, half)
    return Scene(f"example:{argument}", assets, objects, (room,), Pose2D(0.0, -0.4 * WIDE, 0.0))


def _walls() -> list[tuple[str, Vec3, Vec3]]:
    out = (WIDE + THICK) / 2
    along = [((WIDE, HIGH, THICK), (0.0, 0.0, side * out)) for side in (-1, 1)]
    across = [((THICK, HIGH, WIDE), (side * out, 0.0, 0.0)) for side in (-1, 1)]
    return [("wall", size, position) for size, position in along + across]


def box(category: str, size: Vec3) -> Asset:
    """Make a box that stands on its own ground. humanclaw.meshes makes assets of model files."""
    corners = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (0.0, 1.0) for z in (-0.5, 0.5)]) * size
    sides = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    vertices = corners[np.array(sides).ravel()].astype(np.float32)
    faces = [[4 * side, 4 * side + k, 4 * side + k + 1] for side in range(6) for k in (1, 2)]
    texture = np.full((1, 1, 3), 90 if category == "chair" else 200, np.uint8)
    mesh = Mesh(vertices, np.array(faces, np.int32), np.zeros((24, 2), np.float32), texture)
    seat = SEAT if category == "chair" else None
    return Asset(f"{category} {size}", category, mesh, (corners.astype(np.float32),), seat, source="example")
