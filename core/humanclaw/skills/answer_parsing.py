"""Read a model's answer: its reasoning and its calls.

The rule for a text, in this order:
1. Thoughts are told apart, once (split_thoughts). Nothing in a thought is an answer, and nothing behind the turn.
2. Calls alone are read in every dialect (written_calls). Marks of answers around them, such as <answer>, are not words.
3. Before a call with a call's marks may stand words. Before any other, only if the model has no tools: among the words
   of one that has them, an object may be an example.
4. Behind a call no words may stand: they could take it back. Only LFM2's own form has them.
5. What a call holds is its text, and a call in a broken call is none. Refused rather than guessed.

A line break in a JSON string is read, although JSON has none. Values out of bounds pass here: Skill.check refuses them,
and the refusal goes back to the model.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Final

from humanclaw.errors import CallError
from humanclaw.skills.call import Call
from humanclaw.skills.call_dialects import ARGUMENTS, NAME, end_of_text, is_padding, written_calls
from humanclaw.skills.thoughts import split_thoughts
from humanclaw.skills.tool_schemas import OPTIONAL_FIELDS, REASONING_FIELDS, THOUGHTS, Json
from humanclaw.text.json import DEEPEST, LARGEST, once
from humanclaw.text.words import LONGEST

_FIELDS: Final = (*REASONING_FIELDS, *OPTIONAL_FIELDS)
_FIELD: Final = re.compile(rf"[\W\d]*({'|'.join(_FIELDS)})\W*?:\W*(.*)", re.IGNORECASE)
_PER_CENT: Final = re.compile(r"(\d{1,3})\s*(%|per ?cent)?\.?", re.IGNORECASE)
_TOOL: Final = re.compile(rf"{NAME}(?::\d{{1,6}})?\s{{0,9}}(?:<.*)?", re.DOTALL)
_OBJECT: Final = re.compile(rf"(?<!\\boxed)\{{|{ARGUMENTS}")
_TRIES: Final = 200
"""Maximum opening braces that open no object: each costs time in proportion to the text after it."""
_NAMES: Final = ("skill", "name", "function", "tool_name")
"""Keys under which models name the called function."""
_ABOUT_CALLS: Final = frozenset({"type", "id", "index", "tool_call_id"})
"""Keys of a call's envelope, which are no parameters."""


@dataclass(frozen=True)
class Reasoning:
    """Reasoning of a model around a call. The fields are those of Decision; missing ones are empty."""

    visible_state: str = ""
    progress: str = ""
    mid_level_change: str = ""
    mid_level_goal: str = ""
    reasoning: str = ""
    note_to_self: str = ""
    expected_success: float | None = None
    """From 0 to 1; None if it was not told, or not as a whole per cent."""


# -- reading -----------------------------------------------------------------------------------------------------------
def read_call(name: str, arguments: str | Mapping[str, Any]) -> tuple[Reasoning, Call]:
    """Split the arguments of a tool call into reasoning and call. Values are not converted: "40" stays a string.
    Arguments that are null were not given.

    Raises CallError, written for the model, if the arguments are not a JSON object, flat, of plain numbers, each key
    once.
    """
    read = _parse(arguments, name) if isinstance(arguments, str) else arguments
    values = {key: value for key, value in read.items() if value is not None}
    if fault := _fault(values):
        raise CallError(f"{name} was not executed: {fault}.")
    thoughts = _thoughts(_text(values.pop(THOUGHTS, "")))
    said = thoughts | {key: _text(values.pop(key)) for key in _FIELDS if key in values}
    change = said.get("mid_level_change", "").strip().lower()
    said["mid_level_change"] = change if change in REASONING_FIELDS["mid_level_change"]["enum"] else ""
    expected = _share(said.pop("expected_success", ""))
    return Reasoning(**said, expected_success=expected), Call(plain_name(name), values)


def plain_name(tool: str) -> str:
    """Return the name in a tool call without what servers leave on it: functions.walk:0, walk<|channel|>commentary."""
    match = _TOOL.fullmatch(tool)
    return match[1] if match else tool


def read_answer(answer: Mapping[str, Any]) -> tuple[Reasoning, Call]:
    """Read an object with `skill` and `parameters`, the form of answer_schema. Raises CallError, written for the model.

    `name` and `arguments` are read too, and OpenAI's object of type "function", as some models write them.
    """
    rest = dict(answer)
    inputs = ("input",) if rest.get("type") == "tool_use" else ()  # Anthropic's format
    # OpenAI's, as Llama and Mistral write it, and Command's
    if inputs or rest.get("type") == "function" or not {"tool_name", "arguments"}.isdisjoint(rest):
        rest = {key: value for key, value in rest.items() if key not in _ABOUT_CALLS}
    if isinstance(rest.get("function"), Mapping):
        inner = rest.pop("function")
        if twice := sorted(map(str, {*_NAMES, *inner} & rest.keys())):
            raise CallError(f"Nothing was executed: {twice[0][:64]!r} is given beside 'function'; give it once.")
        rest |= inner
    name = _pop_first(rest, *_NAMES)
    if not isinstance(name, str):
        raise CallError(f"Nothing was executed: 'skill' must be the name of a skill; got {name!r}.")
    inner = _pop_first(rest, "parameters", "arguments", *inputs) or {}
    given = _parse(inner, name) if isinstance(inner, str) else inner
    if not isinstance(given, Mapping):
        raise CallError(f"{name} was not executed: 'parameters' must be an object; got {given!r}.")
    if twice := [key for key in given if key in rest and key not in _FIELDS and given[key] != rest[key]]:
        raise CallError(f"{name} was not executed: {twice[0][:64]!r} is given twice; give it once.")
    return read_call(name, {**rest, **given})


def read_text(text: str, prose: bool = True) -> list[tuple[Reasoning, Call]]:
    """Read every call in a model's text, in the order of the text, by the rule above. prose: for a model without tools.

    The number of calls is not judged here: a step takes one, so whoever decides refuses several, equal ones too, as
    with tool calls.

    Raises CallError, written for the model, if there is no call, if a key is there twice, or the text is too long.
    """
    _, answer = split_thoughts(text)
    if len(answer) > LONGEST:
        raise CallError(f"Nothing was executed: the answer is longer than {LONGEST} letters; be brief.")
    calls = _named(written_calls(answer, _once))
    if not calls and not prose:
        raise CallError("Nothing was executed: a call among other words is no call; call a tool.")
    calls = calls or _among_words(answer)
    if not calls:
        raise CallError('Nothing was executed: the answer held no complete JSON object with "skill" and "parameters".')
    return [read_answer(item) for item in calls]


def read_objects(text: str) -> list[Json]:
    """Return the outermost JSON objects of an answer that is no call, such as a verdict, in the order of the text.

    Raises CallError if a key is there twice, or the text is too long.
    """
    if len(text) > LONGEST:
        raise CallError(f"The answer is longer than {LONGEST} letters.")
    return [item.value for item in _objects(text)]


def _among_words(text: str) -> list[Json]:
    """Return the JSON objects that name a skill. Raises CallError if words follow the last one, and if one stands in a
    broken object, which may have said that it is not meant."""
    named = [item for item in _objects(text) if _named([item.value])]
    if any(item.nested for item in named):
        raise CallError("Nothing was executed: the JSON object around the call is not closed; write the call alone.")
    if named and not is_padding(text, named[-1].end):
        raise CallError("Nothing was executed: words follow the call; write the call last, with nothing behind it.")
    return _named(item.value for item in named)


def _named(items: Iterable[Json]) -> list[Json]:
    """Return those that name a skill, and those in an object {"tool_calls": [...]}."""
    lists = (item["tool_calls"] if isinstance(item.get("tool_calls"), list) else [item] for item in items)
    return [item for inner in lists for item in inner if isinstance(item, dict) and _is_named(item)]


def _is_named(item: Json) -> bool:
    return any(isinstance(item.get(key), str) for key in _NAMES) or isinstance(item.get("function"), Mapping)


@dataclass(frozen=True)
class _Found:
    """An outermost JSON object and its place in a text."""

    value: Json
    start: int
    end: int
    nested: bool
    """Whether it stands behind a brace that is not closed before it."""


def _objects(text: str) -> Iterator[_Found]:
    decoder, end, opened, failed = json.JSONDecoder(object_pairs_hook=_once, strict=False), 0, 0, 0
    while failed < _TRIES and (begin := _OBJECT.search(text, end)):
        start = begin.start()
        opened = max(0, opened - text.count("}", end, start))
        if text[start] != "{":
            end, _ = end_of_text(text, start)
            continue
        try:
            value, end = decoder.raw_decode(text, start)
            yield _Found(value, start, end, opened > 0)
        except (ValueError, RecursionError):
            end, failed, opened = start + 1, failed + 1, opened + 1


def _once(pairs: list[tuple[str, Any]]) -> Json:
    """Return an object without duplicate keys: with two values, the intended one is unknown."""
    try:
        return once(pairs)
    except KeyError as error:
        twice = str(error.args[0])[:64]
        raise CallError(f"Nothing was executed: the key {twice!r} is there twice; give it once.") from None


def _parse(arguments: str, name: str) -> Json:
    if len(arguments) > LONGEST:
        raise CallError(f"{name} was not executed: its arguments are longer than {LONGEST} letters; be brief.")
    said = (arguments or "{}").strip()
    try:
        values, end = json.JSONDecoder(object_pairs_hook=_once, strict=False).raw_decode(said)
    except (ValueError, RecursionError) as error:
        raise CallError(
            f"{name} was not executed: its arguments are not valid JSON ({error}); was the answer cut off?"
        ) from error
    if not is_padding(said, end):
        raise CallError(f"{name} was not executed: words follow its arguments; give the object alone.")
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
    """Read the reasoning fields of a text that holds one a line; a line without a field name is reasoning."""
    fields: dict[str, str] = {}
    field = "reasoning"
    for line in filter(None, map(str.strip, text.split("\n"))):
        named = _FIELD.match(line)
        field, words = (named[1].lower(), named[2]) if named else (field, line)
        fields[field] = f"{fields.get(field, '')} {words}".strip()
    return fields


def _share(text: str) -> float | None:
    """Read a whole per cent as a share; None for anything else."""
    match = _PER_CENT.fullmatch(text.strip())
    return int(match[1]) / 100 if match and int(match[1]) <= 100 else None


def _text(value: Any) -> str:
    return value if isinstance(value, str) else json.dumps(value, ensure_ascii=False)


def _pop_first(values: Json, *keys: str) -> Any:
    """Take the first key that is there; the others stay."""
    return next((values.pop(key) for key in keys if key in values), None)
