"""How an answer ended and whose it is, read from replies in each provider's own words."""

import json

import pytest

from humanclaw_litellm.endings import ending_of, stranger_in
from humanclaw_litellm.replies import tidied


def chat(reason, **message):
    return {"choices": [{"message": message, "finish_reason": reason}]}


def gemini(reason, *parts):
    return {"candidates": [{"content": {"role": "model", "parts": list(parts)}, "finishReason": reason}]}


def responses(status, *output, **more):
    return {"object": "response", "status": status, "output": list(output), **more}


@pytest.mark.parametrize(
    ("reply", "ending"),
    [
        (chat("stop"), "whole"),
        (chat("tool_calls"), "whole"),
        (chat("max_tokens"), "length"),
        (chat("image_safety_error"), "content_filter"),
        (chat("stop", refusal="No."), "content_filter"),
        (chat("stop", error={"code": 502}), "failed"),
        (chat("model_context_window_exceeded"), "full"),
        (chat(None), "unknown"),
        (chat("banana"), "unknown"),
        (gemini("FINISH_REASON_STOP"), "whole"),
        (gemini("MALFORMED_FUNCTION_CALL"), "unreadable"),
        (gemini("STOP", {"thought": True, "functionCall": {}}), "unreadable"),
        (gemini("STOP", {"thought": True}, {"functionCall": {}}), "whole"),
        (gemini("MAX_TOKENS", {"thought": True, "functionCall": {}}), "length"),
        (responses("completed"), "whole"),
        (responses("in_progress"), "failed"),
        (responses("completed", {"status": "incomplete"}), "length"),
        (responses("completed", {"content": [{"type": "refusal"}]}), "content_filter"),
        (responses("incomplete", incomplete_details={"reason": "max_output_tokens"}), "length"),
        (responses("incomplete"), "failed"),
        ({"message": {}, "done": True, "done_reason": "length"}, "length"),
        ({"message": {}, "done": False}, "failed"),
        ({"stop_reason": "end_turn"}, "whole"),
        ({"stopReason": "guardrail_intervened"}, "content_filter"),
        ({"finish_reason": "COMPLETE"}, "whole"),
        ({"text": "of a dialect that nobody knows"}, ""),
    ],
)
def test_an_answer_ended_as_the_reply_says(reply, ending):
    assert ending_of(reply) == ending


@pytest.mark.parametrize(
    ("reply", "role"),
    [
        (chat("stop", role="assistant"), ""),
        (chat("stop", role="user"), "user"),
        (chat("stop"), ""),
        ({"candidates": [{"content": {"role": "function"}}]}, "function"),
        ({"message": {"role": "system"}, "done": True}, "system"),
        (responses("completed", {"role": "assistant"}, {"role": "developer"}), "developer"),
    ],
)
def test_an_answer_that_no_model_gave_is_known_by_its_role(reply, role):
    assert stranger_in(reply) == role


def test_only_messages_of_the_model_are_the_answer_of_a_response():
    def message(role, text):
        return {"type": "message", "role": role, "content": [{"type": "output_text", "text": text}]}

    items = [message("user", "Go."), message("assistant", "I"), message("assistant", "walk.")]
    theirs, own = json.loads(tidied(json.dumps(responses("completed", *items)).encode()))["output"]
    assert theirs == items[0]
    assert own["content"][0]["text"] == "I\nwalk."
