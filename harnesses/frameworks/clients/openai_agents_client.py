# /// script
# dependencies = ["openai-agents==0.24.0"]
# dialect = "ResponsesServer"
# ///
"""OpenAI's Agents SDK: its runner asks the model, by the Responses API as it does by default, and calls the tools."""

import os

from agents import Agent, OpenAIResponsesModel, Runner, set_tracing_disabled
from openai import AsyncOpenAI

from humanclaw import Body

set_tracing_disabled(True)
model = OpenAIResponsesModel("scripted", AsyncOpenAI(base_url=os.environ["MODEL_URL"], api_key="unused"))
with Body("house:0") as body:
    agent = Agent("walker", tools=body.tools("openai_agents"), model=model)
    print(Runner.run_sync(agent, os.environ["TASK"]).final_output, body.step, "steps")
