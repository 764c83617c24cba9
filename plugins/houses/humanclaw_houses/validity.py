"""What makes a house usable, checked: nothing stands in anything else, and every target can be walked up to and sat on."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np
from manifold3d import Manifold
from numpy.typing import NDArray

from humanclaw.pose import matrix_from_quaternion
from humanclaw.scene import SIT_CATEGORIES, STRUCTURE, TARGET_CATEGORIES, Scene, SceneObject
from humanclaw_houses.starting import WalkMap

REACH: Final = 0.42
"""How far from the middle of a standing body a target may be, seen from above, metres."""
_SHARED: Final = 2e-5
"""The volume that two things may share, cubic metres: a 2 cm cube at most counts as touching."""


def problems(scene: Scene) -> list[str]:
    """Everything wrong with a house, in words; empty if it can be used."""
    walk = WalkMap.of(scene)
    found = [f"there is no {category}" for category in TARGET_CATEGORIES if not scene.of_category(category)]
    found += [f"{scene.by_id[a].asset} and {scene.by_id[b].asset} interpenetrate" for a, b in interpenetrating(scene)]
    found += [f"{room} cannot be walked to" for room in unreached_rooms(scene, walk)]
    for thing in scene.objects:
        if thing.category in TARGET_CATEGORIES and not walk.near(*scene.aabb(thing.id), REACH).any():
            found.append(f"{thing.asset} cannot be approached")
        if thing.category in SIT_CATEGORIES and not standing_room(scene, walk, thing).any():
            found.append(f"there is no room to stand before {thing.asset}")
    start = walk.cell(scene.start.x, scene.start.z)
    if not walk.main[start] or walk.clearance[start] < 0.5:
        found.append("there is no room at the start")
    return found


def unreached_rooms(scene: Scene, walk: WalkMap) -> list[str]:
    """Rooms with less than three quarters of their free floor in the part that can be walked in one piece."""
    names = []
    for room in scene.rooms:
        (row0, column0), (row1, column1) = walk.cell(room.x0, room.z0), walk.cell(room.x1, room.z1)
        window = slice(row0, row1), slice(column0, column1)
        if walk.main[window].sum() < max(1.0, 0.75 * walk.walkable[window].sum()):
            names.append(room.name)
    return names


def standing_room(scene: Scene, walk: WalkMap, thing: SceneObject) -> NDArray[np.bool_]:
    """Cells from which a body can sit down on a thing: before its front edge (beds: beside them too), and reached on foot."""
    points = scene.assets[thing.asset].mesh.vertices
    front, half = float(points[:, 2].max()), float(points[:, 0].max())
    rows, columns = np.indices(walk.clearance.shape)
    x, z = walk.x0 + (columns + 0.5) * 0.05 - thing.position[0], walk.z0 + (rows + 0.5) * 0.05 - thing.position[2]
    matrix = matrix_from_quaternion(np.array(thing.rotation))
    side, ahead = matrix[0, 0] * x + matrix[2, 0] * z, matrix[0, 2] * x + matrix[2, 2] * z
    before = (ahead > front) & (ahead < front + 0.5) & (np.abs(side) < max(half - 0.1, 0.2))
    if thing.category == "bed":
        before |= (np.abs(ahead) < front - 0.2) & (np.abs(side) > half) & (np.abs(side) < half + 0.5)
    return np.asarray(before & walk.main)


def interpenetrating(scene: Scene) -> Iterator[tuple[int, int]]:
    """Ids of objects whose collision hulls share space, parts of the building among themselves left out."""
    owners, hulls = _hulls(scene)
    low = np.array([hull.min(axis=0) for hull in hulls]) + 0.001
    high = np.array([hull.max(axis=0) for hull in hulls]) - 0.001
    building = np.array([scene.by_id[owner].category in STRUCTURE for owner in owners])
    meet = ((low[:, None] < high[None]) & (low[None] < high[:, None])).all(axis=-1)
    meet &= (owners[:, None] < owners[None]) & ~(building[:, None] & building[None])
    solids: dict[int, Manifold] = {}
    for first, second in np.argwhere(meet).tolist():
        pair = [solids.setdefault(k, Manifold.hull_points(hulls[k])) for k in (first, second)]
        if (pair[0] ^ pair[1]).volume() > _SHARED:
            yield int(owners[first]), int(owners[second])


def _hulls(scene: Scene) -> tuple[NDArray[np.int64], list[NDArray[np.float64]]]:
    """The collision hulls of all objects in the world, and whose they are."""
    owners, hulls = [], []
    for thing in scene.objects:
        matrix = matrix_from_quaternion(np.array(thing.rotation))
        for hull in scene.assets[thing.asset].hulls:
            owners.append(thing.id)
            hulls.append(hull.astype(float) @ matrix.T + np.array(thing.position))
    return np.array(owners), hulls
