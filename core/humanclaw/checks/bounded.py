"""Run third-party code with a timeout."""

from __future__ import annotations

import contextvars
import threading
from collections.abc import Callable
from concurrent.futures import Future
from typing import TypeVar

T = TypeVar("T")


class OverdueError(TimeoutError):
    """A call that did not return in time."""


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
    threading.Thread(target=work, name="plugin", daemon=True).start()
    try:
        return answer.result(seconds)
    except TimeoutError:
        if answer.done():  # The function itself raised it.
            raise
        raise OverdueError(f"it did not return within {seconds:g} s") from None
