"""Open `house:ARGUMENT`. Generated houses are cached, keyed by the generator's code and the house's name."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable
from typing import Final

from humanclaw import Scene, SceneError
from humanclaw.storage import Cache, source_digest
from humanclaw.world import pack_scene, unpack_scene

VALIDATION_HOUSES: Final = 41
GENERATOR: Final = 4
"""Version of the generator. Raise it when a number no longer gives the same house; make the splits again then."""
_REMEDY: Final = "Use house:0 to house:40, or house:train-N with N from 0 for a training house."
SOURCES: Final = ("humanclaw/body", "humanclaw/records", "humanclaw/world", "humanclaw_houses")
"""Packages and folders whose code may change a house."""
_LIBRARIES: Final = ("manifold3d", "numpy", "scikit-image", "scipy")
"""Distributions whose version may change a house."""


def seed_of(argument: str) -> tuple[int, int]:
    """Return the seed of house '0' to '40' or 'train-N'. Raises SceneError if there is no such house."""
    match = re.fullmatch(r"(train-)?(0|[1-9][0-9]{0,8})", argument)
    if not match or (not match[1] and int(match[2]) >= VALIDATION_HOUSES):
        raise SceneError(f"there is no house {argument!r}.", _REMEDY)
    return 1 if match[1] else 0, int(match[2])


def open_house(argument: str) -> Scene:
    """Open house '0' to '40' or 'train-N'. Raises SceneError for any other argument."""
    seed_of(argument)
    return kept(argument, lambda: _generate(argument))


def _generate(argument: str) -> Scene:
    # Imported late: the geometry libraries take longer to load than a cached house.
    from humanclaw_houses.source import house

    return house(argument)


def kept(name: str, generate: Callable[[], Scene]) -> Scene:
    """Return the house from the cache; if it is not there, generate and store it."""
    store = Cache("houses")
    key = hashlib.sha256(f"{generator_version()}|{name}".encode()).hexdigest()
    data = store.get(key)
    if data is not None:
        try:
            return unpack_scene(data)
        except SceneError as error:
            store.drop(key, error.message)
    made = generate()
    store.put(key, pack_scene(made))
    return made


def generator_version() -> str:
    """Return a digest of the code in SOURCES and of the versions of libraries, so that no stale house is served."""
    return source_digest(SOURCES, _LIBRARIES)
