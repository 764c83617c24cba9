"""Compile loops over numbers to machine code."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numba import njit


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
