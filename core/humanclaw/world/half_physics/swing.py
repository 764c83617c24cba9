"""Objects on hinges: one angle says where such an object is and how it moves, whatever engine turns it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np

from humanclaw.body.pose import Array, matrix_from_quaternion, vector_from_quaternion
from humanclaw.world.half_physics.quaternions import conjugate, multiply
from humanclaw.world.half_physics.solids import centre_of_mass, inertia
from humanclaw.world.half_physics.world import ObjectMotion
from humanclaw.world.scene import Hinge, Scene, SceneObject

_UP = np.array([0.0, 1.0, 0.0])


@dataclass(frozen=True, eq=False)
class Swing:
    """A hinged object of a scene."""

    obj: SceneObject
    axis: Array
    """(3,) a point of the hinge in the world."""
    centre: Array
    """(3,) its centre of mass in its asset's frame."""
    inertia: float
    """About the hinge, kg m2."""
    place: Callable[[float], Array] = field(init=False, repr=False)
    """Return (7,) position and quaternion of the asset's own frame at an angle. The array is not for writing."""
    motion: Callable[[float, float], ObjectMotion] = field(init=False, repr=False)
    """Return how the object moves that turns so fast, rad/s, through an angle. The arrays are not for writing."""

    def __post_init__(self) -> None:
        # Engines ask at every step, and most doors hang still: then the answer is the one before.
        object.__setattr__(self, "place", lru_cache(maxsize=1)(self._placed))
        object.__setattr__(self, "motion", lru_cache(maxsize=1)(self._moving))

    @classmethod
    def of(cls, scene: Scene, obj: SceneObject) -> Swing:
        """Measure an object that has a joint and hulls."""
        joint = obj.joint
        assert joint is not None
        hulls = [hull.astype(float) for hull in scene.assets[obj.asset].hulls]
        centre = centre_of_mass(hulls)
        axis = np.array(obj.position) + matrix_from_quaternion(np.array(obj.rotation)) @ np.array(joint.point)
        arm = (centre - joint.point)[[0, 2]]
        about = float(inertia(hulls, obj.mass)[1, 1] + obj.mass * arm @ arm)
        return cls(obj, axis, centre, about)

    @property
    def joint(self) -> Hinge:
        """The hinge."""
        assert self.obj.joint is not None
        return self.obj.joint

    def _placed(self, angle: float) -> Array:
        place = self.obj.at(angle)
        place.flags.writeable = False
        return place

    def _moving(self, angle: float, speed: float) -> ObjectMotion:
        place, spin = self.place(angle), speed * _UP
        centre = place[:3] + matrix_from_quaternion(place[3:]) @ self.centre
        motion = ObjectMotion(centre, place[3:], np.cross(spin, centre - self.axis), spin)
        for array in vars(motion).values():
            array.flags.writeable = False
        return motion

    def angle(self, quaternion: Array) -> float:
        """Return the angle of an object that is turned like this, the one in the hinge's range or nearest to it."""
        middle = (self.joint.low + self.joint.high) / 2
        back = conjugate(self.place(middle)[3:])
        return middle + float(vector_from_quaternion(multiply(quaternion, back))[1])


def swings(scene: Scene) -> Mapping[int, Swing]:
    """Return the hinged objects of a scene that have a body, by id."""
    hung = [obj for obj in scene.objects if obj.joint and scene.assets[obj.asset].hulls]
    return {obj.id: Swing.of(scene, obj) for obj in hung}
