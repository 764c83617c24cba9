"""Write files atomically: no reader ever sees half of one, even after a power cut."""

from __future__ import annotations

import os
import threading
from pathlib import Path


def write_atomically(path: Path, data: bytes) -> None:
    """Write a file. Readers see the old or the whole new file, even if several processes write at once.

    The data are on disk when this returns. The folder must exist. Raises OSError.
    """
    partial = path.with_name(f"{path.name}.{os.getpid()}-{threading.get_ident()}.partial")
    try:
        with partial.open("wb") as stream:
            stream.write(data)
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
