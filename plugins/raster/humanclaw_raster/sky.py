"""The view from windows: a panorama of sky, hills, trees and grass."""

from __future__ import annotations

from functools import cache
from importlib import resources

import numpy as np
from numpy.typing import NDArray
from PIL import Image

TOP, BOTTOM = 0.6, -1.0
"""Elevation of its first and its last row, radians."""


@cache
def panorama() -> NDArray[np.uint8]:
    """Return (H, W, 3) all around, the same for every scene."""
    with resources.files("humanclaw_raster").joinpath("sky.webp").open("rb") as file:
        return np.asarray(Image.open(file).convert("RGB"))
