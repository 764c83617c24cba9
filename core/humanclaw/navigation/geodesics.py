"""How far it still is to a target on foot, from everywhere at once: one search an episode (paper, appendix B)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final

import numpy as np
from scipy.ndimage import distance_transform_edt

from humanclaw.navigation.routes import CELL, RADIUS, SQUEEZE, Storeys
from humanclaw.pose import Array
from humanclaw.scene import Scene

LEANING: Final = 1.0
"""Farther than this from a cell with a way a body is not leaning on something but shut in, metres."""


def geodesics(scene: Scene, targets: Sequence[int], floor: float = 0.0) -> Callable[[Array], float]:
    """A function of a world position (3,): length in metres of the shortest way to a place beside the nearest target.

    The way of a body that is RADIUS wide on each side, over the stairs if need be; of a narrower one where that leads nowhere;
    infinite if none does. A body that leans on furniture is measured from the nearest free cell. Eight directions overestimate
    by up to 8 %. floor: of the start; the position tells the storey, so that nothing depends on it here.
    """
    storeys = Storeys.of(scene)
    goals = np.concatenate([storeys.near(scene, target) for target in targets] or [np.empty((0, 3))])
    field = _field(storeys, goals)
    return lambda point: float(storeys.at(field, np.asarray(point)))


def _field(storeys: Storeys, goals: Array) -> Array:
    """(P, x cell, z cell) distance of every cell of every plan to the nearest goal, metres; what only a narrower body reaches is
    added by its own search."""
    field = np.full((len(storeys.plans), *storeys.plans[0].blocked.shape), np.inf)
    for radius in (RADIUS, 0.2, SQUEEZE):
        weights = [np.where(plan.fits(radius), plan.steepness, -1.0) for plan in storeys.plans]
        starts = goals[storeys.at(np.stack(weights), goals) > 0]
        if len(starts):
            found, _ = storeys.search(weights, starts)
            field = np.where(np.isfinite(field), field, found)
    return np.stack([_extended(layer) for layer in field])


def _extended(field: Array) -> Array:
    """A cell where no body fits takes the way of the nearest cell with one, and the straight line to it."""
    known = np.isfinite(field)
    if not known.any():
        return field
    gap, nearest = distance_transform_edt(~known, sampling=CELL, return_indices=True)
    return np.asarray(np.where(gap < LEANING, field[tuple(nearest)] + gap, np.inf))
