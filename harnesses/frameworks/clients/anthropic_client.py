# /// script
# dependencies = ["anthropic==2.12.0"]
# dialect = "AnthropicServer"
# ways = ["body.tools"]
# ///
"""Anthropic's client: its tool runner asks the model and calls the tools."""

from anthropic import Anthropic
from connection import MODEL, TASK

from humanclaw import Body

client = Anthropic(base_url=MODEL, api_key="unused")
messages = [{"role": "user", "content": TASK}]
with Body("house:0") as body:
    runner = client.beta.messages.tool_runner(
        model="scripted", max_tokens=1000, messages=messages, tools=body.tools("anthropic")
    )
    print(runner.until_done().content[0].text, body.step, "steps")
