"""Maps of fixed things, kept on disk: those of a house take a tenth of a second to draw, and every run needs them."""

from __future__ import annotations

import hashlib
import time
import zlib
from collections.abc import Callable, Mapping
from functools import cache
from importlib import resources
from typing import Any, Final

import numpy as np
import scipy
from numpy.typing import NDArray
from safetensors.numpy import load, save

from humanclaw.storage.cache import Cache
from humanclaw.world.scene import Scene

_LONG: Final = 0.005
"""Seconds that a drawing takes at least if it is to be kept."""

Drawing = Mapping[str, NDArray[Any]]


def kept(scene: Scene, what: str, draw: Callable[[], Drawing]) -> Drawing:
    """Return arrays by name from the cache, or draw them, and store them if that takes long. what: names them."""
    store, key = Cache("maps"), hashlib.sha256(f"{_version()}|{scene.digest}|{what}".encode()).hexdigest()
    if (data := store.get(key)) is not None:
        return load(zlib.decompress(data))
    began, drawn = time.process_time(), draw()
    if time.process_time() - began > _LONG:
        store.put(key, zlib.compress(save({name: np.ascontiguousarray(array) for name, array in drawn.items()}), 1))
    return drawn


@cache
def _version() -> str:
    """Return a digest of everything that may change a drawing of the same scene."""
    maps = [f"world/navigation/{name}.py" for name in ("keeping", "occupancy", "stairs")]
    names = (*maps, "world/scene.py", "body/pose.py")
    code = [resources.files("humanclaw").joinpath(name).read_bytes() for name in names]
    return hashlib.sha256(b"".join([*code, np.__version__.encode(), scipy.__version__.encode()])).hexdigest()
