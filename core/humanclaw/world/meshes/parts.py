"""Parts: triangles of one material, and the pictures on them."""

from __future__ import annotations

import re
from codecs import BOM_UTF16_BE, BOM_UTF16_LE
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from io import BytesIO, StringIO
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from humanclaw.body.pose import Array
from humanclaw.errors import SceneError

MOST: Final = 20_000_000
"""Maximum vertices and triangles of a model, copies included."""
PLAIN: Final = (102, 102, 102)
"""sRGB colour of what has none."""
CLEAR: Final = "see-through pieces (drawn solid)"
SHINING: Final = "pieces that shine (drawn without their light)"
CLAMPED: Final = "pictures that end at their edges (drawn repeated)"
"""What a part cannot say of a material."""
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


def goes_beyond(uv: Array) -> bool:
    """Tell whether (N, 2) uv lie outside of their picture, by more than a rounding."""
    return bool((np.abs(uv - 0.5) > 0.51).any())


def picture_of(name: str, beside: Callable[[str], bytes], lost: Counter[str]) -> NDArray[np.uint8] | None:
    """Return the pixels of a picture's file; None, and a count in lost, for one that cannot be read."""
    try:
        return pixels(Image.open(BytesIO(beside(name))), (255, 255, 255))
    except Exception:  # Decoders fail on broken pictures in every way there is.
        lost[f"files that cannot be read ({name})"] += 1
        return None


def mean_of(colours: Array, most: float, lost: Counter[str]) -> Array:
    """Return the (3,) mean of (N, 3) colours; where they differ, count it in lost. most: of a number."""
    if len(colours) and np.ptp(colours, axis=0).max() > most / 255:
        lost["vertex colours (drawn as their mean)"] += 1
    return np.asarray(colours.mean(axis=0), float)


def mean_colour(values: NDArray[Any], lost: Counter[str]) -> tuple[int, int, int]:
    """Return the mean of (N, 3) colours, which go up to 1 if they have a point and none is larger."""
    most = 255 if values.dtype.kind != "f" or values.max(initial=0) > 1 else 1
    mean = np.clip(mean_of(values.astype(float), most, lost) * 255 / most, 0, 255)
    red, green, blue = mean.round().astype(int).tolist()
    return red, green, blue


def text_of(data: bytes) -> str:
    """Return a model in text, its lines ended by \\n alone. Raises SceneError for decimal commas.

    What is neither UTF-8 nor UTF-16 is read as Latin-1, in which the names of any other code stay apart.
    """
    try:
        text = data.decode("utf-16" if data[:2] in (BOM_UTF16_LE, BOM_UTF16_BE) else "utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("latin-1")
    text = text.replace("\r\n", "\n").replace("\r", "\n")
    if "," in text and re.search(r"(?m)^\s*v(?:ertex)?\s[^\n]*\d,\d", text):
        raise SceneError("its numbers have decimal commas.", "Export it with decimal points.")
    return text


def numbers(lines: str, first: int, least: int, most: int, fill: float) -> Array:
    """Return the (N, most) numbers of N lines from their word first on, fill for those that a line does not have.

    Raises SceneError, which quotes the line, for one of fewer than least, or of something else.
    """
    if not lines:
        return np.zeros((0, most))
    width = min(len(lines.partition("\n")[0].partition("#")[0].split()) - first, most)
    try:
        if not least <= width:
            raise ValueError
        table = np.loadtxt(StringIO(lines), usecols=range(first, first + width), ndmin=2)
        return np.pad(table, ((0, 0), (0, most - width)), constant_values=fill)
    except ValueError:  # They are not all alike.
        rows = [_row(line, first, least, most) for line in lines.removesuffix("\n").split("\n")]
        return np.array([row + [fill] * (most - len(row)) for row in rows])


def _row(line: str, first: int, least: int, most: int) -> list[float]:
    try:
        row = [float(word) for word in line.partition("#")[0].split()[first : first + most]]
    except ValueError:
        row = []
    if len(row) < least:
        raise wrong_line(line, f"{least} number{'s' * (least > 1)}")
    return row


def wrong_line(line: str, wanted: str) -> SceneError:
    """Return what to raise for a line of a model in text that must hold something else."""
    return SceneError(f"its line {line[:60]!r} must hold {wanted}.", "Correct it, or export the file again.")


def bounds(parts: Sequence[Part]) -> tuple[Array, Array]:
    """Lowest and highest corner of some parts, file units."""
    used = np.concatenate([part.vertices[np.unique(part.faces)] for part in parts])
    return used.min(axis=0), used.max(axis=0)
