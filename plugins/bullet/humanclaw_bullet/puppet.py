"""The body in Bullet: one tree of spherical joints that is driven by velocities and never by torques.

Before every physics step the root's turn and all joint velocities are set to what carries each link to its pose by the end of that
step; then Bullet solves that step's contacts together with these velocities. How much a contact bends the body instead of moving
it is a matter of rotational inertia, and so the passive stiffness of a joint is given as the inertia of its link: no motor, no
gain, no spring, and a tree that stays well conditioned because contacts are all there is to solve. The inertia of the pelvis
is practically infinite: its orientation is commanded, so nobody falls over.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from humanclaw.body import JOINTS, LINKS, OFFSETS, PARENTS, Box, Capsule
from humanclaw.pose import FPS, Array, Motion, vector_from_quaternion
from humanclaw_bullet.engine import Client
from humanclaw_bullet.profile import Profile
from humanclaw_bullet.quaternions import capped, conjugate, from_vector, multiply

LINK_OF: Final = {link.joint: link for link in LINKS}
_ARMS: Final = frozenset(link.joint for link in LINKS if link.group == "arm_hand")
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


def along(capsule: Capsule) -> tuple[Array, Array, float]:
    """Centre, matrix that carries +Z onto the axis, and length of the axis."""
    a, b = np.array(capsule.a), np.array(capsule.b)
    length = float(np.linalg.norm(b - a))
    z = (b - a) / length
    x = np.cross([0.0, 1.0, 0.0] if abs(z[1]) < 0.9 else [1.0, 0.0, 0.0], z)
    x /= np.linalg.norm(x)
    return (a + b) / 2, np.stack([x, np.cross(z, x), z], -1), length


def roll_pitch_yaw(m: Array) -> tuple[float, float, float]:
    """A rotation matrix as the angles about the fixed axes x, y, z that URDF writes."""
    pitch = np.arctan2(-m[2, 0], np.hypot(m[0, 0], m[1, 0]))
    if np.hypot(m[0, 0], m[1, 0]) < 1e-6:
        return float(np.arctan2(-m[1, 2], m[1, 1])), float(pitch), 0.0
    return float(np.arctan2(m[2, 1], m[2, 2])), float(pitch), float(np.arctan2(m[1, 0], m[0, 0]))


def urdf(profile: Profile) -> str:
    """The body as URDF: the one format through which Bullet accepts the inertia of a link."""
    parts = [part for joint in range(len(JOINTS)) for part in (_urdf_link(joint, profile), _urdf_joint(joint))]
    return "\n".join(["<robot name='body'>", *parts, "</robot>"])  # Lines, because Bullet reads at most 1 kB at a time.


def _urdf_link(joint: int, profile: Profile) -> str:
    name = JOINTS[joint]
    inertia = _PELVIS_INERTIA if joint == 0 else profile.inertia * profile.stiffness_of(name)
    diagonal = f"ixx='{inertia}' iyy='{inertia}' izz='{inertia}' ixy='0' ixz='0' iyz='0'"
    inertial = f"<inertial><origin xyz='0 0 0'/><mass value='{_mass(name, profile)}'/><inertia {diagonal}/></inertial>"
    return f"<link name='{name}'>{inertial}{_urdf_collision(name) if name in LINK_OF else ''}</link>"


def _mass(name: str, profile: Profile) -> float:
    if name not in LINK_OF:
        return _COLLAR_MASS
    moved = (1 - profile.arm_mass) * sum(LINK_OF[arm].mass for arm in _ARMS) if name == "spine3" else 0.0
    return LINK_OF[name].mass * (profile.arm_mass if name in _ARMS else 1.0) + moved


def _urdf_collision(name: str) -> str:
    shape = LINK_OF[name].shape
    if isinstance(shape, Box):
        size = np.multiply(shape.half, 2)
        return f"<collision><origin xyz='{_text(shape.centre)}'/><geometry><box size='{_text(size)}'/></geometry></collision>"
    centre, turn, length = along(shape)
    origin = f"<origin xyz='{_text(centre)}' rpy='{_text(roll_pitch_yaw(turn))}'/>"
    geometry = f"<geometry><capsule radius='{shape.radius}' length='{length}'/></geometry>"
    return f"<collision>{origin}{geometry}</collision>"


def _urdf_joint(joint: int) -> str:
    if joint == 0:
        return ""
    ends = f"<parent link='{JOINTS[PARENTS[joint]]}'/><child link='{JOINTS[joint]}'/>"
    place = f"<origin xyz='{_text(OFFSETS[joint])}'/><axis xyz='1 0 0'/>"
    return f"<joint name='to_{JOINTS[joint]}' type='spherical'>{ends}{place}</joint>"


def _text(numbers: Iterable[float]) -> str:
    return " ".join(f"{number:.9g}" for number in numbers)


class Puppet:
    """The body in one Bullet world."""

    def __init__(self, client: Client, profile: Profile, pose: Pose) -> None:
        self._client, self._profile = client, profile
        self._links = [joint - 1 for joint in CHILDREN]
        self._recovery = np.array([[profile.arm_recovery if name in _ARMS else 1.0] for name in JOINTS])
        self.body = self._build()
        self._free()
        self.place(pose)

    def _build(self) -> int:
        client = self._client
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "body.urdf"
            path.write_text(urdf(self._profile), encoding="utf-8")
            # Without the second flag Bullet numbers the links depth first.
            flags = client.URDF_USE_INERTIA_FROM_FILE | client.URDF_MAINTAIN_LINK_ORDER
            return int(client.loadURDF(str(path), flags=flags))

    def _free(self) -> None:
        """Surface friction, and none of Bullet's own motors, damping and sleep."""
        client = self._client
        for link in (-1, *self._links):
            client.changeDynamics(
                self.body, link, lateralFriction=self._profile.friction, linearDamping=0, angularDamping=0, jointDamping=0,
                activationState=client.ACTIVATION_STATE_DISABLE_SLEEPING,
            )  # fmt: skip
        for link in self._links:
            client.setJointMotorControlMultiDof(
                self.body, link, client.POSITION_CONTROL, targetPosition=[0, 0, 0, 1], positionGain=0, velocityGain=0,
                force=[0, 0, 0],
            )  # fmt: skip

    def place(self, pose: Pose) -> None:
        """Put the body somewhere, at rest."""
        self._client.resetBasePositionAndOrientation(self.body, pose.root, pose.quaternions[0])
        self._client.resetBaseVelocity(self.body, [0, 0, 0], [0, 0, 0])
        self._target, self._fall = pose.quaternions, 0.0
        self._set_joints(pose.quaternions[1:], np.zeros((len(CHILDREN), 3)))

    def pose(self) -> Pose:
        """The pose as physics left it."""
        root, turn = self._client.getBasePositionAndOrientation(self.body)
        joints = [state[0] for state in self._client.getJointStatesMultiDof(self.body, self._links)]
        return Pose(np.array(root), np.array([turn, *joints]))

    def aim(self, target: Array) -> None:
        """Take up the pose (24, 4) that is due at the end of the coming frame."""
        self._way = vector_from_quaternion(multiply(conjugate(self._target), target))
        self._target = target

    def drive(self, left: int, horizontal: Array | None) -> None:
        """Command one physics step of the frame, with so many steps left in it.

        A joint moves as its pose moves, and makes up for what contact took from it. horizontal: (3,) root velocity, its y
        unread; None leaves it be.
        """
        actual = self.pose().quaternions
        turn = vector_from_quaternion(multiply(conjugate(actual), self._target))
        way = self._way * (left / self._profile.substeps)
        turn = way + self._recovery * (turn - way)
        turn[0] = vector_from_quaternion(multiply(self._target[0], conjugate(actual[0])))
        speeds = capped(turn * (FPS * self._profile.substeps / left), self._profile.max_turn * FPS)
        velocity = self._root_velocity(horizontal)
        self._fall = float(velocity[1])
        self._client.resetBaseVelocity(self.body, velocity, speeds[0])
        self._set_joints(actual[1:], speeds[1:])

    def restrain(self, before: Array) -> None:
        """Take back what a step moved the root, away from (3,) before, faster than a body may move.

        Contacts may push it either way, up and down alike: were only one of them free, limbs that jitter would ratchet the
        body up a wall. Beyond that only gravity speeds up a fall.
        """
        profile, rate = self._profile, FPS * self._profile.substeps
        root, turn = self._client.getBasePositionAndOrientation(self.body)
        speed = (np.array(root) - before) * rate
        allowed = np.empty(3)
        allowed[[0, 2]] = capped(speed[[0, 2]], profile.max_speed)
        allowed[1] = np.clip(speed[1], min(self._fall - profile.gravity / rate, -profile.max_lift), profile.max_lift)
        if np.abs(allowed - speed).max() > 1e-6:
            _, spin = self._client.getBaseVelocity(self.body)
            self._client.resetBasePositionAndOrientation(self.body, before + allowed / rate, turn)
            self._client.resetBaseVelocity(self.body, allowed, spin)

    def _root_velocity(self, horizontal: Array | None) -> Array:
        velocity = np.array(self._client.getBaseVelocity(self.body)[0])
        if horizontal is not None:
            velocity[[0, 2]] = capped(horizontal[[0, 2]], self._profile.max_speed)
        velocity[1] = np.clip(velocity[1], -self._profile.max_fall, self._profile.max_rise)
        return velocity

    def _set_joints(self, quaternions: Array, velocities: Array) -> None:
        self._client.resetJointStatesMultiDof(self.body, self._links, quaternions.tolist(), velocities.tolist())
