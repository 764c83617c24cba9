"""Calls of a skill, drawn from its schema: legal ones at its bounds and between them, and illegal ones."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any, Final

import numpy as np

from humanclaw.skills.contract import Skill
from humanclaw.skills.tool_schemas import parameter_schema

OPEN: Final = 1000
"""Bound for a number without bounds in the schema: large for a skill, and quick to iterate over."""
_WORDS: Final = ("", "a", "a few words")


def corners(skill: Skill) -> list[dict[str, Any]]:
    """Return two legal calls of a skill: all parameters at their minimum, and all at their maximum."""
    return [_drawn(skill, lambda: 0.0), _drawn(skill, lambda: 1.0)]


def legal_calls(skill: Skill, samples: int = 3, seed: int = 0) -> list[dict[str, Any]]:
    """Return the corners, the call with all defaults, and some random calls."""
    random = np.random.default_rng(seed)
    required = skill.schema.get("required", ())
    plain = {key: value for key, value in corners(skill)[0].items() if key in required}
    return [*corners(skill), plain, *(_drawn(skill, random.random) for _ in range(samples))]


def missing_bounds(skill: Skill, params: Mapping[str, Any]) -> str:
    """Return in words which bounds the numbers of a call have not; empty if they have all."""
    return ", ".join(
        f"{key!r} has no {bound}imum ({short}= in Field)"
        for key, part in parameter_schema(skill).items()
        for bound, short in (("min", "ge"), ("max", "le"))
        if key in params and part.get("type") in ("integer", "number") and "enum" not in part
        if not part.keys() & {f"{bound}imum", f"exclusive{bound.title()}imum"}
    )


def values_of(skill: Skill, key: str) -> list[Any]:
    """Return values of one parameter: its least, a middle one and its greatest."""
    part = parameter_schema(skill)[key]
    return [_value(part, lambda share=share: share) for share in (0.0, 0.5, 1.0)]


def _drawn(skill: Skill, share: Any) -> dict[str, Any]:
    return {key: _value(part, share) for key, part in parameter_schema(skill).items()}


def _value(part: Mapping[str, Any], share: Any) -> Any:
    """Return a value of a flat schema. share(): position between minimum and maximum, 0 to 1."""
    if "enum" in part:
        return part["enum"][_index(share(), len(part["enum"]))]
    kind = part.get("type")
    if kind == "array":
        least = int(part.get("minItems", 0))
        most = min(int(part.get("maxItems", least + 3)), least + OPEN)
        count = least + _index(share(), most - least + 1)
        return [_value(part["items"], share) for _ in range(count)]
    if kind == "boolean":
        return share() >= 0.5
    if kind == "string":
        return _text(part, share())
    return _number(part, share())


def _index(share: float, count: int) -> int:
    return min(int(share * count), count - 1)


def _text(part: Mapping[str, Any], share: float) -> str:
    """Return a text of a legal length. For a pattern, return the default."""
    text = str(part.get("default", _WORDS[_index(share, len(_WORDS))]))
    least = int(part.get("minLength", 0))
    return text.ljust(least, "a")[: int(part.get("maxLength", len(text) + least))]


def _number(part: Mapping[str, Any], share: float) -> float:
    whole = part["type"] == "integer"
    low = part.get("minimum", part.get("exclusiveMinimum"))
    high = part.get("maximum", part.get("exclusiveMaximum"))
    low = min(-OPEN, high or 0) if low is None else low
    high = max(OPEN, low) if high is None else high
    inset = 0.001 * (high - low)
    first = low + inset if "exclusiveMinimum" in part else low
    last = high - inset if "exclusiveMaximum" in part else high
    if step := part.get("multipleOf", 1 if whole else 0):
        least, most = math.ceil(first / step), math.floor(last / step)
        # JSON holds the step: a number.
        return (least + _index(share, most - least + 1)) * step  # type: ignore[no-any-return]
    return float(first + share * (last - first))


def illegal_calls(skill: Skill) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield calls that a schema must refuse, each with the name of its check."""
    legal = corners(skill)[0]
    yield "refuses-unknown", legal | {"no_such_parameter": 1}
    for key, part in parameter_schema(skill).items():
        yield "refuses-types", legal | {key: 7 if part.get("type") in ("string", "array") else "a text"}
        yield "refuses-nan", legal | {key: float("nan")}
        yield "refuses-nan", legal | {key: float("inf")}
        for bound, beyond in (("maximum", 1), ("minimum", -1)):
            if bound in part:
                yield "refuses-beyond", legal | {key: part[bound] + beyond}
