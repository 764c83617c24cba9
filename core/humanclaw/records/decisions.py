"""Values of a decision, in the loop and in the record: call, reasoning, verification, cost."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Annotated, Any, ClassVar, TypeVar

from pydantic import Field

from humanclaw.errors import CallError
from humanclaw.skills.call import Call
from humanclaw.skills.contract import Skill, check_call
from humanclaw.text.json import DEEPEST, HELD, LARGEST
from humanclaw.text.words import legible

T = TypeVar("T")


@dataclass(frozen=True)
class Usage:
    """Tokens and cost of one or more answers. Tokens are the provider's count unless `estimated`; cost is in US
    dollars."""

    __pydantic_config__: ClassVar = HELD

    tokens_in: int = 0
    tokens_out: int = 0
    cost: float = 0.0
    estimated: bool = False
    cost_estimated: bool = False
    """The provider reported no cost: it is tokens times a listed price, or unknown and 0."""
    tokens_reasoning: int = 0
    """Reasoning tokens among tokens_out, if the provider reports them."""

    def __post_init__(self) -> None:
        """Raise ValueError for a negative or non-finite number: it would disable every limit."""
        counts = (self.tokens_in, self.tokens_out, self.tokens_reasoning, self.cost)
        if not all(0 <= count < math.inf for count in counts):
            raise ValueError(f"tokens and cost must be finite and not below 0; got {counts}")

    def __add__(self, other: Usage) -> Usage:
        return Usage(
            self.tokens_in + other.tokens_in,
            self.tokens_out + other.tokens_out,
            self.cost + other.cost,
            self.estimated or other.estimated,
            self.cost_estimated or other.cost_estimated,
            self.tokens_reasoning + other.tokens_reasoning,
        )


@dataclass(frozen=True)
class Decision:
    """One answer: perception, high-, mid- and low-level reasoning, and the calls (paper, section 3.2). A legal answer
    has one call."""

    __pydantic_config__: ClassVar = HELD

    calls: tuple[Call, ...] = ()
    visible_state: str = ""
    progress: str = ""
    mid_level_goal: str = ""
    mid_level_change: str = ""
    """'keep' or 'revise'."""
    reasoning: str = ""
    note_to_self: str = ""
    """What the agent wants to read again in later steps; it replaces the note before it."""
    expected_success: Annotated[float, Field(ge=0, le=1)] | None = None
    """How likely the goal would count as reached if the episode ended now; None if the agent does not say."""
    raw: str = ""
    prompt_digest: str = ""
    usage: Usage = field(default_factory=Usage)
    dropped_steps: Annotated[int, Field(ge=0)] = 0
    """Past steps that the settings put into the prompt and that were left out because the model's context was full."""
    left_out: tuple[str, ...] = ()
    """Parameters of the settings, such as temperature, that the model refuses and was asked without."""


@dataclass(frozen=True)
class Attempt:
    """A decision that was submitted, usable or not."""

    __pydantic_config__: ClassVar = HELD

    decision: Decision
    error: str = ""
    """Reason of a refusal; empty if the call was used."""


@dataclass(frozen=True)
class Refusal:
    """Nothing was executed. The agent reads the error and decides again."""

    error: str
    attempts_left: int


@dataclass(frozen=True)
class Answer:
    """A verifier's answer to one check."""

    __pydantic_config__: ClassVar = HELD

    check: str
    passed: bool
    note: str = ""


@dataclass(frozen=True)
class Verdict:
    """Accept the proposed call, or replace it by another one from the same pool.

    A verdict that does not accept names a replacement: something is executed in every step.
    """

    __pydantic_config__: ClassVar = HELD

    accepted: bool
    replacement: Call | None = None
    answers: tuple[Answer, ...] = ()
    failed_open: str = ""
    """Reason why the call passed unverified; empty if it was verified."""
    usage: Usage = field(default_factory=Usage)

    @property
    def failed(self) -> tuple[Answer, ...]:
        """The checks that the call did not pass."""
        return tuple(answer for answer in self.answers if not answer.passed)


def recordable(value: T, kind: type[T]) -> T:
    """Return a decision or a verdict, which a model may have written, in a form that a record can hold.

    Control characters are replaced; texts and nesting are cut at a limit. Values that a schema refuses stay refusable.
    """
    # T is Decision or Verdict, both dataclasses.
    values = {part.name: getattr(value, part.name) for part in fields(kind)}  # type: ignore[arg-type]
    listed = {name: tuple(part) if isinstance(part, list) else part for name, part in values.items()}
    return kind(**{name: _bounded(part) for name, part in listed.items()})


def _bounded(value: Any, depth: int = 0) -> Any:
    if isinstance(value, str):
        return legible(value)
    if isinstance(value, int) and abs(value) > LARGEST:
        return float("inf") if value > 0 else float("-inf")  # Readers of JSON would lose its digits.
    if value is None or isinstance(value, bool | int | float):
        return value
    if depth > DEEPEST:
        return "..."
    if isinstance(value, Call):
        return Call(_bounded(str(value.skill)), _bounded(value.params))
    if kind := next((kind for kind in (Answer, Usage) if isinstance(value, kind)), None):
        return recordable(value, kind)
    if isinstance(value, Mapping):
        return {_bounded(str(key)): _bounded(inner, depth + 1) for key, inner in value.items()}
    if isinstance(value, tuple):
        return tuple(_bounded(inner, depth + 1) for inner in value)
    if isinstance(value, list):
        return [_bounded(inner, depth + 1) for inner in value]
    return _bounded(str(value))


def check(decision: Decision, skills: Mapping[str, Skill]) -> Call:
    """Return the one legal call of a decision, with defaults filled in. Raises CallError, whose text is for the
    model."""
    if len(decision.calls) != 1:
        count = "no call" if not decision.calls else f"{len(decision.calls)} calls"
        raise CallError(f"Nothing was executed: the answer held {count}; make exactly one skill call a step.")
    return check_call(decision.calls[0], skills)
