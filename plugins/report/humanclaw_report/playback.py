"""Playback of a recorded episode: the scene in each frame, without the walls that hide the body."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import scipy
from numpy.typing import NDArray

from humanclaw import Motion, RecordedEpisode, RecordError, Scene, StepRecord
from humanclaw.body import JOINT_INDEX, Array
from humanclaw.world import GROUND, Camera, WorldState, floors_of
from humanclaw_report.camera import FOV, follow, framed, smoothed
from humanclaw_report.floor_plan import storeys_at

SHOWN: Final = [
    JOINT_INDEX[name] for name in ("head", "pelvis", "left_wrist", "right_wrist", "left_foot", "right_foot")
]
"""Joints that no object may hide."""
AHEAD: Final = 12
"""An object is left out this many frames of motion before and after it hides the body."""
AWAY: Final = np.array([0.0, -1000.0, 0.0, 0.0, 0.0, 0.0, 1.0])
"""Place of an object that is left out: position (metres) and quaternion, far below the house."""
_UP: Final = np.array([0.0, 0.05, 0.0])
"""From the hips to where the camera looks, metres."""
SLAB: Final = 0.4
"""Objects that begin less than this below an upper floor belong to its slab, metres."""


@dataclass(frozen=True, eq=False)
class FilmScene:
    """An episode's motion in its scene, with a camera for every frame."""

    episode: RecordedEpisode
    scenes: tuple[Scene, ...]
    """The scene that is shown while the body is on each storey, lowest first."""
    storeys: NDArray[np.int64]
    """(T,) index of the storey that the body is on."""
    motion: Motion
    objects: dict[int, Array]
    people: dict[int, Motion]
    eyes: Array
    """(T, 3) camera positions, metres."""
    centres: Array
    """(T, 3) where the camera looks, metres."""
    hidden: tuple[frozenset[int], ...]
    """For each frame, ids of the objects that are left out because they hide the body from the camera."""

    @classmethod
    def of(cls, episode: RecordedEpisode, scene: Scene) -> FilmScene:
        if not episode.has_motion:
            raise RecordError(f"{episode.folder} holds no motion.", "Only an episode that has ended can be filmed.")
        motion, objects = episode.motion(), episode.objects()
        floors = floors_of(scene)
        scenes = tuple(opened(scene, above - SLAB) for above in (*floors[1:], np.inf))
        # Smoothed, so that the scene does not flicker between two storeys on stairs.
        storeys = storeys_at(floors, smoothed(motion.root[:, 1], 6.0))
        # Outside of rooms there is nothing ahead of the body to see.
        eyes, centres = framed(motion) if not scene.rooms else (follow(motion), smoothed(motion.root, 3.0) + _UP)
        hidden = in_the_way(scene, motion, eyes)
        # A renderer keeps fixed objects where they are, so those that are ever left out become movable.
        loose = frozenset().union(*hidden)
        scenes = tuple(loosened(shown, loose) for shown in scenes)
        return cls(episode, scenes, storeys, motion, objects, episode.people(), eyes, centres, hidden)

    def state(self, frame: int) -> WorldState:
        """Return the world at a frame, without the objects that hide the body."""
        places = {key: path[frame] for key, path in self.objects.items()}
        people = {key: motion[frame : frame + 1] for key, motion in self.people.items()}
        shown = places | dict.fromkeys(self.hidden[frame], AWAY)
        return WorldState(self.motion[frame : frame + 1], shown, people=people)

    def camera(self, frame: int, size: tuple[int, int]) -> Camera:
        return Camera.looking(self.eyes[frame], self.centres[frame], FOV, size)


def step_at(episode: RecordedEpisode, frame: int) -> StepRecord | None:
    """Return the step that a frame belongs to; None before the first."""
    pairs = zip(episode.steps, episode.spans, strict=True)
    return next((step for step, (first, end) in pairs if first <= frame < end), None)


def opened(scene: Scene, above: float = np.inf) -> Scene:
    """Return the same scene without its ceilings and without objects that begin above a height, metres."""
    kept = [obj for obj in scene.objects if not obj.category.startswith("ceiling") and scene.aabb(obj.id)[0][1] < above]
    return replace(scene, objects=tuple(kept))


def loosened(scene: Scene, ids: frozenset[int]) -> Scene:
    """Return the same scene with these objects movable, so that a renderer takes their places from each state."""
    return replace(scene, objects=tuple(replace(o, movable=True) if o.id in ids else o for o in scene.objects))


def in_the_way(scene: Scene, motion: Motion, eyes: Array) -> tuple[frozenset[int], ...]:
    """Return for each frame the ids of the objects between eye and body, and for AHEAD frames before and after.

    Objects are tested by their boxes at rest. Floors, stairs, rugs and the seat that the hips are on never count.
    eyes: (T, 3), metres.
    """
    objects = [obj for obj in scene.objects if obj.category not in (*GROUND, "rug")]
    joints = motion.joints()
    hips = joints[:, 0]
    points = joints[:, SHOWN] + [0, 0.1, 0]
    sets: list[set[int]] = [set() for _ in eyes]
    for obj in objects:
        low, high = scene.aabb(obj.id)
        seat = scene.assets[obj.asset].seat_height is not None
        around = seat & ((hips > low - 0.15) & (hips < high + 0.15)).all(-1)
        hiding = _crosses(eyes[:, None], points, low, high).any(1) & ~around
        # Pictures go with their wall.
        ids = {obj.id} | (hung_on(scene, obj.id) if obj.category == "wall" else set())
        for frame in np.flatnonzero(scipy.ndimage.maximum_filter1d(hiding, 2 * AHEAD + 1)):
            sets[frame] |= ids
    return tuple(map(frozenset, sets))


def hung_on(scene: Scene, wall: int) -> set[int]:
    """Return the ids of the objects that hang on a wall: they touch the wall and stand on no floor.

    They are hidden with the wall, since they would float without it.
    """
    low, high = scene.aabb(wall)
    boxes = {obj.id: scene.aabb(obj.id) for obj in scene.objects if obj.category not in (*GROUND, "wall")}
    floors = floors_of(scene)
    return {
        key for key, (a, b) in boxes.items()
        if (a < high + 0.05).all() and (b > low - 0.05).all() and not any(-0.05 <= a[1] - f <= 0.3 for f in floors)
    }  # fmt: skip


def _crosses(start: Array, end: Array, low: Array, high: Array) -> NDArray[np.bool_]:
    """Tell whether each segment from start to end, (..., 3), meets the box; one that begins inside does."""
    way = end - start
    way = np.where(np.abs(way) < 1e-9, 1e-9, way)  # Avoids division by zero along an axis.
    near, far = (low - start) / way, (high - start) / way
    enters, leaves = np.minimum(near, far).max(-1), np.maximum(near, far).min(-1)
    return np.asarray((enters <= leaves) & (leaves > 0) & (enters < 0.98))
