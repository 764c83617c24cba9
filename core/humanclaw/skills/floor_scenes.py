"""Floor scenes: a tiled floor with the stairs or the seat that a call needs, as scenes that a reference names.

floor                  the floor alone
floor:side=240         a larger one, metres
floor:up=0.18,0.28,3   three steps that rise by 0.18 m and are 0.28 m deep; down likewise
floor:sit=0.5          a bench behind the body, for hips at 0.5 m
floor:wall=0.6         a wall 0.6 m behind the body
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Final

import numpy as np

from humanclaw.body.skeleton import LINKS, Capsule
from humanclaw.errors import SceneError
from humanclaw.motion.leg_collision_avoidance import HEEL_END, TOE_END
from humanclaw.skills.contract import Skill
from humanclaw.world.scene import Asset, Scene
from humanclaw.world.scene_builder import Colour, SceneBuilder

FLOOR: Final = "floor"
"""Name of the scene."""
SIDE: Final = 36.0
"""Side of the floor, metres: twenty of the longest strides stay on it."""
MOST: Final = 1000.0
"""Largest number of an argument: a scene of a million steps would fill memory."""


def _hips_below() -> float:
    pelvis = next(link.shape for link in LINKS if link.joint == "pelvis")
    assert isinstance(pelvis, Capsule)
    return pelvis.radius - pelvis.a[1]


HIPS: Final = _hips_below()
"""Distance from the pelvis joint down to the surface that touches a seat, metres."""
_SEAT_FRONT: Final = -0.13
"""Front of a seat, metres along the facing: just behind the hips of a standing body."""
_CLEAR: Final = 0.01
"""Clearance of the toes from a riser, metres."""
_TREAD, _SEATED = 0.28, 0.5
"""Depth of a tread and height of seated hips, metres, for skills without such a parameter."""
_TILE: Final = 0.5
"""Side of a floor tile, metres. Tiles show how far a body gets, and whether its feet slide."""
_TEXELS: Final = 800
"""Texels along the longer side of a floor: enough for sharp edges of tiles on the usual ones."""
_WOOD, _STONE, _PLASTER = (176, 132, 92), (168, 160, 150), (226, 223, 214)
"""Colours by eye: apart in brightness too, so that steps and walls show against the floor."""


def floor_for(skill: Skill, values: Mapping[str, float], calls: int = 1) -> str:
    """Return what a skill needs, as the argument of the scene `floor`; empty for the floor alone.

    Skills that command a rise or drop of the hips get stairs of as many steps as calls. Skills that sit get a seat.

    Args:
        values: Parameters by name, SI.
    """
    asked = {part.measure: values[part.name] for part in skill.parameters if part.measure}
    tread = asked.get("hips.forward", _TREAD)
    for kind, measure in (("up", "hips.rise"), ("down", "hips.drop")):
        if measure in asked:
            return f"{kind}={asked[measure]!r},{tread!r},{calls}"
    return f"sit={asked.get('hips.height', _SEATED)!r}" if skill.role == "sit" else ""


def floor_scene(argument: str = "") -> Scene:
    """Return the scene of an argument. The body is at the origin, faces +Z, and the floor is at 0.

    Raises SceneError for an argument that is none of those above.
    """
    kind, _, text = argument.partition("=")
    try:
        numbers = [float(number) for number in text.split(",")] if kind else []
        if not all(0 < number <= MOST for number in numbers):
            raise ValueError
        builder = _BUILT[kind](*numbers)
    except (KeyError, TypeError, ValueError):
        problem = f"the scene {FLOOR} knows no {argument!r}."
        known = "up=RISE,DEPTH,STEPS, down=RISE,DEPTH,STEPS, sit=HIPS, wall=DISTANCE or side=LENGTH"
        raise SceneError(problem, f"Write {known}, in metres, or {FLOOR!r} alone.") from None
    scene = builder.scene()
    assets = {key: _tiled(asset) if asset.category == FLOOR else asset for key, asset in scene.assets.items()}
    return replace(scene, assets=assets, name=f"{FLOOR}:{argument}" if argument else FLOOR)


# -- what stands on the floor ------------------------------------------------------------------------------------------
def _flat(side: float = SIDE) -> SceneBuilder:
    builder = SceneBuilder()
    builder.box(FLOOR, (side, 0.2, side), (0.0, -0.2, 0.0))
    return builder


def _ascent(h: float, d: float, steps: float) -> SceneBuilder:
    # As in real climbing, the landing foot has its ankle over the edge; the standing toes stay clear of the riser.
    builder, count, riser = _flat(), int(steps), max(TOE_END + _CLEAR, d + 2 * _CLEAR)
    for k in range(count):
        builder.box("stairs", (2.0, h * (k + 1), d), (0.0, 0.0, riser + d * (k + 0.5)), _stone(k))
    builder.box(FLOOR, (2.0, h * (count + 1), 4.0), (0.0, 0.0, riser + d * count + 2.0))
    return builder


def _descent(h: float, d: float, steps: float) -> SceneBuilder:
    # Downstairs the middle of the foot is over the edge, so that the next heel clears it.
    builder, count, edge = SceneBuilder(), int(steps), (TOE_END + HEEL_END) / 2
    low = -h * (count + 2)  # Every tread is a box that reaches down to low.
    builder.box(FLOOR, (2.0, -low, 4.0), (0.0, low, edge - 2.0))
    for k in range(count):
        builder.box("stairs", (2.0, -h * (k + 1) - low, d), (0.0, low, edge + d * (k + 0.5)), _stone(k))
    builder.box(FLOOR, (2.0, h, 4.0), (0.0, low, edge + d * count + 2.0))
    return builder


def _seat(hips: float) -> SceneBuilder:
    builder = _flat()
    # Its top is where the hips of a body at the commanded height touch it.
    builder.box("bench", (1.2, max(hips - HIPS, 0.02), 1.0), (0.0, 0.0, _SEAT_FRONT - 0.5), _WOOD)
    return builder


def _wall(behind: float) -> SceneBuilder:
    builder = _flat()
    builder.box("wall", (4.0, 2.5, 0.2), (0.0, 0.0, -behind - 0.1), _PLASTER)
    return builder


_BUILT: Final[Mapping[str, Callable[..., SceneBuilder]]] = {
    "": _flat, "side": _flat, "up": _ascent, "down": _descent, "sit": _seat, "wall": _wall
}  # fmt: skip


def _stone(number: int) -> Colour:
    """Return the colour of a step: every second is darker, so that their edges are seen from above."""
    red, green, blue = (part - 24 * (number % 2) for part in _STONE)
    return red, green, blue


def _tiled(asset: Asset) -> Asset:
    """Texture a floor with tiles, projected from above."""
    floor = asset.mesh.vertices[:, [0, 2]]
    low, high = floor.min(0), floor.max(0)
    wide, deep = np.maximum(1, np.round((high - low) / _TILE)).astype(int)
    light = np.add.outer(np.arange(deep), np.arange(wide)) % 2
    texels = max(1, _TEXELS // max(wide, deep))
    texture = (168 + 26 * light[:, :, None]).astype(np.uint8).repeat(texels, 0).repeat(texels, 1)
    uv = ((floor - low) / (high - low)).astype(np.float32)
    return replace(asset, mesh=replace(asset.mesh, uv=uv, texture=texture.repeat(3, 2)))
