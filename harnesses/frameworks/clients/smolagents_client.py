# /// script
# dependencies = ["smolagents[openai]==1.26.0"]
# ///
"""smolagents: its tool-calling agent asks the model and calls the tools; a callback shows the model the pictures."""

import os

from smolagents import OpenAIModel, ToolCallingAgent

from humanclaw import Body

model = OpenAIModel("scripted", api_base=os.environ["MODEL_URL"], api_key="unused")
with Body("house:0") as body:
    tools = body.tools("smolagents")
    agent = ToolCallingAgent(tools, model, step_callbacks=[tools.see], verbosity_level=0)
    print(agent.run(os.environ["TASK"]), body.step, "steps")
