"""Tell a model's thoughts from its answer, in a text that holds both.

Most providers give thoughts a field of their own. Local servers without a reasoning parser leave them in the text,
between the markers of the model's chat template.
"""

from __future__ import annotations

import json
import re
from typing import Final

_TAG: Final = (
    r"(?:\w{1,20}[:_])?(?:ant)?(?:think|thinking|thought|thoughts|thinking_process|reason|reasoning|reflection|cot"
    r"|scratch_?pad|analysis|inner_monologue)(?:\s[^<>]{0,60})?"
)
_LEFT, _RIGHT = r"(?:<|＜|&lt;)\s{0,4}", r"\s{0,4}(?:>|＞|&gt;)"  # noqa: RUF001, as some servers write < and >
_OPENING: Final = (
    f"{_LEFT}{_TAG}{_RIGHT}",  # DeepSeek, Qwen, GLM, MiniMax, EXAONE; <seed:think>, <longcat_think>
    "◁think▷",  # Kimi
    r"\[THINK\]",  # Mistral
    r"<\|START_THINKING\|>",  # Command
    r"<\|inner_prefix\|>",  # Apertus
    r"<\|(?:think|thinking|think_start|begin_of_thought)\|>",  # Solar and others
    r"<\|channel>thought",  # Gemma
    "<unused94>",  # MedGemma
    r"<\|channel\|>analysis",  # gpt-oss
    "Here(?:'s| is) my thought process:",  # Granite
)
"""Markers that begin a thought. Sources: the reasoning parsers of vLLM and SGLang, llama.cpp's chat formats."""
_CLOSING: Final = (
    rf"{_LEFT}/\s{{0,4}}{_TAG}{_RIGHT}",
    "◁/think▷",
    r"\[/THINK\]",
    r"<\|END_THINKING\|>",
    r"<\|inner_suffix\|>",
    r"<\|(?:/think|think_end|end_of_thought)\|>",
    r"<channel\|>",
    "<unused95>",
)
_ANSWER: Final = (
    r"<\|channel\|>final[^<]{0,80}(?:<\|constrain\|>\w{1,20})?<\|message\|>",
    "Here(?:'s| is) my response:",
    r"<(?:answer|response|output)>",  # Hunyuan, ERNIE, Marco-o1
    r"<\|begin_of_box\|>",  # GLM
)
"""Markers that begin the answer, so that all thoughts before them are closed."""
_CALL: Final = r"(?=<\|channel\|>commentary)"
"""The same. The name of the called function follows in it, so it stays in the answer."""
_OVER: Final = (
    r"</(?:answer|response|output)>",
    r"<\|(?:end_of_box|end)\|>",
)
"""Markers that end the answer; in a thought they mean nothing."""
_TURN: Final = re.compile(
    r"<\|(?:im_end|eot_id|eom_id|eot|endoftext|end_of_text|endofturn|end_of_role|role_end|return|call|user|im_user"
    r"|im_start|start_header_id|header_start|observation|END_OF_TURN_TOKEN)\|>"
    r"|</s>|<eos>|<(?:start|end)_of_turn>|<end_of_utterance>|<\|?turn\|?>|<tool_response>|\[\|user\|\]|\[/?INST\]"
    r"|\[SYSTEM_PROMPT\]|<｜(?:User|end▁of▁sentence)｜>",  # noqa: RUF001, as DeepSeek writes them
    re.IGNORECASE,
)
"""Markers at which the model's turn ends. What follows is a turn that the model made up."""
_HEADER: Final = re.compile(
    r"\A\s*(?:<\|im_start\|>|<start_of_turn>|<\|start_header_id\|>)\s*\w{1,20}\s*(?:<\|end_header_id\|>)?"
)
"""The header of the model's own turn, which some models repeat."""
_OVERS: Final = re.compile("|".join(_OVER), re.IGNORECASE)
_INVISIBLE: Final = re.compile("[\u200b-\u200d\u2060\ufeff]")
_MARKERS: Final = re.compile(
    "|".join(
        f"(?P<{name}>{'|'.join(markers)})"
        for name, markers in (
            ("opening", _OPENING),
            ("closing", _CLOSING),
            ("answer", _ANSWER),
            ("call", (_CALL,)),
            ("over", _OVER),
        )
    ),
    re.IGNORECASE | re.ASCII,
)


def split_thoughts(text: str) -> tuple[str, str]:
    """Split a model's text into (thoughts, answer).

    * The answer begins behind the last marker that closes a thought, whether or not the text opens one: chat templates
      often write the opening marker into the prompt.
    * An open thought leaves no answer, wherever it begins; nor do two marked answers.
    * What follows the end of the model's turn is nothing: the model made it up.
    * Words behind a marked answer leave no answer: they could take it back.
    * A text that begins as JSON is no thought: it is the answer if it is whole, and holds none if a marker cuts it.
    * Elsewhere a marker counts also as text of an argument. Rather an answer is refused than a draft executed.

    Takes time in proportion to the text.
    """
    text = _HEADER.sub("", _INVISIBLE.sub("", text))
    begins_as_json = text.lstrip().startswith(("{", "[{"))
    if begins_as_json and _is_json(text):
        return "", text.strip()
    turn = _TURN.search(text)
    start, end = _answer_in(text, turn.start() if turn else len(text))
    if start and begins_as_json:
        start = end
    return f"{text[:start]}{text[end:]}".strip(), text[start:end].strip()


def _is_json(text: str) -> bool:
    try:
        json.loads(text)
    except (ValueError, RecursionError):
        return False
    return True


def _answer_in(text: str, end: int) -> tuple[int, int]:
    """Return the first and last place of the answer before `end`; both are `end` if there is none."""
    start = depth = answers = place = 0
    last, over = "", end
    for marker in _MARKERS.finditer(text, 0, end):
        kind = marker.lastgroup or ""
        if kind == "opening":
            depth += last != "opening" or bool(text[place : marker.start()].strip())
        elif kind == "over":
            over = min(over, marker.start()) if not depth else over
        else:
            depth = max(0, depth - 1) if kind == "closing" else 0
            answers += kind == "answer"
            if not depth and not (kind == last == "call"):
                start, over = marker.end(), end
        last, place = kind, marker.end()
    taken_back = answers and _OVERS.sub("", text[over:end]).strip()
    return (end, end) if depth or answers > 1 or taken_back else (start, over)
