"""Names of houses: the text that may follow the colon in `house:3`."""

from __future__ import annotations

import re
from typing import Final

from humanclaw import SceneError

VALIDATION_HOUSES: Final = 41
GENERATOR: Final = 4
"""Version of the generator. Raise it when a number no longer gives the same house; make the splits again then."""
_REMEDY: Final = "Use house:0 to house:40, or house:train-N with N from 0 for a training house."


def seed_of(argument: str) -> tuple[int, int]:
    """Return the seed of house '0' to '40' or 'train-N'. Raises SceneError if there is no such house."""
    match = re.fullmatch(r"(train-)?(0|[1-9][0-9]{0,8})", argument)
    if not match or (not match[1] and int(match[2]) >= VALIDATION_HOUSES):
        raise SceneError(f"there is no house {argument!r}.", _REMEDY)
    return 1 if match[1] else 0, int(match[2])
