"""Playback of a recorded episode: the scene in each frame, without the walls that hide the body."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from humanclaw import Motion, RecordedEpisode, RecordError, Scene, StepRecord
from humanclaw.body import Array
from humanclaw.world import Camera, WorldState, floors_of
from humanclaw_report.camera import FOV, SIDES, follow, framed, smoothed
from humanclaw_report.floor_plan import storeys_at
from humanclaw_report.shots import kept, shots

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
    """For each frame, ids of the objects that are left out of its shot because they hide the body from the camera."""

    @classmethod
    def of(cls, episode: RecordedEpisode, scene: Scene) -> FilmScene:
        if not episode.has_motion:
            raise RecordError(f"{episode.folder} holds no motion.", "Only an episode that has ended can be filmed.")
        motion, objects = episode.motion(), episode.objects()
        floors = floors_of(scene)
        scenes = tuple(opened(scene, above - SLAB) for above in (*floors[1:], np.inf))
        # Smoothed, so that the scene does not flicker between two storeys on stairs.
        storeys = storeys_at(floors, smoothed(motion.root[:, 1], 6.0))
        cuts, views = [first for first, _ in episode.spans], [follow(motion, side) for side in SIDES]
        centres = smoothed(motion.root, 3.0) + _UP
        if not scene.rooms:  # There is nothing ahead of the body to see.
            eyes, centres = framed(motion)
            cuts, views = [], [eyes]
        taken = shots(opened(scene), motion, views, cuts, kept(episode, scene))
        eyes = np.concatenate([shot.eyes for shot in taken])
        hidden = tuple(shot.hidden for shot in taken for _ in shot.eyes)
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
