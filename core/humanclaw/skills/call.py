"""A call of a skill, and holding it to the skill's schema before anything is executed."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar

from humanclaw.errors import CallError
from humanclaw.text.json import HELD
from humanclaw.text.words import did_you_mean, legible

if TYPE_CHECKING:
    from humanclaw.skills.contract import Skill


@dataclass(frozen=True)
class Call:
    """A skill and its parameters, as a model wrote them or after they were checked."""

    __pydantic_config__: ClassVar = HELD

    skill: str
    params: Mapping[str, Any] = field(default_factory=dict)

    def __str__(self) -> str:
        return f"{self.skill}({', '.join(f'{key}={_shown(value)}' for key, value in self.params.items())})"


def quoted(text: str) -> str:
    """Return a text as a JSON string of one line: whatever it says, it ends at the quotation mark."""
    return json.dumps(" ".join(legible(text).split()), ensure_ascii=False)


def _shown(value: object) -> object:
    """Quote a text of more than one word, which could pass for feedback."""
    return quoted(value) if isinstance(value, str) and not value.isidentifier() else value


def check_call(call: Call, skills: Mapping[str, Skill]) -> Call:
    """Return the call with defaults filled in. Raises CallError, whose text is for the model."""
    if call.skill not in skills:
        message = f"Nothing was executed: there is no skill {call.skill[:64]!r}."
        known = f"The skills are {', '.join(skills)}."
        raise CallError(" ".join(filter(None, (message, did_you_mean(call.skill, skills), known))))
    skill = skills[call.skill]
    if not skill.trained:
        raise CallError(
            f"Nothing was executed: {call.skill} is not available, its adapter is not trained. Use another skill."
        )
    return Call(call.skill, skill.check(call.params))
