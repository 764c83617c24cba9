"""Maps of a house from above, one for each storey, and the path that a body walked."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from humanclaw import RecordedEpisode, Scene
from humanclaw.body import REGIONS, SKINS, Array, matrix_from_quaternion, skin
from humanclaw.records import Vec3
from humanclaw.world import OBSTACLE_HEIGHTS, STEP, SceneObject, body_numbers, floors_of

TIME_COLOURS: Final = np.array([[61, 108, 235], [150, 84, 214], [212, 72, 143], [231, 103, 60], [226, 160, 48]], float)
"""Colours from start to end of a path: of even lightness, so that they show on light and dark pages."""

Box = tuple[float, float, float, float]
"""x, z, width and depth, centimetres."""
Corners = tuple[Vec3, Vec3]
"""Lowest and highest corner of a box, metres."""
Polygon = str
"""Points in SVG notation: x,z x,z ... in centimetres."""


@dataclass(frozen=True)
class HouseMap:
    """One storey of a house from above, in centimetres: x points right and z down on the page."""

    key: str
    box: Box
    """The same for all storeys of a house."""
    title: str = ""
    """Name of the storey; empty if there is only one."""
    floor: float = 0.0
    """Height of the floor, metres."""
    rooms: tuple[tuple[float, float, float, float, str], ...] = ()
    """x, z, width and depth in centimetres, and kind of room."""
    walls: tuple[Polygon, ...] = ()
    objects: tuple[tuple[Polygon, str, str], ...] = ()
    """Outline, kind (fixed, movable or stairs) and title."""


@dataclass(frozen=True)
class PathMap:
    """The path and the targets of one episode on the map of one storey."""

    house: HouseMap
    box: Box
    pieces: tuple[tuple[Polygon, str, int], ...]
    """Points of a piece of the path, its colour, and its step."""
    text: float
    """Size of the labels in centimetres. It grows with the house, so that labels look the same on every page."""
    start: tuple[float, float, float] | None
    """x, z and bearing in degrees, clockwise from up; None if the path begins on another storey."""
    end: tuple[float, float, float] | None
    targets: tuple[tuple[float, float, float, float, float, str], ...]
    """x, z, width and depth in centimetres, z of the label, and label; empty where it would lie over another one."""
    note: str = ""
    """Why the house is not drawn."""
    others: tuple[tuple[Polygon, str], ...] = ()
    """Points of a way that another body went, and the colour of its shirt; of one that stands, one place twice."""


def storeys_at(floors: Sequence[float], heights: Array | float) -> NDArray[np.int64]:
    """Return the (...) index of the storey that each of (...) heights is on: the highest floor at or below it, else 0.

    Take the height of a pelvis or of the bottom of an object. With the pelvis, a body on stairs changes storeys two
    thirds of the way up.

    Args:
        floors: Heights of the floors, metres, lowest first.
        heights: Metres.
    """
    return np.maximum(np.searchsorted(np.asarray(floors), np.asarray(heights) + 0.1, side="right") - 1, 0)


def house_maps(scene: Scene, key: str) -> tuple[HouseMap, ...]:
    """Return the maps of the storeys, lowest first. They share one box, so that they can be laid over each other."""
    floors = floors_of(scene)
    maps = [
        _storey_map(scene, floor, f"{key}-{k}", title)
        for k, (floor, title) in enumerate(zip(floors, _titles(floors), strict=True))
    ]
    # Stacked storeys must have one scale and one origin on the page.
    box = _box(scene, [wall for drawn in maps for wall in drawn.walls])
    return tuple(replace(drawn, box=box) for drawn in maps)


def _titles(floors: Sequence[float]) -> list[str]:
    """Return the names of the storeys, lowest first; an only storey has no name."""
    if len(floors) == 1:
        return [""]
    # The ground floor is at height 0; a cellar lies more than a metre lower.
    below = next((k for k, floor in enumerate(floors) if floor > -1.0), 0)
    above = len(floors) - below - 1
    lower = [f"lower floor {below - k}" if below > 1 else "lower floor" for k in range(below)]
    return [*lower, "ground floor", *(f"upper floor {k}" if above > 1 else "upper floor" for k in range(1, above + 1))]


def _storey_map(scene: Scene, floor: float, key: str, title: str) -> HouseMap:
    rooms = tuple(
        (_c(r.x0), _c(r.z0), _c(r.x1 - r.x0), _c(r.z1 - r.z0), r.called)
        for r in scene.rooms
        if abs(r.floor - floor) < 0.5
    )
    walls, objects = [], []
    # Objects are drawn from the lowest top up, so that a table covers its rug.
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
    """Tell whether an object is on a storey; stairs are on both storeys that they join.

    The upper floor is one step higher than the last step of the stairs.
    """
    low, high = scene.aabb(obj.id)
    bottom = floor - STEP if obj.category == "stairs" else floor + 0.02
    return bool(low[1] < floor + OBSTACLE_HEIGHTS[1] and high[1] > bottom)


def _outlines(scene: Scene, obj: SceneObject, floor: float) -> list[Polygon]:
    """Return the convex outlines of an object's collision pieces between floor and head height.

    A doorway stays open, since its lintel is above head height. All pieces of stairs are drawn, from the lowest up.
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
    """Return the convex hull of points as seen from above."""
    # Without -0, which would be written.
    flat = sorted({(x + 0.0, z + 0.0) for x, z in np.round(100 * points[:, [0, 2]]).tolist()})
    corners = [*_chain(flat)[:-1], *_chain(flat[::-1])[:-1]]
    return " ".join(f"{x:g},{z:g}" for x, z in corners or flat)


def _chain(flat: Sequence[tuple[float, float]]) -> Sequence[tuple[float, float]]:
    """Return one side of the convex hull of sorted points. Qhull takes five times as long for few of them."""
    kept: list[tuple[float, float]] = []
    for x, z in flat:
        while len(kept) > 1:
            (x0, z0), (x1, z1) = kept[-2:]
            if (x1 - x0) * (z - z0) > (z1 - z0) * (x - x0):
                break
            kept.pop()
        kept.append((x, z))
    return kept


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
    """Return the maps of the storeys that hold part of the path or a target, lowest first."""
    walked, ways = _walked(recorded), list(_ways(recorded))
    floors = [storey.floor for storey in house]
    pieces = storeys_at(floors, np.array([piece[:, 1].mean() for piece in walked]))
    targets = list(recorded.record.targets.values())
    on = storeys_at(floors, np.array([low[1] for low, _ in targets]))
    extent = [100 * piece[:, [0, 2]] for piece in (*walked, *(way for way, _ in ways))]
    extent += [100 * np.array(corners)[:, [0, 2]] for corners in targets]
    # Without the house, the map is as large as path and targets need.
    box = house[0].box if house[0].box[2] else _around(np.concatenate(extent), 60)
    others = [(storeys_at(floors, way[:, 1]), way, shirt) for way, shirt in ways]
    return tuple(
        _path_map(
            recorded,
            replace(storey, box=box),
            walked,
            pieces == k,
            [targets[n] for n in np.flatnonzero(on == k)],
            note,
            tuple((points, shirt) for at, way, shirt in others for points in _stretches(way, at == k)),
        )
        for k, storey in enumerate(house)
        if k in pieces or k in on or any(k in at for at, _, _ in others)
    )


def _ways(recorded: RecordedEpisode) -> Iterator[tuple[Array, str]]:
    """Yield (N, 3) pelvis positions of each other body, and the colour of its shirt."""
    people = recorded.people() if recorded.has_motion else {}
    _, *numbers = body_numbers(list(people))
    for number, way in zip(numbers, people.values(), strict=True):
        shirt = skin(SKINS[number % len(SKINS)]).colours[REGIONS.index("shirt")]
        yield way.root[::3], "#" + bytes(shirt).hex()


def _stretches(way: Array, here: NDArray[np.bool_]) -> Iterator[Polygon]:
    """Yield the points of each stretch of a way on one storey, each place once; a single one twice, to be a dot."""
    for stretch in np.split(np.arange(len(way)), np.flatnonzero(np.diff(here)) + 1):
        if len(stretch) and here[stretch[0]]:
            flat = way[stretch][:, [0, 2]].round(2)
            flat = flat[[True, *(np.diff(flat, axis=0) != 0).any(1)]]
            yield _points(flat if len(flat) > 1 else flat[[0, 0]])


def _path_map(
    recorded: RecordedEpisode,
    house: HouseMap,
    walked: list[Array],
    here: NDArray[np.bool_],
    targets: list[Corners],
    note: str,
    others: tuple[tuple[Polygon, str], ...],
) -> PathMap:
    """Draw the path on one storey. here: (pieces,) whether each piece of the path is on this storey."""
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
        text=_text(house),
        start=_mark(walked[0][0], record.start.yaw) if here[0] else None,
        end=_mark(walked[-1][-1], _last_yaw(recorded)) if here[-1] else None,
        targets=tuple(_labelled(targets, noun, house)),
        note=note,
        others=others,
    )


def _text(house: HouseMap) -> float:
    return round(max(house.box[2], house.box[3]) / 34)


def _labelled(
    targets: list[Corners], noun: str, house: HouseMap
) -> Iterator[tuple[float, float, float, float, float, str]]:
    """Yield the targets of a map. A label stands over its box, or under it at the edge of the map: in the box, it would
    lie over the mark of a body that sits there."""
    size = _text(house)
    taken = [(x + 14, z + 14, 0.5 * size * len(kind), size) for x, z, _, _, kind in house.rooms]
    for low, high in targets:
        x, z, wide, deep = _c(low[0]), _c(low[2]), _c(high[0] - low[0]), _c(high[2] - low[2])
        place = z - 0.7 * size if z - 1.5 * size > house.box[1] else z + deep + 0.7 * size
        label = (x + wide / 2 - 0.3 * size * len(noun), place - size / 2, 0.6 * size * len(noun), size)
        free = not any(_overlap(label, other) for other in taken)
        taken += [label] if free else []
        yield x, z, wide, deep, place, noun if free else ""


def _overlap(a: Box, b: Box) -> bool:
    return all(a[k] < b[k] + b[k + 2] and b[k] < a[k] + a[k + 2] for k in (0, 1))


def _last_yaw(recorded: RecordedEpisode) -> float:
    if not recorded.steps:
        return recorded.record.start.yaw
    last = recorded.steps[-1]
    return last.yaw_end if last.status != "invalid" else last.yaw_start


def _mark(place: Array, yaw: float) -> tuple[float, float, float]:
    return _c(place[0]), _c(place[2]), _bearing(yaw)


def _walked(recorded: RecordedEpisode) -> list[Array]:
    """Return (N, 3) pelvis positions of each step, metres.

    They come from the motion if the record holds it, else from the start and end of each step. An episode without steps
    has its start alone.
    """
    if not recorded.steps:
        start = recorded.record.start
        return [np.array([[start.x, start.floor, start.z]])]
    if not recorded.has_motion:
        ends = [(s.start, s.end if s.status != "invalid" else s.start) for s in recorded.steps]
        return [np.array(pair) for pair in ends]
    root, pieces = recorded.motion().root, []
    for first, end in recorded.spans:
        # From the frame before, so that the pieces touch.
        stretch = root[first - 1 : end]
        # Every third frame is fine enough for a map; the last one joins the pieces.
        pieces.append(stretch[sorted({*range(0, len(stretch), 3), len(stretch) - 1})])
    return pieces


def _bearing(yaw: float) -> float:
    """Convert yaw (radians) to the SVG rotation of an arrow that points up; yaw 0 points down on the page."""
    return round(180.0 - float(np.degrees(yaw)), 1)


def colour(share: float) -> str:
    """Return the colour of a moment between start (0) and end (1)."""
    place = np.clip(share, 0, 1) * (len(TIME_COLOURS) - 1)
    index = min(int(place), len(TIME_COLOURS) - 2)
    mixed = TIME_COLOURS[index] + (place - index) * (TIME_COLOURS[index + 1] - TIME_COLOURS[index])
    return "#" + "".join(f"{round(value):02x}" for value in mixed)
