"""Strict JSON: configuration of pydantic, limits on values, readable faults."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any, Final

from humanclaw.text.words import did_you_mean

if TYPE_CHECKING:
    from pydantic import ValidationError

STRICT: Final = {"extra": "forbid", "ser_json_inf_nan": "strings"}
"""Pydantic configuration of recorded classes: unknown fields are errors, NaN and Infinity are written as words."""
HELD: Final = STRICT | {"revalidate_instances": "always"}
"""The same for instances made by plugins, which may hold anything."""
DEEPEST: Final = 16
"""Maximum nesting of a parameter. No schema asks for more."""
LARGEST: Final = 2**53
"""Largest integer that every reader of JSON keeps exactly."""


def once(pairs: Iterable[tuple[str, Any]]) -> dict[str, Any]:
    """Return an object from its pairs; for object_pairs_hook. Raises KeyError for a key that occurs twice."""
    values: dict[str, Any] = {}
    for key, value in pairs:
        if key in values:
            raise KeyError(key)
        values[key] = value
    return values


def first_fault(error: ValidationError, known: Iterable[str] = ()) -> str:
    """Return the first message of pydantic, after the field that it is about: "spec.seed: Input should be ...".

    known: the fields of the model. Then an unknown field comes first, with the nearest: misspelt, it is missing too.
    """
    faults = error.errors(include_url=False)
    first = next((fault for fault in faults if known and fault["type"] == "extra_forbidden"), faults[0])
    where = ".".join(map(str, first["loc"]))
    what = first["msg"].removeprefix("Value error, ")
    if first["type"] == "extra_forbidden" and (near := did_you_mean(where, known)):
        what = f"there is no such field ({near})"
    return f"{where}: {what}" if where else what
