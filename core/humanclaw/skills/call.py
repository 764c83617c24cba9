"""A call of a skill."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

from humanclaw.text.json import HELD
from humanclaw.text.words import legible


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
