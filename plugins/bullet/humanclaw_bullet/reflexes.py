"""What a body does of its own accord: it lifts a toe over an edge, and its thighs give way to a seat.

A generated motion knows no scene, so its feet clear a step by a hair or miss by one, and its thighs slope where a seat is level. A
person would not notice either; half-physics without reflexes turns the one into a lost stair and the other into a body that sits
on its thighs with its hips in the air. Both are bounded: what is higher than a toe blocks as ever.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np

from humanclaw.body import JOINT_INDEX, LINKS, Box
from humanclaw.pose import FPS, Array, matrix_from_quaternion
from humanclaw_bullet.engine import Client
from humanclaw_bullet.profile import Profile

_LINK_A, _BODY_B, _POINT, _NORMAL, _DISTANCE, _FORCE = 3, 2, 6, 7, 8, 9
"""Fields of a row of getContactPoints."""
_TOUCHING: Final = 0.002
_PUSH: Final = 50.0
"""A foot that meets less than this is not held back, newtons."""
_LEVEL: Final = 0.7
"""Upward part of a normal from which on a contact carries and does not block."""
_REACH: Final = 0.02
"""How far behind an edge its upper side is looked for, metres."""
_PELVIS: Final = -1
_THIGHS: Final = tuple(JOINT_INDEX[f"{side}_hip"] for side in ("left", "right"))
_PATIENCE: Final = 0.2
"""A thigh that has carried nothing for so long carries no more, seconds."""
_CORNERS: Final[Mapping[int, Array]] = {
    JOINT_INDEX[link.joint] - 1: np.array(
        [
            np.array(link.shape.centre) + np.multiply(link.shape.half, (x, y, z))
            for x in (-1, 1)
            for y in (-1, 1)
            for z in (-1, 1)
        ]
    )
    for link in LINKS
    if link.group == "leg_foot" and isinstance(link.shape, Box)
}
"""Bullet link of each part of a foot to the (8, 3) corners of its box."""


@dataclass(frozen=True)
class Reflex:
    """What the last physics step calls for."""

    lift: float = 0.0
    """How far the body must rise for a foot to clear the edge that holds it back, metres."""
    borne: Mapping[int, float] = field(default_factory=dict)
    """Joints of the hips whose thighs carry weight, or did a moment ago, to the seconds since."""
    seated: bool = False
    """Whether the pelvis carries some too."""


CALM: Final = Reflex()


def feel(client: Client, body: int, profile: Profile, rows: Iterable[Any], before: Reflex) -> Reflex:
    """Read the contacts of the body that one physics step has left."""
    rows = [row for row in rows if row[_DISTANCE] <= _TOUCHING]
    carrying = {row[_LINK_A] for row in rows if row[_NORMAL][1] > _LEVEL}
    borne = _borne(carrying, before, 1 / (FPS * profile.substeps)) if profile.yielding else {}
    lift = max((_missing(client, body, profile, row) for row in rows), default=0.0) if profile.step_offset else 0.0
    return Reflex(lift, borne, _PELVIS in carrying)


def _borne(carrying: set[int], before: Reflex, step: float) -> Mapping[int, float]:
    """A thigh that loses touch for a moment has not stood up: else it would come back down and push the body off the seat."""
    since = {thigh: 0.0 if thigh - 1 in carrying else before.borne.get(thigh, np.inf) + step for thigh in _THIGHS}
    return {thigh: seconds for thigh, seconds in since.items() if seconds < _PATIENCE}


def _missing(client: Client, body: int, profile: Profile, row: Any) -> float:
    """How far a foot that something holds back is too low to pass over it; 0 if that is more than a step's offset."""
    link, normal = row[_LINK_A], np.array(row[_NORMAL])
    if link not in _CORNERS or normal[1] > _LEVEL or row[_FORCE] < _PUSH or client.getDynamicsInfo(row[_BODY_B], -1)[0]:
        return 0.0
    state = client.getLinkState(body, link)
    sole = float((_CORNERS[link] @ matrix_from_quaternion(np.array(state[5])).T)[:, 1].min() + state[4][1])
    ahead = np.array(row[_POINT]) - _REACH * normal * [1, 0, 1] / max(float(np.hypot(normal[0], normal[2])), 1e-9)
    top, bottom = ahead.copy(), ahead
    top[1], bottom[1] = sole + profile.step_offset, sole - _TOUCHING
    found, _, _, at, face = client.rayTest(top, bottom)[0]
    return float(at[1] - sole + _TOUCHING) if found == row[_BODY_B] and face[1] > _LEVEL else 0.0
