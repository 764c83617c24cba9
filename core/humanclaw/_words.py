"""Words that depend on a number, and names that were meant."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping


def counted(number: int, noun: str) -> str:
    """1 step, 2 steps."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """Ask whether the nearest of the known names was meant; empty if none is near."""
    return nearest(name[:64], dict.fromkeys(known, ""), most=1)


def nearest(name: str, brought: Mapping[str, str], most: int = 3) -> str:
    """Ask whether one of the nearest names was meant; empty if none is near.

    brought: every name that could be meant, to the distribution that brings it; empty for what is there.
    """
    near = difflib.get_close_matches(name, brought, n=most, cutoff=0.5)
    told = [f"{one} (of {brought[one]})" if brought[one] else one for one in near]
    return f"Did you mean {' or '.join(told)}?" if told else ""
