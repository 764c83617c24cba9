"""A scene and its bodies in MuJoCo.

MuJoCo's contacts are springs and dampers that act once shapes overlap. A body driven by velocities would enter a wall
first and be pushed out afterwards. So contacts are made hard here and act ahead: a contact at a distance allows just
the approach that closes the distance by the end of the step.
"""

from __future__ import annotations

import logging
from collections.abc import Collection, Mapping, Sequence
from copy import copy
from typing import Final

import mujoco as mj
import numpy as np
from numpy.typing import NDArray

from humanclaw import Scene
from humanclaw.body import Array, matrix_from_quaternion
from humanclaw.storage import source_digest
from humanclaw.world import LEVEL, TOUCHING, HalfPhysics, Kinematic, ObjectMotion, Pose, Profile, Touch
from humanclaw_mujoco.contacts import body_contacts, harden, harden_stops, let_slide
from humanclaw_mujoco.model import FIXED_GROUP, Model, build
from humanclaw_mujoco.sleep import Sleep

_LOG: Final = logging.getLogger(__name__)
_LIMIT: Final = int(mj.mjtConstraint.mjCNSTR_LIMIT_JOINT)
"""As a number: comparing an array with MuJoCo's own enumeration takes a Python call for each element."""
_FASTEST: Final = 50.0
"""Speed of an object along each axis, m/s and rad/s, that contacts may cause."""
_XYZW: Final = [1, 2, 3, 0]
_WXYZ: Final = [3, 0, 1, 2]
"""Orders of a quaternion's numbers: ours has the scalar last, MuJoCo's first."""
_OBJECTS: Final = np.array([group == FIXED_GROUP for group in range(6)], np.uint8)


class MujocoWorld:
    """The World of humanclaw.world on MuJoCo, as one of its bodies has it."""

    def __init__(self, model: Model, scene: Scene, profile: Profile) -> None:
        """Put a scene at rest; its bodies are nowhere yet."""
        self._model, self._m, self._d = model, model.mj, mj.MjData(model.mj)
        self._number, self._body = 0, model.bodies[0]
        self._passing: dict[int, frozenset[tuple[int, int]]] = {}
        """Links and objects that pass each other, by the number of the body."""
        self._sleep = Sleep(model)
        trees = [(np.arange(body.root_dof, body.root_dof + 6), body.spins.ravel()) for body in model.bodies]
        self._tree = np.concatenate([part for tree in trees for part in tree])
        # + 1: the pelvis's velocity along y, which is up.
        self._falls = np.where(np.isin(self._tree, [body.root_dof + 1 for body in model.bodies]), -profile.gravity, 0.0)
        self._still = {obj.id: np.array([*obj.position, *obj.rotation], float) for obj in scene.objects if obj.movable}
        free = [at + k for at, _, _ in model.movable.values() for k in range(7)]
        self._places = np.array([*free, *(at for at, _, _ in model.hinged.values())], int)
        self._loose = np.setdiff1d(np.arange(self._m.nv), self._tree)
        # NaN equals nothing, so the first look reads the places.
        self._read = np.full(len(self._places), np.nan)
        self._states: Mapping[int, Array] = self._still
        for key, (at, _, centre) in model.movable.items():
            place = self._still[key]
            self._d.qpos[at : at + 3] = place[:3] + matrix_from_quaternion(place[3:]) @ centre
            self._d.qpos[at + 3 : at + 7] = place[3:][_WXYZ]
        for at, _, leaf in model.hinged.values():
            self._d.qpos[at] = leaf.obj.state

    def stood(self, number: int, pose: Pose) -> MujocoWorld:
        """Return the same world as one of its bodies has it, which it stands in a pose, at rest."""
        world = copy(self)
        world._number, world._body = number, self._model.bodies[number]
        world.move(pose.root, pose.quaternions[0], np.zeros(3), np.zeros(3))
        world.bend(pose.quaternions[1:], np.zeros((len(pose.quaternions) - 1, 3)))
        return world

    # -- the body ------------------------------------------------------------------------------------------------------
    def pose(self) -> Pose:
        at, _, turns, _ = self._body
        qpos = self._d.qpos
        return Pose(qpos[at : at + 3].copy(), np.vstack([qpos[at + 3 : at + 7][_XYZW], qpos[turns]]))

    def velocity(self) -> tuple[Array, Array]:
        return self._moving(self._body.root, self._body.root_dof)

    def move(self, root: Array, quaternion: Array, velocity: Array, spin: Array) -> None:
        self._put(self._body.root, root, quaternion)
        self.drive(velocity, spin)

    def drive(self, velocity: Array, spin: Array) -> None:
        self._set_moving(self._body.root, self._body.root_dof, velocity, spin)

    def bend(self, quaternions: Array, speeds: Array) -> None:
        self._d.qpos[self._body.turns] = quaternions
        self._d.qvel[self._body.spins] = speeds

    # -- time ----------------------------------------------------------------------------------------------------------
    def step(self, seconds: float) -> Sequence[Touch]:
        m, d = self._m, self._d
        m.opt.timestep = seconds
        # The stages of mj_step one by one, because contacts and accelerations are changed in between.
        geoms, gaps = self._collide()
        self._harden(geoms, gaps, seconds)
        self._sleep.arrange(d, geoms, gaps)
        mj.mj_makeConstraint(m, d)
        # The margin only activates a hinge's limit early; with it MuJoCo would stop the hinge that far before it.
        d.efc_margin[d.efc_type == _LIMIT] = 0.0
        mj.mj_island(m, d)
        mj.mj_projectConstraint(m, d)
        mj.mj_fwdVelocity(m, d)
        contact, joints = d.contact, self._model.joint_of
        let_slide(geoms, contact.efc_address, contact.friction, joints, d.efc_vel, d.efc_aref, seconds)
        mj.mj_fwdActuation(m, d)
        mj.mj_fwdAcceleration(m, d)
        self._let_fall()
        mj.mj_fwdConstraint(m, d)
        touches = self._touches(geoms, gaps)
        mj.mj_Euler(m, d)
        # A cup that a foot crushes against a wall would gain speed without end.
        d.qvel[self._loose] = np.clip(d.qvel[self._loose], -_FASTEST, _FASTEST)
        return touches

    def overlaps(self) -> Sequence[Touch]:
        geoms, gaps = self._collide()
        # Nothing has made constraints of these contacts: forces are those of the last step.
        self._d.contact.efc_address[:] = -1
        return self._touches(geoms, gaps)

    def _collide(self) -> tuple[NDArray[np.int32], Array]:
        """Find the contacts: (contacts, 2) geoms, and (contacts,) distances, metres."""
        m, d = self._m, self._d
        mj.mj_kinematics(m, d)
        mj.mj_comPos(m, d)
        mj.mj_makeM(m, d)
        mj.mj_factorM(m, d)
        mj.mj_collision(m, d)
        geoms, gaps = d.contact.geom, d.contact.dist
        if self._passing:
            self._part(geoms, gaps)
        return geoms, gaps

    def _part(self, geoms: NDArray[np.int32], gaps: Array) -> None:
        """Leave out the contacts of links and objects that pass each other; their distance is infinite."""
        model = self._model
        rows = np.stack([of[geoms].max(axis=1) for of in (model.body_of, model.joint_of, model.object_of)], axis=1)
        passes = [(link, key) in self._passing.get(owner, ()) for owner, link, key in rows.tolist()]
        self._d.contact.exclude[passes] = 1
        gaps[passes] = np.inf

    def _harden(self, geoms: NDArray[np.int32], gaps: Array, seconds: float) -> None:
        """Let each contact, and the stop of each hinge, allow just the way that reaches it in this step."""
        m, contact, hinges = self._m, self._d.contact, self._model.hinges
        harden(
            geoms, gaps, contact.includemargin, contact.solref, contact.friction, self._model.friction,
            self._model.joint_of, seconds,
        )  # fmt: skip
        if len(hinges):
            harden_stops(hinges, m.jnt_qposadr, m.jnt_range, self._d.qpos, m.jnt_solref, seconds)

    def _let_fall(self) -> None:
        """Let gravity alone change a body's velocity before contacts: its limbs are driven, so they cause no recoil.

        Sleeping objects do not fall at all.
        """
        d = self._d
        d.qacc_smooth[self._tree] = self._falls
        d.qacc_smooth[self._sleep.held()] = 0.0
        mj.mj_mulM(self._m, d, d.qfrc_smooth, d.qacc_smooth)

    def _touches(self, geoms: NDArray[np.int32], gaps: Array) -> Sequence[Touch]:
        contact, model = self._d.contact, self._model
        touching = body_contacts(
            geoms, gaps, contact.pos, contact.frame, contact.efc_address, self._d.efc_force,
            model.joint_of, model.object_of, model.body_of,
        )  # fmt: skip
        return [
            Touch(int(joint), int(key), (x, y, z), (nx, ny, nz), gap, force, int(body))
            for joint, key, x, y, z, nx, ny, nz, gap, force, body in touching.tolist()
        ]

    # -- objects -------------------------------------------------------------------------------------------------------
    def touching(self) -> Collection[tuple[int, int]]:
        contact = self._d.contact
        pairs = self._model.object_of[contact.geom[(contact.dist <= TOUCHING) | (self._pushing() > 0)]]
        return {(min(pair), max(pair)) for pair in pairs.tolist() if min(pair) > 0}

    def _pushing(self) -> Array:
        """Return (contacts,) the force of each contact along its normal, newtons."""
        # Contacts without a constraint have address -1.
        return np.asarray(np.append(self._d.efc_force, 0.0)[self._d.contact.efc_address])

    def top(self, object_id: int, above: Array, below: Array) -> float | None:
        geom, face = np.zeros(1, np.int32), np.zeros(3)
        # 1: fixed geoms count. -1: no body is left out; MuJoCo returns -1, too, where a ray meets nothing.
        share = mj.mj_ray(self._m, self._d, above, below - above, _OBJECTS, 1, -1, geom, face)
        if not 0 <= share <= 1 or self._model.object_of[geom[0]] != object_id or face[1] <= LEVEL:
            return None
        return float(above[1] + share * (below[1] - above[1]))

    def motion(self, object_id: int) -> ObjectMotion:
        if object_id in self._model.hinged:
            angle_at, speed_at, leaf = self._model.hinged[object_id]
            return leaf.motion(float(self._d.qpos[angle_at]), float(self._d.qvel[speed_at]))
        at, dof, _ = self._model.movable[object_id]
        qpos = self._d.qpos
        return ObjectMotion(qpos[at : at + 3].copy(), qpos[at + 3 : at + 7][_XYZW], *self._moving(at, dof))

    def set_motion(self, object_id: int, motion: ObjectMotion) -> None:
        if object_id in self._model.hinged:
            angle_at, speed_at, leaf = self._model.hinged[object_id]
            self._d.qpos[angle_at], self._d.qvel[speed_at] = leaf.state(motion)
            return
        at, dof, _ = self._model.movable[object_id]
        self._put(at, motion.position, motion.quaternion)
        self._set_moving(at, dof, motion.velocity, motion.spin)

    def objects(self) -> Mapping[int, Array]:
        qpos = self._d.qpos[self._places]
        if not np.array_equal(qpos, self._read):
            self._read, self._states = qpos, self._placed()
        return self._states

    def _placed(self) -> Mapping[int, Array]:
        places = dict(self._still)
        if self._model.movable:
            at = np.array([place for place, _, _ in self._model.movable.values()])
            centres = np.array([centre for _, _, centre in self._model.movable.values()])
            poses = self._d.qpos[at[:, None] + np.arange(7)]
            turn = poses[:, 3:][:, _XYZW]
            corner = poses[:, :3] - np.einsum("nij,nj->ni", matrix_from_quaternion(turn), centres)
            places.update(zip(self._model.movable, np.concatenate([corner, turn], axis=1), strict=True))
        for key, (angle_at, _, leaf) in self._model.hinged.items():
            places[key] = leaf.place(float(self._d.qpos[angle_at]))
        return places

    def let_pass(self, pairs: frozenset[tuple[int, int]]) -> None:
        self._passing.pop(self._number, None)
        if pairs:
            self._passing[self._number] = pairs

    def settled(self) -> None:
        self._sleep.lull(self._d)

    def close(self) -> None:
        """Do nothing: MuJoCo frees its memory with the last reference."""

    # -- free joints ---------------------------------------------------------------------------------------------------
    def _put(self, at: int, position: Array, quaternion: Array) -> None:
        self._d.qpos[at : at + 3] = position
        self._d.qpos[at + 3 : at + 7] = np.asarray(quaternion)[_WXYZ]

    def _moving(self, at: int, dof: int) -> tuple[Array, Array]:
        """Return linear and angular velocity in the world frame. MuJoCo keeps the angular one in the joint's frame."""
        qvel, spin = self._d.qvel, np.zeros(3)
        mj.mju_rotVecQuat(spin, qvel[dof + 3 : dof + 6], self._d.qpos[at + 3 : at + 7])
        return qvel[dof : dof + 3].copy(), spin

    def _set_moving(self, at: int, dof: int, velocity: Array, spin: Array) -> None:
        turn, local = np.zeros(4), np.zeros(3)
        mj.mju_negQuat(turn, self._d.qpos[at + 3 : at + 7])
        mj.mju_rotVecQuat(local, np.asarray(spin, float), turn)
        self._d.qvel[dof : dof + 3], self._d.qvel[dof + 3 : dof + 6] = velocity, local


class _Worlds:
    """Opens worlds. Keeps the model of the last scene, so that a reset to its start is cheap."""

    def __init__(self) -> None:
        self._last: tuple[Scene, Profile, Model] | None = None

    def __call__(self, scene: Scene, profile: Profile, pose: Pose) -> MujocoWorld:
        return self.shared(scene, profile, [pose])[0]

    def shared(self, scene: Scene, profile: Profile, poses: Sequence[Pose]) -> Sequence[MujocoWorld]:
        """Open a world of several bodies, as OpenShared does."""
        known = self._last is not None and self._last[0] is scene and self._last[1] == profile
        if self._last is None or not known or len(self._last[2].bodies) != len(poses):
            self._last = scene, profile, build(scene, profile, len(poses))
        world = MujocoWorld(self._last[2], scene, profile)
        return [world.stood(number, pose) for number, pose in enumerate(poses)]


def mujoco(profile: str | Profile = "default") -> HalfPhysics:
    """Return half-physics on MuJoCo. profile: 'default', 'paper', 'reference', or constants of your own."""
    _log_warnings()
    worlds = _Worlds()
    return HalfPhysics(worlds, profile, _digest(), worlds.shared)


def kinematic(profile: str | Profile = "default") -> Kinematic:
    """Return pure kinematics on MuJoCo's collision detection. profile: as for `mujoco`; it settles objects and start
    alone."""
    _log_warnings()
    worlds = _Worlds()
    return Kinematic(worlds, profile, _digest(), worlds.shared)


def _digest() -> str:
    return source_digest(("humanclaw_mujoco",), ("mujoco", "numba"))


def _log_warnings() -> None:
    """Send MuJoCo's warnings to the log, unless the program already handles them.

    By default MuJoCo prints them to stdout, where they could break a protocol, and writes a file into the working
    directory.
    """
    if mj.get_mju_user_warning() is None:
        mj.set_mju_user_warning(_LOG.warning)
