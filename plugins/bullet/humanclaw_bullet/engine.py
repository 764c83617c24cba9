"""Bullet itself, brought in quietly."""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any


@contextmanager
def quiet() -> Iterator[None]:
    """Send what the process prints to nowhere: Bullet greets from C, which would break protocols spoken on stdout."""
    sys.stdout.flush()
    sys.stderr.flush()
    kept, nowhere = [os.dup(1), os.dup(2)], os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    os.dup2(nowhere, 2)
    try:
        yield
    finally:
        ctypes.CDLL(None).fflush(None)
        for stream, descriptor in enumerate(kept, start=1):
            os.dup2(descriptor, stream)
            os.close(descriptor)
        os.close(nowhere)


with quiet():
    import pybullet


class Client:
    """One private Bullet world: every pybullet function, bound to it.

    A Client is not shared between threads. close() frees it; a closed client answers with pybullet.error.
    """

    def __init__(self) -> None:
        self._id = pybullet.connect(pybullet.DIRECT)

    def __getattr__(self, name: str) -> Any:
        function = getattr(pybullet, name)
        if not callable(function):
            return function

        def bound(*args: Any, **kwargs: Any) -> Any:
            return function(*args, physicsClientId=self._id, **kwargs)

        setattr(self, name, bound)
        return bound

    def close(self) -> None:
        if self._id >= 0:
            pybullet.disconnect(self._id)
            self._id = -1
