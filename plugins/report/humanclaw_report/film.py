"""Films of a recorded episode."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import repeat
from pathlib import Path
from typing import Final, Literal

import imageio_ffmpeg
import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont
from tqdm import tqdm

from humanclaw import HumanclawError, RecordedEpisode, RecordError, Renderer, Scene, StepRecord
from humanclaw.body import FPS
from humanclaw.storage import Folder, gif
from humanclaw_report.playback import FilmScene, step_at

Picture = NDArray[np.uint8]
FILM_SIZE: Final = (1280, 720)
"""Width and height of 720p, pixels: both even, as H.264 wants them."""
GIF_SIZE: Final = (480, 270)
"""Smaller than a film: GIF compresses poorly, and a larger one loads too slowly."""
SHORT: Final = 2 * FPS
"""A film of fewer frames of motion is over before one looks, so its first and last picture last a second each."""
GIF_BYTES: Final = 1 << 30
"""Maximum bytes of a GIF's pictures, which are all in memory at once."""


def film(
    episode: RecordedEpisode,
    scene: Scene,
    renderer: Renderer,
    out: Path,
    kind: Literal["mp4", "gif"] = "mp4",
    every: int = 2,
    size: tuple[int, int] = FILM_SIZE,
) -> Path:
    """Film an episode from behind and above, with the ego view in a corner.

    Loads the scene into the renderer, without the objects that hide the body from above.

    Args:
        every: Frames of motion for each frame of film.
        size: Width and height, pixels.

    Raises:
        HumanclawError: A GIF would be larger than GIF_BYTES.
        RecordError: The record holds no motion, or out cannot be written.
    """
    film_scene = FilmScene.of(episode, scene)
    if kind == "gif" and len(film_scene.motion) // every * size[0] * size[1] * 3 > GIF_BYTES:
        problem = f"a GIF of {len(film_scene.motion)} frames is too large at every={every} and {size[0]} x {size[1]}."
        raise HumanclawError(problem, "Name a smaller size, a larger every, or an MP4 file.")
    still = FPS // every if len(film_scene.motion) < SHORT else 0
    pictures = _held(_pictures(film_scene, renderer, every, size), still)
    try:
        with Folder(out.parent).placed(out.name) as file:
            _mp4(pictures, file, FPS / every, size) if kind == "mp4" else gif(list(pictures), file, FPS / every)
    except OSError as error:
        raise RecordError(f"cannot write {out}: {error}.", "Name another file with --out.") from error
    return out


# -- drawing -----------------------------------------------------------------------------------------------------------
def _shots(
    film_scene: FilmScene, renderer: Renderer, frames: Iterable[int], size: tuple[int, int]
) -> Iterator[Picture]:
    """Yield the body from outside at each frame, in the scene of its storey; without the objects in the way."""
    shown: Scene | None = None
    for frame in frames:
        scene = film_scene.scenes[film_scene.storeys[frame]]
        if scene is not shown:
            renderer.load(scene)
            shown = scene
        yield renderer.render(film_scene.state(frame), film_scene.camera(frame, size)).rgb


def _pictures(film_scene: FilmScene, renderer: Renderer, every: int, size: tuple[int, int]) -> Iterator[Picture]:
    inset: tuple[str, Image.Image | None] = ("", None)
    frames = range(0, len(film_scene.motion), every)
    shots = _shots(film_scene, renderer, frames, size)
    # disable=None hides the progress bar where the output is not a terminal.
    for frame, shot in zip(tqdm(frames, "film", unit="frame", disable=None, leave=False), shots, strict=True):
        step = step_at(film_scene.episode, frame)
        # Each view is shown for all frames of its step, so it is read once.
        if step and step.frame_file != inset[0]:
            inset = (step.frame_file, _ego(film_scene.episode.picture(step), size[1] // 3))
        yield _caption(shot, step, inset[1])


def _held(pictures: Iterator[Picture], still: int) -> Iterator[Picture]:
    """Yield all pictures, and the first and the last one so many more times."""
    last = next(pictures)
    yield from repeat(last, still + 1)
    for last in pictures:
        yield last
    yield from repeat(last, still)


def _ego(view: Picture | None, side: int) -> Image.Image | None:
    return None if view is None else Image.fromarray(view).resize((side, side), Image.Resampling.LANCZOS)


def _caption(picture: Picture, step: StepRecord | None, ego: Image.Image | None) -> Picture:
    """Add the ego view in a corner, and below it the current call with the agent's reasoning."""
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
    """Draw a line of white text with a dark edge, cut with an ellipsis at width pixels."""
    font = ImageFont.load_default(size=max(size, 4))
    if draw.textlength(text, font) > width:
        while text and draw.textlength(text + "\u2026", font) > width:
            text = text[:-1]
        text += "\u2026"
    draw.text((14, y), text, "white", font, "ls", stroke_width=2, stroke_fill="black")


# -- files -------------------------------------------------------------------------------------------------------------
def _mp4(pictures: Iterator[Picture], out: Path, fps: float, size: tuple[int, int]) -> None:
    writer = imageio_ffmpeg.write_frames(
        str(out), size, fps=fps, codec="libx264", macro_block_size=2,
        # A browser can start a film before it has all of it: faststart puts the index first.
        output_params=["-preset", "veryfast", "-crf", "21", "-movflags", "+faststart"]
    )  # fmt: skip
    writer.send(None)  # The writer is a generator: it opens the file at the first send.
    try:
        for picture in pictures:
            writer.send(np.ascontiguousarray(picture))
    finally:
        writer.close()
