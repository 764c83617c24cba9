"""Joint names of captured skeletons: which source joint plays which of our 24 joints."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from os.path import commonprefix
from types import MappingProxyType
from typing import Final

from humanclaw.body import JOINTS
from humanclaw.motion import SIDES
from humanclaw_train.mocap.source_motion import MocapError, SourceMotion

_CENTRE: Final = ("pelvis", "spine1", "spine2", "spine3", "neck", "head")
_LIMBS: Final = ("hip", "knee", "ankle", "foot", "collar", "shoulder", "elbow", "wrist", "hand")


def _naming(centre: str, left: str, right: str) -> Mapping[str, str]:
    """Map our joint names to the source's. "-" in the arguments stands for a joint that the source lacks."""
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
    _sided("Hips Spine Spine1 Spine2 Neck Head",
           "*UpLeg *Leg *Foot *ToeBase *Shoulder *Arm *ForeArm *Hand *HandIndex1", "Left", "Right"),
    _sided("Hips Spine Spine1 Spine2 Neck Head",
           "*UpLeg *Leg *Foot *Toe *Shoulder *Arm *ForeArm *Hand -", "Left", "Right"),
    _sided("Hips Chest Chest2 Chest4 Neck Head",
           "*Hip *Knee *Ankle *Toe *Collar *Shoulder *Elbow *Wrist -", "Left", "Right"),
    _sided("Pelvis Spine Spine1 Spine2 Neck Head",
           "*Thigh *Calf *Foot *Toe0 *Clavicle *UpperArm *Forearm *Hand *Finger1", "L", "R"),
    _sided("pelvis spine_01 spine_02 spine_03 neck_01 head",
           "thigh_* calf_* foot_* ball_* clavicle_* upperarm_* lowerarm_* hand_* middle_01_*", "l", "r"),
    _sided("Hips Spine Chest UpperChest Neck Head",
           "*UpperLeg *LowerLeg *Foot *Toes *Shoulder *UpperArm *LowerArm *Hand -", "Left", "Right"),
    _sided("Hips Spine - Chest Neck Head",
           "UpperLeg_* LowerLeg_* Foot_* Toes_* Shoulder_* UpperArm_* LowerArm_* Hand_* -", "L", "R"),
    _sided("hip abdomen - chest neck head", "*Thigh *Shin *Foot - *Collar *Shldr *ForeArm *Hand -", "l", "r"),
    _sided("Hips Spine1 Spine2 Spine4 Neck Head",
           "*Thigh *Shin *Foot *Toe *Shoulder *Arm *ForeArm *Hand -", "Left", "Right"),
    _sided("Hip Ab Chest - Neck Head", "*Thigh *Shin *Foot *Toe *Shoulder *UArm *FArm *Hand -", "L", "R"),
    _sided("Pelvis Spine1 Spine2 Spine3 Neck Head",
           "*Hip *Knee *Ankle *Foot *Collar *Shoulder *Elbow *Wrist *Hand", "L", "R"),
    _sided("root - - chest neck -", "*_hip *_knee *_ankle *_toe - *_shoulder *_elbow *_wrist -", "left", "right"),
    MappingProxyType({name: name for name in JOINTS}),
)  # fmt: skip
"""Known naming conventions: CMU and HDM05 ASF, three CMU BVH conversions, ReActIdle, Mixamo, LAFAN, Xsens, Biped,
Unreal, Unity, Bandai Namco, DAZ, Rokoko, OptiTrack, SMPL's own, humanoid3d, and ours."""
_NEEDED: Final = (
    "pelvis", *(f"{side}_{limb}" for side in SIDES for limb in ("hip", "knee", "ankle", "shoulder", "elbow")),
)  # fmt: skip


def naming_of(source: SourceMotion) -> Mapping[str, str]:
    """Return which of the source's joints plays which of ours: its own table, then the convention that names most.

    Raises MocapError if the source lacks a limb.
    """
    theirs = dict(zip(_plain(source.joints), source.joints, strict=True))
    fits = [
        {
            ours: theirs[name]
            for ours, name in zip(naming, _plain(tuple(naming.values())), strict=True)
            if name in theirs
        }
        for naming in NAMINGS
    ]
    # Of several names of one joint, as of files with several skeletons, the one that this skeleton has.
    best = max(fits, key=len) | dict(sorted(source.naming, key=lambda pair: pair[1] in source.joints))
    if missing := [name for name in dict.fromkeys((*_NEEDED, *best)) if best.get(name) not in source.joints]:
        raise MocapError(
            f"{source.source or 'This skeleton'} has no joint for {', '.join(missing)}. "
            f"It has {', '.join(source.joints)}.",
            "Name them in a table, OURS=THEIRS: --joint left_hip=NAME.",
        )
    return MappingProxyType(best)


def _plain(names: Sequence[str]) -> list[str]:
    """Return names without namespace, common prefix, case and punctuation: `mixamorig:LeftUpLeg` is leftupleg."""
    bare = [name.rpartition(":")[2] for name in names]
    # A prefix ends at a mark or number, as in `Character1_Hips` or `Bip01 Pelvis`, not within a word.
    prefix = re.match(r".*[^A-Za-z]|", commonprefix(bare))  # noqa: RUF071, these are no paths.
    return [re.sub(r"[^a-z0-9]", "", name.removeprefix(prefix[0] if prefix else "").lower()) for name in bare]
