"""Open `house:ARGUMENT`: a house by its number, optionally furnished from a library. Generated houses are cached.

3, train-17                a house with parametric furniture
3?assets=/path/to/LIB      the same house with imported furniture where the library has similar assets
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import parse_qsl

from humanclaw import Scene, SceneError
from humanclaw_houses.caching import kept
from humanclaw_houses.names import seed_of

if TYPE_CHECKING:
    from humanclaw_houses.library import Library


def open_house(argument: str) -> Scene:
    """Open a house.

    Raises SceneError for an unknown house or option, and HumanclawError for an invalid library.
    """
    number, library = _parts(argument)
    seed_of(number)
    scene = kept(number, library.digest if library else "", lambda: _make(number, library))
    # Only if it must be: a copy works its digest and its boxes out again.
    return scene if scene.name == (name := f"house:{argument}") else replace(scene, name=name)


def _make(number: str, library: Library | None) -> Scene:
    # Imported late: the geometry libraries take longer to load than a cached house.
    from humanclaw_houses.source import house

    return house(number, library)


def _parts(argument: str) -> tuple[str, Library | None]:
    number, _, query = argument.partition("?")
    try:
        options = dict(parse_qsl(query, keep_blank_values=True, strict_parsing=True)) if query else {}
    except ValueError as error:
        raise SceneError(f"cannot read the options {query!r} of house:{argument}.", _REMEDY) from error
    folder = options.pop("assets", None)
    if options or folder == "":
        raise SceneError(f"house:{argument} has an unknown or empty option.", _REMEDY)
    return number, _library(Path(folder).expanduser()) if folder else None


def _library(folder: Path) -> Library:
    from humanclaw_houses.library import Library

    return Library(folder)


_REMEDY = "The only option is the furniture library: house:3?assets=/path/to/LIB."
