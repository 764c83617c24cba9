"""Limits on one answer, an episode or a whole run: seconds, tokens and US dollars.

A limit is checked after each answer, so at most one answer exceeds it. Time limits also end a waiting agent, if it asks
for seconds_left(); an agent that does not ask is ended when it returns.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, Literal, get_args

from humanclaw.errors import HumanclawError, LimitError

if TYPE_CHECKING:
    from humanclaw.records.decisions import Usage

Scope = Literal["call", "episode", "run"]
"""call: one question to a model, retries included."""
Unit = Literal["seconds", "tokens", "usd"]
SCOPES: Final[tuple[Scope, ...]] = get_args(Scope)
UNITS: Final[tuple[Unit, ...]] = get_args(Unit)
Limits = Mapping[str, float]
"""Maximum by 'scope.unit', such as {"episode.usd": 0.5}. Missing entries are unlimited."""


def check_limits(limits: Limits) -> Limits:
    """Return the limits. Raises HumanclawError for an unknown scope.unit or a number that is not above 0."""
    known = [f"{scope}.{unit}" for scope in SCOPES for unit in UNITS]
    for name, most in limits.items():
        if name not in known:
            raise HumanclawError(f"there is no limit {name!r}.", f"The limits are {', '.join(known)}.")
        if isinstance(most, bool) or not isinstance(most, int | float) or not 0 < most < math.inf:
            raise HumanclawError(f"limit {name} takes a number above 0; got {most!r}.", f"For example {name}=10.")
    return limits


@dataclass
class _Account:
    """Usage of a scope since it began."""

    began: float
    tokens: int = 0
    usd: float = 0.0

    def used(self, unit: Unit, now: float) -> float:
        return now - self.began if unit == "seconds" else self.tokens if unit == "tokens" else self.usd


def _nothing() -> Usage:
    # Imported here: the command line checks limits before it loads pydantic.
    from humanclaw.records.decisions import Usage

    return Usage()


class Meter:
    """The accounts of a run, of its current episode and of its current call. Not thread-safe."""

    def __init__(self, limits: Limits | None = None, clock: Callable[[], float] = time.monotonic) -> None:
        """Raise HumanclawError for invalid limits."""
        self.limits = dict(check_limits(limits or {}))
        self._clock = clock
        self._accounts: dict[Scope, _Account] = {scope: _Account(clock()) for scope in SCOPES}
        self._total = _nothing()

    def begin(self, scope: Scope) -> None:
        """Begin a new account: of the next episode, or of the next call."""
        self._accounts[scope] = _Account(self._clock())
        if scope == "episode":
            self._total = _nothing()

    def add(self, usage: Usage) -> None:
        """Add the usage of an answer to every account."""
        for account in self._accounts.values():
            account.tokens += usage.tokens_in + usage.tokens_out
            account.usd += usage.cost
        self._total = self._total + usage

    @property
    def episode(self) -> Usage:
        """Usage of the episode so far, including answers that belong to no step."""
        return self._total

    def check(self) -> None:
        """Raise LimitError if a limit has been crossed: first the run's, then the episode's, then the call's."""
        now = self._clock()
        for scope in reversed(SCOPES):
            for unit in UNITS:
                most, used = self.limits.get(f"{scope}.{unit}", math.inf), self._accounts[scope].used(unit, now)
                if used > most:
                    raise LimitError(scope, f"{used:.6g} {unit} used; the limit {scope}.{unit} is {most:g}")

    def seconds_left(self) -> float:
        """Return the seconds until the first time limit; infinite without one, never below 0."""
        now = self._clock()
        left = [
            self.limits[f"{scope}.seconds"] - account.used("seconds", now)
            for scope, account in self._accounts.items()
            if f"{scope}.seconds" in self.limits
        ]
        return max(0.0, min(left, default=math.inf))

    def limits_money(self) -> bool:
        return any(name.endswith(".usd") for name in self.limits)
