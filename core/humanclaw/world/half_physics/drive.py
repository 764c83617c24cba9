"""Drive a body by velocities, never by torques.

Before every physics step the root's turn and all joint velocities carry each link to its pose by the
end of that step. Then the engine solves that step's contacts together with these velocities. Rotational inertia decides
how far a contact bends the body instead of moving it, so the inertia of a link states the passive stiffness of its
joint. There is no motor, gain or spring; the tree stays well conditioned because contacts are its only constraints.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from humanclaw.body.hand_thigh_contact import HIPS, RAISED, lay_hands
from humanclaw.body.pose import FPS, Array, Motion, matrix_from_quaternion, vector_from_quaternion
from humanclaw.body.skeleton import JOINTS
from humanclaw.world.half_physics.kernels import (
    hold_back,
    joint_speeds,
    link_points,
    link_speed,
    moved_on,
    turns_between,
)
from humanclaw.world.half_physics.profile import Profile
from humanclaw.world.half_physics.quaternions import Pose, blend, motion_of, poses_of
from humanclaw.world.half_physics.reflexes import CALM, LEG_OF, Reflex, reach_down
from humanclaw.world.half_physics.skeleton import ARMS, tip_speeds
from humanclaw.world.half_physics.world import World

_LEAVING: Final = 0.05
"""Hips that are to go up or ahead faster than this leave a seat, m/s; the legs then push as commanded."""
_UPRIGHT: Final = math.cos(RAISED / 2)
"""Least real part of the turn of a hip that is not raised."""
_FLEX: Final = np.array([-1.0, 0.0, 0.0])
"""The axis about which a hip bends."""


class Drive:
    """The body of one world, on its way from pose to pose."""

    def __init__(self, world: World, profile: Profile, pose: Pose) -> None:
        """pose: where the world has put the body, at rest."""
        self._world, self._profile = world, profile
        self._recovery = np.array([profile.arm_recovery if name in ARMS else 1.0 for name in JOINTS])
        self._target, self._swing, self._before, self._sent = pose.quaternions, 0.0, pose, np.zeros(3)
        self._turning = np.zeros((len(JOINTS), 3))
        self.pose = world.pose()
        """The body's, after the last step."""

    def aim(self, target: Array, swing: float = 0.0) -> None:
        """Take up the pose (24, 4) that is due at the end of the coming frame; on the way to it no link swings faster,
        m/s."""
        self._way = turns_between(self._target, target)
        self._target, self._swing = target, swing

    def laid(self, target: Pose) -> Pose:
        """Return the pose due at the end of the coming frame with hands that are clear of the thighs as they will be
        then.

        A seat holds thighs otherwise than the motion has them.
        """
        hips = np.stack([pose[HIPS] for pose in (self.pose.quaternions, self._target, target.quaternions)])
        if np.abs(hips[..., 3]).max(-1).min() > _UPRIGHT:
            return target
        now, before, due = vector_from_quaternion(hips)
        (laid,) = poses_of(lay_hands(motion_of([target]), now + due - before))
        return laid

    def command(self, left: int, horizontal: Array | None, reflex: Reflex = CALM) -> float:
        """Command one physics step of the frame, with so many steps left in it; returns a bound of the links' speeds,
        m/s.

        A joint moves as its pose moves, and makes up for what contact took from it. horizontal: (3,) root velocity, its
        y unread; None leaves it be.
        """
        self._before = self.pose
        speeds = self._speeds(self._before, left, horizontal, reflex)
        velocity = self._root_velocity(horizontal, reflex)
        self._sent, self._turning = velocity, speeds
        self._world.drive(velocity, speeds[0])
        self._world.bend(self._before.quaternions[1:], speeds[1:])
        return float(link_speed(speeds, self._way, self._swing)) + math.hypot(*velocity)

    def foreseen(self, seconds: float) -> Pose:
        """Return the body's pose so long after the last command, if nothing touches it."""
        root = self._before.root + self._sent * seconds
        return Pose(root, moved_on(self._before.quaternions, self._turning, seconds))

    def course(self, horizontal: Array, reflex: Reflex) -> Array:
        """Foresee (3, P, 3) points that span the links now, halfway through the coming frame and at its end, if nothing
        touches the body; world frame.

        It falls as fast as it does now, and late limbs do not reach their pose. Arguments: as for command.
        """
        velocity, pose, half = self._root_velocity(horizontal, reflex), self.pose, 0.5 / FPS
        points = [link_points(pose.root, pose.quaternions)]
        for left in (1.0, 0.5):
            speeds = self._speeds(pose, left * self._profile.substeps, horizontal, reflex)
            pose = Pose(pose.root + velocity * half, moved_on(pose.quaternions, speeds, half))
            points.append(link_points(pose.root, pose.quaternions))
        return np.stack(points)

    def _speeds(self, pose: Pose, left: float, horizontal: Array | None, reflex: Reflex) -> Array:
        """(24, 3) angular velocities that a body commands in a pose, none too fast: the first in the world frame, the
        others in each joint's own."""
        profile = self._profile
        speeds: Array = joint_speeds(
            pose.quaternions, self._target, self._way, self._recovery, float(left), profile.substeps
        )
        if reflex.borne and (horizontal is None or not self._leaves(pose, horizontal)):
            self._give_way(pose, speeds, reflex)
        hold_back(speeds, profile.max_turn * FPS, profile.max_link_speed)
        return speeds

    def swings(self, motion: Motion) -> Array:
        """Compute (T,) how fast the fastest link moves in each frame of a motion to come, relative to the pelvis,
        m/s."""
        return tip_speeds(np.concatenate([vector_from_quaternion(self._target)[None], motion.rotations]))

    def _give_way(self, pose: Pose, speeds: Array, reflex: Reflex) -> None:
        """Let the legs of a body that sits follow the motion without catching up; bend hips whose thighs or feet carry
        it until the pelvis is down, and knees and ankles until the feet are."""
        for hip, (knee, ankle, _) in LEG_OF.items():
            leg = [hip, knee, ankle]
            speeds[leg] = self._way[leg] * FPS
            speeds[hip] += self._profile.yielding * reflex.gives(hip) * _FLEX
            if hangs := reflex.hangs(hip):
                rates = reach_down(pose, hip, hangs * self._profile.reaching)
                speeds[[knee, ankle]] -= np.outer(rates, _FLEX)

    def _leaves(self, pose: Pose, horizontal: Array) -> bool:
        """Tell whether a commanded velocity (3,) takes the hips up or ahead, off a seat."""
        x, _, z = matrix_from_quaternion(pose.quaternions[0])[:, 0]
        return float(max(horizontal[1], x * horizontal[2] - z * horizontal[0])) > _LEAVING

    def restrain(self, touched: bool) -> None:
        """Limit the root's motion in the step since command to the speeds of a body. touched: whether contact pushed
        it.

        Without contact the body moves as commanded and falls at g: swinging limbs do not recoil on it. Contacts may
        push it up and down alike: if only one way were free, jittering limbs would lift the body up a wall step by
        step. Limbs give back the same share of their step: a leg that moved on without the hips would be pressed
        through the floor.
        """
        rate = FPS * self._profile.substeps
        self.pose = pose = self._world.pose()
        speed, turn = (pose.root - self._before.root) * rate, pose.quaternions[0]
        allowed = self._allowed(speed) if touched else self._sent - [0.0, self._profile.gravity / rate, 0.0]
        if np.abs(allowed - speed).max() < 1e-6:
            return
        _, spin = self._world.velocity()
        if touched:
            share = float(np.linalg.norm(allowed) / np.linalg.norm(speed))
            kept = blend(self._before.quaternions, pose.quaternions, share)
            turn = kept[0]
            self._world.bend(kept[1:], np.zeros((len(JOINTS) - 1, 3)))
        self._world.move(self._before.root + allowed / rate, turn, allowed, spin)
        self.pose = self._world.pose()

    def pushed(self, pose: Pose, way: Array) -> float:
        """Return how fast along a level unit vector (3,) the body, now in a pose, was moved in the step since command
        beyond what it wants there, which is anything from rest to its command, m/s."""
        moved = float((pose.root - self._before.root) @ way) * FPS * self._profile.substeps
        wanted = float(self._sent @ way)
        return moved - max(min(wanted, 0.0), min(moved, max(wanted, 0.0)))

    def shift(self, pose: Pose, way: Array) -> None:
        """Put the body, now in a pose, elsewhere by a way (3,), metres."""
        self._world.move(pose.root + way, pose.quaternions[0], *self._world.velocity())

    def _allowed(self, speed: Array) -> Array:
        """(3,) the part of a root velocity that contact may cause."""
        profile = self._profile
        falling = self._sent[1] - profile.gravity / (FPS * profile.substeps)
        x, z = _level(speed, profile.max_speed)
        return np.array([x, max(min(falling, -profile.max_lift), min(speed[1], profile.max_lift)), z])

    def _root_velocity(self, horizontal: Array | None, reflex: Reflex) -> Array:
        x, y, z = self._world.velocity()[0].tolist()
        if horizontal is not None:
            x, z = _level(horizontal, self._profile.max_speed)
        y = max(-self._profile.max_fall, min(y, self._profile.max_rise))
        if reflex.lift:
            y = min(reflex.lift * FPS * self._profile.substeps, self._profile.max_lift)
        return np.array([x, y, z])


def _level(velocity: Array, most: float) -> tuple[float, float]:
    """Return the x and z of a velocity (3,), shortened to at most so much."""
    x, _, z = velocity.tolist()
    share = min(1.0, most / max(math.hypot(x, z), 1e-12))
    return share * x, share * z
