"""The plainest agent there is, for clients that bring none: ask the model, call the tool, until it calls none any
more."""

import json

from connection import MODEL, TASK
from openai import AsyncOpenAI


async def drive(tools, call):
    """tools: name, description and schema of each. call: awaits a tool's content. Returns the model's last words."""
    model = AsyncOpenAI(base_url=MODEL, api_key="unused")
    offered = [
        {"type": "function", "function": {"name": name, "description": description, "parameters": schema}}
        for name, description, schema in tools
    ]
    messages = [{"role": "user", "content": TASK}]
    while True:
        answer = (await model.chat.completions.create(model="scripted", messages=messages, tools=offered)).choices[0]
        if not answer.message.tool_calls:
            return answer.message.content
        messages.append(answer.message.model_dump(exclude_none=True))
        for wanted in answer.message.tool_calls:
            content = await call(wanted.function.name, json.loads(wanted.function.arguments))
            messages += shown(wanted.id, content)


def shown(number, content):
    """Yield a tool message of text, then a user message with the pictures, which more models read than pictures in a
    tool message."""
    words = "\n".join(part.text for part in content if part.type == "text")
    pictures = [part for part in content if part.type == "image"]
    wire = [part.model_dump(by_alias=True) for part in pictures]  # In Python the libraries' names differ.
    urls = [{"url": f"data:{part['mimeType']};base64,{part['data']}"} for part in wire]
    said = [{"role": "tool", "tool_call_id": number, "content": words}]
    return said + [{"role": "user", "content": [{"type": "image_url", "image_url": url}]} for url in urls]
