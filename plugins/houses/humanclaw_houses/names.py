"""Which houses there are: what may follow the colon in `house:3`."""

from __future__ import annotations

import re
from typing import Final

from humanclaw import SceneError

VALIDATION_HOUSES: Final = 41
GENERATOR: Final = 3
"""Raised when the houses of a number are no longer those they were; splits of an earlier one want making anew."""
_REMEDY: Final = "Ask for house:0 to house:40, or house:train-N for a training house with N from 0 on."


def seed_of(argument: str) -> tuple[int, int]:
    """Return the seed of the house that '0' to '40' or 'train-N' names. Raises SceneError if there is no such house."""
    match = re.fullmatch(r"(train-)?(0|[1-9][0-9]{0,8})", argument)
    if not match or (not match[1] and int(match[2]) >= VALIDATION_HOUSES):
        raise SceneError(f"there is no house {argument!r}.", _REMEDY)
    return 1 if match[1] else 0, int(match[2])
