"""Scripted servers in the dialects of other providers, with the scripts of openai_server.py.

Each translates requests into OpenAI's form, so that a test reads them the same way, and replies out of it, with the
limits, errors and names of its provider. They follow the public documentation of the Messages API (Anthropic),
generateContent (Gemini), /api/chat (Ollama) and vLLM's OpenAI-compatible server.
"""

from __future__ import annotations

import base64
import json
from collections.abc import Iterator, Mapping
from typing import Any, Final

from model_servers.openai_server import OpenAIServer, Reply, Request

Json = dict[str, Any]


class AnthropicServer(OpenAIServer):
    """POST /v1/messages. A call that was cut off has no arguments, and stop_reason max_tokens."""

    _STOPS: Final = {"stop": "end_turn", "length": "max_tokens", "tool_calls": "tool_use"}
    _ERRORS: Final = {
        400: "invalid_request_error",
        401: "authentication_error",
        404: "not_found_error",
        429: "rate_limit_error",
        529: "overloaded_error",
    }

    @property
    def url(self) -> str:
        return self.origin

    def accepts(self, path: str) -> bool:
        return path.split("?")[0].endswith("/v1/messages")

    def read(self, path: str, headers: Mapping[str, str], raw: Json) -> Request:
        system = raw.get("system") or ""
        texts = system if isinstance(system, str) else "\n".join(part["text"] for part in system)
        messages: list[Json] = [{"role": "system", "content": texts}] if texts else []
        messages += [{**m, "content": _anthropic_content(m["content"])} for m in raw.get("messages", ())]
        tools = [
            _function(tool["name"], tool.get("description", ""), tool["input_schema"]) for tool in raw.get("tools", ())
        ]
        return Request(path, headers, _body(raw["model"], messages, tools), raw)

    def write(self, reply: Reply, request: Request) -> Json:
        if reply.code != 200:
            kind = self._ERRORS.get(reply.code, "api_error")
            return {"type": "error", "error": {"type": kind, "message": _message_of(reply)}, "request_id": "req_test"}
        choice = _choice(reply)
        stop, blocks = self._STOPS[choice["finish_reason"]], []
        turn = len(self.requests)  # Ids are unique: Anthropic's client tells messages apart by them.
        message = choice["message"]
        if message.get("reasoning_content"):
            blocks.append({"type": "thinking", "thinking": message["reasoning_content"], "signature": "c2lnbmVk"})
        if message.get("content"):
            blocks.append({"type": "text", "text": message["content"]})
        for number, (name, arguments) in enumerate(_calls(message)):
            given = _object(arguments)
            stop = "max_tokens" if given is None else stop
            blocks.append({"type": "tool_use", "id": f"toolu_{turn}_{number}", "name": name, "input": given or {}})
        body: Json = {
            "id": f"msg_{turn}",
            "type": "message",
            "role": "assistant",
            "model": request.body["model"],
            "content": blocks,
            "stop_reason": stop,
            "stop_sequence": None,
        }
        tokens = _usage(reply)
        return body | ({"usage": {"input_tokens": tokens[0], "output_tokens": tokens[1]}} if tokens else {})


def _anthropic_content(content: str | list[Json]) -> list[Json]:
    """Return the parts of a message, including those within tool results."""
    parts: list[Json] = [{"type": "text", "text": content}] if isinstance(content, str) else content
    found: list[Json] = []
    for part in parts:
        if part["type"] == "tool_result":
            found += _anthropic_content(part.get("content") or "")
        elif part["type"] == "image":
            found.append(_picture(part["source"]["media_type"], part["source"]["data"]))
        else:
            found.append(part)
    return found


class GeminiServer(OpenAIServer):
    """POST /v1beta/models/NAME:generateContent. A call that is not JSON becomes MALFORMED_FUNCTION_CALL.

    The time to wait is in the body of an error, and not in a header.
    """

    _STOPS: Final = {"stop": "STOP", "length": "MAX_TOKENS", "tool_calls": "STOP"}
    _ERRORS: Final = {
        400: "INVALID_ARGUMENT",
        401: "UNAUTHENTICATED",
        403: "PERMISSION_DENIED",
        404: "NOT_FOUND",
        429: "RESOURCE_EXHAUSTED",
        500: "INTERNAL",
        503: "UNAVAILABLE",
    }

    @property
    def url(self) -> str:
        return f"{self.origin}/v1beta"

    def accepts(self, path: str) -> bool:
        return path.split("?")[0].endswith(":generateContent")

    def read(self, path: str, headers: Mapping[str, str], raw: Json) -> Request:
        system = raw.get("system_instruction") or raw.get("systemInstruction")
        messages = [{"role": "system", "content": _gemini_content(system["parts"])}] if system else []
        messages += [{"role": c["role"], "content": _gemini_content(c["parts"])} for c in raw["contents"]]
        declared = [one for tool in raw.get("tools", ()) for one in _either(tool, "function_declarations")]
        tools = [_function(one["name"], one.get("description", ""), _either(one, "parameters")) for one in declared]
        return Request(path, headers, _body("scripted", messages, tools), raw)

    def write(self, reply: Reply, request: Request) -> Json:
        if reply.code != 200:
            kind = self._ERRORS.get(reply.code, "INTERNAL")
            error = {"code": reply.code, "message": _message_of(reply), "status": kind}
            wait = reply.headers.get("Retry-After")
            hint = {"@type": "type.googleapis.com/google.rpc.RetryInfo", "retryDelay": f"{wait}s"}
            return {"error": error | ({"details": [hint]} if wait else {})}
        tokens = _usage(reply)
        names = ("promptTokenCount", "candidatesTokenCount", "totalTokenCount")
        counts = dict(zip(names, (*tokens, sum(tokens)), strict=True)) if tokens else {}
        body: Json = {"candidates": self._candidates(reply), "modelVersion": "scripted", "responseId": "test"}
        return body | ({"usageMetadata": counts} if counts else {})

    def headers(self, reply: Reply) -> Mapping[str, str]:
        return {name: value for name, value in reply.headers.items() if name != "Retry-After"}

    def _candidates(self, reply: Reply) -> list[Json]:
        if not reply.body["choices"]:
            return []
        choice = _choice(reply)
        message, parts = choice["message"], []
        if message.get("reasoning_content"):
            parts.append({"text": message["reasoning_content"], "thought": True})
        if message.get("content"):
            parts.append({"text": message["content"]})
        for name, arguments in _calls(message):
            given = _object(arguments)
            if given is None:
                return [{"finishReason": "MALFORMED_FUNCTION_CALL", "index": 0}]
            parts.append({"functionCall": {"name": name, "args": given}})
        stop = self._STOPS[choice["finish_reason"]]
        return [{"content": {"role": "model", "parts": parts}, "finishReason": stop, "index": 0}]


def _gemini_content(parts: list[Json]) -> list[Json]:
    found = []
    for part in parts:
        inline = part.get("inline_data") or part.get("inlineData")
        answered = _either(part, "function_response")
        if inline:
            # JSON of protocol buffers may hold base64 in either alphabet; Google's client uses the URL-safe one.
            data = inline["data"].translate(str.maketrans("-_", "+/"))
            found.append(_picture(inline.get("mime_type") or inline["mimeType"], data))
        elif answered:
            found.append({"type": "text", "text": json.dumps(answered["response"], ensure_ascii=False)})
        else:
            found.append({"type": "text", "text": part.get("text", "")})
    return found


class ResponsesServer(OpenAIServer):
    """POST /v1/responses, OpenAI's newer protocol with lists of items. Errors are those of chat completions."""

    def accepts(self, path: str) -> bool:
        return path.split("?")[0].endswith("/responses")

    def read(self, path: str, headers: Mapping[str, str], raw: Json) -> Request:
        given = raw["input"]
        items = [{"role": "user", "content": given}] if isinstance(given, str) else given
        system = [{"role": "system", "content": raw["instructions"]}] if raw.get("instructions") else []
        messages = [*system, *(_responses_message(item) for item in items)]
        tools = [
            _function(tool["name"], tool.get("description", ""), tool["parameters"]) for tool in raw.get("tools") or ()
        ]
        return Request(path, headers, _body(raw["model"], messages, tools), raw)

    def write(self, reply: Reply, request: Request) -> Json:
        if reply.code != 200:
            return reply.body
        message, output = _choice(reply)["message"], []
        if message.get("content"):
            said = {"type": "output_text", "text": message["content"], "annotations": []}
            about = {"type": "message", "id": "msg_0", "status": "completed", "role": "assistant"}
            output.append({**about, "content": [said]})
        for call in message.get("tool_calls") or ():
            about = {"type": "function_call", "id": f"fc_{call['id']}", "call_id": call["id"], "status": "completed"}
            output.append({**about, **call["function"]})
        tokens = _usage(reply) or (0, 0)
        return {
            "id": "resp_test",
            "object": "response",
            "created_at": 0,
            "status": "completed",
            "model": request.body["model"],
            "output": output,
            "parallel_tool_calls": True,
            "tool_choice": "auto",
            "tools": [],
            "usage": {
                "input_tokens": tokens[0],
                "input_tokens_details": {"cached_tokens": 0},
                "output_tokens": tokens[1],
                "output_tokens_details": {"reasoning_tokens": 0},
                "total_tokens": sum(tokens),
            },
        }


def _responses_message(item: Json) -> Json:
    """Return an item as a message; a function's output is a message of role `tool`."""
    content = item.get("content") or item.get("output") or ""
    parts = [{"type": "text", "text": content}] if isinstance(content, str) else content
    kinds = {"input_text": "text", "output_text": "text", "input_image": "image_url"}
    named = [{**part, "type": kinds.get(part["type"], part["type"])} for part in parts]
    shown = [
        {**part, "image_url": {"url": part["image_url"]}} if part["type"] == "image_url" else part for part in named
    ]
    return {"role": item.get("role", "tool"), "content": shown}


class OllamaServer(OpenAIServer):
    """POST /api/chat. It has no tool_choice; a call whose arguments are no object stays in the text."""

    @property
    def url(self) -> str:
        return self.origin

    def accepts(self, path: str) -> bool:
        return path.endswith("/api/chat")

    def read(self, path: str, headers: Mapping[str, str], raw: Json) -> Request:
        messages = [
            {"role": m["role"], "content": [{"type": "text", "text": m.get("content", "")}, *_ollama_pictures(m)]}
            for m in raw["messages"]
        ]
        body = _body(raw["model"], messages, raw.get("tools") or [])
        return Request(path, headers, body | ({"response_format": raw["format"]} if raw.get("format") else {}), raw)

    def write(self, reply: Reply, request: Request) -> Json:
        if reply.code != 200:
            return {"error": _message_of(reply)}
        choice = _choice(reply)
        said, message = choice["message"], {"role": "assistant", "content": choice["message"].get("content") or ""}
        if said.get("reasoning_content"):
            message["thinking"] = said["reasoning_content"]
        pairs = list(_calls(said))
        whole = [(name, given) for name, given in ((name, _object(text)) for name, text in pairs) if given is not None]
        message["content"] += "".join(text for _, text in pairs if _object(text) is None)
        if whole:
            message["tool_calls"] = [{"function": {"name": name, "arguments": given}} for name, given in whole]
        reason = "length" if choice["finish_reason"] == "length" else "stop"
        body: Json = {
            "model": request.body["model"],
            "created_at": "2026-01-01T00:00:00Z",
            "message": message,
            "done": True,
            "done_reason": reason,
        }
        tokens = _usage(reply)
        return body | ({"prompt_eval_count": tokens[0], "eval_count": tokens[1]} if tokens else {})


def _ollama_pictures(message: Json) -> list[Json]:
    return [_picture("image/jpeg", data) for data in message.get("images") or ()]


class VLLMServer(OpenAIServer):
    """OpenAI's protocol as vLLM speaks it: own error format, empty lists of calls, thoughts also in `reasoning`."""

    def write(self, reply: Reply, request: Request) -> Json:
        if reply.code != 200:
            kind = "BadRequestError" if reply.code == 400 else "InternalServerError"
            return {"error": {"message": _message_of(reply), "type": kind, "param": None, "code": reply.code}}
        body = super().write(reply, request)
        for choice in body["choices"]:
            thoughts = choice["message"].get("reasoning_content")
            choice["message"] = {
                "tool_calls": [],
                "function_call": None,
                "refusal": None,
                **choice["message"],
                "reasoning": thoughts,
                "reasoning_content": thoughts,
            }
            choice["stop_reason"] = None
        return {**body, "prompt_logprobs": None, "kv_transfer_params": None}


# -- between the forms -------------------------------------------------------------------------------------------------
def _body(model: str, messages: list[Json], tools: list[Json]) -> Json:
    return {"model": model, "messages": messages} | ({"tools": tools} if tools else {})


def _function(name: str, description: str, parameters: Json) -> Json:
    return {"type": "function", "function": {"name": name, "description": description, "parameters": parameters}}


def _picture(kind: str, data: str) -> Json:
    base64.b64decode(data, validate=True)
    return {"type": "image_url", "image_url": {"url": f"data:{kind};base64,{data}"}}


def _either(values: Json, snake: str) -> Any:
    """Return a field by its name in snake case or camel case; Gemini accepts both."""
    first, *rest = snake.split("_")
    return values.get(snake, values.get(first + "".join(word.title() for word in rest), {}))


def _choice(reply: Reply) -> Json:
    """Return the only choice, or an empty message for a reply without choices."""
    nothing = {"message": {"content": None}, "finish_reason": "stop"}
    return dict(next(iter(reply.body["choices"]), nothing))


def _calls(message: Json) -> Iterator[tuple[str, str]]:
    for call in message.get("tool_calls") or ():
        yield call["function"]["name"], call["function"]["arguments"]


def _object(arguments: str) -> Json | None:
    try:
        found = json.loads(arguments)
    except ValueError:
        return None
    return found if isinstance(found, dict) else None


def _usage(reply: Reply) -> tuple[int, int] | None:
    usage = reply.body.get("usage")
    return (usage["prompt_tokens"], usage["completion_tokens"]) if usage else None


def _message_of(reply: Reply) -> str:
    return str(reply.body["error"]["message"])
