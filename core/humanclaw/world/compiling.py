"""Compile loops over numbers to machine code."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

from numba import njit
from numba.core.event import TimingListener, register

_CLOCK: Final = TimingListener()  # type: ignore[no-untyped-call]
register("numba:compile", _CLOCK)  # type: ignore[no-untyped-call]


def compiling_seconds() -> float:
    """Return the seconds that this process has spent compiling."""
    return float(_CLOCK.duration) if _CLOCK.done else 0.0


def compiled(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile a function to machine code, cached on disk beside the source or in the user's cache.

    Where neither can be written, each process compiles again.
    """
    how: Any = {"error_model": "numpy", "nogil": True}
    try:
        return njit(cache=True, **how)(function)  # type: ignore[no-any-return]
    except RuntimeError:
        return njit(**how)(function)  # type: ignore[no-any-return]


def inlined(function: Callable[..., Any]) -> Callable[..., Any]:
    """Let compiled functions use a function as if it were part of them."""
    return njit(inline="always", error_model="numpy")(function)
