"""Shots of a film: from which side the camera sees each part of an episode, and what is left out meanwhile."""

from __future__ import annotations

from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from humanclaw import Motion, RecordedEpisode, Scene
from humanclaw.body import FPS, JOINT_INDEX, Array
from humanclaw.records import touched_above_ground
from humanclaw.world import GROUND, STRUCTURE, floors_of

Counts = NDArray[np.int64]
SHOWN: Final = [
    JOINT_INDEX[name] for name in ("head", "pelvis", "left_wrist", "right_wrist", "left_foot", "right_foot")
]
"""Joints that no object may hide."""
_CUT, _ASIDE, _BEHIND, _LEFT_OUT = 2.0, 0.3, 3.0, 0.3
"""What a shot costs by itself; and each second of it, by how far its side is down the list of SIDES, for each of the
SHOWN joints behind what is never left out, and for each piece of furniture that is left out. Walls cost nothing."""


@dataclass(frozen=True, eq=False)
class Shot:
    """A part of a film between two cuts."""

    eyes: Array
    """(T, 3) where the camera is in each of its frames, metres."""
    hidden: frozenset[int]
    """Ids of the objects that are left out of all of it: one that came and went would draw the eye."""


def kept(episode: RecordedEpisode, scene: Scene) -> frozenset[int]:
    """Return the ids of what is never left out: targets, and what the body touches or holds, except the building."""
    touched = {contact.object_id for step in episode.steps for contact in touched_above_ground(episode, step)}
    held = {key for step in episode.steps for key in step.held.values()}
    building = {obj.id for obj in scene.objects if obj.category in STRUCTURE}
    return frozenset((touched | held) - building | episode.record.targets.keys())


def shots(
    scene: Scene, motion: Motion, views: Sequence[Array], cuts: Sequence[int], keep: frozenset[int]
) -> list[Shot]:
    """Return the shots of a film that follows the body: few, and from views from which little has to be left out.

    views: (T, 3) camera positions, metres, those preferred first. cuts: frames at which a shot may begin. keep: ids of
    what is never left out.
    """
    bounds = np.unique([0, *cuts, len(motion)])
    joints = motion.joints()
    hiding = [in_the_way(scene, joints, eyes) for eyes in views]
    costs = np.stack([_costs(scene, hidden, bounds, keep) for hidden in hiding])
    # Two views are one on each side of the body.
    costs += _CUT + _ASIDE * (np.arange(len(views)) // 2)[:, None, None] * (bounds[1:] - bounds[:-1, None]) / FPS
    taken = _cheapest(costs, bounds)
    return [Shot(views[view][a:b], left_out(scene, _hidden(hiding[view], a, b), keep)) for a, b, view in taken]


def _hidden(hiding: Mapping[int, Counts], first: int, end: int) -> set[int]:
    return {key for key, counts in hiding.items() if counts[first:end].any()}


def _costs(scene: Scene, hiding: Mapping[int, Counts], bounds: Counts, keep: frozenset[int]) -> Array:
    """Return what is wrong with a shot from each of the bounds (rows) to each later one (columns), from one view."""
    seconds = np.diff(bounds) / FPS
    behind = sum((hiding[key] for key in keep & hiding.keys()), np.zeros(bounds[-1]))
    fixed = _BEHIND * np.add.reduceat(behind, bounds[:-1]) / FPS
    loose = [
        hiding[obj.id] for obj in scene.objects if obj.id in hiding.keys() - keep and obj.category not in STRUCTURE
    ]
    hides = np.maximum.reduceat(np.array([np.zeros(bounds[-1]), *loose]), bounds[:-1], axis=1) > 0
    costs = np.full((len(seconds), len(seconds)), np.inf)
    for row in range(len(seconds)):
        missing = np.logical_or.accumulate(hides[:, row:], axis=1).sum(0)
        costs[row, row:] = np.cumsum(fixed[row:]) + _LEFT_OUT * missing * np.cumsum(seconds[row:])
    return costs


def _cheapest(costs: Array, bounds: Counts) -> list[tuple[int, int, int]]:
    """Return first frame, end and view of each shot of the film that costs least (dynamic programming over its ends).

    costs: (views, N, N) of a shot from each of the bounds to each later one; (N + 1,) frames.
    """
    best, films = [0.0], [list[tuple[int, int, int]]()]
    for end in range(1, len(bounds)):
        total = costs[:, :end, end - 1] + best
        view, first = np.unravel_index(total.argmin(), total.shape)
        best.append(total[view, first])
        films.append([*films[first], (int(bounds[first]), int(bounds[end]), int(view))])
    return films[-1]


def left_out(scene: Scene, hiding: Set[int], keep: frozenset[int]) -> frozenset[int]:
    """Return the ids of what has to be left out, with what hangs on it or stands on it; never one of `keep`, nor the
    furniture that carries it."""
    hidden: set[int] = set()
    for key in hiding - keep:
        with_it = carried(scene, key)
        if scene.by_id[key].category in STRUCTURE or not with_it & keep:
            hidden |= {key} | with_it
    return frozenset(hidden - keep)


def in_the_way(scene: Scene, joints: Array, eyes: Array) -> dict[int, Counts]:
    """Return for each object that is between the eyes and the SHOWN joints at any time how many it hides, (T,).

    Objects are tested by their boxes at rest. Floors, stairs and rugs never count. joints: (T, 24, 3); eyes: (T, 3) or
    (1, 3); metres.
    """
    points = joints[:, SHOWN] + [0, 0.1, 0]
    boxes = {obj.id: scene.aabb(obj.id) for obj in scene.objects if obj.category not in (*GROUND, "rug")}
    hides = {key: _crosses(eyes[:, None], points, low, high).sum(1) for key, (low, high) in boxes.items()}
    return {key: counts for key, counts in hides.items() if counts.any()}


def carried(scene: Scene, carrier: int) -> set[int]:
    """Return the ids of the objects that hang on an object or stand on it: they touch it and stand on no floor."""
    low, high = scene.aabb(carrier)
    boxes = {obj.id: scene.aabb(obj.id) for obj in scene.objects if obj.category not in STRUCTURE and obj.id != carrier}
    floors = floors_of(scene)
    return {
        key for key, (a, b) in boxes.items()
        if (a < high + 0.05).all() and (b > low - 0.05).all() and not any(-0.05 <= a[1] - f <= 0.3 for f in floors)
    }  # fmt: skip


def _crosses(start: Array, end: Array, low: Array, high: Array) -> NDArray[np.bool_]:
    """Tell whether each segment from start to end, (..., 3), meets the box; one that begins inside does."""
    way = end - start
    way = np.where(np.abs(way) < 1e-9, 1e-9, way)  # Avoids division by zero along an axis.
    near, far = (low - start) / way, (high - start) / way
    enters, leaves = np.minimum(near, far).max(-1), np.maximum(near, far).min(-1)
    return np.asarray((enters <= leaves) & (leaves > 0) & (enters < 0.98))
