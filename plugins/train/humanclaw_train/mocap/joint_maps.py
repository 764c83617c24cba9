"""Joint names of captured skeletons: which source joint plays which of our 24 joints."""

from __future__ import annotations

from collections.abc import Mapping
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
    _sided("root - - chest neck -", "*_hip *_knee *_ankle *_toe - *_shoulder *_elbow *_wrist -", "left", "right"),
    MappingProxyType({name: name for name in JOINTS}),
)  # fmt: skip
"""Known naming conventions: CMU and HDM05 ASF, three CMU BVH conversions, ReActIdle, humanoid3d and SMPL."""
_NEEDED: Final = (
    "pelvis", *(f"{side}_{limb}" for side in SIDES for limb in ("hip", "knee", "ankle", "shoulder", "elbow")),
)  # fmt: skip


def naming_of(source: SourceMotion) -> Mapping[str, str]:
    """Return the convention that names most of this source's joints. Raises MocapError if the source lacks a limb."""
    best = max(NAMINGS, key=lambda naming: sum(name in source.joints for name in naming.values()))
    missing = [f"{name} ({best.get(name, '-')})" for name in _NEEDED if best.get(name) not in source.joints]
    if missing:
        raise MocapError(
            f"{source.source or 'This skeleton'} has no joints for {', '.join(missing)}. "
            f"It has {', '.join(source.joints[:12])} ...",
            "Rename its joints to the SMPL names of humanclaw.body.JOINTS.",
        )
    return MappingProxyType({ours: theirs for ours, theirs in best.items() if theirs in source.joints})
