"""Skills as the tools of a language model.

Every published tool is the skill's own schema behind the reasoning fields. These come first, so that one tool call
carries perception, high-, mid- and low-level reasoning in that order (paper, section 3.2).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final, Literal, get_args

from humanclaw.skills.contract import Skill

Format = Literal["openai", "anthropic", "gemini", "mcp"]
Json = dict[str, Any]

REASONING_FIELDS: Final[Mapping[str, Json]] = {
    "visible_state": {
        "type": "string",
        "description": "Objects in view from left to right, each with its distance in metres; whether the target is "
        "among them; obstacles, open space, stairs or seats close by.",
    },
    "progress": {
        "type": "string",
        "description": "What the last action changed; whether to search, approach, align or complete.",
    },
    "mid_level_change": {
        "type": "string",
        "enum": ["keep", "revise"],
        "description": "Keep the previous mid-level goal or revise it.",
    },
    "mid_level_goal": {"type": "string", "description": "The objective of the next few seconds."},
    "reasoning": {"type": "string", "description": "Why this skill with these parameters serves that objective now."},
}
"""Fields that a model fills before a skill's parameters."""
OPTIONAL_FIELDS: Final[Mapping[str, Json]] = {
    "expected_success": {
        "type": "integer",
        "minimum": 0,
        "maximum": 100,
        "description": "How likely the goal would count as reached if you ended the episode now, per cent.",
    },
    "note_to_self": {
        "type": "string",
        "description": "All that is worth keeping beyond the last steps. It replaces the note before it; empty keeps "
        "that one.",
    },
}
"""Fields that are asked for by name alone, after the others (paper, section 6: calibrated termination, memory)."""
THOUGHTS: Final = "thoughts"
"""One text field instead of the reasoning fields, one line each, with the field's name first. With many tools it makes
prompts much shorter."""
_MID_LEVEL: Final = ("mid_level_change", "mid_level_goal")
_GEMINI_WORDS: Final = frozenset({
    "type", "description", "enum", "format", "items", "properties", "required", "minimum", "maximum", "minItems",
    "maxItems", "minLength", "maxLength", "pattern",
})  # fmt: skip


# -- tool lists --------------------------------------------------------------------------------------------------------
def reasoning_schema(mid_level: bool = True, described: bool = True, optional: Sequence[str] = ()) -> Json:
    """Return the reasoning fields in order. mid_level=False leaves out the mid-level goal (an ablation of the paper).

    described=False leaves out the descriptions of the fields, for prompts that give them once. optional: names of
    OPTIONAL_FIELDS to add.
    """
    kept = {key: part for key, part in REASONING_FIELDS.items() if mid_level or key not in _MID_LEVEL}
    kept |= {key: part for key, part in OPTIONAL_FIELDS.items() if key in optional}
    return {key: {w: v for w, v in part.items() if described or w != "description"} for key, part in kept.items()}


def tool_spec(
    skill: Skill, mid_level: bool = True, reasoning: bool = True, described: bool = True, brief: bool = False,
    optional: Sequence[str] = (),
) -> Json:  # fmt: skip
    """Describe a skill as name, description and parameters: a JSON schema without $ref, anyOf, oneOf and allOf.

    brief: ask for the reasoning as one text, THOUGHTS.
    """
    fields = {THOUGHTS: {"type": "string"}} if brief else reasoning_schema(mid_level, described, optional)
    said = fields if reasoning else {}
    parameters: Json = {
        "type": "object",
        "properties": {**said, **parameter_schema(skill)},
        "required": [*said, *skill.schema.get("required", ())],
        "additionalProperties": False,
    }
    return {"name": skill.name, "description": skill.description, "parameters": parameters}


def tool_list(
    skills: Iterable[Skill],
    format: Format,  # noqa: A002
    mid_level: bool = True,
    reasoning: bool = True,
    described: bool = True,
    brief: bool = False,
    optional: Sequence[str] = (),
) -> list[Json]:
    """Return the tool list in a provider's format. Raises ValueError for an unknown format."""
    if format not in get_args(Format):
        raise ValueError(f"format must be one of {', '.join(get_args(Format))}; got {format!r}")
    specs = [tool_spec(skill, mid_level, reasoning, described, brief, optional) for skill in skills]
    return in_format(specs, format)


def in_format(specs: Sequence[Json], form: Format) -> list[Json]:
    """Return specifications (name, description, parameters) as a provider's list of tools."""
    if form == "openai":
        return [{"type": "function", "function": spec} for spec in specs]
    if form == "gemini":
        return [{"functionDeclarations": [_gemini_declaration(spec) for spec in specs]}]
    key = "input_schema" if form == "anthropic" else "inputSchema"
    return [{"name": spec["name"], "description": spec["description"], key: spec["parameters"]} for spec in specs]


def answer_schema(
    skills: Iterable[Skill], mid_level: bool = True, described: bool = True, optional: Sequence[str] = ()
) -> Json:
    """Return one object that holds the reasoning fields, the skill's name and its parameters: for models without tool
    calling.

    The parameters of all skills share one object, with the widest bounds of each name, because providers drop
    alternatives.
    """
    pool = list(skills)
    said = reasoning_schema(mid_level, described, optional)
    properties = {**said, **call_schema(pool)}
    return {"type": "object", "properties": properties, "required": list(properties), "additionalProperties": False}


def call_schema(skills: Sequence[Skill]) -> Json:
    """Return the properties `skill` and `parameters` of an answer that names a call."""
    merged: Json = {}
    for skill in skills:
        for key, part in parameter_schema(skill).items():
            merged[key] = _widen(merged[key], part) if key in merged else part
    shared = {"type": "object", "properties": merged, "additionalProperties": False}
    return {"skill": {"type": "string", "enum": [skill.name for skill in skills]}, "parameters": shared}


def parameter_schema(skill: Skill) -> Json:
    """Return the skill's parameters in keywords that every provider supports."""
    # Keywords that begin with x- are ours; providers refuse unknown keywords.
    return {
        key: {word: value for word, value in part.items() if word != "title" and not word.startswith("x-")}
        for key, part in skill.schema.get("properties", {}).items()
    }


def _widen(part: Json, other: Json) -> Json:
    """Return a schema that allows what either allows, as far as type, bounds and enum go."""
    if part.get("type") != other.get("type"):
        return {}
    wide = {"type": part["type"]} if "type" in part else {}
    for word, pick in (("minimum", min), ("maximum", max)):
        if word in part and word in other:
            wide[word] = pick(part[word], other[word])
    if "enum" in part and "enum" in other:
        wide["enum"] = list(dict.fromkeys([*part["enum"], *other["enum"]]))
    if part.get("items") == other.get("items") and "items" in part:
        wide["items"] = part["items"]
    return wide


def _gemini_declaration(spec: Json) -> Json:
    """Gemini refuses an object without properties, and may change their order if none is named."""
    named = list(spec["parameters"]["properties"])
    plain = {key: value for key, value in spec.items() if key != "parameters"}
    return {**plain, "parameters": {**_for_gemini(spec["parameters"]), "propertyOrdering": named}} if named else plain


def _for_gemini(part: Mapping[str, Any]) -> Json:
    """Return the subset of JSON schema that Gemini documents; an enum of anything but strings goes into the
    description."""
    kept = {key: value for key, value in part.items() if key in _GEMINI_WORDS}
    if not all(isinstance(value, str) for value in kept.get("enum", ())):
        choices = ", ".join(map(str, kept.pop("enum")))
        kept["description"] = f"{kept.get('description', '')} One of {choices}.".strip()
    if "properties" in kept:
        kept["properties"] = {key: _for_gemini(value) for key, value in kept["properties"].items()}
    if "items" in kept:
        kept["items"] = _for_gemini(kept["items"])
    return kept
