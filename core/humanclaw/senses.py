"""Senses beyond sight, for those who ask for them: where one's own limbs are (`body`), and what they touch (`touch`).

The paper gives its agents vision alone, and finds them unaware of their own bodies (section 5.4). What is told here is what a
person would feel: heights above one's own soles, displacements beside those intended, which part of the body touches something
and for how long. Never a coordinate of the scene, never a name of what is touched.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from typing import Final

import numpy as np

from humanclaw.body import JOINT_INDEX, STANDING_HEIGHT
from humanclaw.errors import HumanclawError
from humanclaw.interfaces import Contact, Execution
from humanclaw.pose import FPS, Array, Frame, Motion, support_height, wrap_angle

SENSES: Final = ("vision", "body", "touch")
"""Vision is always on: it is the picture."""

_UPRIGHT: Final = 0.85
_BENT: Final = 0.62
"""Shares of the standing height down to which a body stands upright, and stands with bent knees."""
_UNDERFOOT: Final = 0.05
"""Metres below the ankle at which what a foot touches is what it stands on."""
_PARTS: Final = {"head": "head", "torso": "torso", "arm_hand": "arm or hand", "leg_foot": "leg or foot"}


def check_senses(names: Iterable[str]) -> tuple[str, ...]:
    """The senses asked for, vision among them, in a fixed order. Raises HumanclawError for an unknown one."""
    asked = set(names)
    unknown = asked - set(SENSES)
    if unknown:
        raise HumanclawError(f"there is no sense {sorted(unknown)[0]!r}.", f"Choose from: {', '.join(SENSES)}.")
    return tuple(name for name in SENSES if name in asked | {"vision"})


def feeling(senses: Sequence[str], before: Motion, chunks: Sequence[tuple[Motion, Execution]]) -> str:
    """What the body felt of one call, in words; empty for one that only sees.

    before: the pose (one frame) in which the call began. chunks: what was commanded (15 frames each) and what became of it.
    """
    told = []
    if "body" in senses:
        told += [posture(chunks[-1][1].realised), displacement(before, chunks)]
    if "touch" in senses:
        told.append(touch([execution for _, execution in chunks]))
    return " ".join(told)


# -- where the limbs are -----------------------------------------------------------------------------------------------
def posture(motion: Motion) -> str:
    """Height and pose of the last frame."""
    joints = motion.joints()[-1]
    height = float(motion.root[-1, 1] - support_height(joints))
    share = height / STANDING_HEIGHT
    lean = joints[JOINT_INDEX["neck"]] - joints[JOINT_INDEX["pelvis"]]
    tilt = float(np.degrees(np.arccos(np.clip(lean[1] / np.linalg.norm(lean), -1, 1))))
    pose = (
        "standing upright"
        if share > _UPRIGHT
        else "standing with bent knees"
        if share > _BENT
        else "seated or squatting"
    )
    trunk = "" if tilt < 20 else f", trunk tilted by {tilt:.0f} degrees"
    return f"You feel yourself {pose}{trunk}: your hips are {100 * height:.0f} cm above your soles."


def displacement(before: Motion, chunks: Sequence[tuple[Motion, Execution]]) -> str:
    """How the body moved in its own frame, beside how its limbs meant to move it."""
    meant, moved, start = np.zeros(4), np.zeros(4), before
    for commanded, execution in chunks:
        here = Frame.of(start, floor=0.0)
        meant += _shift(here, start, commanded)
        moved += _shift(here, start, execution.realised)
        start = execution.realised[-1:]
    return f"Your limbs meant {_way(meant)}; your body went {_way(moved)}."


def _shift(frame: Frame, start: Motion, motion: Motion) -> Array:
    """(4,) left, up, forward in metres and turn in radians, from a pose to the end of a motion."""
    way = frame.point_to_local(motion.root[-1]) - frame.point_to_local(start.root[-1])
    return np.array([*way, float(wrap_angle(float(motion.yaw()[-1] - start.yaw()[-1])))])


def _way(shift: Array) -> str:
    left, up, forward = np.round(100 * shift[:3]).astype(int)
    turn = round(float(np.degrees(shift[3])))
    parts = [
        f"{abs(forward)} cm {'forward' if forward > 0 else 'back'}" if forward else "",
        f"{abs(left)} cm to the {'left' if left > 0 else 'right'}" if left else "",
        f"{abs(up)} cm {'up' if up > 0 else 'down'}" if abs(up) > 2 else "",
        f"a turn of {abs(turn)} degrees to the {'left' if turn > 0 else 'right'}" if abs(turn) > 1 else "",
    ]
    return ", ".join(part for part in parts if part) or "nowhere"


# -- what they touch ---------------------------------------------------------------------------------------------------
def touch(executions: Sequence[Execution]) -> str:
    """Which parts of the body touched something other than what they stood on, on which side, for how long, and if it gave way."""
    frames: dict[str, set[tuple[int, int]]] = defaultdict(set)
    gave_way: dict[str, bool] = defaultdict(bool)
    for number, execution in enumerate(executions):
        joints = execution.realised.joints()
        for contact in execution.contacts:
            if not _underfoot(contact, joints[contact.frame]):
                frames[_part(contact)].add((number, contact.frame))
                gave_way[_part(contact)] |= contact.movable
    if not frames:
        return "You touch nothing but what you stand on."
    felt = [
        f"your {part} for {len(when) / FPS:.1f} s{' (it gives way)' if gave_way[part] else ''}"
        for part, when in sorted(frames.items())
    ]
    return f"Something touched {', '.join(felt)}."


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
