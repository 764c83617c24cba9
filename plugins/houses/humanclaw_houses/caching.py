"""Cache generated houses, keyed by the generator's code, the house's name and the library's digest."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from typing import Final

from humanclaw import Scene, SceneError
from humanclaw.storage import Cache, source_digest
from humanclaw.world import pack_scene, unpack_scene

_WORLD: Final = ("joints.py", "keeping.py", "meshes", "navigation", "scene.py")
CORE: Final = ("body", "records/tasks.py", *(f"world/{part}" for part in _WORLD))
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


def generator_version() -> str:
    """Return a digest of everything that may change a house: this package, CORE, and the versions of libraries.

    A test compares CORE with the imports of this package, so that no stale house is served.
    """
    return source_digest((*(f"humanclaw/{part}" for part in CORE), "humanclaw_houses"), _LIBRARIES)
