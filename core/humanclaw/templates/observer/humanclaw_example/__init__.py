"""DESCRIPTION"""

from __future__ import annotations

import csv
from pathlib import Path
from typing import TYPE_CHECKING

from humanclaw import hookimpl

if TYPE_CHECKING:
    from humanclaw import EpisodeRecord, StepRecord

__version__ = "0.1.0"

FILE = "example.csv"
"""Written into the folder of each episode: a line a step."""

_rows: dict[str, list[tuple[object, ...]]] = {}


@hookimpl
def humanclaw_step(episode: EpisodeRecord, step: StepRecord) -> None:
    call = str(step.call) if step.call else step.status
    _rows.setdefault(episode.spec.id, []).append((step.step, call, *step.end))


@hookimpl
def humanclaw_episode_end(episode: EpisodeRecord, folder: Path | None) -> None:
    rows = _rows.pop(episode.spec.id, [])
    if folder is not None:
        with (folder / FILE).open("w", newline="", encoding="utf-8") as file:
            csv.writer(file).writerows([("step", "call", "x", "y", "z"), *rows])
