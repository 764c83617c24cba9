"""Encode pictures as bytes."""

from __future__ import annotations

import base64
import errno
import io
from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from humanclaw.errors import RecordError

PIXELS: Final = 1 << 26
"""Maximum pixels of a picture that is decoded."""


def jpeg(rgb: NDArray[np.uint8], quality: int = 90) -> bytes:
    """Encode a (height, width, 3) uint8 picture as JPEG."""
    buffer = io.BytesIO()
    Image.fromarray(rgb).save(buffer, "JPEG", quality=quality)
    return buffer.getvalue()


def from_jpeg(data: bytes) -> NDArray[np.uint8]:
    """Decode a JPEG as decoded() does."""
    return decoded(data, "JPEG")


def decoded(data: bytes, kind: str) -> NDArray[np.uint8]:
    """Decode a picture to (height, width, 3) uint8, not for writing. kind: as Pillow names it.

    Raises OSError for anything else, and for more than PIXELS.
    """
    try:
        with Image.open(io.BytesIO(data), formats=[kind]) as image:
            if image.width * image.height > PIXELS:
                raise OSError(errno.EFBIG, f"the picture has more than {PIXELS:,} pixels")
            return np.asarray(image.convert("RGB"))
    except (Image.DecompressionBombError, SyntaxError) as error:
        raise OSError(errno.EFBIG, f"the picture cannot be read: {error}") from error


def save_picture(picture: Image.Image, out: Path, quality: int = 80) -> Path:
    """Write a picture as PNG or JPEG, by the name of the file; return its path.

    quality: of a JPEG. Raises RecordError for another name, and if the file cannot be written.
    """
    try:
        picture.save(out, quality=quality)
    except (OSError, ValueError) as error:
        raise RecordError(f"cannot write {out}: {error}.", "Name a PNG or JPEG file with --out.") from error
    return out


def gif(pictures: Sequence[NDArray[np.uint8]], out: Path, fps: float) -> None:
    """Write (height, width, 3) pictures as an animated GIF with one palette; a palette for each would flicker.

    Raises OSError.
    """
    frames = [Image.fromarray(picture) for picture in pictures]
    samples = [np.asarray(frame.resize((96, 72))) for frame in frames[:: max(1, len(frames) // 24)]]
    palette = Image.fromarray(np.concatenate(samples)).quantize(200)
    few = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames]
    # A GIF counts in hundredths of a second: 15 pictures a second take turns of 6 and 7 of them.
    turns = 10 * np.diff(np.round(np.arange(len(few) + 1) * 100 / fps).astype(int))
    few[0].save(out, save_all=True, append_images=few[1:], duration=turns.tolist(), loop=0, optimize=True)


def data_url(data: bytes) -> str:
    """Return a JPEG as a data URL, for web pages and model interfaces."""
    return f"data:image/jpeg;base64,{in_base64(data)}"


def in_base64(data: bytes) -> str:
    """Return bytes as base64 text."""
    return base64.b64encode(data).decode()
