"""The true state of an episode, for privileged agents: where the body and its targets are, and what is in view."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final

import numpy as np

from humanclaw import EpisodeContext, HumanclawError, Scene
from humanclaw.body import JOINT_INDEX, LINKS, Array, Capsule, Pose2D, matrix_from_vector
from humanclaw.skills import Side
from humanclaw.world import CameraMount, OccupancyGrid, WorldState, distance_to_nearest, ego_camera

TOUCHING: Final = 0.005
"""Gap between hips and seat that counts as contact, metres."""
(_HIPS,) = (link.shape for link in LINKS if link.joint == "pelvis" and isinstance(link.shape, Capsule))


@dataclass(frozen=True, eq=False)
class BodyView:
    """The body in a state: place and heading of its pelvis, metres and radians, and places in its own frame."""

    state: WorldState

    @property
    def root(self) -> Array:
        return np.asarray(self.state.body.root[-1])

    @property
    def point(self) -> Array:
        """(2,) x and z of the pelvis."""
        return self.root[[0, 2]]

    @cached_property
    def yaw(self) -> float:
        return float(self.state.body.yaw()[-1])

    @cached_property
    def frame(self) -> Pose2D:
        return Pose2D.of(self.state.body)

    @cached_property
    def joints(self) -> Array:
        """(24, 3) in its own frame."""
        return self.local(self.state.body[-1:].joints()[0])

    def local(self, points: Array) -> Array:
        """Return (..., 3) world points in its own frame."""
        return self.frame.point_to_local(points)

    def on_floor(self, point: Array) -> tuple[float, float]:
        """Return a (2,) point as (left, forward) in its own frame, metres."""
        left, _, forward = self.local(np.array([point[0], 0.0, point[1]])).tolist()
        return left, forward

    @property
    def crouches(self) -> bool:
        """Whether the hips are under 0.8 m."""
        return float(self.joints[JOINT_INDEX["pelvis"], 1]) < 0.8

    def hand(self, side: Side) -> Array:
        """Return the knuckles (3,), in its own frame."""
        return np.asarray(self.joints[JOINT_INDEX[f"{side}_hand"]])


@dataclass
class Perception:
    """The true state of an episode, as distances and bearings of its targets."""

    context: EpisodeContext

    def __post_init__(self) -> None:
        if self.context.scene is None or self.context.state is None:
            raise HumanclawError("a scripted agent needs the scene and the state.", "Run it through the loop.")
        self._scene, self._state = self.context.scene, self.context.state

    def boxes(self) -> list[tuple[Any, Any]]:
        return [box(self._scene, self._state(), key) for key in self.context.spec.target_ids]

    def reach(self) -> float:
        """Return the distance from the nearest joint to the nearest target's bounding box, metres."""
        return distance_to_nearest(self._state().body.joints()[-1], self.boxes())

    def away(self) -> float:
        """Return the horizontal distance from the pelvis to the nearest target, metres."""
        here = BodyView(self._state()).point
        return distance_to_nearest(here, [(low[[0, 2]], high[[0, 2]]) for low, high in self.boxes()])

    def here(self) -> Array:
        """Return the (3,) position of the pelvis."""
        return BodyView(self._state()).root

    def bearing(self) -> float:
        """Return the bearing of the nearest target's middle, radians, left positive; 0 without a target."""
        middles = [(low + high) / 2 for low, high in self.boxes()]
        flat = [float(np.hypot(*(middle - self.here())[[0, 2]])) for middle in middles]
        return self.bearing_of(middles[int(np.argmin(flat))]) if middles else 0.0

    def bearing_of(self, point: Array) -> float:
        """Return the bearing of a (3,) point, radians, left positive."""
        left, _, forward = BodyView(self._state()).local(point)
        return float(np.arctan2(left, forward))


def box(scene: Scene, state: WorldState, target: int) -> tuple[Array, Array]:
    """Return the bounding box of a target at its current place."""
    return scene.aabb(target, state.objects.get(target))


def _hip_ends(state: WorldState) -> Array:
    """Return the (2, 3) ends of the axis of the pelvis link, world frame."""
    turn = matrix_from_vector(state.body.rotations[-1, 0])
    return np.asarray(state.body.root[-1] + np.array([_HIPS.a, _HIPS.b]) @ turn.T)


def _hip_bottom(state: WorldState) -> float:
    """Return the height of the lowest point of the pelvis link, metres."""
    return float(_hip_ends(state)[:, 1].min() - _HIPS.radius)


def on_seat(scene: Scene, state: WorldState, target: int) -> bool:
    """Tell whether a part of the hips is over a target and rests on its seat."""
    low, high = box(scene, state, target)
    obj = scene.by_id[target]
    seat = scene.assets[obj.asset].seat_height
    across = np.array([*_hip_ends(state), state.body.root[-1]])[:, [0, 2]]
    inside = ((across > low[[0, 2]]) & (across < high[[0, 2]])).all(axis=1).any()
    return bool(seat is not None and inside and _hip_bottom(state) <= obj.position[1] + seat + TOUCHING)


def in_view(
    plan: OccupancyGrid, scene: Scene, state: WorldState, target: int, gaze: CameraMount, last: float = 0.1
) -> tuple[float, float] | None:
    """Return bearing (radians, left positive) and distance (metres) of a target in view; None if it is not.

    A target is in view if at least three of 27 points of its bounding box are in the view cone and not hidden.
    last: metres before a point in which nothing hides it.
    """
    camera = ego_camera(state.body, gaze=gaze)
    low, high = box(scene, state, target)
    grid = np.stack(np.meshgrid([0.05, 0.5, 0.95], [0.05, 0.5, 0.95], [0.05, 0.5, 0.95]), -1).reshape(-1, 3)
    points = low + grid * (high - low)
    right = np.cross(camera.forward, camera.up)
    offset = points - camera.position
    depth = offset @ camera.forward
    reach = np.tan(np.radians(camera.fov) / 2) * np.maximum(depth, 1e-6)
    inside = (depth > 0.1) & (np.abs(offset @ right) < reach) & (np.abs(offset @ camera.up) < reach)
    shown = points[inside][plan.sees(camera.position, points[inside], last)]
    if len(shown) < 3:
        return None
    centre = np.mean(shown, axis=0) - camera.position
    bearing = np.arctan2(-centre @ right, centre @ camera.forward)
    return float(bearing), float(np.linalg.norm(centre[[0, 2]]))
