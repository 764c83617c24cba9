"""Scenes of the split `self`: a house of val with a few things in it, placed before the body.

A reference holds everything: `self:house:3?glass,1.2,3.4,0,0.785` is house 3 with the stage `glass` before a body at
x 1.2, z 3.4, floor 0, yaw 0.785. Further numbers are the stage's own.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from inspect import signature
from typing import Any, Final

import numpy as np

from humanclaw import Motion, Plugins, Reach, Scene, SceneError
from humanclaw.body import HISTORY, Pose2D, rest_pose, skin, yaw_matrix
from humanclaw.records import Vec3
from humanclaw.skills import posed
from humanclaw.world import Mesh, SceneBuilder, box_mesh

FRAME: Final = 1.2
"""Metres from the body to a frame: what stands twice as far away stands where its mirror image would."""
EYES: Final = 1.55
"""Height of the eyes of a standing body, metres."""
HAND: Final = (0.16, 1.15, 0.45)
"""Where the other person holds a hand: inwards, above the floor and ahead of its hips, metres."""
CUBE: Final = 0.12
"""Metres from a hand up to the cube that marks it."""
AHEAD: Final = 1.5
"""Metres from the body to a gap, a shelf or a stool."""
_RED, _BLUE, _WOOD, _WALL = (200, 30, 30), (30, 60, 200), (150, 110, 70), (225, 222, 215)


@dataclass(frozen=True)
class Set:
    """A scene under construction, in the frame of the body: left, up and ahead in metres."""

    builder: SceneBuilder
    place: Pose2D

    def box(self, category: str, size: Vec3, at: Vec3, colour: tuple[int, int, int] = _WOOD, **facts: Any) -> None:
        self.builder.box(category, size, self._where(at), colour, rotation=self._turn(0.0), **facts)

    def cube(self, at: Vec3) -> None:
        """Hang a small red cube in the air. Nothing collides with it."""
        self.builder.mesh("cube", box_mesh((0.07, 0.07, 0.07), _RED), self._where(at))

    def person(self, pose: Motion, at: Vec3, turned: float = 0.0, size: Vec3 = (1.0, 1.0, 1.0)) -> None:
        """Put another person of the same looks there. size: scale of width, height and depth, seen from the eyes."""
        looks = skin()
        vertices, _ = looks.posed(pose.root[-1], pose.rotations[-1])
        vertices = ((vertices - [0, EYES, 0]) * size + [0, EYES, 0]).astype(np.float32)
        uv = np.full((len(vertices), 2), 0.5, np.float32)
        uv[:, 0] = (looks.regions + 0.5) / len(looks.colours)
        mesh = Mesh(vertices, looks.faces, uv, looks.colours[None])
        self.builder.mesh("person", mesh, self._where(at), rotation=self._turn(turned))

    def frame(self) -> None:
        """Put up a frame as large as a door, through which one sees what is behind it."""
        for side in (-0.5, 0.5):
            self.box("frame", (0.06, 2.0, 0.06), (side, 0.0, FRAME))
        for up in (0.0, 1.94):
            self.box("frame", (0.94, 0.06, 0.06), (0.0, up, FRAME))

    def glass(self) -> None:
        self.builder.box("mirror", (0.94, 1.88, 0.02), self._where((0, 0.06, FRAME)), rotation=self._turn(np.pi))

    def _where(self, at: Vec3) -> Vec3:
        x, y, z = (yaw_matrix(self.place.yaw) @ at + [self.place.x, self.place.floor, self.place.z]).round(4).tolist()
        return x, y, z

    def _turn(self, turned: float) -> tuple[float, float, float, float]:
        half = (self.place.yaw + turned) / 2
        return 0.0, round(float(np.sin(half)), 7), 0.0, round(float(np.cos(half)), 7)


def _hands(on: Set, side: float, left: float, up: float, ahead: float) -> None:
    """Stand another person beside the body, its inner hand held out, and hang a cube up. side: metres to the left."""
    hand, aside = ("right", -HAND[0]) if side > 0 else ("left", HAND[0])
    pose, _ = posed(Reach(hand, (aside, *HAND[1:]), seconds=0.5), rest_pose(HISTORY))  # type: ignore[arg-type]
    on.person(pose, (side, 0.0, 0.0))
    on.cube((left, up, ahead))


def _mirror(on: Set, kind: str) -> None:
    """Put up a frame that holds a mirror, a picture of a person, or nothing before another person."""
    on.frame()
    if kind == "glass":
        on.glass()
    elif kind == "double":
        on.person(rest_pose(), (0.0, 0.0, 2 * FRAME), np.pi)
    else:
        on.box("picture", (0.94, 1.88, 0.02), (0.0, 0.06, FRAME + 0.02), _WALL)
        on.person(rest_pose(), (0.0, 0.0, FRAME), np.pi, (0.5, 0.5, 0.002))


def _cabinet(on: Set, mass: float) -> None:
    """Put a cabinet before the body. mass: kilograms; 0 fixes it."""
    on.box("cabinet", (0.8, 0.9, 0.4), (0.0, 0.0, 0.6), movable=mass > 0, mass=mass)


def _post(on: Set, bearing: float) -> None:
    """Put a red post a metre away. bearing: degrees to the left."""
    left, ahead = np.sin(np.radians(bearing)), np.cos(np.radians(bearing))
    on.box("post", (0.1, 1.5, 0.1), (float(left), 0.0, float(ahead)), _RED)


def _posts(on: Set, red: float, blue: float) -> None:
    """Put two posts before the body. red, blue: metres to the left."""
    for left, colour in ((red, _RED), (blue, _BLUE)):
        on.box("post", (0.08, 1.4, 0.08), (left, 0.0, 0.9), colour)


def _gap(on: Set, width: float) -> None:
    for side in (-1, 1):
        on.box("panel", (0.2, 2.0, 0.3), (side * (width / 2 + 0.1), 0.0, AHEAD))


def _shelf(on: Set, height: float) -> None:
    """Lay a cube on the edge of a high cupboard. height: of the cube, metres."""
    on.box("shelf", (0.5, height - 0.035, 0.3), (0.0, 0.0, AHEAD + 0.12))
    on.cube((0.0, height - 0.035, AHEAD))


def _stool(on: Set, height: float) -> None:
    on.box("stool", (0.45, height, 0.4), (0.0, 0.0, AHEAD))


_STAGES: Final[Mapping[str, Callable[..., None]]] = {
    "hands": _hands,
    **{kind: partial(_mirror, kind=kind) for kind in ("glass", "double", "picture")},
    "cabinet": _cabinet, "post": _post, "posts": _posts, "gap": _gap, "shelf": _shelf, "stool": _stool,
}  # fmt: skip


def reference(house: str, stage: str, place: Pose2D, values: tuple[float, ...] = ()) -> str:
    """Return the reference of a scene. values: numbers of the stage."""
    numbers = (place.x, place.z, place.floor, place.yaw, *values)
    return f"self:{house}?{','.join((stage, *(f'{number:g}' for number in numbers)))}"


def staged(plugins: Plugins, argument: str) -> Scene:
    """Make the scene of a reference without its `self:`, in a house of any plugin. Raises SceneError for a malformed
    reference."""
    house, _, rest = argument.partition("?")
    stage, *numbers = rest.split(",")
    try:
        x, z, floor, yaw, *values = map(float, numbers)
        signature(_STAGES[stage]).bind(None, *values)
    except (KeyError, TypeError, ValueError) as error:
        expected = f"self:HOUSE?STAGE,X,Z,FLOOR,YAW and the numbers of a stage ({', '.join(_STAGES)})"
        raise SceneError(f"expected {expected}; got self:{argument}.", "Take one from the split `self`.") from error
    scene: Scene = plugins.scene(house)
    place = Pose2D(x, z, yaw, floor)
    on = Set(SceneBuilder(dict(scene.assets), list(scene.objects)), place)
    _STAGES[stage](on, *values)
    objects, assets = tuple(on.builder.objects), on.builder.assets
    return replace(scene, name=f"self:{argument}", assets=assets, objects=objects, start=place)
