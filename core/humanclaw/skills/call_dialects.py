"""Calls that a model writes as text, in the format of its own chat template.

A server without the matching tool parser passes them on unread. This module reads what the tool parsers of vLLM and
llama.cpp read: JSON objects and arrays, alone or marked (Hermes, Qwen, Llama, Mistral, Granite, Phi, Nemotron,
Command), named blocks (Llama, Qwen-Coder, GLM, MiniMax, Kimi, DeepSeek, Gemma, gpt-oss), and Python calls (Llama,
LFM2).
"""

from __future__ import annotations

import ast
import json
import re
from collections.abc import Callable, Iterator
from typing import Any, Final

from humanclaw.skills.tool_schemas import Json

Pairs = list[tuple[str, Any]]
_JSON: Final = r"\s{0,9}(?:(?:<\|constrain\|>)?\w{1,20})?<\|message\|>"
_SPACE: Final = r"(?:\w{1,9}:|｜DSML｜)?"  # noqa: RUF001
"""The namespace that some dialects write before the names of their tags."""
_OPENINGS: Final = (
    "<function=NAME>",  # Llama, Qwen-Coder
    rf'<{_SPACE}invoke name="NAME">',  # MiniMax, DeepSeek 3.2
    r"<tool_call>\s{0,9}NAME\s{0,9}(?=<arg_key>|</tool_call>)",  # GLM
    r"<\|tool_call_begin\|>\s{0,9}NAME:\d{1,6}\s{0,9}<\|tool_call_argument_begin\|>",  # Kimi
    "<｜tool▁call▁begin｜>(?:function<｜tool▁sep｜>)?NAME(?:<｜tool▁sep｜>)?",  # noqa: RUF001, as DeepSeek writes them
    rf"<\|channel\|>commentary to=NAME{_JSON}",  # gpt-oss
    rf"(?:<\|start\|>assistant)?\s{{0,9}}\bto=NAME\s{{0,9}}<\|channel\|>commentary{_JSON}",
    r"\[TOOL_CALLS\]NAME(?:\[CALL_ID\]\w{1,64})?(?:\[ARGS\])?(?={)",  # Mistral
)
"""Openings that name the called function; its arguments follow."""
NAME: Final = r"(?:(?:functions|default_api)[.:])?([\w-]{1,64})"
"""A called function, with the namespace of gpt-oss and Kimi, or Gemini."""
_NAMED: Final = "|".join(_OPENINGS).replace("NAME", NAME)
_HEAD: Final = re.compile(_NAMED)
_MARKS: Final = "|".join(
    (
        rf"</?{_SPACE}(?:tool_calls?|function_calls?|TOOLCALL)>",
        r"<\|/?tool_calls?\|>|<\|tool_call>(?=call:)|<tool_call\|>",
        r"<\|tool_calls?_(?:section_)?(?:begin|start|end)\|>",
        r"\[/?TOOL_CALLS\]",
        r"\bfunctools(?=\[)",
        r"<\|(?:START|END)_ACTION\|>",
        r"<\|python_(?:tag|start|end)\|>",
        "<｜tool▁calls?▁(?:begin|end)｜>",  # noqa: RUF001
    )
)
TURN_END: Final = (
    r"<\|(?:im_end|eot_id|eom_id|eot|endoftext|end_of_text|endofturn|end_of_role|role_end|return|call"
    r"|END_OF_TURN_TOKEN)\|>|</s>|<eos>|<end_of_turn>|<end_of_utterance>|<turn\|>|\[/INST\]"
    "|<｜end▁of▁sentence｜>"  # noqa: RUF001
)
"""Marks that end a model's turn."""
_FRAME: Final = (
    r"</?(?:answer|response|output|action|json|tool)>|<\|(?:begin_of_box|end_of_box|START_RESPONSE|END_RESPONSE|end)\|>"
    r"|\\boxed\{|\}"  # a brace too many, as that of \boxed{}
)
"""Marks around an answer, a call or not."""
_WORDS_BEHIND: Final = r"(?<=\)\]<\|tool_call_end\|>)[^<>{}()\[\]]*\Z"
"""LFM2 alone tells what it does behind its call: <|tool_call_start|>[walk(z_cm=40)]<|tool_call_end|>Walking."""
_PADDING: Final = re.compile(
    rf"\s|{_MARKS}|{_FRAME}|{TURN_END}|</function>|</{_SPACE}invoke>|```\w{{0,10}}|[,;]|{_WORDS_BEHIND}"
)
_LONG_PADDING: Final = re.compile(f"(?:{_PADDING.pattern})*")
"""What may stand around a call without being a part of it."""
_OBJECT: Final = re.compile(r"(?:\s|```\w{0,10})*(?={)")
_PARAMETER: Final = re.compile(
    rf'\s*<{_SPACE}parameter(?:=|\s{{1,4}}name=")([\w-]{{1,64}})"?(?: string="\w{{4,5}}")?>'
    rf"(.{{0,9999}}?)</{_SPACE}parameter>"
    r"|\s*<arg_key>\s{0,9}([\w-]{1,64})\s{0,9}</arg_key>\s{0,9}<arg_value>(.{0,9999}?)</arg_value>",
    re.DOTALL,
)
_CLOSED: Final = re.compile(rf"\s*</(?:function|{_SPACE}invoke|tool_call)>")
_GEMMA: Final = re.compile(
    r'call:([\w-]{1,64})(\{(?:<\|"\|>(?:(?!<\|"\|>).){0,9999}<\|"\|>|[^<]){0,9999}\})(?=<tool_call\|>)', re.DOTALL
)
_GEMMA_WORD: Final = re.compile(r'<\|"\|>(.*?)<\|"\|>|[\w-]{1,64}(?=:)', re.DOTALL)
"""A string between marks, or a key."""
_PYTHON: Final = re.compile(r"""'(?:[^'\\\n]|\\.)*'|"(?:[^"\\\n]|\\.)*"|[()\[\]]""")
_LONGEST: Final = 10_000
"""Characters of a text that may hold marks, and of a Python call, whose parser takes more than linear memory."""
ARGUMENTS: Final = (
    rf"<{_SPACE}parameter[= ]|<arg_key>|\bcall:[\w-]{{1,64}}{{|\b[A-Za-z_]\w{{0,63}}\(\s{{0,9}}\w{{1,64}}\s{{0,9}}="
)
"""Where a tagged parameter, Gemma's call or a Python call begins."""
BEGINNING: Final = rf'{{\s{{0,9}}["}}]|{ARGUMENTS}'
"""Where they begin, or a JSON object. What they hold is text: no mark counts in it."""
_MARKED: Final = re.compile(f"(?P<text>{BEGINNING})|{_MARKS}|{_NAMED}")


def written_calls(text: str, make: Callable[[Pairs], Json]) -> list[Json]:
    """Return the calls of a text that holds nothing else, as objects with a name; empty if it holds other words.

    Before a marked call may stand words, as in every chat template; behind a call may not: they could take it back.
    make: builds each JSON object from its pairs, and may raise CallError. Takes time in proportion to the text.
    """
    return _calls(text, 0, make) or _calls(text, _first_mark(text), make)


def is_padding(text: str, start: int) -> bool:
    """Tell whether nothing but the marks around calls stands from `start` on."""
    return _LONG_PADDING.fullmatch(text, start) is not None


def end_of_text(text: str, start: int) -> tuple[int, bool]:
    """Return where the text that begins with BEGINNING at `start` ends, and whether it is whole.

    Broken JSON ends where no reader can go on; whatever else is not closed, at the end.
    """
    if text[start] == "<":
        parameter = _PARAMETER.match(text, start)
        return (parameter.end(), True) if parameter else (len(text), False)
    if text.startswith("call:", start):
        call = _GEMMA.match(text, start)
        return (call.end(), True) if call else (len(text), False)
    piece = text[start : start + _LONGEST]
    items, end = _item(piece, 0, dict)
    return (len(text) if not items and end == len(piece) else start + end), bool(items)


def _first_mark(text: str) -> int:
    place = 0
    while mark := _MARKED.search(text, place):
        if not mark["text"]:
            return mark.start()
        place, _ = end_of_text(text, mark.start())
    return len(text)


def _calls(text: str, place: int, make: Callable[[Pairs], Json]) -> list[Json]:
    """Read calls and what may stand around them up to the end; empty if anything else is there."""
    calls = []
    while place < len(text):
        if call := _GEMMA.match(text, place):
            arguments, place = _item(_GEMMA_WORD.sub(_quoted, call[2]), 0, make)[0], call.end()
            items = [{"name": call[1], "arguments": each} for each in arguments]
        elif head := _HEAD.match(text, place):
            arguments, place = _arguments(text, head.end(), make)
            items = [{"name": head[head.lastindex or 0], "arguments": each} for each in arguments]
        elif padding := _PADDING.match(text, place):
            place = padding.end()
            continue
        else:
            items, place = _item(text, place, make)
        if not items:
            return []
        calls += items
    return calls


def _quoted(word: re.Match[str]) -> str:
    return json.dumps(word[0] if word[1] is None else word[1])


def _arguments(text: str, place: int, make: Callable[[Pairs], Json]) -> tuple[list[Json], int]:
    """Read the arguments of a named call, one object as JSON or as tagged parameters; empty for anything else."""
    if given := _OBJECT.match(text, place):
        return _item(text, given.end(), make)
    pairs: Pairs = []
    while parameter := _PARAMETER.match(text, place):
        pairs.append((parameter[1] or parameter[3], _value(parameter[2] or parameter[4] or "")))
        place = parameter.end()
    return [make(pairs)] if _CLOSED.match(text, place) else [], place


def _value(text: str) -> Any:
    """Read the text of a tagged parameter: its dialect cannot tell a number from a string."""
    try:
        return json.loads(text, strict=False)
    except (ValueError, RecursionError):
        return text.strip("\n")


def _item(text: str, place: int, make: Callable[[Pairs], Json]) -> tuple[list[Json], int]:
    """Read a JSON object, an array of them, or Python calls, and where they end; without any, where reading failed."""
    try:
        value, end = json.JSONDecoder(object_pairs_hook=make, strict=False).raw_decode(text, place)
    except RecursionError:
        return [], len(text)
    except json.JSONDecodeError as error:
        if text[place : place + 1] != "{":
            return _python(text, place, make)
        # Any other fault lies in a string, and nobody knows where that ends.
        return [], max(error.pos, place + 1) if error.msg.startswith("Expecting") else len(text)
    except ValueError:  # a number too long
        return [], len(text)
    items = value if isinstance(value, list) else [value]
    return items if all(isinstance(item, dict) for item in items) else [], end


def _python(text: str, place: int, make: Callable[[Pairs], Json]) -> tuple[list[Json], int]:
    """Read [walk(z_cm=40)] or walk(z_cm=40)."""
    depth = 0
    for token in _PYTHON.finditer(text, place, place + _LONGEST):
        depth += (token[0] in ("(", "[")) - (token[0] in (")", "]"))
        if depth <= 0:
            return _parsed(text[place : token.end()], make), token.end()
    return [], len(text)


def _parsed(text: str, make: Callable[[Pairs], Json]) -> list[Json]:
    try:
        tree = ast.parse(text, mode="eval").body
        return [_call(node, make) for node in (tree.elts if isinstance(tree, ast.List) else [tree])]
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
