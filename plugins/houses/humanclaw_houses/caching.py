"""Cache generated houses, keyed by the generator's code, the house's name and the library's digest."""

from __future__ import annotations

import hashlib
import importlib.metadata
from collections.abc import Callable
from functools import cache
from importlib import resources
from importlib.resources.abc import Traversable
from typing import Final

from humanclaw import Scene, SceneError
from humanclaw.storage import Cache
from humanclaw.world import pack_scene, unpack_scene

CORE: Final = ("body", "records/tasks.py", "world/joints.py", "world/meshes", "world/navigation", "world/scene.py")
"""Parts of the core whose code may change a house."""
_LIBRARIES: Final = ("manifold3d", "numpy", "scikit-image", "scipy")
"""Distributions whose version may change a house."""


def kept(name: str, assets: str, generate: Callable[[], Scene], store: Cache | None = None) -> Scene:
    """Return the house from the cache; if it is not there, generate and store it.

    assets: digest of the library, or empty.
    """
    store = store or Cache("houses")
    key = hashlib.sha256(f"{generator_version()}|{name}|{assets}".encode()).hexdigest()
    data = store.get(key)
    if data is not None:
        try:
            return unpack_scene(data)
        except SceneError as error:
            store.drop(key, error.message)
    made = generate()
    store.put(key, pack_scene(made))
    return made


@cache
def generator_version() -> str:
    """Return a digest of everything that may change a house: this package, CORE, and the versions of libraries.

    A test compares CORE with the imports of this package, so that no stale house is served.
    """
    state = hashlib.sha256()
    core = resources.files("humanclaw")
    for part in (*(core / name for name in CORE), resources.files(__package__)):
        for path in _sources(part):
            state.update(path.name.encode() + path.read_bytes())
    for name in _LIBRARIES:
        state.update(f"{name} {importlib.metadata.version(name)}".encode())
    return state.hexdigest()


def _sources(part: Traversable) -> list[Traversable]:
    """Return a file, or the Python and table files of a package and the packages in it, in order."""
    if part.is_file():
        return [part] if part.name.endswith((".py", ".toml")) else []
    inside = sorted(part.iterdir(), key=lambda item: item.name)
    return [path for item in inside if item.name != "__pycache__" for path in _sources(item)]
