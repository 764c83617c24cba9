"""Houses that were generated once, kept: by the generator's own code, the house's name and the library's digest."""

from __future__ import annotations

import hashlib
import importlib.metadata
from collections.abc import Callable
from functools import cache
from importlib import resources
from importlib.resources.abc import Traversable
from typing import Final

from humanclaw.cache import Cache
from humanclaw.errors import SceneError
from humanclaw.scene import Scene
from humanclaw.scene_file import pack_scene, unpack_scene

_LIBRARIES: Final = ("manifold3d", "numpy", "scikit-image", "scipy")
"""Distributions whose version may change a house."""


def kept(name: str, assets: str, generate: Callable[[], Scene], store: Cache | None = None) -> Scene:
    """The house from the cache, or generated and put there. assets: digest of the library, or empty."""
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
    """Digest of all code that a house may come from: this package, the core, and the versions of their libraries.

    All of it and not a list of modules: a list would be forgotten one day, and a stale house served.
    """
    state = hashlib.sha256()
    for package in ("humanclaw", __package__):
        for path in _sources(resources.files(package)):
            state.update(path.name.encode() + path.read_bytes())
    for name in _LIBRARIES:
        state.update(f"{name} {importlib.metadata.version(name)}".encode())
    return state.hexdigest()


def _sources(folder: Traversable) -> list[Traversable]:
    """Python and table files of a package and the packages in it, in order."""
    found: list[Traversable] = []
    for item in sorted(folder.iterdir(), key=lambda item: item.name):
        if item.is_dir() and item.name != "__pycache__":
            found += _sources(item)
        elif item.name.endswith((".py", ".toml")):
            found.append(item)
    return found
