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
from numpy.typing import NDArray

from humanclaw import Motion
from humanclaw.body import (
    FPS,
    JOINT_INDEX,
    JOINTS,
    OFFSETS,
    PARENTS,
    SOLE,
    TOE_SOLE,
    Array,
    matrix_from_vector,
    support_height,
    vector_from_matrix,
    yaw_matrix,
)
from humanclaw_train.mocap import MocapError, Rest, SourceMotion

# -- which source joint plays which of ours ----------------------------------------------------------------------------
_CENTRE: Final = ("pelvis", "spine1", "spine2", "spine3", "neck", "head")
_LIMBS: Final = ("hip", "knee", "ankle", "foot", "collar", "shoulder", "elbow", "wrist", "hand")


def _naming(centre: str, left: str, right: str) -> Mapping[str, str]:
    """Our joint names to the source's; "-" where it has none."""
    names = dict(zip(_CENTRE, centre.split(), strict=True))
    for side, words in (("left", left), ("right", right)):
        names |= {f"{side}_{limb}": word for limb, word in zip(_LIMBS, words.split(), strict=True)}
    return MappingProxyType({ours: theirs for ours, theirs in names.items() if theirs != "-"})


def _sided(centre: str, limbs: str, left: str, right: str) -> Mapping[str, str]:
    return _naming(centre, limbs.replace("*", left), limbs.replace("*", right))


NAMINGS: Final = (
    _sided("root lowerback upperback thorax lowerneck head",
           "*femur *tibia *foot *toes *clavicle *humerus *radius *hand *fingers", "l", "r"),
    _sided("Hips LowerBack Spine Spine1 Neck Head",
           "*UpLeg *Leg *Foot *ToeBase *Shoulder *Arm *ForeArm *Hand *HandIndex1", "Left", "Right"),
    _naming("Hips lowerback Chest Chest2 lowerneck Head",
            "LeftHip LeftKnee LeftAnkle LeftToe LeftCollar LeftShoulder LeftElbow LeftWrist LFingers",
            "RightHip RightKnee RightAnkle RightToe RightCollar RightShoulder RightElbow RightWrist RFingers"),
    _sided("CC_Base_Hip CC_Base_Waist CC_Base_Spine01 CC_Base_Spine02 CC_Base_NeckTwist01 CC_Base_Head",
           "CC_Base_*_Thigh CC_Base_*_Calf CC_Base_*_Foot CC_Base_*_ToeBase CC_Base_*_Clavicle CC_Base_*_Upperarm "
           "CC_Base_*_Forearm CC_Base_*_Hand CC_Base_*_Mid1", "L", "R"),
    _sided("pelvis spine - spine.001 neck face",
           "thigh.* shin.* foot.* foot.*_end shoulder.* upper_arm.* forearm.* forearm.*_end -", "L", "R"),
    _sided("root - - chest neck -", "*_hip *_knee *_ankle *_toe - *_shoulder *_elbow *_wrist -", "left", "right"),
    MappingProxyType({name: name for name in JOINTS}),
)  # fmt: skip
"""The naming conventions that are recognised: CMU and HDM05 ASF, three CMU BVH conversions, ReActIdle, humanoid3d,
SMPL."""

_SIDES: Final = ("left", "right")
_NEEDED: Final = (
    "pelvis", *(f"{side}_{limb}" for side in _SIDES for limb in ("hip", "knee", "ankle", "shoulder", "elbow")),
)  # fmt: skip
_BONES: Final = {  # the joint whose orientation turns a bone, to the joint at the bone's far end
    f"{side}_{near}": f"{side}_{far}"
    for side in _SIDES
    for near, far in (
        ("hip", "knee"),
        ("knee", "ankle"),
        ("ankle", "foot"),
        ("shoulder", "elbow"),
        ("elbow", "wrist"),
        ("wrist", "hand"),
    )
}
_STRAIGHT: Final = 0.9995
"""Share of its length that a leg may stretch to: one that is never quite straight keeps its knee from snapping."""
_LEG: Final = float(
    np.linalg.norm(OFFSETS[JOINT_INDEX["left_knee"]]) + np.linalg.norm(OFFSETS[JOINT_INDEX["left_ankle"]])
)


def naming_of(source: SourceMotion) -> Mapping[str, str]:
    """Return the convention that names the most of this source's joints; MocapError if limbs that the body needs have
    no name in it."""
    best = max(NAMINGS, key=lambda naming: sum(name in source.joints for name in naming.values()))
    missing = [f"{name} ({best.get(name, '-')})" for name in _NEEDED if best.get(name) not in source.joints]
    if missing:
        raise MocapError(
            f"{source.source or 'This skeleton'} has no joints for {', '.join(missing)}; "
            f"it has {', '.join(source.joints[:12])} ...",
            "Rename its joints to the SMPL names of humanclaw.body.JOINTS.",
        )
    return MappingProxyType({ours: theirs for ours, theirs in best.items() if theirs in source.joints})


# -- the steps ---------------------------------------------------------------------------------------------------------
def retarget(source: SourceMotion) -> Motion:
    """Source motion to our body at 30 fps: start over the origin, lowest stance sole at height 0, feet level where they
    stand.

    Root travel is scaled by the ratio of leg lengths. Raises MocapError for a skeleton that no naming fits.
    """
    return _settled(_plant(_body(resample(source))).motion())


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
    x = _unit(matrix[..., :, 0])
    y = _unit(matrix[..., :, 1] - np.sum(x * matrix[..., :, 1], -1, keepdims=True) * x)
    return np.stack([x, y, np.cross(x, y)], -1)


def _unit(vector: Array) -> Array:
    return np.asarray(vector / np.maximum(np.linalg.norm(vector, axis=-1, keepdims=True), 1e-12))


def _swing(start: Array, end: Array) -> Array:
    """(..., 3, 3) the least rotation that carries direction start to direction end."""
    start, end = np.broadcast_arrays(_unit(start), _unit(end))
    axis = np.cross(start, end)
    x, y, z = np.moveaxis(axis, -1, 0)
    zero = np.zeros_like(x)
    cross = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], -1).reshape(*axis.shape[:-1], 3, 3)
    cos = np.sum(start * end, -1)[..., None, None]
    return np.asarray(np.eye(3) + cross + cross @ cross / np.maximum(1.0 + cos, 1e-6))


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
            result[joint] = _swing(ours, bone) @ result[joint]
    return result


def _body(source: SourceMotion) -> _Pose:
    """Orientations by the reference pose, root by the scaled middle of the hips, legs onto the scaled ankles."""
    cast = _Cast.of(source)
    reference = _reference(source.rest, cast)
    roles = [cast.index[name] for name in JOINTS]
    world = source.rotations[:, roles] @ np.swapaxes(source.rest.rotations[roles], -1, -2) @ reference
    for joint, name in enumerate(JOINTS):
        bone = cast.bone(name, source.positions)
        if bone is not None:  # exact even where bones stretch
            world[:, joint] = _swing(world[:, joint] @ OFFSETS[JOINT_INDEX[_BONES[name]]], bone) @ world[:, joint]
    points = source.positions * (_LEG / leg_length(source))
    hips = 0.5 * (points[:, cast.index["left_hip"]] + points[:, cast.index["right_hip"]])
    middle = 0.5 * (OFFSETS[JOINT_INDEX["left_hip"]] + OFFSETS[JOINT_INDEX["right_hip"]])
    root = hips - world[:, 0] @ middle
    for side in _SIDES:
        world = _reach(root, world, side, points[:, cast.index[f"{side}_ankle"]])
    return _Pose(root, world)


def leg_length(source: SourceMotion) -> float:
    """Median length of thigh and shin together, in the source's unit."""
    cast = _Cast.of(source)
    bones = [cast.bone(f"{side}_{near}", source.positions) for side in _SIDES for near in ("hip", "knee")]
    return 0.5 * sum(float(np.median(np.linalg.norm(bone, axis=-1))) for bone in bones if bone is not None)


def _local(world: Array) -> Array:
    """(T, 24, 3, 3) world orientations to (T, 24, 3) local rotation vectors."""
    parents = world[:, [max(parent, 0) for parent in PARENTS]].copy()
    parents[:, 0] = np.eye(3)
    return vector_from_matrix(np.swapaxes(parents, -1, -2) @ world)


def _reach(root: Array, world: Array, side: str, ankle: Array) -> Array:
    """Two-bone inverse kinematics: turn one leg so that its ankle lies at (T, 3) `ankle`, the knee bending in its old
    plane."""
    hip, knee, foot = (JOINT_INDEX[f"{side}_{name}"] for name in ("hip", "knee", "ankle"))
    thigh, shin = np.linalg.norm(OFFSETS[knee]), np.linalg.norm(OFFSETS[foot])
    start = root + world[:, 0] @ OFFSETS[hip]
    reach = ankle - start
    distance = np.clip(np.linalg.norm(reach, axis=-1, keepdims=True), 0.25 * (thigh + shin), _STRAIGHT * (thigh + shin))
    along = _unit(reach)
    hinge = world[:, hip, :, 0] + world[:, knee, :, 0]  # turns less than any other part of a leg, even in a deep squat
    forward = _unit(np.cross(along, hinge))
    cos = (thigh**2 + distance**2 - shin**2) / (2 * thigh * distance)
    bend = thigh * (cos * along + np.sqrt(np.maximum(1 - cos**2, 0.0)) * forward)
    result = world.copy()
    result[:, hip] = _swing(world[:, hip] @ OFFSETS[knee], bend) @ world[:, hip]
    result[:, knee] = _swing(world[:, knee] @ OFFSETS[foot], distance * along - bend) @ world[:, knee]
    return result


# -- feet and floor ----------------------------------------------------------------------------------------------------
_CONTACT_SPEED: Final = 0.25
"""A toe base slower than this stands, metres a second; measured: standing feet move at 0.06, swinging ones above 1."""
_LEVEL_TILT: Final = 0.35
"""A standing foot tilted less than this is flat on the floor, radians; a lifted heel tilts more."""
_FLAT_RANGE: Final = 0.07
"""Standing toes that differ in height by less than this stand on one floor, metres; a stair is at least 0.1."""
_LIFTED: Final = 0.05
"""A toe this far above a known floor is in the air however slowly it moves, metres."""
_FADE: Final = 6
"""Frames in which a levelled foot returns to its captured tilt."""
_UP: Final = np.array([0.0, 1.0, 0.0])
_UNDERSIDE: Final = (("ankle", (0.0, -SOLE, -0.06)), ("foot", (0.0, -TOE_SOLE, 0.0)), ("foot", (0.0, -TOE_SOLE, 0.09)))


@dataclass(frozen=True)
class _Pose:
    """Root (T, 3) and world orientations (T, 24, 3, 3) of a motion that is being worked on."""

    root: Array
    world: Array

    def motion(self) -> Motion:
        return Motion(self.root, _local(self.world))

    def at(self, joint: str, offset: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Array:
        """(T, 3) world position of a point in a joint's frame."""
        index = JOINT_INDEX[joint]
        point = self.world[:, index] @ np.array(offset)
        while PARENTS[index] >= 0:
            point = point + self.world[:, PARENTS[index]] @ OFFSETS[index]
            index = PARENTS[index]
        return np.asarray(self.root + point)

    def turned(self, joint: str, turn: Array) -> _Pose:
        """One joint's orientation replaced; the others keep theirs."""
        world = self.world.copy()
        world[:, JOINT_INDEX[joint]] = turn
        return replace(self, world=world)


def _bridged(mask: NDArray[np.bool_], points: Array, frames: int = 4, metres: float = 0.02) -> NDArray[np.bool_]:
    """Return the mask with gaps filled that are shorter than any step and in which the point hardly moves."""
    filled = mask.copy()
    for gap in _runs(~mask, least=1):
        inner = gap.start > 0 and gap.stop < len(mask) and gap.stop - gap.start < frames
        if inner and np.linalg.norm(points[gap.stop] - points[gap.start - 1]) < metres:
            filled[gap] = True
    return filled


def _runs(mask: NDArray[np.bool_], least: int = 3) -> list[slice]:
    """Return the stretches of at least `least` frames in which the mask holds."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]])))
    return [slice(first, last) for first, last in edges.reshape(-1, 2) if last - first >= least]


def _slow(pose: _Pose, joint: str) -> NDArray[np.bool_]:
    """(T,) when a joint of the foot stands still, short flickers bridged."""
    points = pose.at(joint)
    if len(points) < 3:
        return np.zeros(len(points), bool)
    return _bridged(np.linalg.norm(np.gradient(points, axis=0), axis=-1) * FPS < _CONTACT_SPEED, points)


def _bearing(pose: _Pose, side: str, floor: float | None) -> NDArray[np.bool_]:
    """(T,) when a foot bears: its ball stands still and, where the floor is known, is not held in the air."""
    toe = f"{side}_foot"
    slow = _slow(pose, toe)
    if floor is not None:
        slow &= pose.at(toe)[:, 1] < floor + TOE_SOLE + _LIFTED
    return _mask(_runs(slow), len(slow))


def _between(runs: list[slice], values: Array, fade: int | None = None) -> Array:
    """(T, n) values kept inside the runs and interpolated across the gaps; zero where there is no run at all.

    With `fade` they die away within that many frames of a run.
    """
    known = _mask(runs, len(values))
    if not known.any():
        return np.zeros_like(values)
    frames, inside = np.arange(len(values)), np.flatnonzero(known)
    filled = np.stack([np.interp(frames, inside, column[known]) for column in values.T], -1)
    if fade is None:
        return filled
    after = np.clip(np.searchsorted(inside, frames), 0, len(inside) - 1)
    away = np.minimum(np.abs(inside[after] - frames), np.abs(inside[np.maximum(after - 1, 0)] - frames))
    weight = np.clip(1.0 - away / (fade + 1), 0.0, 1.0)[:, None]
    return np.asarray(filled * weight * weight * (3.0 - 2.0 * weight))


def _mask(runs: list[slice], length: int) -> NDArray[np.bool_]:
    mask = np.zeros(length, bool)
    for run in runs:
        mask[run] = True
    return mask


def _plant(pose: _Pose) -> _Pose:
    """Level the feet where they stand, hold them still there, and let the legs follow."""
    for side in _SIDES:
        pose = _calibrated(pose, side)
    floor = _one_floor(pose)
    for side in _SIDES:
        pose = _levelled(pose, side, floor)
    shifts = {side: _hold(pose, side, _runs(_bearing(pose, side, floor)), floor) for side in _SIDES}
    # What both feet agree on is the root's error, not the legs'.
    common = float(np.median(np.concatenate([shift[:, 1] for shift in shifts.values()])))
    ankles = {side: pose.at(f"{side}_ankle") + shift for side, shift in shifts.items()}
    root = pose.root + [0.0, common, 0.0]
    root = root - _overreach(replace(pose, root=root), ankles)[:, None] * _UP
    world = pose.world
    for side, ankle in ankles.items():
        world = _reach(root, world, side, ankle)
    return _Pose(root, world)


def _calibrated(pose: _Pose, side: str) -> _Pose:
    """Make the sole level in the clip's flattest stances: sources disagree on how far above the toe an ankle lies."""
    frames = np.flatnonzero(_bearing(pose, side, None))
    if not len(frames):
        return pose
    rise = (pose.at(f"{side}_ankle") - pose.at(f"{side}_foot"))[frames, 1]
    flattest = frames[rise <= np.percentile(rise, 10) + 0.015]
    for joint in (f"{side}_ankle", f"{side}_foot"):
        turn = pose.world[:, JOINT_INDEX[joint]]
        up = np.median(turn[flattest, 1, :], axis=0)  # the vertical, in the foot's frame
        pose = pose.turned(joint, turn @ _swing(_UP, up))
    return pose


def _levelled(pose: _Pose, side: str, floor: float | None) -> _Pose:
    """Lay each flat stance exactly level, and toes whenever they bear; outside the stances the correction fades
    away."""
    bears = _bearing(pose, side, floor)
    flat = bears & _slow(pose, f"{side}_ankle")
    for joint, stands, most in ((f"{side}_ankle", flat, _LEVEL_TILT), (f"{side}_foot", bears, 1.0)):
        turn = pose.world[:, JOINT_INDEX[joint]]
        level = _runs(stands & (np.arccos(np.clip(turn[:, 1, 1], -1.0, 1.0)) < most))
        correction = _between(level, vector_from_matrix(_swing(turn[:, :, 1], _UP)), _FADE)
        pose = pose.turned(joint, matrix_from_vector(correction) @ turn)
    return pose


def _one_floor(pose: _Pose) -> float | None:
    """Height of the floor if the feet stand on one for nine tenths of the time that they stand, else None (stairs,
    blocks)."""
    toes = [pose.at(f"{side}_foot")[_bearing(pose, side, None), 1] - TOE_SOLE for side in _SIDES]
    heights = np.concatenate(toes)
    if not len(heights) or np.subtract(*np.percentile(heights, [95, 5])) > _FLAT_RANGE:
        return None
    return float(np.median(heights))


def _hold(pose: _Pose, side: str, runs: list[slice], floor: float | None) -> Array:
    """(T, 3) displacement that keeps the ball of the foot still in every stance, and no sole below the lower
    neighbouring one."""
    toe = pose.at(f"{side}_foot")
    target = toe.copy()
    for run in runs:
        target[run] = _steady(toe[run])
        target[run, 1] = np.median(toe[run, 1]) if floor is None else floor + TOE_SOLE
    shift = _between(runs, target - toe)
    if runs:
        lowest = np.min([pose.at(f"{side}_{joint}", point)[:, 1] for joint, point in _UNDERSIDE], axis=0) + shift[:, 1]
        shift[:, 1] += np.maximum(_ground(runs, target[:, 1] - TOE_SOLE) - lowest, 0.0)
    return shift


def _ground(runs: list[slice], heights: Array) -> Array:
    """(T,) height that a foot must not pass: its stance's, and between two stances the lower one's."""
    ground = np.empty(len(heights))
    ground[: runs[0].start] = heights[runs[0].start]
    for run, following in zip(runs, [*runs[1:], None], strict=True):
        ground[run] = heights[run]
        ahead = slice(run.stop, following.start if following else len(heights))
        ground[ahead] = min(heights[run.start], heights[following.start]) if following else heights[run.start]
    return ground


def _steady(points: Array, window: int = 2 * FPS) -> Array:
    """Return the mean of a short stance; the moving average of a long one, so that slow drift of the capture does not
    tear."""
    if len(points) <= window:
        return np.broadcast_to(points.mean(axis=0), points.shape)
    padded = np.pad(points, ((window // 2, window - window // 2 - 1), (0, 0)), mode="edge")
    sums = np.cumsum(np.concatenate([np.zeros((1, 3)), padded]), axis=0)
    return np.asarray((sums[window:] - sums[:-window]) / window)


def _overreach(pose: _Pose, ankles: Mapping[str, Array]) -> Array:
    """(T,) how far the pelvis must sink for both legs to reach their ankles, metres, without jerks."""
    sink = np.zeros(len(pose.root))
    for side, ankle in ankles.items():
        reach = pose.at(f"{side}_hip") - ankle
        level = np.minimum(np.linalg.norm(reach[:, [0, 2]], axis=-1), 0.9 * _LEG)
        sink = np.maximum(sink, reach[:, 1] - np.sqrt((_STRAIGHT * _LEG) ** 2 - level**2))
    wide = np.pad(sink, 6, mode="edge")
    highest = np.lib.stride_tricks.sliding_window_view(wide, 7).max(-1)
    return np.asarray(np.lib.stride_tricks.sliding_window_view(highest, 7).mean(-1))


def _settled(motion: Motion) -> Motion:
    """Floor at 0 under the lowest sole, start over the origin."""
    low = float(np.percentile(support_height(motion.joints()), 5))
    return Motion(motion.root - [motion.root[0, 0], low, motion.root[0, 2]], motion.rotations)
