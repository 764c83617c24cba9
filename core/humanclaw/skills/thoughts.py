"""Tell a model's thoughts from its answer, in a text that holds both.

Most providers give thoughts a field of their own. Local servers without a reasoning parser leave them in the text,
between the markers of the model's chat template.
"""

from __future__ import annotations

import re
from typing import Final

from humanclaw.skills.call_dialects import BEGINNING, TURN_END, end_of_text

_STEMS: Final = (
    "th(?:ink|ought)",
    "reason",
    "reflect",
    "monolog",
    "deliberat",
    "brainstorm",
    "scratch_?pad",
    "analysis",
    r"(?<![^\W_])(?:plan|draft|cot)(?![^\W_])",
)
"""A tag whose name holds one of these is about a thought: <think>, <|START_THINKING|>, [THINK], <seed:think>."""


def _tag(name: str) -> str:
    brackets = (r"<\|?", r"(?:\s[^<>]{0,60})?\|?>"), ("[＜◁[]|&lt;", "[＞▷\\]]|&gt;")  # noqa: RUF001
    return "|".join(rf"(?:{left})\s{{0,4}}{name}\s{{0,4}}(?:{right})" for left, right in brackets)


_TAGS: Final = tuple(
    (
        _tag(rf"(?!end_)[\w:-]{{0,20}}?{stem}[\w:-]{{0,20}}(?<!_end)"),
        _tag(rf"(?:/\s{{0,4}}|end_|(?=\w{{1,40}}_end\b))[\w:-]{{0,20}}?{stem}[\w:-]{{0,20}}"),
    )
    for stem in _STEMS
)
_FINAL: Final = r"<\|channel\|>final[^<]{0,80}(?:<\|constrain\|>\w{1,20})?<\|message\|>"
_PAIRS: Final = (
    *_TAGS,
    (r"<\|inner_prefix\|>", r"<\|inner_suffix\|>"),  # Apertus
    (r"<\|channel>thought", r"<channel\|>"),  # Gemma
    ("<unused94>", "<unused95>"),  # MedGemma
    (r"<\|channel\|>analysis", rf"{_FINAL}|<\|end\|>"),  # gpt-oss
    ("Here(?:'s| is) my thought process:", "Here(?:'s| is) my response:"),  # Granite
    (r"<details\s[^<>]{0,60}(?:reason|think|thought)[^<>]{0,60}>", "</details>"),  # Open WebUI
    (r"```(?:think|thought|reason)\w{0,10}\n", r"```[ \t]{0,9}(?=\n|\Z)"),
)
"""Markers that begin and end a thought. Sources: the reasoning parsers of vLLM and SGLang, llama.cpp's chat formats."""
_CLOSING: Final = "|".join([_FINAL, *(closing for _, closing in _PAIRS[: len(_TAGS) + 3])])
"""Markers that end a thought even if nothing opened it, as chat templates write the opening marker into the prompt."""
_ROLE: Final = r"<\|(?:im_start|start_header_id|header_start|start_of_role|start)\|>|<start_of_turn>|<\|turn>"
_BEGIN: Final = r"<s>|<bos>|<\|(?:begin_of_text|startoftext)\|>|<｜begin▁of▁sentence｜>"  # noqa: RUF001
_OWN: Final = r"<\|(?:assistant|im_assistant)\|>|\[\|assistant\|\]|<｜Assistant｜>"  # noqa: RUF001
_HEADER: Final = re.compile(
    rf"\A(?:\s|{TURN_END}|{_BEGIN}|(?:{_ROLE}|{_OWN})\s{{0,9}}(?:(?:assistant|model)\b\s{{0,9}}"
    r"(?:<\|(?:end_header_id|header_end|end_of_role|im_middle)\|>)?)|(?-i:Assistant):|assistant[ \t]{0,9}\n)*",
    re.IGNORECASE,
)
"""The end of the turn before and the header of the model's own turn, which some models repeat."""
_TURN: Final = (
    rf"{TURN_END}|{_BEGIN}|{_OWN}|(?!<\|start\|>\s{{0,9}}assistant)(?:{_ROLE})"
    r"|<\|(?:user|im_user|system|im_system|observation)\|>|<tool_response>|\[\|user\|\]|\[INST\]|\[SYSTEM_PROMPT\]"
    "|<｜User｜>"  # noqa: RUF001
)
"""Markers at which the model's turn ends. What follows is a turn that the model made up."""
_ROLE_LINE: Final = (
    r"(?m:^)(?:#{1,6} ?instruction|[#*_ \t]{0,9}(?:user|human))[*_ \t]{0,4}(?::|(?m:$))"
    r"|(?m:^)assistant[ \t]{0,9}(?m:$)|(?m:^)Q:(?=.{0,999}\nA:)"
)
"""Lines that begin such a turn in plain words, as in `### User:`, or where a server left the special tokens out."""
_INVISIBLE: Final = re.compile("[\u200b-\u200d\u2060\ufeff]")


def _nested(opening: str) -> str:
    """Match an opening marker inside a thought, but not between words: there it is only spoken of."""
    return rf"(?!(?:(?<=\w )|(?<=\())(?:{opening})\W)(?:{opening})"


def _any(*kinds: str, text: str = "(?!)") -> re.Pattern[str]:
    """Match text (group 1), a mark in quotes, which is only spoken of (2), or one of the marks (3 and so on)."""
    quoted = rf"""(?<![\w`])[`"'](?:{"|".join(kinds)})[`"'](?!`)"""
    return re.compile("|".join(f"({kind})" for kind in (text, quoted, *kinds)), re.IGNORECASE | re.ASCII)


_MARKS: Final = _any(_TURN, _ROLE_LINE, _CLOSING, *(opening for opening, _ in _PAIRS), text=BEGINNING)
_THOUGHTS: Final = tuple(_any(closing, _nested(opening)) for opening, closing in _PAIRS)
_THOUGHT: Final = re.compile("|".join([f"({_CLOSING})", *(opening for opening, _ in _PAIRS)]), re.IGNORECASE | re.ASCII)
_TEXT, _QUOTED, _FIRST = 1, 2, 3
"""Numbers of the groups in _MARKS and _THOUGHTS: _any puts text and quotations before its own kinds."""


def split_thoughts(text: str) -> tuple[str, str]:
    """Split a model's text into (thoughts, answer).

    * A thought ends at its own closing marker. All that stands in it is thought: calls, marks of turns and answers.
    * The answer begins behind the last thought. A closing marker ends one even if none opened it, since templates open
      it in the prompt; only a text that begins with an object is no thought, and then leaves no answer.
    * An open thought leaves no answer.
    * What follows the end of the model's turn is nothing: the model made it up. A line of a role's name ends it too;
      if a thought is closed behind one that nothing opened, there is no answer.
    * What a call holds is its text: no marker counts there. A marker in a broken call leaves no answer.
    * A marker in quotes is only spoken of, and so is an opening one between the words of a thought.

    Takes time in proportion to the text.
    """
    text = _HEADER.sub("", _INVISIBLE.sub("", text))
    start, end = _answer_in(text)
    return f"{text[:start]}{text[end:]}".strip(), text[start:end].strip()


def _answer_in(text: str) -> tuple[int, int]:
    """Return the first and last place of the answer; both are the end of the text if there is none."""
    start = place = 0
    while mark := _MARKS.search(text, place):
        kind, place = mark.lastindex or 0, mark.end()
        if kind == _TEXT:
            place, whole = end_of_text(text, mark.start())
            if not whole and _THOUGHT.search(text, mark.start(), place):
                return len(text), len(text)
        elif kind == _FIRST:
            return start, mark.start()
        elif kind == _FIRST + 1:
            later = _THOUGHT.search(text, place)
            return (len(text), len(text)) if later and later[1] else (start, mark.start())
        elif kind == _FIRST + 2:
            start = place if start or not text.lstrip().startswith(("{", "[{")) else len(text)
        elif kind > _QUOTED:
            start = place = _end_of_thought(text, place, _THOUGHTS[kind - _FIRST - 3])
    return start, len(text)


def _end_of_thought(text: str, place: int, markers: re.Pattern[str]) -> int:
    """Return where a thought that is open at `place` is closed; the end of the text if it is not."""
    depth, last = 1, place
    for mark in markers.finditer(text, place):
        if mark.lastindex == _FIRST:
            depth -= 1
        elif mark.lastindex != _QUOTED:
            depth += bool(text[last : mark.start()].strip())  # Opened twice is opened once.
        if not depth:
            return mark.end()
        last = mark.end()
    return len(text)
