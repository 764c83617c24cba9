"""Serve one worker: `python -m humanclaw_bench.isolation`, as the worker starts it, answers a request a line."""

from __future__ import annotations

import json
import os
import queue
import signal
import sys
import threading
from pathlib import Path
from typing import BinaryIO

from humanclaw import Choice, Plugins
from humanclaw_bench.isolation.session import Session


def main() -> None:
    """Answer requests from standard input until it closes.

    Argument: the plugin files and the choice of plugins, as JSON. Nothing else may write to the pipe, so standard
    output goes where errors go.
    """
    loads = json.loads(sys.argv[1])
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the run, which ends this process.
    pipe = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    lines: queue.Queue[bytes] = queue.Queue()
    threading.Thread(target=_read, args=(sys.stdin.buffer, lines), daemon=True).start()
    choice = Choice(**{name: tuple(texts) for name, texts in loads["choice"].items()})
    session = Session(Plugins.discover([Path(file) for file in loads["files"]], choice))
    while True:
        answer = session.answer(json.loads(lines.get()))
        pipe.write(json.dumps(answer, separators=(",", ":")).encode() + b"\n")
        pipe.flush()


def _read(stream: BinaryIO, lines: queue.Queue[bytes]) -> None:
    """Pass lines on, and end the process with its parent, even in the middle of a decision."""
    for line in stream:
        lines.put(line)
    os._exit(0)


if __name__ == "__main__":
    main()
