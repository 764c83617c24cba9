"""The objects of a scene in Bullet, and the motion of the movable ones."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np

from humanclaw import Scene, SceneError
from humanclaw.body import Array, matrix_from_quaternion
from humanclaw.world import ArticulatedObject, Asset, ObjectMotion, SceneObject, box_of, centre_of_mass, inertia, solids
from humanclaw_bullet.engine import Client

_MOVING: Final = 1
"""Bullet's collision group of everything that is not fixed."""


class _Form(NamedTuple):
    """A shape as Bullet takes it: a single box stays a box, which Bullet stacks better; others become a file."""

    box: tuple[Array, Array] | None
    """Centre and half the sides."""
    text: str

    @classmethod
    def of(cls, hulls: Sequence[Array]) -> _Form:
        box = box_of(hulls[0]) if len(hulls) == 1 else None
        return cls(box, "" if box else wavefront(hulls))


class _Forms:
    """The shapes of a scene, worked out once for all its worlds: a reset makes a new one."""

    def __init__(self, scene: Scene) -> None:
        hulls = {name: solids(asset.hulls) for name, asset in scene.assets.items()}
        solid = [obj for obj in scene.objects if hulls[obj.asset]]
        self.fixed = {
            name: [_Form.of([hull]) for hull in hulls[name]] for name in {o.asset for o in solid if not o.movable}
        }
        """Name of an asset to the forms of its hulls."""
        self.centres = {
            name: centre_of_mass(hulls[name]) for name in {o.asset for o in solid if o.movable and not o.joint}
        }
        """Name of an asset to its centre of mass."""
        self.free = {name: _Form.of([hull - centre for hull in hulls[name]]) for name, centre in self.centres.items()}
        """Name of an asset to the form of all its hulls about that centre."""
        leaves = {obj.id: ArticulatedObject.of(scene, obj) for obj in solid if obj.joint}
        self.hung = {
            key: _Form.of([hull - leaf.point for hull in hulls[leaf.obj.asset]]) for key, leaf in leaves.items()
        }
        """Id of an object on a joint to the form of all its hulls about the joint."""
        self.inertia = {key: np.diag(inertia(hulls[leaf.obj.asset], leaf.obj.mass)) for key, leaf in leaves.items()}


_KNOWN: Final[WeakKeyDictionary[Scene, _Forms]] = WeakKeyDictionary()
"""The shapes of each scene. Freed with the scene."""


class Objects:
    """The objects of a scene as Bullet bodies. Objects of one asset share its shapes."""

    def __init__(self, client: Client, scene: Scene, folder: Path) -> None:
        """folder: for files that Bullet reads meanwhile."""
        self._client, self._scene, self._files = client, scene, folder
        self._forms = _KNOWN.get(scene) or _KNOWN.setdefault(scene, _Forms(scene))
        self._pieces: dict[str, list[int]] = {}
        self._whole: dict[str, int] = {}
        self.object_of: dict[int, int] = {}
        """Bullet body to object id. A fixed object has one body per hull."""
        self._movable: dict[int, tuple[int, Array]] = {}
        self._hinged: dict[int, tuple[int, ArticulatedObject]] = {}
        self._still: dict[int, Array] = {}
        self._read: tuple[list[Any], list[float]] = [], []
        self._states: Mapping[int, Array] = {}
        # With caching, Bullet reads a file only once, but never frees it; switching caching off frees it.
        client.setPhysicsEngineParameter(enableFileCaching=1)
        for obj in scene.objects:
            self._add(obj)
        client.setPhysicsEngineParameter(enableFileCaching=0)

    def _add(self, obj: SceneObject) -> None:
        asset = self._scene.assets[obj.asset]
        if obj.movable:
            self._still[obj.id] = np.array([*obj.position, *obj.rotation], float)
        if not asset.hulls:
            return
        if obj.movable and obj.mass <= 0:
            said = f"movable object {obj.id} ({obj.category}) must have a positive mass; got {obj.mass} kg."
            raise SceneError(said)
        if obj.joint:
            self._add_hinged(obj)
        elif obj.movable:
            self._add_movable(obj, asset)
        else:
            self._add_fixed(obj, asset)

    def _add_fixed(self, obj: SceneObject, asset: Asset) -> None:
        if asset.name not in self._pieces:
            self._pieces[asset.name] = [self._shape(form) for form in self._forms.fixed[asset.name]]
        for shape in self._pieces[asset.name]:
            body = self._client.createMultiBody(0, shape, -1, obj.position, obj.rotation, useMaximalCoordinates=1)
            # Asleep. Otherwise Bullet updates the fixed body in every step, and objects on it never come to rest.
            self._client.changeDynamics(
                body, -1, lateralFriction=obj.friction, activationState=self._client.ACTIVATION_STATE_SLEEP
            )
            self.object_of[body] = obj.id

    def _add_movable(self, obj: SceneObject, asset: Asset) -> None:
        if asset.name not in self._whole:
            self._whole[asset.name] = self._shape(self._forms.free[asset.name])
        shape, centre = self._whole[asset.name], self._forms.centres[asset.name]
        position = np.array(obj.position) + matrix_from_quaternion(np.array(obj.rotation)) @ centre
        body = self._client.createMultiBody(
            obj.mass, shape, -1, position, obj.rotation, useMaximalCoordinates=1,
            flags=self._client.URDF_ENABLE_SLEEPING,
        )  # fmt: skip
        # Without a little rolling friction, a knocked-over cup would roll forever and never sleep.
        self._client.changeDynamics(
            body, -1, lateralFriction=obj.friction, rollingFriction=0.002, spinningFriction=0.002,
            activationState=self._client.ACTIVATION_STATE_ENABLE_SLEEPING,
        )  # fmt: skip
        self.object_of[body] = obj.id
        self._movable[obj.id] = body, centre

    def _add_hinged(self, obj: SceneObject) -> None:
        """Add a fixed post at the joint, and the object as its link, with its frame also at the joint."""
        client, leaf = self._client, ArticulatedObject.of(self._scene, obj)
        body = client.createMultiBody(
            0, -1, -1, leaf.axis, leaf.place(0.0)[3:], linkMasses=[obj.mass],
            linkCollisionShapeIndices=[self._shape(self._forms.hung[obj.id])],
            linkVisualShapeIndices=[-1], linkPositions=[[0, 0, 0]], linkOrientations=[[0, 0, 0, 1]],
            linkInertialFramePositions=[leaf.centre - leaf.point], linkInertialFrameOrientations=[[0, 0, 0, 1]],
            linkParentIndices=[0], linkJointAxis=[leaf.joint.axis],
            linkJointTypes=[client.JOINT_REVOLUTE if leaf.turns else client.JOINT_PRISMATIC],
            flags=client.URDF_ENABLE_SLEEPING,
        )  # fmt: skip
        client.changeDynamics(
            body, 0, lateralFriction=obj.friction, jointLowerLimit=leaf.joint.low, jointUpperLimit=leaf.joint.high,
            jointDamping=leaf.joint.damping, linearDamping=0, angularDamping=0,
            # Bullet would take the inertia of a box around the hulls.
            localInertiaDiagonal=self._forms.inertia[obj.id],
        )  # fmt: skip
        # A motor that wants to stand still with a bounded force does what friction does.
        client.setJointMotorControl2(body, 0, client.VELOCITY_CONTROL, targetVelocity=0, force=leaf.joint.friction)
        client.resetJointState(body, 0, leaf.obj.state)
        # The link is in no group and asks only for moving bodies; Bullet lets two meet if either asks for the other.
        client.setCollisionFilterGroupMask(body, 0, 0, _MOVING)
        self.object_of[body] = obj.id
        self._hinged[obj.id] = body, leaf

    def _shape(self, form: _Form) -> int:
        """Make a shape. Several hulls come through a file, in which each is a named object: Bullet accepts them in one
        shape only from there, and never frees hulls that are passed as points."""
        client = self._client
        if form.box:
            centre, half = form.box
            return int(client.createCollisionShape(client.GEOM_BOX, halfExtents=half, collisionFramePosition=centre))
        path = self._files / f"{len(list(self._files.iterdir()))}.obj"
        path.write_text(form.text, encoding="utf-8")
        return int(client.createCollisionShape(client.GEOM_MESH, fileName=str(path)))

    def motion(self, object_id: int) -> ObjectMotion:
        """Return the current motion of a movable object."""
        if object_id in self._hinged:
            body, leaf = self._hinged[object_id]
            return leaf.motion(*self._client.getJointState(body, 0)[:2])
        body, _ = self._movable[object_id]
        position, quaternion = self._client.getBasePositionAndOrientation(body)
        velocity, spin = self._client.getBaseVelocity(body)
        return ObjectMotion(*map(np.array, (position, quaternion, velocity, spin)))

    def set_motion(self, object_id: int, motion: ObjectMotion) -> None:
        """Set the motion of a movable object; one on a joint follows as far as that allows."""
        if object_id in self._hinged:
            body, leaf = self._hinged[object_id]
            self._client.resetJointState(body, 0, *leaf.state(motion))
            return
        body, _ = self._movable[object_id]
        self._client.resetBasePositionAndOrientation(body, motion.position, motion.quaternion)
        self._client.resetBaseVelocity(body, motion.velocity, motion.spin)

    def link(self, object_id: int) -> tuple[int, int]:
        """Return the Bullet body and link of a movable object."""
        hinged = object_id in self._hinged
        return (self._hinged if hinged else self._movable)[object_id][0], 0 if hinged else -1

    def lull(self) -> None:
        """Let objects at rest sleep until something touches them: asleep they cost almost nothing."""
        # Exactly 0: what topples or rises slowly would hang in mid-air.
        for body, _ in self._movable.values():
            if not np.any(self._client.getBaseVelocity(body)):
                self._client.changeDynamics(body, -1, activationState=self._client.ACTIVATION_STATE_SLEEP)
        for body, _ in self._hinged.values():
            if not self._client.getJointState(body, 0)[1]:
                self._client.changeDynamics(body, -1, activationState=self._client.ACTIVATION_STATE_SLEEP)

    def states(self) -> Mapping[int, Array]:
        """Return movable object id to (7,) position and quaternion of the asset's own frame: the same mapping as long
        as none has moved."""
        poses = [self._client.getBasePositionAndOrientation(body) for body, _ in self._movable.values()]
        angles = [self._client.getJointState(body, 0)[0] for body, _ in self._hinged.values()]
        if (poses, angles) != self._read or not self._states:
            self._read, self._states = (poses, angles), self._placed(poses, angles)
        return self._states

    def _placed(self, poses: Sequence[Any], angles: Sequence[float]) -> Mapping[int, Array]:
        places = dict(self._still)
        if poses:
            centres = np.array([centre for _, centre in self._movable.values()])
            position, turn = np.array([pose[0] for pose in poses]), np.array([pose[1] for pose in poses])
            corner = position - np.einsum("nij,nj->ni", matrix_from_quaternion(turn), centres)
            places.update(zip(self._movable, np.concatenate([corner, turn], axis=1), strict=True))
        for (key, (_, leaf)), angle in zip(self._hinged.items(), angles, strict=True):
            places[key] = leaf.place(angle)
        return places


def wavefront(hulls: Sequence[Array]) -> str:
    """Return an OBJ file of the hulls. Bullet only uses the points, so the faces are a fan that names every vertex."""
    lines, first = [], 1
    for number, hull in enumerate(hulls):
        lines.append(f"o hull{number}")
        lines += [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in hull]
        lines += [f"f {first} {first + k} {first + k + 1}" for k in range(1, len(hull) - 1)]
        first += len(hull)
    return "\n".join(lines) + "\n"
