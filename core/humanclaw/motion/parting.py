"""Keep shoes out of one another: how far a foot gives way to its own side.

Shoes are rectangles on the floor. "Aside" is square to the mean heading of both feet. (...) is any leading shape.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from humanclaw.body.ik import TOE_BASE
from humanclaw.body.pose import Array, smoothstep
from humanclaw.body.skeleton import LINKS, Box

_BOXES: Final = {one.joint: one.shape for one in LINKS if isinstance(one.shape, Box)}
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


def apart(sole: Array, yaw: Array, other: Array, other_yaw: Array, side: Array | float) -> Array:
    """Return the shift (..., 3) over the floor that keeps a foot out of the other one, and on its own side of it.

    sole, other: (..., 3) below the ankles. side: 1 for a left foot, -1 for a right one.
    """
    aside = _aside((yaw + other_yaw) / 2) * np.asarray(side)[..., None]
    between = (sole - other)[..., [0, 2]]
    centre = between + (HEEL_END + TOE_END) / 2 * (_ahead(yaw) - _ahead(other_yaw))
    across, along = _gaps(centre, yaw, other_yaw, aside)
    share = smoothstep(1 - along / _RAMP)
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
