"""Build small scenes of boxes, for physics checks and tests."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from humanclaw.body.pose import Pose2D
from humanclaw.world.joints import Hinge, Vec3
from humanclaw.world.scene import Asset, Mesh, Scene, SceneObject

Colour = tuple[int, int, int]
GREY: Colour = (200, 200, 200)
"""Light enough to show shading, and no colour that a task names."""


def box_mesh(size: Vec3, colour: Colour = GREY) -> Mesh:
    """Return a box that stands on y = 0. Each face has vertices of its own, for flat normals."""
    corners: list[Any] = []
    faces: list[list[int]] = []
    for axis in range(3):
        for sign in (-1, 1):
            a, b = (axis + 1) % 3, (axis + 2) % 3
            square = np.zeros((4, 3))
            square[:, axis], square[:, a], square[:, b] = sign, (-1, 1, 1, -1), (-1, -1, 1, 1)
            order = (0, 1, 2, 3) if sign > 0 else (3, 2, 1, 0)
            faces += [[len(corners) + order[0], len(corners) + order[k], len(corners) + order[k + 1]] for k in (1, 2)]
            corners += (square * np.array(size) / 2 + [0, size[1] / 2, 0]).tolist()
    uv = np.full((len(corners), 2), 0.5, np.float32)
    return Mesh(np.array(corners, np.float32), np.array(faces, np.int32), uv, np.full((2, 2, 3), colour, np.uint8))


def block(low: Vec3, high: Vec3) -> NDArray[np.float32]:
    """Return (8, 3) corners of a box, as a hull."""
    return np.array(
        [[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])], np.float32
    )


@dataclass
class SceneBuilder:
    """Builds a scene of boxes. Metres; ids count from 1; a position is the centre of a box's underside."""

    assets: dict[str, Asset] = field(default_factory=dict)
    objects: list[SceneObject] = field(default_factory=list)

    @classmethod
    def on_floor(cls) -> Self:
        """Begin with a floor of 20 by 20 metres."""
        builder = cls()
        builder.floor()
        return builder

    def box(self, category: str, size: Vec3, position: Vec3, colour: Colour = GREY, **facts: Any) -> int:
        """Add a box. facts: fields of SceneObject. Returns its id."""
        name = f"{category} {size} {colour}"
        if name not in self.assets:
            mesh = box_mesh(size, colour)
            self.assets[name] = Asset(name, category, mesh, (np.unique(mesh.vertices, axis=0),))
        return self._put(name, category, position, facts)

    def mesh(self, category: str, mesh: Mesh, position: Vec3, **facts: Any) -> int:
        """Add an object without collision shape. Returns its id."""
        name = f"{category} {len(self.assets)}" if category in self.assets else category
        self.assets[name] = Asset(name, category, mesh, ())
        return self._put(name, category, position, facts)

    def _put(self, asset: str, category: str, position: Vec3, facts: Mapping[str, Any]) -> int:
        self.objects.append(SceneObject(len(self.objects) + 1, asset, category, position, **facts))
        return len(self.objects)

    def solid(self, category: str, hulls: Sequence[NDArray[np.float32]], position: Vec3, **facts: Any) -> int:
        """Add an object of several convex pieces; it is drawn as its bounding box. Returns its id."""
        low, high = np.concatenate(hulls).min(axis=0), np.concatenate(hulls).max(axis=0)
        x, y, z = (float(edge) for edge in high - low)
        name = f"{category} {len(self.assets)}"
        self.assets[name] = Asset(name, category, box_mesh((x, y, z)), tuple(hulls))
        return self._put(name, category, position, facts)

    def door(self, angle: float = 0.0, x: float = 0.0, z: float = 0.8, away: bool = True, mass: float = 25.0) -> int:
        """Add a wall across +Z with a doorway of 90 cm and a leaf, hinged at smaller x, that opens by 95 degrees.

        away: whether it opens away from the origin. angle: how far it is open, radians. Returns the id of the leaf.
        """
        for side in (-1, 1):
            self.box("wall", (2, 2.5, 0.12), (x + 1.45 * side, 0, z))
        most, turn = float(np.radians(95)), -angle if away else angle
        hinge = Hinge((-0.45, 0.0, 0.0), *((-most, 0.0) if away else (0.0, most)))
        place = (x - 0.45 + 0.45 * float(np.cos(turn)), 0.01, z - 0.45 * float(np.sin(turn)))
        return self.box(
            "door", (0.88, 2.0, 0.04), place, rotation=(0.0, float(np.sin(turn / 2)), 0.0, float(np.cos(turn / 2))),
            movable=True, mass=mass, joint=hinge, state=turn,
        )  # fmt: skip

    def floor(self, y: float = 0.0) -> int:
        return self.box("floor", (20, 0.2, 20), (0, y - 0.2, 0))

    def steps(self, count: int, rise: float, run: float, first: float) -> None:
        """Add stairs that rise towards +Z and end in a landing. first: z of the first riser."""
        for k in range(count):
            self.box("stairs", (2, rise * (k + 1), run), (0, 0, first + run * (k + 0.5)))
        self.box("floor", (2, rise * count, 4), (0, 0, first + run * count + 2))

    def descent(self, count: int, rise: float, run: float, first: float) -> None:
        """Add a landing, and stairs from it that descend towards +Z to the floor at 0. first: z of the first edge."""
        self.box("floor", (2, rise * count, 4), (0, 0, first - 2))
        for k in range(count - 1):
            self.box("stairs", (2, rise * (count - 1 - k), run), (0, 0, first + run * (k + 0.5)))

    def room(self) -> None:
        """Add a floor of 4 by 4 metres between four walls."""
        self.floor()
        for side in (2, -2):
            self.box("wall", (4, 2.5, 0.2), (0, 0, side))
        for side in (2, -2):
            self.box("wall", (0.2, 2.5, 4), (side, 0, 0))

    def scene(self, floor: float = 0.0) -> Scene:
        """Return the scene. The body starts at the origin, facing +Z."""
        return Scene("boxes", dict(self.assets), tuple(self.objects), (), Pose2D(0, 0, 0, floor))
