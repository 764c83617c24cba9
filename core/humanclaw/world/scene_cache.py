"""Arrays that are worked out once for a scene and kept on disk, since every run needs them."""

from __future__ import annotations

import hashlib
import time
import zlib
from collections.abc import Callable, Mapping
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from safetensors.numpy import load, save

from humanclaw.storage.cache import Cache
from humanclaw.world.scene import Scene

_LONG: Final = 0.005
"""Seconds that arrays take at least if they are to be kept."""

Arrays = Mapping[str, NDArray[Any]]


def kept(scene: Scene, what: str, code: str, make: Callable[[], Arrays]) -> Arrays:
    """Return arrays by name from the cache, or make them, and store them if that takes long.

    Args:
        what: names them among all arrays of the scene, from whatever start.
        code: digest of everything else that may change them.
    """
    # A scene's digest joins the hulls of an asset: it does not tell one piece from two with the same points.
    pieces = [[len(hull) for hull in scene.assets[name].hulls] for name in sorted(scene.assets)]
    store, key = Cache("maps"), hashlib.sha256(f"{code}|{scene.still}|{pieces}|{what}".encode()).hexdigest()
    if (data := store.get(key)) is not None:
        return load(zlib.decompress(data))
    began, made = time.process_time(), make()
    if time.process_time() - began > _LONG:
        store.put(key, zlib.compress(save({name: np.ascontiguousarray(array) for name, array in made.items()}), 1))
    return made
