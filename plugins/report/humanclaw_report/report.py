"""One self-contained page about a run: what was asked, what was done, what was seen, and where the body went.

Everything comes from the records; the scene is only needed to draw the house around the path.
"""

from __future__ import annotations

import base64
import os
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final

import jinja2
import numpy as np
from numpy.typing import NDArray
from PIL import Image
from scipy.spatial import ConvexHull, QhullError

from humanclaw import HumanclawError, RecordedEpisode, RecordError, Scene, StepRecord, load_run
from humanclaw.navigation import OBSTACLE_HEIGHTS, STEP, floors_of
from humanclaw.outcomes import end_distance, in_view, on_target, reached, touched_above_ground
from humanclaw.pose import HISTORY, Array, matrix_from_quaternion
from humanclaw.records import Usage, Vec3
from humanclaw.scene import SceneObject
from humanclaw.storage import jpeg

PARTS: Final = ("observe", "decide", "verify", "generate", "simulate")
PICTURES: Final = 400
"""Thumbnails in one page at most, so that it stays a few megabytes."""
DETAILED: Final = 60
"""Episodes that are shown step by step; the rest of a large run has its row in the table."""
FILM_BYTES: Final = 4_000_000
"""A larger film is linked and not put into the page."""
TIME_COLOURS: Final = np.array([[61, 108, 235], [150, 84, 214], [212, 72, 143], [231, 103, 60], [226, 160, 48]], float)
"""Start to end of a path: even in lightness, so that it reads on light and on dark paper."""

Box = tuple[float, float, float, float]
"""x, z, width and depth, centimetres."""
Corners = tuple[Vec3, Vec3]
"""Lowest and highest corner of a box, metres."""
Polygon = str
"""Points as SVG writes them: x,z x,z ... in centimetres."""


# -- what the template shows -------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Table:
    """A table to show in the summary. rows: cells as text, the first of each the row's heading."""

    title: str
    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    note: str = ""


@dataclass(frozen=True)
class Milestone:
    """Found, reached, sat or stopped: whether, and one fact about it."""

    name: str
    met: bool
    detail: str = ""


@dataclass(frozen=True)
class StepView:
    """One row of the timeline."""

    record: StepRecord
    call: str
    picture: str
    """Data URI, or empty."""
    refusals: tuple[str, ...]
    verdict: str
    verdict_kind: str
    contacts: str
    sensor_readings: str
    """What sensors other than vision told of it."""
    pixels: int
    colour: str


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


@dataclass(frozen=True)
class ContactRow:
    obj: str
    parts: str
    steps: str
    kind: str
    depth: float


@dataclass(frozen=True)
class FilmView:
    """A film beside the record: a data URI where it is small enough, else a path relative to the page."""

    kind: str
    source: str
    inside: bool


@dataclass(frozen=True)
class EpisodeView:
    """One episode as the page tells it."""

    recorded: RecordedEpisode
    anchor: str
    words: str
    milestones: tuple[Milestone, ...]
    times: Mapping[str, float]
    tokens: int
    cost: float
    steps: tuple[StepView, ...] = ()
    strip: tuple[StepView, ...] = ()
    maps: tuple[PathMap, ...] = ()
    """The storeys that the path or a target is on, lowest first."""
    contacts: tuple[ContactRow, ...] = ()
    film: FilmView | None = None


@dataclass
class Houses:
    """Scenes by name, each loaded and drawn once. One that cannot be loaded leaves a note in its place."""

    load: Callable[[str], Scene]
    known: dict[str, tuple[Scene | None, tuple[HouseMap, ...], str]] = field(default_factory=dict)

    def of(self, name: str, digest: str) -> tuple[Scene | None, tuple[HouseMap, ...], str]:
        if name not in self.known:
            self.known[name] = self._draw(name, f"house-{len(self.known)}", digest)
        return self.known[name]

    def _draw(self, name: str, key: str, digest: str) -> tuple[Scene | None, tuple[HouseMap, ...], str]:
        nothing = (HouseMap(key, (0, 0, 0, 0)),)
        try:
            scene = self.load(name)
        except HumanclawError as fault:
            return None, nothing, f"The house is not drawn: {fault}"
        if digest and scene.digest != digest:
            return None, nothing, "The house is not drawn: the installed scene differs from the one of the record."
        return scene, house_maps(scene, key), ""


def write_report(run: Path, out: Path | None, scenes: Callable[[str], Scene], *, tables: Sequence[Table] = ()) -> Path:
    """Write one HTML page about all episodes under a folder; returns where (by default report.html in that folder).

    scenes: loads a scene by its reference; if it raises HumanclawError the house is left out, and the page says so.
    tables: further tables for the summary, such as metrics. Raises RecordError if there is nothing to report.
    """
    episodes = load_run(run)
    houses, target = Houses(scenes), out or run / "report.html"
    budget = max(6, PICTURES // min(len(episodes), DETAILED))
    views = [_episode(recorded, number) for number, recorded in enumerate(episodes)]
    views[:DETAILED] = [_detailed(view, houses, budget, target) for view in views[:DETAILED]]
    html = _environment().get_template("report.html").render(
        title=run.resolve().name,
        episodes=views,
        detailed=views[:DETAILED],
        houses=[storey for scene, drawn, _ in houses.known.values() if scene for storey in drawn],
        tables=tables,
        totals=_totals(views),
        parts=PARTS,
    )  # fmt: skip
    try:
        target.write_text(html, "utf-8")
    except OSError as error:
        raise RecordError(f"cannot write {target}: {error.strerror}.", "Name another file with --out.") from error
    return target


def _environment() -> jinja2.Environment:
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("humanclaw_report", "templates"),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["seconds"] = _seconds
    return environment


def _seconds(value: float) -> str:
    if value >= 60:
        return f"{int(value // 60)} min {value % 60:.0f} s"
    return f"{value:.1f} s" if value >= 1 else f"{1000 * value:.0f} ms"


# -- episodes ----------------------------------------------------------------------------------------------------------
def _episode(recorded: RecordedEpisode, number: int) -> EpisodeView:
    met = milestones(recorded)
    times = {part: sum(s.seconds.get(part, 0.0) for s in recorded.steps) for part in PARTS}
    anchor = f"episode-{number}-{re.sub(r'[^A-Za-z0-9]+', '-', recorded.record.spec.id)}"
    usage = sum((step.usage for step in recorded.steps), Usage())
    tokens = usage.tokens_in + usage.tokens_out
    return EpisodeView(recorded, anchor, in_words(recorded, met), met, times, tokens, usage.cost)


def _detailed(view: EpisodeView, houses: Houses, pictures: int, page: Path) -> EpisodeView:
    recorded = view.recorded
    scene, house, note = houses.of(recorded.record.spec.scene, recorded.record.scene_digest)
    chosen = set(_spread(len(recorded.steps), pictures))
    steps = tuple(_step(recorded, s, n, n in chosen, scene) for n, s in enumerate(recorded.steps))
    shown = [step for step in steps if step.picture]
    return replace(
        view,
        steps=steps,
        strip=tuple(shown[k] for k in _spread(len(shown), 8)),
        maps=path_maps(recorded, house, note),
        contacts=_contacts(recorded, scene),
        film=_film(recorded.folder, page),
    )


def _film(folder: Path, page: Path) -> FilmView | None:
    """Return the film that `humanclaw run` left in the episode's folder, if it did."""
    for kind, media in (("mp4", "video/mp4"), ("gif", "image/gif")):
        path = folder / f"film.{kind}"
        if path.is_file():
            small = path.stat().st_size <= FILM_BYTES
            link = Path(os.path.relpath(path.resolve(), page.resolve().parent)).as_posix()
            return FilmView(kind, _data_uri(path.read_bytes(), media) if small else link, small)
    return None


def _data_uri(data: bytes, media: str) -> str:
    return f"data:{media};base64,{base64.b64encode(data).decode()}"


def _spread(count: int, wanted: int) -> list[int]:
    """At most so many of 0..count-1, evenly, first and last among them."""
    return sorted({round(k) for k in np.linspace(0, count - 1, min(count, wanted))}) if count else []


def milestones(recorded: RecordedEpisode) -> tuple[Milestone, ...]:
    """How far an episode came, by geometry and the active stop alone; metrics also ask what the agent acknowledged."""
    spec, steps = recorded.record.spec, recorded.steps
    stopped = Milestone("stopped", recorded.record.outcome == "stopped", f"after {len(steps)} steps")
    if not spec.target_ids:
        return (stopped,)
    seen = [s.step for s in steps if in_view(s)]
    last = end_distance(recorded)
    found = Milestone("in view", bool(seen), f"first at step {seen[0]}" if seen else "never")
    near = Milestone(
        "reached", reached(recorded), f"{last:.2f} m at the end" if np.isfinite(last) else "no distance recorded"
    )
    if not spec.interact:
        return found, near, stopped
    return found, near, _sat(recorded), stopped


def _sat(recorded: RecordedEpisode) -> Milestone:
    """Whether the hips were on a target when the episode was stopped."""
    on = [step.step for step in recorded.steps if on_target(recorded, step)]
    if on and on[-1] == recorded.steps[-1].step:
        return Milestone("sat", True, f"since step {on[-1]}")
    return Milestone("sat", False, f"left the seat after step {on[-1]}" if on else "hips never on the target")


def in_words(recorded: RecordedEpisode, met: Sequence[Milestone]) -> str:
    """Return the outcome as a sentence."""
    record = recorded.record
    endings = {
        "running": "has not ended",
        "stopped": f"stopped of its own accord after {len(recorded.steps)} steps",
        "out_of_steps": f"ran out of its {record.spec.max_steps} steps",
        "infra_error": f"was broken off by a provider failure ({record.error})",
        "limit_reached": f"was ended by a limit ({record.error})",
        "interrupted": f"was interrupted after {len(recorded.steps)} steps",
    }
    facts = {stage.name: stage for stage in met}
    noun = record.spec.target_category.replace("_", " ") or "target"
    told = [f"{'had' if facts[name].met else 'never had'} the {noun} in view" for name in facts if name == "in view"]
    told += [
        f"{'ended' if facts[name].met else 'did not end'} within reach of it" for name in facts if name == "reached"
    ]
    told += [f"{'sat' if facts[name].met else 'did not sit'} on it" for name in facts if name == "sat"]
    told.append(endings[record.outcome])
    return "The body " + (", ".join(told[:-1]) + " and " if told[:-1] else "") + told[-1] + "."


def _step(recorded: RecordedEpisode, step: StepRecord, number: int, picture: bool, scene: Scene | None) -> StepView:
    kind, verdict = _verdict(step)
    touched = {
        c.object_id: f"{c.joint.replace('_', ' ')} on {_name(scene, c.object_id)}"
        for c in touched_above_ground(recorded, step)
    }
    return StepView(
        record=step,
        call=str(step.call or "no usable call"),
        picture=_picture(recorded.folder / step.frame_file) if picture and step.frame_file else "",
        refusals=tuple(attempt.error for attempt in step.attempts if attempt.error),
        verdict=verdict,
        verdict_kind=kind,
        contacts="; ".join(touched.values()),
        sensor_readings=step.feedback.sensor_readings if step.status == "executed" else "",
        pixels=sum(step.target_pixels.values()),
        colour=_colour(number / max(1, len(recorded.steps) - 1)),
    )


def _verdict(step: StepRecord) -> tuple[str, str]:
    """Kind (none, accepted, replaced or open) and words."""
    verdict, calls = step.verdict, step.decision.calls
    proposed = calls[0] if calls else None
    if verdict is None:
        return "none", ""
    if verdict.failed_open:
        return "open", f"let through unverified: {verdict.failed_open}"
    if verdict.accepted or verdict.replacement is None:
        return "accepted", "accepted"
    failed = "; ".join(answer.note or answer.check for answer in verdict.failed)
    asked = f"in the place of {proposed}" if proposed else "by the verifier"
    return "replaced", asked + (f": {failed}" if failed else "")


def _picture(path: Path, size: int = 240) -> str:
    """Return a frame as a small JPEG data URI; empty if the file is missing."""
    if not path.is_file():
        return ""
    with Image.open(path) as image:
        image.thumbnail((size, size), Image.Resampling.LANCZOS)
        return _data_uri(jpeg(np.asarray(image.convert("RGB")), quality=78), "image/jpeg")


def _contacts(recorded: RecordedEpisode, scene: Scene | None) -> tuple[ContactRow, ...]:
    """Return what was touched other than by standing on it, the longest first."""
    rows: dict[int, list[tuple[int, str, float, bool]]] = {}
    for step in recorded.steps:
        for contact in touched_above_ground(recorded, step):
            part = contact.joint.replace("_", " ")
            rows.setdefault(contact.object_id, []).append((step.step, part, contact.depth, contact.movable))
    table = [
        ContactRow(
            _name(scene, key),
            ", ".join(sorted({part for _, part, _, _ in found})),
            _ranges(sorted({number for number, _, _, _ in found})),
            "movable" if found[0][3] else "fixed",
            max(depth for _, _, depth, _ in found),
        )
        for key, found in sorted(rows.items(), key=lambda item: -len({n for n, _, _, _ in item[1]}))
    ]
    return tuple(table)


def _ranges(numbers: Sequence[int]) -> str:
    """1, 2, 3, 7 as '1-3, 7'."""
    runs: list[list[int]] = []
    for number in numbers:
        if runs and number == runs[-1][-1] + 1:
            runs[-1].append(number)
        else:
            runs.append([number])
    return ", ".join(f"{run[0]}\u2013{run[-1]}" if len(run) > 1 else str(run[0]) for run in runs)


def _name(scene: Scene | None, key: int) -> str:
    obj = scene.by_id.get(key) if scene else None
    return f"{obj.category.replace('_', ' ')} {key}" if obj else f"object {key}"


def _totals(views: Sequence[EpisodeView]) -> dict[str, object]:
    names = ("in view", "reached", "sat", "stopped")
    counts = {}
    for name in names:
        asked = [stage for view in views for stage in view.milestones if stage.name == name]
        if asked:
            counts[name] = (sum(stage.met for stage in asked), len(asked))
    return {
        "milestones": counts,
        "steps": sum(len(view.recorded.steps) for view in views),
        "times": {part: sum(view.times[part] for view in views) for part in PARTS},
        "tokens": sum(view.tokens for view in views),
        "cost": sum(view.cost for view in views),
        "errors": sum(view.recorded.record.outcome == "infra_error" for view in views),
    }


# -- maps --------------------------------------------------------------------------------------------------------------
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
        (_points(piece[:, [0, 2]]), _colour(n / max(1, len(walked) - 1)), recorded.steps[n].step)
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
    try:
        root = recorded.motion().root
    except (OSError, KeyError):
        ends = [(s.start, s.end if s.status != "invalid" else s.start) for s in recorded.steps]
        return [np.array(pair) for pair in ends]
    pieces, first = [], HISTORY
    for step in recorded.steps:
        stretch = root[first - 1 : first + step.motion_frames]
        pieces.append(stretch[sorted({*range(0, len(stretch), 3), len(stretch) - 1})])
        first += step.motion_frames
    return pieces


def _bearing(yaw: float) -> float:
    """Yaw to SVG degrees for an arrow that points up: with x right and z down, yaw 0 points down."""
    return round(180.0 - float(np.degrees(yaw)), 1)


def _colour(share: float) -> str:
    """Colour of a moment, from start (0) to end (1)."""
    place = np.clip(share, 0, 1) * (len(TIME_COLOURS) - 1)
    index = min(int(place), len(TIME_COLOURS) - 2)
    mixed = TIME_COLOURS[index] + (place - index) * (TIME_COLOURS[index + 1] - TIME_COLOURS[index])
    return "#" + "".join(f"{round(value):02x}" for value in mixed)
