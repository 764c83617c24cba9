"""Compile loops over numbers to machine code."""

from __future__ import annotations

import hashlib
import inspect
import pickle
import sys
import time
from collections.abc import Callable
from functools import cache
from typing import Any, Final

import numpy as np
from numba import njit
from numba.core.dispatcher import Dispatcher
from numba.core.event import Event, Listener, register


class _Clock(Listener):
    """Sums up the time in which numba compiles, which it does in one thread at a time."""

    def __init__(self) -> None:
        self._depth = 0
        self.state: tuple[float, float] = (0.0, float("inf"))
        """Seconds so far, and when the compilation began that is under way. One value, because other threads read
        it."""

    def on_start(self, event: Event) -> None:
        if self._depth == 0:
            self.state = (self.state[0], time.perf_counter())
        self._depth += 1

    def on_end(self, event: Event) -> None:
        self._depth -= 1
        if self._depth == 0:
            spent, began = self.state
            self.state = (spent + time.perf_counter() - began, float("inf"))


_CLOCK: Final = _Clock()
register("numba:compile", _CLOCK)  # type: ignore[no-untyped-call]


def compiling_seconds(now: float) -> float:
    """Return the seconds that this process has spent compiling until now, a time of time.perf_counter()."""
    spent, began = _CLOCK.state
    return spent + max(now - began, 0.0)


def compiled(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile a function to machine code, cached on disk beside the source or in the user's cache.

    Where neither can be written, each process compiles again.
    """
    how: Any = {"error_model": "numpy", "nogil": True}
    # The cached file has this name. numba looks at the time of the function's own file alone.
    function.__qualname__ += f"_{_taken_in(function.__module__)[:12]}"
    try:
        return njit(cache=True, **how)(function)  # type: ignore[no-any-return]
    except RuntimeError:
        return njit(**how)(function)  # type: ignore[no-any-return]


def inlined(function: Callable[..., Any]) -> Callable[..., Any]:
    """Let compiled functions use a function as if it were part of them."""
    return njit(inline="always", error_model="numpy")(function)


@cache
def _taken_in(module: str) -> str:
    """Return a digest of what a module may give to machine code: numbers, arrays, and functions of other files."""
    state = hashlib.sha256()
    for name, value in sorted(vars(sys.modules[module]).items()):
        if isinstance(value, (int, float, tuple, np.generic, np.ndarray)):
            state.update(name.encode() + pickle.dumps(value))
        elif isinstance(value, Dispatcher) and (elsewhere := value.py_func.__module__) != module:
            state.update((inspect.getsource(sys.modules[elsewhere]) + _taken_in(elsewhere)).encode())
    return state.hexdigest()
