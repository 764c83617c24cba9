"""Perception from depth: points of a view, the pose by aligning views, and a map of everything seen.

Nothing here knows the scene or the true pose. Places are (..., 2) arrays of x (left) and z (ahead), metres, in the
frame of the first view: odometry, which drifts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Final, Self

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_closing, binary_dilation, distance_transform_edt, label
from scipy.spatial import cKDTree

from humanclaw.body import Array, Pose2D, rest_pose, wrap_angle
from humanclaw.world import BODY_ID, CELL, RADIUS, CameraMount, OccupancyGrid, View, ego_camera

STRIDE: Final = 2
"""Only every STRIDE-th pixel of each row and column is used."""
FAR: Final = 6.0
"""Range within which points count, metres. Beyond it the view is too flat to tell floor cells apart."""
LEVEL: Final = 0.08
"""Points within this height of the floor count as floor, metres."""
HEADROOM: Final = 1.85
"""Points higher than this over the floor are no obstacles, metres."""
EXTENT: Final = 40.0
"""Side of the map, metres; the first view is at its centre."""
SEAT_HEIGHTS: Final = (0.25, 0.62)
"""Heights of seats over the floor, metres."""
CERTAIN: Final = 4
"""Greatest evidence for or against an obstacle, in views, so that a few later views can reverse it."""
FEW_CELLS: Final = 8
"""Frontiers and seats with fewer cells are ignored."""
Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Sight:
    """One view as points.

    points: (N, 3) left of the pelvis, over the floor, ahead of the pelvis, metres. mine: (N,) whether a point shows a
    target. pixels: number of pixels of the view that show a target.
    """

    points: Array
    mine: Mask
    pixels: int

    @classmethod
    def of(cls, view: View, targets: Sequence[int], gaze: CameraMount) -> Sight:
        """Back-project a view of the ego camera. The floor in view corrects the height of the eyes.

        targets: ids of the objects that are looked for.
        """
        shown, mine = (view.ids != 0) & (view.ids != BODY_ID), np.isin(view.ids, targets)
        depth = view.depth[::STRIDE, ::STRIDE].astype(float)
        drawn = shown[::STRIDE, ::STRIDE] & (depth > 0.05) & np.isfinite(depth)
        rows, columns = np.nonzero(drawn)
        half, ahead = len(view.depth) / 2, depth[drawn]
        right, up = ((STRIDE * columns + 0.5) / half - 1) * ahead, (1 - (STRIDE * rows + 0.5) / half) * ahead
        sine, cosine = np.sin(gaze.pitch), np.cos(gaze.pitch)
        standing = rest_pose()
        eye = ego_camera(standing, gaze=gaze).position - standing.root[-1] * [1, 0, 1]
        points = np.stack([-right, eye[1] + ahead * sine + up * cosine, eye[2] + ahead * cosine - up * sine], -1)
        # The body bends and sways, so its eyes are not exactly at standing height.
        floor = (np.abs(points[:, 1]) < 2 * LEVEL) & (points[:, 2] < 3.0)
        points[:, 1] -= np.median(points[floor, 1]) if floor.sum() > 100 else 0.0
        return cls(points, mine[::STRIDE, ::STRIDE][drawn], int(mine.sum()))

    def near(self, most: float = FAR) -> Mask:
        """Return a mask (N,) of the points within range. most: metres."""
        return np.asarray(np.hypot(self.points[:, 0], self.points[:, 2]) < most)

    def obstacles(self) -> Array:
        """Return (M, 2) obstacles, one point for each 5 cm cell."""
        high = (np.abs(self.points[:, 1]) > LEVEL) & (self.points[:, 1] < HEADROOM) & self.near()
        return _thinned(self.points[high][:, [0, 2]])


def _thinned(points: Array) -> Array:
    """Keep one of the (N, 2) points of each 5 cm cell."""
    # Both indices are packed into one integer, because unique is much faster on integers than on rows.
    keys = np.unique(np.round(points / CELL).astype(int) @ [1 << 20, 1] + (1 << 19))
    return np.stack([keys >> 20, (keys & ((1 << 20) - 1)) - (1 << 19)], -1) * CELL


# -- pose --------------------------------------------------------------------------------------------------------------
def placed(pose: Pose2D, points: Array) -> Array:
    """Transform (..., 2) points from the body's frame to the map's."""
    sine, cosine = np.sin(pose.yaw), np.cos(pose.yaw)
    left, ahead = points[..., 0], points[..., 1]
    return np.stack([pose.x + cosine * left + sine * ahead, pose.z - sine * left + cosine * ahead], -1)


def moved(pose: Pose2D, left: float, ahead: float, turn: float) -> Pose2D:
    """Return the pose after a displacement in the body's frame and a turn to the left."""
    x, z = placed(pose, np.array([left, ahead]))
    return Pose2D(float(x), float(z), float(wrap_angle(pose.yaw + turn)))


def aligned(points: Array, landmarks: Any, guess: Pose2D) -> tuple[Pose2D, float]:
    """Find the pose near a guess at which (N, 2) points fit the landmarks, a k-d tree.

    Iterated closest points (Besl and McKay 1992). Returns the pose and the mean residual, clipped at 0.25 m a point;
    the guess and infinity if fewer than 30 points have a partner.
    """
    pose = guess
    for _ in range(12):
        distances, partners = landmarks.query(placed(pose, points), distance_upper_bound=0.25)
        fits = np.isfinite(distances)
        if fits.sum() < 30:
            return guess, float("inf")
        pose = _fitted(points[fits], landmarks.data[partners[fits]])
    return pose, float(np.minimum(distances, 0.25).mean())


def _fitted(points: Array, goals: Array) -> Pose2D:
    """Return the least-squares pose that maps (N, 2) points of the body's frame to (N, 2) places."""
    p, q = points - points.mean(0), goals - goals.mean(0)
    sine = float((p[:, 1] * q[:, 0] - p[:, 0] * q[:, 1]).sum())
    yaw = float(np.arctan2(sine, float((p * q).sum())))
    x, z = goals.mean(0) - placed(Pose2D(0.0, 0.0, yaw), points.mean(0))
    return Pose2D(float(x), float(z), yaw)


# -- map ---------------------------------------------------------------------------------------------------------------
@dataclass(eq=False)
class SeenMap:
    """A grid of 5 cm cells with everything that the views have shown."""

    known: Mask
    """Cells whose floor was seen."""
    evidence: NDArray[np.int8]
    """Views that showed an obstacle minus views that showed floor, clipped to CERTAIN."""
    bumped: Mask
    """Cells with an obstacle that was felt and not seen."""
    target: Array
    """Height of the highest point of a target in each cell, metres; 0 without one."""
    origin: tuple[float, float] = field(default=(-EXTENT / 2, -EXTENT / 2))

    @classmethod
    def empty(cls) -> Self:
        shape = (round(EXTENT / CELL),) * 2
        fresh = cls(np.zeros(shape, bool), np.zeros(shape, np.int8), np.zeros(shape, bool), np.zeros(shape))
        fresh.known |= fresh.disk(np.zeros(2), 0.8)  # The body stands there, and its eyes do not see the floor so near.
        return fresh

    def disk(self, point: Array, radius: float) -> Mask:
        """Return the cells within a radius of a (2,) point."""
        mask = np.zeros(self.known.shape, bool)
        reach = round(radius / CELL)
        (i, j), span = self.cell(point), np.arange(-reach, reach + 1)
        near = np.add.outer(span**2, span**2) <= reach**2
        mask[i - reach : i + reach + 1, j - reach : j + reach + 1] = near
        return mask

    def cell(self, points: Array) -> NDArray[np.int64]:
        """Return (..., 2) indices of (..., 2) points, clipped to the map."""
        index = np.floor((points - np.array(self.origin)) / CELL).astype(np.int64)
        # A margin of 40 cells leaves room for the disks around points at the edge.
        inside: NDArray[np.int64] = np.clip(index, 40, len(self.known) - 41)
        return inside

    def add(self, sight: Sight, pose: Pose2D) -> None:
        """Add a view from a pose."""
        cells = self.cell(placed(pose, sight.points[:, [0, 2]]))
        heights, near = sight.points[:, 1], sight.near()
        floor, blocked = (np.zeros(self.known.shape, bool) for _ in range(2))
        low, high = near & (np.abs(heights) <= LEVEL), near & (np.abs(heights) > LEVEL) & (heights < HEADROOM)
        floor[tuple(cells[low].T)], blocked[tuple(cells[high].T)] = True, True
        self.known |= floor
        # A view of floor is evidence against an obstacle: an early wrong one disappears again.
        change = blocked.astype(np.int8) - (floor & ~blocked).astype(np.int8)
        self.evidence = np.clip(self.evidence + change, -CERTAIN, CERTAIN)
        mine = sight.mine & sight.near(2 * FAR)
        np.maximum.at(self.target, tuple(cells[mine].T), np.maximum(heights[mine], 0.01))

    def bump(self, point: Array) -> None:
        """Add an obstacle at a (2,) point that was not seen."""
        self.bumped |= self.disk(point, 0.12)

    def locate(self, sight: Sight, guesses: list[Pose2D]) -> Pose2D:
        """Find the pose at which a view fits the map best.

        guesses: the first wins unless another fits clearly better.
        """
        cells, points = np.argwhere(self.evidence > 0), sight.obstacles()
        if len(cells) < 30 or len(points) < 30:
            return guesses[0]
        tree = cKDTree((cells + 0.5) * CELL + self.origin)
        fits = [aligned(points, tree, guess) for guess in guesses]
        best, left = min(fits, key=lambda fit: fit[1])
        first, residue = fits[0]
        return first if residue < left + 0.004 else best

    def grid(self) -> OccupancyGrid:
        """Return the known part of the map as a grid to plan on."""
        blocked = (self.evidence > 0) | self.bumped
        # Distant floor is seen as separate dots; closing joins them.
        known = binary_closing(self.known, iterations=3) | self.known
        rows, columns = (np.flatnonzero((known | blocked).any(axis)) for axis in (1, 0))
        part = slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)
        origin = self.origin[0] + rows[0] * CELL, self.origin[1] + columns[0] * CELL
        shape = known[part].shape
        none, ground = np.zeros(shape), np.where(known | blocked, 0.0, np.nan)[part]
        overhead = (none + np.inf, none)
        return OccupancyGrid(origin, blocked[part], none > 0, none.astype(np.int32), none, overhead, ground)

    def heights(self, grid: OccupancyGrid) -> Array:
        """Return the target's heights in the cells of a grid cut from this map."""
        i, j = np.round((np.array(grid.origin) - self.origin) / CELL).astype(int)
        rows, columns = grid.blocked.shape
        return self.target[i : i + rows, j : j + columns]


def edges(grid: OccupancyGrid) -> list[Array]:
    """Return frontiers (Yamauchi 1997): (N, 2) places at the edge of the known free floor, an array a stretch."""
    unknown = ~np.isfinite(grid.ground)
    border = np.pad(unknown, 1, constant_values=True)
    edge = grid.fits(RADIUS) & binary_dilation(border, iterations=2)[1:-1, 1:-1]
    groups, count = label(edge, np.ones((3, 3)))
    stretches = (np.argwhere(groups == k) for k in range(1, count + 1))
    return [grid.point(cells) for cells in stretches if len(cells) >= FEW_CELLS]


def seats(heights: Array) -> Mask:
    """Return the cells of a target at the height of a seat; none if there are too few."""
    low, high = SEAT_HEIGHTS
    mask = (heights > low) & (heights < high)
    return np.asarray(mask if mask.sum() > FEW_CELLS else mask & False)


def gap_to(mask: Mask) -> Array:
    """Return the distance of every cell from a mask, metres; infinite if the mask is empty."""
    return np.asarray(distance_transform_edt(~mask) * CELL if mask.any() else np.full(mask.shape, np.inf))
