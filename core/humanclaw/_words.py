"""Words that depend on a number, and names that were meant."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


def counted(number: int, noun: str) -> str:
    """1 step, 2 steps."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """Ask whether the nearest of the known names was meant; empty if none is near."""
    near = difflib.get_close_matches(name[:64], list(known), n=1, cutoff=0.5)
    return f"Did you mean {near[0]}?" if near else ""
