"""Objects on hinges: one angle says where such an object is and how it moves, whatever engine turns it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from humanclaw.half_physics.quaternions import conjugate, from_vector, multiply
from humanclaw.half_physics.solids import centre_of_mass, inertia
from humanclaw.half_physics.world import ObjectMotion
from humanclaw.pose import Array, matrix_from_quaternion, vector_from_quaternion
from humanclaw.scene import Hinge, Scene, SceneObject

_UP = np.array([0.0, 1.0, 0.0])


@dataclass(frozen=True, eq=False)
class Swing:
    """A hinged object of a scene."""

    joint: Hinge
    state: float
    """Its angle at the start, radians."""
    axis: Array
    """(3,) a point of the hinge in the world."""
    quaternion: Array
    """(4,) how the object is turned at angle 0."""
    centre: Array
    """(3,) its centre of mass in its asset's frame."""
    inertia: float
    """About the hinge, kg m2."""

    @classmethod
    def of(cls, scene: Scene, obj: SceneObject) -> Swing:
        """Measure an object that has a joint and hulls."""
        assert obj.joint is not None
        hulls = [hull.astype(float) for hull in scene.assets[obj.asset].hulls]
        centre, turn = centre_of_mass(hulls), np.array(obj.rotation, float)
        axis = np.array(obj.position) + matrix_from_quaternion(turn) @ np.array(obj.joint.point)
        arm = (centre - obj.joint.point)[[0, 2]]
        about = float(inertia(hulls, obj.mass)[1, 1] + obj.mass * arm @ arm)
        return cls(obj.joint, obj.state, axis, multiply(from_vector(-obj.state * _UP), turn), centre, about)

    def place(self, angle: float) -> Array:
        """Return (7,) position and quaternion of the asset's own frame at an angle."""
        turn = multiply(from_vector(angle * _UP), self.quaternion)
        return np.concatenate([self.axis - matrix_from_quaternion(turn) @ np.array(self.joint.point), turn])

    def motion(self, angle: float, speed: float) -> ObjectMotion:
        """Return how the object moves that turns so fast, rad/s, through an angle."""
        place, spin = self.place(angle), speed * _UP
        centre = place[:3] + matrix_from_quaternion(place[3:]) @ self.centre
        return ObjectMotion(centre, place[3:], np.cross(spin, centre - self.axis), spin)

    def angle(self, quaternion: Array) -> float:
        """Return the angle of an object that is turned like this, the one in the hinge's range or nearest to it."""
        middle = (self.joint.low + self.joint.high) / 2
        half = multiply(from_vector(middle * _UP), self.quaternion)
        return middle + float(vector_from_quaternion(multiply(quaternion, conjugate(half)))[1])


def swings(scene: Scene) -> Mapping[int, Swing]:
    """Return the hinged objects of a scene that have a body, by id."""
    hung = [obj for obj in scene.objects if obj.joint and scene.assets[obj.asset].hulls]
    return {obj.id: Swing.of(scene, obj) for obj in hung}
