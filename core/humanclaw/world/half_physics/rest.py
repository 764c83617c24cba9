"""Movable objects at rest: how they lie once they have settled, without a body.

They settle once for a scene and an engine, and the result is kept on disk. So each start in a house finds every object
at the same place, and does not wait for it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np

from humanclaw.body.pose import FPS, Array, Pose2D, rest_pose
from humanclaw.storage.cache import source_digest
from humanclaw.world.half_physics.profile import Profile
from humanclaw.world.half_physics.quaternions import poses_of
from humanclaw.world.half_physics.world import ObjectMotion, OpenWorld
from humanclaw.world.scene import Scene
from humanclaw.world.scene_cache import kept

_FRAMES: Final = 15
"""Half a second: time enough for what is placed a little above its support to land."""
_LAST: Final = 3
"""The frames of it, a tenth of a second, in which an object must not stray to lie still."""
_STILL: Final = 0.1, 0.001
"""An object lies still if it is slower than this, m/s and rad/s, and strays less than this in the last frames, metres.
One that topples is slow for a while, and one that rises is slow before it falls: they stray."""
_LEVEL: Final = np.array([True, False, True])
_ALOFT: Final = 1000.0
"""Height of the body meanwhile, metres: it meets nothing."""
_SOURCES: Final = tuple(
    f"humanclaw/{name}"
    for name in ("world/half_physics", "world/scene_cache.py", "world/scene.py", "world/joints.py", "body")
)


def at_rest(open_world: OpenWorld, scene: Scene, profile: Profile, engine: str = "") -> Mapping[int, ObjectMotion]:
    """Return how each movable object with hulls moves after half a second alone in a scene; most lie still.

    engine: digest of everything in the engine that may change it; empty to keep nothing on disk.
    """
    movable = [obj.id for obj in scene.objects if obj.movable and scene.assets[obj.asset].hulls]
    if not movable:
        return {}

    def settle() -> dict[str, Array]:
        return {"motions": _settled(open_world, scene, profile, movable)}

    code = f"{source_digest(_SOURCES, ('numpy',))}|{engine}|{profile}"
    motions = (kept(scene, "rest", code, settle) if engine else settle())["motions"]
    return {key: ObjectMotion(*np.split(row, (3, 7, 10))) for key, row in zip(movable, motions, strict=True)}


def _settled(open_world: OpenWorld, scene: Scene, profile: Profile, movable: list[int]) -> Array:
    """Return (N, 13) position, quaternion, velocity and spin of the objects; 0 for both speeds of one that is still."""
    placed, motions = _alone(open_world, scene, profile, movable, {})
    if inside := _indoors(scene, movable, placed, motions):
        _, motions = _alone(open_world, scene, profile, movable, inside)
    return _held_up(scene, movable, placed, motions)


def _alone(
    open_world: OpenWorld, scene: Scene, profile: Profile, movable: list[int], elsewhere: Mapping[int, ObjectMotion]
) -> tuple[Array, Array]:
    """Return where the objects begin, and what _settled returns. elsewhere: those that begin where no scene says."""
    (aloft,) = poses_of(Pose2D(0.0, 0.0, 0.0, _ALOFT).to_world(rest_pose()))
    world = open_world(scene, profile, aloft)
    for key, motion in elsewhere.items():
        world.set_motion(key, motion)

    def after(frames: int) -> Array:
        for _ in range(frames * profile.substeps):
            world.step(1 / (FPS * profile.substeps))
        return np.array([np.concatenate([*vars(world.motion(key)).values()]) for key in movable])

    try:
        placed = after(0)
        before, motions = after(_FRAMES - _LAST), after(_LAST)
        speed, way = (np.abs(part).max(axis=1) for part in (motions[:, 7:], (motions - before)[:, :3]))
        motions[(speed < _STILL[0]) & (way < _STILL[1]), 7:] = 0.0
        return placed, motions
    finally:
        world.close()


def _indoors(scene: Scene, movable: list[int], placed: Array, motions: Array) -> Mapping[int, ObjectMotion]:
    """Return on the inner side of its wall each object that was placed in one and has left the house."""
    walls = np.array([scene.aabb(obj.id) for obj in scene.of_category("wall")]).reshape(-1, 2, 3)
    low, high = walls[:, 0].min(axis=0, initial=np.inf), walls[:, 1].max(axis=0, initial=-np.inf)
    inside = dict[int, ObjectMotion]()
    for key, before, after in zip(movable, placed[:, :7], motions[:, :3], strict=True):
        within = ((walls[:, 0] < before[:3]) & (before[:3] < walls[:, 1])).all(axis=1)
        left = ((after < low) | (after > high)) & _LEVEL
        if within.any() and left.any():
            mirrored = walls[within][0].sum(axis=0) - after
            place = np.where(left, mirrored, before[:3])
            inside[key] = ObjectMotion(place, before[3:], np.zeros(3), np.zeros(3))
    return inside


def _held_up(scene: Scene, movable: list[int], placed: Array, motions: Array) -> Array:
    """Leave what is placed so deep in a floor that it leaves the scene below it at rest where it is placed."""
    fixed = [hull for obj in scene.objects if not obj.movable for hull in scene.hulls(obj.id)]
    low, high = (np.array([edge(hull, axis=0) for hull in fixed]).reshape(-1, 3) for edge in (np.min, np.max))
    for key, before, after in zip(movable, placed, motions, strict=True):
        points = np.concatenate(scene.hulls(key))
        inside = (points.min(axis=0) < high) & (points.max(axis=0) > low)
        if inside.all(axis=1).any() and points[:, 1].max() + after[1] - before[1] < low[:, 1].min():
            after[:] = before
    return motions
