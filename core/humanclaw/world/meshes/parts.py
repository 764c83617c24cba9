"""Parts: triangles of one material, and the pictures on them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from humanclaw.body.pose import Array

MOST: Final = 20_000_000
"""Maximum vertices and triangles of a model, copies included."""
_LARGEST_PICTURE: Final = 8192 * 8192
"""Maximum pixels of a picture."""
_PIXELS: Final = 2048
"""The longest side at which a picture is read: an atlas keeps far less of it, and a larger one takes gigabytes."""


@dataclass(frozen=True, eq=False)
class Part:
    """Triangles of one material. vertices: (N, 3) file units, transforms applied. faces: (M, 3). uv: (N, 2), v up, or
    None."""

    vertices: Array
    faces: NDArray[np.int64]
    uv: Array | None
    colour: tuple[int, int, int]
    """sRGB colour of a part without a texture."""
    picture: NDArray[np.uint8] | None = None
    """(H, W, 3), first row at v = 1."""


def pixels(image: Image.Image, tint: tuple[int, int, int]) -> NDArray[np.uint8]:
    """(H, W, 3); where the picture is see-through, the mean colour of the rest, since nothing here draws holes."""
    if image.width * image.height > _LARGEST_PICTURE:
        raise ValueError(f"its picture has {image.width} x {image.height} pixels, more than {_LARGEST_PICTURE:,}")
    picture = image.convert("RGBA")
    picture.thumbnail((_PIXELS, _PIXELS))
    rgba = np.asarray(picture, float)
    opaque = rgba[..., 3:] / 255
    mean = (rgba[..., :3] * opaque).sum(axis=(0, 1)) / max(float(opaque.sum()), 1e-6)
    filled = rgba[..., :3] * opaque + mean * (1 - opaque)
    return np.asarray(np.clip(np.round(filled * np.array(tint) / 255), 0, 255), np.uint8)


def bounds(parts: Sequence[Part]) -> tuple[Array, Array]:
    """Lowest and highest corner of some parts, file units."""
    used = np.concatenate([part.vertices[np.unique(part.faces)] for part in parts])
    return used.min(axis=0), used.max(axis=0)
