"""What a skill's author knows of it beyond what is measured: limits, and what the paper reports of the same skill."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from pathlib import Path

from humanclaw import PluginError

FILE = "card.toml"
"""Beside schema.json: `limits`, a list of sentences; `[paper]` with `ratio` and `baseline`, each mean and deviation."""


@dataclass(frozen=True)
class Notes:
    """The content of a skill's card.toml; nothing where there is none."""

    limits: tuple[str, ...] = ()
    paper: tuple[float, float] | None = None
    """Mean and deviation of achieved over commanded in the paper's table 1, on its own data and body."""
    baseline: tuple[float, float] | None = None
    """The same of the paper's baseline, MoMask, which ignores the magnitude."""

    @classmethod
    def read(cls, folder: Path) -> Notes:
        """Read the card.toml of a skill's folder. Raises PluginError for one that cannot be read."""
        path = folder / FILE
        if not path.is_file():
            return cls()
        try:
            content = tomllib.loads(path.read_text("utf-8"))
            paper = content.get("paper", {})
            return cls(tuple(content.get("limits", ())), _pair(paper.get("ratio")), _pair(paper.get("baseline")))
        except (OSError, ValueError, TypeError) as error:
            raise PluginError(f"{path} cannot be read: {error}.", f"Write it as {FILE} of a shipped skill.") from error


def _pair(values: list[float] | None) -> tuple[float, float] | None:
    if values is None:
        return None
    mean, deviation = values
    return mean, deviation
