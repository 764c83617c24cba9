"""Check that a house is usable: no objects overlap, and every target can be approached and every seat sat on."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np
from manifold3d import Manifold
from numpy.typing import NDArray

from humanclaw import Scene
from humanclaw.body import matrix_from_quaternion
from humanclaw.records import SEATS
from humanclaw.world import RADIUS, STRUCTURE, Hinge, SceneObject
from humanclaw_houses.starting import WalkableArea

REACH: Final = 0.42
"""Largest horizontal distance from the centre of a standing body to a target, metres."""
FURNISHED: Final = ("chair", "couch", "bed", "potted_plant", "tv", "toilet")
"""Categories of which every house has at least one; each such object can be approached."""
_SHARED: Final = 2e-5
"""Largest volume that two objects may share, cubic metres: a cube of about 2.7 cm. Touching objects share some."""


def problems(scene: Scene, walkable: WalkableArea | None = None) -> list[str]:
    """Return a message for each problem of a house; empty if it is usable. walkable: of the scene, if it is known."""
    walkable = walkable or WalkableArea.of(scene)
    faults = [f"there is no {category}" for category in FURNISHED if not scene.of_category(category)]
    faults += [f"{scene.by_id[a].asset} and {scene.by_id[b].asset} interpenetrate" for a, b in interpenetrating(scene)]
    faults += [
        f"{scene.by_id[a].asset} swings through {scene.by_id[b].asset}" for a, b in sorted(set(swung_through(scene)))
    ]
    faults += [f"{room} cannot be walked to" for room in unreached_rooms(scene, walkable)]
    for obj in scene.objects:
        if obj.category in FURNISHED and not _any(walkable.near(*scene.aabb(obj.id), REACH)):
            faults.append(f"{obj.asset} cannot be approached")
        if obj.category in SEATS:
            faults += _wrong_seat(scene, obj)
            if not _any(standing_room(scene, walkable, obj)):
                faults.append(f"there is no room to stand before {obj.asset}")
    plan = walkable.floors.grids[0]
    if plan.at(walkable.room_at(0), np.array([scene.start.x, scene.start.z])) < 0.5:
        faults.append("there is no room at the start")
    return faults


def _any(masks: tuple[NDArray[np.bool_], ...]) -> bool:
    return any(bool(mask.any()) for mask in masks)


def unreached_rooms(scene: Scene, walkable: WalkableArea) -> list[str]:
    """Return the rooms of whose free floor less than three quarters is reachable. Stairs are not checked."""
    names = []
    for room in scene.rooms:
        for k, plan in enumerate(walkable.floors.floors):
            free = plan.within(room) & plan.fits(RADIUS)
            walked = int((free & np.isfinite(walkable.reached[2 * k])).sum())
            if abs(room.floor - plan.floor) < 0.5 and room.kind != "stairs" and walked < max(1.0, 0.75 * free.sum()):
                names.append(room.name)
    return names


def standing_room(scene: Scene, walkable: WalkableArea, obj: SceneObject) -> tuple[NDArray[np.bool_], ...]:
    """Return, for each storey, the reachable cells from which a body can sit down on an object.

    They are in front of its front edge; for a bed also beside it.
    """
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
    """Return the problem of a seat, if any: its height must be 0.35 to 0.65 m, and a collision hull must end there."""
    asset = scene.assets[obj.asset]
    if asset.seat_height is None or not 0.35 <= asset.seat_height <= 0.65:
        return [f"{obj.asset} has its seat at {asset.seat_height} m"]
    gap = min(abs(float(hull[:, 1].max()) - asset.seat_height) for hull in asset.hulls)
    return [f"{obj.asset} has nothing to sit on at its seat height"] if gap > 0.015 else []


def interpenetrating(scene: Scene) -> Iterator[tuple[int, int]]:
    """Yield ids of two objects whose collision hulls overlap, except two parts of the building."""
    owners, hulls = _hulls(scene)
    # Boxes 1 mm smaller on each side rule out nearly all pairs before the exact and slow intersection.
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
    """Yield ids of an object on a joint and of an object that it hits somewhere in its range.

    Excepted are the building and what is on joints too: these do not meet.
    """
    owners, hulls = _hulls(scene)
    others = [k for k, owner in enumerate(owners.tolist())
              if scene.by_id[owner].category not in STRUCTURE and not scene.by_id[owner].joint]  # fmt: skip
    lows, highs = (np.array([f(hulls[k], axis=0) for k in others]) for f in (np.min, np.max))
    for obj in scene.objects:
        for leaf in _swept(scene, obj) if obj.joint else ():
            low, high = leaf.min(axis=1)[:, None] + 0.001, leaf.max(axis=1)[:, None] - 0.001
            for state, k in np.argwhere(((lows < high) & (highs > low)).all(axis=-1)):
                hull = hulls[others[k]]
                if (Manifold.hull_points(leaf[state]) ^ Manifold.hull_points(hull)).volume() > _SHARED:
                    yield obj.id, int(owners[others[k]])


def _swept(scene: Scene, obj: SceneObject) -> Iterator[NDArray[np.float64]]:
    """Yield each hull of an object on a joint, (N, K, 3) world points at states five degrees or centimetres apart."""
    assert obj.joint is not None
    step = np.radians(5) if isinstance(obj.joint, Hinge) else 0.05
    steps = int(np.ceil((obj.joint.high - obj.joint.low) / step)) + 1
    poses = np.array([obj.at(angle) for angle in np.linspace(obj.joint.low, obj.joint.high, steps).tolist()])
    turns = matrix_from_quaternion(poses[:, 3:]).swapaxes(1, 2)
    yield from (hull.astype(float) @ turns + poses[:, None, :3] for hull in scene.assets[obj.asset].hulls)


def _hulls(scene: Scene) -> tuple[NDArray[np.int64], list[NDArray[np.float64]]]:
    """Return the object ids of all collision hulls, and the hulls in the world frame."""
    placed = [(obj.id, hull) for obj in scene.objects for hull in scene.hulls(obj.id)]
    return np.array([owner for owner, _ in placed]), [hull for _, hull in placed]
