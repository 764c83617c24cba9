"""Files of a run's pages that need not be written again: what each was made of, and a digest of what was written.

This stands in the user's cache, not in the run: whoever sends records could send pages of their own with them.
"""

from __future__ import annotations

import hashlib
import json
import os
from dataclasses import astuple
from pathlib import Path
from typing import Final

from humanclaw import RecordedEpisode
from humanclaw.storage import Cache, Folder, source_digest
from humanclaw_report.episode_summary import Facts

CODE: Final = ("humanclaw_report", "humanclaw/body", "humanclaw/cli", "humanclaw/records", "humanclaw/text")
MOST: Final = 1 << 30
"""A larger file is written again, bytes."""


class KeptPages:
    """The files that an earlier report wrote for a run, and those that this one writes or keeps."""

    def __init__(self, run: Path) -> None:
        self._run, self._store = run, Cache("pages", limit=1 << 26)
        self._key = hashlib.sha256(os.fsencode(os.path.realpath(run))).hexdigest()
        self._before: dict[str, list[str]] = json.loads(self._store.get(self._key) or b"{}")
        self._now: dict[str, list[str]] = {}

    def has(self, folder: Folder, name: str, made_of: str) -> bool:
        """Tell whether a file is there as it was written, and was made of the same, which is never empty."""
        key = self._name(folder, name)
        if made_of and self._now.get(key, ("",))[0] == made_of:
            return True
        before, written = self._before.get(key, ("", ""))
        try:
            same = bool(made_of) and made_of == before and folder.digest(name, MOST) == written
        except OSError:
            return False
        if same:
            self._now[key] = [made_of, written]
        return same

    def write(self, folder: Folder, name: str, data: bytes, made_of: str) -> None:
        """Write a file, and remember what it was made of. Raises OSError."""
        # Not settled: to wait for the disk takes long, and a page can be written again.
        folder.write(name, data, settled=False)
        self._now[self._name(folder, name)] = [made_of, hashlib.sha256(data).hexdigest()]

    def save(self) -> None:
        """Keep what was written for the next report."""
        if self._now != self._before:
            self._store.put(self._key, json.dumps(self._now).encode())

    def _name(self, folder: Folder, name: str) -> str:
        return os.path.relpath(folder.path / name, self._run)


def made_of_house(digest: str) -> str:
    """Return what the script of a house is made of."""
    return f"{source_digest(CODE)} {digest}"


def made_of(episode: RecordedEpisode, run: str, facts: Facts) -> str:
    """Return a digest of all that an episode's page shows; empty if its record or house may change unseen.

    run: address of the page of the run.
    """
    records = [episode.record, *(other.record for other in episode.company().values())]
    if not all(record.seal and record.files and record.scene_digest for record in records):
        return ""
    films = [film and film.st_mtime_ns for film in map(episode.files.status, ("film.mp4", "film.gif"))]
    shown = [source_digest(CODE), [record.seal for record in records], films, run, astuple(facts)]
    return hashlib.sha256(json.dumps(shown).encode()).hexdigest()
