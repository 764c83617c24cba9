"""Objects of JSON as their authors wrote them."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any


def once(pairs: Iterable[tuple[str, Any]]) -> dict[str, Any]:
    """Take an object's pairs, for json's object_pairs_hook.

    Raises KeyError for a key that is there twice: of two values one would be lost.
    """
    values: dict[str, Any] = {}
    for key, value in pairs:
        if key in values:
            raise KeyError(key)
        values[key] = value
    return values
