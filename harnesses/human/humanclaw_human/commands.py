"""Typed lines and keys as calls. A line is a skill or its first letters, then numbers in the order of its schema."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from humanclaw import Call, CallError, Skill
from humanclaw.skills import Role, bounds, suited

_MOVES: Final[Mapping[str, tuple[int, tuple[str, ...]]]] = {
    "ArrowUp": (1, ("hips.forward", "hips.left", "heading.left")),
    "ArrowDown": (1, ("hips.back",)),
    "ArrowLeft": (1, ("heading.left",)),
    "ArrowRight": (-1, ("heading.left",)),
    "Shift+ArrowLeft": (1, ("hips.left",)),
    "Shift+ArrowRight": (-1, ("hips.left",)),
}
"""Key to a sign and the measures of a skill. A key commands half the bound of the first measure."""
_ENDS: Final[Mapping[str, Role]] = {"s": "sit", "End": "stop"}
_WORDS: Final = {
    "ArrowUp": "forward", "ArrowDown": "back", "ArrowLeft": "turn left", "ArrowRight": "turn right",
    "Shift+ArrowLeft": "step left", "Shift+ArrowRight": "step right", "s": "sit down", "End": "stop",
}  # fmt: skip


@dataclass(frozen=True)
class TypedCall:
    """A line as a call. seen: what the person reports in view."""

    call: Call
    seen: str = ""


def parse(line: str, skills: Mapping[str, Skill]) -> TypedCall:
    """Read a line. Raises CallError that says what was expected."""
    text, _, seen = line.partition("#")
    words = text.replace(",", " ").split()
    if not words:
        raise CallError("Type a skill and its numbers, or help.")
    skill = skills[_name(words[0], skills)]
    return TypedCall(Call(skill.name, skill.check(_params(skill, words[1:]))), seen.strip())


def _name(word: str, skills: Mapping[str, Skill]) -> str:
    """Return the skill for a name, its first letters, or the first letters of a later word: back for step_back."""
    word = word.lower()
    if word in skills:
        return word
    found = [name for name in skills if name.lower().startswith(word)]
    found = found or [name for name in skills if any(part.startswith(word) for part in name.lower().split("_"))]
    if len(found) == 1:
        return found[0]
    what = f"{word!r} may be {' or '.join(found)}" if found else f"there is no skill {word!r}"
    raise CallError(f"{what[0].upper()}{what[1:]}. The skills are {', '.join(skills)}.")


def _params(skill: Skill, words: Sequence[str]) -> dict[str, Any]:
    parts: Mapping[str, Mapping[str, Any]] = skill.schema.get("properties", {})
    if len(words) > len(parts):
        raise CallError(f"{usage(skill)} takes {len(parts)} numbers; you gave {len(words)}.")
    given = {key: _value(key, part, word) for (key, part), word in zip(parts.items(), words, strict=False)}
    # An omitted parameter is 0 if its bounds include 0, so that "walk 40" is enough.
    left_out = {
        key: 0
        for key, part in parts.items()
        if key not in given and "default" not in part and part.get("minimum", 1) <= 0 <= part.get("maximum", -1)
    }
    return given | left_out


def _value(key: str, part: Mapping[str, Any], word: str) -> Any:
    kind = part.get("type")
    if kind == "boolean":
        return word.lower() in ("1", "true", "yes")
    if kind not in ("integer", "number"):
        return word
    try:
        return int(word) if kind == "integer" else float(word)
    except ValueError:
        raise CallError(f"{key} is a whole number; you gave {word!r}.") from None


def usage(skill: Skill) -> str:
    """Return a skill and its parameters on one line."""
    return " ".join([skill.name, *skill.schema.get("properties", {})])


def manual(skills: Mapping[str, Skill]) -> str:
    """Return all skills with the bounds of their parameters."""
    return "\n".join(_entry(skill) for skill in skills.values() if skill.trained)


def _entry(skill: Skill) -> str:
    parts = skill.schema.get("properties", {})
    return f"  {usage(skill):28} {', '.join(f'{key} {bounds(part)}'.strip() for key, part in parts.items())}"


def forms(skills: Mapping[str, Skill]) -> tuple[dict[str, Any], ...]:
    """Return each skill as a form: its description, and each parameter as a model gets it, with an initial value."""
    return tuple(_form(skill) for skill in skills.values() if skill.trained)


def _form(skill: Skill) -> dict[str, Any]:
    parts: Mapping[str, Mapping[str, Any]] = skill.schema.get("properties", {})
    told = [
        {key: part[key] for key in ("description", "minimum", "maximum") if key in part}
        | {"name": name, "value": part.get("default", _amount(part, 0))}
        for name, part in parts.items()
    ]
    return {"name": skill.name, "description": skill.description, "parameters": told}


def keys(skills: Mapping[str, Skill]) -> dict[str, str]:
    """Return the line of each key of the page, without keys that have no skill."""
    ready = {name: skill for name, skill in skills.items() if skill.trained}
    moves = {key: _move(ready, measures, sign) for key, (sign, measures) in _MOVES.items()}
    ends = {key: _line(skill) for key, role in _ENDS.items() for skill in ready.values() if skill.role == role}
    return {key: line for key, line in {**moves, **ends}.items() if line}


def in_words(lines: Mapping[str, str], skills: Mapping[str, Skill]) -> dict[str, str]:
    """Return what each key does, such as "forward 40 cm". lines: of `keys`."""
    return {key: f"{_WORDS[key]} {_distance(parse(line, skills).call) if key in _MOVES else ''}".strip()
            for key, line in lines.items()}  # fmt: skip


def _distance(call: Call) -> str:
    """Return the one parameter of a call that is not 0, with its unit."""
    (key, value), *_ = [(key, value) for key, value in call.params.items() if value] or [("", 0)]
    return f"{abs(value)}{'°' if key.endswith('_deg') else ' cm'}"


def _move(skills: Mapping[str, Skill], measures: Sequence[str], sign: int) -> str:
    skill = suited(skills.values(), *measures)
    if skill is None:
        return ""
    return _line(skill, next(part.key for part in skill.parameters if part.measure == measures[0]), sign)


def _line(skill: Skill, moved: str = "", sign: int = 1) -> str:
    """Write a call: half the bound of `moved`, 0 for the rest, or the middle of bounds that exclude 0."""
    parts: Mapping[str, Mapping[str, Any]] = skill.schema.get("properties", {})
    return " ".join([skill.name, *(str(_amount(part, sign if key == moved else 0)) for key, part in parts.items())])


def _amount(part: Mapping[str, Any], sign: int) -> int:
    low, high = part.get("minimum", 0), part.get("maximum", 0)
    if sign:
        return int(high / 2) if sign > 0 else int(low / 2)
    return 0 if low <= 0 <= high else int((low + high) / 2)
