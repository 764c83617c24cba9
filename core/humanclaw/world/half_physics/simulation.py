"""Bodies that move in one world: frames of physics, and what they touched and moved in them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from itertools import combinations
from typing import Final

import numpy as np

from humanclaw.body.pose import FPS, Array, Motion
from humanclaw.body.skeleton import JOINTS
from humanclaw.errors import HumanclawError
from humanclaw.world.half_physics.broad_phase import BroadPhase
from humanclaw.world.half_physics.driven_body import Command, DrivenBody
from humanclaw.world.half_physics.profile import Profile
from humanclaw.world.half_physics.quaternions import Pose, motion_of, poses_of
from humanclaw.world.half_physics.skeleton import LINK_OF
from humanclaw.world.half_physics.world import LEVEL, TOUCHING, TRAVEL, Touch, World
from humanclaw.world.scene import STRUCTURE
from humanclaw.world.simulator import Contact, Execution, WorldState, person_id

MOVED: Final = 0.001
"""An object whose path strays less than this from its beginning has not moved, metres."""
_LEVEL: Final = np.array([1.0, 0.0, 1.0])
"""Leaves out the height: the vertical motion of the root is never commanded."""

Met = Sequence[Sequence[Touch]]
"""The contacts of each body."""


class Simulation:
    """One body or several in one world, from their starts on."""

    def __init__(
        self, worlds: Sequence[World], profile: Profile, broad_phase: BroadPhase, poses: Sequence[Pose]
    ) -> None:
        """Take a world, as each body has it, with each in its pose, and the broad phase of its scene."""
        self.world, self._profile, self._broad_phase = worlds[0], profile, broad_phase
        self._scene = scene = broad_phase.scene
        self._building = {scene_object.id for scene_object in scene.objects if scene_object.category in STRUCTURE}
        self.bodies = [DrivenBody(*pair, profile, scene) for pair in zip(worlds, poses, strict=True)]
        self._movable = {scene_object.id for scene_object in scene.objects if scene_object.movable}
        self._objects, self._restless = self.world.objects(), True
        self._still: Mapping[int, Array] | None = None
        """Where the movable objects were when `_pairs` were found."""
        self._pairs: list[tuple[int, int]] = []

    def execute(self, motions: Sequence[Motion]) -> tuple[Execution, ...]:
        """Drive each body through the frames of its finite motion, world frame.

        Raises HumanclawError for another number of motions than of bodies, or motions of different lengths.
        """
        lengths = [len(motion) for motion in motions]
        if len(motions) != len(self.bodies) or len(set(lengths)) > 1:
            raise HumanclawError(
                f"the world holds {len(self.bodies)} bodies, and they move together; got motions of {lengths} frames.",
                "Give each body a motion, all of one length.",
            )
        began, touches, paths = self._objects, list[tuple[int, int, int]](), list[Mapping[int, Array]]()
        simulated: list[list[Pose]] = [[] for _ in motions]
        contacts: list[list[Contact]] = [[] for _ in motions]
        commands = [self._commands(*pair) for pair in zip(self.bodies, motions, strict=True)]
        for frame, now in enumerate(zip(*commands, strict=True)):
            for number, met in enumerate(self.frame(now)):
                simulated[number].append(self.bodies[number].drive.pose)
                contacts[number] += self._contacts(frame, met)
            touches += self._touches(frame)
            paths.append(self._objects)
        moved, ways = _moved(began, paths), [motion_of(poses) for poses in simulated]
        return tuple(
            Execution(way, tuple(met), tuple(touches), moved, body.hands.held, people=others_of(number, ways))
            for number, (way, met, body) in enumerate(zip(ways, contacts, self.bodies, strict=True))
        )

    @staticmethod
    def _commands(body: DrivenBody, motion: Motion) -> list[Command]:
        body.hands.tidy()
        roots = np.concatenate([body.drive.pose.root[None], motion.root])
        swings = body.drive.swings(motion).tolist()
        return list(map(Command, poses_of(motion), np.diff(roots, axis=0) * FPS, swings))

    def states(self) -> tuple[WorldState, ...]:
        """Return the pose of each body and of every movable object, now."""
        poses = [motion_of([body.world.pose()]) for body in self.bodies]
        return tuple(
            WorldState(pose, self._objects, body.hands.held, people=others_of(number, poses))
            for number, (pose, body) in enumerate(zip(poses, self.bodies, strict=True))
        )

    def overlaps(self) -> list[list[Contact]]:
        """Return what each body is inside of, now."""
        return [self._contacts(0, met) for met in self._each(self.world.overlaps())]

    def frame(self, commands: Sequence[Command]) -> Met:
        """One frame of physics; everything that each body touched in any of its substeps."""
        met: list[list[Touch]] = [[] for _ in self.bodies]
        held = [key for body in self.bodies for key in body.hands.held.values()]
        courses = [body.aim(command) for body, command in zip(self.bodies, commands, strict=True)]
        for body, course in zip(self.bodies, courses, strict=True):
            body.look(self._broad_phase, course, self._objects, held)
        between = self._broad_phase.between(courses) if len(courses) > 1 else 0.0
        for substep in range(self._profile.substeps):
            speeds = [body.command(substep) for body in self.bodies]
            # A late limb is no hurry here: without CATCH_UP links of two bodies enter one another by 7 mm at most.
            together = min(sum(free for free, _ in speeds), between * FPS)
            touches = self._step(max(together, *(towards for _, towards in speeds)))
            for body, own, all_own in zip(self.bodies, touches, met, strict=True):
                body.settle(own)
                all_own += own
        for body in self.bodies:
            if body.hands.held:
                body.hands.let_slip(body.drive.pose)
        if held or self._restless or any(body.near for body in self.bodies):
            # Else nothing moves, and to read every place takes long.
            before, self._objects = self._objects, self.world.objects()
            self._restless = self._objects is not before
        return met

    def _step(self, speed: float) -> Met:
        """One physics step, in so many parts that no link comes far towards anything between two looks for contacts;
        the contacts of each body.

        In one part a kick ends 10 cm inside a wall, and a fast enough one behind it. A foot may touch a wall in an
        early part and have left it in the last one: the contacts are those of the last part that had any.
        """
        seconds = 1 / (FPS * self._profile.substeps)
        parts = min(max(1, math.ceil(speed * seconds / TRAVEL)), self._profile.max_looks)
        touches: list[Sequence[Touch]] = [()] * len(self.bodies)
        felt: list[list[Touch]] = [[] for _ in self.bodies]
        several = len(felt) > 1
        for part in range(parts):
            for body in self.bodies:
                body.brace((part + 1) * seconds / parts, seconds / parts)
            for number, met in enumerate(self._each(self.world.step(seconds / parts))):
                self.bodies[number].bound(met, seconds / parts)
                touches[number] = met or touches[number]
                if several:
                    felt[number] += met
        if several:
            self._stand_firm(felt)
        return touches

    def _each(self, touches: Sequence[Touch]) -> Met:
        """Return the contacts of each body."""
        if len(self.bodies) == 1:
            return [touches]
        return [[touch for touch in touches if touch.body == number] for number in range(len(self.bodies))]

    def _stand_firm(self, felt: Met) -> None:
        """Move bodies that met back together, as far as one has pushed the other in the step: both are as strong, and
        are blocked. Whoever comes along is followed no faster than they walk; nobody goes back into a wall.

        felt: the contacts of each body in all parts of the step.
        """
        for first, other in combinations(range(len(self.bodies)), 2):
            met = [touch for touch in felt[first] if touch.object_id == person_id(other) and touch.force > 0.0]
            if not met:
                continue
            push = np.array([touch.normal for touch in met]).T @ [touch.force for touch in met] * _LEVEL
            way = push / max(float(np.linalg.norm(push)), 1e-12)
            # To read a pose takes long: once for both calls.
            poses = {body.drive: body.world.pose() for body in (self.bodies[first], self.bodies[other])}
            back = -sum(drive.pushed(pose, way) for drive, pose in poses.items()) / (FPS * self._profile.substeps) * way
            if not any(_holds(touch, back) for touch in (*felt[first], *felt[other])):
                for drive, pose in poses.items():
                    drive.shift(pose, back)

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
            (frame,), joint, LINK_OF[joint].group, touch.object_id, touch.object_id in self._movable,
            depth=max(0.0, -touch.distance), height=touch.point[1],
        )  # fmt: skip

    def _touches(self, frame: int) -> list[tuple[int, int, int]]:
        if self._objects is not self._still:  # While none moves, each touches what it touched before.
            self._still = self._objects
            self._pairs = sorted(pair for pair in self.world.touching() if not set(pair) & self._building)
        return [(frame, *pair) for pair in self._pairs]


def _holds(touch: Touch, way: Array) -> bool:
    """Tell whether a contact with an object stands in the way (3,) of a body."""
    return touch.object_id > 0 and abs(touch.normal[1]) < LEVEL and float(way @ touch.normal) < 0.0


def others_of(number: int, poses: Sequence[Motion]) -> Mapping[int, Motion]:
    """Return the motions of all bodies but one, by `person_id`."""
    return {person_id(other): pose for other, pose in enumerate(poses) if other != number}


def _moved(began: Mapping[int, Array], paths: list[Mapping[int, Array]]) -> Mapping[int, Array]:
    """(frames, 7) path of each object that strayed from where it began."""
    moved = dict[int, Array]()
    if all(states is began for states in paths):
        return moved
    for key, first in began.items():
        path = np.stack([states[key] for states in paths])
        if np.abs(path[:, :3] - first[:3]).max() > MOVED or _turned(path[:, 3:], first[3:]):
            moved[key] = path
    return moved


def _turned(path: Array, first: Array) -> bool:
    """Whether a path of quaternions leaves the first one by more than about half a degree."""
    return bool((np.abs(path @ first) < 1 - 1e-5).any())  # Cosine of half the angle.
