"""Strict JSON: configuration of pydantic, limits on values, readable faults."""

from __future__ import annotations

import re
import reprlib
from collections.abc import Iterable, Mapping
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
_PARSED: Final = {"int_parsing": "a whole number", "float_parsing": "a number", "bool_parsing": "true or false"}
"""What was to be read from a text, by pydantic's type of the fault."""


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
    what = _plain(first)
    if first["type"] == "extra_forbidden" and (near := did_you_mean(where, known)):
        what = f"there is no such field ({near})"
    return f"{where}: {what}" if where else what


def _plain(fault: Mapping[str, Any]) -> str:
    """Return what was expected and what came; pydantic's own words where they say it."""
    kind, came, context = fault["type"], fault["input"], fault.get("ctx", {})
    if kind in _PARSED:
        return f"expected {_PARSED[kind]}; got {reprlib.repr(came)}"
    if kind == "dataclass_type":
        return f"expected a {context['class_name']}, or an object of its fields; got {reprlib.repr(came)}"
    if kind == "string_pattern_mismatch":
        return _odd(came, context["pattern"]) or str(fault["msg"])
    if kind == "unexpected_keyword_argument":
        return "there is no such field"
    quoted = kind == "json_invalid" and context["error"].startswith(("key must be", "expected value"))
    hint = ". JSON takes names and texts in double quotes, and numbers, true, false and null" if quoted else ""
    return str(fault["msg"]).removeprefix("Value error, ") + hint


def _odd(text: str, pattern: str) -> str:
    """Return the letters without which a text would match a pattern: one, or all that no name has; empty if none."""
    for odd in (*text, re.sub(r"[A-Za-z0-9._-]", "", text)):
        if odd and re.search(pattern, text.translate(dict.fromkeys(map(ord, odd)))):
            letters = dict.fromkeys(odd)
            return f"{' and '.join(map(repr, letters))} {'is' if len(letters) == 1 else 'are'} not allowed in it"
    return "" if text else "it is empty"
