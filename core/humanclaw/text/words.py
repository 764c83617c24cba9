"""Words that depend on a number, names that were meant, and texts that can be kept and shown."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping
from typing import Final

LONGEST: Final = 100_000
"""Letters of one text, or of an answer."""
_ORDER: Final = (*range(0x202A, 0x202F), *range(0x2066, 0x206A))
_CONTROLS: Final = {code: "\ufffd" for code in (*range(0x20), *range(0x7F, 0xA0), *_ORDER) if chr(code) not in "\t\n\r"}
"""What would move the cursor of a terminal, name its window, write to its clipboard, or turn the order of letters."""


def legible(text: str) -> str:
    """Bring a text of somebody else into what a file can hold and a terminal can show: half characters and those that
    control a terminal become U+FFFD, and what is longer than LONGEST is cut."""
    return text[:LONGEST].encode("utf-16", "surrogatepass").decode("utf-16", "replace").translate(_CONTROLS)


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
