"""Compile loops over numbers to machine code."""

from __future__ import annotations

import gc
import hashlib
import inspect
import pickle
import sys
from collections.abc import Callable
from functools import cache
from typing import Any, Final

import numpy as np
from numba import njit
from numba.core import event
from numba.core.dispatcher import Dispatcher

# Nothing calls through C, and each wrapper takes time to compile.
_HOW: Final[Any] = {"error_model": "numpy", "no_cfunc_wrapper": True}
_INSIDE: Final[Any] = {**_HOW, "no_cpython_wrapper": True}
_RARELY: Final = (20_000, 10, 100)
"""How often garbage is collected while numba compiles. Its types and code stay: at Python's thresholds, looking through
them again and again takes a fifth of the time to compile."""


def compiled(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile a function to machine code, cached on disk beside the source or in the user's cache.

    Where neither can be written, each process compiles again.
    """
    # The cached file has this name. numba looks at the time of the function's own file alone.
    function.__qualname__ += f"_{_taken_in(function.__module__)[:12]}"
    try:
        return njit(cache=True, nogil=True, **_HOW)(function)  # type: ignore[no-any-return]  # numba has no types.
    except RuntimeError:
        return njit(nogil=True, **_HOW)(function)  # type: ignore[no-any-return]  # numba has no types.


def internal(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile a function that compiled functions alone call: a way in from Python would take as long as its loops."""
    return njit(**_INSIDE)(function)  # type: ignore[no-any-return]  # numba has no types.


def inlined(function: Callable[..., Any]) -> Callable[..., Any]:
    """Let compiled functions use a function as if it were part of them. Only they can call it.

    LLVM inlines it: numba's own inlining analyses the caller again for each call, which takes longer to compile.
    """
    return njit(**_INSIDE, forceinline=True)(function)  # type: ignore[no-any-return]  # numba has no types.


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


class _Rarely(event.Listener):
    """Collects garbage rarely while numba compiles: one thread at a time, functions within functions."""

    def __init__(self) -> None:
        self._before: list[tuple[int, int, int]] = []

    def on_start(self, event: object) -> None:
        self._before.append(gc.get_threshold())
        gc.set_threshold(*_RARELY)

    def on_end(self, event: object) -> None:
        gc.set_threshold(*self._before.pop())


event.register("numba:compile", _Rarely())  # type: ignore[no-untyped-call]  # numba has no types.
