"""The loops over MuJoCo's contacts that each physics step runs, compiled.

All arrays of contacts are views of MuJoCo's memory, one row a contact.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from humanclaw.body import Array
from humanclaw.world import TOUCHING, compiled

_RECOVERY: Final = 0.2
"""Share of a penetration that one step corrects."""
_GENTLY: Final = 0.5
"""Largest speed at which objects that overlap come apart, m/s. Imported scenes are full of them: 15 cm would else be
7 m/s, and the speed stays when they are apart."""
_LEAST: Final = 1e-5
"""MuJoCo's minimum of friction: without any, MuJoCo would let the shapes pass through each other."""
_SWINGS: Final = 0.2
"""A link that slides slower than this stands, m/s."""
NEAR: Final = 0.01
"""Distance at which an awake object or the body wakes a sleeping object, metres."""

Ints = NDArray[np.int32]


@compiled
def harden(
    geoms: Ints, gaps: Array, margins: Array, stiffness: Array, frictions: Array, friction: Array,
    joint_of: NDArray[np.int64], seconds: float,
) -> None:  # fmt: skip
    """Let each contact allow just the approach that closes its distance in this step.

    MuJoCo would let the shapes overlap first. geoms: (contacts, 2). gaps: (contacts,) metres. friction: (geoms,).
    """
    for k in range(gaps.size):
        margins[k] = 0.0
        share = 1.0 if gaps[k] > 0 else _RECOVERY
        if max(joint_of[geoms[k, 0]], joint_of[geoms[k, 1]]) < 0 and -gaps[k] * _RECOVERY > _GENTLY * seconds:
            share = _GENTLY * seconds / -gaps[k]
        # Negative numbers mean stiffness and damping directly, per unit of effective mass: 1/s^2 and 1/s.
        stiffness[k, 0], stiffness[k, 1] = -share / seconds**2, -1 / seconds
        frictions[k, 0] = frictions[k, 1] = max(friction[geoms[k, 0]] * friction[geoms[k, 1]], _LEAST)


@compiled
def let_slide(
    geoms: Ints, rows: Ints, frictions: Array, joint_of: NDArray[np.int64], speeds: Array, wanted: Array, seconds: float
) -> None:
    """Let links slide over what they touch without being lifted off it.

    MuJoCo moves apart what slides, at friction times its speed: a foot that swings over a floor would lift the body by
    a centimetre. rows: as for body_contacts. speeds, wanted: of all rows, MuJoCo's efc_vel and efc_aref.
    """
    for k in range(rows.size):
        row = rows[k]
        if row >= 0 and max(joint_of[geoms[k, 0]], joint_of[geoms[k, 1]]) >= 0:
            # The two rows after that of the normal are the directions of friction.
            slides = np.hypot(speeds[row + 1], speeds[row + 2])
            # Without this, a foot at 4 m/s 4 mm over the floor threw the body up at .7 m/s.
            wanted[row] -= frictions[k, 0] * max(slides - _SWINGS, 0.0) / seconds


@compiled
def harden_stops(
    hinges: NDArray[np.int64], addresses: Ints, ranges: Array, angles: Array, stiffness: Array, seconds: float
) -> None:
    """Let the limit of each hinge allow just the turn that reaches it in this step.

    hinges: numbers of the joints. addresses, ranges, stiffness: of all joints. angles: MuJoCo's qpos.
    """
    for hinge in hinges:
        angle = angles[addresses[hinge]]
        free = min(angle - ranges[hinge, 0], ranges[hinge, 1] - angle) > 0
        stiffness[hinge, 0], stiffness[hinge, 1] = -(1.0 if free else _RECOVERY) / seconds**2, -1 / seconds


@compiled
def body_contacts(
    geoms: Ints, gaps: Array, points: Array, frames: Array, rows: Ints, forces: Array,
    joint_of: NDArray[np.int64], object_of: NDArray[np.int64], body_of: NDArray[np.int64],
) -> Array:  # fmt: skip
    """Return (N, 11) joint, object, point, normal towards the body, distance, force and body of each contact of a body;
    two rows where two bodies meet.

    rows: (contacts,) first row of each contact in forces; -1 for one without a constraint.
    """
    contacts, count = np.empty((2 * gaps.size, 11)), 0
    for k in range(gaps.size):
        force = forces[rows[k]] if rows[k] >= 0 else 0.0
        if gaps[k] > TOUCHING and force <= 0:
            continue
        for side in range(2):
            geom = geoms[k, side]
            if joint_of[geom] < 0:
                continue
            row = contacts[count]
            row[0], row[1] = joint_of[geom], object_of[geoms[k, 1 - side]]
            # MuJoCo's normal points from the first geom to the second; here it points to the body.
            for axis in range(3):
                row[2 + axis], row[5 + axis] = points[k, axis], frames[k, axis] * (2 * side - 1)
            # A contact at a distance that already pushes closes in this step, so it counts as touching.
            row[8], row[9], row[10] = min(gaps[k], TOUCHING), force, body_of[geom]
            count += 1
    return contacts[:count]


@compiled
def disturbed(
    geoms: Ints, gaps: Array, place_of: NDArray[np.int64], sleepers: int, speeds: Array, held: NDArray[np.int64]
) -> bool:
    """Tell whether anything is near one of the sleepers, or has moved one.

    place_of: (geoms,) place of the geom's object among the sleepers, if below their number. speeds: MuJoCo's qvel.
    held: its addresses that belong to sleepers.
    """
    for k in range(gaps.size):
        if gaps[k] <= NEAR and min(place_of[geoms[k, 0]], place_of[geoms[k, 1]]) < sleepers:
            return True
    moved = False
    for address in held:
        moved |= speeds[address] != 0.0
    return moved
