"""The view from windows: a panorama of sky, hills, trees and grass."""

from __future__ import annotations

from functools import cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

from humanclaw.body import Array
from humanclaw.storage import Cache, source_digest

TOP, BOTTOM = 0.6, -1.0
"""Elevation of its first and its last row, radians."""
_WIDTH, _HEIGHT = 2048, 384
_TREES: Final = 130
"""Trees all around."""


@cache
def panorama() -> NDArray[np.uint8]:
    """Return (H, W, 3) all around, the same for every scene. It is painted once on a machine."""
    store, key = Cache("light"), source_digest(("humanclaw_raster/sky.py",))
    if (data := store.get(key)) is None:
        data = _painted().tobytes()
        store.put(key, data)
    return np.frombuffer(data, np.uint8).reshape(_HEIGHT, _WIDTH, 3)


def _painted() -> NDArray[np.uint8]:
    rng, slope = np.random.default_rng(0), np.tan(np.linspace(TOP, BOTTOM, _HEIGHT))[:, None]
    row, column = np.arange(_HEIGHT)[:, None], np.arange(_WIDTH)
    clouds = _wave(rng, 40)[(column + 5 * row) % _WIDTH] + _wave(rng, 40)[(column - 6 * row) % _WIDTH]
    blue = np.clip(1.5 * slope, 0, 1)[..., None]
    picture = (1 - blue) * [218.0, 232, 243] + blue * [112.0, 168, 228]
    picture = picture + (252 - picture) * 0.7 * np.clip(0.8 * clouds - 0.2, 0, 1)[..., None]
    grain = 1 + 0.1 * np.kron(rng.standard_normal((_HEIGHT // 2, _WIDTH // 2)), np.ones((2, 2)))[..., None]
    for crest, colour in ((0.06 + 0.02 * _wave(rng, 20), (142, 168, 176)), (_crowns(rng), (92, 124, 78))):
        picture = np.where((slope < crest)[..., None], np.array(colour) * grain, picture)
    lawn = np.clip(0.8 - slope, 0.8, 1.1)[..., None] * [138.0, 168, 96]
    picture = np.where((slope < -0.02)[..., None], lawn * (1 + 0.4 * (grain - 1)), picture)
    return np.clip(picture, 0, 255).astype(np.uint8)


def _wave(rng: np.random.Generator, count: int) -> Array:
    """Return (W,) smooth noise, about -1 to 1, that goes on from its last to its first value."""
    angle = np.linspace(0, 2 * np.pi, _WIDTH)[:, None] * np.arange(1, count)
    parts = np.sin(angle + rng.uniform(0, 2 * np.pi, count - 1)) / np.sqrt(np.arange(1, count))
    return np.asarray(parts.sum(axis=1) / np.sqrt(np.log(count)))


def _crowns(rng: np.random.Generator) -> Array:
    """Return (W,) the slope at which trees end."""
    column, high = np.arange(_WIDTH), np.full(_WIDTH, 0.015)
    for middle, radius in zip(rng.integers(0, _WIDTH, _TREES), rng.uniform(8, 26, _TREES), strict=True):
        away = np.minimum(np.abs(column - middle), _WIDTH - np.abs(column - middle)) / radius
        high = np.maximum(high, radius / 300 * (0.35 + np.sqrt(np.clip(1 - away**2, 0, 1))) * (away < 1))
    return high + 0.004 * np.repeat(rng.standard_normal(_WIDTH // 4), 4)
