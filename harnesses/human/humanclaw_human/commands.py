"""The calls that the page offers, by key and by form, and those that it sends."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from pydantic import BaseModel, ValidationError

from humanclaw import Call, CallError, Decision, Skill
from humanclaw.records import first_fault
from humanclaw.skills import Role, check_call, suited

_KEYS: Final[Mapping[str, tuple[str, Role, int, tuple[str, ...]]]] = {
    "ArrowUp": ("forward", "locomotion", 1, ("hips.forward", "hips.left", "heading.left")),
    "ArrowDown": ("back", "locomotion", 1, ("hips.back",)),
    "ArrowLeft": ("turn left", "locomotion", 1, ("heading.left",)),
    "ArrowRight": ("turn right", "locomotion", -1, ("heading.left",)),
    "Shift+ArrowLeft": ("step left", "locomotion", 1, ("hips.left",)),
    "Shift+ArrowRight": ("step right", "locomotion", -1, ("hips.left",)),
    "s": ("sit down", "sit", 0, ()),
    "End": ("stop", "stop", 0, ()),
}
"""Key to its words, and role, sign and measures of its skill. A key commands half the bound of the first measure."""


@dataclass(frozen=True)
class Key:
    """The call of a key. words: what it does, such as "forward 40 cm"."""

    words: str
    skill: str
    params: Mapping[str, int]


class Pressed(BaseModel):
    """A call as the page sends it. seen: what the person reports in view."""

    skill: str
    params: dict[str, Any]
    seen: str = ""


def read(sent: bytes, skills: Mapping[str, Skill]) -> Decision:
    """Return the decision that the page sent as JSON. Raises CallError that says what was expected."""
    try:
        pressed = Pressed.model_validate_json(sent)
    except ValidationError as error:
        raise CallError(f"A call has skill, params and seen: {first_fault(error)}.") from None
    call = check_call(Call(pressed.skill, pressed.params), skills)
    return Decision((call,), pressed.seen.strip(), raw=sent.decode())


def forms(skills: Mapping[str, Skill]) -> tuple[dict[str, Any], ...]:
    """Return each skill as a form: its description, and each parameter as a model gets it, with an initial value."""
    return tuple(_form(skill) for skill in skills.values() if skill.trained)


def _form(skill: Skill) -> dict[str, Any]:
    parts: Mapping[str, Mapping[str, Any]] = skill.schema.get("properties", {})
    parameters = [
        {key: part[key] for key in ("type", "description", "minimum", "maximum") if key in part}
        | {"name": name, "value": part.get("default", _amount(part, 0) if "minimum" in part else "")}
        for name, part in parts.items()
    ]
    return {"name": skill.name, "description": skill.description, "parameters": parameters}


def keys(skills: Mapping[str, Skill]) -> dict[str, Key]:
    """Return the call of each key of the page, without keys that have no skill."""
    ready = [skill for skill in skills.values() if skill.trained]
    return {name: key for name, move in _KEYS.items() if (key := _key(ready, *move))}


def _key(skills: Sequence[Skill], words: str, role: Role, sign: int, measures: Sequence[str]) -> Key | None:
    skill = suited(skills, *measures, role=role)
    if skill is None:
        return None
    moved = next((part.key for part in skill.parameters if part.measure in measures[:1]), "")
    parts: Mapping[str, Mapping[str, Any]] = skill.schema.get("properties", {})
    # 0 for the rest, or the middle of bounds that exclude 0.
    params = {key: _amount(part, sign if key == moved else 0) for key, part in parts.items()}
    if moved:
        words = f"{words} {abs(params[moved])}{'°' if moved.endswith('_deg') else ' cm'}"
    return Key(words, skill.name, params)


def _amount(part: Mapping[str, Any], sign: int) -> int:
    low, high = part.get("minimum", 0), part.get("maximum", 0)
    if sign:
        return int(high / 2) if sign > 0 else int(low / 2)
    return 0 if low <= 0 <= high else int((low + high) / 2)
