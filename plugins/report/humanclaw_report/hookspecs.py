"""What a plugin can add to the page of a run. It implements these hooks with @hookimpl(optionalhook=True),
and then also works where the report is not installed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

import pluggy

if TYPE_CHECKING:
    from humanclaw import RecordedEpisode

hookspec = pluggy.HookspecMarker("humanclaw")


class Overview(Protocol):
    """The page of one or more runs, before it is written."""

    def table(
        self,
        title: str,
        head: Sequence[str],
        rows: Sequence[Sequence[str]],
        *,
        notes: Sequence[str] = (),
        shares: Sequence[Sequence[float]] = (),
    ) -> None:
        """Add a table.

        Args:
            title: Over the table.
            head: A word a column.
            rows: Cells as text, the first of each the row's heading.
            notes: Sentences under the table.
            shares: For each row the shares, 0 to 1, drawn as bars under the cells after the first; NaN draws none.
        """

    def episode(self, run: Path, name: str, *, success: bool | None, cause: str = "", tier: str = "") -> None:
        """Tell of an episode whether it succeeded (None: it counts in no rate), why it failed, and how hard it is."""


@hookspec
def humanclaw_overview(runs: Mapping[Path, Sequence[RecordedEpisode]], page: Overview) -> None:
    """Add tables and facts to the page of runs."""
