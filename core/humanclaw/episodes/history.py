"""The past steps of an episode, with the views that they were decided from."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from humanclaw.plugins.agents import HistoryEntry
from humanclaw.records.folder import read_file
from humanclaw.storage.pictures import from_jpeg, jpeg

RECENT: Final = 16
"""Latest views that stay as they were seen; the paper shows a model at most ten. A view takes 0.8 MB."""


class History:
    """Every step so far. Views of more than RECENT steps ago are read from the record, or held as JPEG without one."""

    def __init__(self, quality: int) -> None:
        self._quality = quality
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
            self._entries[-RECENT - 1] = _Recalled(old, self._frames[-RECENT - 1] or jpeg(old.rgb, self._quality))


class _Recalled(HistoryEntry):
    """An entry whose view is decoded each time that somebody asks for it."""

    _picture: bytes | Path

    def __init__(self, entry: HistoryEntry, picture: bytes | Path) -> None:
        known = {"step": entry.step, "decision": entry.decision, "feedback": entry.feedback}
        for name, value in {**known, "_picture": picture}.items():
            object.__setattr__(self, name, value)  # The dataclass is frozen.

    @property
    def rgb(self) -> NDArray[np.uint8]:
        return from_jpeg(self._picture if isinstance(self._picture, bytes) else read_file(self._picture))
