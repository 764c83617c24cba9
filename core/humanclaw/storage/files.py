"""Write files atomically: no reader ever sees half of one, even after a power cut."""

from __future__ import annotations

import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO


def write_atomically(path: Path, data: bytes) -> None:
    """Write a file as replacing() does. Raises OSError."""
    with replacing(path) as stream:
        stream.write(data)


@contextmanager
def replacing(path: Path) -> Iterator[BinaryIO]:
    """Open a new file that replaces path when the block ends; if the block raises, path stays as it was.

    Readers see the old or the whole new file, even if several processes write at once. The data are on disk after the
    block. The folder must exist. Raises OSError.
    """
    partial = path.with_name(f"{path.name}.{os.getpid()}-{threading.get_ident()}.partial")
    try:
        with partial.open("wb") as stream:
            yield stream
            stream.flush()
            os.fsync(stream.fileno())
        partial.replace(path)
        _sync_folder(path.parent)
    finally:
        partial.unlink(missing_ok=True)


def _sync_folder(folder: Path) -> None:
    """Flush a folder, so that new names are on disk. Windows cannot open folders, and needs no flush."""
    if os.name == "nt":
        return
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def within(folder: Path, name: str | Path) -> Path:
    """Return folder/name. Raises ValueError if the path, read as text, leads out of the folder. Links are not
    resolved."""
    home, path = os.path.abspath(folder), os.path.abspath(folder / name)
    if os.path.commonpath((home, path)) != home:
        raise ValueError(f"{str(name)!r} lies outside of {folder}")
    return Path(path)
