"""Root causes of failures, and the rules that tell them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Generic, Literal, TypeVar

from humanclaw import RecordedEpisode

Stage = Literal[
    "call", "find", "nav", "interact", "reach", "hold", "place", "open", "answer", "meet", "keep", "end", "give",
    "task",
]  # fmt: skip
F = TypeVar("F")
"""The facts of an episode that rules use."""


def last(recorded: RecordedEpisode) -> int | None:
    return len(recorded.steps) - 1 if recorded.steps else None


@dataclass(frozen=True)
class Cause:
    """A root cause: its stage, and the capability that failed."""

    stage: Stage
    name: str
    capability: str
    step: Callable[[RecordedEpisode], int | None] = field(default=last, kw_only=True)
    """The index of the step at which it was decided; None if no step did."""

    @property
    def label(self) -> str:
        return f"{self.stage}: {self.name}"


@dataclass(frozen=True)
class Rule(Cause, Generic[F]):
    """A root cause with the rule that tells it."""

    rule: Callable[[F], bool]
    meaning: str = ""
    second: Callable[[F], bool] | None = None
    """The rule of a second label, if it is not the same: a rule that follows others may presume that they failed."""

    def describes(self, features: F) -> bool:
        """Tell whether it describes an episode, whatever cause comes first."""
        return (self.second or self.rule)(features)


def first_cause(rules: Sequence[Rule[F]], stage: Stage, features: F) -> Rule[F]:
    """Return the first cause of a stage whose rule holds."""
    return next(rule for rule in rules if rule.stage == stage and rule.rule(features))
