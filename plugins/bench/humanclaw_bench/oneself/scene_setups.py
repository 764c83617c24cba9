"""Scenes of the split `self`: a house of val with a few things in it, placed before the body.

A reference holds everything: `self:house:3?glass,1.2,3.4,0,0.785` is house 3 with the setup `glass` before a body at
x 1.2, z 3.4, floor 0, yaw 0.785. Further numbers are the setup's own.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from inspect import signature
from typing import Any, Final

import numpy as np

from humanclaw import Plugins, Scene, SceneError
from humanclaw.body import Array, Motion, Pose2D, skin, yaw_matrix
from humanclaw.motion import DiTGenerator
from humanclaw.records import Vec3
from humanclaw.world import Mesh, SceneBuilder, box_mesh, ego_camera

BESIDE: Final = np.radians(50.0)
"""Between the body and another person, seen from a mirror. It is turned by half of it, to show the other and not the
body, or by a quarter, to show both. The nearer they are, the more alike is the light on them."""
AHEAD: Final = 1.5
"""Metres from the body to a gap or a stool."""
EDGE: Final = 1.1
"""Metres from the body to the edge of a shelf."""
THIN: Final = 0.02
"""Thickness of a sheet, metres for each metre from the eye."""
_RED, _BLUE, _WOOD = (200, 30, 30), (30, 60, 200), (150, 110, 70)


@dataclass(frozen=True)
class Setup:
    """A scene under construction, in the frame of the body: left, up and ahead in metres."""

    builder: SceneBuilder
    place: Pose2D
    heading: float = 0.0
    """Of the body, radians."""

    def body(self) -> Motion:
        """Return the body as it stands at first."""
        return Pose2D(0.0, 0.0, self.heading).to_world(DiTGenerator.load().start())

    def box(self, category: str, size: Vec3, at: Vec3, colour: tuple[int, int, int] = _WOOD, **facts: Any) -> None:
        self.builder.box(category, size, self._where(at), colour, rotation=self._turn(0.0), **facts)

    def cube(self, at: Vec3) -> None:
        """Hang a small red cube in the air. Nothing collides with it."""
        self.builder.mesh("cube", box_mesh((0.07, 0.07, 0.07), _RED), self._where(at))

    def person(self, body: Motion, at: Vec3, turned: float = 0.0) -> None:
        """Put another person of the same looks there. body: its pose, over the origin."""
        looks = skin()
        vertices, normals = looks.posed(np.zeros(3), body.rotations[-1])
        mesh = Mesh(vertices, looks.faces, looks.uv, looks.colours[None], normals)
        where = self._where(tuple(at + yaw_matrix(turned) @ body.root[-1]))
        self.builder.mesh("person", mesh, where, rotation=self._turn(turned))

    def sheet(self, category: str, size: Vec3, ahead: float, eye: Array, turned: float) -> None:
        """Put up a sheet that is a rectangle to an eye (3,), also if it is turned. size: with the height of its
        middle, metres."""
        wide, high, up = size
        middle, normal = np.array([0.0, up, ahead]), yaw_matrix(turned) @ [0.0, 0.0, 1.0]
        flat = box_mesh((wide, high, 1.0), _WOOD)
        x, y, z = flat.vertices.T.astype(float)
        rays = np.stack([-x, y + up - high / 2, np.full(len(x), ahead)], 1) - eye
        way = ((middle - eye) @ normal) / (rays @ normal) + THIN * (0.5 - z)
        at = (eye + rays * way[:, None] - middle) @ yaw_matrix(np.pi + turned)
        mesh = replace(flat, vertices=at.astype(np.float32))
        where, turn, assets = self._where((0.0, up, ahead)), self._turn(np.pi + turned), self.builder.assets
        self.builder.mesh(category, _without_shadow(mesh), where, rotation=turn)
        assets[category] = replace(assets[category], hulls=(mesh.vertices,))

    def _where(self, at: Vec3) -> Vec3:
        x, y, z = (yaw_matrix(self.place.yaw) @ at + [self.place.x, self.place.floor, self.place.z]).round(4).tolist()
        return x, y, z

    def _turn(self, turned: float) -> tuple[float, float, float, float]:
        half = (self.place.yaw + turned) / 2
        return 0.0, round(float(np.sin(half)), 7), 0.0, round(float(np.cos(half)), 7)


def _without_shadow(mesh: Mesh) -> Mesh:
    """Add a corner of no face, too high for renderers to draw a shadow: it would show how a mirror is turned."""
    # Over 2.1 m, from where on humanclaw_raster lets things cast none.
    vertices = np.append(mesh.vertices, np.array([[0.0, 2.2, 0.0]], np.float32), axis=0)
    return replace(mesh, vertices=vertices, uv=np.append(mesh.uv, mesh.uv[:1], axis=0))


def _hands(on: Setup, away: float, own: float) -> None:
    """Put up a mirror, too low for faces, that shows the body and one of two others who stand to its left and right.

    First views are alike whichever way it is turned: image and image change places. Two others, so that whoever looks
    aside sees the same, too.

    away: metres. own: 1 if the image to the left is oneself, else -1.
    """
    _glass(on, (0.96, 0.5, 1.25), away, own * BESIDE / 4)
    for side in (1.0, -1.0):
        _double(on, away, side * BESIDE)


def _mirror(on: Setup, away: float, left: float, turned: float = 0.0) -> None:
    """Put up a mirror that shows oneself; or, turned, another person beside one.

    To the eyes of a standing body first views are alike: the mirror has the same edges, and the other stands likewise.

    away: metres. left: degrees from the heading, so that what stands beside the body is out of view.
    """
    on = replace(on, place=replace(on.place, yaw=on.place.yaw + np.radians(left)), heading=-np.radians(left))
    _glass(on, (0.6, 1.4, 1.2), away, turned)
    if turned:
        _double(on, away, BESIDE)


def _glass(on: Setup, size: Vec3, away: float, turned: float) -> None:
    """Put up a mirror on a foot. size: with the height of its middle, metres."""
    wide, high, up = size
    eye = ego_camera(on.body()).position
    # Behind the mirror, which it would else cover.
    on.sheet("frame", (wide + 0.1, high + 0.1, up), away + 0.01, eye, turned)
    on.sheet("mirror", size, away, eye, turned)
    for foot in ((0.06, 0.5, 0.06), (0.5, 0.02, 0.3)):
        on.box("stand", foot, (0.0, 0.0, away + 0.05))


def _double(on: Setup, away: float, beside: float) -> None:
    """Stand another person beside the body: it, turned around a mirror by an angle, radians."""
    on.person(on.body(), (away * np.sin(beside), 0.0, away * (1 - np.cos(beside))), -beside)


def _cabinet(on: Setup, mass: float) -> None:
    """Put a cabinet before the body. mass: kilograms; 0 fixes it."""
    on.box("cabinet", (0.8, 0.9, 0.4), (0.0, 0.0, 0.6), movable=mass > 0, mass=mass)


def _post(on: Setup, bearing: float) -> None:
    """Put a red post a metre away. bearing: degrees to the left."""
    left, ahead = np.sin(np.radians(bearing)), np.cos(np.radians(bearing))
    on.box("post", (0.1, 1.5, 0.1), (float(left), 0.0, float(ahead)), _RED)


def _posts(on: Setup, red: float, blue: float) -> None:
    """Put two posts before the body. red, blue: metres to the left."""
    for left, colour in ((red, _RED), (blue, _BLUE)):
        on.box("post", (0.08, 1.4, 0.08), (left, 0.0, 0.9), colour)


def _gap(on: Setup, width: float) -> None:
    for side in (-1, 1):
        on.box("panel", (0.2, 2.0, 0.3), (side * (width / 2 + 0.1), 0.0, AHEAD))


def _shelf(on: Setup, height: float, behind: float) -> None:
    """Lay a cube on a deep shelf. behind: metres from its edge."""
    on.box("shelf", (0.6, height, 1.3), (0.0, 0.0, EDGE + 0.65))
    on.cube((0.0, height, EDGE + behind))


def _stool(on: Setup, height: float) -> None:
    on.box("stool", (0.45, height, 0.4), (0.0, 0.0, AHEAD))


_SETUPS: Final[Mapping[str, Callable[..., None]]] = {
    "hands": _hands,
    "glass": _mirror,
    "double": partial(_mirror, turned=-BESIDE / 2),
    "cabinet": _cabinet, "post": _post, "posts": _posts, "gap": _gap, "shelf": _shelf, "stool": _stool,
}  # fmt: skip


def reference(house: str, setup: str, place: Pose2D, values: tuple[float, ...] = ()) -> str:
    """Return the reference of a scene. values: numbers of the setup."""
    numbers = (place.x, place.z, place.floor, place.yaw, *values)
    return f"self:{house}?{','.join((setup, *(f'{number:g}' for number in numbers)))}"


def set_up(plugins: Plugins, argument: str) -> Scene:
    """Make the scene of a reference without its `self:`, in a house of any plugin. Raises SceneError for a malformed
    reference."""
    house, _, rest = argument.partition("?")
    setup, *numbers = rest.split(",")
    try:
        x, z, floor, yaw, *values = map(float, numbers)
        signature(_SETUPS[setup]).bind(None, *values)
    except (KeyError, TypeError, ValueError) as error:
        expected = f"self:HOUSE?SETUP,X,Z,FLOOR,YAW and the numbers of a setup ({', '.join(_SETUPS)})"
        raise SceneError(f"expected {expected}; got self:{argument}.", "Take one from the split `self`.") from error
    scene: Scene = plugins.scene(house)
    place = Pose2D(x, z, yaw, floor)
    on = Setup(SceneBuilder(dict(scene.assets), list(scene.objects)), place)
    _SETUPS[setup](on, *values)
    objects, assets = tuple(on.builder.objects), on.builder.assets
    return replace(scene, name=f"self:{argument}", assets=assets, objects=objects, start=place)
