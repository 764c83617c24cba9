"""Look at the motion that a skill plans: from standing and from a walk, once and a second time."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import product
from typing import Final

import numpy as np

from humanclaw.body.ik import SIDES
from humanclaw.body.limits import JOINT_LIMITS, KNEE_BACK, angles_from_standing, within_limits
from humanclaw.body.pose import (
    FPS,
    HISTORY,
    Array,
    Motion,
    forward_kinematics,
    matrix_from_vector,
    rest_pose,
    vector_from_matrix,
)
from humanclaw.body.self_overlap import overlap
from humanclaw.body.skeleton import JOINT_INDEX, JOINTS
from humanclaw.checks.motions import gait
from humanclaw.errors import ContractError
from humanclaw.skills.gaze_grip_speech import Grip, Speech
from humanclaw.skills.plan import Control
from humanclaw.skills.plan_motion import Part, unlimited_motion

SPEED_LIMIT: Final = 1500.0
"""Degrees a second: about the speed of the knee in a kick and of the elbow in a throw."""
TRUNK_SPEED: Final = 700.0
"""Degrees a second that pelvis, spine, neck and head stay below."""
ROOT_SPEED: Final = 5.0
"""Metres a second that the pelvis stays below."""
TILT: Final = 75.0
"""Degrees from upright that the pelvis stays below."""
DEPTH: Final = 0.05
"""Metres that an arm may sink into the body: skin and clothes give way."""
STARTS: Final[Mapping[str, Motion]] = {"": rest_pose(HISTORY), " from a walk": gait(3, 0.5)[30 : 30 + HISTORY]}
_TRUNK: Final = [index for index, name in enumerate(JOINTS) if name in ("pelvis", "neck", "head") or "spine" in name]
Faults = Iterator[ContractError]


def motion_faults(plan: Callable[[Motion], Sequence[Part]], call: str) -> Faults:
    """Yield the faults of a call's motion. plan: returns its parts for a body in a pose."""
    for where, start in STARTS.items():
        pose = start
        for again in ("", ", a second time"):
            before = pose[-1:]
            for part in plan(pose):
                # The motion model's own motion is not held to these limits, and speech has none.
                if isinstance(part, Control | Speech):
                    pose = pose.held(HISTORY)
                    continue
                motion = unlimited_motion(part, pose)
                yield from _faults(motion, pose[-1:], f"{call}{where}{again}")
                pose = pose.then(within_limits(motion, pose[-1:])[0])[-HISTORY:]
            yield from _contacts(pose[-1:], before, f"{call}{where}{again}")


def moves(parts: Sequence[Part]) -> bool:
    """Whether anything moves in a plan, for a body that stands."""
    start = rest_pose(HISTORY)
    return any(
        isinstance(part, Control | Grip | Speech)
        or not np.allclose(unlimited_motion(part, start).rotations, start.rotations[-1], atol=1e-3)
        or not np.allclose(unlimited_motion(part, start).root, start.root[-1], atol=1e-3)
        for part in parts
    )


def _faults(motion: Motion, pose: Motion, call: str) -> Faults:
    whole = pose.then(motion)
    yield from _beyond_limits(motion, pose, call)
    speeds = _speeds(whole)
    most = np.full(len(JOINTS), SPEED_LIMIT)
    most[_TRUNK] = TRUNK_SPEED
    fastest = int((speeds.max(0) / most).argmax())
    if speeds[:, fastest].max() > most[fastest]:
        message = (
            f"{call} turns {JOINTS[fastest]} by {speeds[:, fastest].max():.0f} degrees a second; bodies stay below"
        )
        yield ContractError("joint-speed", f"{message} {most[fastest]:g}.", "Give it more time.")
    speed = float(np.linalg.norm(np.diff(whole.root, axis=0), axis=1).max()) * FPS
    if speed > ROOT_SPEED:
        message = f"{call} moves the pelvis by {speed:.1f} m/s; bodies stay below {ROOT_SPEED:g}."
        yield ContractError("root-speed", message, "Give it more time, or a shorter way.")
    up = matrix_from_vector(motion.rotations[:, 0])[:, 1, 1]
    if (tilt := float(np.degrees(np.arccos(np.clip(up.min(), -1, 1))))) > TILT:
        message = f"{call} tilts the pelvis by {tilt:.0f} degrees; a body that stands stays below {TILT:g}."
        yield ContractError("upright", message, "Bend the spine and the hips instead.")
    yield from _contacts(motion, pose, call)


def _beyond_limits(motion: Motion, pose: Motion, call: str) -> Faults:
    _, stopped = within_limits(motion, pose)
    angles = angles_from_standing(motion.rotations).max(0)
    for joint in stopped:
        angle, most = angles[JOINT_INDEX[joint]], f"{JOINT_LIMITS[joint]} degrees"
        if angle <= JOINT_LIMITS[joint]:
            angle, most = -np.degrees(motion.rotations[:, JOINT_INDEX[joint], 0].min()), f"{KNEE_BACK:g} backwards"
        message = f"{call} turns {joint} by {angle:.0f} degrees; it turns by {most}."
        remedy = "Turn it less, give absolute keys (radians), or end where it began."
        yield ContractError("joint-limits", message, remedy)


def _speeds(motion: Motion) -> Array:
    """Return (T - 1, 24) the speed of every joint, degrees a second."""
    turned = matrix_from_vector(motion.rotations)
    steps = vector_from_matrix(turned[:-1].swapaxes(-1, -2) @ turned[1:])
    return np.asarray(np.degrees(np.linalg.norm(steps, axis=-1)) * FPS)


# -- the arms and the body ---------------------------------------------------------------------------------------------
def _contacts(motion: Motion, pose: Motion, call: str) -> Faults:
    """Yield a fault for the deepest place where an arm goes into the body, or into the other arm."""
    depths, own = _depths(motion), np.maximum(_depths(pose), 0.0)
    worst = int((depths - own).argmax())
    if depths[worst] > DEPTH + own[worst]:
        arm, other = _PAIRS[worst]
        message = f"{call} puts {arm} {100 * depths[worst]:.0f} cm into {other}."
        yield ContractError("self-contact", message, "Turn the joint the other way, or less.")


def _depths(motion: Motion) -> Array:
    """Return (P,) by how much each pair of links overlaps at most, metres; negative if they are apart."""
    posed = forward_kinematics(motion.root, motion.rotations)
    return np.array([overlap(*posed, *pair).max() for pair in _PAIRS])


_LEFT, _RIGHT = ([f"{side}_{part}" for part in ("elbow", "wrist", "hand")] for side in SIDES)
_PAIRS: Final = [
    *product([*_LEFT, *_RIGHT], ("pelvis", "spine1", "spine2", "spine3", "head")), *product(_LEFT, _RIGHT),
]  # fmt: skip
"""(P) links, by their joint, that may not go into each other."""
