"""Tell a model's thoughts from its answer, in a text that holds both.

Most providers give thoughts a field of their own. Local servers without a reasoning parser leave them in the text,
between the markers of the model's chat template.
"""

from __future__ import annotations

import re
from typing import Final

_TAG: Final = r"(?:\w{1,20}[:_])?(?:ant)?(?:think|thinking|thought|thoughts|reasoning|reflection|scratch_?pad|analysis)"
_OPENING: Final = (
    rf"<\s{{0,4}}{_TAG}\s{{0,4}}>",  # DeepSeek, Qwen, GLM, MiniMax, EXAONE; <seed:think>, <longcat_think>
    "◁think▷",  # Kimi
    r"\[THINK\]",  # Mistral
    r"<\|START_THINKING\|>",  # Command
    r"<\|inner_prefix\|>",  # Apertus
    r"<\|think\|>",  # Solar
    r"<\|channel>thought",  # Gemma
    r"<\|channel\|>analysis",  # gpt-oss
    "Here(?:'s| is) my thought process:",  # Granite
)
"""Markers that begin a thought. Sources: the reasoning parsers of vLLM and SGLang, llama.cpp's chat formats."""
_CLOSING: Final = (
    rf"<\s{{0,4}}/\s{{0,4}}{_TAG}\s{{0,4}}>",
    "◁/think▷",
    r"\[/THINK\]",
    r"<\|END_THINKING\|>",
    r"<\|inner_suffix\|>",
    r"<channel\|>",
    r"<\|channel\|>final[^<]{0,80}(?:<\|constrain\|>\w{1,20})?<\|message\|>",
    r"(?=<\|channel\|>commentary)",  # The name of the called function follows, so this marker stays in the answer.
    "Here(?:'s| is) my response:",
    r"<(?:answer|response|output)>",  # Hunyuan, ERNIE, Marco-o1: the answer is marked as well
    r"<\|begin_of_box\|>",  # GLM too
)
_ENDING: Final = (
    r"</(?:answer|response|output)>",
    r"<\|end_of_box\|>",
    r"<\|(?:im_end|eot_id|end|endoftext|end_of_text|return|call|user|im_start)\|>",
    "<end_of_turn>",
    "</s>",
)
"""Markers after which the turn is over. What follows is a turn that the model made up."""
_MARKERS: Final = re.compile(
    f"(?P<opening>{'|'.join(_OPENING)})|(?P<closing>{'|'.join(_CLOSING)})", re.IGNORECASE | re.ASCII
)
_ENDS: Final = re.compile("|".join(_ENDING), re.IGNORECASE)


def split_thoughts(text: str) -> tuple[str, str]:
    """Split a model's text into (thoughts, answer).

    The answer begins behind the last marker that closes a thought, whether or not the text opens one: chat templates
    often write the opening marker into the prompt. It ends where another thought or turn begins. Everything else is
    thought, so a text with an open thought at its start has no answer. A marker inside the answer, also as text of an
    argument, cuts it: rather an answer is refused than a draft executed.

    Takes time in proportion to the text.
    """
    start, end = 0, len(text)
    for marker in _MARKERS.finditer(text):
        if marker["opening"] is None:
            start, end = marker.end(), len(text)
        elif end == len(text):
            end = marker.start()
    if over := _ENDS.search(text, start, end):
        end = over.start()
    return f"{text[:start]}{text[end:]}".strip(), text[start:end].strip()
