"""Recorded episodes as pictures: a film with a camera that follows the body, and a poster for a front page."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final, Literal

import imageio_ffmpeg
import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont
from scipy.ndimage import gaussian_filter1d, maximum_filter1d
from tqdm import tqdm

from humanclaw import Motion, RecordedEpisode, RecordError, Renderer, Scene, StepRecord
from humanclaw.body import FPS, HISTORY, JOINT_INDEX, Array
from humanclaw.storage import gif
from humanclaw.world import GROUND, Camera, OccupancyGrid, WorldState, ego_camera, floors_of
from humanclaw_report.maps import HouseMap, PathMap, house_maps, path_maps, storeys_at

Picture = NDArray[np.uint8]

DISTANCE: Final = 3.0
"""From the camera to the body, metres."""
AZIMUTHS: Final = np.radians(np.arange(0, 360, 30))
ELEVATIONS: Final = np.radians([25, 38, 52, 66, 80])
PREFERRED_ELEVATION: Final = float(np.radians(32))
_PARTS: Final = ("head", "pelvis", "left_wrist", "right_wrist", "left_knee", "right_knee", "left_foot", "right_foot")
SHOWN: Final = [
    JOINT_INDEX[name] for name in ("head", "pelvis", "left_wrist", "right_wrist", "left_foot", "right_foot")
]
"""Joints that nothing may hide."""
WATCHED: Final = [JOINT_INDEX[name] for name in _PARTS]
KEY: Final = 8
"""Frames between two moments at which the camera decides where to be."""
FILM_SIZE: Final = (1280, 720)
GIF_SIZE: Final = (480, 270)
"""A GIF holds every pixel of every frame: a larger one is for nobody to load."""
FADE: Final = 12
"""Frames of motion in which what gets in the way fades out, or comes back."""
AHEAD: Final = 12
"""Frames of motion before and after it is in the way that an object is left out."""
AWAY: Final = np.array([0.0, -1000.0, 0.0, 0.0, 0.0, 0.0, 1.0])
"""Where an object is put that is left out."""
SLAB: Final = 0.4
"""The thickest floor that hides those below it, metres."""
FILLS: Final = {"fixed": "#cfc8b9", "movable": "#e6dfc9", "stairs": "#ffffff"}
GAP: Final = 16
"""Between the pictures of a poster, pixels."""


def film(
    episode: RecordedEpisode,
    scene: Scene,
    renderer: Renderer,
    out: Path,
    kind: Literal["mp4", "gif"] = "mp4",
    every: int = 2,
    size: tuple[int, int] = FILM_SIZE,
) -> Path:
    """Film an episode from behind and above, with the ego view in a corner. every: frames of motion a frame of film.

    Loads the scene, without what hides the body from above, into the renderer. Raises RecordError if there is no motion
    or out cannot be written.
    """
    pictures = _pictures(Replay.of(episode, scene), renderer, every, size)
    try:
        _mp4(pictures, out, FPS / every, size) if kind == "mp4" else gif(list(pictures), out, FPS / every)
    except OSError as error:
        raise RecordError(f"cannot write {out}: {error}.", "Name another file with --out.") from error
    return out


def poster(
    episode: RecordedEpisode, scene: Scene, renderer: Renderer, out: Path, *, moments: int = 4, width: int = 1600
) -> Path:
    """Return a strip of third-person moments over the ego views of the same moments, beside the map with the walked
    path (PNG)."""
    replay, maps = Replay.of(episode, scene), path_maps(episode, house_maps(scene, "house"))
    # The map fills its column, a storey below another: as wide as its shape makes it at the height of both rows.
    shape = max(one.box[2] / one.box[3] for one in maps) / len(maps)
    side = int((width - GAP * (moments + 2 + shape * (2 - len(maps)))) / (moments + 2 * shape))
    last = len(replay.motion) - 1
    frames = [int(frame) for frame in np.linspace(min(HISTORY, last), last, moments)]
    outside = list(_shots(replay, renderer, frames, (side, side)))
    # The eyes see the ceiling, so the ego views need the whole scene.
    renderer.load(scene)
    inside = [renderer.render(replay.state(frame), ego_camera(replay.state(frame).body, side)).rgb for frame in frames]
    sheet = Image.new("RGB", (width, 2 * side + 3 * GAP), "white")
    for column in range(moments):
        for row, picture in enumerate((outside[column], inside[column])):
            sheet.paste(Image.fromarray(picture), (GAP + column * (side + GAP), GAP + row * (side + GAP)))
    left = GAP + moments * (side + GAP)
    sheet.paste(_draw(maps, (width - left - GAP, 2 * side + GAP)), (left, GAP))
    sheet.save(out)
    return out


# -- playing it back ---------------------------------------------------------------------------------------------------
@dataclass(frozen=True, eq=False)
class Replay:
    """An episode's motion in its scene, with a camera for every frame."""

    episode: RecordedEpisode
    scenes: tuple[Scene, ...]
    """The scene as it is shown while the body is on each storey, lowest first."""
    storeys: NDArray[np.int64]
    """(T,) on which storey the body is."""
    motion: Motion
    objects: dict[int, Array]
    eyes: Array
    """(T, 3) camera positions, metres."""
    hidden: tuple[frozenset[int], ...]
    """For each frame the ids of the objects that are left out, since they are between the camera and the body."""

    @classmethod
    def of(cls, episode: RecordedEpisode, scene: Scene) -> Replay:
        if not episode.has_motion:
            raise RecordError(f"{episode.folder} holds no motion.", "Only an episode that has ended can be filmed.")
        motion, objects = episode.motion(), episode.objects()
        floors = floors_of(scene)
        scenes = tuple(opened(scene, above - SLAB) for above in (*floors[1:], np.inf))
        storeys = storeys_at(floors, _smooth(motion.root[:, 1], 6.0))
        plans = [sight(shown, floor) for shown, floor in zip(scenes, floors, strict=True)]
        eyes = follow(plans, storeys, motion)
        hidden = in_the_way(scene, motion, eyes)
        loose = frozenset().union(*hidden)
        scenes = tuple(loosened(shown, loose) for shown in scenes)
        return cls(episode, scenes, storeys, motion, objects, eyes, hidden)

    def state(self, frame: int, without: frozenset[int] = frozenset()) -> WorldState:
        """Return the world at a frame. without: ids of objects that are left out."""
        places = {key: path[frame] for key, path in self.objects.items()}
        return WorldState(self.motion[frame : frame + 1], places | dict.fromkeys(without, AWAY))

    def fading(self, frame: int) -> tuple[frozenset[int], float]:
        """Return what was left out before, and the share of the picture without it that is still seen."""
        for past in range(1, min(FADE, frame) + 1):
            if self.hidden[frame - past] != self.hidden[frame]:
                return self.hidden[frame - past], 1 - past / (FADE + 1)
        return self.hidden[frame], 0.0

    def camera(self, frame: int, size: tuple[int, int]) -> Camera:
        centre = self.motion.root[max(0, frame - 4) : frame + 5].mean(0) + [0.0, 0.05, 0.0]
        return look_at(self.eyes[frame], centre, size)

    def step(self, frame: int) -> StepRecord | None:
        """Return the step that a frame belongs to; None before the first."""
        first = HISTORY
        for step in self.episode.steps:
            if first <= frame < first + step.motion_frames:
                return step
            first += step.motion_frames
        return None


def opened(scene: Scene, above: float = np.inf) -> Scene:
    """Return the same scene, open from above: without its ceilings and without what begins above a height, metres."""
    kept = [obj for obj in scene.objects if not obj.category.startswith("ceiling") and scene.aabb(obj.id)[0][1] < above]
    return replace(scene, objects=tuple(kept))


def loosened(scene: Scene, ids: frozenset[int]) -> Scene:
    """Return the same scene with these objects movable, so that a renderer takes from each state where they are."""
    return replace(scene, objects=tuple(replace(o, movable=True) if o.id in ids else o for o in scene.objects))


def in_the_way(scene: Scene, motion: Motion, eyes: Array) -> tuple[frozenset[int], ...]:
    """For each frame the ids of what is between the eye and the body, in time for it to fade.

    eyes: (T, 3). Boxes of objects at rest, but for floors and stairs and for a seat that the hips are on.
    """
    objects = [obj for obj in scene.objects if obj.category not in (*GROUND, "rug")]
    joints = motion.joints()
    hips = joints[:, 0]
    points = joints[:, SHOWN] + [0, 0.1, 0]
    sets: list[set[int]] = [set() for _ in eyes]
    for obj in objects:
        low, high = scene.aabb(obj.id)
        seat = scene.assets[obj.asset].seat_height is not None
        around = seat & ((hips > low - 0.15) & (hips < high + 0.15)).all(-1)
        hiding = _crosses(eyes[:, None], points, low, high).any(1) & ~around
        ids = {obj.id} | (hung_on(scene, obj.id) if obj.category == "wall" else set())
        for frame in np.flatnonzero(maximum_filter1d(hiding, 2 * AHEAD + 1)):
            sets[frame] |= ids
    return tuple(map(frozenset, sets))


def hung_on(scene: Scene, wall: int) -> set[int]:
    """Return the ids of what hangs on a wall, which would hang in the air without it: it touches no floor."""
    low, high = scene.aabb(wall)
    boxes = {obj.id: scene.aabb(obj.id) for obj in scene.objects if obj.category not in (*GROUND, "wall")}
    floors = floors_of(scene)
    return {
        key for key, (a, b) in boxes.items()
        if (a < high + 0.05).all() and (b > low - 0.05).all() and not any(-0.05 <= a[1] - f <= 0.3 for f in floors)
    }  # fmt: skip


def _crosses(start: Array, end: Array, low: Array, high: Array) -> NDArray[np.bool_]:
    """Whether the segments from start to end, each (..., 3), meet the box; one that begins in it does."""
    way = end - start
    way = np.where(np.abs(way) < 1e-9, 1e-9, way)
    near, far = (low - start) / way, (high - start) / way
    enters, leaves = np.minimum(near, far).max(-1), np.maximum(near, far).min(-1)
    return np.asarray((enters <= leaves) & (leaves > 0) & (enters < 0.98))


def sight(scene: Scene, floor: float) -> OccupancyGrid:
    """Return the plan of a storey, for what a camera over it sees: through the well of its stairs it sees what is
    below."""
    plan = OccupancyGrid.of(scene, floor)
    well = np.isnan(plan.ground) & (plan.tops == 0)
    return replace(plan, tops=np.where(well, -np.inf, plan.tops))


def look_at(eye: Array, centre: Array, size: tuple[int, int], fov: float = 48.0) -> Camera:
    """Return a level camera at eye that looks at centre. size: width and height in pixels."""
    forward = (centre - eye) / np.linalg.norm(centre - eye)
    right = np.cross(forward, [0.0, 1.0, 0.0])
    up = np.cross(right / np.linalg.norm(right), forward)
    return Camera(eye, forward, up, fov, *size)


def follow(plans: Sequence[OccupancyGrid], storeys: NDArray[np.int64], motion: Motion) -> Array:
    """(T, 3) positions of a camera that stays behind the body and sees it, and moves no more than it must.

    plans: of each storey as it is shown; storeys: (T,) index of the one that the body is on. The cheapest sequence of
    directions (Viterbi) by what hides the body, how far it is from behind, and how far it swings.
    """
    keys = np.arange(0, len(motion), KEY)
    azimuth, elevation = (grid.ravel() for grid in np.meshgrid(AZIMUTHS, ELEVATIONS, indexing="ij"))
    ways = np.stack([np.cos(elevation) * np.sin(azimuth), np.sin(elevation), np.cos(elevation) * np.cos(azimuth)], -1)
    swing = np.arccos(np.clip(ways @ ways.T, -1, 1))
    cost = np.empty((len(keys), len(ways)))
    for k, plan in enumerate(plans):
        here = storeys[keys] == k
        cost[here] = _discomfort(plan, motion, keys[here], azimuth, elevation, ways)
    chosen = _cheapest(cost, 2.5 * swing)
    offsets = np.stack([np.interp(np.arange(len(motion)), keys, ways[chosen, axis]) for axis in range(3)], -1)
    offsets = _smooth(offsets, 9.0)
    offsets *= DISTANCE / np.linalg.norm(offsets, axis=1, keepdims=True)
    return _smooth(motion.root, 6.0) + offsets


def _smooth(values: Array, frames: float) -> Array:
    """(T, ...) values, smoothed over time."""
    return np.asarray(gaussian_filter1d(values, frames, axis=0, mode="nearest"))


def _discomfort(
    plan: OccupancyGrid, motion: Motion, keys: NDArray[np.int64], azimuth: Array, elevation: Array, ways: Array
) -> Array:
    """(K, W) cost of each direction at each key frame."""
    joints, yaw = motion.joints()[keys], motion.yaw()[keys]
    behind = 0.5 * (1 - np.cos(azimuth[None] - yaw[:, None] - np.pi))
    steep = np.abs(elevation - PREFERRED_ELEVATION)
    eyes = joints[:, None, 0] + DISTANCE * ways
    # The floor around the feet counts a little: a picture of the body behind the top of a wall tells little.
    soles = joints[:, :, 1].min(1)[:, None, None] * [0, 1, 0]
    ground = joints[:, None, 0] * [1, 0, 1] + soles + [0, 0.05, 0] + _ring(0.8)
    hidden = 1 - plan.sees(eyes[:, :, None], joints[:, None, WATCHED]).mean(-1)
    veiled = 1 - plan.sees(eyes[:, :, None], ground[:, None]).mean(-1)
    return np.asarray(12.0 * hidden + 4.0 * veiled + behind + steep[None])


def _ring(radius: float) -> Array:
    """(6, 3) points on a circle on the floor."""
    angle = np.linspace(0, 2 * np.pi, 6, endpoint=False)
    return radius * np.stack([np.sin(angle), 0 * angle, np.cos(angle)], -1)


def _cheapest(cost: Array, change: Array) -> NDArray[np.int64]:
    """(K,) states of least total cost; cost: (K, W) per key frame, change: (W, W) between neighbours."""
    total, back = cost[0], []
    for row in cost[1:]:
        options = total[:, None] + change
        back.append(options.argmin(0))
        total = options.min(0) + row
    states = [int(total.argmin())]
    for came in reversed(back):
        states.append(int(came[states[-1]]))
    return np.array(states[::-1])


# -- drawing -----------------------------------------------------------------------------------------------------------
def _shots(replay: Replay, renderer: Renderer, frames: Iterable[int], size: tuple[int, int]) -> Iterator[Picture]:
    """Yield the body from outside at each frame, in the scene as it is shown then; what gets in the way fades."""
    shown: Scene | None = None
    for frame in frames:
        scene = replay.scenes[replay.storeys[frame]]
        if scene is not shown:
            renderer.load(scene)
            shown = scene
        camera = replay.camera(frame, size)
        picture = renderer.render(replay.state(frame, replay.hidden[frame]), camera).rgb
        before, share = replay.fading(frame)
        if share:
            old = renderer.render(replay.state(frame, before), camera).rgb
            picture = (share * old.astype(np.float32) + (1 - share) * picture).astype(np.uint8)
        yield picture


def _pictures(replay: Replay, renderer: Renderer, every: int, size: tuple[int, int]) -> Iterator[Picture]:
    inset: tuple[str, Image.Image | None] = ("", None)
    frames = range(0, len(replay.motion), every)
    shots = _shots(replay, renderer, frames, size)
    # tqdm keeps silent where nobody watches a terminal.
    for frame, shot in zip(tqdm(frames, "film", unit="frame", disable=None, leave=False), shots, strict=True):
        step = replay.step(frame)
        if step and step.frame_file != inset[0]:
            inset = (step.frame_file, _ego(replay.episode.folder / step.frame_file, size[1] // 3))
        yield _caption(shot, step, inset[1])


def _ego(path: Path, side: int) -> Image.Image | None:
    if not path.is_file():
        return None
    with Image.open(path) as image:
        return image.convert("RGB").resize((side, side), Image.Resampling.LANCZOS)


def _caption(picture: Picture, step: StepRecord | None, ego: Image.Image | None) -> Picture:
    """Return the ego view in the corner; below, the call that is being executed, and why, in the agent's words."""
    image = Image.fromarray(picture)
    draw = ImageDraw.Draw(image)
    if ego:
        x = image.width - ego.width - 12
        draw.rectangle((x - 2, 10, x + ego.width + 1, 13 + ego.height), fill="white")
        image.paste(ego, (x, 12))
    if step and step.call:
        said = step.decision.reasoning.split("\n")[0]
        y = image.height - image.height // 40
        if said:
            size = max(image.height // 32, 11)
            _line(draw, said, y, size, image.width - 28)
            y -= size * 3 // 2
        _line(draw, f"{step.step}  {step.call}", y, max(image.height // 24, 13), image.width - 28)
    return np.asarray(image)


def _line(draw: ImageDraw.ImageDraw, text: str, y: int, size: int, width: int) -> None:
    """Draw a line of white text with a dark edge, cut off where the picture ends."""
    font = ImageFont.load_default(size=max(size, 4))
    if draw.textlength(text, font) > width:
        while text and draw.textlength(text + "\u2026", font) > width:
            text = text[:-1]
        text += "\u2026"
    draw.text((14, y), text, "white", font, "ls", stroke_width=2, stroke_fill="black")


def _draw(maps: Sequence[PathMap], size: tuple[int, int]) -> Image.Image:
    """Return the maps of the report as a picture of this size, the highest storey on top."""
    sheet = Image.new("RGB", size, "white")
    height = (size[1] - GAP * (len(maps) - 1)) // len(maps)
    for row, drawn in enumerate(reversed(maps)):
        sheet.paste(_draw_storey(drawn, (size[0], height)), (0, row * (height + GAP)))
    return sheet


def _draw_storey(path: PathMap, size: tuple[int, int]) -> Image.Image:
    chart = _Chart.of(path.box, size)
    chart.house(path.house)
    chart.walk(path)
    return chart.image.resize(size, Image.Resampling.LANCZOS)


@dataclass(frozen=True, eq=False)
class _Chart:
    """A sheet of twice the size that is wanted, and the scale from centimetres to its pixels."""

    image: Image.Image
    pen: ImageDraw.ImageDraw
    scale: float
    shift: tuple[float, float]

    @classmethod
    def of(cls, box: tuple[float, float, float, float], size: tuple[int, int]) -> _Chart:
        image = Image.new("RGB", (2 * size[0], 2 * size[1]), "white")
        scale = min(image.width / box[2], image.height / box[3])
        shift = (
            (image.width - scale * box[2]) / 2 - scale * box[0],
            (image.height - scale * box[3]) / 2 - scale * box[1],
        )
        return cls(image, ImageDraw.Draw(image), scale, shift)

    def point(self, x: float, z: float) -> tuple[float, float]:
        return x * self.scale + self.shift[0], z * self.scale + self.shift[1]

    def line(self, points: str) -> list[tuple[float, float]]:
        pairs = (pair.split(",") for pair in points.split())
        return [self.point(float(x), float(z)) for x, z in pairs]

    def corners(self, x: float, z: float, wide: float, deep: float) -> list[float]:
        return [*self.point(x, z), *self.point(x + wide, z + deep)]

    def house(self, house: HouseMap) -> None:
        for x, z, wide, deep, _ in house.rooms:
            # A little larger than the room, so that the floor goes on in the doorways.
            self.pen.rectangle(self.corners(x - 8, z - 8, wide + 16, deep + 16), fill="#f3efe6")
        for outline, kind, _ in house.objects:
            self.pen.polygon(self.line(outline), fill=FILLS[kind], outline="#a8a294")
        for outline in house.walls:
            self.pen.polygon(self.line(outline), fill="#4a4e55")

    def walk(self, path: PathMap) -> None:
        for x, z, wide, deep, _ in path.targets:
            self.pen.rectangle(self.corners(x, z, wide, deep), outline="#1b6e46", width=4)
        for points, colour, _ in path.pieces:
            self.pen.line(self.line(points), fill=colour, width=8, joint="curve")
        for mark, colour in ((path.start, "#3d6ceb"), (path.end, "#e2a030")):
            if mark is None:
                continue
            a, b = self.point(*mark[:2])
            self.pen.ellipse((a - 11, b - 11, a + 11, b + 11), fill="white", outline=colour, width=6)


# -- files -------------------------------------------------------------------------------------------------------------
def _mp4(pictures: Iterator[Picture], out: Path, fps: float, size: tuple[int, int]) -> None:
    writer = imageio_ffmpeg.write_frames(
        str(out), size, fps=fps, codec="libx264", macro_block_size=2,
        output_params=["-crf", "21", "-movflags", "+faststart"]
    )  # fmt: skip
    writer.send(None)
    try:
        for picture in pictures:
            writer.send(np.ascontiguousarray(picture))
    finally:
        writer.close()
