"""How far it still is to a target along the floor, from everywhere at once: one search an episode (paper, appendix B)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final

import numpy as np
from scipy.ndimage import distance_transform_edt
from skimage.graph import MCP_Geometric

from humanclaw.bench.routes import CELL, RADIUS, SQUEEZE, FloorPlan, near
from humanclaw.pose import Array
from humanclaw.scene import Scene

LEANING: Final = 1.0
"""Farther than this from a cell with a way a body is not leaning on something but shut in, metres."""


def geodesics(scene: Scene, targets: Sequence[int], floor: float = 0.0) -> Callable[[Array], float]:
    """A function of a world position (3,): length in metres of the shortest way to a place beside the nearest target.

    The way of a body that is RADIUS wide on each side; of a narrower one where that leads nowhere; infinite if none does. A
    body that leans on furniture is measured from the nearest free cell. Eight directions overestimate by up to 8 %.
    """
    plan = FloorPlan.of(scene, floor)
    goals = np.concatenate([near(plan, scene, target) for target in targets] or [np.empty((0, 2))])
    field = _field(plan, goals)
    return lambda point: float(plan.at(field, np.asarray(point)[[0, 2]]))


def _field(plan: FloorPlan, goals: Array) -> Array:
    """Distance of every cell to the nearest goal, metres; what only a narrower body reaches is added by its own search."""
    field = np.full(plan.blocked.shape, np.inf)
    for radius in (RADIUS, 0.2, SQUEEZE):
        free = plan.clearance >= radius
        starts = [tuple(cell) for cell in plan.cell(goals) if free[tuple(cell)]]
        if starts:
            found, _ = MCP_Geometric(np.where(free, 1.0, -1.0), sampling=(CELL, CELL)).find_costs(starts)
            field = np.where(np.isfinite(field), field, found)
    return _extended(field)


def _extended(field: Array) -> Array:
    """A cell where no body fits takes the way of the nearest cell with one, and the straight line to it."""
    known = np.isfinite(field)
    if not known.any():
        return field
    gap, nearest = distance_transform_edt(~known, sampling=CELL, return_indices=True)
    return np.asarray(np.where(gap < LEANING, field[tuple(nearest)] + gap, np.inf))
