"""API keys: find them in options, and remove them from every text that is recorded or shown."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Iterator, Mapping
from typing import Any, Final
from urllib.parse import urlsplit

_SECRET_VARIABLE: Final = re.compile(r"KEY|TOKEN|SECRET|PASSWORD|CREDENTIAL", re.IGNORECASE)
_JOINT: Final = r"""(?:['"]\s*\+?\s*['"]|\\\n)"""
"""What stands between two pieces of a string in code that joins them."""
_BETWEEN: Final = r"\W{0,8}"
"""What may stand between two letters of a known key: quotes that code joins, a line break, an invisible character."""
_SECRET_FORM: Final = re.compile(
    rf"\b(?:sk|pk|gsk|xai|hf)[-_](?:[\w*.-]|{_JOINT}(?=\w)){{6,}}|\bAIza[\w-]{{20,}}|(?<=Bearer )\S+"
)
_SECRET_FIELD: Final = re.compile(
    r"key|pass(word|wd|phrase)|secret|credential|auth|bearer|cookie|headers?$|(^|_)(id_|access_|refresh_|session_)?token$",
    re.IGNORECASE,
)
"""Names of fields that hold keys. Counts and prices of tokens, such as max_tokens, do not match or are exempt."""
_NO_SECRET: Final = frozenset({"input_cost_per_token", "output_cost_per_token", "prompt_cache_key"})
_ESCAPE: Final = re.compile(r"\\(?:u([0-9a-fA-F]{4})|(/)|.)", re.DOTALL)
_RANDOM: Final = re.compile(r"(?=[^/]*[a-z])(?=[^/]*[A-Z])(?=[^/]*\d)[\w.~+=-]{20,}")
"""A part of a path that looks random: 20 characters or more, with capitals, small letters and digits."""
_PARTS: Final = re.compile(r"[^\w.~+=-]+")
"""Separators between the parts of a path."""


def redact(text: str, *secrets: str) -> str:
    """Remove these secrets, the values of secret environment variables, and strings that look like keys.

    A text with a key in JSON's escapes is returned with its plain characters unescaped.
    """
    plain = _ESCAPE.sub(_unescaped, text) if "\\" in text else text
    safe = _without(plain, secrets)
    return _without(text, secrets) if safe == plain else safe


def _unescaped(match: re.Match[str]) -> str:
    """Return the character of an escape; the escape itself for one that JSON needs, and for half a character."""
    letter = chr(int(match[1], 16)) if match[1] else match[2] or ""
    return letter if letter.isprintable() and letter not in ('"', "\\", "") else match[0]


def _without(text: str, secrets: Iterable[str]) -> str:
    for value in sorted((value for value in (*_kept(), *secrets) if len(value) >= 8), key=len, reverse=True):
        text = re.sub(_BETWEEN.join(map(re.escape, value)), "[redacted]", text)
    return _SECRET_FORM.sub("[redacted]", text)


def secrets_in(value: Any, where: str = "") -> Iterator[str]:
    """Yield the places in nested options that hold a key, judged by field name or by value."""
    if isinstance(value, Mapping):
        for key, inner in value.items():
            place = f"{where}.{key}" if where else str(key)
            if _SECRET_FIELD.search(str(key)) and str(key) not in _NO_SECRET:
                yield place
            else:
                yield from secrets_in(inner, place)
    elif isinstance(value, list | tuple):
        for number, inner in enumerate(value):
            yield from secrets_in(inner, f"{where}.{number}")
    elif isinstance(value, str) and (redact(value) != value or ("://" in value and _has_credentials(value))):
        yield where


def _has_credentials(url: str) -> bool:
    """Tell whether a URL holds a user, a query, a fragment, or a part of a path that looks like a key."""
    parts = urlsplit(url)
    return bool(parts.username or parts.password or parts.query or parts.fragment) or any(
        map(_RANDOM.fullmatch, _PARTS.split(parts.path))
    )


def _kept() -> list[str]:
    return [value for name, value in os.environ.items() if _SECRET_VARIABLE.search(name)]
