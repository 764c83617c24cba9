"""The past steps of an episode, with the views that they were decided from."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Final

from humanclaw.plugins.agents import HistoryEntry
from humanclaw.storage.pictures import jpeg

QUALITY: Final = 88
"""JPEG quality of recorded frames."""
RECENT: Final = 10
"""Latest views that stay as they were seen: the paper shows a model at most ten. A view takes 0.8 MB."""


class History:
    """Every step so far. Views of more than RECENT steps ago are read from the record, or held as JPEG without one."""

    def __init__(self) -> None:
        self._entries: list[HistoryEntry] = []
        self._frames: list[Path | None] = []

    @property
    def entries(self) -> tuple[HistoryEntry, ...]:
        return tuple(self._entries)

    def append(self, entry: HistoryEntry, frame: Path | None) -> None:
        """Append a step. frame: the recorded picture of its view, if there is one."""
        self._entries.append(entry)
        self._frames.append(frame)
        if len(self._entries) > RECENT:
            old = self._entries[-RECENT - 1]
            self._entries[-RECENT - 1] = replace(old, view=self._frames[-RECENT - 1] or jpeg(old.rgb, QUALITY))
