"""Hostile inputs, and bounds on what a reader may take for them: a GiB of memory and five seconds of the processor."""

from __future__ import annotations

import functools
import json
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, settings, strategies as st

try:
    import resource
except ImportError:  # Windows
    resource = None  # type: ignore[assignment]

GIB = 1 << 30
SECONDS = 5
few = settings(max_examples=8, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck), database=None)
settings.register_profile("few", few)
settings.register_profile("fuzz", few, max_examples=12_500, derandomize=False)
settings.load_profile("few")
DEEP = functools.reduce(lambda inner, _: [inner], range(900), [])
HOSTILE = st.sampled_from(
    [None, True, -1, 0, 10**9, 2**31, 2**63, 10**30, 1e308, float("nan"), float("inf"), "", "x" * 70_000, "../../x",
     "/", "\0", "\x1b[2J", "9" * 5000, [], {}, [[]] * 1000, {"": {}}, DEEP]
)  # fmt: skip
PICKS = st.lists(st.integers(0, 10**6), min_size=1, max_size=6)


def damages() -> st.SearchStrategy[list[tuple[int, bytes, int]]]:
    """Return changes of bytes: (place, what is put there, how many go)."""
    return st.lists(st.tuples(st.integers(0, 2**20), st.binary(max_size=6), st.integers(0, 40)), min_size=1, max_size=3)


def damaged(data: bytes, changes: list[tuple[int, bytes, int]]) -> bytes:
    for place, new, gone in changes:
        first = place % (len(data) + 1)
        data = data[:first] + new + data[first + gone :]
    return data


def changed(value: Any, picks: list[int], new: Any) -> Any:
    """Return a JSON value with another one somewhere in it; the picks say where."""
    if not picks or not isinstance(value, dict | list) or not value:
        return new
    pick, *rest = picks
    keys = list(value) if isinstance(value, dict) else range(len(value))
    key = keys[pick % len(keys)]
    copy = value.copy()
    copy[key] = changed(value[key], rest, new)
    return copy


def rewritten(data: bytes, picks: list[int], new: Any) -> bytes:
    """Return a JSON document with another value somewhere in it."""
    return json.dumps(changed(json.loads(data), picks, new)).encode()


class TooLong(BaseException):
    """A reader took too long, or waits for what never comes."""


def _late(number: int, frame: Any) -> None:
    raise TooLong


@contextmanager
def bounded(*ours: type[Exception]) -> Iterator[None]:
    """Read something hostile: it succeeds, or raises an error of ours, within the bounds."""
    with _memory(), timed("PROF", SECONDS), timed("REAL", 12 * SECONDS):
        try:
            yield
        except ours as error:
            if any(isinstance(cause, MemoryError) for cause in _causes(error)):
                pytest.fail(f"more than a GiB was asked for: {error}")


@contextmanager
def timed(clock: str, seconds: float) -> Iterator[None]:
    """Raise TooLong in the block after so many seconds. clock: PROF, the processor's, or REAL."""
    if not hasattr(signal, "setitimer"):
        yield
        return
    number, timer = getattr(signal, {"PROF": "SIGPROF", "REAL": "SIGALRM"}[clock]), getattr(signal, f"ITIMER_{clock}")
    before = signal.signal(number, _late)
    signal.setitimer(timer, seconds)
    try:
        yield
    finally:
        signal.setitimer(timer, 0)
        signal.signal(number, before)


@contextmanager
def _memory() -> Iterator[None]:
    status = Path("/proc/self/status")
    if resource is None or not status.exists():
        yield
        return
    used = int(status.read_text().partition("VmData:")[2].split()[0]) * 1024
    before = resource.getrlimit(resource.RLIMIT_DATA)
    resource.setrlimit(resource.RLIMIT_DATA, (used + GIB, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_DATA, before)


def _causes(error: BaseException | None) -> Iterator[BaseException]:
    while error:
        yield error
        error = error.__cause__ or error.__context__
