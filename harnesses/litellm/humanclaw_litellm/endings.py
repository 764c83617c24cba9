"""How an answer ended, read from the reply itself: litellm turns most reasons into `stop` or `tool_calls`."""

from __future__ import annotations

import re
from typing import Any, Final, Literal

Json = dict[str, Any]
Ending = Literal["", "unknown", "whole", "length", "content_filter", "unreadable", "full", "failed"]
"""How an answer ended. Empty if its dialect is unknown, and litellm's own reading counts."""
_ENDINGS: Final[dict[Ending, str]] = {
    "full": "contextwindowexceeded",
    "unreadable": "malformed|unexpectedtool|toomanytool",
    "content_filter": "filter|safety|sensitive|refus|recitation|block|prohibited|spii|guardrail|moderat",
    "failed": "error|fail|abort|cancel|interrupt|timeout|overload|insufficient|ratelimit|^(?:un)?load$|^other$",
    "length": "length|^max|limit|truncat|incomplete|^pause",
    "whole": "^(?:stop|end|eos|tool|function|complete)",
}
"""Parts of the reason, in small letters alone. The first line that fits counts: `image_safety_error` is a filter's."""
_OTHERS: Final = frozenset({"user", "system", "developer", "tool", "function"})
"""Roles of messages that no model writes."""


def ending_of(body: Json) -> Ending:
    """Return how the first answer in the body of a reply ended; `unknown` for no reason, and one never met before."""
    if choice := first_of(body, "choices"):
        return _of_chat(choice)
    if candidate := first_of(body, "candidates"):
        return _of_gemini(candidate)
    if body.get("object") == "response":
        return _of_responses(body)
    if "done" in body and "message" in body:  # Ollama
        return _named(body.get("done_reason")) if body["done"] is True else "failed"
    reasons = [body[key] for key in ("stop_reason", "stopReason", "finish_reason") if key in body]
    return _named(reasons[0]) if reasons else ""


def _of_chat(choice: Json) -> Ending:
    message = part_of(choice, "message")
    if message.get("refusal"):
        return "content_filter"
    return "failed" if message.get("error") else _named(choice.get("finish_reason"))


def _of_gemini(candidate: Json) -> Ending:
    ending = _named(candidate.get("finishReason"))
    parts = parts_of(part_of(candidate, "content"), "parts")
    thought = any(part.get("thought") is True and "functionCall" in part for part in parts)
    return "unreadable" if thought and ending in ("whole", "unknown") else ending  # The model only thinks of the call.


def _of_responses(body: Json) -> Ending:
    status, items = body.get("status"), parts_of(body, "output")
    if status == "incomplete":
        ending = _named(part_of(body, "incomplete_details").get("reason"))
        return "failed" if ending in ("whole", "unknown") else ending
    if status not in ("completed", None):  # in_progress and queued too: the answer is not there yet.
        return "failed"
    if any(item.get("status") in ("incomplete", "in_progress") for item in items):
        return "length"
    if any(item.get("type") == "custom_tool_call" for item in items):
        return "unreadable"  # Its input is free text, which litellm passes on as a function's arguments.
    said = [part for item in items for part in parts_of(item, "content")]
    return "content_filter" if any(part.get("type") == "refusal" for part in said) else _named(status)


def _named(reason: Any) -> Ending:
    word = re.sub("[^a-z]", "", reason.lower()).removeprefix("finishreason") if isinstance(reason, str) else ""
    return next((ending for ending, parts in _ENDINGS.items() if re.search(parts, word)), "unknown")


def stranger_in(body: Json) -> str:
    """Return the role of the first answer if it is not the model's; empty if it is, or if the reply names no role."""
    said = part_of(first_of(body, "choices"), "message") or part_of(first_of(body, "candidates"), "content")
    roles = [item.get("role") for item in (said or part_of(body, "message") or body, *parts_of(body, "output"))]
    return next((role for role in roles if role in _OTHERS), "")


def first_of(body: Json, key: str) -> Json:
    """Return the first object of a list in a body; empty without one."""
    return next(iter(parts_of(body, key)), {})


def part_of(body: Json, key: str) -> Json:
    """Return an object in a body; empty without one."""
    part = body.get(key)
    return part if isinstance(part, dict) else {}


def parts_of(body: Json, key: str) -> list[Json]:
    """Return the objects of a list in a body; empty without one."""
    listed = body.get(key)
    return [part for part in listed if isinstance(part, dict)] if isinstance(listed, list) else []
