"""A house from above, a map a storey, and the path that a body walked over it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError

from humanclaw import RecordedEpisode, Scene
from humanclaw.body import HISTORY, Array, matrix_from_quaternion
from humanclaw.records import Vec3
from humanclaw.world import OBSTACLE_HEIGHTS, STEP, SceneObject, floors_of

TIME_COLOURS: Final = np.array([[61, 108, 235], [150, 84, 214], [212, 72, 143], [231, 103, 60], [226, 160, 48]], float)
"""Start to end of a path: even in lightness, so that it reads on light and on dark paper."""

Box = tuple[float, float, float, float]
"""x, z, width and depth, centimetres."""
Corners = tuple[Vec3, Vec3]
"""Lowest and highest corner of a box, metres."""
Polygon = str
"""Points as SVG writes them: x,z x,z ... in centimetres."""


@dataclass(frozen=True)
class HouseMap:
    """One storey of a house from above. Centimetres; x to the right, z down, as one looks at it."""

    key: str
    box: Box
    """The same for all storeys of a house."""
    title: str = ""
    """Which storey; empty if there is only one."""
    floor: float = 0.0
    """Metres."""
    rooms: tuple[tuple[float, float, float, float, str], ...] = ()
    """x, z, width, depth and kind."""
    walls: tuple[Polygon, ...] = ()
    objects: tuple[tuple[Polygon, str, str], ...] = ()
    """Outline, kind (fixed, movable or stairs) and title."""


@dataclass(frozen=True)
class PathMap:
    """What one episode adds to the map of one storey."""

    house: HouseMap
    box: Box
    pieces: tuple[tuple[Polygon, str, int], ...]
    """Stretch of the path, its colour, its step."""
    text: float
    """Size of the labels, so that they are as large on the page whatever the size of the house."""
    start: tuple[float, float, float] | None
    """x, z and bearing in degrees, clockwise from up; None if the path begins on another storey."""
    end: tuple[float, float, float] | None
    targets: tuple[tuple[float, float, float, float, str], ...]
    note: str = ""
    """Why the house is not drawn."""


def storeys_at(floors: Sequence[float], heights: Array | float) -> NDArray[np.int64]:
    """(...) index of the highest of the floors, lowest first, that is not above each of (...) heights, metres; 0 if all
    are.

    A pelvis, or the bottom of an object, tells which storey it is on; on stairs a body changes storeys two thirds of
    the way up.
    """
    return np.maximum(np.searchsorted(np.asarray(floors), np.asarray(heights) + 0.1, side="right") - 1, 0)


def house_maps(scene: Scene, key: str) -> tuple[HouseMap, ...]:
    """Return the storeys of a house from above, lowest first, all in one box: they can be laid one on the other."""
    floors = floors_of(scene)
    maps = [
        _storey_map(scene, floor, f"{key}-{k}", title)
        for k, (floor, title) in enumerate(zip(floors, _titles(floors), strict=True))
    ]
    box = _box(scene, [wall for drawn in maps for wall in drawn.walls])
    return tuple(replace(drawn, box=box) for drawn in maps)


def _titles(floors: Sequence[float]) -> list[str]:
    """Return what storeys are called by their heights, lowest first. One alone needs no name."""
    if len(floors) == 1:
        return [""]
    below = next((k for k, floor in enumerate(floors) if floor > -1.0), 0)
    above = len(floors) - below - 1
    lower = [f"lower floor {below - k}" if below > 1 else "lower floor" for k in range(below)]
    return [*lower, "ground floor", *(f"upper floor {k}" if above > 1 else "upper floor" for k in range(1, above + 1))]


def _storey_map(scene: Scene, floor: float, key: str, title: str) -> HouseMap:
    rooms = tuple(
        (_c(r.x0), _c(r.z0), _c(r.x1 - r.x0), _c(r.z1 - r.z0), r.kind.replace("_", " "))
        for r in scene.rooms
        if abs(r.floor - floor) < 0.5
    )
    walls, objects = [], []
    for obj in sorted(scene.objects, key=lambda obj: scene.aabb(obj.id)[1][1]):
        if obj.category in ("floor", "ceiling") or not _on_storey(scene, obj, floor):
            continue
        outlines = _outlines(scene, obj, floor)
        if obj.category in ("wall", "window"):
            walls += outlines
        else:
            kind = "stairs" if obj.category == "stairs" else "movable" if obj.movable else "fixed"
            objects += [(outline, kind, f"{obj.category.replace('_', ' ')} {obj.id}") for outline in outlines]
    return HouseMap(key, (0, 0, 0, 0), title, floor, rooms, tuple(walls), tuple(objects))


def _on_storey(scene: Scene, obj: SceneObject, floor: float) -> bool:
    """Stairs are on the storeys that they join: they lead up to one whose floor is a step higher than their last."""
    low, high = scene.aabb(obj.id)
    bottom = floor - STEP if obj.category == "stairs" else floor + 0.02
    return bool(low[1] < floor + OBSTACLE_HEIGHTS[1] and high[1] > bottom)


def _outlines(scene: Scene, obj: SceneObject, floor: float) -> list[Polygon]:
    """Convex outlines of an object's collision pieces between floor and head height: a doorway is open, its lintel
    above.

    Of stairs all pieces, from the lowest up.
    """
    asset = scene.assets[obj.asset]
    if not asset.hulls:
        return [_outline(scene.vertices(obj.id))]
    turn = matrix_from_quaternion(np.array(obj.rotation))
    pieces = [hull @ turn.T + np.array(obj.position) for hull in asset.hulls]
    if obj.category == "stairs":
        return [_outline(piece) for piece in sorted(pieces, key=lambda piece: float(piece[:, 1].max()))]
    low, high = floor + OBSTACLE_HEIGHTS[0], floor + OBSTACLE_HEIGHTS[1]
    return [_outline(p) for p in pieces if p[:, 1].min() < high and p[:, 1].max() > low]


def _outline(points: Array) -> Polygon:
    flat = points[:, [0, 2]].astype(float)
    try:
        flat = flat[ConvexHull(flat).vertices]
    except QhullError:
        flat = np.array([flat.min(0), flat.max(0)])
    return _points(flat)


def _points(flat: Array) -> Polygon:
    return " ".join(f"{_c(x):g},{_c(z):g}" for x, z in flat)


def _c(metres: float) -> float:
    return round(100 * float(metres))


def _box(scene: Scene, walls: Sequence[Polygon]) -> Box:
    points = [tuple(map(float, pair.split(","))) for outline in walls for pair in outline.split()]
    points += [(_c(x), _c(z)) for room in scene.rooms for x, z in ((room.x0, room.z0), (room.x1, room.z1))]
    return _around(np.array(points or [(0, 0)], float), 20)


def _around(points: Array, margin: float) -> Box:
    low, high = points.min(0) - margin, points.max(0) + margin
    return float(low[0]), float(low[1]), float(high[0] - low[0]), float(high[1] - low[1])


def path_maps(recorded: RecordedEpisode, house: Sequence[HouseMap], note: str = "") -> tuple[PathMap, ...]:
    """Return the walked path over the storeys of a house that it or a target is on, lowest first."""
    walked = _walked(recorded)
    floors = [storey.floor for storey in house]
    pieces = storeys_at(floors, np.array([piece[:, 1].mean() for piece in walked]))
    targets = list(recorded.record.targets.values())
    on = storeys_at(floors, np.array([low[1] for low, _ in targets]))
    extent = [100 * piece[:, [0, 2]] for piece in walked] + [100 * np.array(corners)[:, [0, 2]] for corners in targets]
    box = house[0].box if house[0].box[2] else _around(np.concatenate(extent), 60)
    return tuple(
        _path_map(
            recorded, replace(storey, box=box), walked, pieces == k, [targets[n] for n in np.flatnonzero(on == k)], note
        )
        for k, storey in enumerate(house)
        if k in pieces or k in on
    )


def _path_map(
    recorded: RecordedEpisode,
    house: HouseMap,
    walked: list[Array],
    here: NDArray[np.bool_],
    targets: list[Corners],
    note: str,
) -> PathMap:
    """Draw the path of one storey. here: (pieces,) whether each piece of the path is on this storey."""
    record = recorded.record
    noun = record.spec.target_category.replace("_", " ")
    pieces = tuple(
        (_points(piece[:, [0, 2]]), colour(n / max(1, len(walked) - 1)), recorded.steps[n].step)
        for n, piece in enumerate(walked)
        if here[n] and len(piece) > 1
    )
    return PathMap(
        house=house,
        box=house.box,
        pieces=pieces,
        text=round(max(house.box[2], house.box[3]) / 34),
        start=_mark(walked[0][0], record.start.yaw) if here[0] else None,
        end=_mark(walked[-1][-1], _last_yaw(recorded)) if here[-1] else None,
        targets=tuple((_c(a[0]), _c(a[2]), _c(b[0] - a[0]), _c(b[2] - a[2]), noun) for a, b in targets),
        note=note,
    )


def _last_yaw(recorded: RecordedEpisode) -> float:
    if not recorded.steps:
        return recorded.record.start.yaw
    last = recorded.steps[-1]
    return last.yaw_end if last.status != "invalid" else last.yaw_start


def _mark(place: Array, yaw: float) -> tuple[float, float, float]:
    return _c(place[0]), _c(place[2]), _bearing(yaw)


def _walked(recorded: RecordedEpisode) -> list[Array]:
    """(N, 3) pelvis positions of each step, from the motion if there is one, else from the steps' ends.

    Without a step the start alone.
    """
    if not recorded.steps:
        start = recorded.record.start
        return [np.array([[start.x, start.floor, start.z]])]
    if not recorded.has_motion:
        ends = [(s.start, s.end if s.status != "invalid" else s.start) for s in recorded.steps]
        return [np.array(pair) for pair in ends]
    root, pieces, first = recorded.motion().root, [], HISTORY
    for step in recorded.steps:
        stretch = root[first - 1 : first + step.motion_frames]
        pieces.append(stretch[sorted({*range(0, len(stretch), 3), len(stretch) - 1})])
        first += step.motion_frames
    return pieces


def _bearing(yaw: float) -> float:
    """Yaw to SVG degrees for an arrow that points up: with x right and z down, yaw 0 points down."""
    return round(180.0 - float(np.degrees(yaw)), 1)


def colour(share: float) -> str:
    """Colour of a moment, from start (0) to end (1)."""
    place = np.clip(share, 0, 1) * (len(TIME_COLOURS) - 1)
    index = min(int(place), len(TIME_COLOURS) - 2)
    mixed = TIME_COLOURS[index] + (place - index) * (TIME_COLOURS[index + 1] - TIME_COLOURS[index])
    return "#" + "".join(f"{round(value):02x}" for value in mixed)
