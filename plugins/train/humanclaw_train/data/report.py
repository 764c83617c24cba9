"""Report of a build of training data: what became of every clip, and why."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Final, Literal

from humanclaw.body import CHUNK, FPS
from humanclaw_train.markdown import table
from humanclaw_train.mocap.clips import Clip

FILE: Final = "report.csv"
"""In the folder of the chunks."""


@dataclass(frozen=True)
class Use:
    """What became of one clip or file. chunks: its windows in the base, before standing still is thinned out."""

    name: str
    source: str
    outcome: Literal["trained on", "held out", "left out"]
    reason: str = ""
    seconds: float = 0.0
    windows: int = 0
    chunks: int = 0

    @classmethod
    def of(cls, clip: Clip, windows: int, chunks: Mapping[str, int], flawed: Mapping[str, int]) -> Use:
        """Describe the use of a clip: its windows, chunks of each skill, and the windows with each flaw.

        A clip without a plausible window is left out, for the commonest reason.
        """
        size = (seconds(clip), windows, chunks.get("base", 0))
        if chunks:
            return cls(clip.name, clip.source, "trained on", "", *size)
        reason = max(flawed, key=flawed.__getitem__) if any(flawed.values()) else "no label"
        reason = reason if windows else f"shorter than {CHUNK / FPS:.2f} s"
        return cls(clip.name, clip.source, "left out", reason, *size)


def save(uses: Sequence[Use], folder: Path) -> None:
    """Write one line for each clip and file."""
    with (folder / FILE).open("w", newline="", encoding="utf-8") as file:
        lines = csv.writer(file)
        lines.writerow(field.name for field in fields(Use))
        lines.writerows(tuple(vars(use).values()) for use in uses)


def summary(uses: Sequence[Use]) -> str:
    """Return a Markdown table of outcomes and reasons."""
    groups: dict[tuple[str, str], list[Use]] = {}
    for use in uses:
        groups.setdefault((use.outcome, use.reason), []).append(use)
    heads = ("clips", "why", "number", "seconds", "windows", "chunks", "for example")
    rows = []
    for (outcome, reason), members in groups.items():
        total = f"{sum(use.seconds for use in members):.1f}"
        counts = (sum(use.windows for use in members), sum(use.chunks for use in members))
        rows.append([outcome, reason, *map(str, (len(members), total, *counts)), members[0].name])
    return table(heads, rows)


def seconds(clip: Clip) -> float:
    """Return the duration of a clip."""
    return round(len(clip.motion) / FPS, 2)
