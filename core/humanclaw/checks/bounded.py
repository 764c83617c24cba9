"""Run third-party code with a timeout."""

from __future__ import annotations

import contextvars
import sys
import threading
from collections.abc import Callable
from concurrent.futures import Future
from traceback import walk_stack
from typing import TypeVar

T = TypeVar("T")


class OverdueError(TimeoutError):
    """A call that did not return in time. stood: file and line of each of its frames then, the innermost first."""

    def __init__(self, message: str, stood: tuple[tuple[str, int], ...] = ()) -> None:
        super().__init__(message)
        self.stood = stood


def bounded(seconds: float, function: Callable[[], T]) -> T:
    """Call a function in a thread of its own, and return its result.

    Python cannot stop a thread: an overdue call goes on, but the process does not wait for it to end. Raises what the
    function raises, and OverdueError if it has not returned in time.
    """
    answer: Future[T] = Future()
    context = contextvars.copy_context()

    def work() -> None:
        try:
            answer.set_result(context.run(function))
        except KeyboardInterrupt:  # Ctrl-C never reaches this thread, so the plugin raised it.
            answer.set_exception(RuntimeError("KeyboardInterrupt"))
        except BaseException as error:
            answer.set_exception(error)

    # A pool would join its threads as the process ends, and so wait for an overdue call for ever.
    thread = threading.Thread(target=work, name="plugin", daemon=True)
    thread.start()
    try:
        return answer.result(seconds)
    except TimeoutError:
        if answer.done():  # The function itself raised it.
            raise
        frame = sys._current_frames().get(thread.ident or 0)
        stood = tuple((each.f_code.co_filename, line) for each, line in walk_stack(frame)) if frame else ()
        raise OverdueError(f"it did not return within {seconds:g} s", stood) from None
