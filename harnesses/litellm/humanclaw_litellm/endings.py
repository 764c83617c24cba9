"""How an answer ended, read from the reply itself: litellm turns most reasons into `stop` or `tool_calls`."""

from __future__ import annotations

from typing import Any, Final, Literal

Json = dict[str, Any]
Ending = Literal["", "whole", "length", "content_filter", "unreadable", "full", "failed"]
"""How an answer ended; empty if its dialect is unknown, and litellm's own reading counts."""
_ENDINGS: Final[dict[Ending, frozenset[str]]] = {
    "whole": frozenset(
        {
            "stop",
            "tool_call",
            "tool_calls",
            "function_call",
            "end_turn",
            "tool_use",
            "stop_sequence",
            "stop_string",
            "complete",
            "completed",
            "end",
            "eos",
            "eos_token",
        }
    ),
    "length": frozenset({"length", "max_tokens", "max_output_tokens", "model_length", "max_length"}),
    "content_filter": frozenset(
        {
            "content_filter",
            "content_filtered",
            "refusal",
            "sensitive",
            "safety",
            "recitation",
            "blocklist",
            "prohibited_content",
            "spii",
            "image_safety",
            "guardrail_intervened",
        }
    ),
    "unreadable": frozenset(
        {
            "malformed_function_call",
            "unexpected_tool_call",
            "too_many_tool_calls",
            "malformed_tool_use",
            "malformed_model_output",
        }
    ),
    "full": frozenset({"model_context_window_exceeded"}),
}
"""Reasons in small letters. An answer that ended for any other reason has failed."""


def ending_of(body: Json) -> Ending:
    """Return how the first answer in the body of a reply ended."""
    if choice := first_of(body, "choices"):
        return _of_chat(choice)
    if candidate := first_of(body, "candidates"):
        return _of_gemini(candidate)
    if body.get("object") == "response":
        return _of_responses(body)
    if "done" in body and "message" in body:  # Ollama; its older versions give no reason.
        return _named(body.get("done_reason", "stop")) if body["done"] is True else "failed"
    found = [body[key] for key in ("stop_reason", "stopReason", "finish_reason") if key in body]
    return _named(found[0]) if found else ""


def _of_chat(choice: Json) -> Ending:
    message = part_of(choice, "message")
    if message.get("refusal"):
        return "content_filter"
    return "failed" if message.get("error") else _named(choice.get("finish_reason"))


def _of_gemini(candidate: Json) -> Ending:
    ending = _named(candidate.get("finishReason"))
    parts = _parts(part_of(candidate, "content"), "parts")
    thought = any(part.get("thought") is True and "functionCall" in part for part in parts)
    return "unreadable" if thought and ending == "whole" else ending  # A call that the model only thinks of.


def _of_responses(body: Json) -> Ending:
    status = body.get("status")
    if status == "incomplete":
        ending = _named(part_of(body, "incomplete_details").get("reason"))
        return "failed" if ending == "whole" else ending
    items = _parts(body, "output")
    if status != "completed" or any(item.get("status") not in (None, "completed") for item in items):
        return "failed"
    said = [part for item in items for part in _parts(item, "content")]
    return "content_filter" if any(part.get("type") == "refusal" for part in said) else "whole"


def _named(reason: Any) -> Ending:
    word = reason.lower() if isinstance(reason, str) else ""
    return next((ending for ending, words in _ENDINGS.items() if word in words), "failed")


def first_of(body: Json, key: str) -> Json:
    """Return the first object of a list in a body; empty without one."""
    return next(iter(_parts(body, key)), {})


def part_of(body: Json, key: str) -> Json:
    """Return an object in a body; empty without one."""
    found = body.get(key)
    return found if isinstance(found, dict) else {}


def _parts(body: Json, key: str) -> list[Json]:
    found = body.get(key)
    return [part for part in found if isinstance(part, dict)] if isinstance(found, list) else []
