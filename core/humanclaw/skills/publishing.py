"""Skills as the tools of a language model.

Every published tool is the skill's own schema behind the reasoning fields. These come first, so that one tool call
carries perception, high-, mid- and low-level reasoning in that order (paper, section 3.2).
"""

from __future__ import annotations

import logging
import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final, Literal, get_args

from humanclaw.errors import PluginError
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
_MAX_DEPTH: Final = 12
_ANTHROPIC_KEY: Final = re.compile(r"[a-zA-Z0-9_.-]{1,64}")
_LOG: Final = logging.getLogger(__name__)
_ABOUT: Final = frozenset({"title", "description", "default", "type"})
"""Keywords for which the referring schema overrides the referenced one."""
_GEMINI_WORDS: Final = frozenset(
    [
        "type",
        "description",
        "enum",
        "format",
        "items",
        "properties",
        "required",
        "minimum",
        "maximum",
        "minItems",
        "maxItems",
        "minLength",
        "maxLength",
        "pattern",
    ]
)


# -- publishing --------------------------------------------------------------------------------------------------------
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

    brief: ask for the reasoning as one text, THOUGHTS. Raises PluginError if a parameter has the name of a reasoning
    field or several types.
    """
    properties = parameter_schema(skill)
    clash = sorted(set(properties) & {*REASONING_FIELDS, *OPTIONAL_FIELDS, THOUGHTS})
    if clash:
        raise PluginError(
            f"skill {skill.name!r} has a parameter {clash[0]!r}, the name of a reasoning field.", "Rename it."
        )
    fields = {THOUGHTS: {"type": "string"}} if brief else reasoning_schema(mid_level, described, optional)
    said = fields if reasoning else {}
    parameters: Json = {
        "type": "object",
        "properties": {**said, **properties},
        "required": [*said, *skill.schema.get("required", ())],
        "additionalProperties": False,
    }
    return {"name": skill.name, "description": skill.description, "parameters": parameters}


def publish(
    skills: Iterable[Skill],
    format: Format,  # noqa: A002
    mid_level: bool = True,
    reasoning: bool = True,
    described: bool = True,
    brief: bool = False,
    optional: Sequence[str] = (),
) -> list[Json]:
    """Return the tool list in a provider's format. Raises ValueError for an unknown format.

    A skill that does not fit the format is left out; the log says why.
    """
    if format not in get_args(Format):
        raise ValueError(f"format must be one of {', '.join(get_args(Format))}; got {format!r}")
    told = tellable(skills, format)
    specs = [tool_spec(skill, mid_level, reasoning, described, brief, optional) for skill in told]
    return in_format(specs, format)


def unpublishable(skill: Skill, format: Format) -> PluginError | None:  # noqa: A002
    """Return why a skill cannot be a tool of this format; None if it can."""
    try:
        tool_spec(skill)
        _check_names(skill, format)
        _check_shapes(parameter_schema(skill), skill, format)
    except PluginError as error:
        return error
    return None


def tellable(skills: Iterable[Skill], form: Format) -> list[Skill]:
    pool = [(skill, unpublishable(skill, form)) for skill in skills]
    for skill, why in pool:
        if why:
            _LOG.warning("skill %r is not among the %s tools: %s", skill.name, form, why)
    return [skill for skill, why in pool if not why]


def _check_names(skill: Skill, form: Format) -> None:
    """Raise PluginError for names that make a provider refuse the whole request."""
    if form == "gemini" and not skill.name[:1].isalpha() and skill.name[:1] != "_":
        raise PluginError(f"the name of skill {skill.name!r} begins with no letter, as Gemini's do.", "Rename it.")
    for key in parameter_schema(skill):
        if form == "anthropic" and not _ANTHROPIC_KEY.fullmatch(key):
            refused = f"Anthropic refuses the name of parameter {key!r} of skill {skill.name!r}."
            raise PluginError(refused, f"Use a name that matches {_ANTHROPIC_KEY.pattern}.")


def _check_shapes(properties: Mapping[str, Any], skill: Skill, form: Format) -> None:
    """Refuse an array without items for OpenAI and Gemini, an object without properties for Gemini."""
    for key, part in properties.items():
        where = f"parameter {key!r} of skill {skill.name!r}"
        if part.get("type") == "array" and "items" not in part and form in ("openai", "gemini"):
            raise PluginError(f"{where} is an array of nobody knows what.", "Give it items.")
        if part.get("type") == "object" and not part.get("properties") and form == "gemini":
            raise PluginError(f"{where} is an object without properties.", "Declare them.")
        _check_shapes(part.get("properties", {}), skill, form)
        if isinstance(part.get("items"), Mapping):
            _check_shapes({key: part["items"]}, skill, form)


def openai_tools(
    skills: Iterable[Skill],
    reasoning: bool = True,
    mid_level: bool = True,
    described: bool = True,
    brief: bool = False,
    optional: Sequence[str] = (),
) -> list[Json]:
    """Return the tool list for OpenAI's chat completions, which most servers and clients accept."""
    return publish(skills, "openai", mid_level, reasoning, described, brief, optional)


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
    told = tellable(skills, "mcp")
    for skill in told:
        for key, part in parameter_schema(skill).items():
            merged[key] = _widen(merged[key], part) if key in merged else part
    shared = {"type": "object", "properties": merged, "additionalProperties": False}
    return {"skill": {"type": "string", "enum": [skill.name for skill in told]}, "parameters": shared}


def parameter_schema(skill: Skill) -> Json:
    """Return the skill's parameters in keywords that every provider supports. Raises PluginError if that fails."""
    defs = skill.schema.get("$defs", {})
    properties = skill.schema.get("properties", {})
    return {key: _plain(part, defs, f"parameter {key!r} of skill {skill.name!r}") for key, part in properties.items()}


def _plain(part: Mapping[str, Any], defs: Mapping[str, Any], where: str, depth: int = 0) -> Json:
    """Return a schema with references resolved, null alternatives dropped and single alternatives merged."""
    if not isinstance(part, Mapping):
        raise PluginError(f"{where} is {part!r} somewhere, not a type.", "Give it a type.")
    if depth > _MAX_DEPTH:
        raise PluginError(f"{where} is nested too deeply or refers to itself.", "Give it a flat type.")
    flat = _one_type(_merge_alternatives(dict(part), defs, where), where)
    # Keywords that begin with x- are ours; providers refuse unknown keywords.
    flat = {word: value for word, value in flat.items() if word != "title" and not word.startswith("x-")}
    if "const" in flat:
        flat["enum"] = [flat.pop("const")]
    if "properties" in flat:
        flat["properties"] = {key: _plain(one, defs, where, depth + 1) for key, one in flat["properties"].items()}
    if isinstance(flat.get("items"), Mapping):
        flat["items"] = _plain(flat["items"], defs, where, depth + 1)
    return _inclusive(flat)


def _merge_alternatives(part: Json, defs: Mapping[str, Any], where: str) -> Json:
    for _ in range(_MAX_DEPTH):
        word = next((word for word in ("$ref", "anyOf", "oneOf", "allOf") if word in part), None)
        if word is None:
            return part
        inner = part.pop(word)
        options = (
            [defs.get(inner.rsplit("/", 1)[-1])] if word == "$ref" else [o for o in inner if o.get("type") != "null"]
        )
        if options == [None]:
            raise PluginError(f"{where} refers to {inner!r}, which is not among its $defs.", "Mend the reference.")
        if len(options) != 1 or not isinstance(options[0], Mapping):
            raise PluginError(f"{where} has several types, which not every provider keeps.", "Give it one type.")
        if twice := sorted(set(options[0]) & set(part) - _ABOUT):
            raise PluginError(f"{where} has {twice[0]!r} both of its own and by reference.", "Give it one.")
        part = {**options[0], **part}
    raise PluginError(f"{where} refers to itself.", "Give it a flat type.")


def _one_type(part: Json, where: str) -> Json:
    if isinstance(part.get("type"), list):
        kinds = [kind for kind in part["type"] if kind != "null"]
        if len(kinds) != 1:
            raise PluginError(f"{where} has several types, which not every provider keeps.", "Give it one type.")
        part["type"] = kinds[0]
    if part.get("default", 0) is None:
        del part["default"]
    return part


def _inclusive(part: Json) -> Json:
    """Turn exclusive bounds of integers into inclusive ones, which constrained decoders support."""
    if part.get("type") == "integer":
        for word, bound, step, pick in (
            ("exclusiveMinimum", "minimum", 1, max),
            ("exclusiveMaximum", "maximum", -1, min),
        ):
            if word in part:
                limit = int(part.pop(word)) + step
                part[bound] = pick(limit, part.get(bound, limit))
    return part


def _widen(one: Json, other: Json) -> Json:
    """Return a schema that allows what either allows, as far as type, bounds and enum go."""
    if one.get("type") != other.get("type"):
        return {}
    wide = {"type": one["type"]} if "type" in one else {}
    for word, pick in (("minimum", min), ("maximum", max)):
        if word in one and word in other:
            wide[word] = pick(one[word], other[word])
    if "enum" in one and "enum" in other:
        wide["enum"] = list(dict.fromkeys([*one["enum"], *other["enum"]]))
    for word in ("items", "properties"):
        if one.get(word) == other.get(word) and word in one:
            wide[word] = one[word]
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
