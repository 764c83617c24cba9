"""Options that several commands share."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, TypeVar

import click

from humanclaw.errors import HumanclawError

F = TypeVar("F", bound=Callable[..., Any])


def plugin_files(function: F) -> F:
    """--plugin FILE, as often as one likes."""
    option = click.option(
        "--plugin",
        "files",
        type=click.Path(path_type=Path),
        multiple=True,
        metavar="FILE",
        help="Also load a plugin from one Python file, without packaging it. Repeatable.",
    )
    return option(function)


def parse_pairs(pairs: Sequence[str]) -> dict[str, Any]:
    """key=value texts to a dict; values are JSON where they can be read as such. Raises HumanclawError."""
    return dict(_parse_pair(pair) for pair in pairs)


def _parse_pair(pair: str) -> tuple[str, Any]:
    key, equals, text = pair.partition("=")
    if not equals or not key:
        raise HumanclawError(f"--option takes key=value; got {pair!r}.", "For example --option temperature=0.2.")
    if "key" in key.lower() or ("token" in key.lower() and "max" not in key.lower()):
        raise HumanclawError(
            f"--option {key} looks like a secret, and options are recorded.", "Put keys into the environment instead."
        )
    try:
        return key, json.loads(text)
    except ValueError:
        return key, text
