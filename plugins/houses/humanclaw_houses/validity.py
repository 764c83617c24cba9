"""What makes a house usable, checked: nothing stands in anything else, and every target can be walked up to and sat
on."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np
from manifold3d import Manifold
from numpy.typing import NDArray

from humanclaw import Scene
from humanclaw.body import matrix_from_quaternion
from humanclaw.records import SEATS
from humanclaw.world import RADIUS, STRUCTURE, SceneObject
from humanclaw_houses.starting import WalkableArea

REACH: Final = 0.42
"""How far from the middle of a standing body a target may be, seen from above, metres."""
FURNISHED: Final = ("chair", "couch", "bed", "potted_plant", "tv", "toilet")
"""Every house has at least one of each of these, and each of them can be walked up to."""
_SHARED: Final = 2e-5
"""The volume that two objects may share, cubic metres: a 2 cm cube at most counts as touching."""


def problems(scene: Scene) -> list[str]:
    """Everything wrong with a house, in words; empty if it can be used."""
    walkable = WalkableArea.of(scene)
    found = [f"there is no {category}" for category in FURNISHED if not scene.of_category(category)]
    found += [f"{scene.by_id[a].asset} and {scene.by_id[b].asset} interpenetrate" for a, b in interpenetrating(scene)]
    found += [
        f"{scene.by_id[a].asset} swings through {scene.by_id[b].asset}" for a, b in sorted(set(swung_through(scene)))
    ]
    found += [f"{room} cannot be walked to" for room in unreached_rooms(scene, walkable)]
    for obj in scene.objects:
        if obj.category in FURNISHED and not _any(walkable.near(*scene.aabb(obj.id), REACH)):
            found.append(f"{obj.asset} cannot be approached")
        if obj.category in SEATS:
            found += _wrong_seat(scene, obj)
            if not _any(standing_room(scene, walkable, obj)):
                found.append(f"there is no room to stand before {obj.asset}")
    plan = walkable.floors.grids[0]
    if plan.at(walkable.room_at(0), np.array([scene.start.x, scene.start.z])) < 0.5:
        found.append("there is no room at the start")
    return found


def _any(masks: tuple[NDArray[np.bool_], ...]) -> bool:
    return any(bool(mask.any()) for mask in masks)


def unreached_rooms(scene: Scene, walkable: WalkableArea) -> list[str]:
    """Rooms with less than three quarters of their free floor in the part that can be walked in one piece; stairs are
    passed over if a storey that they lead to is reached."""
    names = []
    for room in scene.rooms:
        for k, plan in enumerate(walkable.floors.floors):
            free = plan.within(room) & plan.fits(RADIUS)
            walked = int((free & np.isfinite(walkable.reached[2 * k])).sum())
            if abs(room.floor - plan.floor) < 0.5 and room.kind != "stairs" and walked < max(1.0, 0.75 * free.sum()):
                names.append(room.name)
    return names


def standing_room(scene: Scene, walkable: WalkableArea, obj: SceneObject) -> tuple[NDArray[np.bool_], ...]:
    """On each storey, the cells from which a body can sit down on an object: before its front edge (beds: beside them
    too), and reached on foot."""
    points = scene.assets[obj.asset].mesh.vertices
    front, half = float(points[:, 2].max()), float(points[:, 0].max())
    plan = walkable.floors.grids[0]
    offset = plan.point(np.moveaxis(np.indices(plan.blocked.shape), 0, -1)) - np.array(obj.position)[[0, 2]]
    turn = matrix_from_quaternion(np.array(obj.rotation))[np.ix_([0, 2], [0, 2])]
    side, ahead = np.moveaxis(offset @ turn, -1, 0)
    before = (ahead > front) & (ahead < front + 0.5) & (np.abs(side) < max(half - 0.1, 0.2))
    if obj.category == "bed":
        before |= (np.abs(ahead) < front - 0.2) & (np.abs(side) > half) & (np.abs(side) < half + 0.5)
    return tuple(before & near for near in walkable.near(*scene.aabb(obj.id), 2.0))


def _wrong_seat(scene: Scene, obj: SceneObject) -> list[str]:
    """Say what is wrong with a seat: it is where the asset says if a collision hull ends there, and it can be sat on at
    0.35 to 0.65 m."""
    asset = scene.assets[obj.asset]
    if asset.seat_height is None or not 0.35 <= asset.seat_height <= 0.65:
        return [f"{obj.asset} has its seat at {asset.seat_height} m"]
    gap = min(abs(float(hull[:, 1].max()) - asset.seat_height) for hull in asset.hulls)
    return [f"{obj.asset} has nothing to sit on at its seat height"] if gap > 0.015 else []


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


def swung_through(scene: Scene) -> Iterator[tuple[int, int]]:
    """Ids of hinged objects and of what their hulls share space with anywhere in their range, the building left out."""
    owners, hulls = _hulls(scene)
    others = [(int(owner), hull) for owner, hull in zip(owners, hulls, strict=True)
              if scene.by_id[owner].category not in STRUCTURE]  # fmt: skip
    for obj in scene.objects:
        for leaf in _swept(scene, obj) if obj.joint else ():
            low, high = leaf.min(axis=0) + 0.001, leaf.max(axis=0) - 0.001
            for owner, hull in others:
                near = (hull.min(axis=0) < high).all() and (hull.max(axis=0) > low).all()
                if near and (Manifold.hull_points(leaf) ^ Manifold.hull_points(hull)).volume() > _SHARED:
                    yield obj.id, owner


def _swept(scene: Scene, obj: SceneObject) -> Iterator[NDArray[np.float64]]:
    """Yield the hulls of a hinged object at every five degrees of its range, in the world."""
    assert obj.joint is not None
    steps = int(np.ceil(np.degrees(obj.joint.high - obj.joint.low) / 5)) + 1
    for angle in np.linspace(obj.joint.low, obj.joint.high, steps):
        yield from scene.hulls(obj.id, obj.at(float(angle)))


def _hulls(scene: Scene) -> tuple[NDArray[np.int64], list[NDArray[np.float64]]]:
    """Return the collision hulls of all objects in the world, and whose they are."""
    placed = [(obj.id, hull) for obj in scene.objects for hull in scene.hulls(obj.id)]
    return np.array([owner for owner, _ in placed]), [hull for _, hull in placed]
