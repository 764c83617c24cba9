"""The body in Bullet: one tree of spherical joints that is driven by velocities and never by torques.

Before every physics step the root's turn and all joint velocities are set to what carries each link to its pose by the end of that
step; then Bullet solves that step's contacts together with these velocities. How much a contact bends the body instead of moving
it is a matter of rotational inertia, and so the passive stiffness of a joint is given as the inertia of its link: no motor, no
gain, no spring, and a tree that stays well conditioned because contacts are all there is to solve. The inertia of the pelvis
is practically infinite: its orientation is commanded, so nobody falls over.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from humanclaw.body import JOINTS, LINKS, OFFSETS, PARENTS, Box, Capsule
from humanclaw.pose import Array, Motion, quaternion_from_matrix, vector_from_quaternion
from humanclaw_bullet.engine import Client
from humanclaw_bullet.profile import Profile
from humanclaw_bullet.quaternions import capped, conjugate, from_vector, multiply

LINK_OF: Final = {link.joint: link for link in LINKS}
CHILDREN: Final = tuple(range(1, len(JOINTS)))
"""Joint indices of the tree's links; Bullet's link index is one less, and its base is joint 0."""
_COLLAR_MASS: Final = 0.1
_PELVIS_INERTIA: Final = 1e6


@dataclass(frozen=True)
class Pose:
    """One pose of the tree. root: (3,). quaternions: (24, 4), the first in the world frame, the others in the parent's."""

    root: Array
    quaternions: Array


def poses_of(motion: Motion) -> tuple[Pose, ...]:
    return tuple(Pose(root, from_vector(turn)) for root, turn in zip(motion.root, motion.rotations, strict=True))


def motion_of(poses: list[Pose]) -> Motion:
    quaternions = np.stack([pose.quaternions for pose in poses])
    return Motion(np.stack([pose.root for pose in poses]), vector_from_quaternion(quaternions))


def _collision_shape(client: Client, shape: Capsule | Box) -> int:
    if isinstance(shape, Box):
        return int(client.createCollisionShape(client.GEOM_BOX, halfExtents=shape.half, collisionFramePosition=shape.centre))
    centre, turn, length = along(shape)
    return int(
        client.createCollisionShape(
            client.GEOM_CAPSULE,
            radius=shape.radius,
            height=length,
            collisionFramePosition=centre,
            collisionFrameOrientation=turn,
        )
    )


def along(capsule: Capsule) -> tuple[Array, Array, float]:
    """Centre, quaternion that carries +Z onto the axis, and length of the axis."""
    a, b = np.array(capsule.a), np.array(capsule.b)
    length = float(np.linalg.norm(b - a))
    z = (b - a) / length
    x = np.cross([0.0, 1.0, 0.0] if abs(z[1]) < 0.9 else [1.0, 0.0, 0.0], z)
    x /= np.linalg.norm(x)
    return (a + b) / 2, quaternion_from_matrix(np.stack([x, np.cross(z, x), z], -1)), length


class Puppet:
    """The body in one Bullet world."""

    def __init__(self, client: Client, profile: Profile, pose: Pose) -> None:
        self._client, self._profile = client, profile
        self._step = 1 / (30 * profile.substeps)
        self._turn_speed = profile.max_turn * 30
        self._links = [joint - 1 for joint in CHILDREN]
        self.body = self._build()
        self._soften()
        self.place(pose)

    def _build(self) -> int:
        shapes = [
            _collision_shape(self._client, LINK_OF[name].shape) if name in LINK_OF else -1 for name in JOINTS
        ]
        masses = [LINK_OF[name].mass if name in LINK_OF else _COLLAR_MASS for name in JOINTS]
        count, still = len(CHILDREN), [0.0, 0.0, 0.0, 1.0]
        tree: dict[str, Any] = {
            "linkMasses": masses[1:],
            "linkCollisionShapeIndices": shapes[1:],
            "linkVisualShapeIndices": [-1] * count,
            "linkPositions": OFFSETS[1:].tolist(),
            "linkOrientations": [still] * count,
            "linkInertialFramePositions": [[0.0, 0.0, 0.0]] * count,
            "linkInertialFrameOrientations": [still] * count,
            "linkParentIndices": list(PARENTS[1:]),
            "linkJointTypes": [self._client.JOINT_SPHERICAL] * count,
            "linkJointAxis": [[0.0, 0.0, 0.0]] * count,
        }
        return int(self._client.createMultiBody(masses[0], shapes[0], -1, **tree))

    def _soften(self) -> None:
        """Passive stiffness as inertia, surface friction, and none of Bullet's own motors and damping."""
        client, free = self._client, {"linearDamping": 0.0, "angularDamping": 0.0, "jointDamping": 0.0}
        for joint, name in enumerate(JOINTS):
            inertia = _PELVIS_INERTIA if joint == 0 else self._profile.inertia * self._profile.stiffness_of(name)
            client.changeDynamics(
                self.body,
                joint - 1,
                localInertiaDiagonal=[inertia] * 3,
                lateralFriction=self._profile.friction,
                activationState=client.ACTIVATION_STATE_DISABLE_SLEEPING,
                **free,
            )
        for link in self._links:
            client.setJointMotorControlMultiDof(
                self.body, link, client.POSITION_CONTROL, targetPosition=[0, 0, 0, 1], positionGain=0, velocityGain=0,
                force=[0, 0, 0],
            )  # fmt: skip

    def place(self, pose: Pose) -> None:
        """Put the body somewhere, at rest."""
        self._client.resetBasePositionAndOrientation(self.body, pose.root, pose.quaternions[0])
        self._client.resetBaseVelocity(self.body, [0, 0, 0], [0, 0, 0])
        self._set_joints(pose.quaternions[1:], np.zeros((len(CHILDREN), 3)))

    def pose(self) -> Pose:
        """The pose as physics left it."""
        root, turn = self._client.getBasePositionAndOrientation(self.body)
        joints = [state[0] for state in self._client.getJointStatesMultiDof(self.body, self._links)]
        return Pose(np.array(root), np.array([turn, *joints]))

    def drive(self, target: Array, horizontal: Array | None) -> None:
        """Command the next physics step. target: (24, 4). horizontal: (3,) root velocity, its y unread; None leaves it be."""
        actual = self.pose().quaternions
        error = multiply(conjugate(actual), target)
        speed = capped(vector_from_quaternion(error) / self._step, self._turn_speed)
        (vx, vy, vz), _ = self._client.getBaseVelocity(self.body)
        if horizontal is not None:
            vx, vz = float(horizontal[0]), float(horizontal[2])
        spin = vector_from_quaternion(multiply(target[0], conjugate(actual[0]))) / self._step
        self._client.resetBaseVelocity(
            self.body, [vx, min(vy, self._profile.max_rise), vz], capped(spin, self._turn_speed)
        )
        self._set_joints(actual[1:], speed[1:])

    def _set_joints(self, quaternions: Array, velocities: Array) -> None:
        self._client.resetJointStatesMultiDof(
            self.body, self._links, quaternions.tolist(), velocities.tolist()
        )
