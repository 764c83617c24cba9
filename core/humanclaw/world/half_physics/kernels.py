"""The loops that half-physics runs for each physics step or frame, compiled.

Quaternions are x, y, z, w; the first of a pose is in the world frame, the others in the frame of the joint's parent.
All arrays are contiguous and of double precision. Loops write elements: an assignment of arrays compiles much longer,
since it can raise an error with both shapes.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from humanclaw.body.pose import FPS, Array
from humanclaw.body.skeleton import N_JOINTS, OFFSETS, PARENTS
from humanclaw.world.compiling import compiled, inlined, internal
from humanclaw.world.half_physics.skeleton import POINT_JOINTS, POINT_RADII, POINTS, REACH

_OFFSETS, _PARENTS, _REACH = np.array(OFFSETS, float), np.array(PARENTS), np.ascontiguousarray(REACH)
_SMALL: Final = 1e-12
"""Keeps a division finite. No speed or length that matters is so small."""
_CLOSE: Final = 0.01
"""A link this close to a box that its hull fills only in part may meet the hull in any direction, metres. One that is
this deep in a full box may leave it in any."""
_STRAYS: Final = 0.25
"""Share of its way along an axis that a link may come nearer at least, since its way is foreseen at three moments
alone."""


@inlined
def _product(a: Array, b: Array, out: Array) -> None:
    """Multiply two quaternions: the rotation b, then the rotation a. out may be neither."""
    out[0] = a[3] * b[0] + a[0] * b[3] + a[1] * b[2] - a[2] * b[1]
    out[1] = a[3] * b[1] - a[0] * b[2] + a[1] * b[3] + a[2] * b[0]
    out[2] = a[3] * b[2] + a[0] * b[1] - a[1] * b[0] + a[2] * b[3]
    out[3] = a[3] * b[3] - a[0] * b[0] - a[1] * b[1] - a[2] * b[2]


@inlined
def _inverse(q: Array, out: Array) -> None:
    out[0], out[1], out[2], out[3] = -q[0], -q[1], -q[2], q[3]


@inlined
def _placed(place: Array, q: Array, v: Array, out: Array) -> None:
    """Add a rotated vector to a place."""
    x, y, z = (2 * (q[1] * v[2] - q[2] * v[1]), 2 * (q[2] * v[0] - q[0] * v[2]), 2 * (q[0] * v[1] - q[1] * v[0]))
    out[0] = place[0] + (v[0] + q[3] * x + q[1] * z - q[2] * y)
    out[1] = place[1] + (v[1] + q[3] * y + q[2] * x - q[0] * z)
    out[2] = place[2] + (v[2] + q[3] * z + q[0] * y - q[1] * x)


@inlined
def _length(v: Array) -> float:
    # An element of an array has no type.
    return np.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])  # type: ignore[no-any-return]


@inlined
def _scale(q: Array) -> float:
    """Return the length of a rotation vector, on the shortest arc, over that of its quaternion's vector."""
    length = _length(q)
    scale = 2.0 if length < 1e-9 else 2 * np.arctan2(length, abs(q[3])) / length
    return -scale if q[3] < 0 else scale


@compiled
def turns_between(before: Array, after: Array) -> Array:
    """Return (24, 3) rotation vectors from a pose (24, 4) to another, each in its joint's own frame."""
    turns, inverse, turn = np.empty((N_JOINTS, 3)), np.empty(4), np.empty(4)
    for joint in range(N_JOINTS):
        _inverse(before[joint], inverse)
        _product(inverse, after[joint], turn)
        scale = _scale(turn)
        for axis in range(3):
            turns[joint, axis] = turn[axis] * scale
    return turns


@compiled
def joint_speeds(actual: Array, target: Array, way: Array, recovery: Array, left: float, substeps: int) -> Array:
    """Return (24, 3) the speeds with which a pose (24, 4) comes to its target in the steps left of a frame.

    A joint moves as its pose moves, and makes up for the share `recovery` (24,) of what contact took from it. way:
    (24, 3) the turn of each pose in the frame. The root makes up for everything, and its speed is in the world frame.
    """
    speeds, inverse, missing = np.empty((N_JOINTS, 3)), np.empty(4), np.empty(4)
    for joint in range(N_JOINTS):
        _inverse(actual[joint], inverse)
        if joint == 0:
            _product(target[0], inverse, missing)
        else:
            _product(inverse, target[joint], missing)
        scale = _scale(missing)
        share = 1.0 if joint == 0 else recovery[joint]
        for axis in range(3):
            along = 0.0 if joint == 0 else way[joint, axis] * (left / substeps)
            turn = along + share * (missing[axis] * scale - along)
            speeds[joint, axis] = turn * (FPS * substeps / left)
    return speeds


@compiled
def hold_back(speeds: Array, most: float, fastest: float) -> None:
    """Slow each joint (24, 3) to at most `most`, rad/s, and then all alike, so that no link is faster than `fastest`,
    m/s."""
    for joint in range(N_JOINTS):
        share = min(1.0, most / max(_length(speeds[joint]), _SMALL))
        for axis in range(3):
            speeds[joint, axis] *= share
    share = min(1.0, fastest / max(_reached(speeds), 1e-9))
    for joint in range(N_JOINTS):
        for axis in range(3):
            speeds[joint, axis] *= share


@compiled
def link_speed(speeds: Array, way: Array, leaf: float) -> float:
    """Return a bound of the fastest link's speed relative to the pelvis, m/s.

    Each joint carries its links at most by its speed times their distance. Or the links move as in the motion, at most
    at `leaf`, and joints that catch up add to it.
    """
    late = np.empty((N_JOINTS, 3))
    for joint in range(N_JOINTS):
        for axis in range(3):
            late[joint, axis] = speeds[joint, axis] - way[joint, axis] * FPS
    # The root's speed and way are not in the same frame.
    late[0, 0], late[0, 1], late[0, 2] = abs(_length(speeds[0]) - _length(way[0]) * FPS), 0.0, 0.0
    # An element of an array has no type.
    return min(_reached(speeds), leaf + _reached(late))  # type: ignore[no-any-return]


@internal
def _reached(speeds: Array) -> float:
    """Return a bound of the links' speeds relative to the pelvis, m/s."""
    most, links = 0.0, np.zeros(_REACH.shape[1])
    for joint in range(N_JOINTS):
        speed = _length(speeds[joint])
        for link in range(links.size):
            links[link] += speed * _REACH[joint, link]
    for link in range(links.size):
        most = max(most, links[link])
    return most


@compiled
def moved_on(quaternions: Array, speeds: Array, seconds: float) -> Array:
    """Return (24, 4) a pose that turns at speeds (24, 3) for some seconds."""
    turned, step = np.empty((N_JOINTS, 4)), np.empty(4)
    for joint in range(N_JOINTS):
        half = _length(speeds[joint]) * seconds / 2
        scale = seconds / 2 * (np.sin(half) / half if half > 1e-9 else 1.0)
        for axis in range(3):
            step[axis] = speeds[joint, axis] * scale
        step[3] = np.cos(half)
        if joint == 0:
            _product(step, quaternions[0], turned[0])
        else:
            _product(quaternions[joint], step, turned[joint])
    return turned


@compiled
def link_points(root: Array, quaternions: Array) -> Array:
    """Return (P, 3) the points that span the links, world frame, for a body at root (3,) in a pose (24, 4)."""
    points, turns, places = np.empty(POINTS.shape), quaternions.copy(), np.empty((N_JOINTS, 3))
    places[0, 0], places[0, 1], places[0, 2] = root[0], root[1], root[2]
    for joint in range(1, N_JOINTS):
        parent = _PARENTS[joint]
        _product(turns[parent], quaternions[joint], turns[joint])
        _placed(places[parent], turns[parent], _OFFSETS[joint], places[joint])
    for number, joint in enumerate(POINT_JOINTS):
        _placed(places[joint], turns[joint], POINTS[number], points[number])
    return points


@compiled
def link_boxes(course: Array) -> Array:
    """Map (T, P, 3) link points on their way to (5, links, 3): lower and upper corners of each link's box now, those of
    the box that it sweeps, and how far its points move along each axis at most."""
    boxes, link = np.empty((5, _REACH.shape[1], 3)), -1
    for point, joint in enumerate(POINT_JOINTS):
        first = point == 0 or joint != POINT_JOINTS[point - 1]
        link += first
        for axis in range(3):
            low = high = now = course[0, point, axis]
            moved = 0.0
            for time in range(1, len(course)):
                here = course[time, point, axis]
                moved += abs(here - course[time - 1, point, axis])
                low, high = min(low, here), max(high, here)
            reach = POINT_RADII[point]
            box = boxes[:, link, axis]
            box[0] = now - reach if first else min(box[0], now - reach)
            box[1] = now + reach if first else max(box[1], now + reach)
            box[2] = low - reach if first else min(box[2], low - reach)
            box[3] = high + reach if first else max(box[3], high + reach)
            box[4] = moved if first else max(box[4], moved)
    return boxes


@compiled
def approach(boxes: Array, low: Array, high: Array, full: NDArray[np.bool_], slack: float) -> float:
    """Return how far a link comes at most towards a box that it may meet, along the axis that separates them, metres.

    A foot that glides over a floor or rises comes no nearer to it. For a link that comes close to a box which its
    hull does not fill, such as a leaning one's, or is deep in any, the whole way counts. boxes: as link_boxes returns
    them. low, high: (N, 3) corners of the other boxes. full: (N,) whether the hull fills its box. slack: boxes within
    so much of one another may meet, metres.
    """
    most, body = 0.0, boxes[2:4, 0].copy()
    for link in range(1, boxes.shape[1]):
        for axis in range(3):
            body[0, axis] = min(body[0, axis], boxes[2, link, axis])
            body[1, axis] = max(body[1, axis], boxes[3, link, axis])
    for other in range(len(low)):
        if not _meet(body[0], body[1], low[other], high[other], slack):
            continue
        for link in range(boxes.shape[1]):
            if _meet(boxes[2, link], boxes[3, link], low[other], high[other], slack):
                most = max(most, _way(boxes[:, link], low[other], high[other], full[other]))
    return most


@inlined
def _meet(low: Array, high: Array, other_low: Array, other_high: Array, slack: float) -> bool:
    """Tell whether two boxes are closer than slack along every axis."""
    for axis in range(3):
        if low[axis] - slack >= other_high[axis] or high[axis] + slack <= other_low[axis]:
            return False
    return True


@internal
def _way(box: Array, low: Array, high: Array, full: bool) -> float:
    """Return how far a link with a box (5, 3) comes towards another box."""
    gap, way = -np.inf, 0.0
    for side in range(2):
        for axis in range(3):
            apart = low[axis] - box[1, axis] if side == 0 else box[0, axis] - high[axis]
            if apart > gap:
                ahead = box[3, axis] - box[1, axis] if side == 0 else box[0, axis] - box[2, axis]
                gap, way = apart, max(ahead, _STRAYS * box[4, axis])
    near = gap <= -_CLOSE if full else gap - way <= _CLOSE
    return _length(box[4]) if near else way
