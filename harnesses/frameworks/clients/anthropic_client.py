# /// script
# dependencies = ["anthropic==2.12.0"]
# dialect = "AnthropicServer"
# ///
"""Anthropic's client: its tool runner asks the model and calls the tools."""

import os

from anthropic import Anthropic

from humanclaw import Body

client = Anthropic(base_url=os.environ["MODEL_URL"], api_key="unused")
messages = [{"role": "user", "content": os.environ["TASK"]}]
with Body("house:0") as body:
    runner = client.beta.messages.tool_runner(
        model="scripted", max_tokens=1000, messages=messages, tools=body.tools("anthropic")
    )
    print(runner.until_done().content[0].text, body.step, "steps")
