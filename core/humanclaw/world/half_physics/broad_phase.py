"""The broad phase: how often to look for contacts in a frame, and the objects that a push can reach.

Both follow from boxes: those of a scene's hulls, and those that the links sweep on the way that the drive foresees.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from itertools import permutations
from typing import Final

import numpy as np
from numpy.typing import NDArray

from humanclaw.body.pose import Array, matrix_from_quaternion
from humanclaw.body.skeleton import LINKS
from humanclaw.world.half_physics.kernels import approach, link_boxes
from humanclaw.world.half_physics.solids import box_of
from humanclaw.world.scene import Scene

_SLACK: Final = 0.03
"""Metres by which a link may stray from the way foreseen, or an object from its place, in a frame."""
_HANDS_ON: Final = 0.1
"""Objects whose boxes are this close may push one another within a frame, metres."""

_HOLLOW: Final = np.zeros(len(LINKS), bool)
"""No link fills its box."""

Boxes = tuple[Array, Array]
"""(N, 3) lower and (N, 3) upper corners, world frame, metres."""


class BroadPhase:
    """Boxes of a scene: one for each fixed hull and one for each movable object."""

    def __init__(self, scene: Scene) -> None:
        """Measure a scene."""
        self.scene = scene
        fixed = [hull for obj in scene.objects if not obj.movable for hull in scene.hulls(obj.id)]
        self._fixed = _bounds(fixed)
        self._full = np.array([box_of(hull) is not None for hull in fixed], bool)
        moving = {obj.id: scene.assets[obj.asset].hulls for obj in scene.objects if obj.movable}
        self._ids = sorted(key for key, hulls in moving.items() if hulls)
        self._hung = np.array([scene.by_id[key].joint is not None for key in self._ids], bool)
        low, high = _bounds([np.concatenate(moving[key]) for key in self._ids])
        self._centres, self._halves = (low + high) / 2, (high - low) / 2
        self._places: Mapping[int, Array] = {}
        self._movable = np.empty((0, 3)), np.empty((0, 3))

    def look(
        self, course: Array, objects: Mapping[int, Array], held: Collection[int] = ()
    ) -> tuple[float, tuple[int, ...]]:
        """Return how far a link comes towards something in the coming frame, metres, and the ids of the movable objects
        that it may push, directly or through one another.

        course: (T, P, 3) points of the links from now to the end of the frame. objects: as World.objects has them.
        held: ids of those that move with a hand: nothing comes towards them or pushes them.
        """
        boxes, (low, high) = link_boxes(course), self._boxes_of(objects)
        towards = approach(boxes, *self._fixed, self._full, _SLACK)
        close = _pushed((boxes[2].min(axis=0)[None], boxes[3].max(axis=0)[None]), low, high, self._hung)
        if held:
            close &= ~np.isin(self._ids, list(held))
        if not close.any():
            return towards, ()
        loose = approach(boxes, low[close], high[close], np.zeros(close.sum(), bool), _SLACK)
        return max(towards, loose), tuple(self._ids[index] for index in np.flatnonzero(close))

    @staticmethod
    def between(courses: Sequence[Array]) -> float:
        """Return how far links of bodies and of others come together at most in the coming frame, metres; 0 if no two
        are near. courses: as for look, one for each body."""
        boxes = [link_boxes(course) for course in courses]
        return float(sum(approach(a, b[2], b[3], _HOLLOW, _SLACK) for a, b in permutations(boxes, 2)))

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
    x, y, z = np.moveaxis((some[0][:, None] - slack < others[1]) & (some[1][:, None] + slack > others[0]), -1, 0)
    return np.asarray(x & y & z)  # numpy's own all() takes several times as long.


def _pushed(body: Boxes, low: Array, high: Array, hung: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Tell for (objects,) whether a push of the body, which moves within a box, can reach each within a frame.

    hung: (objects,) which are on joints. Those do not push one another: a kitchen's doors and drawers stand in a row.
    """
    close = _meet((low, high), body, _HANDS_ON)[:, 0]
    while close.any():
        pushes = _meet((low, high), (low[close], high[close]), _HANDS_ON) & ~(hung[:, None] & hung[close])
        reached = close | pushes.any(axis=1)
        if (reached == close).all():
            break
        close = reached
    return close
