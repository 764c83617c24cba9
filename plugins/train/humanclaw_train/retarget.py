"""Retargeting: motion on any captured skeleton to our 24-joint body at 30 fps.

Orientations are carried over relative to a reference pose that is fitted from joint positions, so that every limb keeps
its direction and its twist; legs are then solved by two-bone inverse kinematics onto the scaled path of the source's
ankles, and feet are levelled on the floor. Metres, Y up. Needs numpy alone.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Final

import numpy as np

from humanclaw import Motion
from humanclaw.body import JOINT_INDEX, JOINTS, OFFSETS, PARENTS
from humanclaw.motion import SIDES
from humanclaw.pose import FPS, Array, support_height, yaw_matrix
from humanclaw_train.naming import naming_of
from humanclaw_train.planting import plant
from humanclaw_train.posing import LEG, Pose, reach_ankle, swing, unit
from humanclaw_train.source_motion import Rest, SourceMotion

_BONES: Final = {  # the joint whose orientation turns a bone, to the joint at the bone's far end
    f"{side}_{near}": f"{side}_{far}"
    for side in SIDES
    for near, far in (
        ("hip", "knee"),
        ("knee", "ankle"),
        ("ankle", "foot"),
        ("shoulder", "elbow"),
        ("elbow", "wrist"),
        ("wrist", "hand"),
    )
}


def retarget(source: SourceMotion) -> Motion:
    """Source motion to our body at 30 fps: start over the origin, lowest stance sole at height 0, feet level where they
    stand.

    Root travel is scaled by the ratio of leg lengths. Raises MocapError for a skeleton that no naming fits.
    """
    return _settled(plant(_body(resample(source))).motion())


def resample(source: SourceMotion, fps: float = FPS) -> SourceMotion:
    """Return the source at another rate: positions interpolated linearly, orientations along the chord of neighbouring
    frames."""
    times = np.arange(0.0, (len(source) - 1) / source.fps + 1e-9, 1.0 / fps) * source.fps
    low = np.minimum(times.astype(int), len(source) - 1)
    high, part = np.minimum(low + 1, len(source) - 1), times - low
    positions = source.positions[low] + part[:, None, None] * (source.positions[high] - source.positions[low])
    chord = source.rotations[low] + part[:, None, None, None] * (source.rotations[high] - source.rotations[low])
    return replace(source, fps=float(fps), positions=positions, rotations=_orthonormal(chord))


def _orthonormal(matrix: Array) -> Array:
    x = unit(matrix[..., :, 0])
    y = unit(matrix[..., :, 1] - np.sum(x * matrix[..., :, 1], -1, keepdims=True) * x)
    return np.stack([x, y, np.cross(x, y)], -1)


@dataclass(frozen=True)
class _Cast:
    """The source's joints that play ours: index of each role, with the nearest ancestor's where it has none."""

    index: Mapping[str, int]
    exact: frozenset[str]

    @classmethod
    def of(cls, source: SourceMotion) -> _Cast:
        naming = naming_of(source)
        index: dict[str, int] = {}
        for joint, name in enumerate(JOINTS):
            parent = JOINTS[PARENTS[joint]] if joint else ""
            index[name] = source.joints.index(naming[name]) if name in naming else index[parent]
        return cls(MappingProxyType(index), frozenset(naming))

    def bone(self, near: str, positions: Array) -> Array | None:
        """(..., 3) the source's bone that joint `near` turns, or None."""
        far = _BONES.get(near)
        if far is None or not {near, far} <= self.exact:
            return None
        bone = positions[..., self.index[far], :] - positions[..., self.index[near], :]
        return bone if float(np.median(np.linalg.norm(bone, axis=-1))) > 1e-6 else None


def _reference(rest: Rest, cast: _Cast) -> Array:
    """(24, 3, 3) our world orientations in the source's reference pose.

    Torso, head and collars stand upright and face where the hips face. Down a limb each joint begins as its parent and
    swings by the least angle that lays its bone along the source's, which leaves the twist alone.
    """
    left = rest.positions[cast.index["left_hip"]] - rest.positions[cast.index["right_hip"]]
    upright = yaw_matrix(float(np.arctan2(-left[2], left[0])))
    result = np.tile(upright, (len(JOINTS), 1, 1))
    for joint, name in enumerate(JOINTS):
        if joint and not name.endswith(("hip", "spine1", "spine2", "spine3", "neck", "head", "collar", "shoulder")):
            result[joint] = result[PARENTS[joint]]
        bone = cast.bone(name, rest.positions)
        if bone is not None:
            ours = result[joint] @ OFFSETS[JOINT_INDEX[_BONES[name]]]
            result[joint] = swing(ours, bone) @ result[joint]
    return result


def _body(source: SourceMotion) -> Pose:
    """Orientations by the reference pose, root by the scaled middle of the hips, legs onto the scaled ankles."""
    cast = _Cast.of(source)
    reference = _reference(source.rest, cast)
    roles = [cast.index[name] for name in JOINTS]
    world = source.rotations[:, roles] @ np.swapaxes(source.rest.rotations[roles], -1, -2) @ reference
    for joint, name in enumerate(JOINTS):
        bone = cast.bone(name, source.positions)
        if bone is not None:  # exact even where bones stretch
            world[:, joint] = swing(world[:, joint] @ OFFSETS[JOINT_INDEX[_BONES[name]]], bone) @ world[:, joint]
    points = source.positions * (LEG / leg_length(source))
    hips = 0.5 * (points[:, cast.index["left_hip"]] + points[:, cast.index["right_hip"]])
    middle = 0.5 * (OFFSETS[JOINT_INDEX["left_hip"]] + OFFSETS[JOINT_INDEX["right_hip"]])
    root = hips - world[:, 0] @ middle
    for side in SIDES:
        world = reach_ankle(root, world, side, points[:, cast.index[f"{side}_ankle"]])
    return Pose(root, world)


def leg_length(source: SourceMotion) -> float:
    """Median length of thigh and shin together, in the source's unit."""
    cast = _Cast.of(source)
    bones = [cast.bone(f"{side}_{near}", source.positions) for side in SIDES for near in ("hip", "knee")]
    return 0.5 * sum(float(np.median(np.linalg.norm(bone, axis=-1))) for bone in bones if bone is not None)


def _settled(motion: Motion) -> Motion:
    """Floor at 0 under the lowest sole, start over the origin."""
    low = float(np.percentile(support_height(motion.joints()), 5))
    return Motion(motion.root - [motion.root[0, 0], low, motion.root[0, 2]], motion.rotations)
