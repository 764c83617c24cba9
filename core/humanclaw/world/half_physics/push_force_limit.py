"""Bound the force of the body's pushes, so that mass counts.

A body that is driven by velocities would push a crate of a tonne as easily as a cup. So the momentum that a step gives
to movable objects is bounded by the force of a person, less what resists: friction, and whatever took the rest of the
push, such as a load on top or a wall behind. If a step gave more, the objects keep only their share of it, and the body
is moved back as far as they are: it waits at a heavy object as at a wall. An object that resists with more than that
force stays, and objects on it or beside it are pushed as if it were fixed. An object on a joint has leverage: a push
near a hinge needs more force. Nothing that the body touches rises, for feet push and do not lift.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from humanclaw.body.pose import Array, matrix_from_quaternion
from humanclaw.world.half_physics.articulated_object import articulated_objects
from humanclaw.world.half_physics.profile import Profile
from humanclaw.world.half_physics.quaternions import from_vector, multiply
from humanclaw.world.half_physics.world import ObjectMotion, Touch, World
from humanclaw.world.scene import Scene

GROUND_FRICTION: Final = 0.5
"""Friction of a scene's floors."""
_RISING: Final = np.array([-np.inf, 0.0, -np.inf])
_LEAST_LEVER: Final = 0.02
"""A push that passes the hinge nearer than this turns nothing, metres; one that is this oblique moves no slide."""


@dataclass(frozen=True)
class _Group:
    """Objects that touch one another, pushed by the body in one step."""

    faster: Collection[int]
    """Those that the step made faster."""
    free: Collection[int]
    """Those of them that a person can push."""
    gain: float
    """Impulse that it took to make the free ones faster, kg m/s."""
    held: float
    """Force that it takes to overcome their friction, newtons.

    Both are as many times larger as the body pushed harder than gain and friction account for: a chair that is jammed
    against a wall takes most of a push, however hard."""


class PushForceLimit:
    """Bounds the pushes of one body in one world."""

    def __init__(self, world: World, profile: Profile, scene: Scene) -> None:
        self._world, self._profile, self._scene = world, profile, scene
        moving = {obj.id: obj for obj in scene.objects if obj.movable and scene.assets[obj.asset].hulls}
        self.movable = frozenset(moving)
        self._mass = {key: obj.mass for key, obj in moving.items()}
        self._held = {key: GROUND_FRICTION * obj.friction * obj.mass * profile.gravity for key, obj in moving.items()}
        self._radius = {key: _gyration(scene, key) for key in moving}
        self._articulated, self._levers = articulated_objects(scene), dict[int, float]()
        self._near: tuple[int, ...] = ()
        self._before: Mapping[int, ObjectMotion] = {}
        self.burden = 0.0
        """Force that the body needs for what it carries, newtons."""

    @property
    def _most(self) -> float:
        """Force that is left for a push, newtons."""
        return max(0.0, self._profile.push_force - self.burden)

    def look(self, near: tuple[int, ...]) -> None:
        """Remember the objects that can be pushed in the coming frame."""
        self._near = near

    def brace(self) -> None:
        """Remember how everything near moves, before a step."""
        self._before = {key: self._world.motion(key) for key in self._near}

    def bound(self, touches: Sequence[Touch], seconds: float) -> None:
        """Remove the momentum that the step since brace gave to objects beyond the force of a person."""
        pushes = [touch for touch in touches if touch.object_id in self._before]
        pushed = {touch.object_id for touch in pushes}
        self._tame(pushed, seconds)  # Also without a touch: what a limb threw off in the step has left it since.
        if sum(touch.force for touch in pushes) <= self._most:
            return
        after = {key: self._world.motion(key) for key in self._before}
        self._levers = {key: self._lever(key, touches, after[key]) for key in after if key in self._articulated}
        gains = {key: self._gain(key, motion, seconds) for key, motion in after.items()}
        if not any(gain > 0 for gain in gains.values()):
            return
        groups = [self._group(keys, gains, pushes, seconds) for keys in _connected(pushed, self._touching())]
        self._hold(self._kept(groups, after, seconds), after, touches, seconds)

    def _tame(self, pushed: Collection[int], seconds: float) -> None:
        """Take back what the step since brace should not have done to objects: feet push, they do not lift, and nobody
        kicks faster than max_kick."""
        for key in self._before.keys() - self._articulated.keys():
            before, after, radius = self._before[key], self._world.motion(key), self._radius[key]
            most = max(self._profile.max_kick, _speed(before, radius) + self._profile.gravity * seconds)
            slower = min(1.0, most / max(_speed(after, radius), 1e-12))
            velocity = slower * after.velocity
            velocity[1] = min(velocity[1], after.velocity[1])
            if key in pushed:
                velocity[1] = min(velocity[1], max(before.velocity[1], 0.0))
            if slower < 1 or velocity[1] < after.velocity[1]:
                self._world.set_motion(key, _moving(after, velocity, slower * after.spin, seconds))

    def _group(
        self, keys: Collection[int], gains: Mapping[int, float], pushes: Sequence[Touch], seconds: float
    ) -> _Group:
        """Measure objects that touch one another. If those that friction holds got most of a push, the others handed it
        on to them, and none moves."""
        faster = [key for key in keys if gains[key] > 0]
        free = [key for key in keys if self._holding(key) < self._most]
        gain = sum(gains[key] for key in free)
        if sum(gains[key] for key in keys) > 2 * gain:
            return _Group(faster, free, gain, np.inf)
        loads = [key for key in keys if key not in free and any(self._rests(key, other) for other in free)]
        held, push = sum(map(self._holding, [*free, *loads])), sum(self._push(key, pushes) for key in free)
        wasted = max(1.0, push / max(gain / seconds + held, 1e-9))
        return _Group(faster, free, wasted * gain, wasted * held)

    def _rests(self, key: int, other: int) -> bool:
        """Return whether an object in a group lies on another: its lowest point is above the other's middle."""
        place = self._world.objects()[key]
        points = np.concatenate(self._scene.assets[self._scene.by_id[key].asset].hulls)
        lowest = place[1] + (points @ matrix_from_quaternion(place[3:])[1]).min()
        return bool(lowest > self._before[other].position[1])

    def _kept(
        self, groups: Sequence[_Group], after: Mapping[int, ObjectMotion], seconds: float
    ) -> Mapping[int, ObjectMotion]:
        """Return the motion that the faster objects keep, where it is another.

        Objects that take more force than a person has get no faster, and what holds them brakes them; the others share
        the force that is left.
        """
        most = self._most
        moved = [group for group in groups if group.held < most]
        left = max(0.0, most - sum(group.held for group in moved))
        share = left * seconds / max(sum(group.gain for group in moved), 1e-12)
        kept = dict[int, ObjectMotion]()
        for group in groups:
            for key in group.faster:
                held = group.held if key in group.free else self._holding(key)
                if held >= most:
                    braked = self._braked(key, (held - most) * seconds)
                    kept[key] = _shared(braked, after[key], 0.0, seconds)
                elif share < 1:
                    kept[key] = _shared(self._before[key], after[key], share, seconds)
        return kept

    def _braked(self, key: int, lost: float) -> ObjectMotion:
        """Return how an object moved before the step, without so much of its momentum, kg m/s."""
        before = self._before[key]
        momentum = self._mass[key] * _speed(before, self._radius[key])
        if key in self._articulated:
            momentum = self._articulated[key].inertia * abs(self._articulated[key].state(before)[1]) / self._levers[key]
        share = max(0.0, 1 - lost / max(momentum, 1e-12))
        return replace(before, velocity=share * before.velocity, spin=share * before.spin)

    def _gain(self, key: int, after: ObjectMotion, seconds: float) -> float:
        """Return the momentum that made an object faster, kg m/s; the body does not slow objects down."""
        before, radius = self._before[key], self._radius[key]
        if key in self._articulated:
            (_, slow), (_, fast) = map(self._articulated[key].state, (before, after))
            fallen = math.copysign(1.0, fast) * self._weight(key, after) * seconds
            return (
                max(0.0, self._articulated[key].inertia * (abs(fast) - abs(slow)) - max(0.0, fallen))
                / self._levers[key]
            )
        faster = _speed(after, radius) > _speed(before, radius)
        gain = math.hypot(*(_no_fall(after) - _no_fall(before)), *(radius * (after.spin - before.spin)))
        return self._mass[key] * gain if faster else 0.0

    def _weight(self, key: int, after: ObjectMotion) -> float:
        """Return what gravity does to an object on a joint, along the joint, newton metres or newtons."""
        return -self._mass[key] * self._profile.gravity * float(self._articulated[key].arm(after.position)[1])

    def _push(self, key: int, pushes: Sequence[Touch]) -> float:
        """Return the force with which the body pushes an object, newtons. Its weight is no push."""
        met = [touch for touch in pushes if touch.object_id == key]
        if key in self._articulated:
            return abs(sum(touch.force * self._effect(touch) for touch in met)) / self._levers[key]
        x, y, z = (np.array([touch.normal for touch in met]).T @ [touch.force for touch in met]) if met else np.zeros(3)
        return math.hypot(x, min(y, 0.0), z)

    def _effect(self, touch: Touch) -> float:
        """Return what each newton of a push does along the joint of the object, newton metres or newtons."""
        return float(self._articulated[touch.object_id].arm(np.array(touch.point)) @ touch.normal)

    def _lever(self, key: int, touches: Sequence[Touch], after: ObjectMotion) -> float:
        """Return the largest effect that the body has on an object on a joint; at its centre where something else
        pushes it."""
        effects = [abs(self._effect(touch)) for touch in touches if touch.object_id == key]
        middle = float(np.linalg.norm(self._articulated[key].arm(after.position)))
        return max(_LEAST_LEVER, max(effects, default=middle))

    def _touching(self) -> Collection[tuple[int, int]]:
        """Return the pairs of objects near the body that touch each other."""
        near = self._before.keys()
        return [pair for pair in self._world.touching() if near >= set(pair)] if len(near) > 1 else ()

    def _holding(self, key: int) -> float:
        """Force that friction takes from a push, and a joint's damping from one as fast as before, newtons."""
        if key not in self._articulated:
            return self._held[key]
        joint, (_, speed) = self._articulated[key].joint, self._articulated[key].state(self._before[key])
        return (joint.friction + joint.damping * abs(speed)) / self._levers[key]

    def _hold(
        self,
        kept: Mapping[int, ObjectMotion],
        after: Mapping[int, ObjectMotion],
        touches: Sequence[Touch],
        seconds: float,
    ) -> None:
        """Set the objects to the motion that they keep, and move the body back as far as the objects that it pushes."""
        back = np.zeros(3)
        for key, motion in kept.items():
            self._world.set_motion(key, motion)
            met = [touch for touch in touches if touch.object_id == key]
            back = _longer(back, _lost(after[key], motion, met or _at_middle(touches, after[key]), seconds))
        if back.any():
            pose, (velocity, spin) = self._world.pose(), self._world.velocity()
            self._world.move(pose.root - back, pose.quaternions[0], velocity, spin)


def _connected(pushed: Collection[int], touching: Collection[tuple[int, int]]) -> Iterator[Collection[int]]:
    """Yield the pushed objects, each together with those that it touches, directly or through others."""
    left = set(pushed)
    while left:
        group = {min(left)}
        while more := {key for pair in touching if group & set(pair) for key in pair} - group:
            group |= more
        yield sorted(group)
        left -= group


def _no_fall(motion: ObjectMotion) -> Array:
    """(3,) velocity without what gravity does to it."""
    return np.asarray(np.maximum(motion.velocity, _RISING))


def _speed(motion: ObjectMotion, radius: float) -> float:
    return math.hypot(*_no_fall(motion), *(radius * motion.spin))


def _shared(before: ObjectMotion, after: ObjectMotion, share: float, seconds: float) -> ObjectMotion:
    """Return the motion with that share of the step's change. A fall is not a push and stays whole, and so does a
    landing: an object that kept falling into the floor would be thrown out of it later."""
    velocity = before.velocity + share * (after.velocity - before.velocity)
    velocity[1] = np.clip(velocity[1], min(after.velocity[1], 0.0), after.velocity[1])
    spin = before.spin + share * (after.spin - before.spin)
    return _moving(after, velocity, spin, seconds)


def _moving(after: ObjectMotion, velocity: Array, spin: Array, seconds: float) -> ObjectMotion:
    """Return the motion of an object that moved otherwise in a step."""
    turned = multiply(from_vector((spin - after.spin) * seconds), after.quaternion)
    moved = after.position + (velocity - after.velocity) * seconds
    return ObjectMotion(moved, turned, velocity, spin)


def _at_middle(touches: Sequence[Touch], after: ObjectMotion) -> Sequence[Touch]:
    """Return the touches as seen by an object that they were handed on to: same directions, at its centre."""
    x, y, z = after.position
    return [touch._replace(point=(float(x), float(y), float(z))) for touch in touches]


def _lost(after: ObjectMotion, kept: ObjectMotion, touches: Sequence[Touch], seconds: float) -> Array:
    """(3,) how much less far, on the level and along the push, the touched part of an object has come."""
    arms = np.array([touch.point for touch in touches]) - after.position
    ways = (after.velocity - kept.velocity + np.cross(after.spin - kept.spin, arms)) * seconds
    pushes = np.array([touch.normal for touch in touches]) * [-1.0, 0.0, -1.0]
    along = np.maximum((ways * pushes).sum(axis=1), 0.0) / np.maximum((pushes**2).sum(axis=1), 1e-9)
    lost = along[:, None] * pushes
    return np.asarray(lost[(lost**2).sum(axis=1).argmax()])


def _longer(a: Array, b: Array) -> Array:
    return b if b @ b > a @ a else a


def _gyration(scene: Scene, key: int) -> float:
    """Radius of gyration of an object, taken for a solid box, metres."""
    hulls = scene.assets[scene.by_id[key].asset].hulls
    points = np.concatenate(hulls)
    return float(np.linalg.norm(np.ptp(points, axis=0)) / np.sqrt(12))
