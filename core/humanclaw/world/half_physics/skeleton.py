"""The body as an engine builds it: mass and inertia of each joint's link, and how far a link reaches."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from humanclaw.body.pose import FPS, Array, forward_kinematics
from humanclaw.body.skeleton import JOINTS, LINKS, OFFSETS, PARENTS, Box, Capsule
from humanclaw.world.half_physics.profile import Profile

LINK_OF: Final = {link.joint: link for link in LINKS}
ARMS: Final = tuple(link.joint for link in LINKS if link.group == "arm_hand")
"""In order: a sum over a set of names differs in its last bit from process to process."""
_COLLAR_MASS: Final = 0.1
"""Kilograms of a joint without a link of its own, such as a collar."""
_PELVIS_INERTIA: Final = 1e6
"""Kilograms by square metres."""


def link_mass(joint: str, profile: Profile) -> float:
    """Return the kilograms that move with a joint; the chest carries the mass that a profile takes from the arms."""
    if joint not in LINK_OF:
        return _COLLAR_MASS
    moved = (1 - profile.arm_mass) * sum(LINK_OF[arm].mass for arm in ARMS) if joint == "spine3" else 0.0
    return LINK_OF[joint].mass * (profile.arm_mass if joint in ARMS else 1.0) + moved


def link_inertia(joint: str, profile: Profile) -> float:
    """Rotational inertia of a joint's link about every axis through the joint, kg m2: its passive stiffness.

    That of the pelvis is practically infinite: its orientation is commanded, so nobody falls over.
    """
    return _PELVIS_INERTIA if joint == JOINTS[0] else profile.inertia * profile.stiffness_of(joint)


def capsule_frame(capsule: Capsule) -> tuple[Array, Array, float]:
    """Centre, matrix that carries +Z onto the axis, and length of the axis, for engines that know capsules along +Z
    only."""
    a, b = np.array(capsule.a), np.array(capsule.b)
    length = float(np.linalg.norm(b - a))
    z = (b - a) / length
    x = np.cross([0.0, 1.0, 0.0] if abs(z[1]) < 0.9 else [1.0, 0.0, 0.0], z)  # Any, but not along z.
    x /= np.linalg.norm(x)
    return (a + b) / 2, np.stack([x, np.cross(z, x), z], -1), length


def _far(shape: Capsule | Box) -> float:
    """Distance of the farthest point of a shape from its joint."""
    if isinstance(shape, Box):
        return float(np.linalg.norm(np.abs(shape.centre) + np.array(shape.half)))
    return float(np.linalg.norm([shape.a, shape.b], axis=1).max()) + shape.radius


def _reach() -> Array:
    reach = np.zeros((len(JOINTS), len(LINKS)))
    for column, link in enumerate(LINKS):
        joint, distance = JOINTS.index(link.joint), _far(link.shape)
        while joint >= 0:
            reach[joint, column] = distance
            distance, joint = distance + float(np.linalg.norm(OFFSETS[joint])), PARENTS[joint]
    return reach


REACH: Final = _reach()
"""(24, links): how far the far end of a link can be from each joint that moves it; 0 for joints that do not."""


def _corners() -> tuple[Array, NDArray[np.int64], Array]:
    points, joints, radii = list[Array](), list[int](), list[float]()
    for link in LINKS:
        shape = link.shape
        if isinstance(shape, Box):
            signs = np.stack(np.meshgrid(*[(-1.0, 1.0)] * 3), -1).reshape(-1, 3)
            spanning, radius = np.array(shape.centre) + signs * shape.half, 0.0
        else:
            spanning, radius = np.array([shape.a, shape.b]), shape.radius
        points.append(spanning)
        joints += [JOINTS.index(link.joint)] * len(spanning)
        radii += [radius] * len(spanning)
    return np.concatenate(points), np.array(joints), np.array(radii)


POINTS, POINT_JOINTS, POINT_RADII = _corners()
"""(P, 3) points that span the links, each in its joint's frame, (P,) its joint, and (P,) the radius around it."""
_OF_LINK: Final = [JOINTS.index(link.joint) for link in LINKS]
_TIPS: Final = np.array([link.shape.centre if isinstance(link.shape, Box) else link.shape.b for link in LINKS])
"""(links, 3) a point near the far end of each link, in its joint's frame."""


def tip_speeds(rotations: Array) -> Array:
    """Map (T + 1, 24, 3) rotation vectors to (T,) speeds of the fastest link relative to the pelvis, m/s."""
    joints, turns = forward_kinematics(np.zeros((len(rotations), 3)), rotations)
    tips = joints[:, _OF_LINK] + np.einsum("tlij,lj->tli", turns[:, _OF_LINK], _TIPS)
    return np.asarray(np.linalg.norm(np.diff(tips, axis=0), axis=-1).max(axis=1) * FPS)
