"""A body's way through a scene, and what happened to the objects there."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property, reduce

import numpy as np

from humanclaw.body.pose import FUTURE, Array, Motion
from humanclaw.world.scene import Scene
from humanclaw.world.simulator import Chunk, Contact, Simulator, WorldState


@dataclass(frozen=True)
class Played:
    """Commanded motion and its execution, chunk by chunk (world frame)."""

    began: WorldState
    """The state before the first chunk."""
    chunks: tuple[Chunk, ...]

    @property
    def simulated(self) -> Motion:
        return reduce(Motion.then, (chunk.execution.simulated for chunk in self.chunks))

    @property
    def contacts(self) -> tuple[Contact, ...]:
        """The contacts of every chunk, with the frames of their chunk."""
        return tuple(contact for chunk in self.chunks for contact in chunk.execution.contacts)

    def touched(self, object_id: int) -> tuple[Contact, ...]:
        """Return the body's contacts with one object."""
        return tuple(contact for contact in self.contacts if contact.object_id == object_id)

    def depths(self, object_id: int) -> Array:
        """Return the penetration of links into an object in every contact, metres."""
        return np.array([contact.depth for contact in self.touched(object_id)])

    def achieved(self) -> Array:
        """Return (3,) displacement of the root as a share of the commanded displacement."""
        begun = self.began.body.root[-1:]
        ends = np.concatenate([begun, *(chunk.execution.simulated.root[-1:] for chunk in self.chunks)])
        asked = np.stack([chunk.commanded.root[-1] for chunk in self.chunks]) - ends[:-1]
        return np.asarray((ends[-1] - ends[0]) / asked.sum(axis=0))

    @cached_property
    def paths(self) -> Mapping[int, Array]:
        """Poses (frames + 1, 7) by id of the movable object, the first one before the motion."""
        return {key: self._path(key, pose[None]) for key, pose in self.began.objects.items()}

    def _path(self, key: int, path: Array) -> Array:
        for chunk in self.chunks:
            still = np.repeat(path[-1:], len(chunk.commanded), axis=0)
            path = np.concatenate([path, chunk.execution.objects.get(key, still)])
        return path

    def path_above(self, object_id: int, height: float) -> Array:
        """Return (frames + 1, 3) the path of a point above the base of an upright movable object, metres."""
        places = self.paths[object_id]
        x, y, z, w = places[:, 3:].T
        up = np.stack([2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)], -1)
        return np.asarray(places[:, :3] + height * up)


def play(simulator: Simulator, scene: Scene, motion: Motion) -> Played:
    """Drive a body through a motion in chunks of half a second, each from where the last one ended."""
    began = simulator.reset(scene, scene.start)
    here, origin, chunks = began.body, began.body.root[0] * [0, 1, 0], list[Chunk]()
    for first in range(0, len(motion), FUTURE):
        piece = motion[first : first + FUTURE]
        gap = (here.root[-1] - origin) * [1, 0, 1]
        commanded = Motion(piece.root + gap, piece.rotations)
        chunks.append(Chunk(commanded, simulator.execute(commanded)))
        here, origin = chunks[-1].execution.simulated, piece.root[-1]
    return Played(began, tuple(chunks))
