"""Writing files so that nobody ever reads half of one, also after a power cut."""

from __future__ import annotations

import os
import threading
from pathlib import Path


def write_atomically(path: Path, data: bytes) -> None:
    """Write a file: a reader sees the old one or the whole new one, also when several processes write it at once.

    It is on disk when this returns. The folder must exist. Raises OSError.
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
    """Sync a folder: a name is on disk when its folder is. Windows has no such call: it opens no folder."""
    if os.name == "nt":
        return
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def within(folder: Path, name: str | Path) -> Path:
    """Return folder/name. Raises ValueError if that leads out of the folder, by its words alone: links are whose the
    folder is."""
    home, path = os.path.abspath(folder), os.path.abspath(folder / name)
    if os.path.commonpath((home, path)) != home:
        raise ValueError(f"{str(name)!r} lies outside of {folder}")
    return Path(path)
