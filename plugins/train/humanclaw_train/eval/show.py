"""Pictures of a skill: `humanclaw show skill walk --z-cm 40`.

A GIF and a strip show the body in half-physics, executing the same call several times in a row. The body gets the
stairs or the seat that the command needs.
"""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from humanclaw import Backends, Body, Call, HumanclawError, Motion, Renderer, Scene, Skill
from humanclaw.body import FPS, HISTORY, Array
from humanclaw.skills import stage, stage_for, to_si
from humanclaw.storage import gif
from humanclaw.world import Camera, WorldState

if TYPE_CHECKING:
    from humanclaw import Plugins

Picture = NDArray[np.uint8]
SIZE: Final = (240, 320)
"""Height and width of one picture, pixels."""
MOMENTS: Final = 8
"""Pictures in a strip."""
_EVERY: Final = 2
"""Frames of motion per frame of the GIF."""
_BESIDE: Final = np.array([-3.4, 0.35, 1.1])
"""Vector from the body to the camera, metres: to its right and slightly ahead."""
_BEFORE: Final = np.array([1.1, 0.35, 3.4])
"""Vector to the camera for a body that moves sideways, metres: ahead and slightly to its left."""
_MARGIN: Final = 8
"""Margin of a title, pixels."""


def show(
    plugins: Plugins,
    name: str,
    params: Mapping[str, Any],
    calls: int,
    seed: int,
    out: Path,
    renderer: str,
) -> tuple[Path, Path]:
    """Write a GIF and a strip of a skill and return their paths.

    params: checked against the schema. Raises HumanclawError.
    """
    if out.suffix.lower() != ".gif":
        raise HumanclawError(f"Expected a GIF file for --out; got {out}.", "Name a file that ends in .gif.")
    skill = plugins.skill(name)
    shown = performed(plugins, skill, params, calls, seed, renderer)
    drawing: Renderer = plugins.make("renderers", renderer)
    try:
        return pictures(*shown, drawing, out)
    finally:
        drawing.close()


def performed(
    plugins: Plugins, skill: Skill, params: Mapping[str, Any], calls: int, seed: int, renderer: str
) -> tuple[str, Motion, Scene]:
    """Return title, simulated motion and scene of a skill that is called several times in a row."""
    values = {parameter.name: 0.0 for parameter in skill.parameters} | _values(skill, params)
    scene = stage(stage_for(skill, values, calls))
    with Body(scene, seed=seed, plugins=plugins, backends=Backends(renderer=renderer)) as body:
        asked = ", ".join(f"{key} {value}" for key, value in params.items())
        return f"{skill.name} {asked}", acted(body, [Call(skill.name, params)] * calls), scene


def _values(skill: Skill, params: Mapping[str, Any]) -> dict[str, float]:
    """Return the parameters that command a measure, in SI, by name."""
    commanding = (parameter for parameter in skill.parameters if parameter.measure)
    return {parameter.name: to_si(parameter.key, params[parameter.key]) for parameter in commanding}


def acted(body: Body, calls: Iterable[Call]) -> Motion:
    """Execute calls and return the simulated motion, from standing."""
    whole = body.history
    for call in calls:
        for chunk in body.execute(call).chunks:
            whole = whole.then(chunk.execution.simulated)
    return whole


# -- drawing -----------------------------------------------------------------------------------------------------------
def filmed(motion: Motion, scene: Scene, renderer: Renderer, frames: Iterable[int]) -> Iterator[Picture]:
    """Yield a picture of each frame, seen across the direction of travel, on a tiled floor."""
    renderer.load(scene)
    eye = _eye(motion)
    for at in frames:
        # The mean of two thirds of a second keeps the camera steady.
        centre = motion.root[max(0, at - 10) : at + 11].mean(0)
        camera = Camera.looking(centre + eye - [0.0, 0.1, 0.0], centre - [0.0, 0.1, 0.0], 36.0, SIZE)
        yield renderer.render(WorldState(motion[at : at + 1], {}), camera).rgb


def _eye(motion: Motion) -> Array:
    """Return the vector from the body, which first faces +Z, to the camera (3,)."""
    # From the side of the travel, so that the body does not walk towards the camera or away from it.
    across, _, ahead = np.abs(motion.root[-1] - motion.root[0])
    return _BEFORE if across > ahead else _BESIDE


def moments(length: int) -> list[int]:
    """Return the frames of a strip for motion of this length."""
    return [int(frame) for frame in np.linspace(HISTORY - 1, length - 1, MOMENTS)]


def strip(rows: Sequence[tuple[str, Sequence[Picture]]]) -> Picture:
    """Stack rows of pictures, each with its title."""
    return np.concatenate([_titled(np.concatenate(pictures, axis=1), title) for title, pictures in rows])


def _titled(picture: Picture, title: str) -> Picture:
    image = Image.fromarray(picture)
    draw, room = ImageDraw.Draw(image), image.width - 2 * _MARGIN
    columns = int(len(title) * room / max(room, draw.textlength(title, font_size=16)))
    draw.text((_MARGIN, _MARGIN), textwrap.fill(title, columns), fill="black", font_size=16)
    return np.asarray(image)


def pictures(title: str, motion: Motion, scene: Scene, renderer: Renderer, out: Path) -> tuple[Path, Path]:
    """Write `out` (GIF) and a strip beside it (PNG). Returns both paths."""
    row = list(filmed(motion, scene, renderer, moments(len(motion))))
    frames = filmed(motion, scene, renderer, range(0, len(motion), _EVERY))
    out.parent.mkdir(parents=True, exist_ok=True)
    still = out.with_suffix(".png")
    try:
        gif([_titled(frame, title) for frame in frames], out, FPS / _EVERY)
        Image.fromarray(strip([(title, row)])).save(still)
    except OSError as error:
        raise HumanclawError(f"cannot write {out}: {error}.", "Name another file with --out.") from error
    return out, still
