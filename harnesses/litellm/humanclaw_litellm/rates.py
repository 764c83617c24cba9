"""A rate limit that all workers of this machine share: one limiter for each model, address and key variable.

Requests and tokens are spread evenly over the minute, so a limiter stores one number: the time of the next free slot.
Libraries that share a limit between processes store a row for each token, and cannot correct a count afterwards.
"""

from __future__ import annotations

import contextlib
import hashlib
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

from filelock import FileLock

from humanclaw.storage import Cache, Folder
from humanclaw_litellm.settings import ModelError, Settings

_LONGEST: Final = 3600.0
"""Seconds. A stored time that differs more from the clock dates from before a restart of the machine."""


class RateLimiter:
    """Spaces requests in time. Any number of processes and threads may share its file."""

    def __init__(
        self,
        path: Path,
        requests: float | None = None,
        tokens: float | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """Limit requests and tokens per minute; None for no limit.

        clock: monotonic seconds, the same for all processes of the machine.
        """
        self._path, self._files, self._clock = path, Folder(path.parent), clock
        self._requests, self._tokens = requests, tokens

    @classmethod
    def of(cls, settings: Settings) -> RateLimiter:
        """Return the limiter of a model. Its file is in the user's cache folder."""
        who = "\n".join((settings.model, settings.api_base, settings.auth_env))
        path = Cache("rates").folder / hashlib.sha256(who.encode()).hexdigest()[:32]
        return cls(path, settings.requests_per_minute, settings.tokens_per_minute)

    def enter(self, tokens: int) -> float:
        """Reserve the next free slot for a request of `tokens` tokens; return the seconds until then.

        Raises ModelError if there is a limit but its file cannot be written.
        """
        wait = 0.0
        with self._next() as free:
            wait = max(0.0, free[0] - self._clock())
            free[0] = self._clock() + wait + self._seconds(1, tokens)
        return wait

    def settle(self, tokens: int) -> None:
        """Correct a reservation by the tokens that the request took beyond the estimate; negative for fewer."""
        if self._tokens and tokens:
            with self._next() as free:
                free[0] += self._seconds(0, tokens)

    def close(self, seconds: float) -> None:
        """Let no request through for this many seconds, because the provider asks for it."""
        with self._next() as free:
            free[0] = max(free[0], self._clock() + seconds)

    def _seconds(self, requests: int, tokens: int) -> float:
        """Return the seconds that requests and tokens occupy the limiter, by the stricter limit."""
        spans = [60.0 * count / rate for count, rate in ((requests, self._requests), (tokens, self._tokens)) if rate]
        return min(spans, default=0.0) if tokens < 0 else max(spans, default=0.0)

    @contextmanager
    def _next(self) -> Iterator[list[float]]:
        """Lock the file and yield the time of the next free slot, as a list of one number to change."""
        try:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            lock = FileLock(self._path.with_suffix(".lock"))
            lock.acquire(timeout=10)
        except OSError as error:
            if self._requests or self._tokens:
                reason = f"no rate can be kept: {self._path.parent} cannot be written to."
                raise ModelError(reason, "Set HUMANCLAW_CACHE to a folder that all workers share.") from error
            yield [self._clock()]
            return
        try:
            free = [self._read()]
            yield free
            with contextlib.suppress(OSError):
                self._files.write(self._path.name, repr(free[0]).encode())
        finally:
            lock.release()

    def _read(self) -> float:
        try:
            moment = float(self._files.read(self._path.name, 100))
        except (OSError, ValueError):
            return self._clock()
        return moment if abs(moment - self._clock()) < _LONGEST else self._clock()
