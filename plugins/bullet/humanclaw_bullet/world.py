"""A scene and its bodies in Bullet."""

from __future__ import annotations

import tempfile
from collections.abc import Collection, Mapping, Sequence
from copy import copy
from pathlib import Path
from typing import Any, Final

import numpy as np

from humanclaw import Scene
from humanclaw.body import JOINTS, Array
from humanclaw.storage import source_digest
from humanclaw.world import LEVEL, TOUCHING, HalfPhysics, ObjectMotion, Pose, Profile, Touch, person_id
from humanclaw_bullet.body import load_body
from humanclaw_bullet.engine import Client
from humanclaw_bullet.objects import Objects

_BODY_A, _BODY_B, _LINK_A, _POINT, _NORMAL, _DISTANCE, _FORCE = 1, 2, 3, 6, 7, 8, 9
"""Fields of a row of getContactPoints."""
_ITERATIONS: Final = 200
"""Maximum of the solver, which stops early where fewer do. With Bullet's 50, stacks creep."""
_UNEVEN: Final = 32.0
"""Ratio of masses from which a light thing does not bear a heavy one that stands near its edge: 200 iterations do not
suffice there."""
_MANY_ITERATIONS: Final = 2000, 20_000
"""Least and most of the maximum in scenes of larger ratios. Five times the ratio bears 200 kg on a cup of 50 g, at
0.4 ms a step, since the solver has converged long before. With 2 t it never does: the most keeps a step at 8 ms."""
_HASTE: Final = 4
"""While bodies touch one another the maximum is so many times smaller. Their contacts never converge: the steps would
take half as long again, and links enter one another no less."""
_LINKS: Final = list(range(len(JOINTS) - 1))
"""Bullet counts the root's children from 0: the pelvis is the base and no link."""


class BulletWorld:
    """The World of humanclaw.world on Bullet, as one of its bodies has it."""

    def __init__(self, scene: Scene, profile: Profile, pose: Pose, *others: Pose) -> None:
        """Load a scene with bodies at rest in poses; this is the world of the first (see others).

        Raises SceneError for a movable object without a mass.
        """
        self._client = client = Client()
        self._seconds, self._meet, self._iterations = 0.0, False, _iterations(scene)
        client.setGravity(0, -profile.gravity, 0)
        # Pairs are sorted, because the order in which Bullet finds them may differ between runs.
        client.setPhysicsEngineParameter(
            numSubSteps=0, deterministicOverlappingPairs=1, numSolverIterations=self._iterations
        )
        self._passing: frozenset[tuple[int, int]] = frozenset()
        try:
            with tempfile.TemporaryDirectory() as folder:  # One for all files: to remove a folder takes milliseconds.
                self._objects = Objects(client, scene, Path(folder))
                bodies = [load_body(client, profile, Path(folder)) for _ in (pose, *others)]
        except BaseException:  # Whatever happens, Ctrl-C included: nobody else could free this world.
            client.close()
            raise
        self._bodies, self._body = bodies, bodies[0]
        self._objects.object_of.update((body, person_id(number)) for number, body in enumerate(bodies))
        self.others = [self._of(body) for body in bodies[1:]]
        """The same world as each other body has it."""
        for world, its in zip((self, *self.others), (pose, *others), strict=True):
            world.move(its.root, its.quaternions[0], np.zeros(3), np.zeros(3))
            world.bend(its.quaternions[1:], np.zeros((len(_LINKS), 3)))

    def _of(self, body: int) -> BulletWorld:
        world = copy(self)
        world._body = body
        return world

    def pose(self) -> Pose:
        root, turn = self._client.getBasePositionAndOrientation(self._body)
        joints = [state[0] for state in self._client.getJointStatesMultiDof(self._body, _LINKS)]
        return Pose(np.array(root), np.array([turn, *joints]))

    def velocity(self) -> tuple[Array, Array]:
        velocity, spin = self._client.getBaseVelocity(self._body)
        return np.array(velocity), np.array(spin)

    def move(self, root: Array, quaternion: Array, velocity: Array, spin: Array) -> None:
        self._client.resetBasePositionAndOrientation(self._body, root.tolist(), quaternion.tolist())
        self.drive(velocity, spin)

    def drive(self, velocity: Array, spin: Array) -> None:
        self._client.resetBaseVelocity(self._body, velocity.tolist(), spin.tolist())

    def bend(self, quaternions: Array, speeds: Array) -> None:
        self._client.resetJointStatesMultiDof(self._body, _LINKS, quaternions.tolist(), speeds.tolist())

    def step(self, seconds: float) -> Sequence[Touch]:
        if seconds != self._seconds:
            # Not numSubSteps: with it Bullet applies gravity only in the first substep.
            self._client.setPhysicsEngineParameter(fixedTimeStep=seconds)
            self._seconds = seconds
        self._client.stepSimulation()
        touches = self._touches()
        if (meet := any(touch.object_id < 0 for touch in touches)) != self._meet:
            self._meet, most = meet, self._iterations // (_HASTE if meet else 1)
            self._client.setPhysicsEngineParameter(numSolverIterations=most)
        return touches

    def overlaps(self) -> Sequence[Touch]:
        self._client.performCollisionDetection()
        return self._touches()

    def _touches(self) -> Sequence[Touch]:
        known = self._objects.object_of
        return [
            # Bullet's link -1 is the base, our joint 0.
            Touch(row[_LINK_A] + 1, known[row[_BODY_B]], row[_POINT], row[_NORMAL], row[_DISTANCE], row[_FORCE], number)
            for number, body in enumerate(self._bodies)
            for row in self._client.getContactPoints(body)
            if row[_BODY_B] in known
        ]

    def touching(self) -> Collection[tuple[int, int]]:
        # One query for all pairs is cheaper than one for each movable object.
        rows: Sequence[Any] = self._client.getContactPoints() or ()
        known = self._objects.object_of
        met = {(row[_BODY_A], row[_BODY_B]) for row in rows if row[_DISTANCE] <= TOUCHING}
        # 0 is no object, and people have negative ids.
        pairs = {(known.get(a, 0), known.get(b, 0)) for a, b in met}
        return {(min(pair), max(pair)) for pair in pairs if min(pair) > 0}

    def top(self, object_id: int, above: Array, below: Array) -> float | None:
        body, _, _, at, face = self._client.rayTest(above, below)[0]
        return float(at[1]) if self._objects.object_of.get(body) == object_id and face[1] > LEVEL else None

    def motion(self, object_id: int) -> ObjectMotion:
        return self._objects.motion(object_id)

    def set_motion(self, object_id: int, motion: ObjectMotion) -> None:
        self._objects.set_motion(object_id, motion)

    def objects(self) -> Mapping[int, Array]:
        return self._objects.states()

    def let_pass(self, pairs: frozenset[tuple[int, int]]) -> None:
        client = self._client
        for joint, object_id in sorted(pairs ^ self._passing):
            meets = (joint, object_id) not in pairs
            body, link = self._objects.link(object_id)
            client.setCollisionFilterPair(self._body, body, joint - 1, link, int(meets))
            # Asleep, a thing would not feel the speed that a hand gives it.
            state = client.ACTIVATION_STATE_ENABLE_SLEEPING if meets else client.ACTIVATION_STATE_DISABLE_SLEEPING
            client.changeDynamics(body, -1, activationState=state)
            client.changeDynamics(body, -1, activationState=client.ACTIVATION_STATE_WAKE_UP)
        self._passing = pairs

    def settled(self) -> None:
        self._objects.lull()

    def close(self) -> None:
        self._client.close()


def _iterations(scene: Scene) -> int:
    """Return the maximum of the solver in a scene."""
    masses = [obj.mass for obj in scene.objects if obj.movable and not obj.joint and scene.assets[obj.asset].hulls]
    ratio = max(masses) / min(masses) if min(masses, default=0.0) > 0 else 1.0  # Objects refuses a mass of 0.
    return int(np.clip(5 * ratio, *_MANY_ITERATIONS)) if ratio > _UNEVEN else _ITERATIONS


def bullet(profile: str | Profile = "default") -> HalfPhysics:
    """Return half-physics on Bullet. profile: 'default', 'paper', 'reference', or constants of your own."""
    return HalfPhysics(BulletWorld, profile, source_digest(("humanclaw_bullet",), ("pybullet",)), _shared)


def _shared(scene: Scene, profile: Profile, poses: Sequence[Pose]) -> Sequence[BulletWorld]:
    world = BulletWorld(scene, profile, *poses)
    return [world, *world.others]
