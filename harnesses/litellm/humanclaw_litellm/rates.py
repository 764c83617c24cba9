"""How fast a model may be asked by all workers of this machine together: one gate for each model, address and key.

Requests and tokens are paced evenly over the minute, so what is kept is one moment: the next one that is free.
Libraries that share a limit between processes keep a row for each token instead, and none lets a count be mended
afterwards.
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

from humanclaw.storage import Cache
from humanclaw_litellm.settings import ModelError, Settings

_LONGEST: Final = 3600.0
"""A moment further away than this was left behind by a machine that has been started anew since, seconds."""


class Gate:
    """Lets one request through after the other. Any number of processes and threads may share its file."""

    def __init__(
        self,
        path: Path,
        requests: float | None = None,
        tokens: float | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """Keep to so many requests and tokens a minute; None for no limit.

        clock: one for the whole machine, which nobody can set.
        """
        self._path, self._clock = path, clock
        self._requests, self._tokens = requests, tokens

    @classmethod
    def of(cls, settings: Settings) -> Gate:
        """Return the gate of a model; its file lies in the user's cache folder."""
        who = "\n".join((settings.model, settings.api_base, settings.auth_env))
        path = Cache("rates").folder / hashlib.sha256(who.encode()).hexdigest()[:32]
        return cls(path, settings.requests_per_minute, settings.tokens_per_minute)

    def enter(self, tokens: int) -> float:
        """Take the next free moment for a request of so many tokens; return the seconds until then.

        Raises ModelError if there is a rate to keep and no file to share it by.
        """
        wait = 0.0
        with self._next() as free:
            wait = max(0.0, free[0] - self._clock())
            free[0] = self._clock() + wait + self._seconds(1, tokens)
        return wait

    def settle(self, tokens: int) -> None:
        """So many tokens more (less, if negative) were used than had been thought."""
        if self._tokens and tokens:
            with self._next() as free:
                free[0] += self._seconds(0, tokens)

    def close(self, seconds: float) -> None:
        """Let nobody through for so long, because the provider asks for it."""
        with self._next() as free:
            free[0] = max(free[0], self._clock() + seconds)

    def _seconds(self, requests: int, tokens: int) -> float:
        """How long these keep the gate occupied: as long as the slower of the two rates asks for."""
        spans = [60.0 * count / rate for count, rate in ((requests, self._requests), (tokens, self._tokens)) if rate]
        return min(spans, default=0.0) if tokens < 0 else max(spans, default=0.0)

    @contextmanager
    def _next(self) -> Iterator[list[float]]:
        """Hand out the next free moment, to be changed while nobody else does."""
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
                self._path.write_text(repr(free[0]))
        finally:
            lock.release()

    def _read(self) -> float:
        try:
            moment = float(self._path.read_text())
        except (OSError, ValueError):
            return self._clock()
        return moment if abs(moment - self._clock()) < _LONGEST else self._clock()
