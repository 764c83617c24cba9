"""Bound the force of the body's pushes, so that mass counts.

A body that is driven by velocities would push a crate of a tonne as easily as a cup. So the momentum that a step gives
to movable objects is bounded by the force of a person, less the friction of the objects. If a step gave more, the
objects keep only their share of it, and the body is moved back as far as they are: it waits at a heavy object as at a
wall. An object whose friction exceeds that force stays, and objects on it or beside it are pushed as if it were fixed.
An object on a hinge has leverage: a push near the hinge needs more force.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from humanclaw.body.pose import Array
from humanclaw.world.half_physics.profile import Profile
from humanclaw.world.half_physics.quaternions import from_vector, multiply
from humanclaw.world.half_physics.swing import swings
from humanclaw.world.half_physics.world import ObjectMotion, Touch, World
from humanclaw.world.scene import Scene

GROUND_FRICTION: Final = 0.5
"""Friction of a scene's floors."""
_RISING: Final = np.array([-np.inf, 0.0, -np.inf])
_LEAST_LEVER: Final = 0.02
"""A push that passes the hinge nearer than this turns nothing, metres."""


class Exertion:
    """Bounds the pushes of one body in one world."""

    def __init__(self, world: World, profile: Profile, scene: Scene) -> None:
        self._world, self._profile = world, profile
        moving = {obj.id: obj for obj in scene.objects if obj.movable and scene.assets[obj.asset].hulls}
        self.movable = frozenset(moving)
        self._mass = {key: obj.mass for key, obj in moving.items()}
        self._held = {key: GROUND_FRICTION * obj.friction * obj.mass * profile.gravity for key, obj in moving.items()}
        self._radius = {key: _gyration(scene, key) for key in moving}
        self._swings, self._levers = swings(scene), dict[int, float]()
        self._near: tuple[int, ...] = ()
        self._before: Mapping[int, ObjectMotion] = {}

    def look(self, near: tuple[int, ...]) -> None:
        """Remember the objects that can be pushed in the coming frame."""
        self._near = near

    def brace(self) -> None:
        """Remember how everything near moves, before a step."""
        self._before = {key: self._world.motion(key) for key in self._near}

    def bound(self, touches: Sequence[Touch], seconds: float) -> None:
        """Remove the momentum that the step since brace gave to objects beyond the force of a person."""
        pushed = {touch.object_id for touch in touches if touch.object_id in self._before}
        after = {key: self._world.motion(key) for key in self._before} if pushed else {}
        self._levers = {key: self._lever(key, touches, after[key]) for key in after if key in self._swings}
        gains = {key: self._gain(key, motion) for key, motion in after.items()}
        if not any(gain > 0 for gain in gains.values()):
            return
        # A light thing between the body and a heavy one hands its push on and gets no faster itself.
        chain = self._handed_on(pushed)
        shares = self._shares({key: gains[key] for key in chain}, seconds)
        kept = {
            key: _shared(self._before[key], after[key], share, seconds) for key, share in shares.items() if share < 1
        }
        self._hold(kept, after, touches, seconds)

    def _shares(self, gains: Mapping[int, float], seconds: float) -> Mapping[int, float]:
        """Return the share of its gain that each faster object may keep.

        An object that needs more force than a person has stays, like a fixed one; the others share the force that
        friction leaves. If the staying objects got most of a push, the others handed it on to them, and none keeps
        anything.
        """
        most, held = self._profile.exertion, {key: self._holding(key) for key in gains}
        moved = [key for key in gains if held[key] < most]
        gain = sum(gains[key] for key in moved)
        left = 0.0 if sum(gains.values()) > 2 * gain else max(0.0, most - sum(held[key] for key in moved))
        share = left * seconds / max(gain, 1e-12)
        return {key: share if key in moved else 0.0 for key in gains if gains[key] > 0}

    def _gain(self, key: int, after: ObjectMotion) -> float:
        """Return the momentum that made an object faster, kg m/s; the body does not slow objects down."""
        before, radius = self._before[key], self._radius[key]
        if key in self._swings:
            faster = abs(after.spin[1]) - abs(before.spin[1])
            return self._swings[key].inertia * max(0.0, float(faster)) / self._levers[key]
        faster = _speed(after, radius) > _speed(before, radius)
        gain = math.hypot(*(_no_fall(after) - _no_fall(before)), *(radius * (after.spin - before.spin)))
        return self._mass[key] * gain if faster else 0.0

    def _holding(self, key: int) -> float:
        """Force that friction takes from a push, and a hinge's damping from one as fast as before, newtons."""
        if key not in self._swings:
            return self._held[key]
        joint, spin = self._swings[key].joint, abs(float(self._before[key].spin[1]))
        return (joint.friction + joint.damping * spin) / self._levers[key]

    def _lever(self, key: int, touches: Sequence[Touch], after: ObjectMotion) -> float:
        """Return the longest arm that the body has on a hinged object, metres; its centre's where something else pushes
        it."""
        axis = self._swings[key].axis
        arms = [_arm(np.array(touch.point) - axis, touch.normal) for touch in touches if touch.object_id == key]
        return max(_LEAST_LEVER, max(arms, default=float(np.linalg.norm((after.position - axis)[[0, 2]]))))

    def _handed_on(self, pushed: set[int]) -> Sequence[int]:
        """Return the pushed objects, and those that they push."""
        near, chain = set(self._before), set(pushed)
        links = [pair for pair in self._world.touching() if set(pair) <= near] if near - chain else []
        while more := {key for pair in links if chain & set(pair) for key in pair} - chain:
            chain |= more
        return sorted(chain)

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


def _arm(point: Array, normal: Sequence[float]) -> float:
    """How far from a vertical axis through the origin a push passes, metres."""
    return abs(float(point[2] * normal[0] - point[0] * normal[2]))


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
    turned = multiply(from_vector((spin - after.spin) * seconds), after.quaternion)
    moved = after.position + (velocity - after.velocity) * seconds
    return replace(after, position=moved, quaternion=turned, velocity=velocity, spin=spin)


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
