"""Notes of a skill's author for its model card: known limits, and the paper's results for the same skill."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from pathlib import Path

from humanclaw import PluginError

FILE = "card.toml"
"""File beside schema.json: `limits`, a list of sentences; `[paper]` with `ratio` and `baseline`, mean and deviation."""


@dataclass(frozen=True)
class Notes:
    """Content of a skill's card.toml; empty if there is no such file."""

    limits: tuple[str, ...] = ()
    paper: tuple[float, float] | None = None
    """Mean and standard deviation of achieved over commanded in the paper's table 1, on its data and body."""
    baseline: tuple[float, float] | None = None
    """Mean and standard deviation for the paper's baseline, MoMask, which ignores the magnitude."""

    @classmethod
    def read(cls, folder: Path) -> Notes:
        """Read the card.toml of a skill's folder. Raises PluginError if it is broken."""
        path = folder / FILE
        if not path.is_file():
            return cls()
        try:
            content = tomllib.loads(path.read_text("utf-8"))
            paper = content.get("paper", {})
            return cls(tuple(content.get("limits", ())), _pair(paper.get("ratio")), _pair(paper.get("baseline")))
        except (OSError, ValueError, TypeError) as error:
            raise PluginError(
                f"{path} cannot be read: {error}.", f"See the {FILE} of a shipped skill for the format."
            ) from error


def _pair(values: list[float] | None) -> tuple[float, float] | None:
    if values is None:
        return None
    mean, deviation = values
    return mean, deviation
