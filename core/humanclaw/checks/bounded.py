"""Run third-party code with a timeout."""

from __future__ import annotations

import contextvars
import threading
import weakref
from collections.abc import Callable
from concurrent.futures import Future
from queue import SimpleQueue
from typing import Any, TypeVar

T = TypeVar("T")
_Job = tuple[Future[Any], Callable[[], Any]]


class OverdueError(TimeoutError):
    """A call that did not return in time."""


class Bounded:
    """Calls functions in one thread of its own, each with a timeout.

    Python cannot stop a thread. An overdue call goes on in that thread; until it returns, further calls are refused.
    The process does not wait for it to end. One thread makes all calls, so objects that belong to a thread, such as
    database connections, stay usable from call to call.
    """

    def __init__(self, seconds: float) -> None:
        """seconds: the timeout."""
        self._seconds = seconds
        self._jobs: SimpleQueue[_Job | None] = SimpleQueue()
        self._thread: threading.Thread | None = None
        self._last: Future[Any] | None = None

    def __call__(self, function: Callable[[], T]) -> T:
        """Call a function and return its result.

        Raises what the function raises, and OverdueError if it, or an earlier call, has not returned in time.
        """
        if threading.current_thread() is self._thread:
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
        except KeyboardInterrupt:  # Ctrl-C never reaches this thread, so the plugin raised it.
            answer.set_exception(RuntimeError("KeyboardInterrupt"))
        except BaseException as error:
            answer.set_exception(error)
        del job, answer, function  # Keep nothing of a call alive until the next one.
