"""On-disk cache for expensive results: a bounded folder of files, each checked when it is read.

The folder is the user's cache folder, or the one in the environment variable HUMANCLAW_CACHE.
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
"""Maximum bytes of one cache. Beyond it the least recently used entries go."""
_DIGEST: Final = hashlib.sha256().digest_size
_KEY: Final = re.compile(r"[A-Za-z0-9._-]{1,150}")


class Cache:
    """Bytes by key. Any number of processes may read and write: a file appears whole or not at all.

    A cache never fails a run: failed writes are skipped, damaged entries are removed with a warning.
    """

    def __init__(self, name: str, limit: int = LIMIT, root: Path | None = None) -> None:
        base = os.environ.get(VARIABLE) or platformdirs.user_cache_dir("humanclaw", appauthor=False)
        self.folder = (root or Path(base)) / name
        self._limit = limit

    def get(self, key: str) -> bytes | None:
        """Return the bytes of a key; None if there are none, or they are damaged."""
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
            os.utime(path)  # Entries are removed by time of last use, oldest first.
        return data

    def put(self, key: str, data: bytes) -> None:
        """Store bytes under a key, and remove the least recently used entries beyond the limit."""
        path = self._path(key)
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            write_atomically(path, hashlib.sha256(data).digest() + data)
            self._shrink(path)
        except OSError as error:
            warnings.warn(f"nothing is cached in {self.folder}: {error.strerror}. Set {VARIABLE}.", stacklevel=2)

    def drop(self, key: str, reason: str) -> None:
        """Remove an unusable entry, with a warning."""
        warnings.warn(f"{self._path(key)} is made anew: {reason}.", stacklevel=3)
        with contextlib.suppress(OSError):
            self._path(key).unlink(missing_ok=True)

    def _path(self, key: str) -> Path:
        if not _KEY.fullmatch(key):
            raise ValueError(
                f"a cache key must be 1 to 150 letters, digits, dots, dashes and underscores; got {key!r}."
            )
        return self.folder / key

    def _shrink(self, new: Path) -> None:
        files = []
        for path in self.folder.iterdir():
            with contextlib.suppress(OSError):  # Another process may have removed the file.
                stat = path.stat()
                files.append((path == new, stat.st_mtime_ns, stat.st_size, path))
        excess = sum(size for _, _, size, _ in files) - self._limit
        for _, _, size, path in sorted(files):
            if excess <= 0 or path == new:
                return
            path.unlink(missing_ok=True)
            excess -= size
