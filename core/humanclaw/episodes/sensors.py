"""The core's own senses beside vision: the positions of the own limbs (`body`) and their contacts (`touch`).

The paper gives its agents vision alone, and finds them unaware of their own bodies (section 5.4). These senses report
what a person would feel: heights above the soles, intended and actual displacement, which part of the body touches
something and for how long. They never report a coordinate of the scene or the name of an object.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from typing import Final

import numpy as np

from humanclaw.body.pose import Array, Motion, Pose2D, support_height, wrap_angle
from humanclaw.body.skeleton import JOINT_INDEX
from humanclaw.records.feedback import Displacement, Proprioception, Touch
from humanclaw.world.simulator import Contact, Execution

_UNDERFOOT: Final = 0.05
"""Metres below the ankle from which a contact of the foot counts as the ground."""
_PARTS: Final = {"head": "head", "torso": "torso", "arm_hand": "arm or hand", "leg_foot": "leg or foot"}


# -- where the limbs are -----------------------------------------------------------------------------------------------
def proprioception(before: Motion, chunks: Sequence[tuple[Motion, Execution]]) -> Proprioception:
    """Return the body sense after one call.

    Args:
        before: the pose (one frame) in which the call began.
        chunks: commanded motion (15 frames each, world frame) and its execution.
    """
    last = chunks[-1][1].simulated
    joints = last.joints()[-1]
    lean = joints[JOINT_INDEX["neck"]] - joints[JOINT_INDEX["pelvis"]]
    tilt = float(np.degrees(np.arccos(np.clip(lean[1] / np.linalg.norm(lean), -1, 1))))
    meant, moved, start = np.zeros(4), np.zeros(4), before
    for commanded, execution in chunks:
        here = Pose2D.of(start, floor=0.0)
        meant += _shift(here, start, commanded)
        moved += _shift(here, start, execution.simulated)
        start = execution.simulated[-1:]
    height = float(last.root[-1, 1] - support_height(joints))
    return Proprioception(height, tilt, Displacement(*map(float, meant)), Displacement(*map(float, moved)))


def _shift(frame: Pose2D, start: Motion, motion: Motion) -> Array:
    """Return (4,) left, up, forward (metres) and turn (radians), from a pose to the end of a motion."""
    way = frame.point_to_local(motion.root[-1]) - frame.point_to_local(start.root[-1])
    return np.array([*way, float(wrap_angle(float(motion.yaw()[-1] - start.yaw()[-1])))])


# -- touch -------------------------------------------------------------------------------------------------------------
def tactile(executions: Sequence[Execution]) -> tuple[Touch, ...]:
    """Return the parts of the body that touched anything but the ground under the feet, sorted by name, and then the
    hands that hold something."""
    frames: dict[str, set[tuple[int, int]]] = defaultdict(set)
    gives_way: dict[str, bool] = defaultdict(bool)
    people: set[str] = set()
    for number, execution in enumerate(executions):
        joints = execution.simulated.joints()
        for contact in execution.contacts:
            if _is_held(contact, execution):
                continue
            meeting = {(number, frame) for frame in contact.frames if not _underfoot(contact, joints[frame])}
            if meeting:
                frames[_part(contact)] |= meeting
                gives_way[_part(contact)] |= contact.movable
                people |= {_part(contact)} if contact.person else set()
    met = [Touch(part, len(frames[part]), gives_way[part], person=part in people) for part in sorted(frames)]
    spans = {side: sum(len(e.simulated) for e in executions if side in e.held) for side in executions[-1].held}
    return (*met, *(Touch(f"{side} hand", span, True, holds=True) for side, span in spans.items()))


def _is_held(contact: Contact, execution: Execution) -> bool:
    by = contact.joint.partition("_")[0], contact.object_id
    return contact.group == "arm_hand" and by in execution.held.items()


def _underfoot(contact: Contact, joints: Array) -> bool:
    side, _, part = contact.joint.partition("_")
    if part not in ("ankle", "foot"):
        return False
    return contact.height < float(joints[JOINT_INDEX[f"{side}_ankle"], 1]) - _UNDERFOOT


def _part(contact: Contact) -> str:
    if contact.joint == "pelvis":
        return "hips"
    side = contact.joint.split("_")[0]
    part = _PARTS[contact.group]
    return f"{side} {part}" if side in ("left", "right") else part
