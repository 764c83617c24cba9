"""Ways: where the body arrived, what was left to walk, and how directly it went."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Final

import numpy as np

from humanclaw import RecordedEpisode, StepRecord
from humanclaw.body import Array
from humanclaw.records import Vec3, reached, stopped_within_reach

WAY_LEFT: Final = 1.0
"""Longest remaining way of an arrival, metres. Beside a target it is 0.99 m at most over 500 successes; a body behind a
wall has several metres left."""
PELVIS_NEAR: Final = 0.65
"""Longest distance of an arrival from pelvis to target over the floor, metres. A walking body reaches 0.45 m ahead of
its pelvis; an outstretched arm reaches farther, and is no arrival."""


def arrived(recorded: RecordedEpisode) -> bool | None:
    """Tell whether the body stopped at a target (ArriveSR): NavSR, with the pelvis near and a short way left.

    None if the way was not measured. It is measured to the first place of a target.
    """
    record, steps = recorded.record, recorded.steps
    if record.geodesic is None:
        return None
    if not stopped_within_reach(steps):
        return False
    pelvis = straight(steps[-1].targets or record.targets, steps[-1].end)
    return pelvis <= PELVIS_NEAR and way_left(recorded) <= WAY_LEFT


def way_left(recorded: RecordedEpisode) -> float:
    """Return the last known way to a target, metres; infinite if none was measured."""
    known = (step.geodesic for step in reversed(recorded.steps) if step.geodesic is not None)
    begun = recorded.record.geodesic
    return next(known, float("inf") if begun is None else begun)


def gap_to(targets: Mapping[int, tuple[Vec3, Vec3]], point: Sequence[float]) -> Array:
    """Return the (2,) shortest way over the floor, x and z, from a world position to the nearest of some boxes, metres.

    Infinite without boxes.
    """
    here = np.array(point)[[0, 2]]
    boxes = (np.array(box)[:, [0, 2]] for box in targets.values())
    gaps = (np.clip(here, low, high) - here for low, high in boxes)
    return min(gaps, key=lambda gap: float(np.linalg.norm(gap)), default=np.full(2, np.inf))


def straight(targets: Mapping[int, tuple[Vec3, Vec3]], point: Sequence[float]) -> float:
    """Return the distance over the floor from a world position to the nearest of some boxes, metres."""
    return float(np.linalg.norm(gap_to(targets, point)))


def path_weighted(recorded: RecordedEpisode) -> tuple[float, float]:
    """Return SPL and SoftSPL: NavSR, and the covered share of the distance, times distance / max(path, distance).

    The distance is the geodesic at the start. The path is that of the pelvis on the floor, in half seconds. NaN without
    a geodesic.
    """
    way, steps = recorded.record.geodesic, recorded.steps
    if way is None or not recorded.record.spec.target_category:
        return float("nan"), float("nan")
    path = sum(sum(_ways(step)) for step in steps)
    weight = way / max(path, way) if max(path, way) else 1.0
    left = 0.0 if reached(recorded) else way_left(recorded)
    made = max(0.0, 1 - left / way) if way else float(left == 0)
    return float(stopped_within_reach(steps)) * weight, made * weight


def _ways(step: StepRecord) -> list[float]:
    """Return the way of the pelvis over the floor in each chunk, metres."""
    return [float(np.hypot(b[0] - a[0], b[2] - a[2])) for a, b in pairwise(step.path)]


def pace(step: StepRecord) -> float:
    """Return the longest way of the pelvis in a half second of a step, metres; 0 without motion."""
    return max(_ways(step)) if step.motion_frames else 0.0
