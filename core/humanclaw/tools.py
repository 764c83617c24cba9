"""Skills as the tools of a language model: how they are published, and how a call is read back.

Every published tool is the skill's own schema behind the reasoning fields. These come first, so that one tool call
carries perception, high-, mid- and low-level reasoning in that order (paper, section 3.2). Bounds that a model ignored
are not mended here: Skill.check refuses them, and the refusal goes back to the model.
"""

from __future__ import annotations

import base64
import json
import logging
import math
import re
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final, Literal, get_args

from humanclaw._decisions import DEEPEST, LARGEST
from humanclaw._pairs import once
from humanclaw._pictures import jpeg
from humanclaw._words import LONGEST
from humanclaw.contract import Skill
from humanclaw.contract import bounds as bounds
from humanclaw.errors import CallError, PluginError
from humanclaw.records import Call

if TYPE_CHECKING:
    from humanclaw.embodiment import Body

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
"""What a model must say before a skill's parameters; the fields of Reasoning."""
THOUGHTS: Final = "thoughts"
"""The reasoning fields as one text, a line each that begins with the field's name: with many tools it is much shorter
to ask for."""
_MID_LEVEL: Final = ("mid_level_change", "mid_level_goal")
_FIELD: Final = re.compile(rf"[\W\d]*({'|'.join(REASONING_FIELDS)})\W*?:\W*(.*)", re.IGNORECASE)
_MAX_DEPTH: Final = 12
_ANTHROPIC_KEY: Final = re.compile(r"[a-zA-Z0-9_.-]{1,64}")
_LOG: Final = logging.getLogger(__name__)
_TRIES: Final = 200
"""Opening braces of a text that turn out to open no object; each costs as much time as what follows it."""
_BARE: Final = re.compile(r"\s*(?:```\w*)?\s*(\{.*\})\s*(?:```)?\s*", re.DOTALL)
"""A text that begins and ends as a JSON object, perhaps in a fence."""
_ABOUT: Final = frozenset({"title", "description", "default", "type"})
"""Words of which the nearer one goes before that of a referenced schema."""
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


@dataclass(frozen=True)
class Reasoning:
    """What a model said around a call. The fields are those of Decision; what was not said is empty."""

    visible_state: str = ""
    progress: str = ""
    mid_level_change: str = ""
    mid_level_goal: str = ""
    reasoning: str = ""


# -- publishing --------------------------------------------------------------------------------------------------------
def reasoning_schema(mid_level: bool = True, described: bool = True) -> Json:
    """Return the reasoning fields in order. mid_level=False leaves out the mid-level goal (an ablation of the paper).

    described=False leaves out what the fields are for: a prompt that says it once need not say it with every tool
    again.
    """
    kept = {key: part for key, part in REASONING_FIELDS.items() if mid_level or key not in _MID_LEVEL}
    return {key: {w: v for w, v in part.items() if described or w != "description"} for key, part in kept.items()}


def tool_spec(
    skill: Skill, mid_level: bool = True, reasoning: bool = True, described: bool = True, brief: bool = False
) -> Json:
    """Describe a skill as name, description and parameters: a JSON schema without $ref, anyOf, oneOf and allOf.

    brief: ask for the reasoning as one text, THOUGHTS. Raises PluginError if a parameter has the name of a reasoning
    field or several types.
    """
    properties = parameter_schema(skill)
    clash = sorted(set(properties) & {*REASONING_FIELDS, THOUGHTS})
    if clash:
        raise PluginError(
            f"skill {skill.name!r} has a parameter {clash[0]!r}, the name of a reasoning field.", "Rename it."
        )
    fields = {THOUGHTS: {"type": "string"}} if brief else reasoning_schema(mid_level, described)
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
) -> list[Json]:
    """Write the tool list as a provider's interface takes it. Raises ValueError for an unknown format.

    A skill that cannot be told in this format is left out, and the log says why; the others are there.
    """
    if format not in get_args(Format):
        raise ValueError(f"format must be one of {', '.join(get_args(Format))}; got {format!r}")
    told = _tellable(skills, format)
    return in_format([tool_spec(skill, mid_level, reasoning, described, brief) for skill in told], format)


def unpublishable(skill: Skill, format: Format) -> PluginError | None:  # noqa: A002
    """Return why a skill cannot be a tool of this format; None if it can."""
    try:
        tool_spec(skill)
        _check_names(skill, format)
        _check_shapes(parameter_schema(skill), skill, format)
    except PluginError as error:
        return error
    return None


def _tellable(skills: Iterable[Skill], form: Format) -> list[Skill]:
    pool = [(skill, unpublishable(skill, form)) for skill in skills]
    for skill, why in pool:
        if why:
            _LOG.warning("skill %r is not among the %s tools: %s", skill.name, form, why)
    return [skill for skill, why in pool if not why]


def _check_names(skill: Skill, form: Format) -> None:
    """Names that a provider answers with an error to the whole request."""
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
) -> list[Json]:
    """Write the tool list of OpenAI's chat completions, which most other servers and clients take too."""
    return publish(skills, "openai", mid_level, reasoning, described, brief)


def in_format(specs: Sequence[Json], form: Format) -> list[Json]:
    """Write specifications (name, description, parameters) as a provider's interface takes a list of tools."""
    if form == "openai":
        return [{"type": "function", "function": spec} for spec in specs]
    if form == "gemini":
        return [{"functionDeclarations": [_gemini_declaration(spec) for spec in specs]}]
    key = "input_schema" if form == "anthropic" else "inputSchema"
    return [{"name": spec["name"], "description": spec["description"], key: spec["parameters"]} for spec in specs]


def answer_schema(skills: Iterable[Skill], mid_level: bool = True, described: bool = True) -> Json:
    """Return one object that holds the reasoning fields, the skill's name and its parameters: for models without tool
    calling.

    The parameters of all skills share one object, with the widest bounds of each name, because providers drop
    alternatives.
    """
    pool = list(skills)
    said = reasoning_schema(mid_level, described)
    properties = {**said, **call_schema(pool)}
    return {"type": "object", "properties": properties, "required": list(properties), "additionalProperties": False}


def call_schema(skills: Sequence[Skill]) -> Json:
    """Return the properties `skill` and `parameters` of an answer that names a call."""
    merged: Json = {}
    told = _tellable(skills, "mcp")
    for skill in told:
        for key, part in parameter_schema(skill).items():
            merged[key] = _widen(merged[key], part) if key in merged else part
    shared = {"type": "object", "properties": merged, "additionalProperties": False}
    return {"skill": {"type": "string", "enum": [skill.name for skill in told]}, "parameters": shared}


def parameter_schema(skill: Skill) -> Json:
    """Return the skill's own parameters, rewritten in the words that every provider keeps.

    Raises PluginError where that fails.
    """
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
    # Names that begin with x- are for us, and providers refuse words that they do not know.
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
    """Exclusive bounds of integers as inclusive ones, which constrained decoders know."""
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
    """Return the subset of JSON schema that Gemini documents; an enum of anything but strings is told in the
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


# -- reading -----------------------------------------------------------------------------------------------------------
def read_call(name: str, arguments: str | Mapping[str, Any]) -> tuple[Reasoning, Call]:
    """Split the arguments of a tool call into reasoning and call. Nothing is converted: "40" stays a string.

    Raises CallError, written for the model, if the arguments are not a JSON object, flat, of plain numbers, each key
    once.
    """
    values = _parse(arguments, name) if isinstance(arguments, str) else dict(arguments)
    if fault := _fault(values):
        raise CallError(f"{name} was not executed: {fault}.")
    thoughts = _thoughts(_text(values.pop(THOUGHTS, "")))
    said = thoughts | {key: _text(values.pop(key)) for key in REASONING_FIELDS if key in values}
    change = said.get("mid_level_change", "").strip().lower()
    said["mid_level_change"] = change if change in REASONING_FIELDS["mid_level_change"]["enum"] else ""
    return Reasoning(**said), Call(name, values)


def read_answer(answer: Mapping[str, Any]) -> tuple[Reasoning, Call]:
    """Read an object with `skill` and `parameters`, the form of answer_schema. Raises CallError, written for the model.

    `name` and `arguments` are read too, as some models write them. Parameters that are null were not given.
    """
    rest = dict(answer)
    name = _pop_first(rest, "skill", "name")
    if not isinstance(name, str):
        raise CallError(f"Nothing was executed: 'skill' must be the name of a skill; got {name!r}.")
    inner = _pop_first(rest, "parameters", "arguments") or {}
    given = _parse(inner, name) if isinstance(inner, str) else inner
    if not isinstance(given, Mapping):
        raise CallError(f"{name} was not executed: 'parameters' must be an object; got {given!r}.")
    if twice := [key for key in given if key in rest and key not in REASONING_FIELDS and given[key] != rest[key]]:
        raise CallError(f"{name} was not executed: {twice[0][:64]!r} is given twice; give it once.")
    return read_call(name, {key: value for key, value in {**rest, **given}.items() if value is not None})


def read_text(text: str, prose: bool = True) -> list[tuple[Reasoning, Call]]:
    """Read every call in a text: JSON objects that name a skill, with anything around them.

    prose=False: with nothing around them but thoughts and a fence; who was given tools and talks may only be thinking
    of a call. Raises CallError, written for the model, if there is none, and if a key is there twice or the text is too
    long.
    """
    if len(text) > LONGEST:
        raise CallError(f"Nothing was executed: the answer is longer than {LONGEST} letters; be brief.")
    if not prose and not _is_bare(_spoken(text)):
        raise CallError("Nothing was executed: a call among other words is no call; call a tool.")
    items = _objects(text, _once)
    found = [read_answer(item) for item in items if isinstance(item.get("skill", item.get("name")), str)]
    if not found:
        raise CallError('Nothing was executed: the answer held no complete JSON object with "skill" and "parameters".')
    return [item for index, item in enumerate(found) if item not in found[:index]]


def json_objects(text: str, once: bool = False) -> Iterator[Json]:
    """Find the complete outermost JSON objects in a text. Thoughts between <think> tags are skipped, fences ignored.

    It takes time in proportion to the text: what follows its first 100,000 letters, or 200 braces that open nothing, is
    not read. once: raise CallError if a key is there twice.
    """
    return _objects(text[:LONGEST], _once if once else dict)


def _spoken(text: str) -> str:
    return re.sub(r"<think>.*?(</think>|$)", "", text, flags=re.DOTALL)


def _is_bare(text: str) -> bool:
    """Whether a text is one JSON object and nothing else, perhaps in a fence."""
    found = _BARE.fullmatch(text)
    if found is None:
        return False
    try:
        return json.JSONDecoder().raw_decode(found[1])[1] == len(found[1])
    except (ValueError, RecursionError):
        return False


def _objects(text: str, make: Callable[[list[tuple[str, Any]]], Json]) -> Iterator[Json]:
    text = _spoken(text)
    decoder, place, failed = json.JSONDecoder(object_pairs_hook=make), text.find("{"), 0
    while place >= 0 and failed < _TRIES:
        try:
            value, place = decoder.raw_decode(text, place)
            yield value
        except (ValueError, RecursionError):
            place, failed = place + 1, failed + 1
        place = text.find("{", place)


def _once(pairs: list[tuple[str, Any]]) -> Json:
    """Return an object, each of whose keys is there once: of two values nobody knows which was meant."""
    try:
        return once(pairs)
    except KeyError as error:
        twice = str(error.args[0])[:64]
        raise CallError(f"Nothing was executed: the key {twice!r} is there twice; give it once.") from None


def _parse(arguments: str, name: str) -> Json:
    if len(arguments) > LONGEST:
        raise CallError(f"{name} was not executed: its arguments are longer than {LONGEST} letters; be brief.")
    try:
        values = json.loads(arguments or "{}", object_pairs_hook=_once)
    except (ValueError, RecursionError) as error:
        raise CallError(
            f"{name} was not executed: its arguments are not valid JSON ({error}); was the answer cut off?"
        ) from error
    if not isinstance(values, dict):
        raise CallError(f"{name} was not executed: its arguments must be a JSON object; got {type(values).__name__}.")
    return values


def _fault(values: Json) -> str:
    """Why nothing can be called with these values; empty if it can. It looks at a level at a time: recursion has an
    end."""
    level: list[Any] = list(values.values())
    for _ in range(DEEPEST):
        if any(isinstance(value, float) and not math.isfinite(value) for value in level):
            return "NaN and Infinity are not numbers; give plain numbers"
        if any(isinstance(value, int) and abs(value) > LARGEST for value in level):
            return f"an integer lies beyond {LARGEST}; give plain numbers"
        level = [inner for value in level for inner in _inside(value)]
    return f"its arguments are nested more than {DEEPEST} levels deep; give flat parameters" if level else ""


def _inside(value: Any) -> Iterable[Any]:
    if isinstance(value, Mapping):
        return value.values()
    return value if isinstance(value, list | tuple) else ()


def _thoughts(text: str) -> dict[str, str]:
    """Read the reasoning fields of a text that holds one a line; what stands under no name is reasoning."""
    found: dict[str, str] = {}
    field = "reasoning"
    for line in filter(None, map(str.strip, text.split("\n"))):
        named = _FIELD.match(line)
        field, words = (named[1].lower(), named[2]) if named else (field, line)
        found[field] = f"{found.get(field, '')} {words}".strip()
    return found


def _text(value: Any) -> str:
    return value if isinstance(value, str) else json.dumps(value, ensure_ascii=False)


def _pop_first(values: Json, *keys: str) -> Any:
    """Take the first key that is there; the others stay."""
    return next((values.pop(key) for key in keys if key in values), None)


# -- a body's tools ----------------------------------------------------------------------------------------------------
LOOK: Final = "look"
_LOOK: Final[Json] = {
    "name": LOOK,
    "description": "See what the body sees, without moving.",
    "parameters": {"type": "object", "properties": {}, "required": [], "additionalProperties": False},
}


@dataclass(frozen=True)
class ToolResult:
    """What became of a call: words, and what the eyes see now."""

    text: str
    picture: bytes = b""
    """A JPEG of 512 x 512; empty if the call was refused, since nothing has moved."""

    @property
    def base64(self) -> str:
        """The picture in base64; empty if there is none."""
        return base64.b64encode(self.picture).decode()

    @property
    def data_url(self) -> str:
        """The picture as a data URL; empty if there is none."""
        return f"data:image/jpeg;base64,{self.base64}" if self.picture else ""


@dataclass(frozen=True)
class BodyTool:
    """A tool of one body, for an agent framework to wrap in its own objects (hook humanclaw_frameworks).

    Calling it is safe from any thread, and raises nothing for what a model can mend: a refusal is a result in words.
    """

    name: str
    description: str
    parameters: Json
    """JSON Schema of an object, without $ref, anyOf, oneOf and allOf."""
    run: Callable[[str | Mapping[str, Any]], ToolResult]
    """Arguments, an object or the JSON text of one, to the result."""

    @property
    def spec(self) -> Json:
        """Name, description and parameters, as in_format takes them."""
        return {"name": self.name, "description": self.description, "parameters": self.parameters}

    def __call__(self, **arguments: Any) -> ToolResult:
        """Call the tool with its parameters by name."""
        return self.run(arguments)


def body_tools(body: Body) -> tuple[BodyTool, ...]:
    """Make a tool of every skill of a body that can run, and `look`. Calls take their turn: a body does one thing at a
    time."""
    turn = threading.Lock()
    ready = _tellable((skill for skill in body.skills.values() if skill.trained), "openai")
    specs = [tool_spec(skill, reasoning=False) for skill in ready]

    def runner(name: str) -> Callable[[str | Mapping[str, Any]], ToolResult]:
        def run(arguments: str | Mapping[str, Any]) -> ToolResult:
            with turn:
                return _run(body, name, arguments)

        return run

    return tuple(BodyTool(**spec, run=runner(spec["name"])) for spec in (*specs, _LOOK))


def _run(body: Body, name: str, arguments: str | Mapping[str, Any]) -> ToolResult:
    try:
        _, call = read_call(name, arguments)
        seen = body.observe() if name == LOOK else body.call(name, **call.params)
    except CallError as error:
        return ToolResult(str(error))
    words = str(seen.feedback) if name != LOOK else ""
    return ToolResult(f"{words} The picture is what you see now.".strip(), jpeg(seen.rgb))
