"""What JSON may hold, and what is wrong with a text that should."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from pydantic import ValidationError

STRICT: Final = {"extra": "forbid", "ser_json_inf_nan": "strings"}
"""For pydantic, which reads these classes from records: an unknown field is an error, and what is no number is written
as a word that can be read back."""
HELD: Final = STRICT | {"revalidate_instances": "always"}
"""The same for what plugins make: an instance may hold anything."""
DEEPEST: Final = 16
"""Levels of nesting in a parameter; what lies deeper no schema asks for."""
LARGEST: Final = 2**53
"""Of an integer: what every reader of JSON keeps exactly."""


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


def first_fault(error: ValidationError) -> str:
    """Return the first message of pydantic, after the field that it is about: "spec.seed: Input should be ..."."""
    first = error.errors(include_url=False)[0]
    where = ".".join(map(str, first["loc"]))
    return f"{where}: {first['msg']}" if where else first["msg"]
