"""The surroundings of the body: how often to look for contacts in a frame, and the objects that a push can reach.

Both follow from boxes: those of a scene's hulls, and those that the links sweep on the way that the drive foresees.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from humanclaw.body.pose import Array, Motion, forward_kinematics, lengths, matrix_from_quaternion
from humanclaw.body.skeleton import JOINTS, LINKS, Box
from humanclaw.world.half_physics.solids import box_of
from humanclaw.world.scene import Scene

_SLACK: Final = 0.03
"""Metres by which a link may stray from the way foreseen, or an object from its place, in a frame."""
_CLOSE: Final = 0.01
"""A link this close to a box that its hull fills only in part may meet the hull in any direction, metres. One that is
this deep in a full box may leave it in any."""
_STRAYS: Final = 0.25
"""Share of its way along an axis that a link may come nearer at least, since its way is foreseen at three moments
alone."""
_HANDS_ON: Final = 0.1
"""Objects whose boxes are this close may push one another within a frame, metres."""

Boxes = tuple[Array, Array]
"""(N, 3) lower and (N, 3) upper corners, world frame, metres."""


def _corners() -> tuple[Array, NDArray[np.int64], Array]:
    """Return (P, 3) points that span the links, (P,) the joint of each, and (P,) the radius around it."""
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


_POINTS, _JOINT, _RADIUS = _corners()
_FIRST: Final = np.flatnonzero(np.diff(_JOINT, prepend=-1))
"""The first point of each link."""


class Surroundings:
    """Boxes of a scene: one for each fixed hull and one for each movable object."""

    def __init__(self, scene: Scene) -> None:
        """Measure a scene."""
        self.scene = scene
        fixed = [hull for obj in scene.objects if not obj.movable for hull in scene.hulls(obj.id)]
        self._fixed = _bounds(fixed)
        self._full = np.array([box_of(hull) is not None for hull in fixed], bool)
        moving = {obj.id: scene.assets[obj.asset].hulls for obj in scene.objects if obj.movable}
        self._ids = sorted(key for key, hulls in moving.items() if hulls)
        low, high = _bounds([np.concatenate(moving[key]) for key in self._ids])
        self._centres, self._halves = (low + high) / 2, (high - low) / 2
        self._places: Mapping[int, Array] = {}
        self._movable = np.empty((0, 3)), np.empty((0, 3))

    def look(self, course: Array, objects: Mapping[int, Array]) -> tuple[float, tuple[int, ...]]:
        """Return how far a link comes towards something in the coming frame, metres, and the ids of the movable objects
        that it may push, directly or through one another.

        course: (T, P, 3) points of the links from now to the end of the frame. objects: as World.objects has them.
        """
        links, swept = _boxes(course[0], course[0]), _boxes(course.min(axis=0), course.max(axis=0))
        body = swept[0].min(axis=0)[None], swept[1].max(axis=0)[None]
        low, high = self._boxes_of(objects)
        close = _pushed(body, low, high)
        still = _meet(self._fixed, body, _SLACK)[:, 0]
        obstacles = (
            np.concatenate([self._fixed[0][still], low[close]]),
            np.concatenate([self._fixed[1][still], high[close]]),
        )
        full = np.append(self._full[still], np.zeros(close.sum(), bool))
        steps = np.maximum.reduceat(np.abs(np.diff(course, axis=0)).sum(axis=0), _FIRST)
        near = tuple(self._ids[index] for index in np.flatnonzero(close))
        return _approach(links, swept, steps, obstacles, full), near

    def _boxes_of(self, objects: Mapping[int, Array]) -> Boxes:
        """Return the boxes of the movable objects, worked out anew only when one has moved."""
        if objects is not self._places:
            places = np.array([objects[key] for key in self._ids]).reshape(-1, 7)
            turns = matrix_from_quaternion(places[:, 3:])
            centres = places[:, :3] + np.einsum("nij,nj->ni", turns, self._centres)
            halves = np.einsum("nij,nj->ni", np.abs(turns), self._halves)
            self._places, self._movable = objects, (centres - halves, centres + halves)
        return self._movable


def _bounds(pieces: Sequence[NDArray[np.floating]]) -> Boxes:
    low, high = (np.array([reduced(piece, axis=0) for piece in pieces], float) for reduced in (np.min, np.max))
    return low.reshape(-1, 3), high.reshape(-1, 3)


def _meet(some: Boxes, others: Boxes, slack: float) -> NDArray[np.bool_]:
    """Tell for (some, others) whether two boxes are closer than slack along every axis, metres."""
    below = some[0][:, None] - slack < others[1]
    return np.asarray((below & (some[1][:, None] + slack > others[0])).all(axis=2))


def _pushed(body: Boxes, low: Array, high: Array) -> NDArray[np.bool_]:
    """Tell for (objects,) whether a push of the body, which moves within a box, can reach each within a frame."""
    close = _meet((low, high), body, _HANDS_ON)[:, 0]
    while close.any():
        reached = close | _meet((low, high), (low[close], high[close]), _HANDS_ON).any(axis=1)
        if (reached == close).all():
            break
        close = reached
    return close


def link_points(motion: Motion) -> Array:
    """Compute (T, P, 3) points that span the links of a body."""
    joints, turns = forward_kinematics(motion.root, motion.rotations)
    return np.asarray(joints[:, _JOINT] + np.einsum("tpij,pj->tpi", turns[:, _JOINT], _POINTS))


def _boxes(lowest: Array, highest: Array) -> Boxes:
    """Return boxes round the links. lowest, highest: (P, 3) of their points."""
    low = np.minimum.reduceat(lowest - _RADIUS[:, None], _FIRST)
    high = np.maximum.reduceat(highest + _RADIUS[:, None], _FIRST)
    return low, high


def _approach(links: Boxes, swept: Boxes, steps: Array, obstacles: Boxes, full: NDArray[np.bool_]) -> float:
    """Return how far a link comes at most towards a box that it may meet, along the axis that separates them, metres.

    A foot that glides over a floor or rises comes no nearer to it. For a link that is close to a box which its hull
    does not fill, such as a leaning one's, or deep in any, the whole way counts. steps: (links, 3) how far their points
    move along each axis. full: (obstacles,) whether the hull fills its box.
    """
    link, box = np.nonzero(_meet(swept, obstacles, _SLACK))
    if not len(link):
        return 0.0
    gaps = np.stack([obstacles[0][box] - links[1][link], links[0][link] - obstacles[1][box]], axis=1).reshape(-1, 6)
    ways = np.maximum([swept[1] - links[1], links[0] - swept[0]], _STRAYS * steps).swapaxes(0, 1)[link].reshape(-1, 6)
    pair, widest = np.arange(len(link)), gaps.argmax(axis=1)
    apart = gaps[pair, widest] > np.where(full[box], -_CLOSE, _CLOSE)
    return float(np.where(apart, ways[pair, widest], lengths(steps)[link]).max())
