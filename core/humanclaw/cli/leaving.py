"""What a plugin that calls os._exit gets: an error that names it, where the process would end as if all were well."""

from __future__ import annotations

import os
import sys
import threading
from typing import Final, NoReturn

leave: Final = os._exit
"""os._exit itself, for commands that have to end like this."""


def raise_exits() -> list[str]:
    """Let os._exit raise SystemExit from here on, so that a plugin that calls it is blamed and the record closed.

    Until the process ends: a call at its exit would change its status. Returns a list that gets the calls in other
    threads, in words: there nobody may see the exception.
    """
    process, told = os.getpid(), list[str]()

    def instead(status: int) -> NoReturn:
        if os.getpid() != process:  # A forked child has to end like this.
            leave(status)
        if (thread := threading.current_thread()) is not threading.main_thread():
            code = sys._getframe(1)
            told.append(f"os._exit({status}) was called in {thread.name}, {code.f_code.co_filename}:{code.f_lineno}")
        raise SystemExit(f"os._exit({status})")

    os._exit = instead
    return told
