"""Movable objects at rest: how they lie once they have settled, without a body.

They settle once for a scene and an engine, and the result is kept on disk. So each start in a house finds every object
at the same place, and does not wait for it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from typing import Final

import numpy as np

from humanclaw.body.pose import FPS, Array, Pose2D, rest_pose
from humanclaw.storage.cache import source_digest
from humanclaw.world.half_physics.profile import Profile
from humanclaw.world.half_physics.quaternions import poses_of
from humanclaw.world.half_physics.world import ObjectMotion, OpenWorld, World
from humanclaw.world.scene import Scene
from humanclaw.world.scene_cache import kept

_FRAMES: Final = 15
"""Half a second: time enough for what is placed a little above its support to land."""
_LAST: Final = 3
"""The frames of it, a tenth of a second, in which an object must not stray to lie still."""
_STILL: Final = 0.1, 0.001
"""An object lies still if it is slower than this, m/s and rad/s, and strays less than this in the last frames, metres.
One that topples is slow for a while, and one that rises is slow before it falls: they stray."""
_PARTINGS: Final = 50
"""Most steps in one world in which objects that are placed in one another come apart: after 60 without speed an engine
lets them sleep."""
_OPENINGS: Final = 6
"""Most such worlds, one after the other."""
_APART: Final = 0.0002
"""They are apart if none moves further in a step, metres: an engine may push by less than a tenth of the depth."""
_WAYS_IN: Final = 3
"""In a corner an object may leave the house through one wall, and then through the other."""
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
    return {key: _motion(row) for key, row in zip(movable, motions, strict=True)}


def _settled(open_world: OpenWorld, scene: Scene, profile: Profile, movable: list[int]) -> Array:
    """Return (N, 13) position, quaternion, velocity and spin of the objects; 0 for both speeds of one that is still."""
    elsewhere = dict[int, ObjectMotion]()
    for _ in range(_WAYS_IN):
        placed, motions = _alone(open_world, scene, profile, movable, elsewhere)
        if not (inside := _indoors(scene, movable, placed, motions)):
            break
        elsewhere.update(inside)
    return _held_up(scene, movable, placed, motions)


def _alone(
    open_world: OpenWorld, scene: Scene, profile: Profile, movable: list[int], elsewhere: Mapping[int, ObjectMotion]
) -> tuple[Array, Array]:
    """Return where the objects begin, and what _settled returns. elsewhere: those that begin where no scene says."""
    seconds = 1 / (FPS * profile.substeps)
    apart, begun = dict[int, ObjectMotion](), list[Array]()
    for _ in range(_OPENINGS):
        with _opened(open_world, scene, replace(profile, gravity=0.0), {**elsewhere, **apart}) as world:
            begun.append(_motions(world, movable))
            more = _come_apart(world, movable, begun[-1], seconds)
        apart.update(more)
        if not more:
            break
    with _opened(open_world, scene, profile, {**elsewhere, **apart}) as world:

        def after(frames: int) -> Array:
            for _ in range(frames * profile.substeps):
                world.step(seconds)
            return _motions(world, movable)

        before, motions = after(_FRAMES - _LAST), after(_LAST)
        speed, way = (np.abs(part).max(axis=1) for part in (motions[:, 7:], (motions - before)[:, :3]))
        motions[(speed < _STILL[0]) & (way < _STILL[1]), 7:] = 0.0
        return begun[0], motions


def _come_apart(world: World, movable: list[int], placed: Array, seconds: float) -> Mapping[int, ObjectMotion]:
    """Push objects that are placed in one another apart, as if time stood still; return where those are that moved.

    The world has no gravity, and none keeps its speed. Speeds would add up in a row: of sixteen books, each 2 mm inside
    the next, the last one would fly off its shelf.
    """
    before = placed
    for _ in range(_PARTINGS):
        world.step(seconds)
        after = _motions(world, movable)
        after[:, 7:] = 0.0
        if np.abs(after - before)[:, :7].max() < _APART:
            break
        for key, row in zip(movable, after, strict=True):
            world.set_motion(key, _motion(row))
        before = after
    moved = np.abs(before - placed)[:, :7].max(axis=1) > 0
    return {key: _motion(row) for key, row, parted in zip(movable, before, moved, strict=True) if parted}


@contextmanager
def _opened(
    open_world: OpenWorld, scene: Scene, profile: Profile, elsewhere: Mapping[int, ObjectMotion]
) -> Iterator[World]:
    (aloft,) = poses_of(Pose2D(0.0, 0.0, 0.0, _ALOFT).to_world(rest_pose()))
    world = open_world(scene, profile, aloft)
    try:
        for key, motion in elsewhere.items():
            world.set_motion(key, motion)
        yield world
    finally:
        world.close()


def _motions(world: World, movable: list[int]) -> Array:
    return np.array([np.concatenate([*vars(world.motion(key)).values()]) for key in movable])


def _motion(row: Array) -> ObjectMotion:
    return ObjectMotion(*np.split(row, (3, 7, 10)))


def _indoors(scene: Scene, movable: list[int], placed: Array, motions: Array) -> Mapping[int, ObjectMotion]:
    """Return on the inner side of its wall each object that was placed in one and has left the house."""
    walls = np.array([scene.aabb(obj.id) for obj in scene.of_category("wall")]).reshape(-1, 2, 3)
    low, high = walls[:, 0].min(axis=0, initial=np.inf), walls[:, 1].max(axis=0, initial=-np.inf)
    # Twice the middle of the outermost walls: one may be placed in the end of a side wall and leave through the back.
    first, last = low + walls[:, 1].min(axis=0, initial=np.inf), high + walls[:, 0].max(axis=0, initial=-np.inf)
    inside = dict[int, ObjectMotion]()
    for key, before, after in zip(movable, placed[:, :7], motions[:, :3], strict=True):
        within = ((walls[:, 0] < before[:3]) & (before[:3] < walls[:, 1])).all(axis=1)
        left = ((after < low) | (after > high)) & _LEVEL
        if within.any() and left.any():
            mirrored = np.where(after < low, first, last) - after
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
