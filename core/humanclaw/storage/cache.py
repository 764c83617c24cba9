"""On-disk cache for expensive results: a bounded folder of files, each checked when it is read.

The folder is the user's cache folder, or the one in the environment variable HUMANCLAW_CACHE.
"""

from __future__ import annotations

import contextlib
import hashlib
import importlib.metadata
import os
import re
import time
import warnings
from functools import cache
from importlib import resources
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Final

import platformdirs

from humanclaw.storage.files import Folder

VARIABLE: Final = "HUMANCLAW_CACHE"
LIMIT: Final = 1 << 30
"""Maximum bytes of one cache. Beyond it the least recently used entries go."""
_STARTED: Final = time.time()
_DIGEST: Final = hashlib.sha256().digest_size
_KEY: Final = re.compile(r"[A-Za-z0-9._-]{1,150}")


class Cache:
    """Bytes by key. Any number of processes may read and write: a file appears whole or not at all.

    A cache never fails a run: failed writes are skipped, damaged entries are removed with a warning.
    """

    def __init__(self, name: str, limit: int = LIMIT, root: Path | None = None) -> None:
        base = os.environ.get(VARIABLE) or platformdirs.user_cache_dir("humanclaw", appauthor=False)
        self.folder = (root or Path(base)) / name
        self._files, self._limit = Folder(self.folder), limit

    def get(self, key: str) -> bytes | None:
        """Return the bytes of a key; None if there are none, or they are damaged."""
        name = _checked(key)
        try:
            content = self._files.read(name, max(self._limit, LIMIT))
        except OSError:
            return None
        data = content[_DIGEST:]
        if _digest(key, data) != content[:_DIGEST]:
            self.drop(key, "it is damaged")
            return None
        with contextlib.suppress(OSError):
            self._files.touch(name)  # Entries are removed by time of last use, oldest first.
        return data

    def put(self, key: str, data: bytes) -> None:
        """Store bytes under a key, and remove the least recently used entries beyond the limit."""
        name = _checked(key)
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            self._files.write(name, _digest(key, data) + data)
            self._shrink(name)
        except FileNotFoundError:
            pass  # Another process made room, and took the file before it was whole.
        except OSError as error:
            warnings.warn(f"nothing is cached in {self.folder}: {error.strerror}. Set {VARIABLE}.", stacklevel=2)

    def drop(self, key: str, reason: str) -> None:
        """Remove an unusable entry, with a warning."""
        warnings.warn(f"{self.folder / key} is made anew: {reason}.", stacklevel=3)
        with contextlib.suppress(OSError):
            self._files.remove(_checked(key))

    def _shrink(self, new: str) -> None:
        statuses = self._files.statuses()
        excess = sum(status.st_size for status in statuses.values()) - self._limit
        oldest = iter(sorted(statuses.keys() - {new}, key=lambda name: statuses[name].st_mtime_ns))
        while excess > 0 and (name := next(oldest, None)):
            self._files.remove(name)
            excess -= statuses[name].st_size


def _checked(key: str) -> str:
    if not _KEY.fullmatch(key):
        raise ValueError(f"a cache key must be 1 to 150 letters, digits, dots, dashes and underscores; got {key!r}.")
    return key


def _digest(key: str, data: bytes) -> bytes:
    """Return the digest that an entry begins with. It covers the key: an entry under another key is damaged."""
    state = hashlib.sha256(hashlib.sha256(key.encode()).digest())
    state.update(data)
    return state.digest()


@cache
def source_digest(sources: tuple[str, ...], libraries: tuple[str, ...] = ()) -> str:
    """Return a digest of everything that may change a cached result, for its key.

    Nobody finds again what is kept under the digest of a file that changed since the process began, which may run the
    file as it was.

    Args:
        sources: packages, and files or folders in them, such as "humanclaw/body/pose.py".
        libraries: distributions whose version counts.
    """
    state = hashlib.sha256()
    for package, *inside in (source.split("/") for source in sources):
        for path in _sources(resources.files(package).joinpath(*inside)):
            state.update(path.name.encode() + path.read_bytes())
            if isinstance(path, Path) and path.stat().st_mtime > _STARTED:
                state.update(os.urandom(_DIGEST))
    for name in libraries:
        state.update(f"{name} {importlib.metadata.version(name)}".encode())
    return state.hexdigest()


def _sources(part: Traversable) -> list[Traversable]:
    """Return a file, or those of a package that decide what it does and of the packages in it, in order."""
    if part.is_file():
        return [part] if part.name.endswith((".css", ".html", ".js", ".py", ".toml")) else []
    inside = sorted(part.iterdir(), key=lambda item: item.name)
    return [path for item in inside if item.name != "__pycache__" for path in _sources(item)]
