"""Servers in the dialects of other providers, with the scripts of openai_server.py.

Each translates requests into OpenAI's form, so that a test reads them the same way, and calls and texts out of it.
Faults, refusals and thoughts are in the words of the provider: replies.toml.
"""

from __future__ import annotations

import base64
import json
from collections.abc import Iterator, Mapping
from typing import Any

from model_servers.openai_server import OpenAIServer, Reply, Request

Json = dict[str, Any]


class AnthropicServer(OpenAIServer):
    """POST /v1/messages."""

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
        message, (read, written) = _answer(reply)
        turn = len(self.requests)  # Ids are unique: Anthropic's client tells messages apart by them.
        blocks: list[Json] = [{"type": "text", "text": message["content"]}] if message.get("content") else []
        for number, (name, given) in enumerate(_calls(message)):
            blocks.append({"type": "tool_use", "id": f"toolu_{turn}_{number}", "name": name, "input": given})
        return {
            "id": f"msg_{turn}",
            "type": "message",
            "role": "assistant",
            "model": request.body["model"],
            "content": blocks,
            "stop_reason": "tool_use" if message.get("tool_calls") else "end_turn",
            "stop_sequence": None,
            "usage": {"input_tokens": read, "output_tokens": written},
        }


def _anthropic_content(content: str | list[Json]) -> list[Json]:
    """Return the parts of a message, including those within tool results."""
    parts: list[Json] = [{"type": "text", "text": content}] if isinstance(content, str) else content
    pieces: list[Json] = []
    for part in parts:
        if part["type"] == "tool_result":
            pieces += _anthropic_content(part.get("content") or "")
        elif part["type"] == "image":
            pieces.append(_picture(part["source"]["media_type"], part["source"]["data"]))
        else:
            pieces.append(part)
    return pieces


class GeminiServer(OpenAIServer):
    """POST /v1beta/models/NAME:generateContent."""

    @property
    def url(self) -> str:
        return f"{self.origin}/v1beta"

    def accepts(self, path: str) -> bool:
        return path.split("?")[0].endswith(":generateContent")

    def read(self, path: str, headers: Mapping[str, str], raw: Json) -> Request:
        system = raw.get("system_instruction") or raw.get("systemInstruction")
        messages = [{"role": "system", "content": _gemini_content(system["parts"])}] if system else []
        messages += [{"role": c["role"], "content": _gemini_content(c["parts"])} for c in raw["contents"]]
        declared = [function for tool in raw.get("tools", ()) for function in _either(tool, "function_declarations")]
        tools = [_function(tool["name"], tool.get("description", ""), _either(tool, "parameters")) for tool in declared]
        return Request(path, headers, _body("scripted", messages, tools), raw)

    def write(self, reply: Reply, request: Request) -> Json:
        message, (read, written) = _answer(reply)
        parts: list[Json] = [{"text": message["content"]}] if message.get("content") else []
        parts += [{"functionCall": {"name": name, "args": given}} for name, given in _calls(message)]
        candidate = {"content": {"role": "model", "parts": parts}, "finishReason": "STOP", "index": 0}
        counts = {"promptTokenCount": read, "candidatesTokenCount": written, "totalTokenCount": read + written}
        return {"candidates": [candidate], "usageMetadata": counts, "modelVersion": "scripted", "responseId": "test"}


def _gemini_content(parts: list[Json]) -> list[Json]:
    pieces = []
    for part in parts:
        inline = part.get("inline_data") or part.get("inlineData")
        answered = _either(part, "function_response")
        if inline:
            # JSON of protocol buffers may hold base64 in either alphabet; Google's client uses the URL-safe one.
            data = inline["data"].translate(str.maketrans("-_", "+/"))
            pieces.append(_picture(inline.get("mime_type") or inline["mimeType"], data))
        elif answered:
            pieces.append({"type": "text", "text": json.dumps(answered["response"], ensure_ascii=False)})
        else:
            pieces.append({"type": "text", "text": part.get("text", "")})
    return pieces


class ResponsesServer(OpenAIServer):
    """POST /v1/responses, OpenAI's newer protocol with lists of items."""

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
        message, (read, written) = _answer(reply)
        output: list[Json] = []
        if message.get("content"):
            said = {"type": "output_text", "text": message["content"], "annotations": []}
            about = {"type": "message", "id": "msg_0", "status": "completed", "role": "assistant"}
            output.append({**about, "content": [said]})
        for call in message.get("tool_calls") or ():
            about = {"type": "function_call", "id": f"fc_{call['id']}", "call_id": call["id"], "status": "completed"}
            output.append({**about, **call["function"]})
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
                "input_tokens": read,
                "input_tokens_details": {"cached_tokens": 0},
                "output_tokens": written,
                "output_tokens_details": {"reasoning_tokens": 0},
                "total_tokens": read + written,
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
    """POST /api/chat, which has no tool_choice."""

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
        message, (read, written) = _answer(reply)
        called = [{"function": {"name": name, "arguments": given}} for name, given in _calls(message)]
        said = {"role": "assistant", "content": message.get("content") or ""}
        return {
            "model": request.body["model"],
            "created_at": "2026-01-01T00:00:00Z",
            "message": said | ({"tool_calls": called} if called else {}),
            "done": True,
            "done_reason": "stop",
            "prompt_eval_count": read,
            "eval_count": written,
        }


def _ollama_pictures(message: Json) -> list[Json]:
    return [_picture("image/jpeg", data) for data in message.get("images") or ()]


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


def _answer(reply: Reply) -> tuple[Json, tuple[int, int]]:
    """Return the message of a reply, and its tokens in and out."""
    usage = reply.body["usage"]
    return reply.body["choices"][0]["message"], (usage["prompt_tokens"], usage["completion_tokens"])


def _calls(message: Json) -> Iterator[tuple[str, Json]]:
    for call in message.get("tool_calls") or ():
        yield call["function"]["name"], json.loads(call["function"]["arguments"])
