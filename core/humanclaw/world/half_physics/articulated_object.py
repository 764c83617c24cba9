"""Objects on joints: one number says where such an object is, and its speed how it moves, whatever engine moves it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import Final
from weakref import WeakKeyDictionary

import numpy as np

from humanclaw.body.pose import Array, matrix_from_quaternion, vector_from_quaternion
from humanclaw.world.half_physics.quaternions import conjugate, multiply
from humanclaw.world.half_physics.solids import centre_of_mass, inertia, solids
from humanclaw.world.half_physics.world import ObjectMotion
from humanclaw.world.joints import Hinge, Joint
from humanclaw.world.scene import Scene, SceneObject


@dataclass(frozen=True, eq=False)
class ArticulatedObject:
    """An object of a scene on a hinge or a slide. Its state is an angle (radians) or a way (metres)."""

    obj: SceneObject
    point: Array
    """(3,) a point of the hinge, in its asset's frame; of a slide the origin."""
    axis: Array
    """(3,) the same point in the world, at state 0."""
    way: Array
    """(3,) unit vector of the joint's axis in the world."""
    centre: Array
    """(3,) its centre of mass in its asset's frame."""
    inertia: float
    """About the hinge, kg m2; of an object that slides its mass, kg."""
    place: Callable[[float], Array] = field(init=False, repr=False)
    """Return (7,) position and quaternion of the asset's own frame at a state. The array is not for writing."""
    motion: Callable[[float, float], ObjectMotion] = field(init=False, repr=False)
    """Return how the object moves that passes a state at a speed, rad/s or m/s. The arrays are not for writing."""

    def __post_init__(self) -> None:
        # Engines ask at every step, and most doors hang still: then the answer is the one before.
        object.__setattr__(self, "place", lru_cache(maxsize=1)(self._placed))
        object.__setattr__(self, "motion", lru_cache(maxsize=1)(self._moving))

    @classmethod
    def of(cls, scene: Scene, obj: SceneObject) -> ArticulatedObject:
        """Measure an object that has a joint and hulls, once a scene: both the engine and the bounds of pushes ask at
        every reset."""
        known = _MEASURED.setdefault(scene, {})
        if obj.id not in known or known[obj.id].obj is not obj:
            known[obj.id] = cls._measured(scene, obj)
        return known[obj.id]

    @classmethod
    def _measured(cls, scene: Scene, obj: SceneObject) -> ArticulatedObject:
        joint = obj.joint
        assert joint is not None
        hulls = solids(scene.assets[obj.asset].hulls)
        centre, way = centre_of_mass(hulls), np.array(joint.axis)
        point = np.array(joint.point) if isinstance(joint, Hinge) else np.zeros(3)
        arm = np.cross(way, centre - point)
        about = float(way @ inertia(hulls, obj.mass) @ way + obj.mass * arm @ arm)
        place = obj.at(0.0)
        turn = matrix_from_quaternion(place[3:])
        turns = isinstance(joint, Hinge)
        return cls(obj, point, place[:3] + turn @ point, turn @ way, centre, about if turns else obj.mass)

    @property
    def joint(self) -> Joint:
        """The hinge or the slide."""
        assert self.obj.joint is not None
        return self.obj.joint

    @property
    def turns(self) -> bool:
        """Whether the joint is a hinge."""
        return isinstance(self.joint, Hinge)

    def arm(self, point: Array) -> Array:
        """Return (3,) the velocity of a point of the object, in the world, for each rad/s or m/s of the joint."""
        if not self.turns:
            return self.way
        # Engines ask at every step, and numpy's own cross product takes ten times as long.
        (a, b, c), (x, y, z) = self.way.tolist(), (point - self.axis).tolist()
        return np.array([b * z - c * y, c * x - a * z, a * y - b * x])

    def state(self, motion: ObjectMotion) -> tuple[float, float]:
        """Return the state of an object that moves like this, in or nearest to the joint's range, and its speed."""
        middle, there = self._middle
        if not self.turns:
            return middle + float((motion.position - there.position) @ self.way), float(motion.velocity @ self.way)
        turned = vector_from_quaternion(multiply(motion.quaternion, conjugate(there.quaternion)))
        return middle + float(turned @ self.way), float(motion.spin @ self.way)

    @cached_property
    def _middle(self) -> tuple[float, ObjectMotion]:
        middle = (self.joint.low + self.joint.high) / 2
        return middle, self._moving(middle, 0.0)

    def _placed(self, state: float) -> Array:
        place = self.obj.at(state)
        place.flags.writeable = False
        return place

    def _moving(self, state: float, speed: float) -> ObjectMotion:
        place = self._placed(state)
        centre = place[:3] + matrix_from_quaternion(place[3:]) @ self.centre
        motion = ObjectMotion(centre, place[3:], speed * self.arm(centre), speed * self.turns * self.way)
        for array in vars(motion).values():
            array.flags.writeable = False
        return motion


_MEASURED: Final[WeakKeyDictionary[Scene, dict[int, ArticulatedObject]]] = WeakKeyDictionary()
"""The leaves of each scene by object id. Freed with the scene."""


def articulated_objects(scene: Scene) -> Mapping[int, ArticulatedObject]:
    """Return the objects of a scene on joints that have a body, by id."""
    hung = [obj for obj in scene.objects if obj.joint and scene.assets[obj.asset].hulls]
    return {obj.id: ArticulatedObject.of(scene, obj) for obj in hung}
