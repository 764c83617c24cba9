"""Where hands work: the handles of what opens, and the places to stand around a thing."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.spatial import Delaunay

from humanclaw import Scene
from humanclaw.body import Array, matrix_from_quaternion
from humanclaw.world import OccupancyGrid, SceneObject, Slide, Viewpoint, WorldState, room_at
from humanclaw_scripted.ground_truth import BodyView, box

_STEP: Final = {True: 0.3, False: 0.15}
"""How far a hand takes a door (radians) or a drawer (metres) with a call."""
GRIPS: Final = tuple(((0.0, -gap - 0.1), (0.0, -gap - 0.01), (0.0, -gap)) for gap in (0.06, 0.035, 0.08, 0.05))
"""Metres above a handle and ahead of it of a hand on its way, in one try after the other."""
HOOKS: Final = tuple(
    ((0.22, 0.0), (0.1, ahead), (down, ahead)) for ahead, down in ((0.05, 0.07), (0.07, 0.05), (0.03, 0.05))
)
"""The same over the edge of a lid that is open, with the palm towards the body."""
_ROOM: Final = 0.2
"""Metres that are free around a place to stand."""

_CROWD: Final = 50.0
"""Metres that a spot may be farther off for each metre of room that it has more, as far as a thing needs room."""
_FLAT: Final = 0.02
"""Metres below the highest point of furniture down to which its parts are its top."""
_PALM_ROOM: Final = 0.07
"""Metres from the side of a thing to the palm that comes to it."""
_HAND_ROOM: Final = 0.05
"""Metres around a hand that are free."""


@dataclass(frozen=True, eq=False)
class Handle:
    """Where a door, a drawer or a lid is taken hold of."""

    obj: SceneObject
    point: Array
    """(3,) in the frame of its asset."""

    @classmethod
    def of(cls, hulls: Callable[[int, Array], list[Array]], obj: SceneObject, floor: float) -> Handle:
        """Return the spot of a front that is farthest from its hinge, at the height of a hand over a floor (metres)."""
        joint = obj.joint
        assert joint is not None
        still = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
        points = np.concatenate(hulls(obj.id, still))
        low, high = points.min(0), points.max(0)
        x, y = (low[0] + high[0]) / 2, high[1] - 0.05
        if not isinstance(joint, Slide) and abs(joint.axis[1]) > 0.5:
            x = low[0] + 0.06 if high[0] - joint.point[0] < joint.point[0] - low[0] else high[0] - 0.06
            y = float(np.clip(floor + 1.05 - obj.position[1], low[1] + 0.1, high[1] - 0.1))
        return cls(obj, np.array([x, y, high[2]]))

    @property
    def wide(self) -> float:
        """The state in which it is wide open."""
        assert self.obj.joint is not None
        return max(self.obj.joint.low, self.obj.joint.high, key=abs)

    @property
    def tilts(self) -> bool:
        """Whether it is a lid, which comes down before the body."""
        joint = self.obj.joint
        return joint is not None and not isinstance(joint, Slide) and abs(joint.axis[1]) <= 0.5

    @property
    def near(self) -> float:
        """Metres ahead of the hips to which a hand draws it: a lid comes down on knees that are nearer."""
        return 0.3 if self.tilts else 0.22

    @property
    def step(self) -> float:
        return _STEP[not isinstance(self.obj.joint, Slide)]

    @property
    def out(self) -> Array:
        """Where its front looks, (3,)."""
        return np.asarray(matrix_from_quaternion(self.obj.at(0.0)[3:]) @ [0.0, 0.0, 1.0])

    def at(self, state: float) -> Array:
        """Return where it is in a state, (3,)."""
        place = self.obj.at(state)
        return np.asarray(place[:3] + matrix_from_quaternion(place[3:]) @ self.point)

    def state(self, world: WorldState) -> float:
        place = world.objects.get(self.obj.id)
        return self.obj.state if place is None else self.obj.state_at(place)

    def now(self, world: WorldState) -> Array:
        return self.at(self.state(world))

    def share(self, world: WorldState) -> float:
        """Return how far the thing is open, as a share of the way."""
        return (self.state(world) - self.obj.state) / (self.wide - self.obj.state)

    def inside(self, place: Array) -> float:
        """Return a price (metres) for a place (3,) that a door swings over."""
        middle = (self.at(self.obj.state) + self.at(self.wide)) / 2
        return 0.3 if float(np.linalg.norm((place - middle)[[0, 2]])) < 0.35 else 0.0


def places_around(
    scene: Scene, grid: OccupancyGrid, key: int, low: Array, high: Array, far: float
) -> Iterator[Viewpoint]:
    """Yield free places around a box (3,) that are nearer to it than far (metres), in its room and on its level."""
    first, last = grid.cell(low[[0, 2]] - far), grid.cell(high[[0, 2]] + far) + 1
    points = grid.point(np.argwhere(grid.clearance[first[0] : last[0], first[1] : last[1]] >= _ROOM) + first)
    ways = np.clip(points, low[[0, 2]], high[[0, 2]]) - points
    middle = ((low + high) / 2)[[0, 2]]
    ground = float(grid.at(grid.ground, middle))
    level = np.abs(grid.at(grid.ground, points) - ground) < 0.05
    room = room_at(scene, float(middle[0]), float(middle[1]), ground)
    for (x, z), way, gap in zip(points[level].tolist(), ways[level], np.linalg.norm(ways[level], axis=1), strict=True):
        if gap < far and room_at(scene, x, z, ground) == room:
            yield Viewpoint(key, x, z, float(np.arctan2(*way)), float(gap), floor=ground)


def free_sides(scene: Scene, state: WorldState, key: int, places: Array) -> Array:
    """Return whether a hand has room to the right and to the left of a thing, (N, 2), from places (N, 2)."""
    low, high = box(scene, state, key)
    ways = ((low + high) / 2)[[0, 2]] - places
    ways /= np.maximum(np.linalg.norm(ways, axis=1, keepdims=True), 1e-9)
    right = np.stack([-ways[:, 1], ways[:, 0]], 1)
    out = np.stack([right, -right], 1)
    far = np.abs(out) @ ((high - low)[[0, 2]] / 2) + _PALM_ROOM
    x, z = np.moveaxis(((low + high) / 2)[[0, 2]] + out * far[..., None], -1, 0)
    spots = np.stack([x, np.full_like(x, low[1] + 0.1), z], -1)
    gaps = [_gap(*piece, spots, spots) for piece in _pieces_near(scene, state, low, high, key)]
    return np.asarray(np.min([np.full_like(x, np.inf), *gaps], axis=0) > _HAND_ROOM)


def _pieces_near(scene: Scene, state: WorldState, low: Array, high: Array, *but: int) -> Iterator[tuple[Array, Array]]:
    """Yield the corners (3,) of each convex piece of the other things less than half a metre from a box (3,)."""
    others = (obj.id for obj in scene.objects if obj.id not in but)
    near = (key for key in others if _gap(*box(scene, state, key), low, high) < 0.5)
    return ((hull.min(0), hull.max(0)) for key in near for hull in scene.hulls(key, state.objects.get(key)))


def _gap(low: Array, high: Array, first: Array, last: Array) -> Array:
    """Return the distance of a box from others with corners (..., 3), metres."""
    return np.asarray(np.linalg.norm(np.maximum(np.maximum(low - last, first - high), 0.0), axis=-1))


def spot_on(scene: Scene, state: WorldState, thing: int, place: int) -> Array:
    """Return where a thing fits on top of a piece of furniture, nearest to the body, (3,)."""
    own, (low, high) = box(scene, state, thing), box(scene, state, place)
    half = (own[1] - own[0])[[0, 2]].max() / 2
    room = np.minimum(half + 0.04, (high - low)[[0, 2]] / 2 - 0.01)
    xs, zs = (np.linspace(low[k] + room[j], high[k] - room[j], 25) for j, k in enumerate((0, 2)))
    spots = np.stack(np.meshgrid(xs, zs), -1).reshape(-1, 2)
    others = _pieces_near(scene, state, low, high, thing, place)
    there = [(a, b) for a, b in others if a[1] < high[1] + 0.3 and b[1] > high[1] + 0.01]
    gaps = [np.maximum(np.maximum(a[[0, 2]] - spots, spots - b[[0, 2]]).max(1), 0.0) for a, b in there]
    short = np.maximum(half + 0.02 - np.min([np.full(len(spots), np.inf), *gaps], axis=0), 0.0)
    short += _bare(scene, state, place, spots, half)
    x, z = spots[np.argmin(np.linalg.norm(spots - BodyView(state).point, axis=1) + _CROWD * short)]
    return np.array([x, high[1], z])


def _bare(scene: Scene, state: WorldState, place: int, spots: Array, half: float) -> Array:
    """Return the share of four points around each spot (N, 2) that the top of a piece of furniture is not under."""
    hulls = scene.hulls(place, state.objects.get(place))
    top = max(hull[:, 1].max() for hull in hulls)
    around = spots[:, None] + half * np.array([[1, 0], [-1, 0], [0, 1], [0, -1]])
    tops = (Delaunay(hull[:, [0, 2]]) for hull in hulls if hull[:, 1].max() > top - _FLAT)
    return np.asarray(1.0 - np.any([top.find_simplex(around) >= 0 for top in tops], axis=0).mean(1))
