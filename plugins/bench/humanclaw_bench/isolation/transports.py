"""How requests reach the agents' side: through the pipe of a process."""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import sys
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, Final

from humanclaw import LimitError, PluginError, ProviderClosedError, ProviderError
from humanclaw_bench.isolation.messages import Json

LARGEST: Final = 16 * 2**20
"""Bytes that an answer may have."""
GRACE: Final = 5.0
"""Seconds that an agent may take beyond its time limit to say so by itself."""
STARTING: Final = 600.0
"""Seconds that the other side may take to import everything and make agent and verifier."""


_ERROR: Final = ("kind", "type", "message", "remedy", "scope")
"""What an answer tells of an error."""


class OverdueError(Exception):
    """No answer came in time."""


class ProcessTransport:
    """A process of this machine, which answers one request a line. Started when needed; one that died is replaced."""

    def __init__(self, arguments: Sequence[str]) -> None:
        """arguments: of `python -m humanclaw_bench.isolation`."""
        self._command = [sys.executable, "-m", "humanclaw_bench.isolation", *arguments]
        self._process: subprocess.Popen[bytes] | None = None
        # Requests are written and answers read in a thread: a process that does neither would hold up whoever asks.
        self._thread = ThreadPoolExecutor(1)

    def ask(self, method: str, params: Json, seconds: float | None = None) -> Any:
        """Return the result of a request.

        Raises what the other side raised, RuntimeError if it died or answers nonsense, and OverdueError after these
        seconds; the process starts anew after either.
        """
        process = self._process or self._start()
        line = json.dumps({"method": method, "params": params}, separators=(",", ":")).encode() + b"\n"
        try:
            answer = self._thread.submit(_exchange, process, line).result(seconds)
        except TimeoutError:
            process.kill()
            self.close()
            raise OverdueError(f"no answer to {method} within {seconds:.0f} s") from None
        if not answer.endswith(b"\n"):
            raise self._died(process, method, answer)
        return result_of(answer)

    def _start(self) -> subprocess.Popen[bytes]:
        alike = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
        self._process = subprocess.Popen(self._command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=alike)
        return self._process

    def _died(self, process: subprocess.Popen[bytes], method: str, answer: bytes) -> RuntimeError:
        """Return the error of a process that ended, or wrote too much, in the middle of a request."""
        self.close()
        if answer:
            return RuntimeError(f"its answer to {method} has more than {LARGEST} bytes")
        return RuntimeError(f"its process ended with exit code {process.returncode} at {method}; see the worker's log")

    def close(self) -> None:
        process, self._process = self._process, None
        if process is None:
            return
        assert process.stdin
        with contextlib.suppress(OSError):  # Its other end may be gone.
            process.stdin.close()
        try:
            process.wait(timeout=1.0)
        except subprocess.TimeoutExpired:
            process.kill()
        with process:  # Closes the pipes.
            process.wait()


def _exchange(process: subprocess.Popen[bytes], request: bytes) -> bytes:
    """Write a request and return the line that answers it; without a line's end if the process ended, or wrote more."""
    assert process.stdin
    assert process.stdout
    with contextlib.suppress(OSError):  # Its other end may be gone.
        process.stdin.write(request)
        process.stdin.flush()
    return process.stdout.readline(LARGEST)


def result_of(answer: bytes) -> Any:
    """Return the result of an answer.

    Raises the error in it: PluginError, ProviderClosedError, LimitError and ProviderError as such, others under their
    own name. Raises RuntimeError for anything that is no answer.
    """
    try:
        reply = json.loads(answer)
        if "result" in reply:
            return reply["result"]
        kind, name, message, remedy, scope = (str(reply["error"][key]) for key in _ERROR)
    except (ValueError, KeyError, TypeError, RecursionError):
        raise RuntimeError(f"it answers with nonsense: {answer[:80]!r}") from None
    if kind in ("PluginError", "ProviderClosedError"):
        raise (PluginError if kind == "PluginError" else ProviderClosedError)(message, remedy)
    if kind == "LimitError":
        raise LimitError(scope, message)
    raise (ProviderError if kind == "ProviderError" else _named(name))(message)


def _named(name: str) -> type[Exception]:
    """Return an exception of this name, for records: the class itself is on the other side."""
    return type(name, (Exception,), {}) if name.isidentifier() and len(name) < 80 else RuntimeError
