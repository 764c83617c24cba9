"""Hooks with which a plugin adds to the page of a run.

Implement them with @hookimpl(optionalhook=True), so that the plugin also works where the report is not installed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

import pluggy

if TYPE_CHECKING:
    from humanclaw import RecordedEpisode
    from humanclaw.plugins import Installed

hookspec = pluggy.HookspecMarker("humanclaw")


class Overview(Protocol):
    """The page of one or more runs, to be filled before it is written."""

    def table(
        self,
        title: str,
        head: Sequence[str],
        rows: Sequence[Sequence[str]],
        *,
        notes: Sequence[str] = (),
        shares: Sequence[Sequence[float]] = (),
        turned: bool = False,
    ) -> None:
        """Add a table. The first one stands open; those with shares are charts above it; the rest is folded.

        Args:
            title: Heading over the table.
            head: Heading of each column.
            rows: Cells as text; the first cell of a row is its heading.
            notes: Sentences under the table.
            shares: For each row, shares from 0 to 1 that are drawn as bars beside the cells after the first. NaN draws
                no bar.
            turned: Draw the columns of a chart as its rows.
        """

    def episode(
        self, run: Path, name: str, *, success: bool | None, cause: str = "", tier: str = "", step: int | None = None
    ) -> None:
        """Add facts about an episode.

        Args:
            run: Folder of the run.
            name: Identifier of the episode.
            success: Whether it succeeded; None if it counts in no rate.
            cause: Why it failed.
            tier: How difficult it is: easy, medium or hard.
            step: Step at which the cause was decided.
        """


@hookspec
def humanclaw_overview(runs: Mapping[Path, Sequence[RecordedEpisode]], page: Overview, plugins: Installed) -> None:
    """Add tables and facts to the page of these runs; called before the page is written."""
