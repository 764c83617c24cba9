"""Keep shoes and legs out of one another: how far a foot gives way to its own side, and how far knees swivel.

Shoes are rectangles on the floor. "Aside" is square to the mean heading of both feet. (...) is any leading shape.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from humanclaw.body.ik import TOE_BASE
from humanclaw.body.pose import Array, matrix_from_vector, smoothstep
from humanclaw.body.skeleton import JOINT_INDEX, LINKS, OFFSETS, Box, Capsule

_BOXES: Final = {link.joint: link.shape for link in LINKS if isinstance(link.shape, Box)}
SHOE, TOES = (_BOXES[joint] for joint in ("left_ankle", "left_foot"))
HEEL_END: Final = float(SHOE.centre[2] - SHOE.half[2])
TOE_END: Final = float(TOE_BASE[2] + TOES.centre[2] + TOES.half[2])
"""Ends of a shoe, metres ahead of the ankle."""
_HALF: Final = np.array([SHOE.half[0] + 0.004, (TOE_END - HEEL_END) / 2])
"""Half the width of a shoe, with a margin, and half its length, metres."""
_LANE: Final = 0.045
"""Least distance of the feet across their heading, metres, where one is ahead of the other: legs never cross."""
_RAMP: Final = 0.1
"""Distance of the shoes along their heading, metres, from which only _LANE counts."""
_CLEAR: Final = 0.02
"""The same for their distance in height: on stairs a foot passes over the other one."""


def apart(
    sole: Array, yaw: Array, other: Array, other_yaw: Array, side: Array | float, over: Array | float = 0.0
) -> Array:
    """Return the shift (..., 3) over the floor that keeps a foot out of the other one, and on its own side of it.

    sole, other: (..., 3) below the ankles. side: 1 for a left foot, -1 for a right one. over: how far one shoe is
    above the other one, metres.
    """
    # Headings on both sides of the turn from pi to -pi: their plain mean points backwards.
    backwards = np.pi * np.round((yaw - other_yaw) / (2 * np.pi))
    aside = _aside((yaw + other_yaw) / 2 + backwards) * np.asarray(side)[..., None]
    between = (sole - other)[..., [0, 2]]
    centre = between + (HEEL_END + TOE_END) / 2 * (_ahead(yaw) - _ahead(other_yaw))
    across, along = _gaps(centre, yaw, other_yaw, aside)
    share = smoothstep(1 - along / _RAMP) * smoothstep(1 - np.asarray(over) / _CLEAR)
    lane = _LANE - np.sum(between * aside, -1)
    size = np.maximum(share * across + (1 - share) * lane, 0.0)
    shift = size[..., None] * aside
    return np.stack([shift[..., 0], np.zeros_like(size), shift[..., 1]], -1)


def _gaps(centre: Array, yaw: Array, other_yaw: Array, aside: Array) -> tuple[Array, Array]:
    """Return how far one shoe must go aside to be beside the other (...), and how far it is ahead or behind (...)."""
    across, along = [], []
    for own, its in ((yaw, other_yaw), (other_yaw, yaw)):
        spread = np.stack([np.abs(np.cos(its - own)), np.abs(np.sin(its - own))], -1)
        wide, long = (_HALF[axis] + spread @ _HALF[[axis, 1 - axis]] for axis in (0, 1))
        lateral = _aside(own) * np.sign(np.sum(_aside(own) * aside, -1, keepdims=True))
        slope = np.maximum(np.sum(lateral * aside, -1), 0.3)
        across.append((wide - np.sum(lateral * centre, -1)) / slope)
        along.append(np.abs(np.sum(_ahead(own) * centre, -1)) - long)
    return np.minimum(*across), np.maximum(*along)


def _ahead(yaw: Array) -> Array:
    return np.stack([np.sin(yaw), np.cos(yaw)], -1)


def _aside(yaw: Array) -> Array:
    return np.stack([np.cos(yaw), -np.sin(yaw)], -1)


def widened(sizes: Array) -> Array:
    """Widen peaks over time (..., T) by two frames on both sides and then smooth, so that smoothing lowers none."""
    kernel = np.hanning(7)[1:-1] / np.hanning(7)[1:-1].sum()
    edges = [(0, 0)] * (sizes.ndim - 1) + [(4, 4)]
    wide = sliding_window_view(np.pad(sizes, edges, mode="edge"), 5, axis=-1).max(-1)
    return np.asarray(sliding_window_view(wide, 5, axis=-1) @ kernel)


def knees_apart(hips: Array, bones: Sequence[tuple[Array, Array]]) -> Array:
    """Return turns (2, T, 3, 3) of both legs, left first, each about the line from hip to ankle, by the least angles
    that keep their bones apart.

    hips: (2, T, 3). bones: orientations (T, 3, 3) of the thigh and the shin of each leg.
    """
    thighs, shins = (np.stack([leg[bone] for leg in bones]) for bone in (0, 1))
    knees = hips + thighs @ OFFSETS[_KNEE]
    ankles = knees + shins @ OFFSETS[_ANKLE]
    along = ankles - hips
    along /= np.linalg.norm(along, axis=-1, keepdims=True)
    out = knees - hips
    out -= np.sum(out * along, -1, keepdims=True) * along
    ways, angles = np.cross(along, out), np.zeros(hips.shape[:2])
    for _ in range(_TRIES):
        now = hips + (knees - hips - out) + np.cos(angles)[..., None] * out + np.sin(angles)[..., None] * ways
        missing, gains = _missing(hips, now, ankles, np.cos(angles)[..., None] * ways - np.sin(angles)[..., None] * out)
        if not missing.any():
            break
        angles = angles + missing * gains / np.maximum(np.sum(gains**2, 0), _STRAIGHT)
    return matrix_from_vector(np.clip(angles, -_MOST, _MOST)[..., None] * along)


def _missing(hips: Array, knees: Array, ankles: Array, ways: Array) -> tuple[Array, Array]:
    """Return how far the legs are too close (T,), metres, and what a turn of each parts them by (2, T), m a radian.

    hips, knees, ankles: (2, T, 3). ways: (2, T, 3) how a knee moves for each radian.
    """
    starts, spans = np.stack([hips, knees]), np.stack([knees - hips, ankles - knees])
    (left, right), every = _PAIRS, np.arange(hips.shape[1])
    a, b, gap = spans[left, 0], spans[right, 1], starts[left, 0] - starts[right, 1]
    s, t = _closest(a, b, gap)
    between = gap + s[..., None] * a - t[..., None] * b
    distance = np.linalg.norm(between, axis=-1)
    worst = (_APART - distance).argmax(0), every
    deep = np.maximum((_APART - distance)[worst], 0.0)
    normal = between[worst] / np.maximum(distance[worst], 1e-6)[:, None]
    # A thigh moves with its knee the more the nearer to it, and so does a shin.
    shares = np.stack([np.where(bone[:, None] == 0, at, 1 - at)[worst] for bone, at in ((left, s), (right, t))])
    return deep * deep / (deep + _SOFT), shares * np.sum(normal * ways, -1) * [[1.0], [-1.0]]


def _closest(a: Array, b: Array, gap: Array) -> tuple[Array, Array]:
    """Return where on two segments (...) their closest points are, 0 to 1.

    a, b: (..., 3) the segments. gap: (..., 3) from the start of the second to that of the first.
    """
    aa, bb, ab, ag, bg = (np.sum(x * y, -1) for x, y in ((a, a), (b, b), (a, b), (a, gap), (b, gap)))
    s = np.clip((ab * bg - ag * bb) / np.maximum(aa * bb - ab * ab, 1e-9), 0.0, 1.0)
    t = np.clip((ab * s + bg) / bb, 0.0, 1.0)
    return np.clip((ab * t - ag) / aa, 0.0, 1.0), t


_KNEE, _ANKLE = JOINT_INDEX["left_knee"], JOINT_INDEX["left_ankle"]
_PAIRS: Final = np.array([[0, 0, 1], [0, 1, 0]])
"""Bones of the left and of the right leg that a swivel parts: 0 for thighs, 1 for shins. Two shins meet at the feet."""
_RADII: Final = {link.joint: link.shape.radius for link in LINKS if isinstance(link.shape, Capsule)}
_APART: Final = np.array([_RADII["left_hip"], _RADII["left_knee"]])[_PAIRS].sum(0)[:, None] + 0.008
"""(3, 1) least distance of the bones of each pair, with a margin, metres."""
_SOFT: Final = 0.002
"""Metres of the margin over which a swivel fades in."""
_STRAIGHT: Final = 0.03**2
"""A straight leg gains nothing from a swivel: least gain, squared, metres a radian."""
_MOST: Final = 0.4
"""Radians that a leg swivels at most."""
_TRIES: Final = 3
"""Newton steps of the swivel at most; with none missing it ends earlier. What is left after the last one stays."""
