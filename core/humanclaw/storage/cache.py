"""What is dear to compute and can be computed again: a bounded folder of files, each checked when it is read.

The folder is the user's cache folder, or the one that the environment variable HUMANCLAW_CACHE names.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import re
import warnings
from pathlib import Path
from typing import Final

import platformdirs

from humanclaw.storage.files import write_atomically

VARIABLE: Final = "HUMANCLAW_CACHE"
LIMIT: Final = 1 << 30
"""Bytes that one cache may hold; beyond it, what was not asked for longest goes."""
_DIGEST: Final = hashlib.sha256().digest_size
_KEY: Final = re.compile(r"[A-Za-z0-9._-]{1,150}")


class Cache:
    """Bytes by key. Any number of processes may read and write: a file appears whole or not at all.

    A cache never fails a run: what cannot be written is not kept, what is damaged is named in a warning and removed.
    """

    def __init__(self, name: str, limit: int = LIMIT, root: Path | None = None) -> None:
        base = os.environ.get(VARIABLE) or platformdirs.user_cache_dir("humanclaw", appauthor=False)
        self.folder = (root or Path(base)) / name
        self._limit = limit

    def get(self, key: str) -> bytes | None:
        """Return what was put under a key; None if there is nothing, or nothing whole."""
        path = self._path(key)
        try:
            content = path.read_bytes()
        except OSError:
            return None
        data = content[_DIGEST:]
        if hashlib.sha256(data).digest() != content[:_DIGEST]:
            self.drop(key, "it is damaged")
            return None
        with contextlib.suppress(OSError):
            os.utime(path)  # Its time is when it was last asked for.
        return data

    def put(self, key: str, data: bytes) -> None:
        """Keep bytes under a key, and let the oldest others go if there are too many."""
        path = self._path(key)
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            write_atomically(path, hashlib.sha256(data).digest() + data)
            self._shrink(path)
        except OSError as error:
            warnings.warn(f"nothing is cached in {self.folder}: {error.strerror}. Set {VARIABLE}.", stacklevel=2)

    def drop(self, key: str, reason: str) -> None:
        """Remove an entry that cannot be used, and say so."""
        warnings.warn(f"{self._path(key)} is made anew: {reason}.", stacklevel=3)
        with contextlib.suppress(OSError):
            self._path(key).unlink(missing_ok=True)

    def _path(self, key: str) -> Path:
        if not _KEY.fullmatch(key):
            raise ValueError(f"a cache key is 1 to 150 letters, digits, dots and dashes; got {key!r}.")
        return self.folder / key

    def _shrink(self, new: Path) -> None:
        files = []
        for path in self.folder.iterdir():
            with contextlib.suppress(OSError):  # Another process may have removed it.
                stat = path.stat()
                files.append((path == new, stat.st_mtime_ns, stat.st_size, path))
        excess = sum(size for _, _, size, _ in files) - self._limit
        for _, _, size, path in sorted(files):
            if excess <= 0 or path == new:
                return
            path.unlink(missing_ok=True)
            excess -= size
