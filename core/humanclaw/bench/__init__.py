"""The benchmark: episodes, runs, metrics, root causes and tables (paper, section 4)."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import pandas as pd


def load(run: str | Path) -> pd.DataFrame:
    """A run as a pandas DataFrame, one row an episode: scores, costs and root cause. Needs pandas."""
    from humanclaw.bench import export

    return export.load(run)
