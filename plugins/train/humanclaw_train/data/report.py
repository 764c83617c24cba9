"""Report of a build of training data: what became of every clip, and why."""

from __future__ import annotations

import csv
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Final, Literal

from humanclaw.body import CHUNK, FPS
from humanclaw_train.data.curate import Use
from humanclaw_train.markdown import table
from humanclaw_train.mocap.clips import Clip

FILE: Final = "report.csv"
"""In the folder of the chunks."""


@dataclass(frozen=True)
class Row:
    """One clip or file. chunks: windows of the clip in the base, before standing still is thinned out."""

    name: str
    source: str
    outcome: Literal["trained on", "held out", "left out"]
    reason: str = ""
    seconds: float = 0.0
    windows: int = 0
    chunks: int = 0

    @classmethod
    def of(cls, use: Use, outcome: Literal["trained on", "held out"]) -> Row:
        """Describe the use of a clip. A clip without a plausible window is left out, for the commonest reason."""
        clip, chunks = use.clip, use.chunks.get("base", 0)
        size = (_seconds(clip), use.windows, chunks)
        if use.chunks:
            return cls(clip.name, clip.source, outcome, "", *size)
        reason = max(use.flawed, key=use.flawed.__getitem__) if any(use.flawed.values()) else "no label"
        reason = reason if use.windows else f"shorter than {CHUNK / FPS:.2f} s"
        return cls(clip.name, clip.source, "left out", reason, *size)

    @classmethod
    def unwanted(cls, clip: Clip) -> Row:
        """Describe a clip of a source that the caller leaves out."""
        return cls(clip.name, clip.source, "left out", f"--without {clip.source}", _seconds(clip))


@dataclass(frozen=True)
class Report:
    """Rows of clips and files, and the number of windows with each flaw. note: why there is no synthetic motion."""

    rows: tuple[Row, ...]
    flawed: Mapping[str, int]
    note: str = ""

    @classmethod
    def of(cls, rows: Iterable[Row], uses: Sequence[Use], idle: int, note: str) -> Report:
        """Put the rows together. idle: chunks of standing still that the base leaves out."""
        flawed = sum((Counter(use.flawed) for use in uses), Counter[str]())
        return cls(tuple(rows), {**flawed, "standing still, more than a quarter of the base": idle}, note)

    def save(self, folder: Path) -> None:
        """Write one line for each clip and file."""
        with (folder / FILE).open("w", newline="", encoding="utf-8") as file:
            lines = csv.writer(file)
            lines.writerow(field.name for field in fields(Row))
            lines.writerows(tuple(vars(row).values()) for row in self.rows)

    def __str__(self) -> str:
        return "\n\n".join(part for part in (self._clips(), self._windows(), self.note) if part)

    def _clips(self) -> str:
        groups: dict[tuple[str, str], list[Row]] = {}
        for row in self.rows:
            groups.setdefault((row.outcome, row.reason), []).append(row)
        heads = ("clips", "why", "number", "seconds", "windows", "chunks", "for example")
        rows = []
        for (outcome, reason), members in groups.items():
            seconds = f"{sum(row.seconds for row in members):.1f}"
            counts = (sum(row.windows for row in members), sum(row.chunks for row in members))
            rows.append([outcome, reason, *map(str, (len(members), seconds, *counts)), members[0].name])
        return table(heads, rows)

    def _windows(self) -> str:
        rows = [(flaw, str(count)) for flaw, count in self.flawed.items() if count]
        return table(("windows left out", "number"), rows) if rows else ""


def _seconds(clip: Clip) -> float:
    return round(len(clip.motion) / FPS, 2)
