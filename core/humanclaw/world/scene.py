"""A scene as plain values: assets (shape and looks), placed objects, rooms and a start.

Frame: metres, Y up. A scene is complete in itself: simulators and renderers need nothing else, and its digest names it.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from humanclaw.body.pose import Array, Pose2D, matrix_from_quaternion, vector_from_matrix, wrap_angle
from humanclaw.errors import SceneError
from humanclaw.world.joints import Joint, Slide, Vec3 as Vec3, facts_of, joint_of

Quaternion = tuple[float, float, float, float]

STRUCTURE: Final = frozenset({"wall", "floor", "ceiling", "stairs", "door", "window"})
"""Categories of the building; all others are furniture."""
GROUND: Final = ("floor", "stairs")
"""Categories that feet stand on."""
_ROOMS: Final = {"living": "living room", "dining": "dining room", "kids": "children's room"}
"""Kinds of rooms that are not what people say."""
_CUSHION: Final = 0.03
"""Metres by which a seat may be above the collision pieces that carry it: a cover, or what their making took off."""


@dataclass(frozen=True, eq=False)
class Mesh:
    """A textured triangle mesh: one texture for all of it (an atlas where there are several materials).

    vertices: (N, 3) float32 metres. faces: (M, 3) int32, counter-clockwise from outside. uv: (N, 2) float32 in 0..1, v
    up. texture: (H, W, 3) uint8, first row at v = 1. normals: (N, 3) float32 of a body's skin; by default a renderer
    takes them from the faces.
    """

    vertices: NDArray[np.float32]
    faces: NDArray[np.int32]
    uv: NDArray[np.float32]
    texture: NDArray[np.uint8]
    normals: NDArray[np.float32] | None = None

    def __post_init__(self) -> None:
        if len(self.uv) != len(self.vertices):
            raise SceneError(f"a mesh needs one uv a vertex; got {len(self.uv)} for {len(self.vertices)}.")


@dataclass(frozen=True, eq=False)
class Asset:
    """Shape and looks of an object in its own frame: origin at the centre of its footprint, y = 0 at its bottom, front
    +Z."""

    name: str
    category: str
    mesh: Mesh
    hulls: tuple[NDArray[np.float32], ...]
    """Convex collision pieces, each the (K, 3) vertices of its hull. Empty for objects without a body, such as rugs."""
    seat_height: float | None = None
    """Height of the sitting surface above the bottom, metres; None if it is not a seat."""
    source: str = "generated"
    licence: str = "Apache-2.0"

    def __post_init__(self) -> None:
        if not all(len(hull) for hull in self.hulls):
            raise SceneError(f"a collision piece of asset {self.name!r} has no points.", "Leave that piece out.")
        if not all(np.isfinite(hull).all() for hull in self.hulls):
            raise SceneError(
                f"a collision piece of asset {self.name!r} has points that are no numbers.", "Export it again."
            )
        if self.seat_height is None:
            return
        if not self.hulls:
            raise SceneError(f"asset {self.name!r} has a seat and no collision pieces.", "Give it hulls to sit on.")
        top = max(float(hull[:, 1].max()) for hull in self.hulls)
        if not 0 < self.seat_height <= top + _CUSHION:
            problem = f"the seat of asset {self.name!r} is at {self.seat_height:g} m, and the asset is {top:g} m high."
            raise SceneError(problem, "Give the height of its sitting surface over its bottom, in metres.")


@dataclass(frozen=True)
class SceneObject:
    """One object in the scene: fixed, movable, or movable on a joint alone."""

    id: int
    """Positive and unique in the scene; the value of its pixels in the id image."""
    asset: str
    category: str
    position: Vec3
    rotation: Quaternion = (0.0, 0.0, 0.0, 1.0)
    movable: bool = False
    mass: float = 0.0
    """Kilograms; used only if movable."""
    friction: float = 0.5
    room: str = ""
    joint: Joint | None = None
    """Hinge or slide of a movable object; None if it is free."""
    state: float = 0.0
    """The angle (radians) or way (metres) of the joint at the start: position and rotation are where the object is
    there. Only read with a joint."""

    def __post_init__(self) -> None:
        numbers = (*self.position, *self.rotation, self.mass, self.friction)
        sizes = len(self.position), len(self.rotation)
        if sizes != (3, 4) or not np.isfinite(numbers).all() or min(self.mass, self.friction) < 0:
            problem = f"has position, rotation, mass and friction {numbers}"
            raise self._wrong(problem, "Give 3, 4, 1 and 1 finite numbers, no negative friction or mass.")
        if abs(np.linalg.norm(self.rotation) - 1) > 0.01:
            raise self._wrong(f"is turned by {self.rotation}", "Give a unit quaternion x, y, z, w.")
        if self.joint is None:
            if self.state:
                raise self._wrong(f"has the state {self.state:g} and no joint", "Give it a joint, or no state.")
            return
        if not self.movable:
            raise self._wrong("is on a joint and is not movable", "Set movable and mass, or leave out its joint.")
        if not self.joint.low <= self.state <= self.joint.high:
            unit, low, high = self.joint.unit, self.joint.low, self.joint.high
            problem = f"is at {self.state:g} {unit}, and its joint goes from {low:g} to {high:g}"
            raise self._wrong(problem, "Start within the range.")

    def _wrong(self, problem: str, remedy: str) -> SceneError:
        return SceneError(f"object {self.id} ({self.category}) {problem}.", remedy)

    def at(self, state: float) -> Array:
        """Return (7,) position and quaternion of an object whose joint is at an angle (radians) or way (metres)."""
        assert self.joint is not None
        way, turn = self.joint.moved(state - self.state)
        x, y, z, w = self.rotation
        turned = np.array([[w, -z, y, x], [z, w, -x, y], [-y, x, w, z], [-x, -y, -z, w]]) @ turn
        return np.concatenate([self.position + matrix_from_quaternion(np.array(self.rotation)) @ way, turned])

    def state_at(self, pose: Array) -> float:
        """Return the angle (radians) or way (metres) of the joint of an object in a pose (7,): the inverse of at()."""
        assert self.joint is not None
        turn = matrix_from_quaternion(np.array(self.rotation)).T
        if isinstance(self.joint, Slide):
            return self.state + float(turn @ (pose[:3] - self.position) @ self.joint.axis)
        turned = vector_from_matrix(turn @ matrix_from_quaternion(pose[3:])) @ self.joint.axis
        middle = (self.joint.low + self.joint.high) / 2 - self.state
        return self.state + middle + float(wrap_angle(turned - middle))

    def opened(self, state: float) -> SceneObject:
        """Return the object with its joint at another angle (radians) or way (metres), or at the nearest in its
        range."""
        assert self.joint is not None
        state = min(max(state, self.joint.low), self.joint.high)
        x, y, z, *turn = np.round(self.at(state), 7).tolist()
        return replace(self, position=(x, y, z), rotation=(turn[0], turn[1], turn[2], turn[3]), state=state)

    @property
    def facts(self) -> dict[str, Any]:
        """Return its fields as plain values for JSON; a joint and its state only where there is a joint."""
        own = {key: value for key, value in vars(self).items() if key not in ("joint", "state")}
        return own if self.joint is None else own | {"joint": facts_of(self.joint), "state": self.state}

    @classmethod
    def of(cls, facts: Mapping[str, Any]) -> SceneObject:
        """Return the object of such plain values. Raises TypeError or KeyError if they are others."""
        joint = facts.get("joint")
        place = {key: tuple(facts[key]) for key in ("position", "rotation")}
        return cls(**{**facts, **place, "joint": joint and joint_of(joint)})


@dataclass(frozen=True)
class Room:
    """A rectangle of floor with a purpose. Metres; (x0, z0) < (x1, z1)."""

    name: str
    kind: str
    x0: float
    z0: float
    x1: float
    z1: float
    floor: float = 0.0

    @property
    def called(self) -> str:
        """Its purpose in words: "living room" for `living`."""
        return _ROOMS.get(self.kind, self.kind.replace("_", " "))

    @property
    def told(self) -> str:
        """The same in a sentence: "the living room", and "bedroom 2" for `bedroom_2`."""
        number = re.search(r"\d+$", self.name)
        return f"{self.called} {number[0]}" if number else f"the {self.called}"


@dataclass(frozen=True, eq=False)
class Scene:
    """A world at rest: everything that simulators and renderers need."""

    name: str
    assets: Mapping[str, Asset]
    objects: tuple[SceneObject, ...]
    rooms: tuple[Room, ...]
    start: Pose2D
    """Default place of the body."""
    notes: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        ids = [obj.id for obj in self.objects]
        if len(set(ids)) != len(ids) or min(ids, default=1) < 1:
            raise SceneError(f"the object ids of scene {self.name!r} must be positive and unique.")
        missing = sorted({obj.asset for obj in self.objects} - set(self.assets))
        if missing:
            raise SceneError(f"scene {self.name!r} uses assets that it does not hold: {', '.join(missing)}.")

    @cached_property
    def licences(self) -> tuple[str, ...]:
        """Licences of the assets in use with their attribution, as 'licence: source', each once, in order."""
        used = {obj.asset for obj in self.objects}
        return tuple(sorted({f"{asset.licence}: {asset.source}" for key, asset in self.assets.items() if key in used}))

    @cached_property
    def by_id(self) -> Mapping[int, SceneObject]:
        return {obj.id: obj for obj in self.objects}

    def starting(self, start: Pose2D) -> Scene:
        """Return the scene with another start. Boxes that were measured of it are not measured again."""
        other = replace(self, start=start)
        vars(other).update((name, value) for name, value in vars(self).items() if name in ("by_id", "_boxes"))
        return other

    def of_category(self, category: str) -> tuple[SceneObject, ...]:
        """Return the objects of a category, which may be given with blanks: "potted plant"."""
        return tuple(obj for obj in self.objects if obj.category.replace("_", " ") == category.replace("_", " "))

    def vertices(self, object_id: int, pose: Array | None = None) -> NDArray[np.float64]:
        """Compute (N, 3) world positions of an object's mesh vertices, metres. pose: as in aabb."""
        return self._placed(object_id, pose, [self.assets[self.by_id[object_id].asset].mesh.vertices])[0]

    def hulls(self, object_id: int, pose: Array | None = None) -> list[Array]:
        """Convex pieces that an object collides as, (K, 3) world points each, metres. pose: as vertices has it."""
        return self._placed(object_id, pose, self.assets[self.by_id[object_id].asset].hulls)

    def _placed(self, object_id: int, pose: Array | None, pieces: Iterable[NDArray[np.float32]]) -> list[Array]:
        obj = self.by_id[object_id]
        place = np.array([*obj.position, *obj.rotation]) if pose is None else np.asarray(pose)
        turn = matrix_from_quaternion(place[3:])
        return [np.asarray(points.astype(float) @ turn.T + place[:3]) for points in pieces]

    @cached_property
    def _boxes(self) -> Mapping[int, tuple[NDArray[np.float64], NDArray[np.float64]]]:
        points = {obj.id: self.vertices(obj.id) for obj in self.objects}
        return {key: (value.min(axis=0), value.max(axis=0)) for key, value in points.items()}

    def aabb(self, object_id: int, pose: Array | None = None) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Lowest and highest corner of an object's axis-aligned bounding box, metres.

        pose: (7,) position and quaternion where the object is now, as WorldState.objects has it; None: where the scene
        says.
        """
        if pose is None:
            return self._boxes[object_id]
        points = self.vertices(object_id, pose)
        return points.min(axis=0), points.max(axis=0)

    @property
    def digest(self) -> str:
        """SHA-256 over everything physical and visible, but not over how an asset's points are divided into hulls.

        The name is not in it: it may hold a path, which differs from machine to machine.
        """
        return self._digests[0]

    @property
    def still(self) -> str:
        """SHA-256 over the same but the start: what does not depend on the start is kept under it."""
        return self._digests[1]

    @cached_property
    def _digests(self) -> tuple[str, str]:
        state = hashlib.sha256()
        for name in sorted(self.assets):
            asset = self.assets[name]
            state.update(f"{name}|{asset.category}|{asset.seat_height}".encode())
            for array in filter(lambda array: array is not None, (*vars(asset.mesh).values(), *asset.hulls)):
                state.update(np.ascontiguousarray(array).ravel().data)  # Without a copy, which takes as long.
        rest = [[o.facts for o in self.objects], [vars(r) for r in self.rooms]]
        state.update(json.dumps(rest, sort_keys=True)[:-1].encode())  # The digest continues the list with the start.
        still = state.hexdigest()
        state.update(f", {json.dumps(vars(self.start), sort_keys=True)}]".encode())
        return state.hexdigest(), still


def distance_to_box(points: Array, low: Array, high: Array) -> Array:
    """Map (..., 3) points to (...) Euclidean distances to the axis-aligned box [low, high]; 0 inside."""
    outside = np.maximum(np.maximum(low - points, points - high), 0.0)
    return np.asarray(np.linalg.norm(outside, axis=-1))


def distance_to_nearest(points: Array, boxes: Iterable[tuple[Array, Array]]) -> float:
    """Return the distance from the nearest of (..., 3) points to the nearest box (low, high), metres; infinite without
    a box."""
    return min((float(distance_to_box(points, low, high).min()) for low, high in boxes), default=float("inf"))
