"""A body that moves in one world: frames of physics, and what it touched and moved in them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Final

import numpy as np

from humanclaw.body.pose import FPS, Array, Motion
from humanclaw.body.skeleton import JOINTS
from humanclaw.world.half_physics.broad_phase import BroadPhase
from humanclaw.world.half_physics.drive import Drive
from humanclaw.world.half_physics.hands import Hands
from humanclaw.world.half_physics.profile import Profile
from humanclaw.world.half_physics.push_force_limit import PushForceLimit
from humanclaw.world.half_physics.quaternions import Pose, motion_of, poses_of
from humanclaw.world.half_physics.reflexes import CALM, feel
from humanclaw.world.half_physics.skeleton import LINK_OF
from humanclaw.world.half_physics.world import TOUCHING, TRAVEL, Touch, World
from humanclaw.world.scene import STRUCTURE
from humanclaw.world.simulator import Contact, Execution, WorldState

MOVED: Final = 0.001
"""An object whose path strays less than this from its beginning has not moved, metres."""
_CATCH_UP: Final = 3.0
"""A limb that was held back may come to its pose in the last third of a frame, three times as fast."""


class Simulation:
    """One body in one world, from its start on."""

    def __init__(self, world: World, profile: Profile, broad_phase: BroadPhase, pose: Pose) -> None:
        """Take a world with the body in a pose, and the broad phase of its scene."""
        self.world, self._profile, self._broad_phase = world, profile, broad_phase
        self._scene = scene = broad_phase.scene
        self._building = {scene_object.id for scene_object in scene.objects if scene_object.category in STRUCTURE}
        self._drive, self._push_limit = Drive(world, profile, pose), PushForceLimit(world, profile, scene)
        self.hands, self._reflex = Hands(world, profile, scene), CALM
        self._objects, self._restless = world.objects(), True
        self._still: Mapping[int, Array] | None = None
        """Where the movable objects were when `_pairs` were found."""
        self._pairs: list[tuple[int, int]] = []

    def execute(self, motion: Motion) -> Execution:
        """Drive the body through the frames of a finite motion, world frame."""
        simulated, contacts, touches, paths = [], [], [], []
        self.hands.tidy()
        began, before = self._objects, self._drive.pose.root
        swings = self._drive.swings(motion)
        for frame, target in enumerate(poses_of(motion)):
            velocity = (target.root - before) * FPS
            met = self.frame(target, velocity, float(swings[frame]))
            before = target.root
            simulated.append(self._drive.pose)
            contacts += self._contacts(frame, met)
            touches += self._touches(frame)
            paths.append(self._objects)
        return Execution(motion_of(simulated), tuple(contacts), tuple(touches), _moved(began, paths), self.hands.held)

    def state(self) -> WorldState:
        """Return the pose of the body and of every movable object, now."""
        return WorldState(motion_of([self.world.pose()]), self._objects, self.hands.held)

    def overlaps(self) -> list[Contact]:
        """Return what the body is inside of, now."""
        return self._contacts(0, self.world.overlaps())

    def frame(self, target: Pose, velocity: Array, swing: float = 0.0) -> list[Touch]:
        """One frame of physics; everything the body touched in any of its substeps."""
        profile, met = self._profile, list[Touch]()
        if self._reflex.borne:
            target = self._drive.laid(target)
        held, target = self.hands.held, self.hands.guided(target, velocity)
        self._drive.aim(target.quaternions, swing)
        course = self._drive.course(velocity, self._reflex)
        towards, near = self._broad_phase.look(course, self._objects, held.values())
        self._push_limit.look(near)
        self._push_limit.burden = self.hands.weight
        for substep in range(profile.substeps):
            horizontal = velocity if substep % profile.horizontal_every == 0 else None
            speed = self._drive.command(profile.substeps - substep, horizontal, self._reflex)
            touches = self._step(min(speed, _CATCH_UP * towards * FPS))
            self._drive.restrain(bool(touches))
            self._reflex = feel(self.world, profile, self._push_limit.movable, touches, self._reflex)
            met += touches
        if held:
            self.hands.let_slip(self._drive.pose)
        if near or held or self._restless:  # Else nothing moves, and to read every place takes long.
            before, self._objects = self._objects, self.world.objects()
            self._restless = self._objects is not before
        return met

    def _step(self, speed: float) -> Sequence[Touch]:
        """One physics step, in so many parts that no link comes far towards anything between two looks for contacts;
        the contacts of the body.

        In one part a kick ends 10 cm inside a wall, and a fast enough one behind it. A foot may touch a wall in an
        early part and have left it in the last one: the contacts are those of the last part that had any.
        """
        seconds = 1 / (FPS * self._profile.substeps)
        speed = max(speed, self.hands.speed)
        parts = min(max(1, math.ceil(speed * seconds / TRAVEL)), self._profile.max_looks)
        touches: Sequence[Touch] = ()
        for part in range(parts):
            self._push_limit.brace()
            if self.hands.held:
                self.hands.steer(self._drive.foreseen((part + 1) * seconds / parts), seconds / parts)
            met = self.world.step(seconds / parts)
            self._push_limit.bound(met, seconds / parts)
            touches = met or touches
        return touches

    def _contacts(self, frame: int, touches: Iterable[Touch]) -> list[Contact]:
        """One contact for each pair of link and object: the deepest of the frame."""
        deepest: dict[tuple[int, int], Touch] = {}
        for touch in touches:
            key = touch.joint, touch.object_id
            if touch.distance <= TOUCHING and (key not in deepest or touch.distance < deepest[key].distance):
                deepest[key] = touch
        return [self._contact(frame, deepest[key]) for key in sorted(deepest)]

    def _contact(self, frame: int, touch: Touch) -> Contact:
        joint = JOINTS[touch.joint]
        return Contact(
            (frame,), joint, LINK_OF[joint].group, touch.object_id, self._scene.by_id[touch.object_id].movable,
            depth=max(0.0, -touch.distance), height=touch.point[1],
        )  # fmt: skip

    def _touches(self, frame: int) -> list[tuple[int, int, int]]:
        if self._objects is not self._still:  # While none moves, each touches what it touched before.
            self._still = self._objects
            self._pairs = sorted(pair for pair in self.world.touching() if not set(pair) & self._building)
        return [(frame, *pair) for pair in self._pairs]


def _moved(began: Mapping[int, Array], paths: list[Mapping[int, Array]]) -> Mapping[int, Array]:
    """(frames, 7) path of each object that strayed from where it began."""
    found = dict[int, Array]()
    if all(states is began for states in paths):
        return found
    for key, first in began.items():
        path = np.stack([states[key] for states in paths])
        if np.abs(path[:, :3] - first[:3]).max() > MOVED or _turned(path[:, 3:], first[3:]):
            found[key] = path
    return found


def _turned(path: Array, first: Array) -> bool:
    """Whether a path of quaternions leaves the first one by more than about half a degree."""
    return bool((np.abs(path @ first) < 1 - 1e-5).any())
