"""A plugin that hears of the end of `humanclaw bench run`."""

from collections.abc import Callable, Sequence
from pathlib import Path

from humanclaw import RecordedEpisode, hookimpl


@hookimpl(optionalhook=True)
def humanclaw_run_end(run: Path, episodes: Sequence[RecordedEpisode], tell: Callable[[str], None]) -> None:
    tell(f"{len(episodes)} records in {run}")
