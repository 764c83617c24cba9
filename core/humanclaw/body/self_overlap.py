"""How deep links of one body are in each other."""

from __future__ import annotations

from itertools import product
from typing import Final

import numpy as np

from humanclaw.body.pose import Array
from humanclaw.body.skeleton import JOINT_INDEX, LINKS, Box

_LINK: Final = {link.joint: link for link in LINKS}


def overlap(joints: Array, turns: Array, first: str, second: str) -> Array:
    """Return how deep the links of two joints are in each other (...), metres; negative where they are apart.

    joints, turns: positions (..., 24, 3) and orientations (..., 24, 3, 3) of all joints.
    """
    return np.maximum(_within(joints, turns, first, second), _within(joints, turns, second, first))


def _within(joints: Array, turns: Array, first: str, second: str) -> Array:
    """Return the depth of the deepest point of the first link in the second."""
    points, radius = _points(first)
    inner, outer = JOINT_INDEX[first], JOINT_INDEX[second]
    world = joints[..., inner, None, :] + np.einsum("...ij,pj->...pi", turns[..., inner, :, :], points)
    local = np.einsum("...ji,...pj->...pi", turns[..., outer, :, :], world - joints[..., outer, None, :])
    return np.asarray((radius - _outside(local, second)).max(-1))


def _points(joint: str) -> tuple[Array, float]:
    """Return points (P, 3) in the frame of a joint, and the radius of the balls about them that fill its link."""
    shape = _LINK[joint].shape
    if isinstance(shape, Box):
        grid = np.array(list(product((-1, 0, 1), repeat=3)))
        return shape.centre + grid * shape.half, 0.0
    share = np.linspace(0, 1, 7)[:, None]
    return (1 - share) * np.array(shape.a) + share * np.array(shape.b), shape.radius


def _outside(points: Array, joint: str) -> Array:
    """Return the distance of points (..., 3) from the surface of a link; negative inside."""
    shape = _LINK[joint].shape
    if isinstance(shape, Box):
        away = np.abs(points - shape.centre) - shape.half
        return np.asarray(np.linalg.norm(np.maximum(away, 0.0), axis=-1) + np.minimum(away.max(-1), 0.0))
    a, axis = np.array(shape.a), np.subtract(shape.b, shape.a)
    along = np.clip((points - a) @ axis / (axis @ axis), 0.0, 1.0)
    return np.asarray(np.linalg.norm(points - a - along[..., None] * axis, axis=-1) - shape.radius)
