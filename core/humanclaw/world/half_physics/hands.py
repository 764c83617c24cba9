"""The hands: a grasp is a force of bounded size that carries a thing along with a palm.

Before each physics step a held thing gets the velocity that keeps its place in the hand, as far as the force of an arm
allows. Then the engine solves its contacts with everything else. So a held thing collides, can be knocked out of the
hand, and falls at g once it is released. A thing on a joint has one way to go: it follows the hand along its joint, and
the arm follows the handle. What stays behind by more than a palm's reach slips out of the hand.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from typing import Final, TypeAlias

import numpy as np

from humanclaw.body.ik import SIDES, Limb, bent
from humanclaw.body.pose import (
    FPS,
    Array,
    forward_kinematics,
    matrix_from_quaternion,
    quaternion_from_matrix,
    smoothstep,
    vector_from_quaternion,
)
from humanclaw.body.skeleton import JOINT_INDEX, OFFSETS, Side
from humanclaw.world.half_physics.articulated_object import ArticulatedObject, articulated_objects
from humanclaw.world.half_physics.profile import Profile
from humanclaw.world.half_physics.quaternions import Pose, blend, conjugate, motion_of, multiply
from humanclaw.world.half_physics.solids import nearest_point
from humanclaw.world.half_physics.world import ObjectMotion, World
from humanclaw.world.scene import Scene

PALM: Final = 0.06
"""A hand closes on what is this near to palm or fingers, and loses what stays this far behind, metres."""
_ALONG: Final = (-0.035, 0.0, 0.035, 0.07)
"""Metres from the knuckles, along the hand, of the points that find what is near: the palm's middle to the fingers'."""
_BACK: Final = 0.02
"""From the middle of a hand to its surface, metres; a held thing is drawn to it."""
_CLOSING: Final = 0.4
"""Seconds in which it is."""
_CATCHES_UP: Final = 0.3
"""Share of a gap that a hand closes in a step; no faster than its force can brake on half the way."""
_LEARNS: Final = 0.3
"""Share of what a load took of a step's velocity that a hand adds to the next."""
_FAST: Final = 4.0
"""Speed of a held thing at most, m/s: hands move at 2, and a body carries them."""
_SHOCK: Final = 60.0
"""Acceleration that a hand gives at most, m/s^2: a faster start would take a thing through a wall."""
_WRIST: Final = 15.0
"""Torque of a hand, newton metres."""
_FALL: Final = 4
"""Chunks in which what left a hand comes to rest: a cup that falls 1.1 m goes 3.9 cm in a step, and into the floor if
contacts are looked for less often."""
_PULL: Final = 250.0
"""Force of a hand on a thing on a joint, newtons: a standing adult pulls with more than an arm lifts. The lids of ovens
take up to 180: their friction bears their weight."""
_LEAD: Final = 0.04
"""Metres that a hand goes ahead of a handle that does not follow."""
_BETWEEN: Final = np.linspace(0.1, 0.9, 9)[:, None]
"""Shares of the way from a hand to a spot at which something fixed may be in between."""
_TOUCH: Final = 1e-3
"""Metres from which a point counts as outside a hull."""
_RETURN: Final = 12
"""Frames in which an arm that has let go of a handle comes back to where it is told to be."""


@dataclass(frozen=True, eq=False)
class _Hold:
    """A thing in a hand. The frame of a hand: at the knuckles, along the palm."""

    object_id: int
    place: Array
    """(3,) the thing's centre of mass in the frame of the hand; of a thing on a joint the spot that is held."""
    turn: Array
    """(4,) the thing's turn in the frame of the hand."""
    shift: Array
    """(3,) the way to the hand, in the frame of the hand."""
    spot: Array
    """(3,) what is held, in the frame of the thing's asset."""
    age: float = 0.0
    """Seconds since the hand closed."""

    @property
    def now(self) -> Array:
        """The place that the thing is to have in the hand now."""
        return np.asarray(self.place + smoothstep(np.array(self.age / _CLOSING)) * self.shift)


Palms: TypeAlias = Mapping[Side, tuple[Array, Array]]
"""Knuckles (3,) and turn of the palm (3, 3), whose -Y faces what is grasped, by side."""


class Hands:
    """The hands of one body in one world."""

    def __init__(self, world: World, profile: Profile, scene: Scene) -> None:
        self._world, self._profile, self._scene = world, profile, scene
        self._holds: dict[Side, _Hold] = {}
        self._passing: set[tuple[Side, int]] = set()
        """Sides and things that do not push each other."""
        self._carried: dict[int, tuple[Array, Array, Array]] = {}
        """Of each free held thing: where it was due, the velocity that it was given, and what contact takes of that."""
        self._fastest = 0.0
        self._falling: dict[int, int] = {}
        """Free things that left a hand, and for how many more chunks they may fall."""
        self._returning: dict[Side, tuple[int, Array]] = {}
        """Of each arm that let go of a handle: frames since then, and the turns (24, 4) of the body there."""

    @cached_property
    def _articulated(self) -> Mapping[int, ArticulatedObject]:
        return articulated_objects(self._scene)

    @cached_property
    def _sizes(self) -> Mapping[int, float]:
        """Distance of the farthest point of each movable object from the origin of its asset, metres."""
        hulls = {obj.id: self._scene.assets[obj.asset].hulls for obj in self._scene.objects if obj.movable}
        return {key: float(np.linalg.norm(np.concatenate(own), axis=1).max()) for key, own in hulls.items() if own}

    @cached_property
    def _fixed(self) -> Sequence[int]:
        return [obj.id for obj in self._scene.objects if not obj.movable]

    @property
    def speed(self) -> float:
        """Bound of the speed of the fastest point in the coming step of what is held or falls from a hand, m/s."""
        falling = [(self._world.motion(key), self._sizes[key]) for key in self._falling]
        speeds = (float(np.linalg.norm(move.velocity) + size * np.linalg.norm(move.spin)) for move, size in falling)
        return max(self._fastest + _SHOCK / FPS if self._holds else 0.0, *speeds, 0.0)

    @property
    def held(self) -> Mapping[Side, int]:
        """Id of the object that each hand holds, by side."""
        return {side: hold.object_id for side, hold in sorted(self._holds.items())}

    @property
    def weight(self) -> float:
        """Weight of what is held, newtons; a thing on a joint hangs on it."""
        free = {key for key in self.held.values() if key not in self._articulated}
        return sum(self._scene.by_id[key].mass for key in free) * self._profile.gravity

    def grip(self, side: Side, closed: bool) -> None:
        """Open a hand, or close it on the nearest thing before its palm; on nothing if there is none."""
        if not closed:
            self._let_go(side)
        elif side not in self._holds:
            open_to = (thing for thing in self._before(side, self._world.objects()) if not self._walled(*thing[2:]))
            nearest = min(open_to, key=lambda thing: thing[0], default=None)
            if nearest is not None:
                self._holds[side] = self._closed(side, *nearest[1:])
                self._let_pass({*self._passing, (side, nearest[1])})

    def tidy(self) -> None:
        """Let hands that have left what they held meet it again. Called before each chunk."""
        self._falling = {key: rest - 1 for key, rest in self._falling.items() if rest > 1}
        if self._passing:
            objects = self._world.objects()
            self._let_pass({
                (side, key) for side, key in self._passing
                if self.held.get(side) == key or any(self._before(side, {key: objects[key]}, np.inf))
            })  # fmt: skip

    def _let_pass(self, pairs: set[tuple[Side, int]]) -> None:
        """Let arms and things that touch because one holds the other not push each other."""
        if pairs != self._passing:
            self._passing = pairs
            arms = [(JOINT_INDEX[f"{side}_{part}"], key) for side, key in pairs for part in ("elbow", "wrist", "hand")]
            self._world.let_pass(frozenset(arms))

    def steer(self, pose: Pose, seconds: float) -> None:
        """Carry what is held through the coming step, at whose end the body is in a pose."""
        self._fastest = 0.0
        places = _palms(pose)
        for key in dict.fromkeys(self.held.values()):
            sides = [side for side, hold in self._holds.items() if hold.object_id == key]
            if key in self._articulated:
                self._swing(key, sides, places, seconds)
            else:
                self._carry(key, sides, places, seconds)
        self._carried = {key: state for key, state in self._carried.items() if key in self.held.values()}
        self._holds = {side: replace(hold, age=hold.age + seconds) for side, hold in self._holds.items()}

    def guided(self, target: Pose, velocity: Array) -> Pose:
        """Return a pose that is due at the end of a frame with each hand on the way of the handle that it holds, or on
        the way back from one."""
        for side, (frames, there) in self._returning.items():
            target = Pose(target.root, _returned(side, there, target.quaternions, (frames + 1) / _RETURN))
        self._returning = {k: (frames + 1, there) for k, (frames, there) in self._returning.items() if frames < _RETURN}
        for side, hold in self._holds.items():
            if hold.object_id in self._articulated:
                root = self._world.pose().root + velocity * [1.0, 0.0, 1.0] / FPS
                target = Pose(target.root, self._on_its_way(side, hold, Pose(root, target.quaternions)))
        return target

    def let_slip(self, pose: Pose) -> None:
        """Open each hand that what it holds has left, or that is not at it any more."""
        places = _palms(pose)
        for side, hold in list(self._holds.items()):
            hung = hold.object_id in self._articulated
            motion = self._world.motion(hold.object_id)
            there = self._handle(hold, self._state(hold.object_id)[0]) if hung else motion.position
            if np.linalg.norm(there - self._due(side, places)) > PALM:
                self._let_go(side)

    def _let_go(self, side: Side) -> None:
        hold = self._holds.pop(side, None)
        if hold is not None and hold.object_id in self._articulated:
            self._returning[side] = 0, self._world.pose().quaternions
        elif hold is not None:
            self._falling[hold.object_id] = _FALL

    # -- closing -------------------------------------------------------------------------------------------------------
    def _before(
        self, side: Side, objects: Mapping[int, Array], back: float = _BACK
    ) -> Iterator[tuple[float, int, Array, Array]]:
        """Yield the distance, the id, the nearest spot (3,) of each movable thing before a palm, and of the hand."""
        knuckles, turn = _palms(self._world.pose())[side]
        along = turn @ OFFSETS[JOINT_INDEX[f"{side}_hand"]] / np.linalg.norm(OFFSETS[JOINT_INDEX[f"{side}_hand"]])
        for key, place in objects.items():
            if key not in self._sizes or np.linalg.norm(place[:3] - knuckles) > self._sizes[key] + 2 * PALM:
                continue
            for hull, far in product(self._scene.hulls(key, place), _ALONG):
                point = knuckles + far * along
                spot = nearest_point(hull, point)
                gap = float(np.linalg.norm(spot - point))
                if gap <= PALM and float((spot - point) @ turn[:, 1]) <= back:
                    yield gap, key, spot, point

    def _walled(self, spot: Array, point: Array) -> bool:
        """Tell whether something fixed lies between a spot (3,) and a point of the hand (3,)."""
        ways, box = point + _BETWEEN * (spot - point), (np.minimum(spot, point), np.maximum(spot, point))
        hulls = (hull for key in self._fixed if _meet(self._scene.aabb(key), box) for hull in self._scene.hulls(key))
        return any(_apart(hull, point) > _TOUCH and any(_apart(hull, way) < _TOUCH for way in ways) for hull in hulls)

    def _closed(self, side: Side, key: int, spot: Array, point: Array) -> _Hold:
        knuckles, turn = _palms(self._world.pose())[side]
        place, motion = self._world.objects()[key], self._world.motion(key)
        away = float(np.linalg.norm(spot - point))
        shift = turn.T @ (point - spot) * max(0.0, away - _BACK) / max(away, 1e-9)
        there = multiply(conjugate(quaternion_from_matrix(turn)), motion.quaternion)
        held = spot if key in self._articulated else motion.position
        grip = matrix_from_quaternion(place[3:]).T @ (spot - place[:3])
        return _Hold(key, turn.T @ (held - knuckles), there, shift, grip)

    # -- carrying ------------------------------------------------------------------------------------------------------
    def _carry(self, key: int, sides: Sequence[Side], places: Palms, seconds: float) -> None:
        """Give a free thing the velocity that brings it to its place in the hands, as far as their force does."""
        motion, mass = self._world.motion(key), self._scene.by_id[key].mass
        turns = [multiply(quaternion_from_matrix(places[side][1]), self._holds[side].turn) for side in sides]
        turned = turns[0] if len(turns) == 1 else blend(turns[0], turns[1], 0.5)
        due = np.mean([self._due(side, places) for side in sides], axis=0)
        missing = vector_from_quaternion(multiply(turned, conjugate(motion.quaternion)))
        before, given, load = self._carried.get(key, (due, motion.velocity, np.zeros(3)))
        share, fall = len(sides) * seconds / mass, np.array([0.0, self._profile.gravity * seconds, 0.0])
        most = min(self._profile.lift * share, _SHOCK * seconds)
        load = _capped(load + _LEARNS * (given - load - motion.velocity), most)
        gap = before - motion.position
        brakes = math.sqrt(float(np.linalg.norm(gap)) * most / seconds)
        wanted = _capped((due - before) / seconds + _capped(_CATCHES_UP * gap / seconds, brakes), _FAST)
        velocity = motion.velocity + _capped(wanted - motion.velocity + load + fall, most)
        self._carried[key] = due, velocity - fall, load
        faster = _capped(missing / seconds, _FAST / PALM) - motion.spin
        spin = motion.spin + _capped(faster, _WRIST * share / self._sizes[key] ** 2)
        self._world.set_motion(key, ObjectMotion(motion.position, motion.quaternion, velocity, spin))
        self._fastest = max(self._fastest, float(np.linalg.norm(velocity)))

    def _due(self, side: Side, places: Palms) -> Array:
        """Return where a hand has its thing, or the spot of it that it holds, (3,)."""
        point, turn = places[side]
        return np.asarray(point + turn @ self._holds[side].now)

    # -- joints --------------------------------------------------------------------------------------------------------
    def _swing(self, key: int, sides: Sequence[Side], places: Palms, seconds: float) -> None:
        """Give a thing on a joint the speed that brings its handle to the hands, as far as their force does."""
        leaf, (state, speed) = self._articulated[key], self._state(key)
        joint, centre = leaf.joint, self._world.motion(key).position
        dues = {side: self._due(side, places) for side in sides}
        lever = max(PALM, *(float(np.linalg.norm(leaf.arm(due))) for due in dues.values()))
        way = np.mean([self._way(self._holds[side], state, due) for side, due in dues.items()])
        wanted = float(np.clip(way / seconds, -_FAST / lever, _FAST / lever))
        fall = -self._scene.by_id[key].mass * self._profile.gravity * float(leaf.arm(centre)[1])
        brake = math.copysign(joint.friction, wanted) + joint.damping * wanted if wanted else 0.0
        push = leaf.inertia * (wanted - speed) + (brake - fall) * seconds
        most = len(sides) * _PULL * lever * seconds
        speed += float(np.clip(push, -most, most)) / leaf.inertia
        self._world.set_motion(key, leaf.motion(state, speed))
        self._fastest = max(self._fastest, abs(speed) * lever)

    def _state(self, key: int) -> tuple[float, float]:
        return self._articulated[key].state(self._world.motion(key))

    def _handle(self, hold: _Hold, state: float) -> Array:
        """Return the held spot (3,) of a thing on a joint at a state."""
        place = self._articulated[hold.object_id].place(state)
        return np.asarray(place[:3] + matrix_from_quaternion(place[3:]) @ hold.spot)

    def _way(self, hold: _Hold, state: float, point: Array) -> float:
        """Return how far a joint goes for the held point to come nearest to a point (3,), radians or metres."""
        leaf, handle = self._articulated[hold.object_id], self._handle(hold, state)
        if not leaf.turns:
            return float((point - handle) @ leaf.way)
        before, after = (np.cross(leaf.way, place - leaf.axis) for place in (handle, point))
        return math.atan2(float(np.cross(before, after) @ leaf.way), float(before @ after))

    def _on_its_way(self, side: Side, hold: _Hold, pose: Pose) -> Array:
        """Return the turns (24, 4) of a pose whose hand is where the handle can be at the end of the frame."""
        leaf, (state, _) = self._articulated[hold.object_id], self._state(hold.object_id)
        joint, point = leaf.joint, self._due(side, _palms(pose))
        lead = _LEAD / max(float(np.linalg.norm(leaf.arm(point))), PALM)
        there = state + float(np.clip(self._way(hold, state, point), -lead, lead))
        handle = self._handle(hold, min(max(there, joint.low), joint.high))
        return _stretched(side, pose, handle - point)


def _capped(vector: Array, most: float) -> Array:
    return vector * min(1.0, most / max(float(np.linalg.norm(vector)), 1e-12))


def _meet(first: tuple[Array, Array], second: tuple[Array, Array]) -> bool:
    """Tell whether two boxes (lower and upper corner) meet."""
    return bool((first[0] <= second[1]).all() and (second[0] <= first[1]).all())


def _apart(hull: Array, point: Array) -> float:
    return float(np.linalg.norm(nearest_point(hull, point) - point))


def _returned(side: Side, there: Array, target: Array, share: float) -> Array:
    """Return the turns (24, 4) that are told, with an arm at a share of the way to them from where it was."""
    arm = [JOINT_INDEX[f"{side}_{part}"] for part in ("shoulder", "elbow", "wrist")]
    quaternions = target.copy()
    quaternions[arm] = blend(there[arm], target[arm], float(smoothstep(np.array(share))))
    return quaternions


def _palms(pose: Pose) -> Palms:
    """Return the palms of a pose."""
    motion = motion_of([pose])
    joints, turns = forward_kinematics(motion.root[0], motion.rotations[0])
    return {side: (joints[JOINT_INDEX[f"{side}_hand"]], turns[JOINT_INDEX[f"{side}_wrist"]]) for side in SIDES}


def _stretched(side: Side, pose: Pose, way: Array) -> Array:
    """Return the turns (24, 4) of a pose whose hand is elsewhere by a way (3,), turned as it was."""
    motion = motion_of([pose])
    joints, turns = forward_kinematics(motion.root, motion.rotations)
    collar, shoulder, elbow, wrist = (
        JOINT_INDEX[f"{side}_{part}"] for part in ("collar", "shoulder", "elbow", "wrist")
    )
    arm = joints[:, [shoulder, elbow, wrist]]
    upper, fore = bent(Limb.arm(side), arm, turns[:, [shoulder, elbow]], arm[:, 2] + way, Limb.arm(side).reach - 0.005)
    quaternions = pose.quaternions.copy()
    parents = ((shoulder, turns[:, collar], upper), (elbow, upper, fore), (wrist, fore, turns[:, wrist]))
    for joint, parent, turn in parents:
        quaternions[joint] = quaternion_from_matrix(np.swapaxes(parent, -1, -2) @ turn)[0]
    return quaternions
