"""One episode as a Rerun recording: house, body, ghost, eyes, calls and distance on one time line.

The time line `time` is in seconds: frame k of motion.npz is at k / 30. Positions are in the world frame: metres, Y up.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Final, Self

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from humanclaw import (
    EpisodeRecord,
    HumanclawError,
    Motion,
    Plugins,
    RecordedEpisode,
    RecordError,
    Scene,
    StepRecord,
)
from humanclaw.body import FPS, PARENTS, Array, skin
from humanclaw.storage import Folder
from humanclaw.world import Camera, Mesh, SceneObject, ego_camera

TIME: Final = "time"
_GHOST: Final = ((120, 150, 255, 110), 0.012)
"""Colour and radius (metres) of the bones of the generated motion."""
EVERY: Final = 3
"""Frames of motion for each pose of the skin: one takes 77 kB."""
_LEFT_OUT: Final = "ceiling"
"""Category of objects that are not logged, so that the viewer can look in from above."""
_BONES: Final = [(parent, joint) for joint, parent in enumerate(PARENTS) if parent >= 0]


def bones(motion: Motion) -> Array:
    """Return the (T, 23, 2, 3) ends of every bone, metres, world frame."""
    return motion.joints()[:, _BONES]


class EpisodeLog:
    """The recording of one episode: a context manager."""

    def __init__(self, record: EpisodeRecord, file: Path) -> None:
        """Begin a recording in an .rrd file. Raises RecordError if it cannot be written."""
        spec, self._gaze = record.spec, record.gaze
        self._names: dict[int, str] = {}
        self._stream = rr.RecordingStream("humanclaw", recording_id=f"{spec.id} {record.created}".strip())
        with _writing(file):
            self._stream.save(file)
        self._stream.send_blueprint(_blueprint())
        self._stream.send_recording_name(f"{spec.id}: {record.agent}")
        # Static values hold at all times, also before the first frame.
        self._static("world", rr.ViewCoordinates.RIGHT_HAND_Y_UP)
        self._static("task", rr.TextDocument(f"{record.agent} in {spec.scene}: {spec.instruction}"))
        for key, (low, high) in record.targets.items():
            box = rr.Boxes3D(mins=[low], sizes=[np.subtract(high, low)], labels=[f"target {key}"])
            self._static(f"world/targets/{key}", box)
        colour, radius = _GHOST
        self._static("world/body/generated", rr.LineStrips3D.from_fields(colors=[colour], radii=[radius]))
        self._skin = skin()
        colours = self._skin.colours[self._skin.regions]
        self._static(
            "world/body/simulated", rr.Mesh3D.from_fields(triangle_indices=self._skin.faces, vertex_colors=colours)
        )
        fov = np.radians(Camera.fov)
        self._static("world/eyes", rr.Pinhole(fov_y=fov, aspect_ratio=1.0, camera_xyz=rr.ViewCoordinates.RUB))

    # -- the house -----------------------------------------------------------------------------------------------------
    def house(self, scene: Scene) -> None:
        """Log every object except ceilings at its place in the scene, as a mesh with one colour per vertex."""
        self._names = {obj.id: f"{obj.category}_{obj.id}" for obj in scene.objects}
        for obj in scene.objects:
            if obj.category != _LEFT_OUT:
                self._static(self._path(obj.id), _placed(obj))
                self._static(self._path(obj.id), _mesh(scene.assets[obj.asset].mesh))

    # -- motion --------------------------------------------------------------------------------------------------------
    def body(self, simulated: Motion, generated: Motion) -> None:
        """Log the skin of the simulated body and the bones of the generated one."""
        kept = range(0, len(simulated), EVERY)
        poses = [self._skin.posed(simulated.root[k], simulated.rotations[k]) for k in kept]
        if poses:
            vertices, normals = map(np.concatenate, zip(*poses, strict=True))
            skins = rr.Mesh3D.columns(vertex_positions=vertices, vertex_normals=normals)
            sizes = [len(self._skin.vertices)] * len(poses)
            self._columns("world/body/simulated", np.array(kept), skins.partition(sizes))
        ends = bones(generated)
        strips = rr.LineStrips3D.columns(strips=ends.astype(np.float32).reshape(-1, 2, 3))
        self._columns("world/body/generated", np.arange(len(ends)), strips.partition([len(_BONES)] * len(ends)))

    def objects(self, paths: Mapping[int, Array]) -> None:
        """Log (T, 7) positions (metres) and quaternions of movable objects, by id."""
        for key, path in paths.items():
            placed = rr.Transform3D.columns(translation=path[:, :3], quaternion=path[:, 3:])
            self._columns(self._path(key), np.arange(len(path)), placed)

    # -- views, calls and distance -------------------------------------------------------------------------------------
    def view(self, picture: bytes, body: Motion, frame: int) -> None:
        """Log an ego view (JPEG). body: motion whose last frame gives the place of the eyes."""
        self._stream.set_time(TIME, duration=frame / FPS)
        eyes = ego_camera(body, gaze=self._gaze)
        axes = np.stack([np.cross(eyes.forward, eyes.up), eyes.up, -eyes.forward], -1)
        self._stream.log("world/eyes", rr.Transform3D(translation=eyes.position, mat3x3=axes))
        self._stream.log("world/eyes", rr.EncodedImage(contents=picture, media_type="image/jpeg"))

    def step(self, step: StepRecord, first: int) -> None:
        """Log a call with its words at its first frame, and the distance to the target after its last."""
        self._stream.set_time(TIME, duration=first / FPS)
        for level, line in _lines(step):
            self._stream.log("calls", rr.TextLog(line, level=level))
        if step.target_distance is not None:
            self._stream.set_time(TIME, duration=(first + step.motion_frames) / FPS)
            self._stream.log("distance", rr.Scalars(step.target_distance))

    def note(self, text: str) -> None:
        """Log a sentence about the whole episode."""
        self._static("note", rr.TextDocument(text))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._stream.flush()
        self._stream.disconnect()

    def _path(self, key: int) -> str:
        return f"world/house/{self._names.get(key, f'object_{key}')}"

    def _static(self, path: str, what: rr.AsComponents) -> None:
        self._stream.log(path, what, static=True)

    def _columns(self, path: str, frames: NDArray[np.int64], columns: rr.ComponentColumnList) -> None:
        # Columns send a whole chunk at once, which is much faster than a log call for each frame.
        times = rr.TimeColumn(TIME, duration=frames / FPS)
        self._stream.send_columns(path, indexes=[times], columns=columns)


def house_of(episode: EpisodeRecord, plugins: Plugins) -> tuple[Scene | None, str]:
    """Return the house of an episode and an empty note; None and the reason if it is missing or differs."""
    try:
        scene = plugins.scene(episode.spec.scene)
    except HumanclawError as fault:
        return None, f"The house is not drawn: {fault}"
    if episode.scene_digest and scene.digest != episode.scene_digest:
        return None, "The house is not drawn: the installed scene differs from the one of the record."
    return scene, ""


def write_recording(recorded: RecordedEpisode, scene: Scene | None, out: Path, note: str = "") -> None:
    """Write a recorded episode as an .rrd file.

    scene: None leaves the house out. note: a sentence that says why. Raises RecordError if the record is damaged or the
    file cannot be written.
    """
    try:
        with Folder(out.parent).placed(out.name) as file, EpisodeLog(recorded.record, file) as log:
            if scene:
                log.house(scene)
            if note:
                log.note(note)
            _log_episode(log, recorded)
    except OSError as error:
        raise RecordError(f"cannot write {out}: {error.strerror}.", "Name another file with --out.") from error


def _log_episode(log: EpisodeLog, recorded: RecordedEpisode) -> None:
    if recorded.has_motion:
        log.body(recorded.motion(), recorded.motion("generated"))
        log.objects(recorded.objects())
    for step, (first, _) in zip(recorded.steps, recorded.spans, strict=True):
        log.step(step, first)
    _log_views(log, recorded)


def _log_views(log: EpisodeLog, recorded: RecordedEpisode) -> None:
    """Log the view before each step, if the record holds it."""
    if not recorded.has_motion:
        return
    motion = recorded.motion()
    for step, (first, _) in zip(recorded.steps, recorded.spans, strict=True):
        if picture := recorded.view(step):
            # The view was taken where the body stood in the frame before the step.
            log.view(picture, motion[first - 1 : first], first)


def _lines(step: StepRecord) -> Iterator[tuple[str, str]]:
    """Yield the log level and text of each line about a step."""
    yield from (("WARN", f"refused: {attempt.error}") for attempt in step.attempts if attempt.error)
    if step.decision.reasoning:
        yield "DEBUG", step.decision.reasoning
    if step.verdict and not step.verdict.accepted:
        failed = "; ".join(answer.note or answer.check for answer in step.verdict.failed)
        yield "WARN", f"not {step.decision.calls[0]}: {failed}" if step.decision.calls else failed
    yield "INFO", str(step.call or "no usable call")


def _blueprint() -> rrb.Blueprint:
    words = rrb.Vertical(
        rrb.Spatial2DView(origin="world/eyes", name="eyes"),
        rrb.TimeSeriesView(origin="distance", name="metres to the target"),
        rrb.TextLogView(origin="calls", name="calls"),
        row_shares=[3, 1, 2],
    )
    house = rrb.Spatial3DView(origin="world", name="house")
    return rrb.Blueprint(rrb.Horizontal(house, words, column_shares=[3, 2]), rrb.TimePanel(timeline=TIME))


def _placed(obj: SceneObject) -> rr.Transform3D:
    return rr.Transform3D(translation=obj.position, quaternion=rr.Quaternion(xyzw=obj.rotation))


def _mesh(mesh: Mesh) -> rr.Mesh3D:
    return rr.Mesh3D(vertex_positions=mesh.vertices, triangle_indices=mesh.faces, vertex_colors=_colours(mesh))


def _colours(mesh: Mesh) -> NDArray[np.uint8]:
    """Return the (N, 3) colour of the texture at each vertex."""
    height, width = mesh.texture.shape[:2]
    u, v = np.clip(mesh.uv, 0, 1).T
    # Texture rows run from the top, v from the bottom.
    return np.asarray(mesh.texture[np.rint((1 - v) * (height - 1)).astype(int), np.rint(u * (width - 1)).astype(int)])


@contextmanager
def _writing(file: Path) -> Iterator[None]:
    """Raise RecordError if the file cannot be written; Rerun raises RuntimeError for every cause."""
    try:
        yield
    except RuntimeError as error:
        raise RecordError(f"cannot write {file}: {error}.", "Name another file with --out.") from error
