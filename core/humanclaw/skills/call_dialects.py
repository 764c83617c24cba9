"""Calls that a model writes as text, in the format of its own chat template.

A server without the matching tool parser passes them on unread. This module reads what the tool parsers of vLLM and
llama.cpp read: JSON objects and arrays, alone or marked (Hermes, Qwen, Llama, Mistral, Granite, Phi, Nemotron,
Command), named blocks (Llama, Qwen-Coder, GLM, MiniMax, Kimi, DeepSeek, gpt-oss), and Python calls (Llama).
"""

from __future__ import annotations

import ast
import json
import re
from collections.abc import Callable, Iterator
from typing import Any, Final

from humanclaw.errors import CallError
from humanclaw.skills.publishing import Json

Pairs = list[tuple[str, Any]]
_OPENINGS: Final = (
    "<function=NAME>",  # Llama, Qwen-Coder
    '<invoke name="NAME">',  # MiniMax
    r"<tool_call>\s{0,9}NAME\s{0,9}(?=<arg_key>|</tool_call>)",  # GLM
    r"<\|tool_call_begin\|>\s{0,9}(?:functions\.)?NAME:\d{1,6}\s{0,9}<\|tool_call_argument_begin\|>",  # Kimi
    "<｜tool▁call▁begin｜>(?:function<｜tool▁sep｜>)?NAME(?:<｜tool▁sep｜>)?",  # noqa: RUF001, as DeepSeek writes them
    r"<\|channel\|>commentary to=(?:functions\.)?NAME\s{0,9}(?:(?:<\|constrain\|>)?\w{1,20})?<\|message\|>",  # gpt-oss
    r"\[TOOL_CALLS\]NAME(?:\[ARGS\])?(?={)",  # Mistral
)
"""Openings that name the called function; its arguments follow."""
_NAMED: Final = tuple(re.compile(opening.replace("NAME", r"(?P<name>[\w-]{1,64})")) for opening in _OPENINGS)
_MARKS: Final = "|".join(
    (
        r"</?(?:tool_calls?|function_calls?|TOOLCALL|minimax:tool_call)>",
        r"<\|/?tool_calls?\|>",
        r"<\|tool_calls?_(?:section_)?(?:begin|end)\|>",
        r"\[/?TOOL_CALLS\]",
        r"\bfunctools(?=\[)",
        r"<\|(?:START|END)_ACTION\|>",
        r"<\|python_(?:tag|start|end)\|>",
        "<｜tool▁calls?▁(?:begin|end)｜>",  # noqa: RUF001
    )
)
_PADDING: Final = re.compile(rf"(?:\s|{_MARKS}|</function>|</invoke>|```\w{{0,10}}|[,;])*")
"""What may stand around a call without being a part of it."""
_WRAPPING: Final = re.compile(rf"{_MARKS}|```\w{{0,10}}")
_MARKED: Final = re.compile("|".join([_MARKS, *(opening.replace("NAME", r"[\w-]{1,64}") for opening in _OPENINGS)]))
_PARAMETER: Final = re.compile(
    r'<parameter(?:=|\s{1,4}name=")([\w-]{1,64})"?>(.{0,9999}?)</parameter>'
    r"|<arg_key>\s{0,9}([\w-]{1,64})\s{0,9}</arg_key>\s{0,9}<arg_value>(.{0,9999}?)</arg_value>",
    re.DOTALL,
)
_LONGEST_PYTHON: Final = 10_000
"""Characters. Python's parser takes more than linear memory."""


def written_calls(text: str, make: Callable[[Pairs], Json]) -> list[Json]:
    """Return the calls of a text that holds nothing else, as objects with a name; empty if it holds other words.

    Before a marked call may stand words, as in every chat template; behind a call may not: they could take it back.
    make: builds each JSON object from its pairs, and may raise CallError. Takes time in proportion to the text.
    """
    marked = _MARKED.search(text)
    said = text[marked.start() :] if marked else text
    return _named(said, make) or _bare(said, make) or _python(said, make)


def is_padding(text: str, start: int) -> bool:
    """Tell whether nothing but the marks around calls stands from `start` on."""
    return _PADDING.fullmatch(text, start) is not None


def _named(text: str, make: Callable[[Pairs], Json]) -> list[Json]:
    for opening in _NAMED:
        heads = list(opening.finditer(text))
        if not heads or _PADDING.fullmatch(text, 0, heads[0].start()) is None:
            continue
        ends = [*(head.start() for head in heads[1:]), len(text)]
        bodies = [_arguments(text[head.end() : end], make) for head, end in zip(heads, ends, strict=True)]
        if any(body is None for body in bodies):
            return []
        return [{"name": head["name"], "arguments": body} for head, body in zip(heads, bodies, strict=True)]
    return []


def _arguments(body: str, make: Callable[[Pairs], Json]) -> Json | None:
    """Read the arguments of a named call, as JSON or as tagged parameters; None if there is anything else."""
    if _PADDING.fullmatch(_PARAMETER.sub("", body)):
        return make([(match[1] or match[3], _value(match[2] or match[4] or "")) for match in _PARAMETER.finditer(body)])
    values = _bare(body, make)
    return values[0] if len(values) == 1 else None


def _value(text: str) -> Any:
    """Read the text of a tagged parameter: its dialect cannot tell a number from a string."""
    try:
        return json.loads(text)
    except (ValueError, RecursionError):
        return text.strip("\n")


def _bare(text: str, make: Callable[[Pairs], Json]) -> list[Json]:
    """Read a text of JSON objects, and arrays of them, with nothing else around; empty for any other text."""
    decoder, found = json.JSONDecoder(object_pairs_hook=make), []
    place = _skip(text, 0)
    while place < len(text):
        try:
            value, end = decoder.raw_decode(text, place)
        except (ValueError, RecursionError):
            return []
        items = value if isinstance(value, list) else [value]
        if not all(isinstance(item, dict) for item in items):
            return []
        found += items
        place = _skip(text, end)
    return found


def _skip(text: str, place: int) -> int:
    padding = _PADDING.match(text, place)
    return padding.end() if padding else place


def _python(text: str, make: Callable[[Pairs], Json]) -> list[Json]:
    """Read [walk(z_cm=40)] or walk(z_cm=40)."""
    said = _WRAPPING.sub("", text[:_LONGEST_PYTHON]).strip()
    if len(text) > _LONGEST_PYTHON or not said.endswith((")", "]")):
        return []
    try:
        tree = ast.parse(said, mode="eval").body
        return [_call(node, make) for node in (tree.elts if isinstance(tree, ast.List) else [tree])]
    except CallError:
        raise
    except (ValueError, SyntaxError, RecursionError, MemoryError):
        return []


def _call(node: ast.expr, make: Callable[[Pairs], Json]) -> Json:
    if not isinstance(node, ast.Call) or not isinstance(node.func, ast.Name) or node.args:
        raise ValueError("no call with named arguments")
    return {"name": node.func.id, "arguments": make(list(_keywords(node)))}


def _keywords(node: ast.Call) -> Iterator[tuple[str, Any]]:
    for keyword in node.keywords:
        if keyword.arg is None:
            raise ValueError("arguments without names")
        yield keyword.arg, ast.literal_eval(keyword.value)
