# /// script
# dependencies = ["pydantic-ai-slim[openai]==2.68.0"]
# ///
"""Pydantic AI: its agent asks the model and calls the tools."""

import os

from pydantic_ai import Agent
from pydantic_ai.models.openai import OpenAIChatModel
from pydantic_ai.providers.openai import OpenAIProvider

from humanclaw import Body

model = OpenAIChatModel("scripted", provider=OpenAIProvider(base_url=os.environ["MODEL_URL"], api_key="unused"))
with Body("house:0") as body:
    agent = Agent(model, tools=body.tools("pydantic_ai"))
    print(agent.run_sync(os.environ["TASK"]).output, body.step, "steps")
