"""Replies in the form that litellm reads. Servers that follow OpenAI's protocol loosely differ in a few places."""

from __future__ import annotations

import json
import math
from typing import Any, Final

from humanclaw_litellm.endings import Json, first_of, part_of, parts_of

_SUCCESS: Final = frozenset({"0", "200", "ok", "success"})
"""Codes and messages of an `error` that reports none."""
_NOTHING: Final[Json] = {
    "id": "", "type": "message", "role": "assistant", "status": "completed",
    "content": [{"type": "output_text", "text": "", "annotations": []}],
}  # fmt: skip
"""An answer without words. litellm refuses a reply of the Responses API that holds thoughts alone."""
_THOUGHTS: Final = frozenset({"thinking", "reasoning"})
"""Types of content parts that hold thoughts."""


def tidied(content: bytes) -> bytes:
    """Return the content of a reply with one answer, its text as a string, and its counts as whole numbers.

    Content that is not a JSON object stays as it is.
    """
    try:
        body = json.loads(content)
        tidy = _tidied(body) if isinstance(body, dict) else body
        return content if tidy == body else json.dumps(tidy).encode()
    except (ValueError, RecursionError):
        return content


def _tidied(body: Json) -> Json:
    tidy = {key: value for key, value in body.items() if key != "usage"}
    for key in ("choices", "candidates"):
        if listed := parts_of(body, key):
            tidy[key] = [min(listed, key=_index)]
    if message := part_of(first_of(tidy, "choices"), "message"):
        tidy["choices"] = [{**tidy["choices"][0], "message": _as_text(message) | _split_off(body)}]
        if _reports_success(body.get("error")):
            del tidy["error"]
    if body.get("object") == "response" and (items := parts_of(body, "output")):
        tidy["output"] = _with_one_message(items)
    if isinstance(body.get("usage"), dict):
        tidy["usage"] = _counts(_as_openai(body["usage"]) if "choices" in body else body["usage"])
    return tidy


def _index(choice: Json) -> int:
    """Return the place of an answer: servers list several in any order."""
    index = choice.get("index")
    return index if isinstance(index, int) else 0


def _split_off(body: Json) -> Json:
    """Return the tool calls that the first choice ends with and another one holds: GitHub Copilot splits an answer."""
    first, *others = sorted(parts_of(body, "choices"), key=_index)
    if first.get("finish_reason") != "tool_calls" or part_of(first, "message").get("tool_calls"):
        return {}
    calls = [call for other in others for call in parts_of(part_of(other, "message"), "tool_calls")]
    return {"tool_calls": calls} if calls else {}


def _as_text(message: Json) -> Json:
    """Return a message whose content is a string, with thoughts among its parts as `reasoning_content`."""
    content = message.get("content")
    if not isinstance(content, list):
        return message
    thoughts = [part for part in content if isinstance(part, dict) and part.get("type") in _THOUGHTS]
    text = _text([part for part in content if part not in thoughts])
    return {"reasoning_content": _text(thoughts), **message, "content": text}


def _with_one_message(items: list[Json]) -> list[Json]:
    """Return output items of the Responses API with the whole answer in one message, since litellm may read the first
    text alone. Commentary is a thought: the model writes it on the way to its answer.
    """
    items = [_thought(item) if item.get("phase") == "commentary" else item for item in items]
    said = [item for item in items if item.get("type") == "message" and item.get("role") == "assistant"]
    rest = [item for item in items if item not in said]
    if not said:
        return [*rest, _NOTHING] if all(item.get("type") == "reasoning" for item in rest) else rest
    refusals = [part for item in said for part in parts_of(item, "content") if part.get("type") == "refusal"]
    text = {"type": "output_text", "text": "\n".join(_text(item.get("content")) for item in said), "annotations": []}
    return [*rest, {**said[-1], "content": [text, *refusals]}]


def _thought(message: Json) -> Json:
    """Return a message as a thought."""
    summary = {"type": "summary_text", "text": _text(message.get("content"))}
    return {"type": "reasoning", "id": message.get("id", ""), "summary": [summary]}


def _text(part: Any) -> str:
    """Return the text of content parts, however they nest."""
    if isinstance(part, list):
        return "".join(map(_text, part))
    if isinstance(part, dict):
        return next((_text(part[key]) for key in ("text", *_THOUGHTS) if key in part), "")
    return part if isinstance(part, str) else ""


def _as_openai(usage: Json) -> Json:
    """Return a usage of Chat Completions with OpenAI's names, and its cost as one number."""
    renamed = dict(usage)
    for name, other in (("prompt_tokens", "input_tokens"), ("completion_tokens", "output_tokens")):
        if other in renamed:
            renamed.setdefault(name, renamed[other])
    if "cached_tokens" in renamed:  # Kimi
        renamed.setdefault("prompt_tokens_details", {"cached_tokens": renamed["cached_tokens"]})
    return renamed | ({"cost": _cost(renamed)} if "cost" in renamed else {})


def _cost(usage: Json) -> Any:
    """Return the cost as a number; as it is, if it is none. With a key of the user's own, OpenRouter tells its fee, and
    the cost of the key beside it.
    """
    upstream = part_of(usage, "cost_details").get("upstream_inference_cost") if usage.get("is_byok") is True else None
    try:
        return usage["cost"] if isinstance(usage["cost"], bool) else float(usage["cost"]) + float(upstream or 0)
    except (TypeError, ValueError):
        return usage["cost"]


def _counts(usage: Json) -> Json:
    """Return a usage whose counts are whole numbers; without those that are none."""
    counts = {key: _whole(value) if key.endswith("tokens") else value for key, value in usage.items()}
    return {
        key: _counts(value) if isinstance(value, dict) else value for key, value in counts.items() if value is not None
    }


def _whole(count: Any) -> int | None:
    try:
        number = float(count)
    except (TypeError, ValueError):
        return None
    return int(number) if math.isfinite(number) else None


def _reports_success(fault: Any) -> bool:
    words = [fault.get(key) for key in ("code", "message")] if isinstance(fault, dict) else []
    return any(str(word).lower() in _SUCCESS for word in words)
