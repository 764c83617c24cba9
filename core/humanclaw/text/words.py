"""Words: text that is safe to store and print, plurals, nearest names."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping
from typing import Final

LONGEST: Final = 100_000
"""Maximum characters of one text or answer."""
_ORDER: Final = (*range(0x202A, 0x202F), *range(0x2066, 0x206A))
_CONTROLS: Final = {code: "\ufffd" for code in (*range(0x20), *range(0x7F, 0xA0), *_ORDER) if chr(code) not in "\t\n\r"}
"""Characters that control a terminal (cursor, title, clipboard) or reverse the order of letters."""
_ESCAPES: Final = {code: f"\\u{code:04x}" for code in (*_CONTROLS, 0x061C, 0x200E, 0x200F)}
"""The same, and the marks of direction: right to keep in a text, hidden on a terminal."""


def legible(text: str) -> str:
    """Make third-party text safe to store and print.

    Half characters and terminal controls become U+FFFD; text beyond LONGEST characters is cut.
    """
    return text[:LONGEST].encode("utf-16", "surrogatepass").decode("utf-16", "replace").translate(_CONTROLS)


def escaped(text: str) -> str:
    """Return a text as a terminal may print it, with its controls as `\\u001b`."""
    return text.translate(_ESCAPES)


def counted(number: int, noun: str) -> str:
    """Return a number with its noun: 1 step, 2 steps."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """Return a question that suggests the nearest known name; empty if none is near."""
    return nearest(name[:64], dict.fromkeys(known, ""), most=1)


def nearest(name: str, brought: Mapping[str, str], most: int = 3) -> str:
    """Return a question that suggests the nearest names; empty if none is near.

    brought: the distribution that brings each name; empty for installed names.
    """
    near = difflib.get_close_matches(name, brought, n=most, cutoff=0.5)
    names = [f"{candidate} (of {brought[candidate]})" if brought[candidate] else candidate for candidate in near]
    return f"Did you mean {' or '.join(names)}?" if names else ""
