"""Code of somebody else that is waited for so long and no longer."""

from __future__ import annotations

import contextvars
import math
import threading
import weakref
from collections.abc import Callable
from concurrent.futures import Future
from queue import SimpleQueue
from typing import Any, TypeVar

T = TypeVar("T")
_Job = tuple[Future[Any], Callable[[], Any]]


class OverdueError(TimeoutError):
    """A call that has not returned in its time."""


class Bounded:
    """Calls functions in a thread of its own, and waits for each so long and no longer.

    Python cannot end a thread: a call that is overdue goes on in its own, nothing else is asked of it until it returns,
    and the process ends without it. One thread makes all calls, so what belongs to a thread, as a database does, stays
    usable from call to call.
    """

    def __init__(self, seconds: float) -> None:
        """seconds: infinite to call at once, in the thread of whoever asks."""
        self._seconds = seconds
        self._jobs: SimpleQueue[_Job | None] = SimpleQueue()
        self._thread: threading.Thread | None = None
        self._last: Future[Any] | None = None

    def __call__(self, function: Callable[[], T]) -> T:
        """Return what a function gives. Raises what it raises, and OverdueError if it does not return in time, or an
        earlier one has not yet."""
        if math.isinf(self._seconds) or threading.current_thread() is self._thread:
            return function()
        if self._last and not self._last.done():
            raise OverdueError("it has not returned from an earlier call")
        self._last = self._start(function)
        try:
            return self._last.result(self._seconds)  # type: ignore[no-any-return]
        except TimeoutError:
            if self._last.done():
                raise
            raise OverdueError(f"it did not return within {self._seconds:g} s") from None

    def _start(self, function: Callable[[], T]) -> Future[T]:
        if self._thread is None:
            self._thread = threading.Thread(target=_work, args=(self._jobs,), name="plugin", daemon=True)
            self._thread.start()
            weakref.finalize(self, self._jobs.put, None)
        answer: Future[T] = Future()
        context = contextvars.copy_context()
        self._jobs.put((answer, lambda: context.run(function)))
        return answer


def _work(jobs: SimpleQueue[_Job | None]) -> None:
    while job := jobs.get():
        answer, function = job
        try:
            answer.set_result(function())
        except KeyboardInterrupt:  # No key reaches this thread.
            answer.set_exception(RuntimeError("KeyboardInterrupt"))
        except BaseException as error:
            answer.set_exception(error)
        del job, answer, function  # What a call was about is not kept until the next one.
