"""Retargeting: motion on any captured skeleton to our 24-joint body at 30 fps.

Orientations are transferred relative to a reference pose that is fitted to joint positions, so that every limb keeps
its direction and its twist. Then two-bone inverse kinematics puts the legs onto the scaled path of the source's ankles,
and feet are planted on the floor. Metres, Y up. Needs only numpy.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Final

import numpy as np

from humanclaw import Motion
from humanclaw.body import FPS, JOINT_INDEX, JOINTS, OFFSETS, PARENTS, Array, support_height, yaw_matrix
from humanclaw.motion import SIDES
from humanclaw_train.mocap.foot_contacts import plant
from humanclaw_train.mocap.joint_maps import naming_of
from humanclaw_train.mocap.source_motion import MocapError, Rest, SourceMotion
from humanclaw_train.mocap.world_pose import LEG, Pose, hinge_of, reach_ankle, swing, unit

_BONES: Final = {  # The joint that turns a bone, to the joint at the bone's far end.
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
_BEHIND: Final = 0.08
"""Share of a thigh by which knees may stand behind the line from hip to ankle, in the mean of a clip. Measured: up to
.06 in 200 captured clips, of people who press their knees back, and .09 in a mirrored walk."""
_FEET: Final = [JOINT_INDEX[f"{side}_foot"] for side in SIDES]
_ANKLES: Final = [JOINT_INDEX[f"{side}_ankle"] for side in SIDES]
_LEVEL: Final = np.array([1.0, 0.0, 1.0])
"""Leaves out the height: steps and travel are compared on the floor."""
_STEP: Final = 0.5
"""Speed of a standing foot against the pelvis, m/s, of a body that walks: half that of a slow walk."""
_WALKS, _ONWARD = 0.7, 0.4
"""Metres that the steps of a body lead it in one direction of its own, in sum and as a share of their way, from which
steps and travel are compared. Squats, dances and jumping jacks, whose feet slide, step to and fro."""
_STEPS: Final = 0.75
"""Share of a clip in which a body steps, from which they are compared too, if it goes nowhere."""
_SLIDES: Final = (-0.32, 0.35, 0.65)
"""Shares of its step by which a standing foot may slide: least, most, and most where the steps lead nowhere. Measured:
-.09 to .25 in the 72 clips of 230 that walk so far, .57 in a dance to and fro; 1 - k for a root that goes k times as
far: .45 to .81 at a half, -1.2 to -.38 at the double."""
_IN_PLACE: Final = 0.1
"""Share of its steps that a body travels which may as well be a treadmill's as another unit's."""
_SQUATS: Final = 0.1
"""Standard deviation of the height of the pelvis over the lowest joint, metres, of a body that squats or sits down."""
_HOVERS, _TOGETHER = 0.3, 0.9
"""Share of the hips' way by which feet may move with them, where that explains so much of the feet's variance.
Measured: .13 where it explains .6, in 221 captured clips; a backflip has -1.1 and .8. A root that stays has -1."""
_FLIES, _BORNE = 0.7, 25
"""Speed of the slowest joint, m/s, that so many percent of the frames keep under, since something bears every body.
Measured: up to .41 in 230 clips; over .7 in 169 of 180 with a root in centimetres and bones in metres, the others being
of people who hardly sway."""


def retarget(source: SourceMotion) -> Motion:
    """Move a source motion to our body at 30 fps.

    The result starts over the origin, with the lowest standing sole at height 0 and level standing feet. Root travel is
    scaled by the ratio of leg lengths. Raises MocapError for a skeleton that no naming convention fits, and for a body
    that is mirrored or whose travel does not fit its steps.
    """
    motion = _settled(plant(_body(resample(source))).motion())
    _refuse_sliding(motion, source.source)
    _refuse_hovering(motion, source.source)
    _refuse_flying(motion, source.source)
    return motion


def resample(source: SourceMotion, fps: float = FPS) -> SourceMotion:
    """Resample the source: positions linearly, orientations along the chord between frames."""
    # 1e-9: rounding must not lose the last frame.
    times = np.arange(0.0, (len(source) - 1) / source.fps + 1e-9, 1.0 / fps) * source.fps
    low = np.minimum(times.astype(int), len(source) - 1)
    high, part = np.minimum(low + 1, len(source) - 1), times - low
    positions = source.positions[low] + part[:, None, None] * (source.positions[high] - source.positions[low])
    chord = source.rotations[low] + part[:, None, None, None] * (source.rotations[high] - source.rotations[low])
    return replace(source, fps=float(fps), positions=positions, rotations=_orthonormal(chord))


def _orthonormal(matrix: Array) -> Array:
    """Make matrices (..., 3, 3) rotations again by Gram-Schmidt, from their first two columns."""
    x = unit(matrix[..., :, 0])
    y = unit(matrix[..., :, 1] - np.sum(x * matrix[..., :, 1], -1, keepdims=True) * x)
    return np.stack([x, y, np.cross(x, y)], -1)


@dataclass(frozen=True)
class _Cast:
    """The source's joints for our roles. index: of each role, or of its nearest ancestor. exact: the roles found."""

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
        """Return the source's bone that joint `near` turns (..., 3), or None."""
        far = _BONES.get(near)
        if far is None or not {near, far} <= self.exact:
            return None
        bone = positions[..., self.index[far], :] - positions[..., self.index[near], :]
        return bone if float(np.median(np.linalg.norm(bone, axis=-1))) > 1e-6 else None


def _reference(rest: Rest, cast: _Cast) -> Array:
    """Return our world orientations in the source's reference pose (24, 3, 3).

    Torso, head and collars stand upright and face where the hips face. Down a limb each joint starts as its parent and
    turns by the smallest angle that lays its bone along the source's, which leaves the twist unchanged.
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
    """Pose our body: orientations by the reference pose, root between the scaled hips, legs to the scaled ankles."""
    cast = _Cast.of(source)
    _refuse_mirrored(source, cast)
    reference = _reference(source.rest, cast)
    roles = [cast.index[name] for name in JOINTS]
    world = source.rotations[:, roles] @ np.swapaxes(source.rest.rotations[roles], -1, -2) @ reference
    for joint, name in enumerate(JOINTS):
        bone = cast.bone(name, source.positions)
        if bone is not None:  # Exact even where the source's bones stretch.
            world[:, joint] = swing(world[:, joint] @ OFFSETS[JOINT_INDEX[_BONES[name]]], bone) @ world[:, joint]
    points = source.positions * (LEG / leg_length(source))
    left, right = (points[:, cast.index[f"{side}_hip"]] for side in SIDES)
    our_left, our_right = (OFFSETS[JOINT_INDEX[f"{side}_hip"]] for side in SIDES)
    # Joints between pelvis and hips, as CMU's, may carry turns that the pelvis lacks.
    world[:, 0] = swing(world[:, 0] @ (our_left - our_right), left - right) @ world[:, 0]
    root = (left + right) / 2 - world[:, 0] @ (our_left + our_right) / 2
    for side in SIDES:
        hip, knee, ankle = (points[:, cast.index[f"{side}_{name}"]] for name in ("hip", "knee", "ankle"))
        world = reach_ankle(root, world, side, ankle, hinge_of(world, side, knee - hip, ankle - knee))
    return Pose(root, world)


def _refuse_mirrored(source: SourceMotion, cast: _Cast) -> None:
    """Raise MocapError for a body whose knees and toes point behind it."""
    place = {name: source.positions[:, index] for name, index in cast.index.items()}
    ahead = unit(np.cross(place["left_hip"] - place["right_hip"], place["head"] - place["pelvis"]))
    points = 0.0
    for side in SIDES:
        hip, knee, ankle, foot = (place[f"{side}_{name}"] for name in ("hip", "knee", "ankle", "foot"))
        thigh, leg = unit(knee - hip), unit(ankle - hip)
        bend = thigh - np.sum(thigh * leg, -1, keepdims=True) * leg
        points += float(np.mean(np.sum((bend + unit(foot - ankle)) * ahead, -1)))
    if points < -2 * _BEHIND:
        raise MocapError(
            f"{source.source or 'This motion'}: expected knees and toes before the body; they point behind it, as if "
            "left and right were exchanged.",
            "Mirror the file, or name its joints: --joint left_hip=NAME.",
        )


def _refuse_sliding(motion: Motion, name: str) -> None:
    """Raise MocapError for a motion that walks, with a travel that is not that of its steps."""
    joints = motion.joints()
    feet = joints[:, _FEET]
    # With the ankles: the toes of a swinging foot point down.
    lower = (feet + joints[:, _ANKLES])[1:, :, 1].argmin(axis=1)[:, None, None]
    moved = np.take_along_axis(np.diff(feet, axis=0), lower, axis=1)[:, 0] * _LEVEL
    step = moved - np.diff(motion.root, axis=0) * _LEVEL
    steps = np.linalg.norm(step, axis=-1) > _STEP / FPS
    left = unit((joints[1:, JOINT_INDEX["left_hip"]] - joints[1:, JOINT_INDEX["right_hip"]]) * _LEVEL)
    own = np.stack([np.sum(step * axis, axis=-1) for axis in (left, np.cross(left, [0, 1, 0]))], axis=-1)[steps]
    upright = (joints[:, JOINT_INDEX["head"], 1] > motion.root[:, 1]).all()
    onward = np.linalg.norm(own.sum(axis=0)) > max(_WALKS, _ONWARD * np.linalg.norm(own, axis=-1).sum())
    if not (upright and (onward or np.count_nonzero(steps) > _STEPS * len(steps))):
        return
    slides = float(np.median(np.sum(moved * step, axis=-1)[steps] / np.sum(step**2, axis=-1)[steps]))
    if not _SLIDES[0] <= slides <= _SLIDES[1 if onward else 2]:
        in_place = "Export it with the root's own travel, off a treadmill, in the unit of the bones."
        raise MocapError(
            f"{name or 'This motion'}: expected feet that stay where they stand; they slide by {slides:.0%} of their "
            "steps, because the root is in another unit than the bones or the walk is in place.",
            f"Divide the root's positions by {1 - slides:.3g}." if 1 - slides > _IN_PLACE else in_place,
        )


def _refuse_hovering(motion: Motion, name: str) -> None:
    """Raise MocapError for a body that squats, and whose feet rise or sink as its hips do."""
    low = motion.joints()[:, :, 1].min(axis=1)
    height = motion.root[:, 1] - low
    spread = np.cov(height, low, bias=True)
    if spread[0, 0] <= _SQUATS**2 or spread[0, 1] ** 2 <= _TOGETHER * spread[0, 0] * spread[1, 1]:
        return
    if abs(share := float(spread[0, 1] / spread[0, 0])) > _HOVERS:
        raise MocapError(
            f"{name or 'This motion'}: expected feet on the floor as the hips go down; they move by {share:.0%} of "
            "that, because the root is in another unit than the bones.",
            "Scale the root's positions.",
        )


def _refuse_flying(motion: Motion, name: str) -> None:
    """Raise MocapError for a body of which no joint stays in place."""
    slowest = np.linalg.norm(np.diff(motion.joints(), axis=0), axis=-1).min(axis=1, initial=np.inf) * FPS
    if len(slowest) and (speed := float(np.percentile(slowest, _BORNE))) > _FLIES:
        raise MocapError(
            f"{name or 'This motion'}: expected a foot or hand that bears the body; all joints together move by more "
            f"than {speed:.1f} m/s, because the root is in another unit than the bones.",
            "Divide the root's positions by 100 if they are in centimetres and the bones in metres.",
        )


def leg_length(source: SourceMotion) -> float:
    """Return the median length of thigh plus shin, in the source's unit."""
    cast = _Cast.of(source)
    bones = [cast.bone(f"{side}_{near}", source.positions) for side in SIDES for near in ("hip", "knee")]
    return 0.5 * sum(float(np.median(np.linalg.norm(bone, axis=-1))) for bone in bones if bone is not None)


def _settled(motion: Motion) -> Motion:
    """Put the floor at 0 under the lowest sole, and the start over the origin."""
    # A percentile, since single frames of captured feet go through the floor.
    low = float(np.percentile(support_height(motion.joints()), 5))
    return Motion(motion.root - [motion.root[0, 0], low, motion.root[0, 2]], motion.rotations)
