"""Import PyBullet without its output, and bind its functions to one world."""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any


@contextmanager
def quiet() -> Iterator[None]:
    """Discard the process's output: Bullet prints a banner from C, which would break protocols on stdout."""
    sys.stdout.flush()
    sys.stderr.flush()
    kept, nowhere = [os.dup(1), os.dup(2)], os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    os.dup2(nowhere, 2)
    try:
        yield
    finally:
        # C has its own buffers: flush them before stdout is restored, or the banner appears afterwards.
        ctypes.CDLL(None).fflush(None)
        for stream, descriptor in enumerate(kept, start=1):
            os.dup2(descriptor, stream)
            os.close(descriptor)
        os.close(nowhere)


with quiet():
    import pybullet


class Client:
    """One private Bullet world, with every pybullet function bound to it.

    Not thread-safe. close() frees the world; afterwards every function raises pybullet.error.
    """

    def __init__(self) -> None:
        self._id = pybullet.connect(pybullet.DIRECT)

    def __getattr__(self, name: str) -> Any:
        attribute = getattr(pybullet, name)
        bound = partial(attribute, physicsClientId=self._id) if callable(attribute) else attribute
        setattr(self, name, bound)
        return bound

    def close(self) -> None:
        if self._id >= 0:
            pybullet.disconnect(self._id)
            # The bound functions go too: another world may get this number.
            self.__dict__ = {"_id": -1}
