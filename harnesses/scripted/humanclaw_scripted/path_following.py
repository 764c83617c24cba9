"""A way through a house: level segments and runs of stairs, and the next point to walk to."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np

from humanclaw.body import Array
from humanclaw.world import OccupancyGrid, Segment, StairRun, length, stair_runs
from humanclaw_scripted.ground_truth import BodyView

LOOK_AHEAD: Final = 0.7
"""Greatest distance along the way to the next point to walk to, metres."""
BEFORE_STEPS: Final = 0.24
"""Distance from the pelvis to the first edge of a run of stairs before the first step, metres."""
ONTO_FLOOR: Final = 0.16
"""Distance of the pelvis beyond the last edge after the last step, metres."""


@dataclass(frozen=True, eq=False)
class LevelSegment:
    """A part of the way without stairs."""

    grid: OccupancyGrid
    path: Array
    """(N, 2) polyline."""


def parts(segments: Sequence[Segment]) -> list[LevelSegment | StairRun]:
    """Split a route into level segments and runs of stairs, alternating; the first and last are segments."""
    way: list[LevelSegment | StairRun] = []
    for segment in segments:
        path, first = segment.samples, segment.points[:1]
        for run in stair_runs(segment.grid, segment.samples):
            enters, leaves = (int(np.argmin(np.linalg.norm(path - end, axis=1))) for end in run.ends)
            before = [p for p in path[:enters] if (p - run.foot) @ run.way < -BEFORE_STEPS]
            way += [LevelSegment(segment.grid, np.array([*first, *before, run.point(-BEFORE_STEPS)])), run]
            path, first = path[leaves:], run.point(float(run.edges[-1]) + ONTO_FLOOR)[None]
        way.append(LevelSegment(segment.grid, np.concatenate([first, path] if len(way) else [segment.points])))
    return _joined(way)


def _joined(way: list[LevelSegment | StairRun]) -> list[LevelSegment | StairRun]:
    """Join neighbouring segments, on the grid of the storey and not of the stairs."""
    result: list[LevelSegment | StairRun] = []
    for part in way:
        last = result[-1] if result else None
        if isinstance(part, LevelSegment) and isinstance(last, LevelSegment):
            plan = last.grid if last.grid.slope is None else part.grid
            result[-1] = LevelSegment(plan, np.concatenate([last.path, part.path]))
        else:
            result.append(part)
    return result


def on_stairs(pose: BodyView, run: StairRun) -> tuple[float, float]:
    """Return how far along a run of stairs, and how far left of its middle line, the body is, metres."""
    along, across = pose.point - run.foot, np.array([run.way[1], -run.way[0]])
    return float(along @ run.way), float(along @ across)


def side_of(left: float) -> str:
    """Return the side of an angle or a way to the left."""
    return "left" if left > 0 else "right"


def remaining(way: Sequence[LevelSegment | StairRun], pose: BodyView) -> float:
    """Return the rest of the way, metres over the floor."""
    first, *rest = way
    if isinstance(first, StairRun):
        here = max(0.0, float(first.edges[-1]) - on_stairs(pose, first)[0])
    else:
        here = aim(first.grid, first.path, pose.point)[1]
    return here + sum(float(p.edges[-1]) if isinstance(p, StairRun) else length(p.path) for p in rest)


def aim(plan: OccupancyGrid, path: Array, point: Array, room: float = 0.2) -> tuple[Array, float]:
    """Return the farthest point of the path within LOOK_AHEAD that a straight walk reaches, and the metres left.

    room: how far from everything the walk keeps, metres.
    """
    marks = np.concatenate([np.linspace(a, b, max(2, int(np.linalg.norm(b - a) / 0.05) + 1)) for a, b in _legs(path)])
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(marks, axis=0), axis=1))])
    here = int(np.argmin(np.linalg.norm(marks - point, axis=1)))
    rest = float(along[-1] - along[here])
    ahead = [k for k in range(here, len(marks)) if along[k] - along[here] <= LOOK_AHEAD]
    for k in reversed(ahead):
        # With a point nearer than a step the body would step on the spot; only the end of the path may be that near.
        if along[k] - along[here] >= min(0.3, rest) and plan.clear(point, marks[k], room):
            return marks[k], rest
    return marks[ahead[len(ahead) // 2]], rest


def _legs(path: Array) -> list[tuple[Array, Array]]:
    return list(pairwise(path)) or [(path[0], path[0])]
