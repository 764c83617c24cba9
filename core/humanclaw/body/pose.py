"""Rotations, forward kinematics, canonical frames and the 219-number state of the motion model (paper, section 3.3).

Conventions: metres, radians, seconds; Y up; at yaw 0 the body faces +Z with its left towards +X; positive yaw is a left
turn. Rotations are axis-angle vectors (rotation vectors) unless a name says otherwise. Needs numpy alone.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import ClassVar, Final, TypeVar

import numpy as np
from numpy.typing import NDArray

from humanclaw.body.skeleton import JOINT_INDEX, JOINTS, N_JOINTS, OFFSETS, PARENTS, SOLE, STANDING_HEIGHT, TOE_SOLE

Array = NDArray[np.float64]
F = TypeVar("F", np.float32, np.float64)

FPS: Final = 30
"""Frames a second (paper, section 3.3)."""
WHOLE_TURN: Final = 7.0
"""Radians, a little more than a whole turn. Above it, degrees were meant."""
HISTORY: Final = 5
FUTURE: Final = 15
"""Frames that a motion continues, and those that it adds, half a second (paper, section 3.3)."""
CHUNK: Final = HISTORY + FUTURE
STATE_SIZE: Final = 3 + 3 * N_JOINTS + 3 * N_JOINTS + 3 * N_JOINTS  # 219

_FEET: Final = (
    (JOINT_INDEX["left_ankle"], SOLE), (JOINT_INDEX["right_ankle"], SOLE),
    (JOINT_INDEX["left_foot"], TOE_SOLE), (JOINT_INDEX["right_foot"], TOE_SOLE),
)  # fmt: skip
_OTHER_SIDE: Final = [
    JOINT_INDEX[name.replace("left", "?").replace("right", "left").replace("?", "right")] for name in JOINTS
]


# -- rotations ---------------------------------------------------------------------------------------------------------
def matrix_from_vector(vector: Array) -> Array:
    """Map (..., 3) rotation vectors to (..., 3, 3) matrices (Rodrigues)."""
    vector = np.asarray(vector, float)
    angle = lengths(vector)[..., None]
    safe = np.where(angle < 1e-8, 1.0, angle)
    sin = np.where(angle < 1e-8, 1.0, np.sin(angle) / safe)
    cos = np.where(angle < 1e-8, 0.5, (1 - np.cos(angle)) / safe**2)
    # The square of the cross product's matrix is v v' - |v|^2. Flat matrices: many small products are slow in numpy.
    outer = (vector[..., :, None] * vector[..., None, :]).reshape(*vector.shape[:-1], 9)
    flat = np.cos(angle) * _IDENTITY + sin * (vector @ _CROSS) + cos * outer
    return np.asarray(flat.reshape(*vector.shape, 3))


def lengths(vector: Array) -> Array:
    """Return (...) lengths of (..., n) vectors: numpy's own norm takes several times as long for few of them."""
    return np.asarray(np.sqrt(np.einsum("...i,...i->...", vector, vector)))


_IDENTITY: Final = np.eye(3).ravel()
_CROSS: Final = np.cross(np.eye(3)[:, None], np.eye(3)).swapaxes(1, 2).reshape(3, 9)
"""For each component of a vector its share of the matrix of the cross product with it, flattened."""


def vector_from_matrix(matrix: Array) -> Array:
    """Map (..., 3, 3) matrices to (..., 3) rotation vectors of length at most pi."""
    return vector_from_quaternion(quaternion_from_matrix(matrix))


def quaternion_from_matrix(matrix: Array) -> Array:
    """Map (..., 3, 3) matrices to (..., 4) unit quaternions x, y, z, w with w >= 0."""
    m = np.asarray(matrix, float)
    xx, yy, zz = m[..., 0, 0], m[..., 1, 1], m[..., 2, 2]
    # One row per choice of the largest component: dividing by it is what keeps every case well conditioned.
    rows = np.empty((*m.shape[:-2], 4, 4))
    rows[..., :3, :3] = m + np.swapaxes(m, -1, -2)
    rows[..., 3, 0] = rows[..., 0, 3] = m[..., 2, 1] - m[..., 1, 2]
    rows[..., 3, 1] = rows[..., 1, 3] = m[..., 0, 2] - m[..., 2, 0]
    rows[..., 3, 2] = rows[..., 2, 3] = m[..., 1, 0] - m[..., 0, 1]
    rows[..., 0, 0], rows[..., 1, 1] = 1 + xx - yy - zz, 1 - xx + yy - zz
    rows[..., 2, 2], rows[..., 3, 3] = 1 - xx - yy + zz, 1 + xx + yy + zz
    best = np.einsum("...ii->...i", rows).argmax(-1).ravel()
    quaternion = rows.reshape(-1, 4, 4)[np.arange(best.size), best].reshape(*m.shape[:-2], 4)
    quaternion = quaternion / np.linalg.norm(quaternion, axis=-1, keepdims=True)
    return np.asarray(np.where(quaternion[..., 3:] < 0, -quaternion, quaternion))


def matrix_from_quaternion(quaternion: Array) -> Array:
    """Map (..., 4) quaternions x, y, z, w to (..., 3, 3) matrices."""
    q = np.asarray(quaternion, float)
    x, y, z, w = (q / np.linalg.norm(q, axis=-1, keepdims=True)).T
    matrix = np.empty((3, 3, *x.shape))
    matrix[0] = 1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)
    matrix[1] = 2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)
    matrix[2] = 2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)
    return np.ascontiguousarray(matrix.T.swapaxes(-1, -2))


def vector_from_quaternion(quaternion: Array) -> Array:
    """Map (..., 4) quaternions x, y, z, w to (..., 3) rotation vectors along the shortest arc."""
    q = np.asarray(quaternion, float)
    vector, w = q[..., :3], q[..., 3]
    length = lengths(vector)
    small = length < 1e-9
    scale = np.where(small, 2.0, 2 * np.arctan2(length, np.abs(w)) / np.where(small, 1.0, length))
    return np.asarray(vector * np.where(w < 0, -scale, scale)[..., None])


def wrap_angle(angle: float | Array) -> Array:
    """Return the angle of the same direction in [-pi, pi), radians."""
    return np.asarray((angle + np.pi) % (2 * np.pi) - np.pi)


def yaw_matrix(yaw: float | Array) -> Array:
    """Return the (..., 3, 3) rotation about +Y; a positive yaw turns +Z towards +X."""
    yaw = np.asarray(yaw, float)
    return matrix_from_vector(np.stack([np.zeros_like(yaw), yaw, np.zeros_like(yaw)], -1))


def heading(root_rotation: Array) -> Array:
    """Return the yaw of (..., 3) root rotation vectors, radians: that of the hip line, which bowing does not change."""
    left = matrix_from_vector(root_rotation)[..., :, 0]
    return np.asarray(np.arctan2(-left[..., 2], left[..., 0]))


# -- motion ------------------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Motion:
    """Poses at 30 frames a second in one Y-up frame.

    root: (T, 3) pelvis positions, metres. rotations: (T, 24, 3) local rotation vectors; joint 0 is the root's
    orientation.
    """

    root: Array
    rotations: Array

    def __post_init__(self) -> None:
        if self.root.ndim != 2 or self.root.shape[1] != 3 or self.rotations.shape != (len(self.root), N_JOINTS, 3):
            raise ValueError(
                f"a motion needs root (T, 3) and rotations (T, {N_JOINTS}, 3); "
                f"got {self.root.shape} and {self.rotations.shape}"
            )

    def __len__(self) -> int:
        return len(self.root)

    def __getitem__(self, frames: slice) -> Motion:
        return Motion(self.root[frames], self.rotations[frames])

    @property
    def seconds(self) -> float:
        return len(self) / FPS

    def joints(self) -> Array:
        """Compute (T, 24, 3) joint positions by forward kinematics."""
        return forward_kinematics(self.root, self.rotations)[0]

    def yaw(self) -> Array:
        """Compute (T,) heading in radians."""
        return heading(self.rotations[:, 0])

    def held(self, frames: int) -> Motion:
        """Return the last frame, so many times."""
        return Motion(np.repeat(self.root[-1:], frames, 0), np.repeat(self.rotations[-1:], frames, 0))

    def then(self, other: Motion) -> Motion:
        """Return this motion followed by the other one."""
        return Motion(np.concatenate([self.root, other.root]), np.concatenate([self.rotations, other.rotations]))


def forward_kinematics(root: Array, rotations: Array) -> tuple[Array, Array]:
    """Map (..., 3) root positions and (..., 24, 3) local rotations to (..., 24, 3) positions and (..., 24, 3, 3)
    orientations."""
    orientations = matrix_from_vector(rotations)
    for joints, parents in _LEVELS:
        orientations[..., joints, :, :] = orientations[..., parents, :, :] @ orientations[..., joints, :, :]
    positions = np.einsum("...ij,...j->...i", orientations[..., _PARENTS, :, :], OFFSETS)
    positions[..., 0, :] = root
    for joints, parents in _LEVELS:
        positions[..., joints, :] += positions[..., parents, :]
    return positions, orientations


def _levels() -> Iterator[tuple[slice, slice | list[int]]]:
    """Yield the joints as far from the pelvis as one another, and their parents, from the pelvis outwards."""
    parents = [0]
    while joints := [joint for joint in range(1, N_JOINTS) if PARENTS[joint] in parents]:
        parents = [PARENTS[joint] for joint in joints]
        run = parents == list(range(parents[0], parents[-1] + 1))
        # Slices: numpy takes several times as long for a list of indices.
        yield slice(joints[0], joints[-1] + 1), slice(parents[0], parents[-1] + 1) if run else parents
        parents = joints


_LEVELS: Final = tuple(_levels())
_PARENTS: Final = [max(parent, 0) for parent in PARENTS]


def mirrored(root: NDArray[F], rotations: NDArray[F]) -> tuple[NDArray[F], NDArray[F]]:
    """Mirror root (..., 3) and rotations (..., 24, 3) at the plane x = 0: left and right change places."""
    flipped = np.array([-1, 1, 1], root.dtype)
    return root * flipped, rotations[..., _OTHER_SIDE, :] * -flipped


def rest_pose(frames: int = 1) -> Motion:
    """Return frames of standing upright with hanging arms, the pose of a body that has not moved."""
    rotations = np.zeros((frames, N_JOINTS, 3))
    rotations[:, JOINT_INDEX["left_shoulder"]] = (0.0, 0.0, -1.25)
    rotations[:, JOINT_INDEX["right_shoulder"]] = (0.0, 0.0, 1.25)
    root = np.tile([0.0, STANDING_HEIGHT, 0.0], (frames, 1))
    return Motion(root, rotations)


def support_height(joints: Array) -> Array:
    """Map (..., 24, 3) joint positions to the height of the lowest sole, metres."""
    return np.asarray(np.min(np.stack([joints[..., joint, 1] - drop for joint, drop in _FEET], -1), axis=-1))


# -- canonical frames --------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Pose2D:
    """A place on a floor and a heading (SE(2)): (x, floor, z) in metres, yaw in radians. Also the frame that it
    spans."""

    __pydantic_config__: ClassVar = {"extra": "forbid", "allow_inf_nan": False}

    x: float = 0.0
    z: float = 0.0
    yaw: float = 0.0
    floor: float = 0.0

    @classmethod
    def of(cls, motion: Motion, index: int = -1, floor: float | None = None) -> Pose2D:
        """Return the floor-projected hip frame of one pose; without a floor the height of that pose's lowest sole."""
        frame = motion[index:] if index == -1 else motion[index : index + 1]
        if floor is None:
            floor = float(support_height(frame.joints())[0])
        return cls(float(frame.root[0, 0]), float(frame.root[0, 2]), float(frame.yaw()[0]), floor)

    @classmethod
    def of_history(cls, history: Motion) -> Pose2D:
        """Return the canonical frame of a chunk: the last history pose's hip frame, floor at the history's lowest
        sole."""
        return cls.of(history, -1, float(support_height(history.joints()).min()))

    def to_local(self, motion: Motion) -> Motion:
        """Express a motion given in the outer frame in this one."""
        turn = yaw_matrix(-self.yaw)
        return _turned(replace(motion, root=motion.root - [self.x, self.floor, self.z]), turn)

    def to_world(self, motion: Motion) -> Motion:
        """Apply the inverse of to_local."""
        turned = _turned(motion, yaw_matrix(self.yaw))
        return replace(turned, root=turned.root + [self.x, self.floor, self.z])

    def point_to_local(self, point: Array) -> Array:
        """Return (..., 3) points of the outer frame in this one."""
        return np.asarray((np.asarray(point, float) - [self.x, self.floor, self.z]) @ yaw_matrix(self.yaw))


def re_rooted(generated: Motion, simulated: Motion) -> Motion:
    """Return generated frames, moved rigidly so that the last one stands where the simulated body is.

    The motion model continues its own poses, not the simulated ones: contact bends bodies into poses that no person
    takes, and the model has never seen them. Position and heading are the simulated ones.
    """
    there = Pose2D.of(simulated, floor=float(simulated.root[-1, 1]))
    here = Pose2D.of(generated, floor=float(generated.root[-1, 1]))
    return there.to_world(here.to_local(generated))


def next_history(history: Motion, commanded: Motion, simulated: Motion, source: str = "generated") -> Motion:
    """Return the five frames that the next motion continues (world frame).

    source: `generated` for the model's own poses, re-rooted where the body is; `simulated` for the body's own, as in
    the paper (section 3.1).
    """
    if source == "simulated":
        return simulated[-HISTORY:]
    return re_rooted(history.then(commanded)[-HISTORY:], simulated)


def _turned(motion: Motion, turn: Array) -> Motion:
    rotations = motion.rotations.copy()
    rotations[:, 0] = vector_from_matrix(turn @ matrix_from_vector(motion.rotations[:, 0]))
    return Motion(motion.root @ turn.T, rotations)


# -- the state of the motion model -------------------------------------------------------------------------------------
def encode(motion: Motion) -> Array:
    """Return (T, 219) states of a motion in its canonical frame: root 3, root rotation 3, joint rotations 69, positions
    72, velocities 72.

    A velocity is the difference to the frame before, metres a frame; the first frame repeats that of the second.
    """
    joints = motion.joints()
    velocity = np.diff(joints, axis=0, prepend=joints[:1])
    if len(motion) > 1:
        velocity[0] = velocity[1]
    flat = (motion.root, motion.rotations.reshape(len(motion), -1), joints.reshape(len(motion), -1))
    return np.concatenate([*flat, velocity.reshape(len(motion), -1)], axis=1)


def decode(state: Array) -> Motion:
    """Map (T, 219) states to the motion that their root and rotations describe.

    The redundant joint positions are not read.
    """
    state = np.asarray(state, float)
    if state.ndim != 2 or state.shape[1] != STATE_SIZE:
        raise ValueError(f"a state sequence needs shape (T, {STATE_SIZE}); got {state.shape}")
    return Motion(state[:, :3].copy(), state[:, 3 : 3 + 3 * N_JOINTS].reshape(-1, N_JOINTS, 3).copy())


JERK_STRIDE: Final = 8
"""Frames between the points of the jerk's third difference: 0.27 s, the time scale of decisions."""


def pelvis_jerk(motion: Motion) -> float:
    """Return the mean third derivative of the pelvis's path, m/s^3 (paper, section 5.2); NaN for fewer than 27 frames.

    A moving average of 3 frames, then the third difference of points 8 frames apart.
    """
    return _jerk(motion.root[:, None])


def root_jerk(motion: Motion) -> float:
    """Return the mean third derivative of the body's path and orientation, m/s^3 (paper, table 2); NaN
    for fewer than 27 frames.

    As pelvis_jerk(), for all joints of the rest skeleton but the hands, which root translation and rotation carry. So
    turns count, and gait has no effect.
    """
    rest = forward_kinematics(np.zeros(3), np.zeros((N_JOINTS, 3)))[0][:22]
    return _jerk(np.einsum("tij,kj->tki", matrix_from_vector(motion.rotations[:, 0]), rest) + motion.root[:, None])


def _jerk(points: Array) -> float:
    """Return the mean jerk of (T, K, 3) points, m/s^3."""
    smooth = (points[:-2] + points[1:-1] + points[2:]) / 3
    if len(smooth) <= 3 * JERK_STRIDE:
        return float("nan")
    a, b, c, d = (smooth[k * JERK_STRIDE : len(smooth) - (3 - k) * JERK_STRIDE] for k in range(4))
    return float(np.linalg.norm(d - 3 * c + 3 * b - a, axis=-1).mean() / (JERK_STRIDE / FPS) ** 3)


def smoothstep(share: Array) -> Array:
    """Return a smooth ramp from 0 to 1 with zero slope at both ends; share is clipped to [0, 1]."""
    share = np.clip(share, 0.0, 1.0)
    return np.asarray(share * share * (3 - 2 * share))
