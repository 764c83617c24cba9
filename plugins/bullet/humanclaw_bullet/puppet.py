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
from humanclaw.pose import FPS, Array, Motion, forward_kinematics, vector_from_quaternion
from humanclaw_bullet.engine import Client
from humanclaw_bullet.profile import Profile
from humanclaw_bullet.quaternions import blend, capped, conjugate, from_vector, multiply
from humanclaw_bullet.reflexes import CALM, Reflex

LINK_OF: Final = {link.joint: link for link in LINKS}
_ARMS: Final = tuple(link.joint for link in LINKS if link.group == "arm_hand")
"""In order: a sum over a set of names differs in its last bit from process to process."""
CHILDREN: Final = tuple(range(1, len(JOINTS)))
"""Joint indices of the tree's links; Bullet's link index is one less, and its base is joint 0."""
_COLLAR_MASS: Final = 0.1
_PELVIS_INERTIA: Final = 1e6
_FLEX: Final = np.array([-1.0, 0.0, 0.0])
"""The axis about which a hip bends."""


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


def _far(shape: Capsule | Box) -> float:
    """Distance of the farthest point of a shape from its joint."""
    if isinstance(shape, Box):
        return float(np.linalg.norm(np.abs(shape.centre) + np.array(shape.half)))
    return float(np.linalg.norm([shape.a, shape.b], axis=1).max()) + shape.radius


def _reach() -> Array:
    """(24, links): how far the far end of a link can be from each joint that moves it; 0 for joints that do not."""
    reach = np.zeros((len(JOINTS), len(LINKS)))
    for column, link in enumerate(LINKS):
        joint, distance = JOINTS.index(link.joint), _far(link.shape)
        while joint >= 0:
            reach[joint, column] = distance
            distance, joint = distance + float(np.linalg.norm(OFFSETS[joint])), PARENTS[joint]
    return reach


_REACH: Final = _reach()
_OF_LINK: Final = [JOINTS.index(link.joint) for link in LINKS]
_TIPS: Final = np.array([link.shape.centre if isinstance(link.shape, Box) else link.shape.b for link in LINKS])
"""(links, 3) a point near the far end of each link, in its joint's frame."""


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
        self._target, self._swing, self._before, self._sent = pose.quaternions, 0.0, pose, np.zeros(3)
        self._set_joints(pose.quaternions[1:], np.zeros((len(CHILDREN), 3)))

    def pose(self) -> Pose:
        """The pose as physics left it."""
        root, turn = self._client.getBasePositionAndOrientation(self.body)
        joints = [state[0] for state in self._client.getJointStatesMultiDof(self.body, self._links)]
        return Pose(np.array(root), np.array([turn, *joints]))

    def aim(self, target: Array, swing: float = 0.0) -> None:
        """Take up the pose (24, 4) that is due at the end of the coming frame; on the way to it no link swings faster, m/s."""
        self._way = vector_from_quaternion(multiply(conjugate(self._target), target))
        self._target, self._swing = target, swing

    def drive(self, left: int, horizontal: Array | None, reflex: Reflex = CALM) -> float:
        """Command one physics step of the frame, with so many steps left in it; returns a bound of the links' speeds, m/s.

        A joint moves as its pose moves, and makes up for what contact took from it. horizontal: (3,) root velocity, its y
        unread; None leaves it be.
        """
        self._before = self.pose()
        speeds = self._joint_speeds(self._before.quaternions, left)
        self._give_way(speeds, reflex)
        fastest = float((np.linalg.norm(speeds, axis=1) @ _REACH).max())
        speeds *= min(1.0, self._profile.max_link_speed / max(fastest, 1e-9))
        velocity = self._root_velocity(horizontal, reflex)
        self._sent = velocity
        self._client.resetBaseVelocity(self.body, velocity, speeds[0])
        self._set_joints(self._before.quaternions[1:], speeds[1:])
        return min(fastest, self._profile.max_link_speed, self._expected(speeds)) + float(np.linalg.norm(velocity))

    def _expected(self, speeds: Array) -> float:
        """Speed of the fastest link: what the motion has it swing at, and at most so much more where joints catch up."""
        late = np.linalg.norm(speeds - self._way * FPS, axis=1)
        late[0] = abs(np.linalg.norm(speeds[0]) - np.linalg.norm(self._way[0]) * FPS)  # Not in the same frame.
        return self._swing + float((late @ _REACH).max())

    def _joint_speeds(self, actual: Array, left: int) -> Array:
        """(24, 3) angular velocities, the first in the world frame, the others in each joint's own."""
        turn = vector_from_quaternion(multiply(conjugate(actual), self._target))
        way = self._way * (left / self._profile.substeps)
        turn = way + self._recovery * (turn - way)
        turn[0] = vector_from_quaternion(multiply(self._target[0], conjugate(actual[0])))
        return capped(turn * (FPS * self._profile.substeps / left), self._profile.max_turn * FPS)

    def swings(self, motion: Motion) -> Array:
        """(T,) how fast the fastest link moves in each frame of a motion to come, relative to the pelvis, m/s."""
        rotations = np.concatenate([vector_from_quaternion(self._target)[None], motion.rotations])
        joints, turns = forward_kinematics(np.zeros((len(rotations), 3)), rotations)
        tips = joints[:, _OF_LINK] + np.einsum("tlij,lj->tli", turns[:, _OF_LINK], _TIPS)
        return np.asarray(np.linalg.norm(np.diff(tips, axis=0), axis=-1).max(axis=1) * FPS)

    def _give_way(self, speeds: Array, reflex: Reflex) -> None:
        """Hips whose thighs carry weight follow the motion but make up for nothing, and bend until the pelvis is down."""
        for hip, seconds in reflex.borne.items():
            bends = seconds == 0.0 and not reflex.seated
            speeds[hip] = self._way[hip] * FPS + (self._profile.yielding * _FLEX if bends else 0.0)

    def restrain(self, touched: bool) -> None:
        """Take back what the step since drive moved the root faster than a body may move. touched: whether contact pushed it.

        A body that nothing touches goes where it was sent and falls at g: limbs that swing do not recoil on it. Contacts may
        push it either way, up and down alike: were only one of them free, limbs that jitter would ratchet the body up a wall.
        Limbs give back the same share of their step: a leg that went on while the hips must not would be pressed through the
        floor.
        """
        rate = FPS * self._profile.substeps
        root, turn = self._client.getBasePositionAndOrientation(self.body)
        speed = (np.array(root) - self._before.root) * rate
        sent = self._sent - [0.0, self._profile.gravity / rate, 0.0]
        allowed = self._allowed(speed) if touched else sent
        if np.abs(allowed - speed).max() < 1e-6:
            return
        _, spin = self._client.getBaseVelocity(self.body)
        if touched:
            share = float(np.linalg.norm(allowed) / np.linalg.norm(speed))
            kept = blend(self._before.quaternions, self.pose().quaternions, share)
            turn = kept[0]
            self._set_joints(kept[1:], np.zeros((len(CHILDREN), 3)))
        self._client.resetBasePositionAndOrientation(self.body, self._before.root + allowed / rate, turn)
        self._client.resetBaseVelocity(self.body, allowed, spin)

    def _allowed(self, speed: Array) -> Array:
        """(3,) the part of a root velocity that contact may cause."""
        profile = self._profile
        falling = self._sent[1] - profile.gravity / (FPS * profile.substeps)
        x, z = capped(speed[[0, 2]], profile.max_speed)
        return np.array([x, np.clip(speed[1], min(falling, -profile.max_lift), profile.max_lift), z])

    def _root_velocity(self, horizontal: Array | None, reflex: Reflex) -> Array:
        velocity = np.array(self._client.getBaseVelocity(self.body)[0])
        if horizontal is not None:
            velocity[[0, 2]] = capped(horizontal[[0, 2]], self._profile.max_speed)
        velocity[1] = np.clip(velocity[1], -self._profile.max_fall, self._profile.max_rise)
        if reflex.lift:
            velocity[1] = min(reflex.lift * FPS * self._profile.substeps, self._profile.max_lift)
        return velocity

    def _set_joints(self, quaternions: Array, velocities: Array) -> None:
        self._client.resetJointStatesMultiDof(self.body, self._links, quaternions.tolist(), velocities.tolist())
