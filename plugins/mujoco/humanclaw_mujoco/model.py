"""Compile a scene and the body to a MuJoCo model, and map its addresses back to joints and objects."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import mujoco as mj
import numpy as np
from numpy.typing import NDArray

from humanclaw import Scene, SceneError
from humanclaw.body import JOINTS, OFFSETS, PARENTS, Array, Box, quaternion_from_matrix
from humanclaw.world import (
    LINK_OF,
    ArticulatedObject,
    Asset,
    Profile,
    SceneObject,
    box_of,
    capsule_frame,
    centre_of_mass,
    inertia,
    link_inertia,
    link_mass,
    person_id,
    solids,
)

FIXED_GROUP, BODY_GROUP = 0, 1
_MARGIN: Final = 0.03
"""Contacts are found up to this distance from the body and movable objects, metres. No link moves farther in a step."""
_IMPEDANCE: Final = (0.9999, 0.9999, 0.001, 0.5, 2.0)
"""MuJoCo's solimp at its limit of 0.9999: the hardest contacts that MuJoCo allows."""
_FIXED: Final = {"contype": 1, "conaffinity": 0, "group": FIXED_GROUP}
MOVABLE: Final = {"contype": 2, "conaffinity": 7, "group": FIXED_GROUP, "margin": _MARGIN}
HINGED: Final = MOVABLE | {"contype": 4, "conaffinity": 2}
_BODY: Final[dict[str, Any]] = {"contype": 0, "conaffinity": 7, "group": BODY_GROUP, "margin": _MARGIN}
"""All geoms collide with one another, with two exceptions: a body not with itself, and fixed and hinged geoms not
among themselves."""
_MEETS_BODIES: Final = 8
"""The first bit of contype that says which body a geom belongs to."""
_AHEAD: Final = 0.3
"""The limit of a joint becomes a constraint this far before it is reached, radians or metres."""


class BodyAddresses(NamedTuple):
    """Where a body is in MuJoCo's qpos and qvel."""

    root: int
    """First address of the pelvis's position."""
    root_dof: int
    """First address of the pelvis's velocity."""
    turns: NDArray[np.int64]
    """(23, 4) addresses of the joints' quaternions, in the order of JOINTS[1:]."""
    spins: NDArray[np.int64]
    """(23, 3) addresses of their angular velocities."""


@dataclass(frozen=True, eq=False)
class Model:
    """A compiled model. Addresses are indices into MuJoCo's qpos and qvel."""

    mj: Any
    joint_of: NDArray[np.int64]
    """Geom to the index of the joint of a body that it moves with; -1 for geoms of objects."""
    body_of: NDArray[np.int64]
    """Geom to the number of its body; -1 for geoms of objects."""
    object_of: NDArray[np.int64]
    """Geom to object id, or the `person_id` of its body."""
    friction: Array
    """(geoms,) coefficient of each surface."""
    bodies: Sequence[BodyAddresses]
    movable: Mapping[int, tuple[int, int, Array]]
    """Object id to its first addresses in qpos and qvel, and its (3,) centre of mass in the asset's frame."""
    hinged: Mapping[int, tuple[int, int, ArticulatedObject]]
    """Object id to its addresses in qpos and qvel, and its leaf."""
    hinges: NDArray[np.int64]
    """MuJoCo's joint numbers of the hinged objects, in the order of `hinged`."""


def build(scene: Scene, profile: Profile, bodies: int = 1) -> Model:
    """Compile a scene with bodies.

    Raises SceneError for a movable object without a mass, and for what MuJoCo refuses.
    """
    spec = mj.MjSpec()
    spec.option.gravity = [0.0, -profile.gravity, 0.0]
    # A row for the force along the normal, then two for friction: let_slide and body_contacts read them so.
    spec.option.cone = mj.mjtCone.mjCONE_ELLIPTIC
    spec.memory = 1 << 26
    spec.default.geom.solimp[:] = _IMPEDANCE
    spec.compiler.degree = False
    for number in range(bodies):
        _add_body(spec, profile, number, bodies)
    objects = _Objects(spec, scene)
    objects.add()
    try:
        compiled = spec.compile()
    except ValueError as error:
        raise SceneError(
            f"MuJoCo cannot compile scene {scene.name!r}: {error}", "Check that the points of its hulls are finite."
        ) from error
    return _addressed(compiled, scene, profile, objects, bodies)


def _named(joint: str, number: int) -> str:
    return f"{joint} {number}"


def _add_body(spec: Any, profile: Profile, number: int, bodies: int) -> None:
    """Add a body, which looks for contacts with those before it. number: its own, of so many."""
    links: list[Any] = []
    # No bit for the last body: none comes after it to look for it.
    own = _MEETS_BODIES << number if number < bodies - 1 else 0
    meets = _BODY | {"contype": own, "conaffinity": _BODY["conaffinity"] | _MEETS_BODIES * ((1 << number) - 1)}
    for joint, name in enumerate(JOINTS):
        parent = links[PARENTS[joint]] if joint else spec.worldbody
        body = parent.add_body(name=_named(name, number), pos=OFFSETS[joint])
        body.explicitinertial, body.mass = True, link_mass(name, profile)
        body.ipos, body.inertia = [0.0] * 3, [link_inertia(name, profile)] * 3
        body.add_joint(name=_named(name, number), type=mj.mjtJoint.mjJNT_BALL if joint else mj.mjtJoint.mjJNT_FREE)
        if name in LINK_OF:
            _add_link(body, name, _named(name, number), meets)
        links.append(body)


def _add_link(body: Any, joint: str, name: str, meets: Mapping[str, Any]) -> None:
    shape = LINK_OF[joint].shape
    if isinstance(shape, Box):
        body.add_geom(name=name, type=mj.mjtGeom.mjGEOM_BOX, size=shape.half, pos=shape.centre, **meets)
        return
    centre, turn, length = capsule_frame(shape)
    size, quaternion = [shape.radius, length / 2, 0.0], wxyz(quaternion_from_matrix(turn))
    body.add_geom(name=name, type=mj.mjtGeom.mjGEOM_CAPSULE, size=size, pos=centre, quat=quaternion, **meets)


class _Objects:
    """Adds a scene's objects to a model. Objects that share a hull share one mesh."""

    def __init__(self, spec: Any, scene: Scene) -> None:
        self._spec, self._scene, self._meshes = spec, scene, set[str]()
        self.centres: dict[int, Array] = {}
        """Id of each free movable object to its centre of mass in the asset's frame."""
        self.leaves: dict[int, ArticulatedObject] = {}

    def add(self) -> None:
        for obj in self._scene.objects:
            asset = self._scene.assets[obj.asset]
            if not asset.hulls:
                continue
            if obj.movable and obj.mass <= 0:
                said = f"movable object {obj.id} ({obj.category}) must have a positive mass; got {obj.mass} kg."
                raise SceneError(said)
            if obj.joint:
                self.leaves[obj.id] = self._add_hinged(obj, asset)
            elif obj.movable:
                self.centres[obj.id] = self._add_movable(obj, asset)
            else:
                place = {"pos": obj.position, "quat": wxyz(np.array(obj.rotation)), **_FIXED}
                self._add_hulls(self._spec.worldbody, obj, asset, np.zeros(3), place)

    def _add_movable(self, obj: SceneObject, asset: Asset) -> Array:
        hulls = solids(asset.hulls)
        centre = centre_of_mass(hulls)
        body = self._spec.worldbody.add_body(name=f"object {obj.id}")
        body.add_freejoint(name=f"object {obj.id}")
        _weigh(body, obj.mass, hulls, np.zeros(3))
        self._add_hulls(body, obj, asset, centre, dict(MOVABLE))
        return centre

    def _add_hinged(self, obj: SceneObject, asset: Asset) -> ArticulatedObject:
        """Add an object on a joint, with its frame at the joint."""
        leaf = ArticulatedObject.of(self._scene, obj)
        point, joint = leaf.point, leaf.joint
        kind = mj.mjtJoint.mjJNT_HINGE if leaf.turns else mj.mjtJoint.mjJNT_SLIDE
        body = self._spec.worldbody.add_body(name=f"object {obj.id}", pos=leaf.axis, quat=wxyz(leaf.place(0.0)[3:]))
        body.add_joint(
            name=f"object {obj.id}", type=kind, axis=joint.axis, limited=True, margin=_AHEAD,
            range=[joint.low, joint.high], frictionloss=joint.friction, damping=joint.damping,
            solimp_limit=_IMPEDANCE, solimp_friction=_IMPEDANCE,
        )  # fmt: skip
        _weigh(body, obj.mass, solids(asset.hulls), leaf.centre - point)
        self._add_hulls(body, obj, asset, point, dict(HINGED))
        return leaf

    def _add_hulls(self, body: Any, obj: SceneObject, asset: Asset, centre: Array, facts: dict[str, Any]) -> None:
        for number, hull in enumerate(solids(asset.hulls)):
            name = f"{obj.id} {number}"
            box = box_of(hull - centre)
            # Hulls that are boxes become box geoms: the engine then needs no mesh for them.
            if box is None:
                # A hull has other points about a centre of mass or a joint than in the asset's frame: a mesh for each.
                kind = f"{'movable' if obj.movable else 'fixed'} {centre.tolist() if obj.joint else ''}"
                mesh = self._mesh(f"{asset.name} {number} {kind}", hull - centre)
                body.add_geom(name=name, type=mj.mjtGeom.mjGEOM_MESH, meshname=mesh, **facts)
            else:
                body.add_geom(name=name, type=mj.mjtGeom.mjGEOM_BOX, size=box[1], **_moved(facts, box[0]))

    def _mesh(self, name: str, hull: Array) -> str:
        if name not in self._meshes:
            mesh = self._spec.add_mesh(name=name)
            mesh.uservert = hull.ravel()
            self._meshes.add(name)
        return name


def _weigh(body: Any, mass: float, hulls: Sequence[Array], centre: Array) -> None:
    """Give a MuJoCo body its mass and inertia. centre: its centre of mass in its own frame, metres."""
    matrix = inertia(hulls, mass)
    body.explicitinertial, body.mass, body.ipos = True, mass, centre
    # MuJoCo's order: the diagonal, then xy, xz and yz.
    body.fullinertia = [matrix[0, 0], matrix[1, 1], matrix[2, 2], matrix[0, 1], matrix[0, 2], matrix[1, 2]]


def _moved(facts: dict[str, Any], offset: Array) -> dict[str, Any]:
    """Return the facts for a geom that is offset from the origin of its object."""
    turn, turned = np.array(facts.get("quat", (1.0, 0.0, 0.0, 0.0))), np.zeros(3)
    mj.mju_rotVecQuat(turned, offset, turn)
    return facts | {"pos": np.array(facts.get("pos", np.zeros(3))) + turned}


def _addressed(compiled: Any, scene: Scene, profile: Profile, added: _Objects, bodies: int) -> Model:
    names = [compiled.geom(k).name.split() for k in range(compiled.ngeom)]
    joints = np.array([JOINTS.index(first) if first in JOINTS else -1 for first, _ in names])
    owners = np.array([int(number) if first in JOINTS else -1 for first, number in names])
    objects = np.array([person_id(int(last)) if first in JOINTS else int(first) for first, last in names])
    friction = np.array([scene.by_id[key].friction if key > 0 else profile.friction for key in objects.tolist()])
    at, dof = compiled.jnt_qposadr, compiled.jnt_dofadr
    hung = {key: compiled.joint(f"object {key}").id for key in (*added.centres, *added.leaves)}
    movable = {key: (int(at[hung[key]]), int(dof[hung[key]]), centre) for key, centre in added.centres.items()}
    hinged = {key: (int(at[hung[key]]), int(dof[hung[key]]), leaf) for key, leaf in added.leaves.items()}
    return Model(
        compiled, joints, owners, objects, friction, [_body_addresses(compiled, number) for number in range(bodies)],
        movable, hinged, np.array([hung[key] for key in hinged], int),
    )  # fmt: skip


def _body_addresses(compiled: Any, number: int) -> BodyAddresses:
    at, dof = compiled.jnt_qposadr, compiled.jnt_dofadr
    joints = [compiled.joint(_named(name, number)).id for name in JOINTS]
    turns = np.array([[at[k] + i for i in (1, 2, 3, 0)] for k in joints[1:]])
    spins = np.array([[dof[k] + i for i in range(3)] for k in joints[1:]])
    return BodyAddresses(int(at[joints[0]]), int(dof[joints[0]]), turns, spins)


def wxyz(quaternion: Array) -> Sequence[float]:
    """Return a quaternion x, y, z, w in MuJoCo's order w, x, y, z."""
    x, y, z, w = (float(number) for number in quaternion)
    return [w, x, y, z]
