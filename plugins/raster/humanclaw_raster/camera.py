"""What a real camera adds to a picture: a mild lens, and the noise of its sensor."""

from __future__ import annotations

import zlib
from typing import Final

import numpy as np
import scipy  # Its parts load when they are used: ndimage takes a fifth of a second.
from numpy.typing import NDArray

from humanclaw import Renderer, Scene
from humanclaw.world import Camera, View, WorldState

BARREL: Final = 0.04
"""Radial distortion: r of the bent picture shows r * (1 + BARREL * r**2) of the straight one, with 1 at its sides."""
CORNER: Final = 0.3
"""Share of the light that a corner loses."""
SHOT: Final = 0.15
"""Variance of the noise for each step of a channel's value."""
READ: Final = 2.0
"""Deviation of the noise in the dark, steps of 255."""


class CameraRenderer:
    """Draws by another renderer, then bends the view as a lens does or adds noise, or both.

    A lens bends depth and ids like colours, so a pinhole no longer describes them. The noise follows from the picture
    itself: the same state and camera give the same bytes.
    """

    def __init__(self, renderer: Renderer, *, lens: bool, noise: bool) -> None:
        self._renderer, self._lens, self._noise = renderer, lens, noise

    def load(self, scene: Scene) -> None:
        """Make a scene ready to be drawn; it replaces the previous one."""
        self._renderer.load(scene)

    def render(self, state: WorldState, camera: Camera) -> View:
        """Draw one moment. Raises HumanclawError if no scene is loaded."""
        view = self._renderer.render(state, camera)
        view = bent(view) if self._lens else view
        return View(noisy(view.rgb), view.depth, view.ids) if self._noise else view

    def close(self) -> None:
        """Free the scene; a closed renderer can load again."""
        self._renderer.close()


def bent(view: View) -> View:
    """Return a view through a lens: straight lines at the sides bulge, and corners are darker."""
    height, width = view.ids.shape
    middle = np.array([height - 1, width - 1]) / 2
    off = (np.moveaxis(np.indices((height, width)), 0, -1) - middle) / np.maximum(middle, 0.5)
    square = np.square(off).sum(-1)
    at = np.moveaxis(middle + off * (middle * ((1 + BARREL * square) / (1 + 2 * BARREL))[..., None]), -1, 0)
    light = 1 - CORNER * np.square(square / 2)
    rgb = np.stack([light * scipy.ndimage.map_coordinates(view.rgb[..., k], at, float, 1) for k in range(3)], -1)
    near = tuple(np.rint(at).astype(int))
    return View(np.rint(rgb).astype(np.uint8), view.depth[near], view.ids[near])


def noisy(rgb: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return a picture with the noise of light and of a sensor."""
    rng, light = np.random.default_rng(zlib.crc32(rgb.tobytes())), rgb.astype(np.float32)
    noise = rng.standard_normal(rgb.shape, np.float32) * np.sqrt(SHOT * light + READ**2)
    return np.asarray(np.clip(np.rint(light + noise), 0, 255), np.uint8)
