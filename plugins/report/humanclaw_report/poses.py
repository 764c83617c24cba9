"""A recorded episode in one picture: the body at several moments, in the house without its ceilings."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np
from PIL import Image, ImageDraw

from humanclaw import RecordedEpisode, RecordError, Renderer, Scene
from humanclaw.body import JOINT_INDEX, Array
from humanclaw.storage import save_picture
from humanclaw.world import Camera, WorldState, floors_of, together
from humanclaw_report.floor_plan import colour
from humanclaw_report.playback import AWAY, SLAB, loosened, opened, step_at
from humanclaw_report.shots import in_the_way, kept, left_out

APART: Final = 1.0
"""Way from one body to the next, metres."""
SIDES: Final = 12
"""Directions from which a camera may look."""
ELEVATION: Final = float(np.radians(42))
"""Of the camera, radians: lower, bodies hide one another; higher, one sees heads alone."""
_HIDING: Final = 0.01
"""What an object that has to be left out costs a direction, as a share of the picture between two bodies."""
_FINE: Final = 2
"""The picture is drawn this much larger, because edges are hard where bodies overlap."""


def poses(episode: RecordedEpisode, scene: Scene, renderer: Renderer, out: Path, size: tuple[int, int]) -> Path:
    """Draw the bodies of an episode in one picture (JPG or PNG), each with its step and skill.

    size: width and height, pixels. Raises RecordError if the record holds no motion, or out cannot be written.
    """
    if not episode.has_motion:
        raise RecordError(f"{episode.folder} holds no motion.", "Only an episode that has ended can be drawn.")
    motion = episode.motion()
    frames = moments(motion.root)
    bodies, joints = [motion[frame : frame + 1] for frame in frames], motion.joints()[frames]
    above = min((floor for floor in floors_of(scene) if floor > joints[:, 0, 1].max()), default=np.inf)
    keep, shown = kept(episode, scene), opened(scene, above - SLAB)
    seen = joints[:, JOINT_INDEX["head"]] + [0.0, 0.25, 0.0]

    def judged(side: int) -> tuple[float, Camera, frozenset[int]]:
        camera = _camera(joints, 2 * np.pi * side / SIDES, (_FINE * size[0], _FINE * size[1]))
        hiding = in_the_way(shown, joints, camera.position[None])
        gaps = np.linalg.norm(np.diff(camera.pixels(seen), axis=0), axis=1) / camera.width
        apart = float(gaps.mean()) if len(gaps) else 0.0
        return apart - _HIDING * len(hiding), camera, left_out(shown, hiding.keys(), keep)

    _, camera, hidden = max(map(judged, range(SIDES)), key=lambda view: view[0])
    renderer.load(loosened(shown, hidden))
    objects = {key: path[-1] for key, path in episode.objects().items()} | dict.fromkeys(hidden, AWAY)
    image = Image.fromarray(together([renderer.render(WorldState(body, objects), camera) for body in bodies]))
    draw = ImageDraw.Draw(image)
    for number, (frame, (x, y)) in enumerate(zip(frames, camera.pixels(seen), strict=True)):
        draw.text(
            (x, y), _told(episode, frame), colour(number / len(frames)), font_size=16 * _FINE, anchor="mb",
            stroke_width=2 * _FINE, stroke_fill="white",
        )  # fmt: skip
    return save_picture(image.resize(size, Image.Resampling.LANCZOS), out, quality=85)


def moments(root: Array) -> list[int]:
    """Return frames to draw of hips (T, 3): the first, about one every APART metres of way, and the last."""
    flat = root[:, [0, 2]]
    way = np.concatenate([[0.0], np.linalg.norm(np.diff(flat, axis=0), axis=1).cumsum()])
    frames = np.searchsorted(way, np.arange(0.0, way[-1], APART))
    # Who turns and sits down moves the hips, but stays in place.
    return [*frames[np.linalg.norm(flat[frames] - flat[-1], axis=1) > 0.6 * APART].tolist(), len(root) - 1]


def _camera(joints: Array, side: float, size: tuple[int, int]) -> Camera:
    """Return the nearest camera from a side (radians) that has all joints (N, 24, 3) well in its picture."""
    centre = (joints.min((0, 1)) + joints.max((0, 1))) / 2
    way = np.array([np.sin(side) * np.cos(ELEVATION), np.sin(ELEVATION), np.cos(side) * np.cos(ELEVATION)])
    cameras = (Camera.looking(centre + metres * way, centre, 30.0, size) for metres in np.arange(5.0, 100.0, 0.5))
    return next(camera for camera in cameras if (np.abs(camera.pixels(joints) / size - 0.5) < 0.4).all())


def _told(episode: RecordedEpisode, frame: int) -> str:
    """Return step and skill of a frame."""
    step = step_at(episode, frame)
    return f"{step.step} {step.call.skill}" if step and step.call else "start"
