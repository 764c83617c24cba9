"""Figures 5 and 6 of the paper as pictures, each of several poses in one scene: `humanclaw figure 5a`."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np
from PIL import Image, ImageDraw

from humanclaw import Backends, Body, Call, Motion, Renderer, Scene, Skill
from humanclaw.body import FPS, FUTURE, HISTORY, Array
from humanclaw.motion import DiTGenerator
from humanclaw.skills import Role, find_suited, floor_for, floor_scene
from humanclaw.storage import save_picture
from humanclaw.world import GRAVITY, Camera, SceneBuilder, WorldState, together

if TYPE_CHECKING:
    from humanclaw import Plugins

Vec3 = tuple[float, float, float]
WIDTH: Final = 1200
"""Width of a figure, pixels."""
BODIES: Final = 16
"""Seeds in figure 5a."""
STRIDE, STRIDES = 30, 12
"""Length, cm (as in the paper), and number of the strides in figure 5b."""
SEATS: Final = (20, 50, 80)
"""Heights of the hips in figure 5d, cm: both ends of the range, and a chair's."""
_FINE: Final = 2
"""Pictures are drawn this much larger, because edges are hard where bodies overlap."""
_TITLE: Final = 34
"""Height of the bar of a title, pixels."""


@dataclass(frozen=True)
class Panel:
    """A picture of bodies in a scene.

    poses: one frame for each body. eye, centre: metres. fov: vertical, degrees. height: pixels. lines: points (N, 3),
    colour and label of each line over the picture. share: of WIDTH.
    """

    title: str
    scene: Scene
    poses: Motion
    eye: Vec3
    centre: Vec3
    fov: float
    height: int
    share: float = 1.0
    lines: Sequence[tuple[Array, str, str]] = ()

    def drawn(self, renderer: Renderer) -> Image.Image:
        """Draw the bodies, then the lines, below the title."""
        width = round(self.share * WIDTH)
        camera = Camera.looking(self.eye, self.centre, self.fov, (_FINE * width, _FINE * self.height))
        renderer.load(self.scene)
        states = (WorldState(self.poses[k : k + 1], {}) for k in range(len(self.poses)))
        image = Image.fromarray(together([renderer.render(state, camera) for state in states]))
        draw = ImageDraw.Draw(image)
        for points, colour, label in self.lines:
            pixels = [(float(x), float(y)) for x, y in camera.pixels(points)]
            draw.line(pixels, colour, 4 * _FINE, "curve")
            draw.text(
                pixels[len(pixels) // 2], label, colour, font_size=18 * _FINE, anchor="mm",
                stroke_width=2 * _FINE, stroke_fill="white",
            )  # fmt: skip
        sheet = Image.new("RGB", (width, self.height + _TITLE), "white")
        sheet.paste(image.resize((width, self.height), Image.Resampling.LANCZOS), (0, _TITLE))
        ImageDraw.Draw(sheet).text((6, _TITLE / 2), self.title, "black", font_size=18, anchor="lm")
        return sheet


Rows = list[list[Panel]]


def figure(plugins: Plugins, name: str, seed: int, renderer: str, out: Path) -> Path:
    """Draw one of FIGURES into a PNG or JPEG file and return its path. Raises HumanclawError."""
    drawing: Renderer = plugins.make("renderers", renderer)
    try:
        rows = [[np.asarray(panel.drawn(drawing)) for panel in row] for row in FIGURES[name](plugins, seed)]
    finally:
        drawing.close()
    out.parent.mkdir(parents=True, exist_ok=True)
    return save_picture(Image.fromarray(np.concatenate([np.concatenate(row, axis=1) for row in rows])), out)


# -- motion ------------------------------------------------------------------------------------------------------------
_WALK: Final = ("hips.forward", "hips.left", "heading.left")


def _skill(plugins: Plugins, *measures: str, role: Role = "locomotion") -> Skill:
    return find_suited(plugins.skills.values(), *measures, role=role)


def _call(skill: Skill, **values: int) -> Call:
    """Return a call with parameters by measure, dots as underscores, in centimetres; others are 0."""
    asked = {measure.replace("_", "."): value for measure, value in values.items()}
    return Call(skill.name, {part.key: asked.get(part.measure, 0) for part in skill.parameters})


def _acted(plugins: Plugins, scene: Scene, calls: Sequence[Call], seed: int, simulator: str = "") -> Motion:
    """Return the simulated motion of calls, from standing."""
    with Body(scene, seed=seed, plugins=plugins, backends=Backends(simulator=simulator)) as body:
        whole = body.history
        for call in calls:
            for chunk in body.execute(call).chunks:
                whole = whole.then(chunk.execution.simulated)
        return whole


def _ends(motion: Motion, every: int = 1) -> Motion:
    """Return the pose at the start and after each call, or each `every` calls."""
    return motion[HISTORY - 1 :: every * FUTURE]


# -- figure 5 ----------------------------------------------------------------------------------------------------------
def prior(plugins: Plugins, seed: int) -> Rows:
    """Draw two seconds of many seeds: of the prior alone, and with the adapter of walking."""
    walk = _skill(plugins, *_WALK)
    asked = {part.name: STRIDE / 100 if part.measure == "hips.forward" else 0.0 for part in walk.parameters}
    alone, led = _dreamt(None, {}, seed), _dreamt(walk.adapter, asked, seed)
    shown = ("the prior alone", alone), (f"with the adapter: walk {STRIDE} cm", led)
    view = (-5.0, 2.2, 3.0), (0.0, 0.7, 0.1), 30, 430, 1 / 2
    return [[Panel(f"{title}, {BODIES} seeds", floor_scene(), poses, *view) for title, poses in shown]]


def _dreamt(adapter: Path | None, values: Mapping[str, float], seed: int) -> Motion:
    """Return the pose of each body after two seconds, without physics."""
    # Without corrections, as in the paper: they would hold the body upright.
    generator = DiTGenerator.load(profile="paper")
    motions = [generator.start()] * BODIES
    for number in range(4):
        keys = [(seed, body, number) for body in range(BODIES)]
        motions = generator.generate_batch([motion[-HISTORY:] for motion in motions], adapter, [values] * BODIES, keys)
    return Motion(*(np.stack([getattr(motion, key)[-1] for motion in motions]) for key in ("root", "rotations")))


def stride(plugins: Plugins, seed: int) -> Rows:
    """Draw a walk along a ruler whose marks are one commanded stride apart."""
    walk = _call(_skill(plugins, *_WALK), hips_forward=STRIDE)
    motion = _acted(plugins, floor_scene(), [walk] * STRIDES, seed)
    hips = _ends(motion).root[:, 2]
    builder, marks, middle = SceneBuilder.on_floor(), np.arange(STRIDES + 1) * STRIDE / 100, STRIDES * STRIDE / 200
    builder.box("ruler", (0.22, 0.01, 2 * middle + 0.3), (-0.6, 0, middle), (246, 236, 206))
    for mark in marks:
        builder.box("mark", (0.1, 0.012, 0.02), (-0.66, 0, mark), (20, 20, 20))
    lines = [(np.array([[-1.0, 0.0, mark]]), "black", f"{100 * mark:.0f}") for mark in marks]
    lines += [(np.array([[-0.6, 0.01, place], [-0.6, 0.08, place]]), "#d2281c", "") for place in hips]
    paces = 100 * np.diff(hips)
    title = f"walk {STRIDE} cm: {paces.mean():.1f} cm a call, standard deviation {paces.std():.1f} cm (red: the hips)"
    view = (-24.0, 4.0, middle), (0.0, 0.75, middle), 4.9, 540
    return [[Panel(title, builder.scene(), _ends(motion, 2), *view, lines=lines)]]


def loop(plugins: Plugins, seed: int) -> Rows:
    """Draw walking, side steps and steps back around a square."""
    walk, side, back = (_skill(plugins, *asked) for asked in (_WALK, ("hips.left",), ("hips.back",)))
    sides = (
        (_call(walk, hips_forward=60), 4, "#c2410c"),
        (_call(side, hips_left=40), 6, "#7c3aed"),
        (_call(back, hips_back=40), 6, "#15803d"),
        (_call(side, hips_left=-40), 6, "#be185d"),
    )
    motion = _acted(plugins, floor_scene(), [call for call, count, _ in sides for _ in range(count)], seed)
    corners = HISTORY - 1 + FUTURE * np.cumsum([0, *(count for _, count, _ in sides)])
    ground = motion.root * [1, 0, 1]
    lines = [
        (ground[first : last + 1], colour, f"{call.skill} {count} x")
        for (first, last), (call, count, colour) in zip(pairwise(corners), sides, strict=True)
    ]
    jolts = FPS**2 / GRAVITY * np.linalg.norm(np.diff(motion.joints(), 2, axis=0), axis=-1).max(-1)
    # A second difference spans three frames, and those around a seam are of both skills.
    seams = corners[1:-1, None] + [-2, -1, 0]
    seam, other = jolts[seams].max(), np.delete(jolts, seams).max()
    title = f"Joints accelerate by at most {seam:.1f} g where skills change, {other:.1f} g elsewhere"
    return [[Panel(title, floor_scene(), _ends(motion, 2), (-4.0, 4.4, 6.6), (1.2, 0.5, 1.05), 27, 600, lines=lines)]]


def seats(plugins: Plugins, seed: int) -> Rows:
    """Draw sitting at several heights, each on a seat that fits."""
    skill, stop, panels = _skill(plugins, "hips.height", role="sit"), _skill(plugins, role="stop"), []
    for height in SEATS:
        scene = floor_scene(floor_for(skill, {"h": height / 100}))
        motion = _acted(plugins, scene, [_call(skill, hips_height=height), _call(stop)], seed)
        title = f"sit {height} cm: hips at {100 * motion.root[-1, 1]:.0f} cm"
        panels.append(Panel(title, scene, motion[-1:], (-4.2, 1.7, 3.0), (0.0, 0.6, -0.1), 22, 420, 1 / 3))
    return [panels]


# -- figure 6 ----------------------------------------------------------------------------------------------------------
def kinematics(plugins: Plugins, seed: int) -> Rows:
    """Draw the same calls into a wall and up stairs, by pure kinematics and in half-physics."""
    wall, stairs = SceneBuilder.on_floor(), SceneBuilder.on_floor()
    wall.box("wall", (1.2, 2.0, 0.12), (0.3, 0, 1.3), (214, 190, 160))
    stairs.steps(4, 0.17, 0.28, 0.35)
    walk = _call(_skill(plugins, *_WALK), hips_forward=50)
    climb = _call(_skill(plugins, "hips.rise"), hips_rise=17, hips_forward=28)
    blocked, aloft = ("walks through the wall", "the wall blocks"), ("climbs on in the air", "stairs and landing carry")
    rows: Rows = []
    for scene, calls, titles, (y, z) in (
        (wall.scene(), [walk] * 5, blocked, (1.1, 1.2)),
        (stairs.scene(), [climb] * 8, aloft, (1.45, 1.5)),
    ):
        played, simulated = (_acted(plugins, scene, calls, seed, simulator) for simulator in ("kinematic", ""))
        shown = (f"pure kinematics {titles[0]}", played), (f"half-physics: {titles[1]}", simulated)
        view = (-14.0, 3.4, z - 2.0), (0.0, y, z), 14, 400, 1 / 2
        rows.append([Panel(title, scene, _ends(motion), *view) for title, motion in shown])
    return rows


FIGURES: Final[Mapping[str, Callable[[Plugins, int], Rows]]] = {
    "5a": prior, "5b": stride, "5c": loop, "5d": seats, "6": kinematics
}  # fmt: skip
