# /// script
# dependencies = ["openai==3.54.0"]
# ways = ["body.tools"]
# ///
"""OpenAI's client: ask the model, answer its calls, until it has none."""

from connection import MODEL, TASK
from openai import OpenAI

from humanclaw import Body

client = OpenAI(base_url=MODEL, api_key="unused")
messages = [{"role": "user", "content": TASK}]
with Body("house:0") as body:
    tools = body.tools("openai")
    while True:
        answer = client.chat.completions.create(model="scripted", messages=messages, tools=tools).choices[0].message
        if not answer.tool_calls:
            break
        messages += [answer, *tools.answer(answer)]
    print(answer.content, body.step, "steps")
