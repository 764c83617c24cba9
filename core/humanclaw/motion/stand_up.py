"""Rise from a seat, a squat, the knees or the floor.

A person who gets up pulls the feet under the body, slides to the edge of the seat, leans until the weight is over the
feet, and only then leaves the seat. The times were measured on real rises (CMU subject 75): 0.4 s of leaning, 0.5 s of
rising. Both feet stay where they stand.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from humanclaw.body.ik import TOE_BASE
from humanclaw.body.limits import centre_of_mass, shoe_heights
from humanclaw.body.pose import (
    FUTURE,
    Array,
    Motion,
    Pose2D,
    forward_kinematics,
    matrix_from_vector,
    smoothstep,
    support_height,
    vector_from_matrix,
    yaw_matrix,
)
from humanclaw.body.skeleton import JOINT_INDEX, SOLE, STANDING_HEIGHT
from humanclaw.motion.leg_ik import ANKLES, solve_legs

_DOWN: Final = 0.8 * STANDING_HEIGHT
"""Pelvis height over the lower sole, metres, below which a body has to rise before it can step. Walks and stairs keep
.87 of the standing height; on a seat of 70 cm it is .69."""
_BEHIND: Final = 0.2
"""How far behind the ankles hips leave the seat, metres. 52 to 60 degrees of lean balance it; from .25 on none do."""
_LOW: Final = 0.3
"""Pelvis height, metres, below which it rises while the body leans: legs that fold further have no knees to bend."""
_BALANCED: Final = -0.01
"""Where the weight is then, metres ahead of the ankles: 5 cm ahead of the heels."""
_LEANS: Final = np.radians(np.arange(0.0, 71.0, 2.0))
"""The first that balances is taken."""
_SHARES: Final = {"pelvis": 0.6, "spine1": 0.25, "spine2": 0.2, "neck": -0.2, "head": -0.35}
"""How the joints of the trunk share a lean. Neck and head take half of it back, so that the eyes stay ahead."""
_HANGING: Final = -sum(_SHARES[joint] for joint in ("pelvis", "spine1", "spine2"))
_AROUND, _BESIDE = 0.6, 0.1
"""Radians by which arms turn outwards as hands come from the thighs to beside them, and while they hang there. Straight
down, hands passed 7 cm deep through the thighs."""
_SPREAD: Final = np.array([[0.09], [-0.09]])
"""Feet stand below the hip joints, metres."""
_TILT, _AWAY, _LIFTED = 1.0, 0.45, 0.15
"""A foot stands if it is tilted by less (radians: a kneeling one stands on its toes), no further from its place and no
higher (metres). Legs of hips 65 cm high reach that place and .45 m more."""
_LIFT: Final = 0.06
"""Height of a foot on its way to a new place, metres. Toes of the shortest walks rise by .03 to .08."""


def is_down(pose: Motion) -> bool:
    """Tell whether the body of a pose's last frame sits, squats, kneels or lies."""
    last = pose[-1:]
    return bool(last.root[0, 1] - support_height(last.joints())[0] < _DOWN)


def rise(pose: Motion, stance: Motion) -> Motion:
    """Return whole chunks of 15 frames in which a body rises from the last frame of a pose to a stance.

    The motion is in the frame of the pose. stance: at the origin, facing +Z.
    """
    last = forward_kinematics(pose.root[-1], pose.rotations[-1])
    here = Pose2D.of(pose, floor=float(shoe_heights(*last).min()))
    start = here.to_local(pose[-1:])
    (joints,), (turns,) = forward_kinematics(start.root, start.rotations)
    begun = joints[list(ANKLES)], turns[list(ANKLES)]
    feet, moved = _placed(*begun)
    leant, stands = _leant(start, stance, *feet), _over(stance, feet[0])
    clock = np.arange(1, FUTURE * (len(moved) + 2) + 1) / FUTURE
    lean, up = smoothstep(clock - len(moved)), smoothstep(clock - len(moved) - 1)
    # The trunk stays down until the hips are a fifth of the way up, as a person's does.
    erect = smoothstep((clock - len(moved) - 1.3) / 0.7)
    root = start.root + lean[:, None] * (leant.root - start.root) + up[:, None] * (stands.root - leant.root)
    rotations = _blended(_blended(start.rotations, leant.rotations, lean), stands.rotations, erect)
    _spread(rotations, 4 * _AROUND * lean * (1 - lean) + _BESIDE * lean * (1 - erect))
    ankles, soles = _swung(begun, feet, moved, clock)
    return here.to_world(solve_legs(Motion(root, rotations), ankles, soles))


def _placed(ankles: Array, feet: Array) -> tuple[tuple[Array, Array], list[int]]:
    """Return where both feet will stand, ankles (2, 3) and orientations (2, 3, 3), and the feet that have to move."""
    away = np.linalg.norm(ankles[:, [0, 2]] - np.hstack([_SPREAD, np.full((2, 1), _BEHIND)]), axis=-1)
    tilt = np.arccos(np.clip(feet[:, 1, 1], -1.0, 1.0))
    moved = [foot for foot in (0, 1) if away[foot] > _AWAY or tilt[foot] > _TILT or ankles[foot, 1] > SOLE + _LIFTED]
    level = yaw_matrix(np.arctan2(feet[:, 0, 2], feet[:, 2, 2]))
    level[moved] = np.eye(3)
    # A raised heel comes down while the toes stay.
    stand = ankles + feet @ TOE_BASE - level @ TOE_BASE
    stand[moved] = np.hstack([_SPREAD, np.full((2, 2), _BEHIND)])[moved]
    stand[:, 1] = SOLE
    return (stand, level), moved


def _swung(
    begun: tuple[Array, Array], feet: tuple[Array, Array], moved: list[int], clock: Array
) -> tuple[Array, Array]:
    """Return the ankles (T, 2, 3) and orientations (T, 2, 3, 3) of feet that go to their places one after the other."""
    order = [moved.index(foot) if foot in moved else 0 for foot in (0, 1)]
    share = smoothstep(clock[:, None] - order)
    ankles = begun[0] + share[..., None] * (feet[0] - begun[0])
    lifts = np.isin((0, 1), moved) * _LIFT
    ankles[..., 1] += lifts * 4 * share * (1 - share)
    turn = vector_from_matrix(np.swapaxes(begun[1], -1, -2) @ feet[1])
    return ankles, begun[1] @ matrix_from_vector(share[..., None] * turn)


def _spread(rotations: Array, outwards: Array) -> None:
    """Turn both arms outwards, in place, by angles (T,), radians, so that hands pass around the thighs."""
    for joint, sign in ((JOINT_INDEX["left_shoulder"], 1.0), (JOINT_INDEX["right_shoulder"], -1.0)):
        turn = matrix_from_vector(np.outer(outwards, [0.0, 0.0, sign]))
        rotations[:, joint] = vector_from_matrix(turn @ matrix_from_vector(rotations[:, joint]))


def _over(stance: Motion, ankles: Array) -> Motion:
    """Return the last frame of a stance with its pelvis over feet that stand elsewhere."""
    last = stance[-1:]
    joints = last.joints()[0]
    floor = ankles.mean(0) - joints[list(ANKLES)].mean(0)
    height = SOLE - joints[list(ANKLES), 1].min()
    return Motion(last.root + [floor[0], height, floor[2]], last.rotations)


def _leant(start: Motion, stance: Motion, ankles: Array, feet: Array) -> Motion:
    """Return the pose in which a body leaves its seat: hips close to the feet, the weight over them."""
    middle = ankles.mean(0)
    root = start.root + [middle[0], max(0.0, _LOW - start.root[0, 1]), max(0.0, middle[2] - _BEHIND)]
    leans = np.repeat(stance.rotations[-1:], len(_LEANS), 0)
    for joint, share in {**_SHARES, "left_shoulder": _HANGING, "right_shoulder": _HANGING}.items():
        turn = matrix_from_vector(np.outer(_LEANS, [share, 0.0, 0.0]))
        leans[:, JOINT_INDEX[joint]] = vector_from_matrix(turn @ matrix_from_vector(leans[:, JOINT_INDEX[joint]]))
    bodies = solve_legs(Motion(np.repeat(root, len(_LEANS), 0), leans), ankles, feet)
    weight = centre_of_mass(*forward_kinematics(bodies.root, bodies.rotations))[:, 2]
    balanced = np.flatnonzero(weight > middle[2] + _BALANCED)
    least = int(balanced[0]) if len(balanced) else len(_LEANS) - 1
    return bodies[least : least + 1]


def _blended(start: Array, end: Array, share: Array) -> Array:
    """Turn rotations (T or 1, 24, 3) by a share (T,) of the way to others (1, 24, 3), along the shortest arc."""
    first = matrix_from_vector(start)
    way = vector_from_matrix(np.swapaxes(first, -1, -2) @ matrix_from_vector(end))
    return vector_from_matrix(first @ matrix_from_vector(share[:, None, None] * way))
