"""The past steps of an episode, with the views that they were decided from."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from humanclaw.plugins.agents import HistoryEntry
from humanclaw.storage.pictures import from_jpeg, jpeg

RECENT: Final = 16
"""Latest views that stay as they were seen; the paper shows a model at most ten. A view is 0.8 MB, as JPEG 0.03 MB."""


class History:
    """Every step so far. Views of more than RECENT steps ago are held as JPEG, with the quality of recorded frames."""

    def __init__(self, quality: int) -> None:
        self._quality = quality
        self._entries: list[HistoryEntry] = []

    @property
    def entries(self) -> tuple[HistoryEntry, ...]:
        return tuple(self._entries)

    def append(self, entry: HistoryEntry) -> None:
        self._entries.append(entry)
        if len(self._entries) > RECENT:
            self._entries[-RECENT - 1] = _Compressed(self._entries[-RECENT - 1], self._quality)


class _Compressed(HistoryEntry):
    """An entry whose view is decoded each time that somebody asks for it."""

    _picture: bytes

    def __init__(self, entry: HistoryEntry, quality: int) -> None:
        known = {"step": entry.step, "decision": entry.decision, "feedback": entry.feedback}
        for name, value in {**known, "_picture": jpeg(entry.rgb, quality)}.items():
            object.__setattr__(self, name, value)  # The dataclass is frozen.

    @property
    def rgb(self) -> NDArray[np.uint8]:
        return from_jpeg(self._picture)
