"""Mirrors and dark screens: the room before one, drawn once more by the eye's mirror image at half the size."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final, NamedTuple, Self

import numpy as np
import scipy  # Its parts load when they are used: ndimage takes a fifth of a second.
from numpy.typing import NDArray

from humanclaw import Scene
from humanclaw.body import Array, matrix_from_quaternion
from humanclaw.world import Mesh, View
from humanclaw_raster.buffers import Instances, Pinhole
from humanclaw_raster.lighting import front
from humanclaw_raster.packing import Model
from humanclaw_raster.painting import BRIGHTNESS, tones

COARSE: Final = 2
"""Pixels of a picture to one of a reflection, along each axis."""
SEEN: Final = 200
"""Pixels of a mirror from which it reflects."""
_CLEAR: Final = 0.01
"""What is less far before the glass hides nothing in it, metres: its own frame and wall."""
SHINE: Final = {"mirror": 0.85, "tv": 0.02}
"""Share of the light that glass reflects, by category; screens are coated against it."""
_DARK: Final = 60
"""Mean of a screen that is off, of 255. A picture outshines the room in it."""
_LINEAR: Final = BRIGHTNESS**2.2
"""Light of each value of a picture."""


class Glass(NamedTuple):
    """The reflecting rectangle of one mirror or dark screen."""

    id: int
    shine: float
    """As SHINE has it."""
    place: Array
    """(3,) and"""
    turn: Array
    """(3, 3) from the mirror's frame to the world."""
    low: Array
    """(3,) and"""
    high: Array
    """(3,) corners in the mirror's frame, metres; it faces along +Z there."""

    @classmethod
    def all_in(cls, scene: Scene) -> Iterator[Self]:
        """Yield the mirrors and the dark screens of a scene that stay where they are."""
        for obj in scene.objects:
            if obj.category not in SHINE or obj.movable:
                continue
            mesh = scene.assets[obj.asset].mesh
            faces = mesh.faces[front(mesh)]
            faces = faces[mesh.vertices[faces, 2].min(1) > mesh.vertices[faces, 2].max(initial=-np.inf) - 1e-3]
            if len(faces) and (obj.category == "mirror" or _tone(mesh, faces) < _DARK):
                corners = mesh.vertices[faces].reshape(-1, 3).astype(float)
                turn = matrix_from_quaternion(np.array(obj.rotation))
                shine = SHINE[obj.category]
                yield cls(obj.id, shine, np.array(obj.position), turn, corners.min(0), corners.max(0))

    @property
    def normal(self) -> Array:
        return np.asarray(self.turn[:, 2])

    @property
    def plane(self) -> float:
        """Distance of the glass from the world's origin along its normal."""
        return float(self.normal @ self.place + self.low[2])

    def reflects(self, pinhole: Pinhole, view: View) -> NDArray[np.bool_]:
        """Return (H, W) the pixels of a view that show the glass from before it; none if they are too few."""
        shown = np.asarray(view.ids == self.id)
        if shown.sum() < SEEN or self.normal @ pinhole.eye <= self.plane:
            return shown & False
        rows, columns = np.nonzero(shown)
        middle = np.array(view.ids.shape[::-1]) / 2
        rays = np.stack([*((np.stack([columns, rows]) + 0.5 - middle[:, None]) / pinhole.focal), np.ones(len(rows))])
        points = pinhole.eye + (rays * view.depth[shown]).T @ pinhole.axes
        local = (points - self.place) @ self.turn
        shown[shown] = (np.abs(local - (self.low + self.high) / 2) < (self.high - self.low) / 2 + 0.004).all(1)
        return shown

    def image(self, pinhole: Pinhole) -> Pinhole:
        """Return the mirror image of a camera for a picture of half the size. What it sees in a pixel is what
        the camera sees in the mirror there."""
        off = self.normal @ pinhole.eye - self.plane
        axes = pinhole.axes - 2 * np.outer(pinhole.axes @ self.normal, self.normal)
        most = axes @ self.normal / (off + _CLEAR)
        return Pinhole(pinhole.eye - 2 * off * self.normal, axes, pinhole.focal / COARSE, most)

    def before(self, model: Model, instances: Instances, drawn: NDArray[np.int32]) -> NDArray[np.bool_]:
        """Return (K,) which of the (K, 2) instances and clusters may reach before the glass."""
        instance, sphere = drawn[:, 0], model.spheres[drawn[:, 1]].astype(float)
        way = np.einsum("kij,i->kj", instances.turn[instance], self.normal)
        start = instances.place[instance] @ self.normal - self.plane - _CLEAR
        return np.asarray(start + np.einsum("kj,kj->k", way, sphere[:, :3]) + sphere[:, 3] > 0)


def _tone(mesh: Mesh, faces: NDArray[np.int32]) -> float:
    """Return the mean value of the texture on faces, 0 to 255, from 15 places on each."""
    weights = np.array([[i, j, 4 - i - j] for i in range(5) for j in range(5 - i)]) / 4
    u, v = np.moveaxis(weights @ mesh.uv[faces], -1, 0) % 1.0
    high, wide = mesh.texture.shape[:2]
    return float(mesh.texture[((1 - v) * high).astype(int).clip(0, high - 1), (u * wide).astype(int)].mean())


def blend(rgb: NDArray[np.uint8], shown: NDArray[np.bool_], reflection: NDArray[np.uint8], shine: float) -> None:
    """Put the light of a reflection into the pixels (H, W) of a picture that show the glass."""
    at = (np.stack(np.nonzero(shown)) + 0.5) / COARSE - 0.5
    seen = [scipy.ndimage.map_coordinates(_LINEAR[reflection[..., k]], at, float, 1, mode="nearest") for k in range(3)]
    light = shine * np.stack(seen, -1) + (1 - shine) * _LINEAR[rgb[shown]]
    rgb[shown] = np.rint(tones(light ** (1 / 2.2)))
